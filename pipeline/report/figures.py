"""The figures of a report; each is inline SVG with a text that says what is to be seen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from pipeline.model.predict import free_angle_of_attack
from pipeline.model.sensitivity import sensitivities
from pipeline.model.steady import MAX_ANGLE_OF_ATTACK, steady_state, trim_at_pitch
from pipeline.report.compare import DIRECTIONS, density_of, floats
from pipeline.report.drawing import (
    FREE,
    HELD,
    INK,
    MEASURED,
    SENSOR,
    VOID,
    WIDTH,
    Array,
    Picture,
    canvas,
    clock,
    render,
    since,
    style,
)
from pipeline.vehicle import Vehicle

#: Marks with error bars beyond this many are drawn as an image.
MOST_MARKS = 400
LINES = ("-", "--", ":", "-.")
MARKERS = {-1: "v", 0: "s", 1: "^"}


def answer(parts: Sequence[Mapping[str, Any]]) -> Picture | None:
    """Return measured and predicted speed of each part of the mission side by side; None if there is no part.

    Parameters
    ----------
    parts
        Rows of `nominal.table`.
    """
    if not parts:
        return None
    things = (
        ("measured_speed", "measured", MEASURED, "o"),
        ("held_speed", "theory, measured pitch held", HELD, "D"),
        ("free_speed", "theory, pitch left free", FREE, "X"),
        ("sensor_speed", "speed sensor", SENSOR, "s"),
    )
    with style():
        figure = canvas(7.4, 1.5 + 0.85 * len(parts))
        axes = figure.subplots()
        seen: set[str] = set()
        for row, part in enumerate(parts):
            base = len(parts) - 1.0 - row
            if row % 2 == 0:
                axes.axhspan(base - 0.5, base + 0.5, color=VOID, alpha=0.10, linewidth=0)
            low, high = part["stable_speed_lower_m_s"], part["stable_speed_upper_m_s"]
            if math.isfinite(low) and math.isfinite(high):
                axes.plot([low, high], [base - 0.36] * 2, color=VOID, linewidth=4, solid_capstyle="butt",
                          label=None if "range" in seen else "stable range, (27), (28)")  # fmt: skip
                seen.add("range")
            for place, (key, label, colour, marker) in enumerate(things):
                value, std = part[f"{key}_m_s"], part[f"{key}_std_m_s"]
                if not math.isfinite(value):
                    continue
                axes.errorbar(
                    value, base + 0.3 - 0.17 * place, xerr=std if math.isfinite(std) else None, color=colour,
                    marker=marker, markersize=7, capsize=3, linestyle="none", label=None if key in seen else label,
                )  # fmt: skip
                seen.add(key)
            if not math.isfinite(part["measured_speed_m_s"]):
                axes.annotate(
                    part["measured_reason"], (0.01, base + 0.36), xycoords=("axes fraction", "data"), fontsize=8,
                    va="top", color=MEASURED,
                )  # fmt: skip
        axes.set_yticks(range(len(parts)), [_wrapped(part) for part in reversed(parts)])
        axes.set_ylim(-0.55, len(parts) - 0.45)
        axes.grid(axis="y", visible=False)
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("speed through water, m/s (bars: 1σ)")
        axes.set_xlim(left=0.0)
        handles, labels = axes.get_legend_handles_labels()
        order = sorted(range(len(labels)), key=lambda i: labels[i].startswith("stable"))
        figure.legend([handles[i] for i in order], [labels[i] for i in order], loc="outside upper center", ncols=2)
        svg = render(figure, "answer")
    words = [
        f"{part['name']}: measured {_value(part['measured_speed_m_s'])}, pitch held {_value(part['held_speed_m_s'])}, "
        f"pitch free {_value(part['free_speed_m_s'])} m/s"
        for part in parts
    ]
    caption = "Measured speed (blue) beside theory with the measured pitch held (orange diamonds)"
    if "free_speed" in seen:
        caption += " and with the pitch left free at α = −K_M0/K_M (purple crosses)"
    caption += ". Bars are 1σ"
    if "sensor_speed" in seen:
        caption += "; green squares: the speed sensor in the same blocks"
    if "range" in seen:
        caption += "; the grey bar is the stable range of the paper's inequalities with the pitch left free"
    return Picture(
        "answer",
        svg,
        "Speeds of each part of the mission, measured and by theory. " + "; ".join(words) + ".",
        caption + ".",
    )


def _wrapped(part: Mapping[str, Any]) -> str:
    settings = f"{part['net_buoyancy_N']:+.1f} N"
    if part["propeller_speed_rpm"]:
        settings += f", {part['propeller_speed_rpm']:.0f} rpm"
    if math.isfinite(part["pitch_deg"]):
        settings += f", {part['pitch_deg']:+.1f}°"
    return f"{part['name']}\n{settings}"


def curves(blocks: pd.DataFrame, vehicle: Vehicle, gps: tuple[float, float] | None) -> Picture | None:
    """Return the theory's V(α) and θ(α) with the measured blocks on them, as Figs. 4 to 7; None without theory."""
    used = blocks[blocks["used"].to_numpy(dtype=bool) & np.isfinite(floats(blocks, "net_buoyancy"))]
    groups = [group for _key, group in used.groupby(["direction", "powered"], sort=True)]
    with style():
        figure = canvas(WIDTH, 4.4)
        left, right = figure.subplots(1, 2)
        drawn = [
            label
            for group, line in zip(groups, LINES * 2, strict=False)
            if (label := _curve(left, right, group, vehicle, line, gps))
        ]
        if not drawn:
            return None
        free, _reason = free_angle_of_attack(vehicle)
        if math.isfinite(free):
            for axes in (left, right):
                axes.axvline(math.degrees(free), color=FREE, linewidth=1.0, label="α of the free pitch, −K_M0/K_M")
        for axes, label in ((left, "speed through water, m/s"), (right, "pitch, °")):
            axes.set_xlabel("angle of attack, °")
            axes.set_ylabel(label)
        left.set_ylim(bottom=0.0)
        low, high = right.get_ylim()
        right.set_ylim(max(low, -95.0), min(high, 95.0))
        handles, labels = left.get_legend_handles_labels()
        unique = dict(zip(labels, handles, strict=True))
        figure.legend(unique.values(), unique.keys(), loc="outside upper center", ncols=3)
        svg = render(figure, "curves")
    return Picture(
        "curves",
        svg,
        f"Speed and pitch against angle of attack by theory for {'; '.join(drawn)}, with the measured blocks.",
        "Theory's steady speed and pitch against angle of attack for the median net buoyancy and propeller speed flown "
        "(orange, band: 1σ of the coefficients) and the measured blocks (blue, bars: 1σ). In unpowered flight the "
        "measured angle of attack is taken from the same lift/drag ratio at the measured pitch, so the right panel "
        "agrees by construction; the left one does not.",
    )


def _curve(
    left: Axes, right: Axes, group: pd.DataFrame, vehicle: Vehicle, line: str, gps: tuple[float, float] | None
) -> str:
    """Draw one state flown; return its label, or "" where theory has nothing."""
    side, powered = int(group["direction"].iloc[0]), bool(group["powered"].iloc[0])
    force, density = float(np.median(floats(group, "net_buoyancy"))), float(np.median(density_of(group, vehicle)))
    turning = float(np.nanmedian(floats(group, "propeller_speed"))) if powered else 0.0
    pitch = float(np.nanmedian(floats(group, "pitch")))
    held = trim_at_pitch(vehicle, force, pitch, propeller_speed=turning, density=density)
    alpha_held, speed_held = float(held.angle_of_attack), float(held.speed)
    seen = floats(group, "angle_of_attack")
    centre = [value for value in (*seen, alpha_held) if math.isfinite(value)]
    if not centre:
        return ""
    limit = min(MAX_ANGLE_OF_ATTACK, max(math.radians(3.0), 2.2 * max(abs(value) for value in centre)))
    sign = float(np.sign(np.median(centre))) or 1.0
    alpha = (
        np.linspace(sign * math.radians(0.05), sign * limit, 160) if not powered else np.linspace(-limit, limit, 241)
    )
    theory = steady_state(vehicle, force, alpha, propeller_speed=turning, density=density)
    slopes = sensitivities(
        "fixed_alpha", vehicle, force, theory.speed, theory.path_angle, alpha, propeller_speed=turning, density=density
    )
    speed_std, pitch_std = np.zeros_like(alpha), np.zeros_like(alpha)
    for name in ("lift_at_zero", "lift_slope", "parasite_drag", "induced_drag"):
        sigma = float(np.nan_to_num(vehicle.std(name)))
        speed_std = np.hypot(speed_std, slopes[name].speed * sigma)
        pitch_std = np.hypot(pitch_std, slopes[name].path_angle * sigma)
    forward = np.abs(theory.pitch) <= 0.5 * math.pi
    x = np.degrees(alpha)
    label = f"theory, {DIRECTIONS[side]}, {force:+.1f} N" + (f", {60 * turning:.0f} rpm" if powered else "")
    for axes, value, std, factor in (
        (left, theory.speed, speed_std, 1.0),
        (right, theory.pitch, pitch_std, 180.0 / math.pi),
    ):
        drawn = np.where(forward, factor * value, np.nan)
        # Where two steady states meet the slopes go to infinity and say nothing of the band.
        width = np.where(speed_std < 0.5 * theory.speed, factor * std, np.nan)
        axes.plot(x, drawn, color=HELD, linestyle=line, label=label)
        axes.fill_between(x, drawn - width, drawn + width, color=HELD, alpha=0.18, linewidth=0)
    if math.isfinite(speed_held):
        for axes, height in ((left, speed_held), (right, math.degrees(pitch))):
            axes.plot(
                math.degrees(alpha_held), height, marker="D", markersize=7, color=HELD, linestyle="none",
                markeredgecolor=INK, label="theory, measured pitch held", zorder=4,
            )  # fmt: skip
    if np.isfinite(seen).any():
        look: dict[str, Any] = {
            "color": MEASURED, "marker": MARKERS[side], "markersize": 4, "linestyle": "none", "elinewidth": 0.6,
            "alpha": 0.75, "label": f"measured, {DIRECTIONS[side]}", "rasterized": len(group) > MOST_MARKS,
        }  # fmt: skip
        errors = np.degrees(floats(group, "angle_of_attack_std"))
        left.errorbar(np.degrees(seen), floats(group, "speed"), xerr=errors, yerr=floats(group, "speed_std"), **look)
        right.errorbar(
            np.degrees(seen), np.degrees(floats(group, "pitch")), xerr=errors,
            yerr=np.degrees(floats(group, "pitch_std")), **look,
        )  # fmt: skip
    if side == 0 and powered and gps is not None:
        left.axhspan(gps[0] - gps[1], gps[0] + gps[1], color=MEASURED, alpha=0.22, linewidth=0)
        left.axhline(gps[0], color=MEASURED, label="measured, GPS legs")
    return label.removeprefix("theory, ")


def agreement(comparison: pd.DataFrame) -> Picture | None:
    """Return measured against predicted speed of each block, and their difference against time; None without any."""
    kinds = (("speed", "kinematic speed", MEASURED), ("sensor_speed", "speed sensor", SENSOR))
    held = comparison[comparison["trim"] == "pitch"]
    chosen = [(held[held["quantity"] == kind], label, colour) for kind, label, colour in kinds]
    chosen = [(rows, label, colour) for rows, label, colour in chosen if len(rows)]
    if not chosen:
        return None
    start = min(float(floats(rows, "start_s").min()) for rows, _label, _colour in chosen)
    last = max(float(floats(rows, "end_s").max()) for rows, _label, _colour in chosen)
    unit = "days" if last - start > 3 * 86400.0 else "hours"
    with style():
        figure = canvas(WIDTH, 4.2)
        left, right = figure.subplots(1, 2, width_ratios=(1, 1.35))
        for rows, label, colour in chosen:
            middle = clock(0.5 * (floats(rows, "start_s") + floats(rows, "end_s")), start, unit)[0]
            for side, marker in MARKERS.items():
                here = rows["direction"].to_numpy() == side
                if not here.any():
                    continue
                look: dict[str, Any] = {
                    "color": colour, "marker": marker, "markersize": 4, "linestyle": "none", "elinewidth": 0.6,
                    "alpha": 0.8, "label": f"{label}, {DIRECTIONS[side]}", "rasterized": len(rows) > MOST_MARKS,
                }  # fmt: skip
                own = rows[here]
                left.errorbar(
                    floats(own, "predicted"), floats(own, "measured"), xerr=floats(own, "u_input"),
                    yerr=floats(own, "u_measured"), **look,
                )  # fmt: skip
                right.errorbar(middle[here], 100 * floats(own, "error"), yerr=100 * floats(own, "u_val"), **look)
        low, high = left.get_xlim()
        low, high = min(low, left.get_ylim()[0]), max(high, left.get_ylim()[1])
        left.plot([low, high], [low, high], color=INK, linewidth=0.9, linestyle="--", label="equal")
        left.set(xlim=(low, high), ylim=(low, high), aspect="equal")
        left.set_xlabel("predicted speed, m/s")
        left.set_ylabel("measured speed, m/s")
        right.axhline(0.0, color=INK, linewidth=0.9, linestyle="--")
        right.set_ylabel("E = predicted − measured, cm/s (bars: u_val)")
        right.set_xlabel(since(start, unit))
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=4)
        svg = render(figure, "agreement")
    count = sum(len(rows) for rows, _label, _colour in chosen)
    mean = float(np.mean(floats(chosen[0][0], "error")))
    return Picture(
        "agreement",
        svg,
        f"Predicted against measured speed in {count} comparisons; the mean difference is {100 * mean:+.1f} cm/s.",
        "Left: each steady block's measured speed against theory with the measured pitch held, with the 1σ of either "
        "side. Right: their difference against time with the validation uncertainty u_val, in which what both sides "
        "borrow from the polar is not counted twice.",
    )


def fitted(fit: Mapping[str, Any]) -> Picture | None:
    """Return the confidence ellipse of the two corrections with their prior, and residuals before and after."""
    if fit["reason"] or len(fit["parameters"]) != 2:
        return None
    first, second = fit["parameters"]
    residuals = fit["residuals"]
    time = np.asarray(residuals["time_s"], dtype=np.float64)
    unit = "days" if time[-1] - time[0] > 3 * 86400.0 else "hours"
    with style():
        figure = canvas(WIDTH, 4.2)
        left, right = figure.subplots(1, 2, width_ratios=(1, 1.35))
        centre = np.array([first["value"], second["value"]])
        covariance = np.asarray(fit["covariance"], dtype=np.float64)
        for scale, alpha, label in ((2.4477, 0.15, "data alone, 95 %"), (1.5096, 0.3, "data alone, 68 %")):
            left.fill(*_ellipse(centre, covariance, scale), color=MEASURED, alpha=alpha, linewidth=0, label=label)
        left.plot(*centre, marker="o", color=MEASURED, linestyle="none")
        with_prior = [item["value_with_prior"] for item in (first, second)]
        left.plot(*with_prior, marker="P", markersize=8, color=HELD, linestyle="none", label="with prior")
        prior = np.array([first["prior_std"], second["prior_std"]])
        if np.all(np.isfinite(prior)):
            left.plot(
                *_ellipse(np.zeros(2), np.diag(prior**2), 2.4477), color=VOID, linestyle="--", label="prior, 95 %"
            )
        left.axhline(0.0, color=INK, linewidth=0.6)
        left.axvline(0.0, color=INK, linewidth=0.6)
        left.set_xlabel(f"{first['symbol']}, {first['unit']}")
        left.set_ylabel(f"{second['symbol']}, {second['unit']}")
        hours = clock(time, float(time[0]), unit)[0]
        for key, colour, marker, label in (
            ("before_m_s", VOID, "o", "before"),
            ("after_m_s", MEASURED, "D", "after"),
        ):
            values = 100 * np.asarray(residuals[key], dtype=np.float64)
            errors = 100 * np.asarray(residuals["std_m_s"], dtype=np.float64) if key == "after_m_s" else None
            label = f"{label}, RMS {np.sqrt(np.mean(values**2)):.2f} cm/s"
            right.errorbar(
                hours, values, yerr=errors, color=colour, marker=marker, markersize=4, linestyle="none",
                elinewidth=0.6, alpha=0.85, rasterized=time.size > MOST_MARKS, label=label,
            )  # fmt: skip
        right.axhline(0.0, color=INK, linewidth=0.9, linestyle="--")
        right.set_ylabel("measured − predicted depth rate, cm/s")
        right.set_xlabel(since(float(time[0]), unit))
        left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
        right.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
        svg = render(figure, "fit")
    return Picture(
        "fit",
        svg,
        f"Confidence ellipse of {first['symbol']} = {first['value']:+.3f} ± {first['std']:.3f} {first['unit']} and "
        f"{second['symbol']} = {second['value']:+.3f} ± {second['std']:.3f} {second['unit']}; residuals of the depth "
        "rate before and after the corrections.",
        "Left: what the data alone say of the two corrections (ellipses), the vehicle file's prior (dashed) and both "
        "together (orange cross). Right: depth rate of each block, measured less predicted, before and after the "
        "corrections, with the 1σ of measurement and moving water.",
    )


def _ellipse(centre: Array, covariance: Array, scale: float) -> tuple[Array, Array]:
    """Return the points of the ellipse of `scale` standard deviations."""
    angle = np.linspace(0.0, 2.0 * math.pi, 181)
    values, vectors = np.linalg.eigh(covariance)
    circle = np.sqrt(np.maximum(values, 0.0))[:, np.newaxis] * np.stack([np.cos(angle), np.sin(angle)])
    points = centre[:, np.newaxis] + scale * vectors @ circle
    return points[0], points[1]


def _value(number: float) -> str:
    return f"{number:.3f}" if math.isfinite(number) else "unknown"

"""Measured blocks on the curves of the theory, as Figs. 4 to 7 of the paper."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from pipeline.model.predict import free_angle_of_attack
from pipeline.model.sensitivity import sensitivities
from pipeline.model.steady import MAX_ANGLE_OF_ATTACK, steady_state, trim_at_pitch
from pipeline.report.compare import DIRECTIONS, density_of, floats
from pipeline.report.figures.drawing import (
    FREE,
    HELD,
    INK,
    MARKERS,
    MEASURED,
    MOST_MARKS,
    WIDTH,
    Picture,
    canvas,
    render,
    style,
)
from pipeline.vehicle import Vehicle

LINES = ("-", "--", ":", "-.")


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

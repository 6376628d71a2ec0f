"""Measured blocks on the curves of the theory, as Figs. 4 to 7 of the paper."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from pipeline.model.case import driven
from pipeline.model.predict import free_angle_of_attack
from pipeline.model.sensitivity import sensitivities
from pipeline.model.steady import MAX_ANGLE_OF_ATTACK, steady_state, trim_at_pitch
from pipeline.records import Column
from pipeline.report.compare import DIRECTIONS, density_of, floats
from pipeline.report.figures.drawing import (
    FREE,
    HELD,
    INK,
    MARKERS,
    MEASURED,
    MOST_MARKS,
    WIDTH,
    Array,
    Drawn,
    Picture,
    canvas,
    picture,
    style,
)
from pipeline.report.propulsion import setting
from pipeline.report.rounding import signed
from pipeline.vehicle import Vehicle

LINES = ("-", "--", ":", "-.")
#: The panels: what is drawn against angle of attack, its factor from SI, and its axis.
PANELS = (
    ("speed", 1.0, "speed through water, m/s"),
    ("pitch", 180.0 / math.pi, "pitch θ, °"),
    ("path_angle", 180.0 / math.pi, "path angle γ, °"),
)
COLUMNS = (
    Column("kind", "", "theory: a curve; held: the measured pitch held; measured: a block", "string"),
    Column("flight", "", "state flown: direction, net buoyancy, propeller", "string"),
    Column("angle_of_attack", "rad", "angle of attack, flow from below positive"),
    Column("angle_of_attack_std", "rad", "1-sigma of angle_of_attack, measured blocks only"),
    Column("speed", "m/s", "speed through water"),
    Column("speed_std", "m/s", "1-sigma of speed; of a curve that of the polar's coefficients"),
    Column("pitch", "rad", "pitch, nose up positive"),
    Column("pitch_std", "rad", "1-sigma of pitch"),
    Column("path_angle", "rad", "flight-path angle, climbing positive"),
    Column("path_angle_std", "rad", "1-sigma of path_angle"),
)


class State(NamedTuple):
    """One state flown: what theory gives over angle of attack, at the measured pitch, and what was measured."""

    label: str
    side: int
    powered: bool
    theory: pd.DataFrame
    held: pd.DataFrame
    measured: pd.DataFrame


def curves(blocks: pd.DataFrame, vehicle: Vehicle, gps: tuple[float, float] | None) -> Picture | None:
    """Return the theory's V(α), θ(α) and γ(α) with the measured blocks on them; None where theory has nothing.

    Parameters
    ----------
    blocks
        Table `records.BLOCKS`.
    vehicle
        Coefficients with their 1-sigma.
    gps
        Speed of level powered flight by GPS and its 1-sigma, m/s, where known.
    """
    used = blocks[blocks["used"].to_numpy(dtype=bool) & np.isfinite(floats(blocks, "net_buoyancy"))]
    groups = [group for _key, group in used.groupby(["direction", "powered"], sort=True)]
    states = [state for group in groups if (state := _state(group, vehicle)) is not None]
    if not states:
        return None
    with style():
        figure = canvas(WIDTH, 4.4)
        axes = list(figure.subplots(1, len(PANELS)))
        for state, line in zip(states, LINES * 2, strict=False):
            for own, (name, factor, _label) in zip(axes, PANELS, strict=True):
                _draw(own, state, name, factor, line)
            if state.side == 0 and state.powered and gps is not None:
                axes[0].axhspan(gps[0] - gps[1], gps[0] + gps[1], color=MEASURED, alpha=0.22, linewidth=0)
                axes[0].axhline(gps[0], color=MEASURED, label="measured, GPS legs")
        free, _reason = free_angle_of_attack(vehicle)
        for own, (_name, _factor, label) in zip(axes, PANELS, strict=True):
            if math.isfinite(free):
                own.axvline(math.degrees(free), color=FREE, linewidth=1.0, label="α of the free pitch, −K_M0/K_M")
            own.set_xlabel("angle of attack α, °")
            own.set_ylabel(label)
        axes[0].set_ylim(bottom=0.0)
        for own in axes[1:]:
            low, high = own.get_ylim()
            own.set_ylim(max(low, -95.0), min(high, 95.0))
        handles, labels = axes[0].get_legend_handles_labels()
        unique = dict(zip(labels, handles, strict=True))
        figure.legend(unique.values(), unique.keys(), loc="outside upper center", ncols=3)
        return picture(
            figure,
            "curves",
            "Speed, pitch and path angle against angle of attack by theory for "
            f"{'; '.join(state.label for state in states)}, with the measured blocks.",
            "Theory's steady speed, pitch and path angle against angle of attack for the median net buoyancy and "
            "propeller speed flown (orange, band: 1σ of the coefficients) and the measured blocks (blue, bars: 1σ). In "
            "unpowered flight the measured angle of attack is taken from the same lift/drag ratio at the measured "
            "pitch, so pitch and path angle agree by construction; the speed does not.",
            _table(states),
        )


def _state(group: pd.DataFrame, vehicle: Vehicle) -> State | None:
    """Return one state flown, or None where neither theory nor measurement has an angle of attack."""
    side, powered = int(group["direction"].iloc[0]), bool(group["powered"].iloc[0])
    force, density = float(np.median(floats(group, "net_buoyancy"))), float(np.median(density_of(group, vehicle)))
    logged = driven(
        vehicle,
        group["powered"].to_numpy(dtype=bool),
        *(floats(group, f"propeller_{name}") for name in ("speed", "power")),
    )
    turning, power = (_middle(values) for values in logged)
    pitch = float(np.nanmedian(floats(group, "pitch")))
    held = trim_at_pitch(vehicle, force, pitch, propeller_speed=turning, propeller_power=power, density=density)
    centre = [value for value in (*floats(group, "angle_of_attack"), float(held.angle_of_attack)) if np.isfinite(value)]
    if not centre:
        return None
    names = ["angle_of_attack", "speed", "pitch", "path_angle"]
    names += [f"{name}_std" for name in names]
    at_pitch = {
        "angle_of_attack": [float(held.angle_of_attack)],
        "speed": [float(held.speed)],
        "pitch": [pitch],
        "path_angle": [pitch - float(held.angle_of_attack)],
    }
    driving = setting(60.0 * turning, power)
    return State(
        DIRECTIONS[side] + f", {signed(force)} N" + (f", {driving}" if driving else ""),
        side,
        powered,
        _curve(vehicle, _angles(centre, powered=powered), force, turning, power, density),
        pd.DataFrame(at_pitch)[np.isfinite(at_pitch["speed"])],
        group.loc[np.isfinite(floats(group, "angle_of_attack")), names],
    )


def _middle(values: Array) -> float:
    """Return the median of the finite `values`, NaN without any."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else math.nan


def _angles(centre: Sequence[float], *, powered: bool) -> Array:
    """Return the angles of attack of a curve about those flown, rad: of one sign where there is no thrust."""
    limit = min(MAX_ANGLE_OF_ATTACK, max(math.radians(3.0), 2.2 * max(abs(value) for value in centre)))
    if powered:
        return np.linspace(-limit, limit, 241)
    sign = float(np.sign(np.median(centre))) or 1.0
    return np.linspace(sign * math.radians(0.05), sign * limit, 160)


def _curve(vehicle: Vehicle, alpha: Array, force: float, turning: float, power: float, density: float) -> pd.DataFrame:
    """Return the theory over angle of attack with the 1-sigma of the polar, NaN where it would fly backwards."""
    theory = steady_state(vehicle, force, alpha, propeller_speed=turning, propeller_power=power, density=density)
    slopes = sensitivities(
        "fixed_alpha",
        vehicle,
        force,
        theory.speed,
        theory.path_angle,
        alpha,
        propeller_speed=turning,
        propeller_power=power,
        density=density,
    )
    speed_std, angle_std = np.zeros_like(alpha), np.zeros_like(alpha)
    for name in ("lift_at_zero", "lift_slope", "parasite_drag", "induced_drag"):
        sigma = float(np.nan_to_num(vehicle.std(name)))
        speed_std = np.hypot(speed_std, slopes[name].speed * sigma)
        angle_std = np.hypot(angle_std, slopes[name].path_angle * sigma)
    forward = np.abs(theory.pitch) <= 0.5 * math.pi
    # Where two steady states meet the slopes go to infinity and say nothing of the band.
    told = forward & (speed_std < 0.5 * theory.speed)
    columns = {"speed": theory.speed, "pitch": theory.pitch, "path_angle": theory.path_angle}
    frame = pd.DataFrame({name: np.where(forward, value, np.nan) for name, value in columns.items()})
    frame["angle_of_attack"] = alpha
    frame["speed_std"] = np.where(told, speed_std, np.nan)
    frame["pitch_std"] = frame["path_angle_std"] = np.where(told, angle_std, np.nan)
    return frame


def _draw(axes: Axes, state: State, name: str, factor: float, line: str) -> None:
    """Draw one state into one panel."""
    x, y = np.degrees(floats(state.theory, "angle_of_attack")), factor * floats(state.theory, name)
    band = factor * floats(state.theory, f"{name}_std")
    axes.plot(x, y, color=HELD, linestyle=line, label=f"theory, {state.label}")
    axes.fill_between(x, y - band, y + band, color=HELD, alpha=0.18, linewidth=0)
    axes.plot(
        np.degrees(floats(state.held, "angle_of_attack")), factor * floats(state.held, name), marker="D", markersize=7,
        color=HELD, linestyle="none", markeredgecolor=INK, label="theory, measured pitch held", zorder=4,
    )  # fmt: skip
    if len(state.measured):
        look: dict[str, Any] = {
            "color": MEASURED, "marker": MARKERS[state.side], "markersize": 4, "linestyle": "none", "elinewidth": 0.6,
            "alpha": 0.75, "label": f"measured, {DIRECTIONS[state.side]}",
            "rasterized": len(state.measured) > MOST_MARKS,
        }  # fmt: skip
        axes.errorbar(
            np.degrees(floats(state.measured, "angle_of_attack")),
            factor * floats(state.measured, name),
            xerr=np.degrees(floats(state.measured, "angle_of_attack_std")),
            yerr=factor * floats(state.measured, f"{name}_std"),
            **look,
        )


def _table(states: Sequence[State]) -> Drawn:
    frames = [
        frame.assign(kind=kind, flight=state.label)
        for state in states
        for kind, frame in (("theory", state.theory), ("held", state.held), ("measured", state.measured))
        if len(frame)
    ]
    return Drawn(pd.concat(frames), COLUMNS)

"""Whether what was flown is stable: the paper's range of speeds, and which disturbances the theory survives."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from pipeline.model.attraction import CONVERGED, Attraction, attraction
from pipeline.model.case import driven
from pipeline.model.modes import Equilibrium, equilibrium
from pipeline.records import Column
from pipeline.report.compare import DIRECTIONS, density_of, floats
from pipeline.report.figures.drawing import (
    FAINT,
    HELD,
    INK,
    MARKERS,
    MEASURED,
    MOST_MARKS,
    VOID,
    WIDTH,
    Array,
    Drawn,
    Picture,
    canvas,
    picture,
    style,
)
from pipeline.report.rounding import counted, signed
from pipeline.vehicle import Vehicle

COLUMNS = (
    Column("block", "", "number of the block", "int32"),
    Column("direction", "", "-1 down, +1 up, 0 level", "int8"),
    Column("powered", "", "propeller turning", "bool"),
    Column("pitch", "rad", "measured pitch, nose up positive"),
    Column("speed", "m/s", "measured speed, kinematic"),
    Column("speed_std", "m/s", "1-sigma of speed"),
    Column("path_angle", "rad", "measured flight-path angle"),
    Column("speed_theory", "m/s", "speed by theory, measured pitch held"),
    Column("speed_lower", "m/s", "lower bound of the stable range, Eq. (27)"),
    Column("speed_upper", "m/s", "upper bound of the stable range, Eq. (28)"),
)
#: Deviations V̄ and γ̄ [rad] of the map, and starts along each side.
FASTEST, STEEPEST, STARTS = (-0.9, 1.5), math.radians(60.0), 48


class Flown(NamedTuple):
    """The state flown most: what it is called, its steady flight and its blocks."""

    label: str
    state: Equilibrium
    blocks: pd.DataFrame


def stability(blocks: pd.DataFrame, predictions: pd.DataFrame, vehicle: Vehicle) -> Picture | None:
    """Return measured speeds in the paper's stable range, and flown deviations in the region of attraction.

    Parameters
    ----------
    blocks, predictions
        Tables `records.BLOCKS` and `records.PREDICTIONS`; None is returned where theory has no steady flight.
    vehicle
        Coefficients.
    """
    held = predictions[predictions["trim"] == "pitch"]
    both = blocks[blocks["used"].to_numpy(dtype=bool)].merge(held, on="block", suffixes=("", "_theory"))
    both = both[np.isfinite(floats(both, "speed_theory"))]
    if both.empty:
        return None
    flown = _flown(both, vehicle)
    with style():
        figure = canvas(WIDTH, 4.4)
        panels = figure.subplots(1, 1 if flown.state.reason else 2, squeeze=False)[0]
        _range(panels[0], both)
        if flown.state.reason:
            region = f"The region of attraction is not known: {flown.state.reason}."
            dies = region
        else:
            share = 100.0 * _region(panels[1], flown).share
            dies = f"Of the disturbances tried about {flown.label}, {share:.0f} % die out."
            region = (
                f"Right: {flown.label} by theory, trimmed at the measured pitch; disturbances of speed and path angle "
                "that die out within 300 s (shaded, by simulation of the borrowed dynamics with battery and righting "
                "moment held) and the blocks as flown (blue), as deviations from it."
            )
        figure.legend(loc="outside lower center", ncols=3)
        return picture(
            figure,
            "stability",
            f"Measured speed of {counted(len(both), 'block')} and the stable range of each. {dies}",
            f"{'Measured' if flown.state.reason else 'Left: measured'} speed (blue, 1σ) of each block, theory with "
            "the measured pitch held (orange) and the paper's stable range, Eqs. (27) and (28), at the block's net "
            f"buoyancy and thrust with the measured pitch held (grey): theory that borrows all coefficients. {region}",
            Drawn(both[[column.name for column in COLUMNS]], COLUMNS),
        )


def _flown(both: pd.DataFrame, vehicle: Vehicle) -> Flown:
    """Return the state that most blocks were flown in, unpowered before powered."""
    groups = [group for _key, group in both.groupby(["powered", "direction"], sort=True)]
    group = max(groups, key=len)
    powered = bool(group["powered"].iloc[0])
    force = float(np.nanmedian(floats(group, "net_buoyancy")))
    turning = group["powered"].to_numpy(dtype=bool)
    speed, power = driven(vehicle, turning, floats(group, "propeller_speed"), floats(group, "propeller_power"))
    state = equilibrium(
        vehicle,
        force,
        pitch=float(np.nanmedian(floats(group, "pitch"))),
        propeller_speed=float(np.median(speed)) or None,
        propeller_power=float(np.median(power)) or None,
        density=float(np.median(density_of(group, vehicle))),
        moment_sin=vehicle["righting_moment"],
    )
    label = f"the median of {DIRECTIONS[int(group['direction'].iloc[0])]}{' under propeller' if powered else ''}"
    return Flown(f"{label}, {signed(force)} N", state, group)


def _range(axes: Axes, both: pd.DataFrame) -> None:
    many = len(both) > MOST_MARKS
    pitch = np.degrees(floats(both, "pitch"))
    low, high = floats(both, "speed_lower"), floats(both, "speed_upper")
    known = np.isfinite(low) & np.isfinite(high)
    if known.any():
        axes.vlines(pitch[known], low[known], high[known], color=VOID, linewidth=2.5, alpha=0.35, rasterized=many,
                    label="stable range, (27), (28)")  # fmt: skip
    axes.plot(pitch, floats(both, "speed_theory"), "D", color=HELD, markersize=4, linestyle="none", rasterized=many,
              label="theory, measured pitch held")  # fmt: skip
    speed = floats(both, "speed")
    if np.isfinite(speed).any():
        axes.errorbar(pitch, speed, yerr=floats(both, "speed_std"), color=MEASURED, marker="o", markersize=4,
                      elinewidth=0.6, linestyle="none", rasterized=many, label="measured")  # fmt: skip
    axes.set(xlabel="measured pitch, °", ylabel="speed through water, m/s", title="stable range of speeds")


def _region(axes: Axes, flown: Flown) -> Attraction:
    """Draw which disturbances die out, and what was flown, and return the former."""
    axes.set(title="region of attraction", xlabel="speed over that of steady flight, V/V_e − 1")
    axes.set_ylabel("path angle less that of steady flight, °")
    speed, angle = np.linspace(*FASTEST, STARTS), np.linspace(-STEEPEST, STEEPEST, STARTS)
    ends = attraction(flown.state, speed=speed[None, :], path_angle=angle[:, None], workers=1)
    axes.pcolormesh(
        speed, np.degrees(angle), ends.verdict == CONVERGED, cmap=ListedColormap([FAINT, HELD]), vmin=0, vmax=1,
        alpha=0.3, shading="nearest", rasterized=True,
    )  # fmt: skip
    axes.fill([], [], color=HELD, alpha=0.3, linewidth=0, label="dies out (simulated)")
    axes.fill([], [], color=FAINT, linewidth=0, label="does not")
    if ends.reason:
        axes.set_title(ends.reason, fontsize=8.0, loc="right", fontweight="normal")
    flight = flown.state.flight
    seen: Array = floats(flown.blocks, "speed") / flight.speed - 1.0
    path = np.degrees(floats(flown.blocks, "path_angle") - flight.path_angle)
    side = int(flown.blocks["direction"].iloc[0])
    axes.plot(seen, path, MARKERS[side], color=MEASURED, markersize=4, linestyle="none",
              rasterized=seen.size > MOST_MARKS)  # fmt: skip
    axes.plot(0.0, 0.0, "+", color=INK, markersize=10)
    axes.set(xlim=FASTEST, ylim=(-math.degrees(STEEPEST), math.degrees(STEEPEST)))
    return ends

"""Plausibility: do depth and pitch together mean a speed that a glider can have? Catches units declared wrongly.

A glider that moves along its nose at U changes depth by U |sin pitch| a second. Gliders fly at 0.2 to 2 m/s; bar read
as dbar makes them ten times too slow, dbar read as bar ten times too fast, whatever the mission.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.findings import Finding, InputError
from pipeline.ingest.seawater import good

Array = npt.NDArray[np.float64]

SLOWEST, FASTEST = 0.12, 2.2  # m/s through the water that a glider can have
_WINDOW = 60.0  # s over which depth rate and pitch are compared
_STEEP = math.radians(10.0)
_MOVING = 0.03  # m/s
_MIDDLE = (0.2, 0.85)  # share of the deepest pressure: away from surface and turning points
_LEAST = 8  # windows


def implied_speed(table: pd.DataFrame) -> tuple[Array, Array, Array]:
    """Return depth rate [m/s, + down], mean pitch [rad] and the speed that they imply [m/s], one for each minute.

    Parameters
    ----------
    table
        ``time`` [s], ``depth`` [m] (as good as ``pressure_qc``) and ``pitch`` [rad], each on its own rows.

    Returns
    -------
    rate, pitch, speed
        Shape (minutes,): only those inside the middle of the water column with both instruments reporting.
    """
    time = table["time"].to_numpy(dtype=np.float64)
    depth = np.where(np.isfinite(good(table, "pressure")), table["depth"].to_numpy(dtype=np.float64), np.nan)
    pitch = good(table, "pitch")
    known = np.isfinite(depth)
    if known.sum() < 2 or not np.isfinite(pitch).any():
        return np.zeros(0), np.zeros(0), np.zeros(0)
    minute = ((time - time[0]) // _WINDOW).astype(np.int64)
    first = np.flatnonzero(np.diff(minute[known], prepend=-1))
    knots, depths = time[known][first], depth[known][first]
    length = np.diff(knots)
    near = (length > 0.5 * _WINDOW) & (length < 5 * _WINDOW)
    rate = np.diff(depths)[near] / length[near]
    middle = (0.5 * (depths[1:] + depths[:-1]))[near]
    tilt = np.isfinite(pitch)
    total = np.r_[0.0, np.cumsum(pitch[tilt])]
    begin, end = (np.searchsorted(time[tilt], edges) for edges in (knots[:-1][near], knots[1:][near]))
    count = end - begin
    mean = (total[end] - total[begin]) / np.maximum(count, 1)
    deepest = float(np.percentile(depth[known], 99))
    use = (count > 0) & (middle > _MIDDLE[0] * deepest) & (middle < _MIDDLE[1] * deepest)
    with np.errstate(divide="ignore"):
        speed = np.abs(rate[use]) / np.abs(np.sin(mean[use]))
    return rate[use], mean[use], speed


def checked(table: pd.DataFrame, pressure_source: dict[str, str], pitch_source: dict[str, str]) -> list[Finding]:
    """Return what is doubtful about pressure and pitch taken together.

    Parameters
    ----------
    table
        The merged records, with depth.
    pressure_source, pitch_source
        ``file`` and ``column`` for messages.

    Raises
    ------
    InputError
        If the speed implied is one that no glider has.
    """
    rate, pitch, speed = implied_speed(table)
    steep, moving = np.abs(pitch) >= _STEEP, np.abs(rate) >= _MOVING
    if steep.sum() >= _LEAST and float(np.median(speed[steep])) < SLOWEST:
        raise _implausible(rate[steep], pitch[steep], "bar", 10.0, pressure_source)
    if moving.sum() >= max(_LEAST, 0.2 * rate.size) and float(np.median(speed[moving])) > FASTEST:
        if float(np.median(np.abs(pitch[moving]))) < math.radians(1.5):
            tilt, vertical = math.degrees(np.median(np.abs(pitch[moving]))), float(np.median(np.abs(rate[moving])))
            raise InputError(
                pitch_source["file"],
                f"column '{pitch_source['column']}'",
                found=f"pitch of {tilt:.2g}° while depth changes by {vertical:.2g} m/s",
                expected=f"a speed through water of {SLOWEST:g} to {FASTEST:g} m/s",
                remedy="is the unit of pitch rad, declared as deg? correct it under files: in mission.yaml",
            )
        raise _implausible(rate[moving], pitch[moving], "dbar", 0.1, pressure_source)
    both = steep & moving
    if both.sum() >= _LEAST and float(np.mean(np.sign(rate[both]) == np.sign(pitch[both]))) > 0.8:
        return [
            Finding(
                "warning",
                pitch_source["file"],
                f"column '{pitch_source['column']}'",
                "nose up on the way down",
                "pitch with nose up positive",
                "if its sign is reversed, give its unit with a minus sign (-deg) under files: in mission.yaml",
            )
        ]
    return []


def _implausible(rate: Array, pitch: Array, unit: str, factor: float, source: dict[str, str]) -> InputError:
    vertical, tilt = float(np.median(np.abs(rate))), float(np.median(np.abs(pitch)))
    speed = float(np.median(np.abs(rate) / np.abs(np.sin(pitch))))
    remedy = "check the unit of pressure under files: in mission.yaml"
    if SLOWEST <= speed * factor <= FASTEST:
        remedy = f"is the unit of pressure {unit}? correct it under files: in mission.yaml"
    return InputError(
        source["file"],
        f"column '{source['column']}'",
        found=f"depth changing by {vertical:.2g} m/s at {math.degrees(tilt):.0f}° of pitch, a speed of {speed:.2g} m/s",
        expected=f"{SLOWEST:g} to {FASTEST:g} m/s through the water",
        remedy=remedy,
    )

"""Plausibility: is what depth, pitch and engine mean together a glider's flight? Catches wrong units and signs.

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
from pipeline.records import TURNING, Quality

Array = npt.NDArray[np.float64]

SLOWEST, FASTEST = 0.12, 2.2  # m/s through the water that a glider can have
_WINDOW = 60.0  # s over which depth rate and pitch are compared
_STEEP = math.radians(10.0)
_MOVING = 0.03  # m/s
_MIDDLE = (0.2, 0.85)  # share of the deepest pressure: away from surface and turning points
_LEAST = 8  # windows
_LEAST_EACH = 3  # windows of dives, and of climbs
_STROKE = 2e-6  # m3 between climbs and dives that an engine resolves
_SURE = 0.95  # share of the steep minutes of dives, and of climbs, that tell a reversed sign beyond doubt
_LEGS = ("dives", "climbs")


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
    return _tilted_minutes(table)[:3]


def _tilted_minutes(table: pd.DataFrame) -> tuple[Array, Array, Array, Array]:
    """Return what `implied_speed` does, and the last instant of each minute [s]."""
    pitch = good(table, "pitch")
    if not np.isfinite(pitch).any():
        return np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0)
    rate, edges = _minutes(table)
    time = table["time"].to_numpy(dtype=np.float64)
    tilt = np.isfinite(pitch)
    total = np.r_[0.0, np.cumsum(pitch[tilt])]
    begin, end = np.searchsorted(time[tilt], edges)
    count = end - begin
    use = count > 0
    mean = (total[end] - total[begin])[use] / count[use]
    with np.errstate(divide="ignore"):
        speed = np.abs(rate[use]) / np.abs(np.sin(mean))
    return rate[use], mean, speed, edges[1][use]


def _minutes(table: pd.DataFrame) -> tuple[Array, Array]:
    """Return the rate of depth [m/s, + down], shape (k,), of minutes in the middle of the water column, and their ends.

    Returns
    -------
    rate, edges
        Shape (k,), and first and last instant of each, s, shape (2, k).
    """
    time = table["time"].to_numpy(dtype=np.float64)
    depth = np.where(np.isfinite(good(table, "pressure")), table["depth"].to_numpy(dtype=np.float64), np.nan)
    known = np.isfinite(depth)
    if known.sum() < 2:
        return np.zeros(0), np.zeros((2, 0))
    minute = ((time - time[0]) // _WINDOW).astype(np.int64)
    first = np.flatnonzero(np.diff(minute[known], prepend=-1))
    knots, depths = time[known][first], depth[known][first]
    length = np.diff(knots)
    middle = 0.5 * (depths[1:] + depths[:-1])
    deepest = float(np.percentile(depth[known], 99))
    use = (length > 0.5 * _WINDOW) & (length < 5 * _WINDOW)
    use &= (middle > _MIDDLE[0] * deepest) & (middle < _MIDDLE[1] * deepest)
    return np.diff(depths)[use] / length[use], np.stack([knots[:-1][use], knots[1:][use]])


def with_engine_checked(table: pd.DataFrame, source: dict[str, str]) -> tuple[pd.DataFrame, list[Finding]]:
    """Return `table` with the engine's volume flagged bad where it is that of a vehicle driven the other way round.

    A vehicle without a turning propeller sinks with its engine smaller than it rises with. Where it is logged larger on
    dives than on climbs its sign is reversed, and net buoyancy would be, too.

    Parameters
    ----------
    table
        The merged records, with depth.
    source
        ``file`` and ``column`` of the engine's volume, for messages.
    """
    stroke = _stroke(table)
    if stroke > -_STROKE:
        return table, []
    finding = Finding(
        "warning",
        source["file"],
        f"column '{source['column']}'",
        f"an engine volume {-1e6 * stroke:.3g} cm3 larger on dives than on climbs",
        "volume with light positive",
        "flagged bad and not used; if its sign is reversed, give its unit with a minus sign (-cc) under files: in "
        "mission.yaml; or are the clocks of engine and pressure in different zones?",
    )
    flag = np.where(np.isfinite(table["buoyancy_volume"]), Quality.BAD, Quality.MISSING).astype(np.int8)
    return table.assign(buoyancy_volume_qc=flag), [finding]


def _stroke(table: pd.DataFrame) -> float:
    """Return how much larger the engine's volume is on climbs than on dives, m³; 0 where too little tells."""
    if "buoyancy_volume" not in table:
        return 0.0
    rate, edges = _minutes(table)
    volume = _held(table, "buoyancy_volume", edges[1])
    free = np.isfinite(volume) & ~_driven(table, edges[1])
    down, up = (free & (sign * rate > _MOVING) for sign in (1.0, -1.0))
    if min(down.sum(), up.sum()) < _LEAST_EACH:
        return 0.0
    return float(np.median(volume[up]) - np.median(volume[down]))


def _driven(table: pd.DataFrame, time: Array) -> npt.NDArray[np.bool_]:
    """Return whether a propeller turns at `time` [s], shape (n,)."""
    driven = np.zeros(time.size, dtype=bool)
    for name, least in TURNING.items():
        if name in table:
            driven |= np.nan_to_num(np.abs(_held(table, name, time))) > least
    return driven


def with_pitch_checked(
    table: pd.DataFrame, source: dict[str, str], *, vouched: bool
) -> tuple[pd.DataFrame, list[Finding]]:
    """Return `table` with the sign of pitch turned where it is beyond doubt reversed; else a doubt about it.

    A glider sinks nose down and rises nose up. Where nearly every steep minute of dives and of climbs says otherwise,
    either the sign of pitch or its clock is wrong. Its clock is right where the engine, in the same file, is smaller on
    dives than on climbs, and then the sign is turned; not beside a gyro's rate of pitch, whose sign nothing tells.

    Parameters
    ----------
    table
        The merged records, with depth.
    source
        ``file`` and ``column`` of pitch, for messages.
    vouched
        Whether the engine's volume comes from the same file as pitch.
    """
    rate, pitch, _, ends = _tilted_minutes(table)
    both = (np.abs(pitch) >= _STEEP) & (np.abs(rate) >= _MOVING)
    if both.sum() < _LEAST or float(np.mean(np.sign(rate[both]) == np.sign(pitch[both]))) <= 0.8:
        return table, []
    free = both & ~_driven(table, ends)
    legs = [free & (sign * rate > 0) for sign in (1.0, -1.0)]
    sure = all(
        leg.sum() >= _LEAST_EACH and float(np.mean(np.sign(rate[leg]) == np.sign(pitch[leg]))) >= _SURE for leg in legs
    )
    place = f"column '{source['column']}'"
    expected = "pitch with nose up positive"
    if sure and vouched and "pitch_rate" not in table and _stroke(table) > _STROKE:
        minutes = " and ".join(f"{leg.sum()} minutes of {name}" for leg, name in zip(legs, _LEGS, strict=True))
        found = f"nose up on the way down and down on the way up in {minutes}, with the engine as on a glider"
        remedy = "its sign is turned; pitch: {scale: -1} in mission.yaml says the same"
        finding = Finding("warning", source["file"], place, found, expected, remedy)
        return table.assign(pitch=-table["pitch"]), [finding]
    remedy = (
        "if its sign is reversed, pitch: {scale: -1} in mission.yaml turns it; "
        "or are the clocks of pitch and pressure in different zones?"
    )
    return table, [Finding("warning", source["file"], place, "nose up on the way down", expected, remedy)]


def _held(table: pd.DataFrame, name: str, time: Array) -> Array:
    """Return the last good value of column `name` at or before `time` [s], shape (n,), NaN where there is none."""
    values = good(table, name)
    known = np.isfinite(values)
    before = np.searchsorted(table["time"].to_numpy(dtype=np.float64)[known], time, side="right")
    return np.asarray(np.r_[np.nan, values[known]][before], dtype=np.float64)


def require(table: pd.DataFrame, pressure_source: dict[str, str], pitch_source: dict[str, str]) -> None:
    """Check that pressure and pitch taken together are a glider's.

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

"""Fixes: positions that a receiver can have had. A glider hears satellites at the surface alone.

Receivers go on reporting a while after the antenna is under water, along the last velocity or at the last place, and
many gliders log dead-reckoned positions in the columns of fixes. Neither is a fix.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.findings import Finding
from pipeline.records import Quality

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

_DEEP = 1.0  # dbar below the surface at which no antenna is out of the water
_OFFSET = 1.5  # dbar, least pressure up to which the vehicle is taken to have been at the surface
_BRACKET = 60.0  # s between the pressures before and after a fix that tell its depth
_FASTEST = 3.0  # m/s over ground, vehicle and current
_SCATTER = 50.0  # m by which two fixes may differ whatever the time between them
_LOOK_BACK = 30  # fixes among which the one before is sought
_EARTH = 6_371_000.0


def checked(streams: list[pd.DataFrame]) -> tuple[list[pd.DataFrame], list[Finding]]:
    """Return `streams` with the positions flagged bad that are no fixes, and what was flagged.

    Parameters
    ----------
    streams
        Flagged frames (`quality.checked`), times increasing.
    """
    findings: list[Finding] = []
    depths = _pressures(streams)
    out = []
    for frame in streams:
        if not {"latitude_qc", "longitude_qc"} <= set(frame.columns):
            out.append(frame)
            continue
        name = str(frame.attrs.get("name", "stream"))
        good = ((frame["latitude_qc"] == Quality.GOOD) & (frame["longitude_qc"] == Quality.GOOD)).to_numpy()
        rows = np.flatnonzero(good)
        time, latitude, longitude = (
            frame[column].to_numpy(dtype=np.float64)[rows] for column in ("time", "latitude", "longitude")
        )
        under = _under_water(time, depths)
        astray = np.zeros(rows.size, dtype=bool)
        astray[~under] = ~consistent(time[~under], latitude[~under], longitude[~under])
        for mask, what, expected in (
            (under, "under water", "fixes at the surface"),
            (astray, "out of reach of the others", f"fixes that agree at {_FASTEST:g} m/s over ground"),
        ):
            if mask.any():
                count = f"{int(mask.sum())} of {rows.size} positions"
                first = f"latitude, record {int(rows[np.argmax(mask)]) + 1}"
                findings.append(
                    Finding("warning", name, first, f"{count} {what}", expected, "flagged bad and not used")
                )
        bad = rows[under | astray]
        flags = {}
        for column in ("latitude_qc", "longitude_qc"):
            flag = frame[column].to_numpy(dtype=np.int8, copy=True)
            flag[bad] = Quality.BAD
            flags[column] = flag
        result = frame.assign(**flags)
        result.attrs = frame.attrs
        out.append(result)
    return out, findings


def _under_water(time: Array, depths: list[tuple[Array, Array]]) -> Mask:
    """Return where a fix at `time` [s], shape (n,), is below the surface by the first of the sensors that tells."""
    under, open_ = np.zeros(time.size, dtype=bool), np.ones(time.size, dtype=bool)
    for pressure_time, pressure in depths:
        under |= open_ & below_the_surface(time, pressure_time, pressure)
        open_ &= ~_bracketed(time, pressure_time)
    return under


def _bracketed(time: Array, pressure_time: Array) -> Mask:
    """Return where `time`, shape (n,), has one of `pressure_time` before and after it that are close together, s."""
    after = np.searchsorted(pressure_time, time)
    inside = (after > 0) & (after < pressure_time.size)
    after = np.clip(after, 1, max(1, pressure_time.size - 1))
    near = np.zeros(time.size, dtype=bool)
    if pressure_time.size > 1:
        near = pressure_time[after] - pressure_time[after - 1] <= _BRACKET
    return np.asarray(inside & near)


def below_the_surface(time: Array, pressure_time: Array, pressure: Array) -> Mask:
    """Return where the pressures before and after `time` [s], shape (n,), are both those of an antenna under water.

    Parameters
    ----------
    time
        Of the fixes.
    pressure_time, pressure
        Good pressures [dbar], shape (m,), times increasing.
    """
    if pressure.size < 2:
        return np.zeros(time.size, dtype=bool)
    least = float(pressure.min())
    limit = _DEEP + (max(least, 0.0) if least < _OFFSET else 0.0)
    after = np.clip(np.searchsorted(pressure_time, time), 1, pressure.size - 1)
    shallower = np.minimum(pressure[after], pressure[after - 1])
    return np.asarray(_bracketed(time, pressure_time) & (shallower > limit))


def consistent(time: Array, latitude: Array, longitude: Array) -> Mask:
    """Return which fixes, shape (n,), form a longest chain of which each can be reached from the one before.

    Latitude and longitude in degrees; two fixes may be 50 m and 3 m/s times the time between them apart.
    """
    n = time.size
    length = np.ones(n, dtype=np.int64)
    before = np.full(n, -1, dtype=np.int64)
    for i in range(1, n):
        start = max(0, i - _LOOK_BACK)
        past = slice(start, i)
        north = np.radians(latitude[i] - latitude[past])
        east = np.radians((longitude[i] - longitude[past] + 180.0) % 360.0 - 180.0) * np.cos(np.radians(latitude[i]))
        reach = _SCATTER + _FASTEST * (time[i] - time[past])
        chain = np.where(_EARTH * np.hypot(north, east) <= reach, length[past], 0)
        best = int(chain.size - 1 - np.argmax(chain[::-1]))
        if chain[best]:
            length[i], before[i] = chain[best] + 1, start + best
    kept = np.zeros(n, dtype=bool)
    i = int(n - 1 - np.argmax(length[::-1])) if n else -1
    while i >= 0:
        kept[i] = True
        i = int(before[i])
    return kept


def _pressures(streams: list[pd.DataFrame]) -> list[tuple[Array, Array]]:
    """Return times and good values of every stream with pressure, the one with most of them first."""
    found = []
    for frame in streams:
        if "pressure_qc" in frame:
            good = (frame["pressure_qc"] == Quality.GOOD).to_numpy()
            found.append((frame["time"].to_numpy(np.float64)[good], frame["pressure"].to_numpy(np.float64)[good]))
    return sorted(found, key=lambda series: -series[0].size)

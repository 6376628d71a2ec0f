"""Passages: submerged flight between two fixes, over ground by the fixes and through water by a model of the speed.

Horizontal vectors are complex numbers, east + i north. What the vehicle drifted between a fix and going under, or
between coming up and the next fix, is taken off at the velocity of its surface drift.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.geodesy import apart
from pipeline.records import seconds, usable

Array = NDArray[np.float64]
Vector = NDArray[np.complex128]
Whole = NDArray[np.int64]

#: Columns of the records that passages are made from.
_JUDGED = ("pressure", "heading", "latitude", "longitude")
NEEDED = ("time", "dive", "depth", *_JUDGED, *(f"{name}_qc" for name in _JUDGED))
#: Above this depth (m) the vehicle is afloat.
AFLOAT = 1.0
#: Samples of depth and heading closer together than this (s) are passed over.
STEP = 5.0
#: A pause between samples (s) longer than this says nothing of what was flown meanwhile.
PAUSE = 300.0
#: Shortest passage, s; longest time between two fixes of one drift at the surface, and the shortest such drift, s.
SHORTEST, LONGEST_DRIFT, SHORTEST_DRIFT = 600.0, 1800.0, 120.0
#: 1-sigma of a fix along each axis, m: a receiver's 5 m, and what the vehicle does between the waves and the fix.
FIX = 10.0
#: 1-sigma of the surface drift along each axis where it was measured, and where it was not, m/s.
DRIFT, DRIFT_UNKNOWN = 0.1, 0.3
#: Neither vehicle nor current makes this over ground, m/s.
FASTEST = 3.0
#: Share of a passage that must have been recorded, with a heading, and in which the speed must be known.
RECORDED, SEEN = 0.8, 0.5
#: 1-sigma of a speed where it is not known, as a share of what it is around.
UNSEEN = 0.3

NO_FIXES = "fewer than two fixes"
NO_DEPTH = "no depth"
NO_HEADING = "no heading"
NO_PASSAGE = f"no fixes before and after {SHORTEST / 60.0:.0f} minutes under water"


@dataclass(frozen=True)
class Passages:
    """Passages, k of them, and the n short steps that they are made of.

    Attributes
    ----------
    start, end
        Of going under and coming up, s since 1970-01-01 UTC, shape (k,).
    dive
        Dive number, shape (k,).
    over_ground
        Mean velocity over ground while under water, m/s, shape (k,).
    over_ground_std
        1-sigma of either component, fixes and surface drift, m/s, shape (k,).
    recorded
        Share of the time under water that the records tell of, shape (k,).
    number, time, step
        Of each step: its passage, its middle [s since 1970], its length times the unit vector of the heading [s],
        shape (n,).
    left_out
        ``start`` [s] and ``reason`` of each passage that cannot be used.
    reason
        Why there is none, "" where there are some.
    """

    start: Array
    end: Array
    dive: Whole
    over_ground: Vector
    over_ground_std: Array
    recorded: Array
    number: Whole
    time: Array
    step: Vector
    left_out: tuple[dict[str, Any], ...]
    reason: str

    @property
    def count(self) -> int:
        """Number of passages."""
        return int(self.start.size)


class ThroughWater(NamedTuple):
    """What a model says of each passage, shape (k,)."""

    velocity: Vector  # mean velocity through water, m/s
    std: Array  # 1-sigma of either component by what the model does not say, m/s
    seen: Array  # share of the time under water in which the model knows the speed


def find(records: pd.DataFrame) -> Passages:
    """Return the passages of a mission.

    Parameters
    ----------
    records
        Canonical records, times increasing; columns `NEEDED`.
    """
    time = seconds(records["time"])
    fixed = usable(records, "latitude") & usable(records, "longitude")
    known = usable(records, "pressure") & np.isfinite(records["depth"].to_numpy())
    reason = NO_FIXES if fixed.sum() < 2 else NO_DEPTH if known.sum() < 2 else ""
    reason = reason or ("" if usable(records, "heading").sum() > 1 else NO_HEADING)
    if reason:
        return _none(reason)
    rows = _spaced(time, known)
    track = _Track.of(time[rows], records["depth"].to_numpy()[rows], _heading(time, records, time[rows]))
    at = time[fixed]
    latitude, longitude = (records[name].to_numpy()[fixed] for name in ("latitude", "longitude"))
    east, north = apart(latitude[1:], longitude[1:], latitude[:-1], longitude[:-1])
    moved = east + 1j * north
    passing = track.under(at[:-1], at[1:]) >= SHORTEST
    drift, drift_std = _drifts(at, moved, passing)
    table: list[dict[str, Any]] = []
    left_out: list[dict[str, Any]] = []
    pieces: list[slice] = []
    for fix in np.flatnonzero(passing):
        part = track.between(at[fix], at[fix + 1])
        row = track.passage(part, at[fix], at[fix + 1])
        ends = np.array([row.pop("lead"), row.pop("tail")])
        speeds, stds = drift[[fix, fix + 1]], drift_std[[fix, fix + 1]]
        row["over_ground"] = (moved[fix] - np.sum(ends * speeds)) / row["duration"]
        row["over_ground_std"] = math.sqrt(2.0 * FIX**2 + float(np.sum((ends * stds) ** 2))) / row["duration"]
        why = _unfit(row, ends)
        if why:
            left_out.append({"start": row["start"], "reason": why})
            continue
        table.append(row)
        pieces.append(part)
    if not table:
        return _none(left_out[0]["reason"] if left_out else NO_PASSAGE, tuple(left_out))
    found = {name: np.array([row[name] for row in table]) for name in table[0]}
    middle = np.searchsorted(time, 0.5 * (found["start"] + found["end"]))
    inside = np.concatenate([np.arange(piece.start, piece.stop) for piece in pieces])
    number = np.repeat(np.arange(len(table)), [piece.stop - piece.start for piece in pieces])
    kept = np.isfinite(track.step[inside])
    return Passages(
        found["start"],
        found["end"],
        records["dive"].to_numpy()[middle].astype(np.int64),
        found["over_ground"],
        found["over_ground_std"],
        found["recorded"],
        number[kept],
        track.time[inside][kept],
        track.step[inside][kept],
        tuple(left_out),
        "",
    )


def through_water(passages: Passages, time: Array, speed: Array) -> ThroughWater:
    """Return what a series of horizontal speeds makes of each passage.

    Where the speed is not known it is interpolated, and the 1-sigma is wider.

    Parameters
    ----------
    passages
        As found in the records.
    time
        Instants, s since 1970-01-01 UTC, increasing, shape (m,).
    speed
        Horizontal speed through water V cos γ, m/s, shape (m,); NaN where it is not known.
    """
    known = np.isfinite(speed)
    if known.sum() < 2:
        nothing = np.full(passages.count, np.nan, dtype=np.complex128)
        return ThroughWater(nothing, np.full(passages.count, np.nan), np.zeros(passages.count))
    clock, value = time[known], speed[known]
    after = np.clip(np.searchsorted(clock, passages.time), 1, clock.size - 1)
    near = np.minimum(np.abs(clock[after] - passages.time), np.abs(clock[after - 1] - passages.time)) <= PAUSE / 2.0
    # Between two instants at which the speed is known, and next to none at which it is not.
    blank = np.interp(passages.time, time, (~known).astype(np.float64)) > 0.5
    return _mean(passages, np.interp(passages.time, clock, value), near & ~blank)


def by_blocks(passages: Passages, start: Array, end: Array) -> tuple[Any, Array]:
    """Return how the speeds of steady blocks make up each passage.

    What is flown outside blocks counts as the block nearest in time within the passage.

    Parameters
    ----------
    passages
        As found in the records.
    start, end
        Bounds of the blocks, s since 1970-01-01 UTC, in time order, shape (b,).

    Returns
    -------
    weights
        Sparse complex array of shape (k, b): `weights @ speed` is the mean velocity through water.
    seen
        Share of each passage that blocks cover, shape (k,).
    """
    from scipy.sparse import coo_array

    k, blocks = passages.count, start.size
    if not blocks:
        return coo_array((k, 0), dtype=np.complex128).tocsr(), np.zeros(k)
    after = np.clip(np.searchsorted(end, passages.time), 0, blocks - 1)
    before = np.maximum(after - 1, 0)
    ahead, behind = start[after] - passages.time, passages.time - end[before]
    nearest = np.where((np.abs(behind) < ahead) & (behind >= 0.0), before, after)
    middle = 0.5 * (start + end)[nearest]
    own = (middle >= passages.start[passages.number]) & (middle <= passages.end[passages.number])
    length = np.abs(passages.step)
    total = np.bincount(passages.number[own], length[own], k)
    inside = own & (passages.time >= start[nearest]) & (passages.time <= end[nearest])
    covered = np.bincount(passages.number[inside], length[inside], k)
    whole = np.bincount(passages.number, length, k)
    share = passages.step[own] / total[passages.number[own]]
    weights = coo_array((share, (passages.number[own], nearest[own])), shape=(k, blocks)).tocsr()
    return weights, passages.recorded * covered / whole


def mean_of(weights: Any, seen: Array, speed: Array) -> ThroughWater:
    """Return what the horizontal speeds of blocks make of each passage.

    Parameters
    ----------
    weights, seen
        As from `by_blocks`.
    speed
        m/s, shape (b,); NaN where the theory has none, and then the passage has none.
    """
    velocity = weights @ speed
    return ThroughWater(velocity, UNSEEN * np.abs(velocity) * (1.0 - seen), np.where(seen >= SEEN, seen, 0.0))


def _mean(passages: Passages, speed: Array, seen: NDArray[np.bool_]) -> ThroughWater:
    """Return the means over passages of a horizontal speed at each step, `seen` or filled in."""
    k, length = passages.count, np.abs(passages.step)
    total = np.bincount(passages.number, length, k)
    east, north = (np.bincount(passages.number, part * speed, k) for part in (passages.step.real, passages.step.imag))
    share = passages.recorded * np.bincount(passages.number, length * seen, k) / total
    size = np.bincount(passages.number, length * speed, k) / total
    return ThroughWater((east + 1j * north).astype(np.complex128) / total, UNSEEN * size * (1.0 - share), share)


class _Track(NamedTuple):
    """Samples of depth and the steps between them, of which those under water are kept; n of them."""

    time: Array  # (n,): middle of each step
    start: Array
    end: Array
    hidden: Array  # (n,): s, all of the step where nothing was recorded under water, else 0
    step: Vector  # (n,): s, NaN without heading
    passed: Array  # (n + 1,): s under water up to each step

    @staticmethod
    def of(time: Array, depth: Array, heading: Array) -> _Track:
        """Return the steps between samples of depth [m], `heading` [rad] at the same instants, shape (n + 1,)."""
        length = np.diff(time)
        silent = length > PAUSE
        deep = 0.5 * (depth[1:] + depth[:-1]) > AFLOAT
        deep |= silent & (np.maximum(depth[1:], depth[:-1]) > 2.0 * AFLOAT)
        unit = np.exp(1j * (0.5 * np.pi - 0.5 * (heading[1:] + heading[:-1])))
        step = np.where(silent, np.nan, length * unit)[deep]
        start, end, length = time[:-1][deep], time[1:][deep], length[deep]
        return _Track(
            0.5 * (start + end),
            start,
            end,
            np.where(silent[deep], length, 0.0),
            step,
            np.concatenate([[0.0], np.cumsum(length)]),
        )

    def under(self, first: Array, last: Array) -> Array:
        """Return how long the vehicle was under water between instants, s."""
        return np.asarray(
            self.passed[np.searchsorted(self.time, last)] - self.passed[np.searchsorted(self.time, first)]
        )

    def between(self, first: float, last: float) -> slice:
        """Return the steps between two instants."""
        return slice(int(np.searchsorted(self.time, first)), int(np.searchsorted(self.time, last)))

    def passage(self, part: slice, first: float, last: float) -> dict[str, Any]:
        """Return times and shares of the steps `part` between two fixes."""
        start, end = float(self.start[part][0]), float(self.end[part][-1])
        under = float(self.passed[part.stop] - self.passed[part.start])
        told = np.isfinite(self.step[part])
        afloat = end - start - under  # came up without a fix
        return {
            "start": start,
            "end": end,
            "duration": under,
            "lead": max(start - first, 0.0) + 0.5 * afloat,
            "tail": max(last - end, 0.0) + 0.5 * afloat,
            "hidden": float(self.hidden[part].sum()) / under,
            "recorded": float((self.end[part] - self.start[part])[told].sum()) / under,
        }


def _heading(time: Array, records: pd.DataFrame, at: Array) -> Array:
    """Return the true heading, rad, not wrapped, at instants; NaN where none was measured within `PAUSE`."""
    rows = _spaced(time, usable(records, "heading"))
    clock, value = time[rows], np.unwrap(records["heading"].to_numpy()[rows])
    after = np.clip(np.searchsorted(clock, at), 1, clock.size - 1)
    near = np.minimum(np.abs(clock[after] - at), np.abs(clock[after - 1] - at)) <= PAUSE / 2.0
    return np.where(near, np.interp(at, clock, value), np.nan)


def _spaced(time: Array, known: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return of the instants that are `known` the first in every `STEP`, and the last."""
    rows = np.flatnonzero(known)
    slot = np.floor(time[rows] / STEP)
    first = np.diff(slot, prepend=slot[0] - 1.0) > 0.0
    first[-1] = True
    return rows[first]


def _drifts(time: Array, moved: Vector, passing: NDArray[np.bool_]) -> tuple[Vector, Array]:
    """Return the velocity of the surface drift around each fix and the 1-sigma of either component, m/s, shape (f,).

    Fixes belong to one drift as long as no passage and no long time lies between them.
    """
    breaks = np.flatnonzero(passing | (np.diff(time) > LONGEST_DRIFT)) + 1
    place = np.concatenate([[0.0], np.cumsum(moved)])
    drift, std = np.zeros(time.size, dtype=np.complex128), np.full(time.size, DRIFT_UNKNOWN)
    for first, stop in pairwise([0, *breaks.tolist(), time.size]):
        length = time[stop - 1] - time[first]
        velocity = (place[stop - 1] - place[first]) / max(length, 1.0)
        if length >= SHORTEST_DRIFT and abs(velocity) <= FASTEST:
            drift[first:stop], std[first:stop] = velocity, DRIFT
    return drift, std


def _unfit(row: dict[str, Any], afloat: Array) -> str:
    """Return why a passage cannot be used, "" if it can."""
    if abs(row["over_ground"]) > FASTEST:
        return f"fixes farther apart than {FASTEST:g} m/s over ground"
    if row["hidden"] > 1.0 - RECORDED:
        return "depth not recorded all the way"
    if row["recorded"] < RECORDED:
        return "heading not recorded all the way"
    if afloat.sum() > row["duration"]:
        return "longer afloat than under water between its fixes"
    return ""


def _none(reason: str, left_out: tuple[dict[str, Any], ...] = ()) -> Passages:
    """Return no passages, and why."""
    real, vector, whole = np.zeros(0), np.zeros(0, dtype=np.complex128), np.zeros(0, dtype=np.int64)
    return Passages(real, real, whole, vector, real, real, whole, real, vector, left_out, reason)

"""Phases: what the vehicle was doing, dive by dive, and where its flight was steady.

Decided on a smoothed copy of the data, drawn on a regular clock between gaps; the records themselves stay as measured.
The rules know up and down only where they must (the surface, the count of dives), so that a mission mirrored in depth
and pitch has mirrored phases and the same blocks.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.findings import Finding
from pipeline.ingest.seawater import good
from pipeline.records import TURNING, Phase

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Whole = npt.NDArray[np.int32]

_STEP = 2.0  # s, the internal clock
_BREAK = 900.0  # s without pressure that separates two stretches of record
_TURN = (3.0, 8.0)  # m, least rise and fall about a turning point, and its most
_TURN_SHARE = 0.01  # of the depth range
_SMOOTHING, _SPAN = 10.0, 30.0  # s, mean of depth; baseline of its rate
_SLOW = 0.02  # m/s of depth, below which nothing is called a dive or climb
_LEVEL_WINDOW, _LEVEL_RANGE, _LEVEL_RATE = 120.0, 3.0, 0.05  # s, m, m/s: level flight stays within
_SURFACE = 2.5  # m
_NEAR_TURN = 90.0  # s
_SETTLING, _AHEAD = 15.0, 5.0  # s after a change until flight is steady again, and before it
_LEAST_SAMPLES = 4  # of pressure and of pitch in a block
_LEAST_IN_DIVE = 10  # samples of each in a dive and its climb: with fewer, half of them are near a turn


@dataclass(frozen=True)
class _Limit:
    """How much a quantity may change within 20 s of steady flight."""

    least: float
    share: float
    circular: bool = False


#: Engine, propeller and heading limits: `least` in the records' unit, or `share` of the quantity's own range.
_LIMITS = {
    "pitch": _Limit(0.05, 0.0),
    "buoyancy_volume": _Limit(3e-6, 0.02),
    "propeller_speed": _Limit(0.5, 0.05),
    "propeller_power": _Limit(1.0, 0.2),
    "heading": _Limit(0.5, 0.0, circular=True),
}
_MEAN, _BASE = 10.0, 20.0  # s: means compared, and how far apart
_RATE_CHANGE = (0.05, 0.35)  # m/s, or share of the rate itself


def with_phases(table: pd.DataFrame, *, block_s: float = 300.0, minimum_block_s: float = 60.0) -> pd.DataFrame:
    """Return `table` with ``phase``, ``dive`` and ``block`` of each row.

    Parameters
    ----------
    table
        ``time`` [s], ``depth`` [m], ``pitch`` [rad] and, where there is one, ``buoyancy_volume``, ``propeller_speed``,
        ``propeller_power``, ``heading``; flags ``<name>_qc`` are heeded.
    block_s
        Length at which steady flight is cut into blocks, s: equal pieces of about that.
    minimum_block_s
        Steady flight shorter than this is no block, s.

    Returns
    -------
    table
        With ``phase`` (OG1: ascent and descent, powered or not; propelled = powered level flight; parking = level
        without power; surfacing; inflexion at the turns; transition; unknown where depth was not measured), ``dive``
        (one per descent and what follows, 0 before the first) and ``block`` (number of the steady-flight block from 0,
        −1 outside).
    """
    time = table["time"].to_numpy(dtype=np.float64)
    phase = np.full(time.size, Phase.UNKNOWN, dtype=np.int8)
    dive = np.zeros(time.size, dtype=np.int32)
    block = np.full(time.size, -1, dtype=np.int32)
    tracks = {name: _track(table, name) for name in ("depth", *_LIMITS) if name in table}
    limits = {name: max(_LIMITS[name].least, _LIMITS[name].share * _range(track[1]))
              for name, track in tracks.items() if name in _LIMITS}  # fmt: skip
    depth_time, depth = tracks.get("depth", (np.zeros(0), np.zeros(0)))
    dives = blocks = 0
    before = np.inf  # depth at which the last stretch broke off going down
    for first, last in _stretches(depth_time):
        stretch = _Stretch.of(depth_time[first:last], depth[first:last])
        if stretch is None:
            continue
        leg, turns = _legs(stretch)
        powered = _powered(stretch.time, tracks)
        state = _states(stretch, leg, turns, powered)
        starts = _dive_starts(leg)
        starts[0] &= stretch.depth[0] < before
        before = stretch.depth[-1] if leg[-1] > 0 else np.inf
        count = dives + np.cumsum(starts)
        steady = _steady(stretch, state, tracks, limits)
        rows = slice(*np.searchsorted(time, (stretch.time[0] - _STEP / 2, stretch.time[-1] + _STEP)))
        at = np.clip(np.round((time[rows] - stretch.time[0]) / _STEP).astype(np.int64), 0, stretch.time.size - 1)
        phase[rows] = np.where(stretch.covered[at], state[at], Phase.UNKNOWN)
        dive[rows] = count[at]
        dive[rows.stop :] = count[-1]
        dives = int(count[-1])
        blocks = _cut(block, time, rows, at, steady, state, tracks, blocks, block_s, minimum_block_s)
    return table.assign(phase=phase, dive=dive, block=block)


def sampled_seldom(table: pd.DataFrame) -> list[Finding]:
    """Return a warning where a dive, in the middle, has too few samples of depth or pitch to show how it was flown.

    Parameters
    ----------
    table
        As `with_phases` returns it.
    """
    under = table[(table["dive"] > 0) & (table["phase"] != Phase.SURFACING)]
    findings = []
    for name in ("depth", "pitch"):
        if name not in under:
            continue
        _, samples = np.unique(under["dive"].to_numpy()[np.isfinite(good(under, name))], return_counts=True)
        if not samples.size or (middle := float(np.median(samples))) >= _LEAST_IN_DIVE:
            continue
        findings.append(
            Finding(
                "warning",
                "mission",
                name,
                f"{middle:g} samples in a dive and its climb (median)",
                f"{_LEAST_IN_DIVE} or more",
                "what was flown between them is guessed, and the intervals may be too narrow; if the vehicle has "
                "recorded more than it sent home, use that",
            )
        )
    return findings


@dataclass(frozen=True)
class _Stretch:
    """A stretch of record on the internal clock: time, smoothed depth, its rate, and where depth was measured."""

    time: Array
    depth: Array
    rate: Array
    covered: Mask

    @staticmethod
    def of(time: Array, depth: Array) -> _Stretch | None:
        """Return the stretch through samples of depth, None if it is too short to say anything."""
        if time.size < 3 or time[-1] - time[0] < 2 * _SPAN:
            return None
        clock = np.arange(time[0], time[-1], _STEP)
        smooth = _mean(np.interp(clock, time, depth), _SMOOTHING)
        return _Stretch(clock, smooth, _difference(smooth, _SPAN) / _SPAN, _near(clock, time, _gap_limit(time)))


def _track(table: pd.DataFrame, name: str) -> tuple[Array, Array]:
    """Return times and values of the good samples of column `name`; depth is as good as its pressure."""
    values = good(table, name)
    if name == "depth" and "pressure_qc" in table:
        values = np.where(np.isfinite(good(table, "pressure")), values, np.nan)
    finite = np.isfinite(values)
    return table["time"].to_numpy(dtype=np.float64)[finite], values[finite]


def _range(values: Array) -> float:
    return float(np.subtract(*np.percentile(values, (98, 2)))) if values.size else 0.0


def _stretches(time: Array) -> list[tuple[int, int]]:
    """Return first and past-the-last sample of each stretch without a break."""
    if time.size == 0:
        return []
    cuts = np.flatnonzero(np.diff(time) > _BREAK) + 1
    return list(zip([0, *cuts.tolist()], [*cuts.tolist(), time.size], strict=True))


def _gap_limit(time: Array) -> float:
    """Return how long a sensor may be silent before nothing is said about that time, s."""
    return max(60.0, 4.0 * float(np.median(np.diff(time)))) if time.size > 1 else 60.0


def _near(clock: Array, time: Array, limit: float) -> Mask:
    """Return where samples at `time` lie before and after `clock` with at most `limit` seconds between them."""
    if time.size == 0:
        return np.zeros(clock.size, dtype=bool)
    after = np.searchsorted(time, clock)
    later = time[np.minimum(after, time.size - 1)]
    earlier = time[np.maximum(after - 1, 0)]
    exact = later == clock
    return np.asarray(exact | ((later > clock) & (earlier <= clock) & (later - earlier <= limit)))


def _mean(values: Array, width: float) -> Array:
    """Return the running mean over `width` seconds of the internal clock."""
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(values, 2 * round(width / _STEP / 2) + 1, mode="nearest"))


def _difference(values: Array, span: float) -> Array:
    """Return values half a `span` later minus half a span earlier, one-sided at the ends (scaled to the whole span)."""
    half = round(span / _STEP / 2)
    index = np.arange(values.size)
    ahead, behind = np.minimum(index + half, values.size - 1), np.maximum(index - half, 0)
    return np.asarray((values[ahead] - values[behind]) * (2 * half) / np.maximum(ahead - behind, 1))


def _legs(stretch: _Stretch) -> tuple[npt.NDArray[np.int8], npt.NDArray[np.int64]]:
    """Return +1 (going down), −1 (going up) or 0 of each instant between turning points, and those points.

    A turning point rises and falls by 3 m or more (1 % of the depth range, at most 8 m, in deep missions).
    """
    from scipy.signal import find_peaks

    depth = stretch.depth
    prominence = float(np.clip(_TURN_SHARE * np.ptp(depth), *_TURN))
    low, _ = find_peaks(depth, prominence=prominence)
    high, _ = find_peaks(-depth, prominence=prominence)
    turns = np.unique(np.r_[0, low, high, depth.size - 1])
    fall = np.diff(depth[turns])
    sense = np.where(np.abs(fall) >= 0.9 * prominence, np.sign(fall), 0).astype(np.int8)
    leg = np.repeat(sense, np.diff(turns))
    return np.r_[leg, leg[-1:]].astype(np.int8), turns


def _dive_starts(leg: npt.NDArray[np.int8]) -> Mask:
    """Return where a descent begins."""
    down = leg > 0
    return np.asarray(down & ~np.r_[False, down[:-1]])


def _powered(clock: Array, tracks: dict[str, tuple[Array, Array]]) -> Mask:
    """Return where the propeller turns: by its speed, where that is logged, else by its power."""
    for name, limit in TURNING.items():
        time, values = tracks.get(name, (np.zeros(0), np.zeros(0)))
        if time.size:
            return np.asarray(
                (np.interp(clock, time, np.abs(values)) > limit) & _near(clock, time, 4 * _gap_limit(time))
            )
    return np.zeros(clock.size, dtype=bool)


def _states(
    stretch: _Stretch, leg: npt.NDArray[np.int8], turns: npt.NDArray[np.int64], powered: Mask
) -> npt.NDArray[np.int8]:
    """Return the phase of each instant of the internal clock."""
    from scipy.ndimage import binary_dilation, maximum_filter1d, minimum_filter1d

    size = round(_LEVEL_WINDOW / _STEP) + 1
    spread = maximum_filter1d(stretch.depth, size) - minimum_filter1d(stretch.depth, size)
    whole = (spread < _LEVEL_RANGE) & (np.minimum(np.arange(spread.size), np.arange(spread.size)[::-1]) >= size // 2)
    level = binary_dilation(whole, np.ones(size)) & (np.abs(stretch.rate) < _LEVEL_RATE)
    moving = ~level & (leg != 0) & (np.abs(stretch.rate) >= _SLOW) & (np.sign(stretch.rate) == leg)
    near = np.zeros(leg.size, dtype=bool)
    near[turns[1:-1]] = True
    near = binary_dilation(near, np.ones(2 * round(_NEAR_TURN / _STEP) + 1))
    state = np.full(leg.size, Phase.TRANSITION, dtype=np.int8)
    state[near & ~level] = Phase.INFLEXION
    state[level] = np.where(powered[level], Phase.PROPELLED, Phase.PARKING)
    state[(stretch.depth < _SURFACE) & ~moving] = Phase.SURFACING
    state[moving & (leg > 0)] = Phase.DESCENT
    state[moving & (leg < 0)] = Phase.ASCENT
    return state


def _steady(
    stretch: _Stretch,
    state: npt.NDArray[np.int8],
    tracks: dict[str, tuple[Array, Array]],
    limits: dict[str, float],
) -> Mask:
    """Return where flight is steady: nothing changes, nothing has changed just before, and pitch is measured."""
    clock = stretch.time
    if "pitch" not in tracks or tracks["pitch"][0].size < _LEAST_SAMPLES:
        return np.zeros(clock.size, dtype=bool)
    flying = np.isin(state, (Phase.DESCENT, Phase.ASCENT, Phase.PROPELLED)) & (stretch.depth > _SURFACE)
    rate = _mean(stretch.rate, _SMOOTHING)
    change = np.abs(_difference(rate, _BASE))
    changing = change > np.maximum(_RATE_CHANGE[0], _RATE_CHANGE[1] * np.abs(rate))
    for name, limit in limits.items():
        time, values = tracks[name]
        if time.size < 3:
            continue
        values = _without_outliers(values, circular=_LIMITS[name].circular)
        drawn = _mean(np.interp(clock, time, values), _MEAN)
        changing |= np.abs(_difference(drawn, _BASE)) > limit
    settled = ~_lasting(changing, _AHEAD, _SETTLING)
    time = tracks["pitch"][0]
    return np.asarray(flying & settled & stretch.covered & _near(clock, time, _gap_limit(time)))


def _lasting(mask: Mask, before: float, after: float) -> Mask:
    """Return where `mask` holds, or will within `before` seconds, or did within `after`."""
    index = np.arange(mask.size)
    total = np.r_[0, np.cumsum(mask)]
    end = np.minimum(index + round(before / _STEP) + 1, mask.size)
    return np.asarray(total[end] > total[np.maximum(index - round(after / _STEP), 0)])


def _without_outliers(values: Array, *, circular: bool) -> Array:
    """Return the median of each three neighbours; of angles by their components, and unwrapped."""
    from scipy.ndimage import median_filter

    if not circular:
        return np.asarray(median_filter(values, 3, mode="nearest"))
    east, north = (median_filter(part, 3, mode="nearest") for part in (np.sin(values), np.cos(values)))
    return np.unwrap(np.arctan2(east, north))


def _cut(
    block: Whole,
    time: Array,
    rows: slice,
    at: npt.NDArray[np.int64],
    steady: Mask,
    state: npt.NDArray[np.int8],
    tracks: dict[str, tuple[Array, Array]],
    number: int,
    block_s: float,
    minimum_s: float,
) -> int:
    """Write the numbers of one stretch's blocks, from `number` on, into `block`; return the next number.

    Each run of steady flight in one phase is cut into equal pieces of about `block_s`, none shorter than `minimum_s`.
    """
    kind = np.where(steady, state, -1)[at]
    within = time[rows]
    out = block[rows]
    edges = np.r_[0, np.flatnonzero(np.diff(kind) != 0) + 1, kind.size]
    for first, past in pairwise(edges.tolist()):
        if first == past or kind[first] < 0:
            continue
        inside = within[first:past]
        length = inside[-1] - inside[0]
        if length < minimum_s:
            continue
        longest = float(np.diff(inside).max(initial=0.0))
        pieces = max(1, min(round(length / block_s), int(length / (minimum_s + longest))))
        bounds = inside[0] + length / pieces * np.arange(pieces + 1)
        if not all(_sampled(tracks[name][0], bounds) for name in ("depth", "pitch")):
            continue
        out[first:past] = number + np.minimum(((inside - inside[0]) / length * pieces).astype(np.int32), pieces - 1)
        number += pieces
    return number


def _sampled(time: Array, bounds: Array) -> bool:
    """Return whether each piece between `bounds` has enough samples."""
    inner = np.searchsorted(time, bounds[:-1]), np.searchsorted(time, bounds[1:], side="right")
    return bool((inner[1] - inner[0] >= _LEAST_SAMPLES).all())

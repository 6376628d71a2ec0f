"""Spikes: measurements that go out and come back faster than the vehicle can.

A sample is a spike when it departs to one side from the median of five samples before and of five after by more than
the noise and the vehicle's motion allow, and those two agree. Steps, turns and slow excursions do not: there the two
medians differ, or follow. A speed must also depart from what depth rate and pitch say, so that a motion that is real
is none, and cannot be less than the depth rate.

A step of depth that is farther than a vehicle can move is a leap.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import median_filter

#: Samples on either side; spikes of up to two are found at once, longer ones in as many passes.
SIDE, PASSES = 5, 4
#: Departure that counts, in 1-sigma of the noise, and the share of it by which the two sides may differ.
GATE, AGREE = 8.0, 0.4
#: Least departures that count: m, rad (an autopilot that hunts swings by 10° and back), m/s.
LEAST_DEPTH, LEAST_PITCH, LEAST_SPEED = 1.0, math.radians(20.0), 0.04
#: The vehicle is nowhere faster than this, m/s; nor slower than its depth rate by more than this.
FASTEST, SLOWER = 2.5, 0.06
#: A step of depth is a leap if it is this much (m) more than the way of the fastest vehicle.
LEAP = 10.0
#: Speed in a manoeuvre is judged by samples closer than this (s) only: meanwhile the vehicle may gather way.
QUICK = 15.0
#: Depth rate is taken over this time, s.
SPAN = 20.0
#: Flatter than this (rad) depth rate says nothing about speed.
FLAT = math.radians(8.0)


def noise(value: np.ndarray) -> float:
    """Return the 1-sigma of white noise on a smooth series of shape (n,), by the median of its third differences."""
    if value.size < 8:
        return 0.0
    return float(np.median(np.abs(np.diff(value, 3)))) / (0.6745 * math.sqrt(20.0))


def out_and_back(value: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Return where `value` leaves both of its neighbourhoods to one side by more than `allowed`.

    Parameters
    ----------
    value, allowed
        Finite samples in order of time, and the departure that is allowed, shape (n,).

    Returns
    -------
    ndarray
        Boolean, shape (n,).
    """
    n = value.size
    out = np.zeros(n, dtype=bool)
    if n < 2 * SIDE + 1:
        return out
    middle = median_filter(value, SIDE, mode="nearest")
    half = SIDE // 2 + 1
    inner = slice(half, n - half)
    before, after = middle[: n - 2 * half], middle[2 * half :]
    off, other = value[inner] - before, value[inner] - after
    least = np.minimum(np.abs(off), np.abs(other))
    out[inner] = (off * other > 0.0) & (least > allowed[inner]) & (np.abs(before - after) < AGREE * least)
    return out


def _repeated(value: np.ndarray, allowed: np.ndarray, second: np.ndarray | None = None) -> np.ndarray:
    """Return the spikes of `value` (and of `second` at the same samples), those found left out and looked for again."""
    kept = np.ones(value.size, dtype=bool)
    for _ in range(PASSES):
        found = out_and_back(value[kept], allowed[kept])
        if second is not None:
            found &= out_and_back(second[kept], allowed[kept])
        if not found.any():
            break
        kept[np.flatnonzero(kept)[found]] = False
    return ~kept


def _reach(time: np.ndarray) -> np.ndarray:
    """Return the time from a sample to the farthest of its neighbourhood, s."""
    index = np.arange(time.size)
    before, after = time[np.maximum(index - SIDE, 0)], time[np.minimum(index + SIDE, time.size - 1)]
    return np.asarray(np.maximum(time - before, after - time))


def depth_spikes(time: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return where `depth` [m] at `time` [s], finite, shape (n,), is a spike: more than three times the usual rate."""
    if time.size < 2 * SIDE + 1:
        return np.zeros(time.size, dtype=bool)
    rate = np.abs(np.diff(depth)) / np.maximum(np.diff(time), 1e-3)
    moving = rate[rate > 0.02]
    usual = min(3.0 * float(np.median(moving)), FASTEST) if moving.size else 0.0
    return _repeated(depth, np.maximum(GATE * noise(depth), LEAST_DEPTH) + usual * _reach(time))


def leaps(time: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return from where `depth`, m, leaps to its next record at `time`, s, shape (m,): a part of the log is missing.

    Or its clock is wrong, or the sensor's zero: between the two records the vehicle was anywhere.
    """
    leaping = np.zeros(time.size, dtype=bool)
    known = np.flatnonzero(np.isfinite(depth))
    farther = np.abs(np.diff(depth[known])) > LEAP + FASTEST * np.diff(time[known])
    leaping[known[:-1][farther]] = True
    return leaping


def pitch_spikes(time: np.ndarray, pitch: np.ndarray) -> np.ndarray:
    """Return where `pitch` [rad] at `time` [s], finite, shape (n,), is a spike; beside a pause nobody can say."""
    if time.size < 2 * SIDE + 1:
        return np.zeros(time.size, dtype=bool)
    allowed = np.full(pitch.size, max(GATE * noise(pitch), LEAST_PITCH))
    allowed[_reach(time) > 4.0 * SIDE * float(np.median(np.diff(time)))] = np.inf
    return _repeated(pitch, allowed)


def speed_spikes(
    time: np.ndarray,
    speed: np.ndarray,
    std: np.ndarray,
    depth_rate: np.ndarray,
    pitch: np.ndarray,
    manoeuvre: np.ndarray,
) -> np.ndarray:
    """Return where a speed sensor reports what cannot be.

    Parameters
    ----------
    time, speed, std
        Speed through water and its 1-sigma [m/s], finite, shape (n,).
    depth_rate, pitch
        Rate of depth [m/s] over `SPAN` seconds and pitch [rad] at these instants, shape (n,).
    manoeuvre
        Whether pitch or engine are changing there, boolean of shape (n,).
    """
    impossible = (speed < -SLOWER) | (speed > FASTEST)
    impossible |= ~manoeuvre & (speed + 3.0 * std + SLOWER < np.abs(depth_rate))
    kept = ~impossible
    if kept.sum() < 2 * SIDE + 1:
        return impossible
    value = speed[kept]
    implied = np.abs(depth_rate) / np.maximum(np.abs(np.sin(pitch)), math.sin(FLAT))
    extra = (speed - np.where(np.abs(pitch) < FLAT, 0.0, implied))[kept]
    usual = float(np.median(np.abs(value - median_filter(value, SIDE, mode="nearest")))) / 0.6745
    allowed = np.maximum(np.maximum(GATE * usual, 4.0 * std[kept]), LEAST_SPEED)
    allowed[manoeuvre[kept] & (_reach(time[kept]) > SIDE * QUICK)] = np.inf
    impossible[np.flatnonzero(kept)[_repeated(value, allowed, extra)]] = True
    return impossible

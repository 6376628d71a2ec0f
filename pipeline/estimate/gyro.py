"""Pitch rate, measured: by how much the pitch turns from one record to the next, and how far that can be believed.

A gyro says how pitch changes, not what it is; its bias wanders. So its integral over each step is an input that moves
the state θ, its bias is a state, and what the random walk of θ then has to bear is no more than the noise of the gyro
and what it missed between its samples. How much that is is read off the mission: from how pitch less the integrated
rate wanders, in steady flight and in manoeuvres. Where pitch wanders hardly less after the rate is taken off than
before, the gyro is not used: a stuck one, one of wrong sign or unit, one that reports too seldom.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: The rate is integrated over pauses up to this many of its usual intervals.
PAUSES = 3.0
#: Time (s) on either side over which a walk is measured, two samples of pitch at least; the fewest such stretches that
#: are believed; and the least turn (rad) in one that shows what a gyro is worth in manoeuvres.
REACH, FEWEST, TURN = 12.0, 20, np.radians(5.0)
#: A gyro is used where it takes away more than this share of the walk.
WORTH = 0.5
#: No gyro is believed to leave less of a walk than this, rad²/s: 0.01° in a second.
LEAST = np.radians(0.01) ** 2


class Walks(NamedTuple):
    """Random walk of θ less the integrated rate, rad²/s; NaN where the gyro is not used."""

    steady: float
    manoeuvre: float


def turns(time: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return by how much the pitch turns from each record to the next, rad, shape (m,); NaN where that is not known.

    Parameters
    ----------
    time
        Instants, s, increasing, shape (m,).
    rate
        Measured rate of pitch, rad/s, nose up positive, NaN where there is none, shape (m,). Between two samples it
        is a straight line, unless they are `PAUSES` times as far apart as is usual.
    """
    turn = np.full(time.size, np.nan)
    known = np.flatnonzero(np.isfinite(rate))
    if known.size < 2:
        return turn
    at = time[known]
    interval = np.diff(at)
    after = np.searchsorted(at, time[:-1], side="right")
    inside = (after > 0) & (after < known.size)
    inside[inside] = interval[after[inside] - 1] <= PAUSES * float(np.median(interval))
    middle = np.interp(0.5 * (time[:-1] + time[1:]), at, rate[known])
    turn[:-1][inside] = (middle * np.diff(time))[inside]
    return turn


def walks(
    time: np.ndarray, pitch: np.ndarray, turn: np.ndarray, manoeuvre: np.ndarray, flying: np.ndarray, noise: float
) -> Walks:
    """Return how θ wanders less the integrated rate, in steady flight and in manoeuvres.

    Parameters
    ----------
    time
        Instants, s, increasing, shape (m,).
    pitch
        Measured pitch, rad, NaN where there is none, shape (m,).
    turn
        As from `turns`, shape (m,).
    manoeuvre, flying
        Whether flight is not steady, and whether the vehicle is below the surface, boolean of shape (m,).
    noise
        1-sigma of a measured pitch, rad.
    """
    measured, unknown = np.flatnonzero(np.isfinite(pitch)), np.isnan(turn[:-1])
    if unknown.all() or measured.size < 2:
        return Walks(np.nan, np.nan)
    lag = max(2, round(REACH / float(np.median(np.diff(time[measured])))))
    first, middle, last = measured[: -2 * lag], measured[lag:-lag], measured[2 * lag :]
    if not first.size:
        return Walks(np.nan, np.nan)
    share = (time[middle] - time[first]) / (time[last] - time[first])
    span = share * (time[last] - time[middle])  # a walk of q is off the straight line between the ends by q · span
    error = noise**2 * (1.0 + share**2 + (1.0 - share) ** 2)
    turned = np.append(0.0, np.cumsum(np.where(unknown, 0.0, turn[:-1])))

    def within(flag: np.ndarray) -> np.ndarray:
        """Return how many records have `flag` between the ends of each stretch."""
        count = np.append(0, np.cumsum(flag))
        return np.asarray(count[last] - count[first])

    def walk(value: np.ndarray, where: np.ndarray) -> float:
        off = value[middle] - (1.0 - share) * value[first] - share * value[last]
        return float(np.mean((off**2 - error)[where]) / np.mean(span[where]))

    known = (within(unknown) == 0) & (within(~flying) == 0)
    steady = within(manoeuvre) == 0
    found = []
    for where in (known & steady, known & ~steady & (np.abs(pitch[last] - pitch[first]) > TURN)):
        left, alone = np.nan, np.nan
        if where.sum() >= FEWEST:
            left, alone = walk(pitch - turned, where), walk(pitch, where)
        found.append(max(left, LEAST) if left < WORTH * alone else np.nan)
    return Walks(*found)

"""Peaks of a curve by their prominence: found as `scipy.signal.find_peaks` does, which takes half a second to load."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def peaks(values: Array, prominence: float) -> npt.NDArray[np.int64]:
    """Return where a curve has its peaks, of a flat one its middle.

    Parameters
    ----------
    values
        The curve, shape (n,), all finite.
    prominence
        Least height above the higher of the two saddles that lead to something higher, or to an end of the curve.

    Returns
    -------
    ndarray
        Indices, ascending; an end is no peak.
    """
    begins = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
    ends = np.append(begins[1:], values.size) - 1
    steps = values[begins]
    tops = np.flatnonzero((steps[1:-1] > steps[:-2]) & (steps[1:-1] > steps[2:])) + 1
    heights = steps[tops]
    lows = np.minimum.reduceat(steps, np.append(0, tops)) if steps.size else steps
    before = _saddles(heights, lows[:-1])
    after = _saddles(heights[::-1], lows[:0:-1])[::-1]
    chosen = tops[heights - np.maximum(before, after) >= prominence]
    return np.asarray((begins[chosen] + ends[chosen]) // 2)


def _saddles(heights: Iterable[float], lows: Iterable[float]) -> Array:
    """Return the lowest point between each peak and the next higher one before it, by the lowest from peak to peak."""
    passed: list[tuple[float, float]] = []
    found = []
    for height, lowest in zip(heights, lows, strict=True):
        while passed and passed[-1][0] <= height:
            lowest = min(lowest, passed.pop()[1])
        passed.append((height, lowest))
        found.append(lowest)
    return np.array(found)

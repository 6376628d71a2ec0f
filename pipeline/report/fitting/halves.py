"""Halves of a mission, or further parts, of whole dives flown alike: what one was fitted to is tried on the others.

Dives are matched by their settings – pitch, net buoyancy and propeller on each leg, configuration – and, where these
are alike, by time; of those matched one goes into each part. So no part lacks a setting that the others have, in
whatever rhythm settings alternate. The order in which parts are served turns round from match to match, so that a
drift in time is no difference between them either.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.report.fitting.points import Array, Points

#: What is set on a leg.
SETTINGS = ("pitch", "net_buoyancy", "propeller_speed", "propeller_power")
#: How far configurations are apart: as a propeller that turns from one that does not.
CARRIED = 1.0


def parts_of(points: Points, count: int) -> NDArray[np.int64]:
    """Return in which of `count` parts each block is, shape (n,); all blocks of a dive are in the same.

    Parameters
    ----------
    points
        Blocks, n of them, in time order.
    count
        Number of parts, no more than there are dives.

    Returns
    -------
    ndarray
        Numbers 0 to `count` - 1. Parts differ by one dive at most.
    """
    dives, place = np.unique(points.dive, return_inverse=True)
    settings = _settings(points, place, dives.size)
    part = np.zeros(dives.size, dtype=np.int64)
    left, forward = np.arange(dives.size), True
    while left.size:
        apart = np.sum((settings[left] - settings[left[0]]) ** 2, axis=1)
        matched = np.sort(np.argsort(apart, kind="stable")[:count])
        served = np.arange(count)[:: 1 if forward else -1]
        part[left[matched]] = served[: matched.size]
        left, forward = np.delete(left, matched), not forward
    return part[place]


def _settings(points: Points, place: NDArray[np.intp], count: int) -> Array:
    """Return what was set on each of `count` dives, shape (count, k): each setting over its root mean square."""
    columns = []
    for side in (-1, 0, 1):
        inside = points.direction == side
        blocks = np.bincount(place[inside], minlength=count)
        for name in SETTINGS:
            total = np.bincount(place[inside], np.nan_to_num(getattr(points, name)[inside]), minlength=count)
            mean = total / np.maximum(blocks, 1)
            size = float(np.sqrt(np.mean(mean[blocks > 0] ** 2))) if blocks.any() else 0.0
            columns.append(mean / size if size > 0.0 else np.zeros(count))
    blocks = np.bincount(place, minlength=count)
    for number in range(1, len(points.configurations)):
        columns.append(CARRIED * np.bincount(place, points.configuration == number, minlength=count) / blocks)
    middle = np.bincount(place, points.days, minlength=count) / blocks
    span = float(np.ptp(middle))
    columns.append((middle - middle.min()) / span if span > 0.0 else middle)
    return np.column_stack(columns)

"""A long series made small enough for a page: whole near every apex, the lowest and highest of its stretches elsewhere.

The rule keeps what a reader zooms in on, the turning points to the second, and loses no excursion of the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.records import seconds, timestamps, usable
from pipeline.report.compare import floats

if TYPE_CHECKING:
    from pipeline.table import Columns

Array = NDArray[np.float64]

#: Rows of a series on the page at most; a shorter one is shown whole.
MOST = 40_000
#: Seconds on either side of an apex that are shown whole, the longest that leaves half of `MOST` to the rest.
AROUND = (120.0, 90.0, 60.0, 45.0, 30.0, 20.0, 10.0, 5.0, 2.0)


class Apex(NamedTuple):
    """The deepest point of a dive: number of the dive and POSIX seconds."""

    dive: int
    time: float


@dataclass(frozen=True)
class Thinning:
    """How a series is thinned: the rows that begin a stretch, and what is done in words.

    Attributes
    ----------
    start
        First row of each stretch, shape (k,), increasing from 0.
    rows
        Rows of the series.
    around
        Seconds on either side of an apex that are whole; infinite if all is.
    longest
        Rows of the longest stretch.
    """

    start: NDArray[np.intp]
    rows: int
    around: float
    longest: int

    def instants(self, time: Array) -> Array:
        """Return the time of each point kept: that of a row, or the begin and the middle of a stretch."""
        end = np.append(self.start[1:], self.rows) - 1
        points = np.column_stack([time[self.start], time[(self.start + end + 1) // 2]])
        return points[self._kept()]

    def line(self, values: Array) -> Array:
        """Return the points of a line: lowest and highest of each stretch, in turn in either order."""
        low, high = self._extremes(values, values)
        swapped = np.arange(self.start.size) % 2 == 1
        points = np.column_stack([np.where(swapped, high, low), np.where(swapped, low, high)])
        return points[self._kept()]

    def band(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return the points of a band: in each stretch from the lowest `low` to the highest `high`."""
        lowest, highest = self._extremes(low, high)
        kept = self._kept()
        return np.column_stack([lowest, lowest])[kept], np.column_stack([highest, highest])[kept]

    def _kept(self) -> NDArray[np.bool_]:
        """Return which of two points a stretch are kept, shape (k, 2): one of a single row, both of a longer one."""
        several = np.diff(np.append(self.start, self.rows)) > 1
        return np.column_stack([np.ones_like(several), several])

    def _extremes(self, low: Array, high: Array) -> tuple[Array, Array]:
        lowest = np.fmin.reduceat(low, self.start)
        return lowest, np.fmax.reduceat(high, self.start)


def thinning(time: Array, apexes: Sequence[Apex], most: int = MOST) -> Thinning:
    """Return how a series is thinned to about `most` points.

    Parameters
    ----------
    time
        POSIX seconds, shape (n,), n > 0, increasing.
    apexes
        Near which every row is kept, as many as half of `most` allow.
    most
        Points wanted at most.
    """
    if time.size <= most:
        return Thinning(np.arange(time.size), time.size, np.inf, 1)
    centres = np.array([apex.time for apex in apexes])
    for around in (*AROUND, 0.0):
        first = np.searchsorted(time, centres - around)
        last = np.searchsorted(time, centres + around, side="right")
        steps = np.zeros(time.size + 1, dtype=np.int64)
        np.add.at(steps, first, 1)
        np.subtract.at(steps, last, 1)
        whole = np.cumsum(steps[:-1]) > 0
        if np.count_nonzero(whole) <= most // 2:
            break
    rest = time.size - np.count_nonzero(whole)
    longest = max(2, int(np.ceil(rest / ((most - np.count_nonzero(whole)) / 2.0 - 2.0 * centres.size - 1.0))))
    edges = np.flatnonzero(np.diff(whole)) + 1
    begins = np.concatenate([[0], edges])
    ends = np.append(edges, time.size)
    start = [np.arange(a, b, 1 if whole[a] else longest) for a, b in zip(begins, ends, strict=True)]
    return Thinning(np.concatenate(start), time.size, around, longest)


def apexes(records: Columns) -> list[Apex]:
    """Return the deepest point measured in each dive, in the order of the dives."""
    dive = records["dive"].to_numpy()
    depth = np.where((dive > 0) & usable(records, "pressure"), floats(records, "depth"), np.nan)
    rows = np.flatnonzero(np.isfinite(depth))
    if not rows.size:
        return []
    order = rows[np.lexsort((-depth[rows], dive[rows]))]
    first = order[np.unique(dive[order], return_index=True)[1]]
    time = seconds(records["time"])
    return [Apex(int(dive[row]), float(time[row])) for row in first]


def account(thinned: Thinning, turns: Sequence[Apex]) -> dict[str, object]:
    """Return what of the estimates is shown, for summary.json and the page."""
    points = int(thinned.start.size + np.count_nonzero(np.diff(np.append(thinned.start, thinned.rows)) > 1))
    if np.isinf(thinned.around):
        rule = f"Every one of the {thinned.rows} rows of the estimates is shown."
    else:
        near = f"every row within {thinned.around:.0f} s of the deepest point of each dive; elsewhere " if turns else ""
        rule = (
            f"Of {thinned.rows} rows of the estimates {points} points are shown: {near}the lowest and the highest "
            f"value of every {thinned.longest} rows, so that no excursion is lost."
        )
    return {
        "rows": thinned.rows,
        "points": points,
        "rule": rule,
        "apexes": [
            {"dive": apex.dive, "time": f"{timestamps(np.array([apex.time]))[0]:%Y-%m-%dT%H:%M:%S.%fZ}"}
            for apex in turns
        ],
    }

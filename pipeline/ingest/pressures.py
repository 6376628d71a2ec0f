"""Two records of one pressure: whether they agree, and if not, whether a clock or a unit may be why."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Samples of either record, and the range (dbar), without which nothing is said.
_LEAST, _RANGE = 20, 10.0
#: Two pressures agree where they typically differ by no more than this (dbar), or by this share of the range.
_ALIKE, _SHARE = 3.0, 0.05
#: A sample of the other record is compared where ours has one within this time, s.
_NEAR = 120.0
#: Correlation beyond which one record is a multiple of the other, or the other at another time.
_SAME = 0.98
#: Steps about the largest product among which the best fit is sought.
_AROUND = 60
#: Steps of the grid that lags are sought on, at most, and the shortest step, s.
_GRID, _STEP = 20_000, 10.0


class Unlike(NamedTuple):
    """What is unlike in another record, in words, and whether a unit may be why, not a clock."""

    found: str
    by_unit: bool = False


def unlike(time: Array, pressure: Array, other_time: Array, other: Array) -> Unlike | None:
    """Return what is unlike in another record of the pressure, None where the two agree or nothing can be said.

    Parameters
    ----------
    time, pressure
        s and dbar, shape (n,); NaN where nothing was measured.
    other_time, other
        The same of the other record, shape (m,).
    """
    (t, p), (s, q) = _known(time, pressure), _known(other_time, other)
    if min(t.size, s.size) < _LEAST or max(np.ptp(p), np.ptp(q)) < _RANGE:
        return None
    after = np.clip(np.searchsorted(t, s), 1, t.size - 1)
    near = np.minimum(np.abs(s - t[after - 1]), np.abs(t[after] - s)) <= _NEAR
    ours, theirs = np.interp(s, t, p)[near], q[near]
    apart = float(np.median(np.abs(theirs - ours))) if near.any() else np.inf
    if near.sum() >= _LEAST and apart <= max(_ALIKE, _SHARE * float(np.ptp(p))):
        return None
    if near.sum() >= _LEAST and np.ptp(ours) > 0.0 and np.ptp(theirs) > 0.0:
        factor = float(theirs @ ours / (ours @ ours))
        if np.corrcoef(ours, theirs)[0, 1] > _SAME and abs(factor - 1.0) > _SHARE:
            return Unlike(f"{factor:.3g} times the pressures", by_unit=True)
    lag = _lag(t, p, s, q)
    if lag:
        return Unlike(f"the pressures, {abs(lag):.0f} s {'later' if lag > 0 else 'earlier'},")
    return Unlike(f"pressures that are typically {apart:.0f} dbar off those") if near.sum() >= _LEAST else None


def _known(time: Array, pressure: Array) -> tuple[Array, Array]:
    known = np.isfinite(time) & np.isfinite(pressure)
    order = np.argsort(time[known], kind="stable")
    return time[known][order], pressure[known][order]


def _lag(t: Array, p: Array, s: Array, q: Array) -> float:
    """Return by how much, s, the second record comes later than the first, 0 where they are not alike at any lag."""
    from scipy.signal import correlate, correlation_lags

    step = max(_STEP, (max(t[-1], s[-1]) - min(t[0], s[0])) / _GRID)
    ours, theirs = (
        np.interp(np.arange(clock[0], clock[-1], step), clock, value - value.mean())
        for clock, value in ((t, p), (s, q))
    )
    if min(ours.size, theirs.size) < _LEAST:
        return 0.0
    found = correlate(theirs, ours, method="fft") / np.sqrt((ours @ ours) * (theirs @ theirs))
    best = int(np.argmax(found))
    if found[best] < _SAME:
        return 0.0
    rough = float(correlation_lags(theirs.size, ours.size)[best]) * step + s[0] - t[0]
    # Where the two overlap in part the largest product is not the best fit.
    lags = rough + step * np.arange(-_AROUND, _AROUND + 1)
    lag = float(lags[np.argmin([_misfit(t, p, s - lag, q) for lag in lags])])
    return lag if abs(lag) > 2.0 * step else 0.0


def _misfit(t: Array, p: Array, s: Array, q: Array) -> float:
    inside = (s >= t[0]) & (s <= t[-1])
    return float(np.median(np.abs(np.interp(s[inside], t, p) - q[inside]))) if inside.any() else np.inf

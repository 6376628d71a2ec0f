"""Theil's split of the mean square of an error: what is offset, what goes with the value, and what is scatter."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Of fewer pairs than this nothing is said: two lie on a line whatever they are.
FEWEST = 3
SHARES = ("offset_share", "slope_share", "scatter_share")


def split(predicted: Array, measured: Array, weights: Array) -> dict[str, float]:
    """Return the three shares of the weighted mean square of E = S − D; they add to 1.

    mean E² = (mean S − mean D)² + (s_S − r s_D)² + (1 − r²) s_D² with standard deviations s and the correlation r
    (Theil 1966, Applied Economic Forecasting, ch. 2). The second is zero where D rises by as much as S does.

    Parameters
    ----------
    predicted, measured
        S and D, shape (n,).
    weights
        Shape (n,), not negative, with a sum above zero.

    Returns
    -------
    dict
        `SHARES`; NaN for fewer than `FEWEST` pairs, and where there is no error.
    """
    share = weights / weights.sum()
    square = float(share @ (predicted - measured) ** 2)
    if measured.size < FEWEST or square == 0.0:
        return dict.fromkeys(SHARES, math.nan)
    offset = float(share @ (predicted - measured))
    s, d = predicted - share @ predicted, measured - share @ measured
    spread, own, common = float(share @ s**2), float(share @ d**2), float(share @ (s * d))
    slope = (spread - common) ** 2 / spread if spread > 0.0 else 0.0
    scatter = max(own - (common**2 / spread if spread > 0.0 else 0.0), 0.0)
    parts = (offset**2, slope, scatter)
    return {name: part / sum(parts) for name, part in zip(SHARES, parts, strict=True)}

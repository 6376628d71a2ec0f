"""Theil's split of the mean square of an error: what is offset, what goes with the value, and what is scatter."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.report.rounding import counted

Array = NDArray[np.float64]

#: Of fewer pairs than this nothing is said.
FEWEST = 3
SHARES = ("offset_share", "slope_share", "scatter_share")


def unsplit(predicted: Array, measured: Array, weights: Array) -> str:
    """Return why there are no shares of E = S − D, "" where there are.

    Parameters
    ----------
    predicted, measured, weights
        As for `split`.
    """
    if measured.size < FEWEST:
        found = counted(measured.size, "block")
        return f"{found}, which an offset and a slope meet exactly whatever they are: {FEWEST} are needed"
    return "" if weights @ (predicted - measured) ** 2 > 0.0 else "no error to split"


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
        `SHARES`; NaN where `unsplit` says why.
    """
    if unsplit(predicted, measured, weights):
        return dict.fromkeys(SHARES, math.nan)
    share = weights / weights.sum()
    offset = float(share @ (predicted - measured))
    s, d = predicted - share @ predicted, measured - share @ measured
    spread, own, common = float(share @ s**2), float(share @ d**2), float(share @ (s * d))
    slope = (spread - common) ** 2 / spread if spread > 0.0 else 0.0
    scatter = max(own - (common**2 / spread if spread > 0.0 else 0.0), 0.0)
    parts = (offset**2, slope, scatter)
    return {name: part / sum(parts) for name, part in zip(SHARES, parts, strict=True)}

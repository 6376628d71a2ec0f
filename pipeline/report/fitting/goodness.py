"""Goodness of a fit: whether its residuals are as large as was assumed, by the distribution of χ²."""

from __future__ import annotations

import math
from typing import Any

from pipeline.report.fitting.regression import Problem, Solution
from pipeline.report.rounding import uncertainty

#: Probability of a χ² below, and of one above, its band.
TAIL = 0.025
#: What there is to say where nothing was fitted.
NONE: dict[str, Any] = {
    "chi_square": math.nan,
    "degrees_of_freedom": math.nan,
    "reduced": math.nan,
    "low": math.nan,
    "high": math.nan,
    "verdict": "",
    "sentence": "",
}


def goodness(problem: Problem, alone: Solution, effective: float, scatter: float) -> dict[str, Any]:
    """Return χ² per degree of freedom with the band in which it is in 95 of 100 fits, and what to make of it.

    What is borrowed is held by its prior, a measurement like others: with it χ² has as many degrees of freedom as
    values were fitted less corrections freed. Where residuals are alike, fewer of them count.

    Parameters
    ----------
    problem
        What was fitted.
    alone
        Its solution without the priors of what is free.
    effective
        How many independent blocks the residuals are worth.
    scatter
        Factor by which the depth rates of `problem` were widened already, since they scattered more than was assumed.

    Returns
    -------
    dict
        ``chi_square``, ``degrees_of_freedom`` of the band, ``reduced``, ``low``, ``high``, ``verdict`` (low, high or
        ordinary) and ``sentence``.
    """
    from scipy.special import chdtri

    freedom = problem.size - problem.free
    if freedom < 1:
        return NONE
    chi_square = alone.chi_square + alone.penalty
    independent = max(freedom * min(effective / problem.points.size, 1.0), 1.0)
    reduced = chi_square / freedom
    low, high = (float(chdtri(independent, tail)) / independent for tail in (1.0 - TAIL, TAIL))
    found = {
        "chi_square": chi_square,
        "degrees_of_freedom": independent,
        "reduced": reduced,
        "low": low,
        "high": high,
    }
    verdict = "high" if scatter > 1.0 or reduced > high else "low" if reduced < low else "ordinary"
    return found | {"verdict": verdict, "sentence": _sentence(found, verdict, scatter)}


def _sentence(found: dict[str, Any], verdict: str, scatter: float) -> str:
    words = (
        f"χ² per degree of freedom is {uncertainty(found['reduced'])}, where chance has {uncertainty(found['low'])} to "
        f"{uncertainty(found['high'])} in 95 of 100 fits"
    )
    if verdict == "low":
        return (
            f"{words}: blocks differ less than was assumed, so the motion of the water or the error of the depth rates "
            "was overestimated, and the 1σ of the corrections are too wide"
        )
    if verdict == "high" and scatter > 1.0:
        return (
            f"Depth rates scattered {uncertainty(scatter)} times as much as measurement and moving water explain, more "
            f"than chance has: they count for less in proportion, and the 1σ are wider. With that, {words}"
        )
    if verdict == "high":
        return f"{words}: blocks differ more than was assumed, and the 1σ were widened in proportion"
    return f"{words}: blocks differ as much as was assumed"

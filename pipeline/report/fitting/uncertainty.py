"""How far to trust a fit: coloured residuals, bootstrap by dives, profile likelihood."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pipeline.report.fitting.points import Array
from pipeline.report.fitting.regression import Problem, Solution, solve
from pipeline.report.rounding import counted

#: Resamples of the bootstrap, and the dives that it takes at least.
RESAMPLES, LEAST_DIVES = 400, 5
#: Profile likelihood: points on either side together, how far out, in 1-sigma, and how far where an end is not met.
PROFILE, REACH, FURTHEST = 13, 3.0, 12.0
#: Δχ² of a 95 % interval, and the probability below which residuals are called coloured or too large.
HALF_WIDTH, DOUBTED = 3.841458820694124, 0.025


class Colour(NamedTuple):
    """What neighbouring whitened residuals have in common, and how many of them are worth one that is independent."""

    ljung_box: float
    lags: int
    p_value: float
    effective: float
    coloured: bool


def colour(residual: Array) -> Colour:
    """Return whether whitened residuals in time order, shape (n,), are coloured, and their effective number.

    Ljung and Box (1978), doi:10.1093/biomet/65.2.297; the effective number is n/(1 + 2 Σ ρ_k), summed as long as the
    autocorrelation is positive.
    """
    from scipy.special import chdtrc

    n = residual.size
    lags = min(10, n // 5)
    if lags < 1 or not np.ptp(residual) > 0.0:
        return Colour(math.nan, 0, math.nan, float(n), False)
    centred = residual - residual.mean()
    rho = np.array([float(centred[k:] @ centred[: n - k]) for k in range(lags + 1)]) / float(centred @ centred)
    statistic = n * (n + 2.0) * float(np.sum(rho[1:] ** 2 / (n - np.arange(1, lags + 1))))
    p_value = float(chdtrc(lags, statistic))
    coloured = p_value < DOUBTED
    positive = rho[1:] if (rho[1:] > 0.0).all() else rho[1 : 1 + int(np.argmin(rho[1:] > 0.0))]
    effective = n / (1.0 + 2.0 * float(positive.sum())) if coloured else float(n)
    return Colour(statistic, lags, p_value, effective, coloured)


def bootstrap(problem: Problem, solution: Solution, *, resamples: int = RESAMPLES, seed: int = 0) -> dict[str, Any]:
    """Return what resampling whole dives makes of the corrections that are free.

    Every resample is one Gauss–Newton step from the solution (its normal matrix is a sum over dives), and draws what
    is borrowed anew from its prior.

    Parameters
    ----------
    problem, solution
        What was fitted, and its solution from the data alone.
    resamples
        Number of resamples.
    seed
        Of the generator.

    Returns
    -------
    dict
        ``std`` (half the width of the middle 68.3 %) and ``interval_95`` of each free correction; ``resamples``,
        ``dives``, ``seed``; ``reason`` where there are too few dives.
    """
    dives = np.unique(problem.dives[problem.dives >= 0])
    count = problem.free
    out: dict[str, Any] = {"resamples": 0, "dives": int(dives.size), "seed": seed, "std": [math.nan] * count}
    out |= {"interval_95": [[math.nan, math.nan]] * count, "reason": ""}
    if dives.size < LEAST_DIVES:
        return out | {"reason": f"{counted(dives.size, 'dive')}: at least {LEAST_DIVES} are needed"}
    rng = np.random.default_rng(seed)
    scale, rows = problem.scale, problem.prior_rows(on_free=False)
    slope, left = solution.jacobian * scale, solution.residual
    normal = np.stack([_normal(slope, solution.weights, problem.dives == dive) for dive in dives])
    pull = np.stack([_pull(slope, left, solution.weights, problem.dives == dive) for dive in dives])
    chosen = rng.multinomial(dives.size, np.full(dives.size, 1.0 / dives.size), size=resamples)
    always = problem.dives < 0
    steady = np.concatenate([slope[always], rows])
    offset = np.concatenate([left[always], rows @ (solution.x / scale)])
    noise = rng.standard_normal((resamples, offset.size))
    matrix = np.tensordot(chosen, normal, axes=1) + steady.T @ steady
    right = chosen @ pull + (offset + noise) @ steady
    inverse = np.linalg.pinv(matrix, hermitian=True)
    step = -np.einsum("bij,bj->bi", inverse, right)
    values = (solution.x + step * scale)[:, :count]
    quantiles = np.quantile(values, [0.025, 0.1587, 0.8413, 0.975], axis=0)
    return out | {
        "resamples": resamples,
        "std": (0.5 * (quantiles[2] - quantiles[1])).tolist(),
        "interval_95": np.column_stack([quantiles[0], quantiles[3]]).tolist(),
    }


def _normal(slope: Array, weights: Array, inside: Array) -> Array:
    part = slope[inside]
    return np.asarray(part.T @ (weights[inside, None] * part))


def _pull(slope: Array, left: Array, weights: Array, inside: Array) -> Array:
    return np.asarray(slope[inside].T @ (weights[inside] * left[inside]))


def profile(problem: Problem, solution: Solution, place: int, *, inflation: float = 1.0) -> dict[str, Any]:
    """Return the profile likelihood of the free correction at `place`: least Δχ² with it held at each value.

    Parameters
    ----------
    problem, solution
        What was fitted, and its solution from the data alone.
    place
        Which of the free corrections.
    inflation
        Factor on all 1-sigma for scatter beyond what was assumed; Δχ² is divided by its square.

    Returns
    -------
    dict
        ``value`` and ``delta_chi_square`` along the profile, over three 1-sigma on either side and further where the
        interval ends further out; ``interval_95``, an end NaN where the profile does not reach Δχ² = 3.84.
    """
    std = math.sqrt(solution.covariance[place, place])
    least = solution.chi_square + solution.penalty
    direction = solution.covariance[:, place] / std

    def rise(t: float) -> tuple[float, float]:
        start = solution.x + direction * (t * inflation)
        found = solve(problem, weights=solution.weights, start=start, held=(place,)) if t else solution
        lost = found is None or not found.converged
        worse = math.nan if found is None or lost else max(found.chi_square + found.penalty - least, 0.0)
        return float(start[place]), worse / inflation**2

    steps = np.linspace(0.0, REACH, PROFILE // 2 + 1)
    sides = []
    for sign in (-1.0, 1.0):
        side = [rise(sign * t) for t in steps]
        for t in np.arange(REACH + 1.0, FURTHEST + 1.0):
            if not (math.isnan(_crossing(side)) and math.isfinite(side[-1][1])):
                break
            side.append(rise(sign * t))
        sides.append(side)
    ends = [_crossing(side) for side in sides]
    values, rises = zip(*sides[0][:0:-1], *sides[1], strict=True)
    return {"value": list(values), "delta_chi_square": list(rises), "interval_95": ends}


def _crossing(side: list[tuple[float, float]]) -> float:
    """Return where √Δχ² first reaches that of a 95 % interval, from the least outwards; NaN where it does not."""
    values, rises = zip(*side, strict=True)
    root, limit = np.sqrt(rises), math.sqrt(HALF_WIDTH)
    for k in range(1, len(values)):
        if root[k] >= limit > root[k - 1]:
            share = (limit - root[k - 1]) / (root[k] - root[k - 1])
            return float(values[k - 1] + share * (values[k] - values[k - 1]))
    return math.nan

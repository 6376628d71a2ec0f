"""The regression behind the fit: whitened residuals, priors as further residuals, and the least-squares solution.

The Jacobian is analytic. Unknowns that are borrowed rather than fitted are held by their prior 1-sigma, with the
correlations of the vehicle file. Outliers are weighted down by Huber's function on the whitened residuals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pipeline.report.fitting.model import Model
from pipeline.report.fitting.parameters import borrowed
from pipeline.report.fitting.points import Array, Points
from pipeline.report.fitting.terms import Constraint

#: In place of the residual of a block that the theory cannot fly.
LOST = 1e3
#: Huber's constant: 95 % as efficient as least squares where there is no outlier (Huber 1964).
HUBER = 1.345
#: One mission in a hundred has a residual beyond what is called an outlier, if errors are normal.
FALSE_ALARM = 0.01
#: Re-weightings at most, and the change of a weight that is none.
ROUNDS, SETTLED = 30, 1e-3


@dataclass(frozen=True)
class Problem:
    """What is fitted: the theory, what it is compared with, and what was known before.

    Attributes
    ----------
    model
        The theory; the first `free` of its names are fitted, the others borrowed.
    terms
        Measurements and further constraints.
    priors
        1-sigma before of each correction; NaN or absent where nothing is known.
    free
        Number of corrections that are fitted.
    std_factors
        By what factor the 1-sigma of a term, by its name, are wider than it has them; absent: by none.
    """

    model: Model
    terms: tuple[Constraint, ...]
    priors: Mapping[str, float]
    free: int
    std_factors: Mapping[str, float] = field(default_factory=dict)

    @property
    def points(self) -> Points:
        """The blocks."""
        return self.model.points

    @cached_property
    def dives(self) -> NDArray[np.int64]:
        """Dive of each residual, shape (m,)."""
        return np.concatenate([term.dives for term in self.terms])

    @property
    def size(self) -> int:
        """Number of fitted values m."""
        return self.dives.size

    @property
    def tells_speed(self) -> bool:
        """Whether anything but depth rate tells of speed."""
        return any(term.tells_speed and term.dives.size for term in self.terms)

    def of(self, points: Points) -> Problem:
        """Return the same problem for some of its blocks."""
        return replace(self, model=self.model.at(points), terms=tuple(term.of(points) for term in self.terms))

    def freeing(self, names: Sequence[str]) -> Problem:
        """Return the same problem with `names` fitted and all else borrowed."""
        model = replace(self.model, names=(*names, *borrowed(self.priors, names)))
        return replace(self, model=model, free=len(names))

    def evaluate(self, x: Array) -> tuple[Array, Array]:
        """Return the residuals, shape (m,), and their slopes, shape (m, k), with the corrections `x`."""
        flight = self.model.fly(x)
        factors = [self.std_factors.get(term.name, 1.0) for term in self.terms]
        pairs = list(zip(self.terms, factors, strict=True))
        left = np.concatenate([term.residual(flight) / factor for term, factor in pairs])
        slope = np.concatenate([term.jacobian(flight) / factor for term, factor in pairs])
        lost = ~np.isfinite(left)
        if lost.any():
            left, slope = np.where(lost, LOST, left), np.where(lost[:, None], 0.0, np.nan_to_num(slope))
        return left, slope

    @cached_property
    def scale(self) -> Array:
        """An ordinary size of each correction: its prior 1-sigma where it has one, shape (k,)."""
        known = [self.priors.get(name, math.nan) for name in self.model.names]
        sizes = [self.model.correction(name).size for name in self.model.names]
        return np.array([std if std > 0.0 else size for std, size in zip(known, sizes, strict=True)])

    def prior_rows(self, on_free: bool) -> Array:
        """Return rows W of the prior's residuals W (x / scale), shape (h, k); of what is free only if `on_free`."""
        names = self.model.names
        held = [i for i, name in enumerate(names) if (i >= self.free or on_free) and self.priors.get(name, 0.0) > 0.0]
        matrix = np.eye(len(held))
        for (first, second), value in self.model.vehicle.correlations.items():
            places = [held.index(names.index(name)) for name in (first, second) if _among(name, names, held)]
            if len(places) == 2:
                matrix[places[0], places[1]] = matrix[places[1], places[0]] = value
        rows = np.zeros((len(held), len(names)))
        rows[:, held] = np.linalg.inv(np.linalg.cholesky(matrix + 1e-9 * np.eye(len(held))))
        return rows


def _among(name: str, names: Sequence[str], held: Sequence[int]) -> bool:
    return name in names and names.index(name) in held


@dataclass(frozen=True)
class Solution:
    """Values and covariance of all unknowns, and how well they fit.

    Attributes
    ----------
    x, covariance
        Corrections of the model's names, shape (k,), and their covariance by the assumed errors, shape (k, k).
    residual, jacobian
        Whitened residuals, shape (m,), and their slopes, shape (m, k), not weighted.
    weights
        Weight of each residual, 1 but for outliers, shape (m,).
    chi_square
        Weighted sum of squares of the residuals.
    penalty
        The same of the priors.
    converged
        Whether the search ended at a least.
    """

    x: Array
    covariance: Array
    residual: Array
    jacobian: Array
    weights: Array
    chi_square: float
    penalty: float
    converged: bool

    def bic(self, free: int) -> float:
        """Return Schwarz's criterion: χ² with the priors of what is borrowed, plus ln m for each of the `free`."""
        return self.chi_square + self.penalty + free * math.log(max(self.residual.size, 1))


def solve(
    problem: Problem,
    *,
    prior_on_free: bool = False,
    weights: Array | None = None,
    start: Array | None = None,
    held: Sequence[int] = (),
) -> Solution | None:
    """Return the least-squares solution, or None where the normal matrix is singular.

    Parameters
    ----------
    problem
        What is fitted.
    prior_on_free
        Whether the prior of what is free counts, too; that of what is borrowed always does.
    weights
        Weight of each residual, shape (m,); 1 if left out.
    start
        Corrections to begin with, shape (k,); none if left out.
    held
        Corrections, by their place, that stay as they are in `start`.
    """
    from scipy.optimize import least_squares

    scale, rows = problem.scale, problem.prior_rows(prior_on_free)
    root = np.ones(problem.size) if weights is None else np.sqrt(weights)
    first = np.zeros(scale.size) if start is None else start / scale
    active = np.setdiff1d(np.arange(scale.size), held)
    last: list[tuple[Array, Array, Array]] = []

    def at(part: Array) -> tuple[Array, Array]:
        if not last or not np.array_equal(last[0][0], part):
            y = first.copy()
            y[active] = part
            left, slope = problem.evaluate(y * scale)
            both = np.concatenate([root * left, rows @ y])
            last[:] = [(part.copy(), both, np.concatenate([root[:, None] * slope * scale, rows])[:, active])]
        return last[0][1], last[0][2]

    if root.size + len(rows) < active.size:
        return None
    done = True
    if active.size:
        result = least_squares(
            lambda part: at(part)[0], first[active], jac=lambda part: at(part)[1], method="lm", max_nfev=100, xtol=1e-9
        )
        done, first[active] = bool(result.success), result.x
    x = first * scale
    residual, jacobian = problem.evaluate(x)
    whole = np.concatenate([root[:, None] * jacobian * scale, rows])[:, active]
    try:
        inverse = np.linalg.inv(whole.T @ whole)
    except np.linalg.LinAlgError:
        return None
    covariance = np.zeros((scale.size, scale.size))
    covariance[np.ix_(active, active)] = inverse * np.outer(scale[active], scale[active])
    sound = np.isfinite(inverse).all() and bool((np.diag(inverse) > 0.0).all())
    return Solution(
        x,
        covariance,
        residual,
        jacobian,
        root**2,
        float(np.sum((root * residual) ** 2)),
        float(np.sum((rows @ first) ** 2)),
        bool(done and sound and not (residual == LOST).any()),
    )


def outlying(residual: Array) -> NDArray[np.int64]:
    """Return which whitened residuals, shape (m,), are outliers.

    They lie beyond what one in 1/`FALSE_ALARM` of such sets of normal errors would have, in units of their robust
    scatter.
    """
    from scipy.special import ndtri

    if not residual.size:
        return np.zeros(0, dtype=np.int64)
    limit = -float(ndtri(0.5 * FALSE_ALARM / residual.size))
    return np.flatnonzero(np.abs(residual) > limit * _scatter(residual))


def robust(problem: Problem, plain: Solution, *, prior_on_free: bool = False) -> Solution:
    """Return the solution with residuals weighted by Huber's function if any is an outlier, or else `plain` itself."""
    solution = plain
    if not outlying(plain.residual).size:
        return plain
    for _ in range(ROUNDS):
        size = np.abs(solution.residual) / _scatter(solution.residual)
        weights = np.minimum(1.0, HUBER / np.maximum(size, 1e-12))
        change = float(np.max(np.abs(weights - solution.weights)))
        found = solve(problem, prior_on_free=prior_on_free, weights=weights, start=solution.x)
        if found is None:
            return plain
        solution = found
        if change < SETTLED:
            break
    return solution


def _scatter(residual: Array) -> float:
    """Return the robust scatter of whitened residuals, at least 1: from their median size."""
    return max(1.0, 1.4826 * float(np.median(np.abs(residual))))

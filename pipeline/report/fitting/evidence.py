"""Evidence: how probable the data are under a hypothesis, whatever its unknowns are.

Unknowns are x = m + L y with y standard normal: what the vehicle file states, and along one more column the cause.
The mode is found by Gauss–Newton steps, the integral over y by Laplace's approximation, exact where theory is linear:
of whitened data, −2 ln p = χ² + |y|² + ln det(I + LᵀJᵀJL) + n ln 2π. For BIC (Schwarz 1978,
doi:10.1214/aos/1176344136) the cause's own unknown is left free and paid for by ln n.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pipeline.report.fitting.points import Array
from pipeline.report.fitting.regression import Problem

#: Gauss–Newton ends when a step is shorter than this, in 1-sigma, or after so many.
AT_REST, STEPS = 1e-4, 25


class Prior(NamedTuple):
    """Unknowns before the data: x = mean + root @ y, mean of shape (p,), root of shape (p, q)."""

    mean: Array
    root: Array


class Posterior(NamedTuple):
    """Unknowns after the data, and how well the hypothesis did.

    Attributes
    ----------
    x, covariance
        Mode and covariance of the unknowns, shapes (p,) and (p, p).
    y
        The mode in units of the prior, shape (q,).
    residual
        Whitened, measured less predicted, shape (n,).
    leverage
        Diagonal of the hat matrix: how many unknowns each whitened value has paid for, shape (n,).
    minus_two_log_evidence
        −2 ln p(whitened data).
    """

    x: Array
    covariance: Array
    y: Array
    residual: Array
    leverage: Array
    minus_two_log_evidence: float


def stated(problem: Problem) -> Prior:
    """Return the unknowns as stated by vehicle file and mission: nothing is wrong."""
    names = problem.model.names
    correlation = np.eye(len(names))
    for (first, second), value in problem.model.vehicle.correlations.items():
        if first in names and second in names:
            i, j = names.index(first), names.index(second)
            correlation[i, j] = correlation[j, i] = value
    values, vectors = np.linalg.eigh(correlation)
    root = vectors * np.sqrt(np.maximum(values, 0.0))  # rounding of the correlations forgiven
    std = np.array([problem.priors[name] for name in names])
    return Prior(np.zeros(len(names)), std[:, np.newaxis] * root)


def with_cause(prior: Prior, column: int, spread: float, expected: float = 0.0) -> Prior:
    """Return `prior` with unknown number `column` off by `expected` ± `spread` besides."""
    extra = np.zeros((prior.root.shape[0], 1))
    extra[column] = spread
    mean = prior.mean.copy()
    mean[column] += expected
    return Prior(mean, np.concatenate([prior.root, extra], axis=1))


def posterior(problem: Problem, prior: Prior, *, free: bool = False) -> Posterior:
    """Return the unknowns after the data.

    Parameters
    ----------
    problem
        What was measured, as a function of the unknowns.
    prior
        The hypothesis.
    free
        Whether the last column of the prior is no prior at all: its unknown is left to the data, and the evidence is
        the likelihood at its best value.
    """
    held = np.ones(prior.root.shape[1])
    if free:
        held[-1] = 0.0
    y = np.zeros(held.size)
    left, slope = _evaluated(problem, prior, y)
    cost = float(left @ left)
    for _ in range(STEPS):
        step = np.linalg.lstsq(slope.T @ slope + np.diag(held), -slope.T @ left - held * y, rcond=None)[0]
        fraction, better = 1.0, False
        while not better and fraction > 1e-3:
            new = y + fraction * step
            at = _evaluated(problem, prior, new)
            better = float(at[0] @ at[0] + held @ new**2) <= cost
            fraction *= 0.5
        if not better:
            break
        y, (left, slope) = new, at
        cost = float(left @ left + held @ y**2)
        if np.max(np.abs(step)) < AT_REST:
            break
    known = slope.T @ slope
    inverse = np.linalg.pinv(known + np.diag(held), hermitian=True)
    kept = held > 0.0
    _sign, spread = np.linalg.slogdet(np.eye(int(kept.sum())) + known[np.ix_(kept, kept)])
    return Posterior(
        prior.mean + prior.root @ y,
        prior.root @ inverse @ prior.root.T,
        y,
        left,
        np.einsum("ij,jk,ik->i", slope, inverse, slope),
        float(cost + spread + problem.size * math.log(2.0 * math.pi)),
    )


def information(problem: Problem, prior: Prior, columns: Sequence[int]) -> Array:
    """Return the information that the data have of the unknowns `columns`, whatever all others are within `prior`.

    Their own stated 1-sigma counts as doubt too: this is how well a change on top of it would be seen.

    Returns
    -------
    ndarray
        Shape (len(columns), len(columns)), inverse variance in the units of the unknowns.
    """
    _left, slope = problem.evaluate(prior.mean)
    nuisance, wanted = slope @ prior.root, slope[:, list(columns)]
    inner = np.linalg.solve(np.eye(nuisance.shape[1]) + nuisance.T @ nuisance, nuisance.T @ wanted)
    return np.asarray(wanted.T @ wanted - (wanted.T @ nuisance) @ inner)


def separation(known: Array, first: int, second: int | None, change: float) -> float:
    """Return the expected difference in χ² between a true cause and another one, or none at all.

    Parameters
    ----------
    known
        As `information` gives it.
    first, second
        Number of the true cause and of its rival; None: nothing.
    change
        How much the true cause changes its unknown.
    """
    own = known[first, first]
    if second is not None and known[second, second] > 0.0:
        own -= known[first, second] ** 2 / known[second, second]
    return float(max(own, 0.0) * change**2)


def _evaluated(problem: Problem, prior: Prior, y: Array) -> tuple[Array, Array]:
    """Return the whitened residuals and their slopes in y."""
    left, slope = problem.evaluate(prior.mean + prior.root @ y)
    return left, slope @ prior.root

"""A linear, time-varying problem with missing data, and what its solution is.

State x_k (n values), k = 0 … m−1::

    x_0     ~ N(mean_0, covariance_0)
    x_{k+1} = F_k x_k + shift_k + noise,   noise ~ N(0, Q_k)
    y_kj    = h_j · x_k + error,           error ~ N(0, variance_kj),   j = 0 … p−1

What couples a vehicle's states is sparse, and only that is stored. F_k is diagonal (`decay`) but for the `coupled`
rows; Q_k is diagonal (`noise`) but for the covariance of one state, `driven`, with the others (`cross`); h_j has at
most two entries. Every y_kj may be NaN: no measurement, taken at its own instant.

Considered parameters are unknown constants that the data are not allowed to change (Schmidt 1966): the estimate is
carried together with its derivative with respect to each of them, which costs one more mean and no covariance. The
covariance plus the squares of these derivatives is that of the estimate's true error.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Problem(NamedTuple):
    """A linear, time-varying problem; m instants, n states, p kinds of measurement, r coupled rows, c parameters.

    Considered parameters have unit variance: `shift` and `observed_by` hold changes per 1-sigma.
    """

    mean_0: np.ndarray  # (n,)
    covariance_0: np.ndarray  # (n, n)
    decay: np.ndarray  # (m, n): diagonal of F; ignored where a row is coupled
    coupled: np.ndarray  # (r,): states whose row of F is given
    rows: np.ndarray  # (m, r, n): those rows
    shift: np.ndarray  # (m, r, 1 + c): what is added to them; then its change with each considered parameter
    noise: np.ndarray  # (m, n): diagonal of Q
    cross: np.ndarray  # (m, n): covariance of the noise of the state `driven` with that of the others
    driven: int
    seen: np.ndarray  # (p, 2): the states measured; the second may be any where its weight is zero
    weight: np.ndarray  # (p, 2): h_j
    observed: np.ndarray  # (m, p), NaN = none
    observed_by: np.ndarray  # (p, c): change of the measurement with each considered parameter
    variance: np.ndarray  # (m, p)


class Solution(NamedTuple):
    """What filter and smoother return."""

    mean: (
        np.ndarray
    )  # (m, n, 1 + c): smoothed; then its change with each considered parameter, and what was left room for
    covariance: np.ndarray  # (m, n, n): smoothed, considered parameters held; (0, n, n) unless asked for
    innovation: np.ndarray  # (m, p), NaN where nothing was observed
    innovation_variance: np.ndarray  # (m, p)
    log_likelihood: float


def transition(problem: Problem) -> np.ndarray:
    """Return F_k as full matrices, shape (m, n, n)."""
    m, n = problem.decay.shape
    full = np.zeros((m, n, n))
    full[:, np.arange(n), np.arange(n)] = problem.decay
    full[:, problem.coupled, :] = problem.rows
    return full


def process(problem: Problem) -> np.ndarray:
    """Return Q_k as full matrices, shape (m, n, n)."""
    m, n = problem.decay.shape
    full = np.zeros((m, n, n))
    others = np.arange(n) != problem.driven
    full[:, problem.driven, others] = full[:, others, problem.driven] = problem.cross[:, others]
    full[:, np.arange(n), np.arange(n)] = problem.noise
    return full


def design(problem: Problem) -> np.ndarray:
    """Return the rows h_j, shape (p, n)."""
    p, n = problem.seen.shape[0], problem.mean_0.size
    full = np.zeros((p, n))
    for s in range(2):
        np.add.at(full, (np.arange(p), problem.seen[:, s]), problem.weight[:, s])
    return full


def unconsidered(problem: Problem) -> Problem:
    """Return `problem` without its considered parameters."""
    if problem.shift.shape[2] == 1:
        return problem
    shift = np.ascontiguousarray(problem.shift[:, :, :1])
    return problem._replace(shift=shift, observed_by=np.empty((len(problem.seen), 0)))

"""Kalman filter and Rauch–Tung–Striebel smoother for a linear, time-varying problem with missing data, compiled.

State x_k (n values), k = 0 … m−1::

    x_0     ~ N(mean_0, covariance_0)
    x_{k+1} = transition_k x_k + shift_k + noise,   noise ~ N(0, process_k)
    y_kj    = design_j · x_k + error,               error ~ N(0, variance_kj),   j = 0 … p−1

Every y_kj may be NaN: no measurement. Updates are sequential scalars in Joseph form, so that no matrix is
inverted in the filter; the smoother solves with the Cholesky factor of the predicted covariance.
Rauch, Tung & Striebel (1965), doi:10.2514/3.3166; Bierman (1977), *Factorization Methods*, ch. II.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit


class Problem(NamedTuple):
    """A linear, time-varying state-space problem; shapes with m instants, n states, p kinds of measurement."""

    mean_0: np.ndarray  # (n,)
    covariance_0: np.ndarray  # (n, n)
    transition: np.ndarray  # (m, n, n), the last one unused
    shift: np.ndarray  # (m, n), the last one unused
    process: np.ndarray  # (m, n, n), the last one unused
    design: np.ndarray  # (p, n)
    observed: np.ndarray  # (m, p), NaN = none
    variance: np.ndarray  # (m, p)


class Solution(NamedTuple):
    """What filter and smoother return."""

    mean: np.ndarray  # (m, n) smoothed
    covariance: np.ndarray  # (m, n, n) smoothed
    innovation: np.ndarray  # (m, p), NaN where nothing was observed
    innovation_variance: np.ndarray  # (m, p)
    log_likelihood: float


@njit(cache=True)
def _update(
    x: np.ndarray, P: np.ndarray, h: np.ndarray, y: float, r: float, gain: np.ndarray, row: np.ndarray
) -> tuple[float, float]:
    """Update `x` and `P` in place with the scalar measurement y = h·x + N(0, r); return innovation and variance."""
    n = x.size
    innovation = y
    variance = r
    for i in range(n):
        innovation -= h[i] * x[i]
        row[i] = 0.0
        for j in range(n):
            if h[j] != 0.0:
                row[i] += P[i, j] * h[j]
    for i in range(n):
        variance += h[i] * row[i]
    for i in range(n):
        gain[i] = row[i] / variance
        x[i] += gain[i] * innovation
    for i in range(n):
        for j in range(i + 1):
            # Joseph form (I − K h) P (I − K h)ᵀ + K r Kᵀ for a scalar, written symmetrically
            value = P[i, j] - gain[i] * row[j] - row[i] * gain[j] + gain[i] * variance * gain[j]
            P[i, j] = value
            P[j, i] = value
    return innovation, variance


@njit(cache=True)
def _predict(
    F: np.ndarray, c: np.ndarray, Q: np.ndarray, x: np.ndarray, P: np.ndarray, work: np.ndarray, out: np.ndarray
) -> None:
    """Write F x + c into the last row of `out` and F P Fᵀ + Q into the others; zeros of F are skipped."""
    n = x.size
    for i in range(n):
        value = c[i]
        for j in range(n):
            work[i, j] = 0.0
        for k in range(n):
            f = F[i, k]
            if f != 0.0:
                value += f * x[k]
                for j in range(n):
                    work[i, j] += f * P[k, j]
        out[n, i] = value
    for i in range(n):
        for j in range(i + 1):
            value = Q[i, j]
            for k in range(n):
                if F[j, k] != 0.0:
                    value += work[i, k] * F[j, k]
            out[i, j] = value
            out[j, i] = value


@njit(cache=True)
def _filter(
    problem: Problem, means: np.ndarray, covariances: np.ndarray, predicted: np.ndarray, keep: bool
) -> tuple[np.ndarray, np.ndarray, float]:
    """Run the filter; store filtered moments and predictions (covariance over mean) if `keep`."""
    m, p = problem.observed.shape
    n = problem.mean_0.size
    x = problem.mean_0.copy()
    P = problem.covariance_0.copy()
    work = np.empty((n, n))
    out = np.empty((n + 1, n))
    gain = np.empty(n)
    row = np.empty(n)
    innovations = np.full((m, p), np.nan)
    variances = np.full((m, p), np.nan)
    log_likelihood = 0.0
    for k in range(m):
        for j in range(p):
            y = problem.observed[k, j]
            if not math.isnan(y):
                innovation, s = _update(x, P, problem.design[j], y, problem.variance[k, j], gain, row)
                innovations[k, j] = innovation
                variances[k, j] = s
                log_likelihood -= 0.5 * (math.log(2.0 * math.pi * s) + innovation * innovation / s)
        if keep:
            means[k] = x
            covariances[k] = P
        if k < m - 1:
            _predict(problem.transition[k], problem.shift[k], problem.process[k], x, P, work, out)
            x[:] = out[n]
            P[:, :] = out[:n]
            if keep:
                predicted[k] = out
    return innovations, variances, log_likelihood


@njit(cache=True)
def _cholesky_solve(A: np.ndarray, B: np.ndarray, L: np.ndarray) -> None:
    """Replace the rows of `B` by their solutions of A x = row, A symmetric positive definite; `L` is work space."""
    n = A.shape[0]
    for i in range(n):
        for j in range(i + 1):
            value = A[i, j]
            for k in range(j):
                value -= L[i, k] * L[j, k]
            L[i, j] = math.sqrt(max(value, 1e-300)) if i == j else value / L[j, j]
    for r in range(B.shape[0]):
        for i in range(n):
            value = B[r, i]
            for k in range(i):
                value -= L[i, k] * B[r, k]
            B[r, i] = value / L[i, i]
        for i in range(n - 1, -1, -1):
            value = B[r, i]
            for k in range(i + 1, n):
                value -= L[k, i] * B[r, k]
            B[r, i] = value / L[i, i]


@njit(cache=True)
def _smooth(transition: np.ndarray, means: np.ndarray, covariances: np.ndarray, predicted: np.ndarray) -> None:
    """Turn filtered into smoothed moments, in place, from the last instant back."""
    m, n = means.shape
    gain = np.empty((n, n))
    L = np.zeros((n, n))
    change = np.empty((n, n))
    for k in range(m - 2, -1, -1):
        F = transition[k]
        P = covariances[k]
        for i in range(n):
            for j in range(n):
                value = 0.0
                for q in range(n):
                    if F[j, q] != 0.0:
                        value += P[i, q] * F[j, q]
                gain[i, j] = value
        _cholesky_solve(predicted[k, :n], gain, L)
        for i in range(n):
            for j in range(n):
                value = 0.0
                for q in range(n):
                    value += gain[i, q] * (covariances[k + 1, q, j] - predicted[k, q, j])
                change[i, j] = value
        for i in range(n):
            for j in range(n):
                means[k, i] += gain[i, j] * (means[k + 1, j] - predicted[k, n, j])
        for i in range(n):
            for j in range(i + 1):
                value = P[i, j]
                for q in range(n):
                    value += change[i, q] * gain[j, q]
                P[i, j] = value
                P[j, i] = value


def solve(problem: Problem) -> Solution:
    """Return the smoothed mean and covariance of every state, and the innovations of the filter.

    Parameters
    ----------
    problem
        The state-space problem; m instants, n states, p kinds of measurement.

    Returns
    -------
    Solution
        Smoothed moments, innovations and the log-likelihood of the measurements.
    """
    m, n = problem.observed.shape[0], problem.mean_0.size
    means, covariances = np.empty((m, n)), np.empty((m, n, n))
    predicted = np.empty((max(m - 1, 0), n + 1, n))
    innovation, variance, log_likelihood = _filter(problem, means, covariances, predicted, True)
    _smooth(problem.transition, means, covariances, predicted)
    return Solution(means, covariances, innovation, variance, log_likelihood)


def log_likelihood(problem: Problem) -> float:
    """Return the log-likelihood of the measurements of `problem`, by the filter alone."""
    nothing = np.empty((0, 0))
    n = problem.mean_0.size
    value: float = _filter(problem, nothing, np.empty((0, n, n)), np.empty((0, n + 1, n)), False)[2]
    return value

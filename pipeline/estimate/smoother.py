"""Kalman filter and smoother for a linear, time-varying problem with missing data, compiled.

State x_k (n values), k = 0 … m−1::

    x_0     ~ N(mean_0, covariance_0)
    x_{k+1} = F_k x_k + shift_k + noise,   noise ~ N(0, Q_k)
    y_kj    = h_j · x_k + error,           error ~ N(0, variance_kj),   j = 0 … p−1

What couples a vehicle's states is sparse, and only that is stored. F_k is diagonal (`decay`) but for the `coupled`
rows; Q_k is diagonal (`noise`) but for the covariance of one state, `driven`, with the others (`cross`); h_j has at
most two entries. Every y_kj may be NaN: no measurement, taken at its own instant.

Updates are sequential scalars in Joseph form; the smoother is the modified Bryson–Frazier form of the
Rauch–Tung–Striebel smoother, which inverts nothing (Bierman 1977, *Factorization Methods*, ch. X;
Rauch, Tung & Striebel 1965, doi:10.2514/3.3166).

Considered parameters are unknown constants that the data are not allowed to change (Schmidt 1966): the estimate is
carried together with its derivative with respect to each of them, which costs one more mean and no covariance.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

#: What an operation may lose of a variance to rounding is added to it, so that covariances stay positive.
ROUNDING = 4.0 * 2.0**-52
#: The quick smoother subtracts; where it leaves less than this share of a variance, the slow one, which only adds,
#: takes its place.
LEAST = 1e-8


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

    mean: np.ndarray  # (m, n, 1 + c): smoothed; then its change with each considered parameter
    covariance: np.ndarray  # (m, n, n): smoothed, considered parameters held
    innovation: np.ndarray  # (m, p), NaN where nothing was observed
    innovation_variance: np.ndarray  # (m, p)
    log_likelihood: float


@njit(cache=True, nogil=True)
def _update(
    size: tuple[int, ...],
    x: np.ndarray,
    P: np.ndarray,
    a: int,
    b: int,
    weight_a: float,
    weight_b: float,
    variance: float,
    innovation: np.ndarray,
    gain: np.ndarray,
    row: np.ndarray,
) -> float:
    """Update `x` and `P` in place; `innovation` (1 + c,) comes in as the measurement, goes out as innovation."""
    n = len(size)
    for i in range(n):
        row[i] = weight_a * P[i, a] + weight_b * P[i, b]
    total: float = variance + weight_a * row[a] + weight_b * row[b]
    lost = ROUNDING
    if weight_b != 0.0:
        lost *= 1.0 + math.sqrt((weight_a * weight_a * P[a, a] + weight_b * weight_b * P[b, b]) / total)
    for i in range(n):
        gain[i] = row[i] / total
    for q in range(innovation.size):
        innovation[q] -= weight_a * x[a, q] + weight_b * x[b, q]
        for i in range(n):
            x[i, q] += gain[i] * innovation[q]
    for i in range(n):
        before = P[i, i]
        for j in range(i + 1):
            value = P[i, j] - gain[i] * row[j]
            P[i, j] = value
            P[j, i] = value
        P[i, i] += lost * before
    return total


@njit(cache=True, nogil=True)
def _predict(
    size: tuple[int, ...], problem: Problem, k: int, x: np.ndarray, P: np.ndarray, moved: np.ndarray, FP: np.ndarray
) -> None:
    """Replace `x` by F x + shift and `P` by F P Fᵀ + Q; `FP` (n, n) goes out as F P, `moved` is (r,)."""
    n = len(size)
    decay, rows, noise, cross = problem.decay[k], problem.rows[k], problem.noise[k], problem.cross[k]
    coupled, shift = problem.coupled, problem.shift[k]
    for r in range(coupled.size):
        value = 0.0
        for j in range(n):
            value += rows[r, j] * rows[r, j] * P[j, j]
        moved[r] = ROUNDING * n * value
    for i in range(n):
        for j in range(n):
            FP[i, j] = decay[i] * P[i, j]
    for r in range(coupled.size):
        for j in range(n):
            value = 0.0
            for i in range(n):
                value += rows[r, i] * P[i, j]
            FP[coupled[r], j] = value
    for i in range(n):
        for j in range(i + 1):
            value = FP[i, j] * decay[j]
            P[i, j] = value
            P[j, i] = value
    for r in range(coupled.size):
        for i in range(n):
            value = 0.0
            for j in range(n):
                value += FP[i, j] * rows[r, j]
            P[i, coupled[r]] = value
    for r in range(coupled.size):
        for i in range(n):
            P[coupled[r], i] = P[i, coupled[r]]
    for r in range(coupled.size):
        P[coupled[r], coupled[r]] += moved[r]
    d = problem.driven
    for i in range(n):
        P[i, i] += noise[i]
        if i != d:
            P[d, i] += cross[i]
            P[i, d] += cross[i]
    for q in range(x.shape[1]):
        for r in range(coupled.size):
            value = shift[r, q]
            for i in range(n):
                value += rows[r, i] * x[i, q]
            moved[r] = value
        for i in range(n):
            x[i, q] *= decay[i]
        for r in range(coupled.size):
            x[coupled[r], q] = moved[r]


@njit(cache=True, nogil=True)
def _filter(
    size: tuple[int, ...],
    problem: Problem,
    keep: bool,
    means: np.ndarray,
    covariances: np.ndarray,
    gains: np.ndarray,
    innovations: np.ndarray,
    variances: np.ndarray,
) -> float:
    """Run the filter and return the log-likelihood; store filtered moments and innovations if `keep`."""
    n = len(size)
    m, p = problem.observed.shape
    c = problem.observed_by.shape[1]
    x = np.zeros((n, 1 + c))
    x[:, 0] = problem.mean_0
    P = problem.covariance_0.copy()
    FP, moved = np.empty((n, n)), np.empty(problem.coupled.size)
    gain, row, innovation = np.empty(n), np.empty(n), np.empty(1 + c)
    log_likelihood = 0.0
    for k in range(m):
        for j in range(p):
            y = problem.observed[k, j]
            if not math.isnan(y):
                innovation[0] = y
                for q in range(c):
                    innovation[1 + q] = problem.observed_by[j, q]
                total = _update(
                    size,
                    x,
                    P,
                    problem.seen[j, 0],
                    problem.seen[j, 1],
                    problem.weight[j, 0],
                    problem.weight[j, 1],
                    problem.variance[k, j],
                    innovation,
                    gain,
                    row,
                )
                log_likelihood -= 0.5 * (math.log(2.0 * math.pi * total) + innovation[0] * innovation[0] / total)
                if keep:
                    variances[k, j] = total
                    for i in range(n):
                        gains[k, j, i] = gain[i]
                    for q in range(1 + c):
                        innovations[k, j, q] = innovation[q]
            elif keep:
                innovations[k, j, 0] = np.nan
                variances[k, j] = np.nan
        if keep:
            for i in range(n):
                for q in range(1 + c):
                    means[k, i, q] = x[i, q]
                for j in range(n):
                    covariances[k, i, j] = P[i, j]
        if k < m - 1:
            _predict(size, problem, k, x, P, moved, FP)
    return log_likelihood


@njit(cache=True, nogil=True)
def _smooth(
    size: tuple[int, ...],
    problem: Problem,
    means: np.ndarray,
    covariances: np.ndarray,
    gains: np.ndarray,
    innovations: np.ndarray,
    variances: np.ndarray,
) -> bool:
    """Turn filtered into smoothed moments, in place, from the last instant back; False where digits run out.

    The adjoints `a` (n, 1 + c) and `A` (n, n) hold what later measurements say: x − P a and P − P A P.
    """
    n = len(size)
    m, p = problem.observed.shape
    c = problem.observed_by.shape[1]
    coupled = problem.coupled
    a, A = np.zeros((n, 1 + c)), np.zeros((n, n))
    column, pivots, work, out, old = (
        np.empty(n),
        np.empty(n),
        np.empty((n, n)),
        np.empty((n, n)),
        np.empty((coupled.size, 1 + c)),
    )
    for k in range(m - 1, -1, -1):
        if k < m - 1:  # a ← Fᵀ a, A ← Fᵀ A F
            decay, rows = problem.decay[k], problem.rows[k]
            for r in range(coupled.size):
                for q in range(1 + c):
                    old[r, q] = a[coupled[r], q]
                    a[coupled[r], q] = 0.0
            for i in range(n):
                for q in range(1 + c):
                    a[i, q] *= decay[i]
                    for r in range(coupled.size):
                        a[i, q] += rows[r, i] * old[r, q]
            for i in range(n):
                for j in range(n):
                    work[i, j] = A[i, j] * decay[j]
                for r in range(coupled.size):
                    work[i, coupled[r]] = 0.0
                for r in range(coupled.size):
                    for j in range(n):
                        work[i, j] += A[i, coupled[r]] * rows[r, j]
            for j in range(n):
                for i in range(n):
                    A[i, j] = work[i, j] * decay[i]
                for r in range(coupled.size):
                    A[coupled[r], j] = 0.0
                for r in range(coupled.size):
                    for i in range(n):
                        A[i, j] += rows[r, i] * work[coupled[r], j]
            for i in range(n):
                for j in range(i):  # what is not symmetric would grow
                    A[j, i] = A[i, j]
        P = covariances[k]
        for i in range(n):
            for j in range(n):
                value = 0.0
                for q in range(n):
                    value += P[i, q] * A[q, j]
                work[i, j] = value
        for i in range(n):
            for j in range(i + 1):
                value = P[i, j]
                for q in range(n):
                    value -= work[i, q] * P[q, j]
                out[i, j] = value
        for j in range(n):  # P − P A P = L D Lᵀ
            pivot = out[j, j]
            for q in range(j):
                pivot -= work[j, q] * work[j, q] * pivots[q]
            if not pivot > LEAST * P[j, j]:
                return False
            pivots[j] = pivot
            for i in range(j + 1, n):
                value = out[i, j]
                for q in range(j):
                    value -= work[i, q] * work[j, q] * pivots[q]
                work[i, j] = value / pivot
        for i in range(n):
            for q in range(1 + c):
                value = 0.0
                for j in range(n):
                    value += P[i, j] * a[j, q]
                means[k, i, q] -= value
        for i in range(n):
            for j in range(i + 1):
                P[i, j] = out[i, j]
                P[j, i] = out[i, j]
        for j in range(p - 1, -1, -1):
            total = variances[k, j]
            if math.isnan(total):
                continue
            # a ← Cᵀ a − h ν/S, A ← Cᵀ A C + h hᵀ/S with C = I − K hᵀ
            gain = gains[k, j]
            square = 1.0 / total
            for i in range(n):
                value = 0.0
                for q in range(n):
                    value += A[i, q] * gain[q]
                column[i] = value
            for i in range(n):
                square += gain[i] * column[i]
            for s in range(2):
                state, h = problem.seen[j, s], problem.weight[j, s]
                if h == 0.0:
                    continue
                for i in range(n):
                    A[i, state] -= h * column[i]
                    A[state, i] -= h * column[i]
                for other in range(2):
                    A[state, problem.seen[j, other]] += h * problem.weight[j, other] * square
            for q in range(1 + c):
                value = innovations[k, j, q] / total
                for i in range(n):
                    value += gain[i] * a[i, q]
                for s in range(2):
                    a[problem.seen[j, s], q] -= problem.weight[j, s] * value
    return True


@njit(cache=True, nogil=True)
def _ahead(
    size: tuple[int, ...],
    problem: Problem,
    steps: np.ndarray,
    stride: int,
    last: np.ndarray,
    error: np.ndarray,
    variance: np.ndarray,
) -> None:
    """Fill `error` and `variance` (starts, s, p); see `predictions`."""
    n = len(size)
    m, p = problem.observed.shape
    x, P, row, gain = np.zeros((n, 1)), problem.covariance_0.copy(), np.empty(n), np.empty(n)
    x[:, 0] = problem.mean_0
    y, Y, FP, moved = x.copy(), P.copy(), np.empty((n, n)), np.empty(problem.coupled.size)
    innovation = np.empty(1)
    for k in range(m):
        for j in range(p):
            innovation[0] = problem.observed[k, j]
            if not math.isnan(innovation[0]):
                a, b, h, g = problem.seen[j, 0], problem.seen[j, 1], problem.weight[j, 0], problem.weight[j, 1]
                _update(size, x, P, a, b, h, g, problem.variance[k, j], innovation, gain, row)
        for s in range(steps.size):
            ahead = k + steps[s]
            if k % (stride * ((steps[s] + stride - 1) // stride)) != 0 or ahead > last[k]:
                continue
            y[:], Y[:] = x, P
            for on in range(k, ahead):
                _predict(size, problem, on, y, Y, moved, FP)
            for j in range(p):
                a, b, h, g = problem.seen[j, 0], problem.seen[j, 1], problem.weight[j, 0], problem.weight[j, 1]
                spread = h * h * Y[a, a] + 2.0 * h * g * Y[a, b] + g * g * Y[b, b]
                error[k // stride, s, j] = problem.observed[ahead, j] - h * y[a, 0] - g * y[b, 0]
                variance[k // stride, s, j] = spread + problem.variance[ahead, j]
        if k < m - 1:
            _predict(size, problem, k, x, P, moved, FP)


@njit(cache=True, nogil=True)
def _solve_in_place(size: tuple[int, ...], P: np.ndarray, right: np.ndarray) -> None:
    """Replace `right` (n, n) by P⁻¹ right, P = L D Lᵀ; `P` is lost; what has no variance of its own counts as known."""
    n = len(size)
    for j in range(n):
        least = ROUNDING * P[j, j]
        for q in range(j):
            P[j, j] -= P[j, q] * P[j, q] * P[q, q] if P[q, q] < math.inf else 0.0
        if not P[j, j] > least:
            P[j, j] = math.inf
        for i in range(j + 1, n):
            for q in range(j):
                P[i, j] -= P[i, q] * P[j, q] * P[q, q] if P[q, q] < math.inf else 0.0
            P[i, j] /= P[j, j]
            for q in range(n):
                right[i, q] -= P[i, j] * right[j, q]
    for j in range(n):
        for q in range(n):
            right[j, q] /= P[j, j]
    for j in range(n - 1, -1, -1):
        for i in range(j):
            for q in range(n):
                right[i, q] -= P[j, i] * right[j, q]


@njit(cache=True, nogil=True)
def _congruence(size: tuple[int, ...], P: np.ndarray, B: np.ndarray, work: np.ndarray, out: np.ndarray) -> None:
    """Add Bᵀ P B to `out`."""
    n = len(size)
    for i in range(n):
        for j in range(n):
            work[i, j] = 0.0
        for q in range(n):
            for j in range(n):
                work[i, j] += P[i, q] * B[q, j]
    for q in range(n):
        for i in range(n):
            for j in range(n):
                out[i, j] += B[q, i] * work[q, j]


@njit(cache=True, nogil=True)
def _by_squares(size: tuple[int, ...], problem: Problem, means: np.ndarray, covariances: np.ndarray) -> None:
    """Turn filtered into smoothed moments, in place, from the last instant but one back.

    With C = P Fᵀ (F P Fᵀ + Q)⁻¹: x + C (x⁺ − F x − shift) and (I − C F) P (I − C F)ᵀ + C (P⁺ + Q) Cᵀ, sums of
    squares alone.
    """
    n = len(size)
    coupled, d = problem.coupled, problem.driven
    columns = means.shape[2]
    x, moved, P, C = np.empty((n, columns)), np.empty(coupled.size), np.empty((n, n)), np.empty((n, n))
    G, work, out = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    for k in range(problem.observed.shape[0] - 2, -1, -1):
        here, after = covariances[k], covariances[k + 1]
        for i in range(n):
            for q in range(columns):
                x[i, q] = means[k, i, q]
            for j in range(n):
                P[i, j] = here[i, j]
        _predict(size, problem, k, x, P, moved, C)
        _solve_in_place(size, P, C)  # now Cᵀ
        decay, rows, noise, cross = problem.decay[k], problem.rows[k], problem.noise[k], problem.cross[k]
        for i in range(n):
            for q in range(n):
                G[i, q] = -decay[i] * C[i, q]
        for r in range(coupled.size):
            for q in range(n):
                G[coupled[r], q] = 0.0
        for r in range(coupled.size):
            for i in range(n):
                for q in range(n):
                    G[i, q] -= rows[r, i] * C[coupled[r], q]
        for i in range(n):
            G[i, i] += 1.0
        for q in range(columns):
            for i in range(n):
                gap = means[k + 1, i, q] - x[i, q]
                for j in range(n):
                    means[k, j, q] += C[i, j] * gap
        for i in range(n):
            for j in range(n):
                out[i, j] = 0.0
                P[i, j] = after[i, j]
        for i in range(n):
            P[i, i] += noise[i]
            if i != d:
                P[d, i] += cross[i]
                P[i, d] += cross[i]
        _congruence(size, here, G, work, out)
        _congruence(size, P, C, work, out)
        for i in range(n):
            for j in range(i + 1):
                here[i, j] = 0.5 * (out[i, j] + out[j, i])
                here[j, i] = here[i, j]


def solve(problem: Problem) -> Solution:
    """Return the smoothed mean and covariance of every state, and the innovations of the filter.

    Parameters
    ----------
    problem
        The state-space problem; m instants, n states, p kinds of measurement, c considered parameters.

    Returns
    -------
    Solution
        Smoothed moments, innovations and the log-likelihood of the measurements.
    """
    (m, p), n, c = problem.observed.shape, problem.mean_0.size, problem.observed_by.shape[1]
    size = (0,) * n
    means, covariances = np.empty((m, n, 1 + c)), np.empty((m, n, n))
    gains, innovations, variances = np.empty((m, p, n)), np.empty((m, p, 1 + c)), np.empty((m, p))
    log_likelihood = _filter(size, problem, True, means, covariances, gains, innovations, variances)
    if not _smooth(size, problem, means, covariances, gains, innovations, variances):
        _filter(size, problem, True, means, covariances, gains, innovations, variances)
        _by_squares(size, problem, means, covariances)
    return Solution(means, covariances, innovations[:, :, 0], variances, log_likelihood)


def innovations(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Return the filter's innovations with their changes, shape (m, p, 1 + c), and variances (m, p); NaN = none."""
    (m, p), n, c = problem.observed.shape, problem.mean_0.size, problem.observed_by.shape[1]
    found, variances = np.full((m, p, 1 + c), np.nan), np.empty((m, p))
    _filter(
        (0,) * n, problem, True, np.empty((m, n, 1 + c)), np.empty((m, n, n)), np.empty((m, p, n)), found, variances
    )
    return found, variances


def predictions(
    problem: Problem, steps: tuple[int, ...], stride: int, last: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return how far measurements are from what the filter predicted some rows before, and the variance of that.

    Parameters
    ----------
    problem
        The state-space problem; m instants, n states, p kinds of measurement.
    steps
        How many rows ahead; s of them.
    stride
        Predictions start from every `stride`-th row, or so many of them apart that none overlap, with all
        measurements up to and at it, and none after.
    last
        The last row that may be predicted from each row, shape (m,).

    Returns
    -------
    error, variance
        Shape (ceil(m / stride), s, p), considered parameters held; NaN where nothing was measured or foretold.
    """
    m, p = problem.observed.shape
    shape = (-(-m // stride), len(steps), p)
    error, variance = np.full(shape, np.nan), np.full(shape, np.nan)
    alone = problem._replace(shift=np.ascontiguousarray(problem.shift[:, :, :1]))
    _ahead((0,) * problem.mean_0.size, alone, np.array(steps), stride, last, error, variance)
    return error, variance


def log_likelihood(problem: Problem) -> float:
    """Return the log-likelihood of the measurements of `problem`, by the filter alone."""
    n, three = problem.mean_0.size, np.empty((0, 0, 0))
    value: float = _filter((0,) * n, problem, False, three, three, three, three, np.empty((0, 0)))
    return value


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

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


# In the kernels `size` and `links` are tuples as long as there are states and coupled rows: the compiler knows both
# numbers and unrolls. Work arrays are parts of one, so that it knows that they do not overlap.


@njit(cache=True, nogil=True, inline="always")
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
    total: float = variance
    lost = ROUNDING
    if weight_b == 0.0:
        for i in range(n):
            row[i] = weight_a * P[a, i]
        total += weight_a * row[a]
    else:
        for i in range(n):
            row[i] = weight_a * P[a, i] + weight_b * P[b, i]
        total += weight_a * row[a] + weight_b * row[b]
        lost *= 1.0 + math.sqrt((weight_a * weight_a * P[a, a] + weight_b * weight_b * P[b, b]) / total)
    for i in range(n):
        gain[i] = row[i] / total
    for q in range(innovation.size):
        innovation[q] -= weight_a * x[a, q] + weight_b * x[b, q]
        for i in range(n):
            x[i, q] += gain[i] * innovation[q]
    for i in range(n):
        before, factor = P[i, i], gain[i]
        for j in range(n):
            P[i, j] -= factor * row[j]
        P[i, i] += lost * before
    for i in range(n):
        for j in range(i):
            P[j, i] = P[i, j]
    return total


@njit(cache=True, nogil=True, inline="always")
def _transition(
    size: tuple[int, ...], links: tuple[int, ...], problem: Problem, k: int, kept: np.ndarray, F: np.ndarray
) -> None:
    """Fill `kept` (n,), the diagonal of F with zeros where a row is coupled, and `F` with those rows."""
    for i in range(len(size)):
        kept[i] = problem.decay[k, i]
    for r in range(len(links)):
        kept[problem.coupled[r]] = 0.0
        for i in range(len(size)):
            F[r, i] = problem.rows[k, r, i]


@njit(cache=True, nogil=True, inline="always")
def _predict(
    size: tuple[int, ...],
    links: tuple[int, ...],
    problem: Problem,
    k: int,
    x: np.ndarray,
    P: np.ndarray,
    kept: np.ndarray,
    moved: np.ndarray,
    F: np.ndarray,
    FP: np.ndarray,
) -> None:
    """Replace `x` by F x + shift and `P` by F P Fᵀ + Q; `FP` goes out as the coupled rows of F P, `moved` is (r,)."""
    n, coupled = len(size), problem.coupled
    _transition(size, links, problem, k, kept, F)
    for r in range(len(links)):
        value = 0.0
        for j in range(n):
            value += F[r, j] * F[r, j] * P[j, j]
        moved[r] = ROUNDING * n * value
        for j in range(n):
            FP[r, j] = F[r, 0] * P[0, j]
        for i in range(1, n):
            value = F[r, i]
            for j in range(n):
                FP[r, j] += value * P[i, j]
    for i in range(n):
        for j in range(n):
            P[i, j] *= kept[i] * kept[j]
    for r in range(len(links)):
        for i in range(n):
            value = FP[r, i] * kept[i]
            P[i, coupled[r]] = value
            P[coupled[r], i] = value
    for r in range(len(links)):
        for s in range(r + 1):
            value = 0.0
            for j in range(n):
                value += FP[r, j] * F[s, j]
            P[coupled[r], coupled[s]] = value
            P[coupled[s], coupled[r]] = value
        P[coupled[r], coupled[r]] += moved[r]
    d = problem.driven
    for i in range(n):
        P[i, i] += problem.noise[k, i]
        if i != d:
            P[d, i] += problem.cross[k, i]
            P[i, d] += problem.cross[k, i]
    for q in range(x.shape[1]):
        for r in range(len(links)):
            value = problem.shift[k, r, q]
            for i in range(n):
                value += F[r, i] * x[i, q]
            moved[r] = value
        for i in range(n):
            x[i, q] *= kept[i]
        for r in range(len(links)):
            x[coupled[r], q] = moved[r]


@njit(cache=True, nogil=True)
def _filter(
    size: tuple[int, ...],
    links: tuple[int, ...],
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
    x, innovation, moved = np.zeros((n, 1 + c)), np.empty(1 + c), np.empty(len(links))
    x[:, 0] = problem.mean_0
    room = np.zeros((4, n, n))
    P, F, FP = room[0], room[1], room[2]
    gain, row, kept = room[3, 0], room[3, 1], room[3, 2]
    P[:] = problem.covariance_0
    squares, logarithms, product = 0.0, 0.0, 1.0
    for k in range(m):
        for j in range(p):
            y = problem.observed[k, j]
            if not math.isnan(y):
                innovation[0] = y
                for q in range(c):
                    innovation[1 + q] = problem.observed_by[j, q]
                a, b, h, g = problem.seen[j, 0], problem.seen[j, 1], problem.weight[j, 0], problem.weight[j, 1]
                total = _update(size, x, P, a, b, h, g, problem.variance[k, j], innovation, gain, row)
                squares += innovation[0] * innovation[0] / total
                product *= 2.0 * math.pi * total
                if not 1e-100 < product < 1e100:
                    logarithms += math.log(product)
                    product = 1.0
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
            _predict(size, links, problem, k, x, P, kept, moved, F, FP)
    return -0.5 * (squares + logarithms + math.log(product))


@njit(cache=True, nogil=True)
def _smooth(
    size: tuple[int, ...],
    links: tuple[int, ...],
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
    a, old = np.zeros((n, 1 + c)), np.empty((len(links), 1 + c))
    room = np.zeros((6, n, n))
    A, P, F, work, out = room[0], room[1], room[2], room[3], room[4]
    column, gain, kept = room[5, 0], room[5, 1], room[5, 2]
    for k in range(m - 1, -1, -1):
        if k < m - 1:  # a ← Fᵀ a, A ← Fᵀ A F
            _transition(size, links, problem, k, kept, F)
            for q in range(1 + c):
                for r in range(len(links)):
                    old[r, q] = a[coupled[r], q]
                for i in range(n):
                    value = a[i, q] * kept[i]
                    for r in range(len(links)):
                        value += F[r, i] * old[r, q]
                    a[i, q] = value
            for i in range(n):
                for j in range(n):
                    work[i, j] = A[i, j] * kept[j]
                for r in range(len(links)):
                    value = A[i, coupled[r]]
                    for j in range(n):
                        work[i, j] += value * F[r, j]
            for i in range(n):
                for j in range(n):
                    A[i, j] = work[i, j] * kept[i]
            for r in range(len(links)):
                for i in range(n):
                    value = F[r, i]
                    for j in range(n):
                        A[i, j] += value * work[coupled[r], j]
            for i in range(n):
                for j in range(i):  # what is not symmetric would grow
                    A[j, i] = A[i, j]
        for i in range(n):
            for j in range(n):
                P[i, j] = covariances[k, i, j]
                out[i, j] = covariances[k, i, j]
        for i in range(n):
            for j in range(n):
                work[i, j] = P[i, 0] * A[0, j]
            for q in range(1, n):
                value = P[i, q]
                for j in range(n):
                    work[i, j] += value * A[q, j]
        for i in range(n):
            for q in range(n):
                value = work[i, q]
                for j in range(n):
                    out[i, j] -= value * P[q, j]
        for i in range(n):
            for q in range(1 + c):
                value = 0.0
                for j in range(n):
                    value += P[i, j] * a[j, q]
                means[k, i, q] -= value
            for j in range(i + 1):
                covariances[k, i, j] = out[i, j]
                covariances[k, j, i] = out[i, j]
        for j in range(n):  # P − P A P = L D Lᵀ
            pivot = out[j, j]
            if not pivot > LEAST * P[j, j]:
                return False
            inverse = 1.0 / pivot
            for i in range(j + 1, n):
                value = out[i, j] * inverse
                for q in range(j + 1, i + 1):
                    out[i, q] -= value * out[q, j]
        for j in range(p - 1, -1, -1):
            total = variances[k, j]
            if math.isnan(total):
                continue
            # a ← Cᵀ a − h ν/S, A ← Cᵀ A C + h hᵀ/S with C = I − K hᵀ
            square = 1.0 / total
            for i in range(n):
                gain[i] = gains[k, j, i]
                column[i] = 0.0
            for q in range(n):
                value = gain[q]
                for i in range(n):
                    column[i] += A[q, i] * value
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
    links: tuple[int, ...],
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
    x, y, innovation, moved = np.zeros((n, 1)), np.zeros((n, 1)), np.empty(1), np.empty(len(links))
    x[:, 0] = problem.mean_0
    room = np.zeros((5, n, n))
    P, Y, F, FP = room[0], room[1], room[2], room[3]
    gain, row, kept = room[4, 0], room[4, 1], room[4, 2]
    P[:] = problem.covariance_0
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
                _predict(size, links, problem, on, y, Y, kept, moved, F, FP)
            for j in range(p):
                a, b, h, g = problem.seen[j, 0], problem.seen[j, 1], problem.weight[j, 0], problem.weight[j, 1]
                spread = h * h * Y[a, a] + 2.0 * h * g * Y[a, b] + g * g * Y[b, b]
                error[k // stride, s, j] = problem.observed[ahead, j] - h * y[a, 0] - g * y[b, 0]
                variance[k // stride, s, j] = spread + problem.variance[ahead, j]
        if k < m - 1:
            _predict(size, links, problem, k, x, P, kept, moved, F, FP)


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
def _by_squares(
    size: tuple[int, ...], links: tuple[int, ...], problem: Problem, means: np.ndarray, covariances: np.ndarray
) -> None:
    """Turn filtered into smoothed moments, in place, from the last instant but one back.

    With C = P Fᵀ (F P Fᵀ + Q)⁻¹: x + C (x⁺ − F x − shift) and (I − C F) P (I − C F)ᵀ + C (P⁺ + Q) Cᵀ, sums of
    squares alone.
    """
    n = len(size)
    coupled, d = problem.coupled, problem.driven
    columns = means.shape[2]
    x, moved, kept = np.empty((n, columns)), np.empty(len(links)), np.empty(n)
    room = np.zeros((7, n, n))
    P, C, F, FP, G, work, out = room[0], room[1], room[2], room[3], room[4], room[5], room[6]
    for k in range(problem.observed.shape[0] - 2, -1, -1):
        here, after = covariances[k], covariances[k + 1]
        for i in range(n):
            for q in range(columns):
                x[i, q] = means[k, i, q]
            for j in range(n):
                P[i, j] = here[i, j]
        _predict(size, links, problem, k, x, P, kept, moved, F, FP)
        for i in range(n):
            for q in range(n):
                C[i, q] = kept[i] * here[i, q]
        for r in range(len(links)):
            for q in range(n):
                C[coupled[r], q] = FP[r, q]
        _solve_in_place(size, P, C)  # C was F P, now Cᵀ
        for i in range(n):
            for q in range(n):
                G[i, q] = -kept[i] * C[i, q]
        for r in range(len(links)):
            for i in range(n):
                for q in range(n):
                    G[i, q] -= F[r, i] * C[coupled[r], q]
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
            P[i, i] += problem.noise[k, i]
            if i != d:
                P[d, i] += problem.cross[k, i]
                P[i, d] += problem.cross[k, i]
        _congruence(size, here, G, work, out)
        _congruence(size, P, C, work, out)
        for i in range(n):
            for j in range(i + 1):
                here[i, j] = 0.5 * (out[i, j] + out[j, i])
                here[j, i] = here[i, j]


def _sizes(problem: Problem) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return `size` and `links` for the kernels."""
    return (0,) * problem.mean_0.size, (0,) * problem.coupled.size


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
    size, links = _sizes(problem)
    means, covariances = np.empty((m, n, 1 + c)), np.empty((m, n, n))
    gains, innovations, variances = np.empty((m, p, n)), np.empty((m, p, 1 + c)), np.empty((m, p))
    log_likelihood = _filter(size, links, problem, True, means, covariances, gains, innovations, variances)
    if not _smooth(size, links, problem, means, covariances, gains, innovations, variances):
        _filter(size, links, problem, True, means, covariances, gains, innovations, variances)
        _by_squares(size, links, problem, means, covariances)
    return Solution(means, covariances, innovations[:, :, 0], variances, log_likelihood)


def innovations(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Return the filter's innovations with their changes, shape (m, p, 1 + c), and variances (m, p); NaN = none."""
    (m, p), n, c = problem.observed.shape, problem.mean_0.size, problem.observed_by.shape[1]
    found, variances = np.full((m, p, 1 + c), np.nan), np.empty((m, p))
    _filter(
        *_sizes(problem),
        problem,
        True,
        np.empty((m, n, 1 + c)),
        np.empty((m, n, n)),
        np.empty((m, p, n)),
        found,
        variances,
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
    _ahead(*_sizes(problem), alone, np.array(steps), stride, last, error, variance)
    return error, variance


def log_likelihood(problem: Problem) -> float:
    """Return the log-likelihood of the measurements of `problem`, by the filter alone."""
    three = np.empty((0, 0, 0))
    value: float = _filter(*_sizes(problem), problem, False, three, three, three, three, np.empty((0, 0)))
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

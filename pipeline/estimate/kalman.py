"""Kalman filter of a `Problem`, compiled: forwards in time, what each measurement says given those before it.

Updates are sequential scalars in Joseph form (Bierman 1977, *Factorization Methods*, ch. II).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pipeline.estimate.problem import Problem, unconsidered

#: What an operation may lose of a variance to rounding is added to it, so that covariances stay positive.
ROUNDING = 4.0 * 2.0**-52
#: What `run` need not fill, of two and of three dimensions.
FLAT, DEEP = np.empty((0, 0)), np.empty((0, 0, 0))

# In the kernels `size` and `links` are as long as there are states and coupled rows. As tuples they tell the compiler
# both numbers, and it unrolls; as arrays they make one code for every size, slower and compiled once. Work arrays are
# parts of one, so that the compiler knows that they do not overlap.
Extent = tuple[int, ...] | np.ndarray


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _update(
    size: Extent,
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


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def transition_at(size: Extent, links: Extent, problem: Problem, k: int, kept: np.ndarray, F: np.ndarray) -> None:
    """Fill `kept` (n,), the diagonal of F with zeros where a row is coupled, and `F` with those rows."""
    for i in range(len(size)):
        kept[i] = problem.decay[k, i]
    for r in range(len(links)):
        kept[problem.coupled[r]] = 0.0
        for i in range(len(size)):
            F[r, i] = problem.rows[k, r, i]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def predict(
    size: Extent,
    links: Extent,
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
    transition_at(size, links, problem, k, kept, F)
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


@njit(cache=True, nogil=True, error_model="numpy")
def run(
    size: Extent,
    links: Extent,
    problem: Problem,
    means: np.ndarray,
    covariances: np.ndarray,
    gains: np.ndarray,
    innovations: np.ndarray,
    variances: np.ndarray,
) -> float:
    """Run the filter and return the log-likelihood; what has rows is filled: moments, gains in turn, innovations."""
    n = len(size)
    m, p = problem.observed.shape
    c = problem.observed_by.shape[1]
    moments, gained, told, turn = len(covariances) > 0, len(gains) > 0, len(innovations) > 0, 0
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
                if gained:
                    for i in range(n):
                        gains[turn, i] = gain[i]
                    turn += 1
                if told:
                    variances[k, j] = total
                    for q in range(1 + c):
                        innovations[k, j, q] = innovation[q]
            elif told:
                innovations[k, j, 0] = np.nan
                variances[k, j] = np.nan
        if moments:
            for i in range(n):
                for q in range(1 + c):
                    means[k, i, q] = x[i, q]
                for j in range(n):
                    covariances[k, i, j] = P[i, j]
        if k < m - 1:
            predict(size, links, problem, k, x, P, kept, moved, F, FP)
    return -0.5 * (squares + logarithms + math.log(product))


@njit(cache=True, nogil=True, error_model="numpy")
def _ahead(
    size: Extent,
    links: Extent,
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
                predict(size, links, problem, on, y, Y, kept, moved, F, FP)
            for j in range(p):
                a, b, h, g = problem.seen[j, 0], problem.seen[j, 1], problem.weight[j, 0], problem.weight[j, 1]
                spread = h * h * Y[a, a] + 2.0 * h * g * Y[a, b] + g * g * Y[b, b]
                error[k // stride, s, j] = problem.observed[ahead, j] - h * y[a, 0] - g * y[b, 0]
                variance[k // stride, s, j] = spread + problem.variance[ahead, j]
        if k < m - 1:
            predict(size, links, problem, k, x, P, kept, moved, F, FP)


def sizes(problem: Problem) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return `size` and `links` for the kernels."""
    return (0,) * problem.mean_0.size, (0,) * problem.coupled.size


def innovations(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Return the filter's innovations with their changes, shape (m, p, 1 + c), and variances (m, p); NaN = none."""
    (m, p), c = problem.observed.shape, problem.observed_by.shape[1]
    found, variances = np.full((m, p, 1 + c), np.nan), np.empty((m, p))
    run(*sizes(problem), problem, DEEP, DEEP, FLAT, found, variances)
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
    _ahead(*sizes(problem), unconsidered(problem), np.array(steps), stride, last, error, variance)
    return error, variance


def log_likelihood(problem: Problem) -> float:
    """Return the log-likelihood of the measurements of `problem`, by the filter alone."""
    value: float = run(*sizes(problem), problem, DEEP, DEEP, FLAT, DEEP, FLAT)
    return value

"""Smoother of a `Problem`, compiled: backwards over what the filter left, what later measurements say.

In the modified Bryson–Frazier form of the Rauch–Tung–Striebel smoother, which inverts nothing (Bierman 1977,
*Factorization Methods*, ch. X; Rauch, Tung & Striebel 1965, doi:10.2514/3.3166). Means alone follow from its adjoints
without any covariance of the filter, forwards by the smoothed noise (Koopman 1993, doi:10.1093/biomet/80.1.117).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pipeline.estimate.kalman import DEEP, ROUNDING, Extent, predict, run, sizes, transition_at
from pipeline.estimate.problem import Problem, Solution

#: The quick smoother subtracts; where it leaves less than this share of a variance, the slow one, which only adds,
#: takes its place.
LEAST = 1e-8
#: Instants whose covariances are formed together.
LANES = 16


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _subtract(size: Extent, P: np.ndarray, A: np.ndarray, work: np.ndarray, out: np.ndarray) -> bool:
    """Fill the lower half of `out` with P − P A P, lane by lane, shape (n, n, LANES) each; whether digits are left."""
    n = len(size)
    for i in range(n):
        for j in range(n):
            for lane in range(LANES):
                value = 0.0
                for q in range(n):
                    value += P[i, q, lane] * A[q, j, lane]
                work[i, j, lane] = value
    for i in range(n):
        for j in range(i + 1):
            for lane in range(LANES):
                value = 0.0
                for q in range(n):
                    value += work[i, q, lane] * P[q, j, lane]
                out[i, j, lane] = P[i, j, lane] - value
    for i in range(n):
        for j in range(i + 1):
            for lane in range(LANES):
                work[i, j, lane] = out[i, j, lane]
    lost = 0.0
    for j in range(n):  # P − P A P = L D Lᵀ
        for lane in range(LANES):
            lost += 0.0 if work[j, j, lane] > LEAST * P[j, j, lane] else 1.0
        for i in range(j + 1, n):
            for lane in range(LANES):
                work[j, i, lane] = work[i, j, lane] / work[j, j, lane]
        for i in range(j + 1, n):
            for q in range(j + 1, i + 1):
                for lane in range(LANES):
                    work[i, q, lane] -= work[j, i, lane] * work[q, j, lane]
    return lost == 0.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _back(
    size: Extent, links: Extent, coupled: np.ndarray, kept: np.ndarray, F: np.ndarray, old: np.ndarray, a: np.ndarray
) -> None:
    """Replace the adjoint `a` (n, 1 + c) by Fᵀ a; `old` is (r, 1 + c)."""
    for q in range(a.shape[1]):
        for r in range(len(links)):
            old[r, q] = a[coupled[r], q]
        for i in range(len(size)):
            value = a[i, q] * kept[i]
            for r in range(len(links)):
                value += F[r, i] * old[r, q]
            a[i, q] = value


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _told(
    size: Extent,
    seen: np.ndarray,
    weight: np.ndarray,
    gain: np.ndarray,
    inverse: float,
    innovation: np.ndarray,
    a: np.ndarray,
) -> None:
    """Replace the adjoint `a` by Cᵀ a − h ν/S with C = I − K hᵀ: what one measurement says."""
    for q in range(a.shape[1]):
        value = innovation[q] * inverse
        for i in range(len(size)):
            value += gain[i] * a[i, q]
        for s in range(2):
            a[seen[s], q] -= weight[s] * value


@njit(cache=True, nogil=True, error_model="numpy")
def _smooth(
    size: Extent,
    links: Extent,
    problem: Problem,
    means: np.ndarray,
    covariances: np.ndarray,
    gains: np.ndarray,
    innovations: np.ndarray,
    variances: np.ndarray,
) -> bool:
    """Turn filtered into smoothed moments, in place, from the last instant back; False where digits run out.

    The adjoints `a` (n, 1 + c) and `A` (n, n) hold what later measurements say: x − P a and P − P A P. The latter is
    formed for `LANES` instants at a time, so that the compiler has vectors to work on.
    """
    n = len(size)
    m, p = problem.observed.shape
    c = problem.observed_by.shape[1]
    coupled, turn = problem.coupled, len(gains)
    a, old = np.zeros((n, 1 + c)), np.empty((len(links), 1 + c))
    room = np.zeros((4, n, n))
    A, F, across = room[0], room[1], room[2]
    column, gain, kept = room[3, 0], room[3, 1], room[3, 2]
    lanes = np.zeros((4, n, n, LANES))
    before, later, work, out = lanes[0], lanes[1], lanes[2], lanes[3]
    for i in range(n):
        before[i, i] = 1.0
    for k in range(m - 1, -1, -1):
        lane = k % LANES
        if k < m - 1:  # a ← Fᵀ a, A ← Fᵀ A F
            transition_at(size, links, problem, k, kept, F)
            _back(size, links, coupled, kept, F, old, a)
            for r in range(len(links)):
                for i in range(n):
                    value = kept[i] * A[i, coupled[r]]
                    for s in range(len(links)):
                        value += 0.5 * A[coupled[r], coupled[s]] * F[s, i]
                    across[r, i] = value
            for i in range(n):
                for j in range(i + 1):
                    value = kept[i] * A[i, j] * kept[j]
                    for r in range(len(links)):
                        value += F[r, i] * across[r, j] + across[r, i] * F[r, j]
                    A[i, j] = value
            for i in range(n):
                for j in range(i):
                    A[j, i] = A[i, j]
        for i in range(n):
            for q in range(1 + c):
                value = 0.0
                for j in range(n):
                    value += covariances[k, i, j] * a[j, q]
                means[k, i, q] -= value
        for i in range(n):
            for j in range(n):
                before[i, j, lane] = covariances[k, i, j]
                later[i, j, lane] = A[i, j]
        if lane == 0:
            if not _subtract(size, before, later, work, out):
                return False
            for after in range(min(LANES, m - k)):
                for i in range(n):
                    for j in range(i + 1):
                        covariances[k + after, i, j] = out[i, j, after]
                        covariances[k + after, j, i] = out[i, j, after]
        for j in range(p - 1, -1, -1):
            total = variances[k, j]
            if math.isnan(total):
                continue
            inverse = 1.0 / total
            turn -= 1
            for i in range(n):
                gain[i] = gains[turn, i]
            _told(size, problem.seen[j], problem.weight[j], gain, inverse, innovations[k, j], a)
            square = inverse  # A ← Cᵀ A C + h hᵀ/S
            for i in range(n):
                value = 0.0
                for q in range(n):
                    value += A[q, i] * gain[q]
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
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _trace(
    size: Extent,
    links: Extent,
    problem: Problem,
    means: np.ndarray,
    gains: np.ndarray,
    innovations: np.ndarray,
    variances: np.ndarray,
) -> None:
    """Fill `means` with the smoothed ones: back to the adjoints, then forwards by x⁺ = F x + shift − Q a⁺."""
    n = len(size)
    m, p = problem.observed.shape
    c = problem.observed_by.shape[1]
    coupled, driven, turn = problem.coupled, problem.driven, len(gains)
    a, x, moved = np.zeros((n, 1 + c)), np.zeros((n, 1 + c)), np.empty((len(links), 1 + c))
    room = np.zeros((2, n, n))
    F, gain, kept = room[0], room[1, 0], room[1, 1]
    for k in range(m - 1, -1, -1):
        if k < m - 1:
            transition_at(size, links, problem, k, kept, F)
            _back(size, links, coupled, kept, F, moved, a)
        for j in range(p - 1, -1, -1):
            total = variances[k, j]
            if math.isnan(total):
                continue
            turn -= 1
            for i in range(n):
                gain[i] = gains[turn, i]
            _told(size, problem.seen[j], problem.weight[j], gain, 1.0 / total, innovations[k, j], a)
        for i in range(n):
            for q in range(1 + c):
                means[k, i, q] = a[i, q]
    x[:, 0] = problem.mean_0
    for i in range(n):
        for j in range(n):
            for q in range(1 + c):
                x[i, q] -= problem.covariance_0[i, j] * means[0, j, q]
    for k in range(m):
        if k > 0:
            transition_at(size, links, problem, k - 1, kept, F)
            for q in range(1 + c):
                for r in range(len(links)):
                    value = problem.shift[k - 1, r, q]
                    for i in range(n):
                        value += F[r, i] * x[i, q]
                    moved[r, q] = value
                for i in range(n):
                    x[i, q] = kept[i] * x[i, q] - problem.noise[k - 1, i] * means[k, i, q]
                for r in range(len(links)):
                    x[coupled[r], q] += moved[r, q]
                for i in range(n):
                    if i != driven:
                        x[driven, q] -= problem.cross[k - 1, i] * means[k, i, q]
                        x[i, q] -= problem.cross[k - 1, i] * means[k, driven, q]
        for i in range(n):
            for q in range(1 + c):
                means[k, i, q] = x[i, q]


@njit(cache=True, nogil=True, error_model="numpy")
def _solve_in_place(size: Extent, P: np.ndarray, right: np.ndarray) -> None:
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


@njit(cache=True, nogil=True, error_model="numpy")
def _congruence(size: Extent, P: np.ndarray, B: np.ndarray, work: np.ndarray, out: np.ndarray) -> None:
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


@njit(cache=True, nogil=True, error_model="numpy")
def _by_squares(size: Extent, links: Extent, problem: Problem, means: np.ndarray, covariances: np.ndarray) -> None:
    """Turn filtered into smoothed moments, in place, from the last instant but one back.

    With C = P Fᵀ (F P Fᵀ + Q)⁻¹: x + C (x⁺ − F x − shift) and (I − C F) P (I − C F)ᵀ + C (P⁺ + Q) Cᵀ, sums of
    squares alone. It is seldom needed: `size` and `links` are arrays here, so that one code serves every size.
    """
    n = len(size)
    coupled, d = problem.coupled, problem.driven
    columns = 1 + problem.observed_by.shape[1]
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
        predict(size, links, problem, k, x, P, kept, moved, F, FP)
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


def solve(problem: Problem, *, whole: bool = True, room: int = 0) -> Solution:
    """Return the smoothed mean and covariance of every state, and the innovations of the filter.

    Parameters
    ----------
    problem
        The state-space problem; m instants, n states, p kinds of measurement, c considered parameters.
    whole
        Whether covariances are wanted; without them it takes about a third of the time.
    room
        So many more columns of the mean are left, for the caller to fill.

    Returns
    -------
    Solution
        Smoothed moments, innovations and the log-likelihood of the measurements.
    """
    (m, p), n, c = problem.observed.shape, problem.mean_0.size, problem.observed_by.shape[1]
    size, links = sizes(problem)
    means, covariances = np.empty((m, n, 1 + c + room)), np.empty((m, n, n)) if whole else DEEP.reshape(0, n, n)
    gains = np.empty((int(np.isfinite(problem.observed).sum()), n))
    innovations, variances = np.empty((m, p, 1 + c)), np.empty((m, p))
    log_likelihood = run(size, links, problem, means, covariances, gains, innovations, variances)
    if not whole:
        _trace(size, links, problem, means, gains, innovations, variances)
    elif not _smooth(size, links, problem, means, covariances, gains, innovations, variances):
        run(size, links, problem, means, covariances, gains, innovations, variances)
        _by_squares(np.empty(n), np.empty(problem.coupled.size), problem, means, covariances)
    return Solution(means, covariances, innovations[:, :, 0], variances, log_likelihood)

"""Smoother of a `Problem`, compiled: backwards over what the filter left, what later measurements say.

In the modified Bryson–Frazier form of the Rauch–Tung–Striebel smoother, which inverts nothing (Bierman 1977,
*Factorization Methods*, ch. X; Rauch, Tung & Striebel 1965, doi:10.2514/3.3166).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pipeline.estimate.kalman import ROUNDING, predict, run, sizes, transition_at
from pipeline.estimate.problem import Problem, Solution

#: The quick smoother subtracts; where it leaves less than this share of a variance, the slow one, which only adds,
#: takes its place.
LEAST = 1e-8


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
            transition_at(size, links, problem, k, kept, F)
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
    size, links = sizes(problem)
    means, covariances = np.empty((m, n, 1 + c)), np.empty((m, n, n))
    gains, innovations, variances = np.empty((m, p, n)), np.empty((m, p, 1 + c)), np.empty((m, p))
    log_likelihood = run(size, links, problem, True, means, covariances, gains, innovations, variances)
    if not _smooth(size, links, problem, means, covariances, gains, innovations, variances):
        run(size, links, problem, True, means, covariances, gains, innovations, variances)
        _by_squares(size, links, problem, means, covariances)
    return Solution(means, covariances, innovations[:, :, 0], variances, log_likelihood)

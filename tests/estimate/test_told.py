"""Considered parameters: what they leave open, and what the measurements tell of them where they are allowed to.

Everything is compared with one dense Gaussian: all states of all instants and the parameters, stacked.
"""

import numpy as np
import pytest
from problems import problem, shift_of

from pipeline.estimate import smoother
from pipeline.estimate.problem import Problem, design, process, transition
from pipeline.estimate.told import Told, nothing, told


def stacked(case: Problem) -> tuple[np.ndarray, ...]:
    """Return the problem as one Gaussian: mean, change with the parameters and covariance of all states, unmeasured.

    Then the measurements, their change with the parameters, their rows, and the covariance of their errors.
    """
    (m, n), c = case.decay.shape, case.observed_by.shape[1]
    F, Q, H, shift = transition(case), process(case), design(case), shift_of(case)
    by = np.zeros((m, n, c))
    by[:, case.coupled] = case.shift[:, :, 1:]
    mean, change = np.zeros((m, n)), np.zeros((m, n, c))
    covariance = np.zeros((m, n, m, n))
    mean[0], covariance[0, :, 0] = case.mean_0, case.covariance_0
    for k in range(m - 1):
        mean[k + 1], change[k + 1] = F[k] @ mean[k] + shift[k], F[k] @ change[k] + by[k]
        for j in range(k + 1):
            covariance[k + 1, :, j] = F[k] @ covariance[k, :, j]
            covariance[j, :, k + 1] = covariance[k + 1, :, j].T
        covariance[k + 1, :, k + 1] = F[k] @ covariance[k, :, k] @ F[k].T + Q[k]
    known = np.isfinite(case.observed)
    rows = np.stack([np.kron(np.eye(m)[k], H[j]) for k, j in np.argwhere(known)])
    return (
        *(mean.ravel(), change.reshape(m * n, c), covariance.reshape(m * n, m * n)),
        *(case.observed[known], case.observed_by[np.nonzero(known)[1]], rows, np.diag(case.variance[known])),
    )


def total(covariance: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Return covariances (m, n, n) with what the parameters leave open, `change` (m, n, c), added."""
    return np.asarray(covariance + change @ change.transpose(0, 2, 1))


@pytest.mark.parametrize("seed", range(3))
def test_what_is_considered_gives_the_covariance_of_the_true_error(seed: int) -> None:
    """With p ~ N(0, 1) unknown the error of the estimate that holds p is (B − K (H B − D)) p + (I − K H) ξ − K e."""
    case = problem(seed, m=15, missing=0.3, considered=2)
    mean, B, P, y, D, H, R = stacked(case)
    gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    left = np.eye(mean.size) - gain @ H
    open_ = B - gain @ (H @ B - D)
    error = left @ P @ left.T + gain @ R @ gain.T + open_ @ open_.T
    found = smoother.solve(case)
    (m, n), at = case.decay.shape, np.arange(case.decay.shape[0])
    np.testing.assert_allclose(found.mean[:, :, 0].ravel(), mean + gain @ (y - H @ mean), rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(
        total(found.covariance, found.mean[:, :, 1:]), error.reshape(m, n, m, n)[at, :, at], rtol=1e-8, atol=1e-8
    )


@pytest.mark.parametrize("seed", range(3))
def test_the_last_instant_is_that_of_schmidts_recursion_with_the_gain_of_a_filter_that_holds_them(seed: int) -> None:
    """Schmidt's filter carries the covariance of [x, p] and corrects x alone."""
    case = problem(seed, m=20, missing=0.2, considered=2)
    (m, n), c = case.decay.shape, 2
    F, Q, H = transition(case), process(case), design(case)
    by = np.zeros((m, n, c))
    by[:, case.coupled] = case.shift[:, :, 1:]
    held, P = case.covariance_0.copy(), np.eye(n + c)
    P[:n, :n] = held
    for k in range(m):
        for j in np.flatnonzero(np.isfinite(case.observed[k])):
            variance = case.variance[k, j]
            gain = held @ H[j] / (H[j] @ held @ H[j] + variance)
            held = held - np.outer(gain, H[j] @ held)
            both = np.append(gain, np.zeros(c))
            left = np.eye(n + c) - np.outer(both, np.concatenate([H[j], -case.observed_by[j]]))
            P = left @ P @ left.T + variance * np.outer(both, both)
        if k < m - 1:
            step = np.block([[F[k], by[k]], [np.zeros((c, n)), np.eye(c)]])
            held, P = F[k] @ held @ F[k].T + Q[k], step @ P @ step.T
            P[:n, :n] += Q[k]
    found = smoother.solve(case)
    last = total(found.covariance, found.mean[:, :, 1:])[-1]
    np.testing.assert_allclose(last, P[:n, :n], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_what_is_told_makes_states_of_the_parameters(seed: int) -> None:
    """Bias-separated estimation is the dense problem in states and parameters together."""
    case = problem(seed, m=15, missing=0.3, considered=2)
    (m, n), c = case.decay.shape, 2
    mean, B, P, y, D, H, R = stacked(case)
    prior = np.block([[P + B @ B.T, B], [B.T, np.eye(c)]])
    both = np.hstack([H, -D])
    gain = prior @ both.T @ np.linalg.inv(both @ prior @ both.T + R)
    expected = np.append(mean, np.zeros(c)) + gain @ (y - H @ mean)
    covariance = prior - gain @ both @ prior
    found, known = smoother.solve(case), told(case, np.ones(m, dtype=bool))
    np.testing.assert_allclose(known.value, expected[m * n :], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(known.covariance, covariance[m * n :, m * n :], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(known.moved(found.mean).ravel(), expected[: m * n], rtol=1e-7, atol=1e-8)
    variance = np.diagonal(found.covariance, axis1=1, axis2=2) + known.left_open(found.mean)
    np.testing.assert_allclose(variance.ravel(), np.diag(covariance)[: m * n], rtol=1e-7, atol=1e-9)


def test_what_is_told_nowhere_or_of_nothing_is_as_before() -> None:
    case = problem(1, m=15, considered=2)
    mean = smoother.solve(case).mean
    for known in (told(case, np.zeros(15, dtype=bool)), nothing(2)):
        np.testing.assert_array_equal(known.value, np.zeros(2))
        np.testing.assert_array_equal(known.covariance, np.eye(2))
        np.testing.assert_array_equal(known.moved(mean), mean[:, :, 0])
        np.testing.assert_allclose(known.left_open(mean), np.sum(mean[:, :, 1:] ** 2, axis=2), rtol=1e-12)
    empty = told(problem(1, m=15), np.ones(15, dtype=bool))
    assert empty.value.size == 0
    assert Told(np.ones(1), np.eye(1)).moved(np.array([3.0, 2.0])) == 5.0

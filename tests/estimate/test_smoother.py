"""Filter and smoother: against filterpy, against one dense least-squares problem, and with data missing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.estimate import reference, smoother
from pipeline.estimate.smoother import Problem


def problem(seed: int, m: int = 40, n: int = 4, p: int = 3, missing: float = 0.4) -> Problem:
    """Return a random, well-posed problem with gaps."""
    rng = np.random.default_rng(seed)
    transition = np.eye(n) + 0.1 * rng.standard_normal((m, n, n))
    root = 0.3 * rng.standard_normal((m, n, n))
    process = root @ root.transpose(0, 2, 1) + 0.01 * np.eye(n)
    observed = rng.standard_normal((m, p))
    observed[rng.random((m, p)) < missing] = np.nan
    return Problem(
        rng.standard_normal(n),
        np.diag(rng.uniform(0.5, 2.0, n)),
        transition,
        0.1 * rng.standard_normal((m, n)),
        process,
        rng.standard_normal((p, n)),
        observed,
        rng.uniform(0.1, 1.0, (m, p)),
    )


def dense(given_problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Solve for all states at once by normal equations: mean (m, n) and covariance (m, n, n)."""
    m, n = given_problem.observed.shape[0], given_problem.mean_0.size
    information, vector = np.zeros((m * n, m * n)), np.zeros(m * n)
    prior = np.linalg.inv(given_problem.covariance_0)
    information[:n, :n] += prior
    vector[:n] += prior @ given_problem.mean_0
    for k in range(m - 1):
        weight = np.linalg.inv(given_problem.process[k])
        row = np.zeros((n, m * n))
        row[:, k * n : (k + 1) * n] = -given_problem.transition[k]
        row[:, (k + 1) * n : (k + 2) * n] = np.eye(n)
        information += row.T @ weight @ row
        vector += row.T @ weight @ given_problem.shift[k]
    for k, j in np.argwhere(np.isfinite(given_problem.observed)):
        row = np.zeros(m * n)
        row[k * n : (k + 1) * n] = given_problem.design[j]
        information += np.outer(row, row) / given_problem.variance[k, j]
        vector += row * given_problem.observed[k, j] / given_problem.variance[k, j]
    covariance = np.linalg.inv(information)
    blocks = np.stack([covariance[k * n : (k + 1) * n, k * n : (k + 1) * n] for k in range(m)])
    return (covariance @ vector).reshape(m, n), blocks


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.floats(0.0, 0.95))
def test_smoothed_moments_are_those_of_one_dense_least_squares_problem(seed: int, missing: float) -> None:
    case = problem(seed, m=12, missing=missing)
    solution = smoother.solve(case)
    mean, covariance = dense(case)
    np.testing.assert_allclose(solution.mean, mean, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(solution.covariance, covariance, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("n", [5, 10])
def test_filterpy_and_the_compiled_engine_agree_to_1e9(seed: int, n: int) -> None:
    case = problem(seed, m=120, n=n)
    ours, theirs = smoother.solve(case), reference.solve(case)
    for name in ("mean", "covariance", "innovation", "innovation_variance"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=1e-9, atol=1e-9, err_msg=name)
    assert ours.log_likelihood == pytest.approx(theirs.log_likelihood, rel=1e-9)


def test_log_likelihood_is_that_of_the_joint_normal_distribution() -> None:
    from scipy.stats import multivariate_normal

    case = problem(3, m=6, missing=0.0)
    m, n, p = 6, case.mean_0.size, case.observed.shape[1]
    mean, covariance = np.zeros(m * n), np.zeros((m * n, m * n))
    mean[:n], covariance[:n, :n] = case.mean_0, case.covariance_0
    for k in range(m - 1):
        a, b = slice(k * n, (k + 1) * n), slice((k + 1) * n, (k + 2) * n)
        mean[b] = case.transition[k] @ mean[a] + case.shift[k]
        covariance[b, : (k + 1) * n] = case.transition[k] @ covariance[a, : (k + 1) * n]
        covariance[: (k + 1) * n, b] = covariance[b, : (k + 1) * n].T
        covariance[b, b] = case.transition[k] @ covariance[a, a] @ case.transition[k].T + case.process[k]
    design = np.kron(np.eye(m), case.design)
    joint = multivariate_normal(
        design @ mean, design @ covariance @ design.T + np.diag(case.variance.ravel()), allow_singular=False
    )
    assert smoother.log_likelihood(case) == pytest.approx(joint.logpdf(case.observed.ravel()), rel=1e-9)
    assert p * m == case.observed.size


def test_innovations_are_white_and_of_the_stated_variance_on_data_from_the_model_itself() -> None:
    rng = np.random.default_rng(7)
    case = problem(11, m=4000, missing=0.2)
    case = case._replace(transition=np.broadcast_to(0.95 * np.eye(4), case.transition.shape).copy())
    x = rng.multivariate_normal(case.mean_0, case.covariance_0)
    observed = case.observed.copy()
    for k in range(4000):
        y = case.design @ x + np.sqrt(case.variance[k]) * rng.standard_normal(3)
        observed[k] = np.where(np.isnan(observed[k]), np.nan, y)
        x = case.transition[k] @ x + case.shift[k] + rng.multivariate_normal(np.zeros(4), case.process[k])
    solution = smoother.solve(case._replace(observed=observed))
    normal = solution.innovation / np.sqrt(solution.innovation_variance)
    normal = normal[np.isfinite(normal)]
    assert np.mean(normal**2) == pytest.approx(1.0, abs=5 * np.sqrt(2 / normal.size))
    assert abs(np.corrcoef(normal[:-1], normal[1:])[0, 1]) < 5 / np.sqrt(normal.size)


@pytest.mark.parametrize("m", [1, 2])
def test_one_or_two_instants_are_enough(m: int) -> None:
    case = problem(0, m=m)
    mean, _ = dense(case)
    np.testing.assert_allclose(smoother.solve(case).mean, mean, rtol=1e-9, atol=1e-9)


def test_covariances_stay_symmetric_and_positive_without_any_measurement() -> None:
    case = problem(1, m=300, missing=1.1)
    solution = smoother.solve(case)
    assert np.array_equal(solution.covariance, solution.covariance.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(solution.covariance).min() > 0

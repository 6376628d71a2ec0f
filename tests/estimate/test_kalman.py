"""Filter: against the joint normal distribution, on data from the model itself, and ahead of the measurements."""

import numpy as np
import pytest
from problems import problem, shift_of, simulated

from pipeline.estimate import kalman, smoother
from pipeline.estimate.problem import design, process, transition


def test_log_likelihood_is_that_of_the_joint_normal_distribution() -> None:
    from scipy.stats import multivariate_normal

    case = problem(3, m=6, missing=0.0)
    F, Q, shift = transition(case), process(case), shift_of(case)
    m, n, p = 6, case.mean_0.size, case.observed.shape[1]
    mean, covariance = np.zeros(m * n), np.zeros((m * n, m * n))
    mean[:n], covariance[:n, :n] = case.mean_0, case.covariance_0
    for k in range(m - 1):
        a, b = slice(k * n, (k + 1) * n), slice((k + 1) * n, (k + 2) * n)
        mean[b] = F[k] @ mean[a] + shift[k]
        covariance[b, : (k + 1) * n] = F[k] @ covariance[a, : (k + 1) * n]
        covariance[: (k + 1) * n, b] = covariance[b, : (k + 1) * n].T
        covariance[b, b] = F[k] @ covariance[a, a] @ F[k].T + Q[k]
    whole = np.kron(np.eye(m), design(case))
    joint = multivariate_normal(
        whole @ mean, whole @ covariance @ whole.T + np.diag(case.variance.ravel()), allow_singular=False
    )
    assert kalman.log_likelihood(case) == pytest.approx(joint.logpdf(case.observed.ravel()), rel=1e-9)
    assert smoother.solve(case).log_likelihood == kalman.log_likelihood(case)
    assert p * m == case.observed.size


def test_innovations_are_white_and_of_the_stated_variance_on_data_from_the_model_itself() -> None:
    case = problem(11, m=4000, missing=0.2)
    case.rows[:, np.arange(case.coupled.size), case.coupled] = 0.9
    solution = smoother.solve(simulated(case, np.random.default_rng(7)))
    normal = solution.innovation / np.sqrt(solution.innovation_variance)
    normal = normal[np.isfinite(normal)]
    assert np.mean(normal**2) == pytest.approx(1.0, abs=5 * np.sqrt(2 / normal.size))
    assert abs(np.corrcoef(normal[:-1], normal[1:])[0, 1]) < 5 / np.sqrt(normal.size)


def test_predictions_are_the_states_carried_on_without_measurements() -> None:
    case = problem(2, m=50, missing=0.3)
    steps, stride = (1, 5, 12), 7
    last = np.where(np.arange(50) < 30, 30, 49)
    error, variance = kalman.predictions(case, steps, stride, last)
    assert error.shape == variance.shape == (8, 3, 3)
    H = design(case)
    for start in range(0, 50, stride):
        for s, step in enumerate(steps):
            if start + step > last[start] or (step > stride and start % (2 * stride)):
                assert np.isnan(error[start // stride, s]).all()
                continue
            hidden = case.observed[: start + step + 1].copy()
            hidden[start + 1 :] = np.nan
            short = {
                name: getattr(case, name)[: start + step + 1]
                for name in ("decay", "rows", "shift", "noise", "cross", "variance")
            }
            found = smoother.solve(case._replace(observed=hidden, **short))
            expected = case.observed[start + step] - H @ found.mean[-1, :, 0]
            np.testing.assert_allclose(error[start // stride, s], expected, rtol=1e-9, atol=1e-9)
            spread = np.einsum("ji,ik,jk->j", H, found.covariance[-1], H) + case.variance[start + step]
            np.testing.assert_allclose(variance[start // stride, s], spread, rtol=1e-9)

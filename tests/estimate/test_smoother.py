"""Smoother: against filterpy, statsmodels and one dense least-squares problem, and with data missing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import SIZES, dense, problem, shift_of

from pipeline.estimate import reference, smoother
from pipeline.estimate.problem import design, process, transition


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.floats(0.0, 0.95))
def test_smoothed_moments_are_those_of_one_dense_least_squares_problem(seed: int, missing: float) -> None:
    case = problem(seed, m=12, missing=missing)
    solution = smoother.solve(case)
    mean, covariance = dense(case)
    np.testing.assert_allclose(solution.mean[:, :, 0], mean, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(solution.covariance, covariance, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("size", SIZES)
def test_filterpy_and_the_compiled_engine_agree_to_1e9(seed: int, size: tuple[int, int]) -> None:
    case = problem(seed, m=120, size=size, considered=2)
    ours, theirs = smoother.solve(case), reference.solve(case)
    for name in ("mean", "covariance", "innovation", "innovation_variance"):
        a, b = getattr(ours, name), getattr(theirs, name)
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.nanmax(np.abs(b)), err_msg=name)
    assert ours.log_likelihood == pytest.approx(theirs.log_likelihood, rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_statsmodels_agrees_on_an_unchanging_problem_with_data_missing(seed: int) -> None:
    from statsmodels.tsa.statespace.kalman_smoother import KalmanSmoother

    case = problem(seed, m=300, missing=0.3)
    constant = {
        name: np.broadcast_to(getattr(case, name)[:1], getattr(case, name).shape).copy()
        for name in ("decay", "rows", "shift", "noise", "cross", "variance")
    }
    constant["rows"][:, np.arange(case.coupled.size), case.coupled] = 0.9
    case = case._replace(**constant)
    n, p = case.mean_0.size, case.observed.shape[1]
    theirs = KalmanSmoother(p, n, k_posdef=n, loglikelihood_burn=0, tolerance=0)
    theirs.bind(np.asfortranarray(case.observed.T))
    theirs["transition"], theirs["state_intercept"] = transition(case)[0], shift_of(case)[:1].T
    theirs["selection"], theirs["state_cov"] = np.eye(n), process(case)[0]
    theirs["design"], theirs["obs_cov"] = design(case), np.diag(case.variance[0])
    theirs.initialize_known(case.mean_0, case.covariance_0)
    found, ours = theirs.smooth(), smoother.solve(case)
    mean, covariance = found.smoothed_state.T, np.moveaxis(found.smoothed_state_cov, -1, 0)
    np.testing.assert_allclose(ours.mean[:, :, 0], mean, rtol=1e-9, atol=1e-9 * np.abs(mean).max())
    np.testing.assert_allclose(ours.covariance, covariance, rtol=1e-9, atol=1e-9 * np.abs(covariance).max())
    assert ours.log_likelihood == pytest.approx(found.llf, rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_considered_parameters_shift_the_mean_as_finite_differences_say_and_nothing_else(seed: int) -> None:
    case = problem(seed, m=60, considered=3)
    solution = smoother.solve(case)
    for q in range(3):
        moved = case.shift[:, :, :1] + case.shift[:, :, [1 + q]]
        other = case._replace(
            shift=moved, observed=case.observed + case.observed_by[:, q], observed_by=np.empty((3, 0))
        )
        found = smoother.solve(other)
        change = found.mean[:, :, 0] - solution.mean[:, :, 0]
        np.testing.assert_allclose(solution.mean[:, :, 1 + q], change, atol=1e-11 * np.abs(found.mean).max())
        np.testing.assert_array_equal(found.covariance, solution.covariance)


def test_covariances_stay_symmetric_and_positive_without_any_measurement() -> None:
    case = problem(1, m=300, missing=1.1)
    solution = smoother.solve(case)
    assert np.array_equal(solution.covariance, solution.covariance.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(solution.covariance).min() > 0


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 100_000), st.sampled_from(SIZES), st.floats(0.0, 1.1))
def test_covariances_stay_positive_with_variances_over_eighteen_decades(
    seed: int, size: tuple[int, int], missing: float
) -> None:
    solution = smoother.solve(problem(seed, size=size, missing=missing, decades=18.0))
    assert np.isfinite(solution.mean).all()
    assert np.array_equal(solution.covariance, solution.covariance.transpose(0, 2, 1))
    trace = np.trace(solution.covariance, axis1=1, axis2=2)
    assert np.all(np.linalg.eigvalsh(solution.covariance)[:, 0] >= -1e-12 * trace)
    assert np.all(np.diagonal(solution.covariance, axis1=1, axis2=2) >= 0.0)


@pytest.mark.parametrize("variance", [1e6, 1e10])
def test_covariances_stay_positive_across_a_huge_gap_and_are_those_of_the_sum_of_squares(variance: float) -> None:
    """A gap leaves all open, and a sharp measurement ends it: what is before is as if nothing came after."""
    case = problem(4, m=60, missing=0.2)
    noise, cross = case.noise.copy(), case.cross.copy()
    noise[30], cross[30] = variance, 0.0
    sharp = case.variance.copy()
    sharp[31] = 1e-8
    case = case._replace(noise=noise, cross=cross, variance=sharp)
    ours, theirs = smoother.solve(case), reference.solve(case)
    assert np.all(np.linalg.eigvalsh(ours.covariance) > 0.0)
    before = slice(0, 31)
    np.testing.assert_allclose(ours.covariance[before], theirs.covariance[before], rtol=1e-6, atol=1e-9)
    for found in (ours, smoother.solve(case, whole=False)):
        np.testing.assert_allclose(found.mean[before], theirs.mean[before], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_without_covariances_the_means_are_the_same(seed: int) -> None:
    """They are computed in another way, so not to the last digit."""
    case = problem(seed, m=50, considered=2)
    whole, means = smoother.solve(case), smoother.solve(case, whole=False)
    np.testing.assert_allclose(means.mean, whole.mean, rtol=1e-9, atol=1e-11)
    np.testing.assert_array_equal(means.innovation, whole.innovation)
    assert means.log_likelihood == whole.log_likelihood
    assert means.covariance.shape == reference.solve(case, whole=False).covariance.shape == (0, 5, 5)


@pytest.mark.parametrize("m", [1, smoother.LANES - 1, smoother.LANES, smoother.LANES + 1, 3 * smoother.LANES + 5])
def test_any_number_of_instants_is_smoothed_to_the_first(m: int) -> None:
    case = problem(7, m=m)
    mean, covariance = dense(case)
    solution = smoother.solve(case)
    np.testing.assert_allclose(solution.mean[:, :, 0], mean, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(solution.covariance, covariance, rtol=1e-8, atol=1e-8)

"""Filter and smoother: against filterpy, statsmodels and one dense least-squares problem, and with data missing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.estimate import reference, smoother
from pipeline.estimate.smoother import Problem, design, process, transition


def problem(
    seed: int, m: int = 40, n: int = 4, p: int = 3, missing: float = 0.4, considered: int = 0, decades: float = 0.0
) -> Problem:
    """Return a random problem with gaps, one to three coupled rows and measurements of one state or of two.

    Variances spread over so many `decades`, each instant's anew.
    """
    rng = np.random.default_rng(seed)
    r = int(rng.integers(1, min(3, n) + 1))
    coupled = np.sort(rng.permutation(n)[:r])
    rows = 0.3 * rng.standard_normal((m, r, n))
    rows[:, np.arange(r), coupled] = 1.0

    def spread(*size: int) -> np.ndarray:
        return rng.uniform(0.1, 1.0, size) * 10.0 ** (decades * (rng.random(size) - 0.5))

    noise, driven = spread(m, n), int(rng.integers(n))
    share = rng.dirichlet(np.ones(n), m)
    cross = rng.choice([-0.9, 0.9], (m, n)) * np.sqrt(share * noise * noise[:, [driven]])
    cross[:, driven] = 0.0
    seen = rng.integers(0, n, (p, 2))
    seen[:, 1] = (seen[:, 0] + rng.integers(1, n, p)) % n
    weight = rng.standard_normal((p, 2))
    weight[::2, 1] = 0.0
    observed = rng.standard_normal((m, p))
    observed[rng.random((m, p)) < missing] = np.nan
    return Problem(
        rng.standard_normal(n),
        np.diag(spread(n)),
        rng.uniform(0.5, 1.0, (m, n)),
        coupled,
        rows,
        rng.standard_normal((m, r, 1 + considered)),
        noise,
        cross,
        driven,
        seen,
        weight,
        observed,
        rng.standard_normal((p, considered)),
        spread(m, p),
    )


def shift_of(case: Problem) -> np.ndarray:
    """Return what is added to each state, (m, n)."""
    full = np.zeros(case.decay.shape)
    full[:, case.coupled] = case.shift[:, :, 0]
    return full


def dense(case: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Solve for all states at once by normal equations: mean (m, n) and covariance (m, n, n)."""
    m, n = case.observed.shape[0], case.mean_0.size
    F, Q, H, shift = transition(case), process(case), design(case), shift_of(case)
    information, vector = np.zeros((m * n, m * n)), np.zeros(m * n)
    prior = np.linalg.inv(case.covariance_0)
    information[:n, :n] += prior
    vector[:n] += prior @ case.mean_0
    for k in range(m - 1):
        weight = np.linalg.inv(Q[k])
        row = np.zeros((n, m * n))
        row[:, k * n : (k + 1) * n] = -F[k]
        row[:, (k + 1) * n : (k + 2) * n] = np.eye(n)
        information += row.T @ weight @ row
        vector += row.T @ weight @ shift[k]
    for k, j in np.argwhere(np.isfinite(case.observed)):
        row = np.zeros(m * n)
        row[k * n : (k + 1) * n] = H[j]
        information += np.outer(row, row) / case.variance[k, j]
        vector += row * case.observed[k, j] / case.variance[k, j]
    covariance = np.linalg.inv(information)
    blocks = np.stack([covariance[k * n : (k + 1) * n, k * n : (k + 1) * n] for k in range(m)])
    return (covariance @ vector).reshape(m, n), blocks


def simulated(case: Problem, rng: np.random.Generator) -> Problem:
    """Return the problem with measurements drawn from the model itself, missing where they were."""
    F, Q, H, shift = transition(case), process(case), design(case), shift_of(case)
    x = rng.multivariate_normal(case.mean_0, case.covariance_0)
    observed = case.observed.copy()
    for k in range(len(observed)):
        y = H @ x + np.sqrt(case.variance[k]) * rng.standard_normal(len(H))
        observed[k] = np.where(np.isnan(observed[k]), np.nan, y)
        x = F[k] @ x + shift[k] + rng.multivariate_normal(np.zeros(x.size), Q[k])
    return case._replace(observed=observed)


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.floats(0.0, 0.95))
def test_smoothed_moments_are_those_of_one_dense_least_squares_problem(seed: int, missing: float) -> None:
    case = problem(seed, m=12, missing=missing)
    solution = smoother.solve(case)
    mean, covariance = dense(case)
    np.testing.assert_allclose(solution.mean[:, :, 0], mean, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(solution.covariance, covariance, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("n", [5, 10])
def test_filterpy_and_the_compiled_engine_agree_to_1e9(seed: int, n: int) -> None:
    case = problem(seed, m=120, n=n, considered=2)
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
    assert smoother.log_likelihood(case) == pytest.approx(joint.logpdf(case.observed.ravel()), rel=1e-9)
    assert smoother.solve(case).log_likelihood == smoother.log_likelihood(case)
    assert p * m == case.observed.size


@pytest.mark.parametrize("seed", range(4))
def test_considered_parameters_shift_the_mean_as_finite_differences_say_and_nothing_else(seed: int) -> None:
    case = problem(seed, m=60, n=5, considered=3)
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


def test_full_matrices_are_what_the_sparse_ones_stand_for() -> None:
    case = problem(5)
    F, Q, H = transition(case), process(case), design(case)
    for k in (0, 17):
        for i in range(4):
            r = list(case.coupled).index(i) if i in case.coupled else None
            expected = np.diag(case.decay[k])[i] if r is None else case.rows[k, r]
            np.testing.assert_array_equal(F[k, i], expected)
        np.testing.assert_array_equal(Q[k], Q[k].T)
        np.testing.assert_array_equal(np.diag(Q[k]), case.noise[k])
        others = np.arange(4) != case.driven
        np.testing.assert_array_equal(Q[k, case.driven, others], case.cross[k, others])
    for j in range(3):
        x = np.arange(1.0, 5.0)
        assert H[j] @ x == pytest.approx(case.weight[j] @ x[case.seen[j]])


def test_innovations_are_white_and_of_the_stated_variance_on_data_from_the_model_itself() -> None:
    case = problem(11, m=4000, missing=0.2)
    case.rows[:, np.arange(case.coupled.size), case.coupled] = 0.9
    solution = smoother.solve(simulated(case, np.random.default_rng(7)))
    normal = solution.innovation / np.sqrt(solution.innovation_variance)
    normal = normal[np.isfinite(normal)]
    assert np.mean(normal**2) == pytest.approx(1.0, abs=5 * np.sqrt(2 / normal.size))
    assert abs(np.corrcoef(normal[:-1], normal[1:])[0, 1]) < 5 / np.sqrt(normal.size)


@pytest.mark.parametrize("m", [1, 2])
def test_one_or_two_instants_are_enough(m: int) -> None:
    case = problem(0, m=m)
    mean, _ = dense(case)
    np.testing.assert_allclose(smoother.solve(case).mean[:, :, 0], mean, rtol=1e-9, atol=1e-9)


def test_predictions_are_the_states_carried_on_without_measurements() -> None:
    case = problem(2, m=50, missing=0.3)
    steps, stride = (1, 5, 12), 7
    last = np.where(np.arange(50) < 30, 30, 49)
    error, variance = smoother.predictions(case, steps, stride, last)
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


def test_covariances_stay_symmetric_and_positive_without_any_measurement() -> None:
    case = problem(1, m=300, missing=1.1)
    solution = smoother.solve(case)
    assert np.array_equal(solution.covariance, solution.covariance.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(solution.covariance).min() > 0


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 100_000), st.sampled_from([4, 5, 10]), st.floats(0.0, 1.1))
def test_covariances_stay_positive_with_variances_over_eighteen_decades(seed: int, n: int, missing: float) -> None:
    solution = smoother.solve(problem(seed, n=n, missing=missing, decades=18.0))
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
    np.testing.assert_allclose(ours.mean[before], theirs.mean[before], rtol=1e-6, atol=1e-6)

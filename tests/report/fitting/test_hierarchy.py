"""Several missions together: against statsmodels, against integrals done otherwise, and against a known truth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import minimize_scalar
from scipy.stats import halfcauchy, multivariate_normal, norm
from statsmodels.stats.meta_analysis import combine_effects

from pipeline.report.fitting.hierarchy import Prior, conditional, evidence, homogeneity, pool

VALUE = np.array([0.31, -0.12, 0.55, 0.18, 0.90, 0.02])
STD = np.array([0.11, 0.20, 0.15, 0.08, 0.30, 0.14])
OWN = np.diag(STD**2)
SCALE = 0.4


class TestAgainstStatsmodels:
    @pytest.mark.parametrize("method", ["chi2", "iterated"])
    def test_mean_and_1_sigma_at_its_scatter_are_those_of_its_random_effects(self, method: str) -> None:
        theirs = combine_effects(VALUE, STD**2, method_re=method)
        found = conditional(VALUE, OWN, np.array([math.sqrt(theirs.tau2)]))
        assert found.mean[0, 0] == pytest.approx(theirs.mean_effect_re, rel=1e-12)
        assert math.sqrt(found.covariance[0, 0, 0]) == pytest.approx(theirs.sd_eff_w_re, rel=1e-12)

    def test_cochrans_q_and_its_probability_are_the_same(self) -> None:
        theirs = combine_effects(VALUE, STD**2).test_homogeneity()
        assert homogeneity(VALUE, OWN) == pytest.approx((theirs.statistic, theirs.pvalue), rel=1e-10)

    def test_missions_of_one_1_sigma_have_the_scatter_of_dersimonian_and_laird(self) -> None:
        # With equal variances restricted maximum likelihood has a closed form, which is theirs.
        theirs = combine_effects(VALUE, np.full(6, 0.1**2), method_re="chi2")
        found = minimize_scalar(
            lambda tau: -conditional(VALUE, 0.1**2 * np.eye(6), np.array([tau])).log_likelihood[0],
            bounds=(0.0, 3.0), method="bounded", options={"xatol": 1e-9},
        )  # fmt: skip
        assert found.x**2 == pytest.approx(theirs.tau2, rel=1e-6)
        assert theirs.tau2 == pytest.approx(np.var(VALUE, ddof=1) - 0.1**2)


class TestAgainstIntegralsDoneOtherwise:
    def chance(self, tau: float) -> float:
        """Return the chance of a scatter: the normal density of the missions, their mean integrated by quadrature."""
        width = np.hypot(STD, tau)
        found, _error = quad(lambda mean: math.exp(norm.logpdf(VALUE, mean, width).sum()), -3.0, 4.0, epsrel=1e-11)
        return float(found * halfcauchy.pdf(tau, scale=SCALE))

    def test_likelihood_of_the_scatter(self) -> None:
        tau = np.array([0.05, 0.2, 0.7])
        found = np.exp(conditional(VALUE, OWN, tau).log_likelihood) * halfcauchy.pdf(tau, scale=SCALE)
        found *= math.sqrt(2.0 * math.pi)
        assert found == pytest.approx([self.chance(each) for each in tau], rel=1e-8)

    def test_scatter_and_mean(self) -> None:
        whole, _error = quad(self.chance, 0.0, 40.0, limit=400, points=[0.1, 0.5, 2.0])
        found = pool(VALUE, OWN, SCALE)
        below, _error = quad(self.chance, 0.0, found.scatter.value, limit=200)
        assert below / whole == pytest.approx(0.5, abs=2e-4)
        inside, _error = quad(self.chance, found.scatter.low, found.scatter.high, limit=200)
        assert inside / whole == pytest.approx(0.95, abs=5e-4)

        def mean_at(tau: float) -> float:
            weight = 1.0 / (STD**2 + tau**2)
            return float(self.chance(tau) * (weight @ VALUE) / weight.sum())

        mean, _error = quad(mean_at, 0.0, 40.0, limit=400, points=[0.1, 0.5, 2.0])
        assert found.vehicle.value == pytest.approx(mean / whole, abs=2e-4)

    def test_what_missions_have_borrowed_in_common_is_not_averaged_away(self) -> None:
        shared = OWN + 0.25**2
        tau = np.array([0.1, 0.4])
        apart, together = conditional(VALUE, OWN, tau), conditional(VALUE, shared, tau)
        assert together.mean == pytest.approx(apart.mean)
        assert together.covariance == pytest.approx(apart.covariance + 0.25**2)
        assert np.array(pool(VALUE, shared, SCALE).scatter) == pytest.approx(pool(VALUE, OWN, SCALE).scatter, rel=2e-3)
        density = multivariate_normal(np.full(6, 0.3), shared + 0.2**2 * np.eye(6)).logpdf(VALUE)
        grid = conditional(VALUE, shared, np.array([0.2]))
        left = 0.3 - grid.mean[0, 0]
        at_best = grid.log_maximum[0] - 0.5 * left**2 / grid.covariance[0, 0, 0]
        assert at_best == pytest.approx(density, rel=1e-12)

    def test_the_prior_is_applied_once_however_many_missions_there_are(self) -> None:
        prior = Prior(1.0, 0.05)
        tau = np.array([0.2])
        alone, held = conditional(VALUE, OWN, tau), conditional(VALUE, OWN, tau, prior=prior)
        precision = 1.0 / alone.covariance[0, 0, 0] + 1.0 / prior.std**2
        assert held.covariance[0, 0, 0] == pytest.approx(1.0 / precision)
        expected = (alone.mean[0, 0] / alone.covariance[0, 0, 0] + prior.mean / prior.std**2) / precision
        assert held.mean[0, 0] == pytest.approx(expected)
        total = norm.logpdf(alone.mean[0, 0], prior.mean, math.hypot(prior.std, math.sqrt(alone.covariance[0, 0, 0])))
        gained = held.log_likelihood[0] - alone.log_likelihood[0]
        assert gained == pytest.approx(total + math.log(prior.std * math.sqrt(2.0 * math.pi)))


class TestLimits:
    def test_missions_that_agree_are_pulled_to_the_mean_and_those_that_do_not_are_left_alone(self) -> None:
        near = pool(np.array([0.1, 0.2, 0.15]), 0.3**2 * np.eye(3), 0.02)
        assert max(abs(each.value - near.vehicle.value) for each in near.missions) < 0.01
        far = pool(np.array([-5.0, 0.0, 5.0]), 0.01**2 * np.eye(3), 5.0)
        assert [each.value for each in far.missions] == pytest.approx([-5.0, 0.0, 5.0], abs=1e-3)
        assert [each.std for each in far.missions] == pytest.approx([0.01] * 3, rel=1e-2)

    def test_a_drift_is_found_where_there_is_one(self) -> None:
        time = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
        value, covariance = 1.0 + 0.5 * time + np.array([0.02, -0.01, 0.0, 0.01, -0.02]), 0.05**2 * np.eye(5)
        found = pool(value, covariance, 0.3, time=time)
        assert found.drift is not None
        assert found.drift.value == pytest.approx(0.49, abs=0.02)
        assert found.vehicle.value == pytest.approx(1.0, abs=0.01)
        assert evidence(value, covariance, time, 0.3) < -5.0
        assert evidence(value - 0.49 * time, covariance, time, 0.3) == pytest.approx(math.log(5.0), abs=0.1)

    def test_one_mission_is_not_several(self) -> None:
        with pytest.raises(ValueError, match="found 1 mission; expected two or more"):
            pool(np.array([1.0]), np.eye(1), 1.0)


values = st.lists(st.tuples(st.floats(-5.0, 5.0), st.floats(0.01, 3.0)), min_size=2, max_size=8)


@settings(max_examples=30)
@given(values, st.floats(0.05, 5.0), st.floats(-3.0, 3.0), st.floats(0.1, 10.0))
def test_units_and_zero_do_not_matter(
    missions: list[tuple[float, float]], scale: float, shift: float, unit: float
) -> None:
    value, std = np.array(missions).T
    plain, other = (
        pool(value, np.diag(std**2), scale),
        pool(unit * (value + shift), np.diag((unit * std) ** 2), unit * scale),
    )
    for a, b in zip(
        (plain.vehicle, plain.next, *plain.missions), (other.vehicle, other.next, *other.missions), strict=True
    ):
        assert b.value == pytest.approx(unit * (a.value + shift), abs=1e-6 * unit)
        assert b.std == pytest.approx(unit * a.std, rel=1e-5)
    assert other.scatter == pytest.approx(tuple(unit * each for each in plain.scatter), rel=1e-6)
    assert plain.next.std >= plain.vehicle.std


@pytest.mark.parametrize("count", [2, 4, 10])
def test_intervals_cover_the_truth(count: int) -> None:
    rng = np.random.default_rng(20140728)
    runs, hits = 150, np.zeros(4)
    for _ in range(runs):
        truth, scatter = rng.normal(0.0, 1.0), abs(rng.standard_cauchy()) * 0.3
        own = truth + scatter * rng.standard_normal(count + 1)
        std = rng.uniform(0.1, 0.5, count)
        found = pool(own[:count] + std * rng.standard_normal(count), np.diag(std**2), 0.3)
        pairs = (
            (found.vehicle, truth),
            (found.next, own[count]),
            (found.scatter, scatter),
            (found.missions[0], own[0]),
        )
        hits += [spread.low <= value <= spread.high for spread, value in pairs]
    assert np.all(np.abs(hits / runs - 0.95) < 3.5 * math.sqrt(0.95 * 0.05 / runs))


def test_a_drift_that_is_none_is_seldom_called_one() -> None:
    rng = np.random.default_rng(20150211)
    called = 0
    for _ in range(100):
        time = np.sort(rng.uniform(0.0, 2.0, 5))
        time -= time.mean()
        std = rng.uniform(0.05, 0.3, 5)
        value = rng.normal(0.0, np.hypot(std, 0.2))
        drift = pool(value, np.diag(std**2), 0.3, time=time).drift
        assert drift is not None
        called += evidence(value, np.diag(std**2), time, 0.3) < -2.0 and not drift.low < 0.0 < drift.high
    assert called / 100 <= 0.1

"""Evidence and BIC of linear problems against a multivariate normal density by scipy, a regression by statsmodels."""

import math

import numpy as np
import pytest
import statsmodels.api as sm
from scipy.stats import multivariate_normal
from statsmodels.tools.eval_measures import bic

from pipeline.report.fitting.evidence import Prior, information, posterior, separation, with_cause


class Straight:
    """A linear problem: `size` whitened values y = design @ x + noise of 1-sigma one."""

    def __init__(self, values: np.ndarray, design: np.ndarray) -> None:
        self.values, self.design, self.size = values, design, values.size

    def evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.values - self.design @ x, -self.design


@pytest.fixture(params=range(4))
def straight(request) -> Straight:
    rng = np.random.default_rng(request.param)
    design = rng.normal(size=(30, 4))
    return Straight(design @ rng.normal(size=4) + rng.normal(size=30), design)


PRIOR = Prior(np.zeros(4), np.diag([0.5, 1.0, 2.0, 0.0]))


def test_evidence_of_a_linear_problem_is_the_density_of_the_data_by_scipy(straight):
    prior = with_cause(PRIOR, 3, 0.7, 0.2)
    mean = straight.design @ prior.mean
    covariance = np.eye(30) + straight.design @ prior.root @ prior.root.T @ straight.design.T
    expected = -2.0 * multivariate_normal(mean, covariance).logpdf(straight.values)
    assert posterior(straight, prior).minus_two_log_evidence == pytest.approx(expected, rel=1e-10)


def test_value_and_error_of_a_linear_problem_are_those_of_the_conditional_normal(straight):
    prior = with_cause(PRIOR, 3, 0.7)
    covariance = prior.root @ prior.root.T
    gain = covariance @ straight.design.T @ np.linalg.inv(np.eye(30) + straight.design @ covariance @ straight.design.T)
    found = posterior(straight, prior)
    np.testing.assert_allclose(found.x, gain @ straight.values, atol=1e-9)
    np.testing.assert_allclose(found.covariance, covariance - gain @ straight.design @ covariance, atol=1e-9)


def test_bic_of_a_free_cause_is_that_of_statsmodels_with_all_else_in_the_covariance(straight):
    covariance = np.eye(30) + straight.design @ PRIOR.root @ PRIOR.root.T @ straight.design.T
    lower = np.linalg.cholesky(covariance)
    white, column = np.linalg.solve(lower, straight.values), np.linalg.solve(lower, straight.design[:, 3])
    model = sm.OLS(white, column[:, None])
    result = model.fit(cov_type="fixed scale", cov_kwds={"scale": 1.0})
    expected = bic(model.loglike(result.params, scale=1.0), 30, 1)
    found = posterior(straight, with_cause(PRIOR, 3, 1.0), free=True)
    own = found.minus_two_log_evidence + math.log(30)
    assert own == pytest.approx(expected + np.linalg.slogdet(covariance)[1], rel=1e-10)
    assert found.x[3] == pytest.approx(result.params[0], rel=1e-9)
    assert math.sqrt(found.covariance[3, 3]) == pytest.approx(result.bse[0], rel=1e-9)


def test_a_cause_of_no_size_is_nothing(straight):
    none = posterior(straight, PRIOR)
    nested = posterior(straight, with_cause(PRIOR, 3, 0.0))
    assert nested.minus_two_log_evidence == pytest.approx(none.minus_two_log_evidence, rel=1e-12)


def test_leverages_add_up_to_the_unknowns_that_the_data_determine(straight):
    sharp = Straight(1e4 * straight.values, 1e4 * straight.design)
    assert posterior(sharp, with_cause(PRIOR, 3, 1.0)).leverage.sum() == pytest.approx(4.0, abs=1e-3)


def test_expected_gain_in_chi_square_is_what_noiseless_data_give():
    rng = np.random.default_rng(7)
    design = rng.normal(size=(40, 3))
    prior = Prior(np.zeros(3), np.diag([0.3, 0.0, 0.0]))
    covariance = np.eye(40) + design @ prior.root @ prior.root.T @ design.T
    known = information(Straight(np.zeros(40), design), prior, [1, 2])
    signal = 0.8 * design[:, 1]
    inverse = np.linalg.inv(covariance)
    assert separation(known, 0, None, 0.8) == pytest.approx(signal @ inverse @ signal)
    rival = design[:, 2]
    left = signal - rival * (rival @ inverse @ signal) / (rival @ inverse @ rival)
    assert separation(known, 0, 1, 0.8) == pytest.approx(left @ inverse @ left)


def test_a_step_that_leads_out_of_flight_is_halved():
    class Curved:
        size = 1

        def evaluate(self, x):
            return np.array([4.0 - math.exp(x[0])]), np.array([[-math.exp(x[0])]])

    found = posterior(Curved(), with_cause(Prior(np.zeros(1), np.zeros((1, 1))), 0, 1.0), free=True)
    assert found.x[0] == pytest.approx(math.log(4.0), abs=1e-4)

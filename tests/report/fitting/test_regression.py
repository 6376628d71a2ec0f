"""The regression against independent solvers: scipy on the dense covariance, statsmodels for Huber's loss."""

import math

import numpy as np
import pytest
import statsmodels.api as sm
from scipy.linalg import toeplitz
from scipy.optimize import least_squares
from synthetic import SETTINGS, blocks

from pipeline.report.fitting import selection
from pipeline.report.fitting.fit import FREE, fit, solvable
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.model import Model
from pipeline.report.fitting.regression import Problem, outlying, robust, solve
from pipeline.vehicle import Vehicle


def problem(vehicle: Vehicle, table, free=FREE, **options) -> Problem:
    made, reason = solvable(table, vehicle, Given(**({"settings": SETTINGS} | options)))
    assert not reason
    return made.freeing(free)


def test_solution_is_that_of_scipy_on_the_dense_covariance(exact):
    table = blocks(dives=1, each=6, sides=(-1,), extra_drag=1.0, seed=2)
    ours = problem(exact, table, ("parasite_drag",), ballast_std=0.0, pitch_std=0.0)
    solution = solve(ours)
    # blocks of 300 s in a row, water of 1 cm/s and 300 s: double integrals of the covariance, by hand
    sigma, ratio = SETTINGS["sigma_w"], math.exp(-1.0)
    first = [2.0 * sigma**2 * ratio, *(sigma**2 * (1.0 - ratio) ** 2 * ratio ** (k - 1) for k in range(1, 6))]
    covariance = toeplitz(first) + np.eye(6) * 0.001**2
    factor = np.linalg.inv(np.linalg.cholesky(covariance))
    model = Model(exact, ours.points, ("parasite_drag",))
    theirs = least_squares(lambda x: factor @ (ours.points.depth_rate - model.fly(x).depth_rate), [0.0], xtol=1e-14)
    assert solution.x[0] == pytest.approx(theirs.x[0], rel=1e-6)
    assert solution.chi_square == pytest.approx(2.0 * theirs.cost, rel=1e-6)
    assert solution.covariance[0, 0] == pytest.approx(1.0 / float(np.sum(theirs.jac**2)), rel=1e-4)


def test_priors_that_are_correlated_count_as_one(petrel):
    correlated = Vehicle(petrel.name, petrel.description, petrel.coefficients, {("lift_slope", "induced_drag"): 0.8})
    ours = problem(correlated, blocks(dives=3))
    rows = ours.prior_rows(on_free=False)
    places = [ours.model.names.index(name) for name in ("lift_slope", "induced_drag")]
    matrix = np.linalg.inv(rows.T @ rows + np.diag([1e12, 1e12] + [0.0] * (len(ours.model.names) - 2)))
    assert matrix[places[0], places[1]] == pytest.approx(0.8, abs=1e-6)


def test_huber_weights_are_those_of_statsmodels(exact):
    table = blocks(dives=8, sigma_w=0.0, noise=0.01, seed=4)
    table.loc[5, "depth_rate"] += 0.3
    table.loc[40, "depth_rate"] -= 0.2
    ours = problem(
        exact, table, ("parasite_drag",), settings={"sigma_w": 1e-9, "tau_w": 1.0}, ballast_std=0.0, pitch_std=0.0
    )
    plain = solve(ours)
    assert set(outlying(plain.residual)) == {5, 40}
    found = robust(ours, plain)
    white, slope = ours.evaluate(found.x)
    # the same regression, linear about the solution, with statsmodels' scale held at the robust scatter found
    scatter = max(1.0, 1.4826 * float(np.median(np.abs(white))))
    weights = sm.robust.norms.HuberT(t=1.345).weights(white / scatter)
    np.testing.assert_allclose(found.weights, weights, atol=2e-3)
    gradient = slope[:, 0] @ (weights * white)
    assert abs(gradient) < 1e-2 * math.sqrt(float(slope[:, 0] @ slope[:, 0]))


def test_one_wild_block_hardly_moves_the_fit_and_is_named(exact):
    table = blocks(dives=8, seed=6)
    wild = table.copy()
    wild.loc[17, "depth_rate"] += 0.4
    clean, found = (fit(each, exact, Given(SETTINGS, pitch_std=0.0)) for each in (table, wild))
    assert clean["robust"]["loss"] == "none"
    assert found["robust"]["loss"] == "huber"
    assert 17 in found["robust"]["blocks"]
    assert "Huber" in found["text"]
    for one, other in zip(clean["parameters"], found["parameters"], strict=True):
        assert abs(one["value"] - other["value"]) < one["std"]


def test_a_search_without_an_end_is_said_not_to_converge(exact, monkeypatch):
    monkeypatch.setattr(selection, "solve", lambda *_args, **_options: None)
    result = fit(blocks(dives=2), exact, Given(SETTINGS))
    assert result["reason"] == "the fit does not converge: look at pitch and buoyancy of the blocks"
    assert all(math.isnan(item["value"]) for item in result["parameters"])


def test_a_problem_of_some_dives_is_that_of_their_blocks_alone(petrel):
    table = blocks(dives=4, sensor=True)
    whole = problem(petrel, table, use_sensor=True)
    part = whole.of(whole.points.only(whole.points.dive <= 2))
    alone = problem(petrel, table[table["dive"] <= 2], use_sensor=True)
    for one, other in zip(
        part.evaluate(np.zeros(len(part.model.names))), alone.evaluate(np.zeros(len(alone.model.names))), strict=True
    ):
        np.testing.assert_allclose(one, other)

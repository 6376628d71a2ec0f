"""Colour, bootstrap and profiles against statsmodels, theory and each other."""

import math
from dataclasses import replace

import numpy as np
import pytest
from statsmodels.stats.diagnostic import acorr_ljungbox
from synthetic import SETTINGS, blocks

from pipeline.report.fitting.fit import FREE, fit, solvable
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.regression import solve
from pipeline.report.fitting.uncertainty import HALF_WIDTH, bootstrap, colour, profile

#: Missions flown for a coverage.
SEEDS = 400


def coloured(share: float, n: int = 400, seed: int = 3) -> np.ndarray:
    rng = np.random.default_rng(seed)
    out = rng.standard_normal(n)
    for k in range(1, n):
        out[k] += share * out[k - 1]
    return out


def solved(vehicle, **options):
    made, _ = solvable(blocks(**options), vehicle, Given(SETTINGS, pitch_std=0.0))
    problem = made.freeing(FREE)
    return problem, solve(problem)


def test_ljung_box_is_that_of_statsmodels():
    value = coloured(0.3)
    found, theirs = colour(value), acorr_ljungbox(value, lags=[10])
    assert found.ljung_box == pytest.approx(float(theirs["lb_stat"].iloc[0]), rel=1e-9)
    assert found.p_value == pytest.approx(float(theirs["lb_pvalue"].iloc[0]), rel=1e-6)


def test_effective_number_of_a_coloured_series_is_that_of_theory():
    share = 0.5
    found = colour(coloured(share, 4000))
    assert found.coloured
    assert found.effective == pytest.approx(4000 * (1.0 - share) / (1.0 + share), rel=0.15)


def test_white_residuals_keep_their_number():
    found = colour(coloured(0.0, 200))
    assert not found.coloured
    assert found.effective == 200.0
    assert colour(np.ones(3)).effective == 3.0


def test_bootstrap_by_dives_agrees_with_the_covariance_where_the_errors_are_as_assumed(exact):
    ratios = []
    for seed in range(6):
        problem, solution = solved(exact, dives=30, each=2, seed=seed)
        found = bootstrap(problem, solution)
        ratios.append(np.array(found["std"]) / np.sqrt(np.diag(solution.covariance)[:2]))
        for (low, high), value in zip(found["interval_95"], solution.x, strict=False):
            assert low < value < high
    np.testing.assert_allclose(np.mean(ratios, axis=0), 1.0, atol=0.15)


def test_one_newton_step_is_what_refitting_the_resampled_dives_gives(exact):
    problem, solution = solved(exact, dives=12, seed=1)
    weights = np.repeat(np.random.default_rng(0).multinomial(12, np.full(12, 1 / 12)), 8).astype(float)
    whole = solve(problem, weights=weights)
    slope, scale = solution.jacobian * problem.scale, problem.scale
    step = np.linalg.solve(slope.T @ (weights[:, None] * slope), -slope.T @ (weights * solution.residual)) * scale
    np.testing.assert_allclose(
        (solution.x + step)[:2], whole.x[:2], atol=0.1 * np.sqrt(np.diag(whole.covariance)).min()
    )


def test_bootstrap_draws_what_is_borrowed_too(petrel, exact):
    wide, narrow = (bootstrap(*solved(vehicle, dives=20, seed=2))["std"][0] for vehicle in (petrel, exact))
    assert wide > narrow


def test_bootstrap_is_the_same_every_time_and_needs_five_dives(exact):
    problem, solution = solved(exact, dives=6)
    assert bootstrap(problem, solution) == bootstrap(problem, solution)
    few = bootstrap(*solved(exact, dives=3))
    assert few["reason"] == "3 dives: at least 5 are needed"
    assert math.isnan(few["std"][0])


def test_profile_of_a_nearly_linear_correction_is_the_parabola_of_its_1_sigma(exact):
    problem, solution = solved(exact, dives=12)
    found = profile(problem, solution, 1)
    std = math.sqrt(solution.covariance[1, 1])
    expected = ((np.array(found["value"]) - solution.x[1]) / std) ** 2
    np.testing.assert_allclose(found["delta_chi_square"], expected, rtol=0.05, atol=0.02)
    low, high = found["interval_95"]
    assert (high - low) / (2.0 * std) == pytest.approx(math.sqrt(HALF_WIDTH), rel=0.03)


def test_an_interval_that_ends_beyond_three_1_sigma_is_followed_to_its_end(exact):
    problem, solution = solved(exact, dives=12)
    # A 1-sigma said to be a fifth of what it is: the profile has to go five times as far.
    shrunken = replace(solution, covariance=solution.covariance / 25.0)
    found, wanted = (profile(problem, each, 0) for each in (shrunken, solution))
    assert found["interval_95"] == pytest.approx(wanted["interval_95"], rel=0.02)
    assert len(found["value"]) == len(found["delta_chi_square"]) > len(wanted["value"]) == 13


def test_where_theory_bends_the_profile_holds_the_truth_as_often_as_it_says_and_the_1_sigma_does_not(exact):
    # V goes with the root of drag: where water leaves drag open by half, its error is far from normal.
    water = {"sigma_w": 0.08, "tau_w": 300.0}
    by_profile = by_std = 0
    for seed in range(SEEDS):
        table = blocks(dives=1, each=1, sides=(-1, 1), sigma_w=water["sigma_w"], seed=seed)
        made, _ = solvable(table, exact, Given(water, ballast_std=0.0, pitch_std=0.0))
        problem = made.freeing(("parasite_drag",))
        solution = solve(problem)
        low, high = profile(problem, solution, 0)["interval_95"]
        by_profile += not (low > 0.0 or high < 0.0)
        by_std += abs(solution.x[0]) < 1.96 * math.sqrt(solution.covariance[0, 0])
    error = math.sqrt(0.95 * 0.05 / SEEDS)
    assert by_profile / SEEDS == pytest.approx(0.95, abs=3.0 * error)
    assert by_std / SEEDS < 0.95 - 2.0 * error


def test_scatter_that_widens_the_1_sigma_widens_the_profile(exact):
    problem, solution = solved(exact, dives=8)
    narrow, wide = (profile(problem, solution, 0, inflation=factor)["interval_95"] for factor in (1.0, 2.0))
    assert (wide[1] - wide[0]) / (narrow[1] - narrow[0]) == pytest.approx(2.0, rel=0.15)


def test_the_fit_carries_profiles_and_bootstrap_of_every_correction(exact):
    result = fit(blocks(dives=6), exact, Given(SETTINGS))
    assert [item["name"] for item in result["profiles"]] == list(FREE)
    assert all(item["bootstrap_std"] > 0.0 for item in result["parameters"])
    assert result["bootstrap"]["resamples"] >= 200

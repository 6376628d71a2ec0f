"""Noise levels of a mission: what the search leaves open of them moves the estimate, and is in every interval."""

from __future__ import annotations

from dataclasses import replace

import arrays
import dives
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.special import gammaln

from pipeline.estimate import kalman, kinematic, smoother, stage
from pipeline.estimate.linearise import Sources, follow, linearise
from pipeline.estimate.noise import (
    SEARCHED,
    WATER,
    covariance,
    fill_left_open,
    levelled,
    mean_over_mode,
    moved,
    noise_from,
)
from pipeline.estimate.problem import Problem
from pipeline.estimate.series import from_records
from pipeline.estimate.settings import Noise, Settings
from pipeline.estimate.trajectory import first_guess, iterate


@given(st.floats(0.05, 1.0), st.floats(0.05, 1.0), st.floats(-0.9, 0.9))
def test_sigma_moves_by_its_own_spread_and_tau_with_it_as_far_as_they_are_correlated(
    a: float, b: float, correlation: float
) -> None:
    covariance = np.array([[a * a, correlation * a * b], [correlation * a * b, b * b]])
    first, second = moved(Settings(), ["sigma_w", "tau_w"], covariance)
    usual = Settings()
    assert np.log(first.sigma_w / usual.sigma_w) == pytest.approx(a)
    assert np.log(first.tau_w / usual.tau_w) == pytest.approx(correlation * b)
    assert second.sigma_w == usual.sigma_w
    assert np.log(second.tau_w / usual.tau_w) == pytest.approx(b * np.sqrt(1.0 - correlation**2))


def test_the_moves_account_for_all_of_the_covariance_of_sigma_and_tau() -> None:
    root = np.random.default_rng(3).normal(size=(4, 4))
    covariance = root @ root.T / 20.0
    names = ["sigma_w", "tau_w", "unsteadiness", "depth_noise"]
    usual = Settings()
    steps = np.array(
        [[np.log(getattr(to, name) / getattr(usual, name)) for name in names] for to in moved(usual, names, covariance)]
    )
    np.testing.assert_allclose((steps.T @ steps)[:, :2], covariance[:, :2], atol=1e-12)


def test_a_linear_estimate_changes_by_its_slope_times_the_move() -> None:
    usual = Settings()
    noise = Noise(usual, (usual._replace(sigma_w=0.03), usual._replace(tau_w=400.0)))
    mean = np.full((2, 1, 4), 7.0)
    fill_left_open(noise, mean, lambda s: 7.0 + np.array([[s.sigma_w - usual.sigma_w], [s.tau_w - usual.tau_w]]))
    np.testing.assert_allclose(mean[:, 0, 2:], [[0.02, 0.0], [0.0, 100.0]])
    assert (mean[:, :, :2] == 7.0).all()


def test_where_nothing_is_open_nothing_is_filled() -> None:
    mean = np.full((5, 3, 2), 7.0)
    fill_left_open(Noise(Settings()), mean, lambda s: np.zeros((5, 3)))
    assert (mean == 7.0).all()


def test_what_is_not_known_of_the_water_widens_the_intervals_of_speed_and_water() -> None:
    flown = dives.fly(5, dives=((25.0, 4.0, 150.0),))
    series = from_records(flown.records)
    model = kinematic.prepare(series, flown.vehicle, flown.mission, smoother.solve, fixes=False)
    assert len(model.noise.moved) == 2
    known = model._replace(noise=Noise(model.noise.settings))
    here, there = (kinematic.solve(series, each).flight for each in (model, known))
    np.testing.assert_array_equal(here.state, there.state)
    assert (here.std >= there.std * (1.0 - 1e-12)).all()
    under = ~series.afloat
    assert np.mean(here.std[4, under]) > np.mean(there.std[4, under])


@pytest.mark.parametrize("length", [400, 40, 12])
def test_how_steep_each_leg_is_passes_for_no_random_walk(length: int) -> None:
    """Legs between turns, each as steep as it likes, with white noise of 0.1° and a walk of 0.02° a sample."""
    rng, legs, turn = np.random.default_rng(4), 4000 // length, 6
    pitch, quick = [], []
    for leg in range(legs):
        walk = np.cumsum(rng.normal(0.0, 0.02, length))
        pitch.append((-1) ** leg * rng.uniform(15.0, 45.0) + walk + rng.normal(0.0, 0.1, length))
        quick.append(np.zeros(length, dtype=bool))
        pitch.append(rng.uniform(-45.0, 45.0, turn))
        quick.append(np.ones(turn, dtype=bool))
    degrees, manoeuvre = np.concatenate(pitch), np.concatenate(quick)
    series = arrays.series(3.0 * np.arange(degrees.size), np.radians(degrees))
    found = noise_from(replace(series, manoeuvre=manoeuvre))
    assert np.degrees(found.pitch_noise) == pytest.approx(0.1, rel=0.1)
    assert np.degrees(np.sqrt(3.0 * found.pitch_drift)) == pytest.approx(0.02, abs=0.02)


def test_a_mission_known_twice_as_badly_leaves_more_open() -> None:
    flown = dives.fly(5, dives=((25.0, 4.0, 150.0),))
    series = from_records(flown.records)
    half = series.time < 0.5 * (series.time[0] + series.time[-1])
    short = replace(series, depth=np.where(half, series.depth, np.nan), pitch=np.where(half, series.pitch, np.nan))
    whole, part = (
        kinematic.prepare(each, flown.vehicle, flown.mission, smoother.solve, fixes=False).noise
        for each in (series, short)
    )
    spread = [np.log(noise.moved[0].sigma_w / noise.settings.sigma_w) for noise in (whole, part)]
    assert spread[1] > spread[0] > 0.0


def innovation_sizes(problem: Problem, steady: np.ndarray) -> np.ndarray:
    """Return the mean normalised innovation squared of depth and of pitch in steady flight, shape (2,)."""
    found, variance = kalman.innovations(problem)
    return np.asarray(np.nanmean(found[steady, :2, 0] ** 2 / variance[steady, :2], axis=0))


@pytest.mark.parametrize(("depth_by", "pitch_by"), [(1.0, 1.0), (1.7, 0.4), (0.6, 2.5)])
def test_wherever_the_noise_of_depth_and_pitch_starts_innovations_come_out_as_large_as_predicted(
    depth_by: float, pitch_by: float
) -> None:
    flown = dives.fly(5, dives=((25.0, 4.0, 150.0),))
    series = from_records(flown.records)
    model = kinematic.prepare(series, flown.vehicle, flown.mission, smoother.solve, fixes=False)
    polar, here, sources = model.polar, model.noise.settings, model.sources
    at = iterate(series, polar, here, first_guess(series, polar), sources, smoother.solve, 3)
    wrong = here._replace(
        depth_noise=here.depth_noise * depth_by,
        pitch_noise=here.pitch_noise * pitch_by,
        pitch_drift=here.pitch_drift * pitch_by**2,
    )
    steady, along = ~(series.manoeuvre | series.afloat), follow(series, polar, at)

    def problem_of(settings: Settings) -> Problem:
        return linearise(series, along, settings, sources)

    found = levelled(wrong, steady, problem_of)
    np.testing.assert_allclose(innovation_sizes(problem_of(found), steady), 1.0, rtol=0.02)
    assert found.pitch_drift / found.pitch_noise**2 == pytest.approx(here.pitch_drift / here.pitch_noise**2)
    assert found.depth_noise == pytest.approx(0.02, rel=0.25)  # what `dives.fly` adds


def test_too_few_innovations_leave_the_noise_as_it_was() -> None:
    flown = dives.fly(5, dives=((25.0, 4.0, 150.0),))
    series = from_records(flown.records)
    polar, here, sources = flown.vehicle.polar, Settings(), Sources(speed=False, fixes=False)
    along = follow(series, polar, first_guess(series, polar))
    nowhere = np.zeros(series.time.size, dtype=bool)
    np.testing.assert_allclose(
        levelled(here, nowhere, lambda settings: linearise(series, along, settings, sources)), here, rtol=1e-12
    )


def test_in_the_estimates_innovations_of_depth_and_pitch_are_as_large_as_predicted() -> None:
    flown = dives.fly(8, dives=((30.0, 5.0, 250.0),))
    report = stage.estimate(flown.records, flown.vehicle, flown.mission).report["consistency"]
    for method in ("kinematic", "force"):
        for row in report[method]["innovations"]:
            assert row["low_effective"] <= row["nis"] <= row["high_effective"], (method, row["instrument"])


# --- The curvature of a search ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1.0, 30.0, 1000.0])
def test_a_steep_and_skew_valley_is_not_taken_for_a_flat_one(scale: float) -> None:
    """Curvatures of 1 to `scale`, tilted against the axes; along each the cost is exp(x) - x, skew by its own width."""
    turn = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [-1.0, 0.4, 2.0], [0.3, -1.0, 1.0]]))[0]
    widths, floor = np.array([1.0, 0.5, scale**-0.5]), np.array([0.4, -0.2, 0.1])

    def cost(u: np.ndarray) -> float:
        x = turn.T @ (u - floor) / widths
        return float(np.sum(np.exp(x) - x))

    search = minimize(cost, np.zeros(3), method="L-BFGS-B", options={"ftol": 1e-3})
    found = covariance(cost, search.x, search.hess_inv.todense())
    np.testing.assert_allclose(turn.T @ found @ turn / np.outer(widths, widths), np.eye(3), atol=0.15)


def test_what_the_data_do_not_tell_is_as_open_as_before() -> None:
    known = covariance(lambda u: 0.5 * float(u @ u), np.zeros(2), np.diag([2.0, 1e-3]))
    np.testing.assert_allclose(known, np.eye(2), atol=1e-9)
    saddle = covariance(lambda u: 0.5 * float(u[0] ** 2 - u[1] ** 2), np.zeros(2), np.eye(2))
    np.testing.assert_allclose(saddle, np.eye(2), atol=1e-9)


def test_a_variance_told_by_its_scatter_alone_has_the_mean_of_an_inverse_gamma() -> None:
    """Squares of n normals under a flat prior: 1-sigma has the mean sqrt(n/2) Γ((n - 1)/2)/Γ(n/2), its mode being 1."""
    for n in (8.0, 20.0, 400.0):
        found = mean_over_mode(np.array([2.0, 0.0]), np.array([1e3, 1.0]), np.diag([0.5 / n, 1.0]))
        mean = np.sqrt(0.5 * n) * np.exp(gammaln(0.5 * (n - 1.0)) - gammaln(0.5 * n))
        assert found == pytest.approx(mean**2, rel=1e-3)


@given(st.floats(0.1, 1.5), st.floats(0.1, 1.5), st.floats(-0.9, 0.9))
def test_a_variance_that_the_data_do_not_tell_has_the_mean_of_its_log_normal_prior(
    sigma: float, tau: float, power: float
) -> None:
    spread, powers = np.array([sigma, tau]), np.array([2.0, power])
    found = mean_over_mode(powers, spread, np.diag(spread**2))
    assert found == pytest.approx(np.exp(0.25 * (powers**2 @ spread**2)), rel=1e-3)


@given(st.floats(0.01, 0.15), st.floats(1.05, 2.0))
def test_the_less_is_known_of_a_variance_the_larger_its_mean(after: float, factor: float) -> None:
    spread, powers = np.array([0.8]), np.array([2.0])
    less, more = (mean_over_mode(powers, spread, np.array([[each]])) for each in (after, after * factor))
    assert 1.0 < less <= more * (1.0 + 1e-12)


def test_what_a_vehicle_does_in_manoeuvres_is_not_taken_for_the_water() -> None:
    """Dives so short that the engine works throughout: w_w of 2 mm/s stays as it was thought to be before, 1.5 cm/s."""
    flown = dives.fly(1, dives=((30.0, 12.0, 50.0),) * 4, every=5, water=(0.002, 300.0))
    series = from_records(flown.records)
    assert series.manoeuvre.all()
    model = kinematic.prepare(series, flown.vehicle, flown.mission, smoother.solve, fixes=False)
    assert model.noise.settings.sigma_w < WATER * np.exp(SEARCHED["sigma_w"] ** 2), "the mean of what is thought before"

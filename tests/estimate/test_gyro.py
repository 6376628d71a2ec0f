"""A measured rate of pitch: what it says of the turns, how far it is believed, and against simulated truth."""

import numpy as np
import pandas as pd
import pytest
from dives import Flown, fly
from problems import problem

from pipeline.estimate import smoother, stage
from pipeline.estimate.gyro import LEAST, Walks, turns, walks
from pipeline.estimate.problem import design, process, transition
from pipeline.estimate.sensors import with_rate
from pipeline.records import Quality

TIME = np.arange(0.0, 4000.0, 2.0)
#: A dive and a climb every 200 s: turns at up to 1.9°/s, with steady flight between.
PITCH = 0.45 * np.tanh(4.0 * np.sin(2.0 * np.pi * TIME / 400.0)) + 1e-5 * TIME
RATE = np.gradient(PITCH, TIME)
TURNING = np.abs(RATE) > 1e-3
FLYING = np.ones(TIME.size, dtype=bool)


def test_a_steady_turn_is_its_rate_times_the_time_whatever_the_clocks() -> None:
    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0.0, 100.0, 300))
    rate = np.where(rng.random(300) < 0.4, 0.02, np.nan)
    turn = turns(time, rate)
    known = np.flatnonzero(np.isfinite(turn))
    np.testing.assert_allclose(turn[known], 0.02 * np.diff(time)[known], rtol=1e-12)
    assert np.isnan(turn[-1])
    ends = np.flatnonzero(np.isfinite(rate))[[0, -1]]
    assert known.min() >= ends[0]
    assert known.max() < ends[1]


def test_the_turn_of_a_straight_rate_is_exact_between_its_samples() -> None:
    time = np.array([0.0, 0.3, 1.0, 1.9, 2.0])
    turn = turns(time, np.array([0.0, np.nan, np.nan, np.nan, 0.2]))
    np.testing.assert_allclose(turn[:-1], 0.05 * np.diff(time**2), rtol=1e-12)


def test_over_a_pause_three_times_as_long_as_usual_nothing_is_known() -> None:
    time = np.concatenate([np.arange(0.0, 10.0), [13.5], np.arange(14.0, 20.0)])
    turn = turns(time, np.full(time.size, 0.1))
    assert np.isnan(turn[9])
    assert np.isfinite(turn[:9]).all()
    assert np.isfinite(turn[10:-1]).all()


@pytest.mark.parametrize("rate", [[], [np.nan], [np.nan, np.nan, np.nan], [0.1, np.nan, np.nan]])
def test_without_two_samples_no_turn_is_known(rate: list[float]) -> None:
    assert np.isnan(turns(np.arange(float(len(rate))), np.array(rate))).all()


@pytest.mark.parametrize("walk", [0.05, 0.2])
def test_the_walk_that_a_gyro_leaves_is_found(walk: float) -> None:
    """White noise s on a rate sampled every T is a walk of s² T; the sensor of pitch has noise of its own."""
    rng = np.random.default_rng(1)
    rate = RATE + np.radians(walk) / np.sqrt(2.0) * rng.standard_normal(TIME.size) + 0.01  # biased, too
    pitch = PITCH + np.radians(0.1) * rng.standard_normal(TIME.size)
    found = walks(TIME, pitch, turns(TIME, rate), TURNING, FLYING, np.radians(0.1))
    assert np.degrees(np.sqrt(found.manoeuvre)) == pytest.approx(walk, rel=0.25)
    assert np.isnan(found.steady)  # pitch did not wander there: nothing to gain


def test_a_gyro_of_no_worth_is_not_used() -> None:
    rng = np.random.default_rng(2)
    pitch = PITCH + np.radians(0.1) * rng.standard_normal(TIME.size)
    for useless in (-RATE, np.degrees(RATE), np.full(TIME.size, 0.02), np.zeros(TIME.size), np.full(TIME.size, np.nan)):
        found = walks(TIME, pitch, turns(TIME, useless), TURNING, FLYING, np.radians(0.1))
        assert np.isnan(found).all()


@pytest.mark.parametrize("rows", [0, 1, 2, 5, 30])
def test_too_little_of_pitch_says_nothing_of_a_gyro(rows: int) -> None:
    pitch = np.where(np.arange(TIME.size) < rows, PITCH, np.nan)
    assert np.isnan(walks(TIME, pitch, turns(TIME, RATE), TURNING, FLYING, 0.001)).all()
    short = slice(0, max(rows, 1))
    few = walks(TIME[short], PITCH[short], turns(TIME[short], RATE[short]), TURNING[short], FLYING[short], 0.001)
    assert np.isnan(few).all()


def test_no_gyro_is_believed_to_be_perfect() -> None:
    turn = np.append(np.diff(PITCH), np.nan)
    assert walks(TIME, PITCH, turn, TURNING, FLYING, 0.0) == Walks(LEAST, LEAST)


def test_turns_and_bias_are_those_of_a_textbook_filter() -> None:
    case = problem(2, m=30, size=(5, 2), missing=0.2)
    pitch = next(i for i in range(5) if i not in case.coupled and i != case.driven)
    decay = case.decay.copy()
    decay[:, pitch] = 1.0
    case = case._replace(decay=decay)
    rng = np.random.default_rng(4)
    m, n = case.decay.shape
    time, turn, turning = np.cumsum(rng.uniform(0.5, 3.0, m)), 0.1 * rng.standard_normal(m), rng.random(m) < 0.7
    turn = np.where(turning, turn, 0.0)
    found = smoother.solve(with_rate(case, time, pitch, turn, turning, (0.3, 0.01)))
    F, Q, H = transition(case), process(case), design(case)
    mean, P = np.append(case.mean_0, 0.0), np.zeros((n + 1, n + 1))
    P[:n, :n], P[n, n] = case.covariance_0, 0.3**2
    for k in range(m):
        for j in np.flatnonzero(np.isfinite(case.observed[k])):
            row = np.append(H[j], 0.0)
            gain = P @ row / (row @ P @ row + case.variance[k, j])
            mean, P = mean + gain * (case.observed[k, j] - row @ mean), P - np.outer(gain, row @ P)
        if k < m - 1:
            dt, step, shift = time[k + 1] - time[k], np.eye(n + 1), np.zeros(n + 1)
            step[:n, :n], step[pitch, n] = F[k], -dt if turning[k] else 0.0
            shift[case.coupled], shift[pitch] = case.shift[k, :, 0], turn[k]
            mean, P = step @ mean + shift, step @ P @ step.T
            P[:n, :n] += Q[k]
            P[n, n] += 0.01 * dt
    np.testing.assert_allclose(found.mean[-1, :, 0], mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.covariance[-1], P, rtol=1e-8, atol=1e-12)


def test_without_a_turn_the_problem_stays_as_it_is() -> None:
    case = problem(2, m=10)
    assert with_rate(case, np.arange(10.0), 0, np.zeros(10), np.zeros(10, dtype=bool), (1.0, 1.0)) is case


# --- Against truth: pitch every 16 s, its rate every second -----------------------------------------------------------


@pytest.fixture(scope="module")
def flown() -> Flown:
    """Return a mission of short dives, its pitch reported every 16 s only."""
    found = fly(0, dives=((25.0, 4.0, 60.0), (40.0, 6.0, 60.0)), every=1)
    seldom = np.arange(len(found.records)) % 16 == 0
    return found._replace(records=found.records.assign(pitch=found.records["pitch"].where(seldom)))


def estimated(flown: Flown, rate: np.ndarray | None = None, flag: Quality = Quality.GOOD) -> stage.Estimated:
    """Return the estimates with what a gyro reports, if there is one."""
    records = flown.records if rate is None else flown.records.assign(pitch_rate=rate, pitch_rate_qc=np.int8(flag))
    return stage.estimate(records, flown.vehicle, flown.mission)


def reported(flown: Flown) -> np.ndarray:
    """Return what a gyro reports: 1 % of scale, 0.3°/s of bias that wanders by 0.1, 0.05°/s of noise."""
    rng = np.random.default_rng(6)
    m = len(flown.truth)
    wrong = 0.3 + 0.1 * np.sin(np.arange(m) / 400.0) + 0.05 * rng.standard_normal(m)
    return 1.01 * flown.truth["pitch_rate"].to_numpy() + np.radians(wrong)


def turning(flown: Flown) -> np.ndarray:
    """Return where the vehicle turns fast, below the waves."""
    return np.asarray((flown.truth["pitch_rate"].abs() > np.radians(0.5)) & (flown.truth["depth"] > 5.0))


@pytest.fixture(scope="module")
def blind(flown: Flown) -> stage.Estimated:
    return estimated(flown)


@pytest.fixture(scope="module")
def seeing(flown: Flown) -> stage.Estimated:
    return estimated(flown, reported(flown))


def of(found: stage.Estimated, method: str, name: str) -> np.ndarray:
    """Return one column of the estimates by one method."""
    return found.estimates.loc[found.estimates["method"] == method, name].to_numpy()


@pytest.mark.parametrize("method", ["kinematic", "force"])
def test_pitch_in_fast_turns_is_better_known_and_its_intervals_hold(
    flown: Flown, blind: stage.Estimated, seeing: stage.Estimated, method: str
) -> None:
    fast, true = turning(flown), flown.truth["pitch"].to_numpy()
    error, before = (of(found, method, "pitch")[fast] - true[fast] for found in (seeing, blind))
    std, std_before = (of(found, method, "pitch_std")[fast] for found in (seeing, blind))
    assert np.sqrt(np.mean(error**2)) < 0.8 * np.sqrt(np.mean(before**2))
    assert std.mean() < 0.5 * std_before.mean()
    assert np.mean(np.abs(error) < 1.96 * std) > 0.95


def test_the_angle_of_attack_of_a_fast_turn_is_better_known(
    flown: Flown, blind: stage.Estimated, seeing: stage.Estimated
) -> None:
    """By the lift balance with m V q: there the pitch rate tells."""
    fast = turning(flown) & np.isfinite(of(blind, "force", "speed")) & np.isfinite(of(seeing, "force", "speed"))
    fast &= flown.truth["speed"].to_numpy() > 0.2
    true = flown.truth["angle_of_attack"].to_numpy()[fast]
    error, before = (of(found, "force", "angle_of_attack")[fast] - true for found in (seeing, blind))
    assert np.sqrt(np.mean(error**2)) < 0.9 * np.sqrt(np.mean(before**2))
    assert np.mean(np.abs(error) < 1.96 * of(seeing, "force", "angle_of_attack_std")[fast]) > 0.9


def test_the_account_says_whether_a_gyro_was_used(blind: stage.Estimated, seeing: stage.Estimated) -> None:
    assert not blind.report["used"]["pitch_rate"]
    assert seeing.report["used"]["pitch_rate"]


@pytest.mark.parametrize("damage", ["stuck", "wrong sign", "flagged", "absent"])
def test_a_gyro_that_is_not_believed_changes_nothing_to_the_last_bit(
    flown: Flown, blind: stage.Estimated, damage: str
) -> None:
    rate, flag = reported(flown), Quality.GOOD
    if damage == "stuck":
        rate = np.full(rate.size, 0.01)
    elif damage == "wrong sign":
        rate = -rate
    elif damage == "absent":
        rate = np.full(rate.size, np.nan)
    else:
        flag = Quality.BAD
    pd.testing.assert_frame_equal(estimated(flown, rate, flag).estimates, blind.estimates, check_exact=True)


@pytest.mark.parametrize("damage", ["dropouts", "gap", "noise"])
def test_a_damaged_gyro_leaves_finite_numbers_whose_intervals_hold(flown: Flown, damage: str) -> None:
    rng, rate = np.random.default_rng(9), reported(flown)
    if damage == "dropouts":
        rate[rng.random(rate.size) < 0.5] = np.nan
    elif damage == "gap":
        rate[rate.size // 3 : rate.size // 2] = np.nan
    else:
        rate += np.radians(3.0) * rng.standard_normal(rate.size)
    found = estimated(flown, rate)
    below = (flown.truth["depth"] > 5.0).to_numpy()
    for method in ("kinematic", "force"):
        error = of(found, method, "pitch") - flown.truth["pitch"].to_numpy()
        assert np.isfinite(error).all()
        assert np.mean(np.abs(error) < 1.96 * of(found, method, "pitch_std"), where=below) > 0.9

"""The scale error of a speed sensor that is used: as a state, and against simulated truth."""

import numpy as np
import pytest
from dives import Flown, fly
from problems import problem

from pipeline.estimate import smoother, stage
from pipeline.estimate.problem import Problem, design, process, transition
from pipeline.estimate.sensors import LASTING, MOST, around, scale_of, with_scale
from pipeline.simulate import Injection

KIND, SPEED = 2, 1


def sensed(seed: int, m: int = 25) -> tuple[Problem, np.ndarray, np.ndarray]:
    """Return a random problem whose third kind of measurement is of one state; instants, and a path of that state."""
    rng = np.random.default_rng(seed)
    case = problem(seed, m=m, missing=0.2)
    case.seen[KIND], case.weight[KIND] = (SPEED, 0), (1.0, 0.0)
    return case, np.cumsum(rng.uniform(0.5, 20.0, m)), rng.uniform(0.2, 0.8, m)


@pytest.mark.parametrize("scale", [0.0, 0.08, -0.2])
def test_the_scale_is_a_state_of_the_problem_with_rows_that_change_in_time(scale: float) -> None:
    """A textbook filter with rows (1 + s_0, V_0) and s itself as a random walk, at the last instant."""
    case, time, speed = sensed(3)
    ours, std = with_scale(case, time, speed, scale, 0.05, (KIND,)), 0.05
    found = smoother.solve(ours)
    (m, n), p = case.decay.shape, case.observed.shape[1]
    F, Q, H = transition(case), process(case), design(case)
    mean, P = np.append(case.mean_0, 0.0), np.zeros((n + 1, n + 1))
    P[:n, :n], P[n, n] = case.covariance_0, std**2
    for k in range(m):
        for j in range(p):
            y = case.observed[k, j]
            row = np.append(H[j], 0.0)
            if j == KIND:
                row[SPEED], row[n], y = 1.0 + scale, speed[k], y + scale * speed[k]
            if np.isfinite(y):
                gain = P @ row / (row @ P @ row + case.variance[k, j])
                mean, P = mean + gain * (y - row @ mean), P - np.outer(gain, row @ P)
        if k < m - 1:
            shift = np.zeros(n + 1)
            shift[case.coupled] = case.shift[k, :, 0]
            step = np.eye(n + 1)
            step[:n, :n] = F[k]
            mean, P = step @ mean + shift, step @ P @ step.T
            P[:n, :n] += Q[k]
            P[n, n] += std**2 * (time[k + 1] - time[k]) / LASTING
    size = np.append(np.ones(n), speed[-1] / (1.0 + scale))
    np.testing.assert_allclose(found.mean[-1, :, 0], size * mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.covariance[-1], np.outer(size, size) * P, rtol=1e-8, atol=1e-12)
    assert scale_of(found.mean[:, -1, 0], speed, scale)[-1] == pytest.approx(mean[n], abs=1e-9)


def test_a_sensor_whose_scale_is_known_adds_no_state() -> None:
    case, time, speed = sensed(1)
    assert with_scale(case, time, speed, 0.0, 0.0, (KIND,)) is case


def test_a_scale_is_followed_only_so_far_and_without_a_reading_not_at_all() -> None:
    s = np.array([0.1, 5.0, 0.3])
    assert around(s, np.array([True, False, True])) == pytest.approx(0.2)
    assert around(s, np.array([False, True, False])) == MOST
    assert around(s, np.zeros(3, dtype=bool)) == 0.0


def estimated(flown: Flown, scale: float, std: float, *, rows: slice = slice(None)) -> stage.Estimated:
    """Return the estimates with a sensor of 1 cm/s noise that reads (1 + scale) V, known to `std`."""
    rng = np.random.default_rng(5)
    speed = flown.truth["speed"].to_numpy()
    sensor = (1.0 + scale) * speed + 0.01 * rng.standard_normal(speed.size)
    records = flown.records.assign(
        speed_through_water=sensor, speed_through_water_std=0.01, speed_through_water_qc=np.int8(1)
    )
    mission = flown.mission.model_copy(update={"speed_sensor": "use", "speed_sensor_scale_std": std})
    return stage.estimate(records.iloc[rows].reset_index(drop=True), flown.vehicle, mission)


def errors(flown: Flown, found: stage.Estimated, method: str) -> tuple[np.ndarray, np.ndarray]:
    """Return error and 1-sigma of V in steady flight, m/s."""
    table = found.estimates[found.estimates["method"] == method].reset_index(drop=True)
    steady = (flown.records["block"].to_numpy() >= 0) & table["observable"].to_numpy()
    return (table["speed"] - flown.truth["speed"]).to_numpy()[steady], table["speed_std"].to_numpy()[steady]


@pytest.fixture(scope="module")
def flown() -> Flown:
    """Return a mission of a vehicle that is not quite as its file says, its pitch biased."""
    changes = {"lift_slope": 1.15, "parasite_drag": 0.95}
    return fly(3, changes=changes, injection=Injection(pitch_bias_deg=0.2), dives=((25.0, 4.0, 300.0),), every=8)


@pytest.mark.parametrize("method", ["kinematic", "force"])
@pytest.mark.parametrize("scale", [-0.08, 0.06])
def test_a_flowmeter_far_off_is_found_out(flown: Flown, method: str, scale: float) -> None:
    found = estimated(flown, scale, 0.1)
    entry = found.report["speed_scale"][method]
    assert abs(entry["value"] - scale) < 2.5 * entry["std"]
    assert entry["determined"]
    assert entry["std"] < 0.05
    error, std = errors(flown, found, method)
    assert np.mean(np.abs(error) < 2.5 * std) > 0.95  # of one mission: its scale is wrong all through
    assert np.sqrt(np.mean(error**2)) < 0.7 * abs(scale) * flown.truth["speed"].median()


@pytest.mark.parametrize("method", ["kinematic", "force"])
def test_a_doppler_log_makes_the_speed_better_than_depth_alone_does(flown: Flown, method: str) -> None:
    """A scale off by its 1-sigma, 0.5 %, at 0.5 m/s: 2.5 mm/s that no depth rate could tell."""
    found = estimated(flown, 0.005, 0.005)
    error, std = errors(flown, found, method)
    alone = stage.estimate(flown.records, flown.vehicle, flown.mission)
    before, before_std = errors(flown, alone, method)
    assert np.sqrt(np.mean(error**2)) < 0.5 * np.sqrt(np.mean(before**2))
    assert std.mean() < 0.5 * before_std.mean()
    assert np.mean(np.abs(error) < 1.96 * std) > 0.95
    assert alone.report["speed_scale"] == {}
    assert not found.report["speed_scale"][method]["determined"]

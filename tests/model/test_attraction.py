"""The simulated region of attraction against the reference integrator, finer steps and longer flights."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.model.attraction import CONVERGED, DIVERGED, OTHER, UNDECIDED, attraction
from pipeline.model.dynamics import trajectory
from pipeline.model.lyapunov import certificate, quadratic
from pipeline.model.modes import Equilibrium, equilibrium
from pipeline.vehicle import load

PETREL = load("petrel-ii")
TURNING = 1391.0 / 60.0
GIVEN: dict[str, dict[str, float]] = {
    "gliding": {},
    "driven": {"propeller_speed": TURNING},
    "pitched": {"pitch": 0.4, "moment_sin": -4.0},
}


@cache
def steady(name: str) -> Equilibrium:
    """Return a steady flight of Petrel-II with G = 7 N by name."""
    return equilibrium(PETREL, 7.0, **GIVEN[name])  # type: ignore[arg-type]


def plane(size: int, angle: str) -> dict[str, Any]:
    """Return a plane of starts of speed and of `angle`, from standstill to twice the speed."""
    widest = {"path_angle": 3.1, "angle_of_attack": 0.45}[angle]
    return {"speed": np.linspace(-0.9, 0.9, size)[None, :], angle: np.linspace(-widest, widest, size)[:, None]}


def flown(state: Equilibrium, starts: np.ndarray, times: np.ndarray, turning: float) -> np.ndarray:
    """Return deviations at `times` by the reference integrator, shape (n, times, 4)."""
    flight = state.flight
    at_rest = np.array([flight.speed, flight.path_angle, flight.angle_of_attack, 0.0])
    units = np.array([flight.speed, 1.0, 1.0, 1.0 / flight.rate_scale])
    inputs = {"propeller_speed": turning, "moment_cos": flight.moment_cos, "moment_sin": flight.moment_sin}
    return np.array(
        [
            (trajectory(PETREL, at_rest + y * units, times, net_buoyancy=flight.net_buoyancy, **inputs) - at_rest)
            / units
            for y in starts
        ]
    )


def at_edge(verdict: np.ndarray) -> np.ndarray:
    """Return where a verdict differs from one of its eight neighbours."""
    padded = np.pad(verdict, 1, mode="edge")
    rows, columns = verdict.shape
    around = [padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    return np.logical_or.reduce([neighbour != verdict for neighbour in around])


@pytest.mark.parametrize("name", GIVEN)
def test_starts_that_converge_do_so_in_the_reference_integration(name: str) -> None:
    state, turning = steady(name), GIVEN[name].get("propeller_speed", 0.0)
    draws = np.random.default_rng(3)
    starts = draws.uniform(-1.0, 1.0, (30, 4)) * [0.8, 2.5, 0.3, 0.01]
    found = attraction(
        state, speed=starts[:, 0], path_angle=starts[:, 1], angle_of_attack=starts[:, 2], pitch_rate=starts[:, 3]
    )
    assert set(found.verdict.tolist()) <= {CONVERGED, DIVERGED}
    returns = found.verdict == CONVERGED
    assert returns.sum() > 15
    function = quadratic(state)
    times = np.append(np.arange(0.0, 130.0, 0.1), 300.0)
    motions = flown(state, starts[returns], times, turning)
    motions[..., 1] -= 2.0 * np.pi * np.round(motions[..., 1] / (2.0 * np.pi))
    assert np.abs(motions[:, -1]).max() < 1e-3
    # The time of the verdict is that of the first entry into the certified set, to a step and a sample.
    within = function.value(motions) <= found.level
    entered = times[np.argmax(within, axis=1)]
    np.testing.assert_allclose(found.time[returns], entered, atol=0.4)


def test_starts_that_diverge_leave_the_range_of_the_model_in_the_reference_integration() -> None:
    draws = np.random.default_rng(4)
    starts = draws.uniform(-1.0, 1.0, (60, 4)) * [0.8, 3.1, 0.4, 0.0]
    found = attraction(steady("pitched"), speed=starts[:, 0], path_angle=starts[:, 1], angle_of_attack=starts[:, 2])
    lost = found.verdict == DIVERGED
    assert lost.sum() >= 10
    for y, time in zip(starts[lost], found.time[lost], strict=True):
        motion = flown(steady("pitched"), y[None], np.linspace(0.0, time + 0.1, 200), 0.0)[0]
        assert np.abs(steady("pitched").flight.angle_of_attack + motion[:, 2]).max() >= 0.49


@pytest.mark.parametrize("name", GIVEN)
@pytest.mark.parametrize("angle", ["path_angle", "angle_of_attack"])
def test_half_the_step_changes_verdicts_at_most_at_the_edge(name: str, angle: str) -> None:
    state = steady(name)
    starts = plane(40, angle)
    whole, half = (attraction(state, step=step, **starts) for step in (1.2, 0.6))
    changed = whole.verdict != half.verdict
    assert changed.mean() < 0.005
    assert (at_edge(half.verdict) | ~changed).all()
    both = (whole.verdict == CONVERGED) & ~changed
    assert np.abs(whole.time - half.time)[both].max() < 1.0


@pytest.mark.parametrize("name", GIVEN)
def test_stopping_at_the_certified_set_gives_the_verdicts_of_following_on(name: str) -> None:
    state = steady(name)
    starts = plane(30, "path_angle")
    early, late = (attraction(state, depth=depth, **starts) for depth in (1.0, 1e-4))
    np.testing.assert_array_equal(early.verdict, late.verdict)
    returns = early.verdict == CONVERGED
    assert (late.time[returns] > early.time[returns]).all()


def test_every_start_in_the_certified_set_has_converged_at_once() -> None:
    found = certificate(quadratic(steady("driven")))
    for axis, reach in zip(("speed", "path_angle", "angle_of_attack"), found.semi_axes[:3], strict=True):
        there = attraction(steady("driven"), **{axis: np.array([-0.999, -0.5, 0.0, 0.5, 0.999]) * reach})
        assert (there.verdict == CONVERGED).all()
        assert (there.time == 0.0).all()
        assert (attraction(steady("driven"), **{axis: np.array([-1.001, 1.001]) * reach}).time > 0.0).all()


def test_the_slow_powered_dive_at_the_same_angle_of_attack_is_another_steady_flight() -> None:
    driven = steady("driven")
    # At 1391 rpm and G = 7 N forces balance at 1.3689 m/s and at 0.68139 m/s (reference case); there γ < 0.
    slow, alpha = 0.6813910851279376, driven.flight.angle_of_attack
    thrust = driven.flight.push + driven.flight.pull * slow
    along = (7.3579 + 318.0849 * alpha**2) * slow**2 - thrust * math.cos(alpha)
    across = 351.357 * alpha * slow**2 + thrust * math.sin(alpha)
    dive = math.atan2(along, -across)
    assert dive < 0.0
    there = {
        "speed": slow / driven.flight.speed - 1.0,
        "path_angle": dive - driven.flight.path_angle,
    }
    found = attraction(driven, **there)
    assert found.verdict == OTHER
    assert found.time == 0.0
    # It is unstable: from beside it, the vehicle returns.
    assert attraction(driven, speed=there["speed"] + 0.05, path_angle=there["path_angle"]).verdict == CONVERGED


@pytest.mark.parametrize("workers", [2, 3])
def test_result_does_not_depend_on_the_number_of_workers(workers: int) -> None:
    starts = plane(12, "path_angle")
    one, many = (attraction(steady("pitched"), workers=w, **starts) for w in (1, workers))
    np.testing.assert_array_equal(one.verdict, many.verdict)
    np.testing.assert_array_equal(one.time, many.time)


@settings(max_examples=6)
@given(g=st.floats(1.0, 9.0), pitch=st.floats(0.4, 1.3), seed=st.integers(0, 1000))
def test_dives_end_as_their_mirrored_climbs(g: float, pitch: float, seed: int) -> None:
    vehicle = PETREL.with_values({"moment_at_zero": 0.0}, "symmetric")
    starts = np.random.default_rng(seed).uniform(-1.0, 1.0, (50, 3)) * [0.7, 1.5, 0.2]
    up, down = (
        attraction(
            equilibrium(vehicle, side * g, pitch=side * pitch, moment_sin=-4.0),
            speed=starts[:, 0], path_angle=side * starts[:, 1], angle_of_attack=side * starts[:, 2],
        )
        for side in (1.0, -1.0)
    )  # fmt: skip
    same = up.verdict == down.verdict
    assert same.sum() >= 49  # rounding may move a start at the very edge
    np.testing.assert_allclose(up.time[same], down.time[same], atol=2.0)


def test_a_whole_turn_of_the_path_is_the_same_start() -> None:
    here, there = (attraction(steady("driven"), speed=0.5, path_angle=g) for g in (0.4, 0.4 + 2.0 * math.pi))
    assert here.verdict == there.verdict == CONVERGED
    assert float(here.time) == pytest.approx(float(there.time), abs=1e-9)


def test_a_flight_that_is_too_short_is_undecided() -> None:
    found = attraction(steady("driven"), path_angle=[0.0, 3.0], duration=1.0)
    assert found.verdict.tolist() == [CONVERGED, UNDECIDED]
    assert math.isnan(found.time[1])
    assert found.share == 0.5


def test_nothing_converges_to_a_flight_that_is_unstable_or_is_not() -> None:
    wild = equilibrium(PETREL.with_values({"moment_slope": 313.8643, "moment_at_zero": 0.7959}, "test"), 7.0)
    nowhere = equilibrium(PETREL, 7.0, angle_of_attack=0.1, thrust=60.0)
    for state, reason in ((wild, "a mode grows"), (nowhere, "no equilibrium")):
        found = attraction(state, speed=[0.0, 0.1])
        assert (found.verdict != CONVERGED).all()
        assert found.share == 0.0
        assert reason in found.reason


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"duration": 0.0}, "duration: found 0"),
        ({"depth": 1.5}, "depth: found 1.5; expected a positive number up to 1"),
        ({"step": -1.0}, "step: found -1"),
        ({"largest_angle": math.nan}, "largest_angle: found nan"),
    ],
)
def test_senseless_arguments_are_refused(given: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        attraction(steady("driven"), **given)  # type: ignore[arg-type]

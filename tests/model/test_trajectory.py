"""Flight under schedules: two integrators agree, trims are reached, energy is kept, and what cannot be is said."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from pipeline.model.dynamics import trajectory
from pipeline.model.forces import thrust
from pipeline.model.steady import trim_at_moment
from pipeline.model.trajectory import Flight, Inputs, simulate
from pipeline.vehicle import load

PETREL = load("petrel-ii")
START = [0.6, 0.5, 0.01, 0.02]
TURN = Inputs(
    [0.0, 30.0, 60.0, 90.0],
    [4.0, 4.0, -4.0, -4.0],
    [-0.02, -0.02, 0.03, 0.03],
    [0.0, 15.0, 15.0, 5.0],
    1025.0,
)
NAMES = ("speed", "path_angle", "angle_of_attack", "pitch_rate", "depth", "distance")


def gap(one: Flight, other: Flight) -> float:
    return max(float(np.abs(getattr(one, name) - getattr(other, name)).max()) for name in NAMES)


def test_both_integrators_agree_on_a_turn_from_climb_to_dive() -> None:
    times = np.linspace(0.0, 120.0, 41)
    reference = simulate(PETREL, START, TURN, times, method="implicit")
    assert gap(simulate(PETREL, START, TURN, times, step=0.01), reference) < 1e-7
    assert gap(simulate(PETREL, START, TURN, times), reference) < 1e-3
    assert reference.path_angle[8] > 0.3
    assert reference.path_angle[-1] < -0.3


def test_error_falls_with_the_fourth_power_of_the_step() -> None:
    times = [0.0, 3.0]
    exact = simulate(PETREL, START, TURN, times, step=1e-3)
    coarse, fine = (gap(simulate(PETREL, START, TURN, times, step=step), exact) for step in (0.1, 0.05))
    assert math.log2(coarse / fine) == pytest.approx(4.0, abs=0.3)


def test_constant_inputs_give_the_motion_of_an_independent_integrator() -> None:
    times = np.linspace(0.0, 60.0, 13)
    flight = simulate(PETREL, START, Inputs(0.0, 5.0, propeller_speed=12.0), times, step=2.5e-3)
    other = trajectory(PETREL, START, times, net_buoyancy=5.0, propeller_speed=12.0, moment_sin=-4.0)
    found = np.column_stack([getattr(flight, name) for name in NAMES[:4]])
    np.testing.assert_allclose(found, other, rtol=0.0, atol=1e-9)


@settings(max_examples=8)
@given(g=st.floats(-8.0, -3.0), position=st.floats(0.005, 0.04), turning=st.sampled_from([0.0, 12.0]))
def test_long_flight_ends_in_the_stable_trim(g: float, position: float, turning: float) -> None:
    trim = trim_at_moment(PETREL, g, battery_position=position, propeller_speed=turning)
    if str(trim.reason):
        return
    start = [float(trim.speed) * 1.05, float(trim.path_angle) + 0.03, float(trim.angle_of_attack), 0.0]
    flight = simulate(PETREL, start, Inputs(0.0, g, position, turning), [0.0, 3000.0])
    assert flight.speed[-1] == pytest.approx(float(trim.speed), rel=1e-9)
    assert flight.path_angle[-1] == pytest.approx(float(trim.path_angle), abs=1e-9)
    assert flight.angle_of_attack[-1] == pytest.approx(float(trim.angle_of_attack), abs=1e-10)


def test_kinetic_energy_gained_is_the_work_of_forces_and_moments() -> None:
    times = np.linspace(0.0, 30.0, 1501)
    flight = simulate(PETREL, START, TURN, times, step=0.01)
    v, gamma, alpha, q = flight.speed, flight.path_angle, flight.angle_of_attack, flight.pitch_rate
    turning = 15.0 * times / 30.0
    law = PETREL.propeller
    push = np.array([thrust(law, 1025.0, n, speed) for n, speed in zip(turning, v, strict=True)])
    ratio = 1025.0 / 1020.0
    drag = ratio * (7.3579 + 318.0849 * alpha**2) * v**2
    moment = ratio * (-0.7959 - 313.8643 * alpha - 7.0 * q) * v**2
    moment += 11.0 * 9.81 * 0.02 * np.cos(flight.pitch) - 4.0 * np.sin(flight.pitch)
    power = 4.0 * v * np.sin(gamma) - drag * v + push * v * np.cos(alpha) + moment * q
    kinetic = 0.5 * (84.7 * v**2 + 12.3 * q**2)
    work = CubicSpline(times, power).antiderivative()(times)
    np.testing.assert_allclose(kinetic - kinetic[0], work, atol=1e-6)
    rise = CubicSpline(times, v * np.sin(gamma)).antiderivative()(times)
    np.testing.assert_allclose(flight.depth, -rise, atol=1e-7)
    level = CubicSpline(times, v * np.cos(gamma)).antiderivative()(times)
    np.testing.assert_allclose(flight.distance, level, atol=1e-7)


@given(st.floats(0.2, 1.2), st.floats(-1.0, 1.0), st.floats(-0.1, 0.1), st.floats(1.0, 8.0))
def test_a_symmetric_glider_upside_down_flies_the_mirrored_path(v: float, gamma: float, alpha: float, g: float) -> None:
    symmetric = PETREL.with_values({"moment_at_zero": 0.0}, "symmetric")
    up = simulate(symmetric, [v, gamma, alpha, 0.0], Inputs([0.0, 20.0], [g, -g], 0.01), [0.0, 5.0, 40.0])
    down = simulate(symmetric, [v, -gamma, -alpha, 0.0], Inputs([0.0, 20.0], [-g, g], -0.01), [0.0, 5.0, 40.0])
    np.testing.assert_allclose(up.speed, down.speed, rtol=1e-12)
    np.testing.assert_allclose(up.depth, -down.depth, atol=1e-10)
    assert up.reason.split("(")[0] == down.reason.split("(")[0]


def test_schedules_are_constant_before_their_first_and_after_their_last_time() -> None:
    late = simulate(PETREL, START, Inputs([100.0, 200.0], [4.0, -4.0]), [0.0, 50.0, 90.0])
    assert gap(late, simulate(PETREL, START, Inputs(0.0, 4.0), [0.0, 50.0, 90.0])) == 0.0


def test_instants_asked_for_do_not_change_the_motion() -> None:
    few = simulate(PETREL, START, TURN, [0.0, 100.0])
    many = simulate(PETREL, START, TURN, np.arange(0.0, 100.1, 0.25))
    assert many.speed[-1] == pytest.approx(few.speed[-1], rel=1e-10)
    assert many.depth[-1] == pytest.approx(few.depth[-1], rel=1e-10)


@pytest.mark.parametrize("method", ["fixed", "implicit"])
def test_a_vehicle_that_comes_to_rest_says_when_and_why(method: Any) -> None:
    # Straight down and heavy, then light: it must stop before it can rise.
    flight = simulate(
        PETREL.with_values({"moment_at_zero": 0.0, "righting_moment": 0.0}, "neutral"),
        [0.5, -math.pi / 2, 0.0, 0.0],
        Inputs(0.0, 6.0),
        [0.0, 1.0, 300.0],
        method=method,
    )
    assert flight.speed[1] > 0.0
    assert np.isnan(flight.speed[2])
    assert np.isnan(flight.depth[2])
    assert flight.reason


def test_too_long_a_step_is_reported_not_returned() -> None:
    flight = simulate(PETREL, START, Inputs(0.0, 6.0), [0.0, 4000.0], step=8.0)
    assert np.isnan(flight.speed[-1])
    assert flight.reason.endswith(" s)")


@pytest.mark.parametrize(
    ("flight", "reason"),
    [
        (
            simulate(load("slocum-g2"), START, Inputs(0.0, 2.0), [0.0, 1.0]),
            "the vehicle file leaves pitch_inertia, moment_at_zero, moment_slope, pitch_damping unknown",
        ),
        (
            simulate(
                PETREL.with_values({"thrust_slope": math.nan}, "unknown"),
                START,
                Inputs(0.0, 2.0, propeller_speed=5.0),
                [0.0, 1.0],
            ),
            "powered, but the vehicle file has no thrust law",
        ),
        (
            simulate(
                PETREL.with_values({"battery_mass": math.nan}, "unknown"), START, Inputs(0.0, 2.0, 0.01), [0.0, 1.0]
            ),
            "the vehicle file leaves battery_mass unknown",
        ),
    ],
)
def test_what_cannot_be_flown_is_nan_with_its_reason(flight: Flight, reason: str) -> None:
    assert flight.reason == reason
    assert np.isnan(flight.speed).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: Inputs(0.0, 2.0, propeller_speed=1400.0),
            "inputs: propeller_speed: found 1400; expected at most 100 rev/s; rev/s, not rpm?",
        ),
        (lambda: Inputs(0.0, math.nan), "inputs: net_buoyancy: found nan; expected finite numbers"),
        (
            lambda: Inputs([0.0, 1.0], [1.0, 2.0, 3.0]),
            "inputs: net_buoyancy: found shape (3,); expected (2,) or a number",
        ),
        (
            lambda: Inputs(0.0, 2.0, density=-1020.0),
            "inputs: density: found -1020; expected a positive number of kg/m3",
        ),
        (
            lambda: Inputs([0.0, 0.0], 2.0),
            "inputs: times: found times that are not finite and increasing; expected seconds in order",
        ),
        (
            lambda: simulate(PETREL, START, TURN, [1.0, 0.0]),
            "times: found times that are not finite and increasing; expected seconds in order",
        ),
        (
            lambda: simulate(PETREL, [0.6, 35.0, 0.0, 0.0], TURN, [0.0, 1.0]),
            "state: γ: found 35; expected at most 3.142 rad; degrees?",
        ),
        (
            lambda: simulate(PETREL, [0.6, 0.5, -1.5, 0.0], TURN, [0.0, 1.0]),
            "state: α: found -1.5; expected at most 0.5 rad; degrees?",
        ),
        (
            lambda: simulate(PETREL, [0.0, 0.5, 0.0, 0.0], TURN, [0.0, 1.0]),
            "state: found [0.0, 0.5, 0.0, 0.0]; expected V > 0, γ, α and q, four finite numbers",
        ),
        (
            lambda: simulate(PETREL, START, TURN, [0.0, 1.0], step=0.0),
            "step: found 0; expected a positive number of seconds",
        ),
        (
            lambda: simulate(PETREL, START, TURN, [0.0, 1.0], method="radau"),  # type: ignore[arg-type]
            "method: found 'radau'; expected 'fixed' or 'implicit'",
        ),
    ],
)
def test_bad_input_is_refused_with_what_was_found_and_expected(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match="found") as caught:
        call()
    assert str(caught.value) == message

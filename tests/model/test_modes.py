"""Modes against the paper, reference cases and a Jacobian by complex steps; the motion about steady flight."""

import cmath
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.model.dynamics import trajectory
from pipeline.model.forces import disk_thrust
from pipeline.model.modes import Equilibrium, deviation_rates, equilibrium, modes
from pipeline.model.steady import trim_at_pitch
from pipeline.vehicle import Vehicle, load

PETREL = load("petrel-ii")
UNEQUAL = PETREL.with_values({"mass_forward": 75.0, "mass_normal": 95.0, "lift_at_zero": 0.3}, "test")
ALPHA_E = -0.7959 / 313.8643


def trimmed(vehicle: Vehicle, alpha: float) -> Vehicle:
    """Return the vehicle with equal masses and without moment at `alpha`, as the reference cases assume."""
    changes = {"mass_forward": vehicle["mass_normal"], "moment_at_zero": -vehicle["moment_slope"] * alpha}
    return vehicle.with_values(changes, "trimmed")


def complex_step(vehicle: Vehicle, state: Equilibrium) -> np.ndarray:
    """Return the Jacobian of the dynamics in (V̄, γ̄, ᾱ, q̄) by complex steps, from the equations of motion."""
    flight, c = state.flight, vehicle
    m1, m3 = c["mass_forward"], c["mass_normal"]
    scale = c["pitch_damping"] / c["moment_slope"]

    def rate(y: np.ndarray) -> np.ndarray:
        speed, gamma = flight.speed * (1.0 + y[0]), flight.path_angle + y[1]
        alpha, q = flight.angle_of_attack + y[2], y[3] / scale
        thrust = flight.push + flight.pull * speed + flight.square * speed**2
        lift = (c["lift_at_zero"] + c["lift_slope"] * alpha) * speed**2
        drag = (c["parasite_drag"] + c["induced_drag"] * alpha**2) * speed**2
        sine, cosine, theta = cmath.sin(alpha), cmath.cos(alpha), gamma + alpha
        g = flight.net_buoyancy
        u, w = speed * cosine, speed * sine
        u_rate = (thrust - drag * cosine + lift * sine + g * cmath.sin(theta) - m3 * w * q) / m1
        w_rate = (-drag * sine - lift * cosine - g * cmath.cos(theta) + m1 * u * q) / m3
        moment = (c["moment_at_zero"] + c["moment_slope"] * alpha + c["pitch_damping"] * q) * speed**2
        moment += flight.moment_cos * cmath.cos(theta) + flight.moment_sin * cmath.sin(theta) + (m3 - m1) * u * w
        alpha_rate = (w_rate * cosine - u_rate * sine) / speed
        along = (u_rate * cosine + w_rate * sine) / flight.speed
        return np.array([along, q - alpha_rate, alpha_rate, scale * moment / c["pitch_inertia"]])

    return np.stack([rate(1e-30j * axis).imag / 1e-30 for axis in np.eye(4)], axis=1)


@pytest.mark.parametrize(("hold", "slow"), [("propeller_speed", -0.295), ("thrust", -0.236), ("advance_ratio", -0.111)])
def test_the_slow_mode_depends_on_what_is_held(hold: Any, slow: float) -> None:
    found = modes(equilibrium(PETREL, 7.0, thrust=7.0, hold=hold))
    assert found.stable
    assert found.eigenvalues[1].real == pytest.approx(slow, abs=5e-4)
    assert found.time_constants[1] == pytest.approx(-1.0 / slow, rel=5e-3)


def test_eigenvalues_of_the_paper_s_example() -> None:
    found = modes(equilibrium(PETREL, 7.0, thrust=7.0))
    np.testing.assert_allclose(found.eigenvalues, [-0.054, -0.236, -3.406 + 6.485j, -3.406 - 6.485j], atol=1e-3)
    assert found.periods[2] == pytest.approx(2.0 * math.pi / 6.4845, rel=1e-4)
    assert np.isinf(found.periods[:2]).all()


@pytest.mark.parametrize("vehicle", [PETREL, UNEQUAL], ids=["petrel-ii", "unequal masses"])
@pytest.mark.parametrize("hold", ["propeller_speed", "thrust", "advance_ratio"])
def test_matrix_is_that_of_complex_steps(vehicle: Vehicle, hold: Any) -> None:
    for state in (
        equilibrium(vehicle, 7.0, thrust=5.0, hold=hold),
        equilibrium(vehicle, -3.0, pitch=-0.5, thrust=2.0, moment_sin=-4.0, hold=hold),
    ):
        expected = complex_step(vehicle, state)
        found = modes(state)
        np.testing.assert_allclose(found.matrix, expected, atol=1e-9)
        np.testing.assert_allclose(np.sort(found.eigenvalues), np.sort(np.linalg.eigvals(expected)), atol=1e-8)


def test_group_b_slowest_eigenvalue(cases: dict[str, Any], vehicle_of: Callable[[dict[str, Any]], Vehicle]) -> None:
    for case in cases["b"]:
        inputs, expected = case["inputs"], case["physical"]
        vehicle = trimmed(vehicle_of(inputs), inputs["alpha"])
        state = equilibrium(vehicle, inputs["G"], angle_of_attack=inputs["alpha"], propeller_speed=inputs["n"] / 60.0)
        assert state.flight.speed == pytest.approx(expected["V"], rel=1e-8)
        assert modes(state).eigenvalues[0].real == pytest.approx(expected["max_re_eig"], abs=1e-7)


def test_group_f_dimensionless_rates(cases: dict[str, Any], vehicle_of: Callable[[dict[str, Any]], Vehicle]) -> None:
    for case in cases["f"]:
        inputs, expected = case["inputs"], case["physical"]
        vehicle = trimmed(vehicle_of(inputs), inputs["alpha"])
        state = equilibrium(vehicle, inputs["G"], angle_of_attack=inputs["alpha"], thrust=inputs["T"])
        found = expected["tau"] * np.array(deviation_rates(*expected["y"], state.flight))
        np.testing.assert_allclose(found, expected["rhs_dimless"], rtol=1e-8)


@given(
    g=st.floats(0.5, 9.0),
    pitch=st.floats(0.3, 1.4),
    turning=st.sampled_from([0.0, 8.0, 15.0]),
    density=st.floats(990.0, 1050.0),
    righting=st.floats(-20.0, 0.0),
)
def test_nothing_moves_in_steady_flight_and_its_mirror_has_the_same_modes(
    g: float, pitch: float, turning: float, density: float, righting: float
) -> None:
    vehicle = UNEQUAL.with_values({"lift_at_zero": 0.0, "moment_at_zero": 0.0}, "symmetric")
    up, down = (
        equilibrium(
            vehicle, side * g, pitch=side * pitch, propeller_speed=turning, density=density, moment_sin=righting
        )
        for side in (1.0, -1.0)
    )
    np.testing.assert_allclose(deviation_rates(0.0, 0.0, 0.0, 0.0, up.flight), 0.0, atol=1e-12)
    np.testing.assert_allclose(modes(up).eigenvalues, modes(down).eigenvalues, rtol=1e-5, atol=1e-7)


def test_a_small_motion_along_the_slowest_mode_decays_with_its_time_constant() -> None:
    state = equilibrium(PETREL, 7.0, thrust=7.0, hold="propeller_speed")
    found = modes(state)
    values, vectors = np.linalg.eig(found.matrix)
    slowest = 1e-4 * vectors[:, np.argmax(values.real)].real
    flight = state.flight
    at_rest = np.array([flight.speed, flight.path_angle, flight.angle_of_attack, 0.0])
    units = np.array([flight.speed, 1.0, 1.0, 1.0 / flight.rate_scale])
    law = PETREL.propeller
    assert law is not None
    turning = flight.pull / (1020.0 * law.diameter**3 * law.thrust_slope)
    flown = trajectory(
        PETREL, at_rest + slowest * units, [0.0, found.time_constants[0]], net_buoyancy=7.0, propeller_speed=turning
    )
    np.testing.assert_allclose((flown[1] - at_rest) / units, slowest / math.e, atol=3e-8)


def test_propeller_speed_that_holds_a_given_thrust_is_the_paper_s() -> None:
    state = equilibrium(PETREL, 7.0, thrust=7.0, hold="propeller_speed")
    law = PETREL.propeller
    assert law is not None
    turning = state.flight.pull / (1020.0 * law.diameter**3 * law.thrust_slope)
    assert 60.0 * turning == pytest.approx(1391.0, abs=0.5)
    assert state.flight.thrust == pytest.approx(7.0, rel=1e-12)


def test_at_a_held_power_thrust_falls_as_that_of_the_actuator_disk_does() -> None:
    by_power = PETREL.with_values({"propulsive_efficiency": 0.5}, "a test")
    disk = by_power.disk
    assert disk is not None
    state = equilibrium(by_power, 3.0, pitch=0.4, propeller_power=12.0, density=1027.0)
    assert (state.hold, state.reason) == ("propeller_power", "")
    flight = state.flight
    trim = trim_at_pitch(by_power, 3.0, 0.4, propeller_power=12.0, density=1027.0)
    assert flight.speed == pytest.approx(float(trim.speed), rel=1e-12)
    assert flight.thrust == pytest.approx(float(trim.thrust), rel=1e-9)
    for change in (-0.01, 0.01):
        there = flight.push + flight.pull * (flight.speed + change)
        assert there == pytest.approx(disk_thrust(disk, 1027.0, 12.0, flight.speed + change)[0], rel=1e-4)
    damping = {
        hold: np.trace(modes(equilibrium(by_power, 3.0, pitch=0.4, propeller_power=12.0, hold=hold)).matrix)
        for hold in ("propeller_power", "thrust")
    }
    expected = flight.pull * math.cos(flight.angle_of_attack) / by_power["mass_forward"]
    assert damping["propeller_power"] - damping["thrust"] == pytest.approx(expected, rel=0.05)


def test_without_power_a_held_power_is_a_glide() -> None:
    assert equilibrium(PETREL, 5.0, propeller_power=0.0).flight == equilibrium(PETREL, 5.0).flight


def test_a_nose_that_turns_away_from_its_path_is_unstable() -> None:
    found = modes(equilibrium(PETREL.with_values({"moment_slope": 313.8643, "moment_at_zero": 0.7959}, "test"), 7.0))
    assert not found.stable
    assert found.time_constants[0] < 0.0


@pytest.mark.parametrize(
    ("vehicle", "given", "reason"),
    [
        (load("slocum-g2"), {}, "the vehicle file leaves pitch_inertia"),
        (PETREL, {"angle_of_attack": 0.1, "thrust": 60.0}, "no equilibrium"),
        (
            PETREL.with_values({"thrust_slope": math.nan}, "test"),
            {"thrust": 3.0, "hold": "propeller_speed"},
            "thrust law",
        ),
    ],
)
def test_no_steady_flight_has_no_modes_and_says_why(vehicle: Vehicle, given: dict[str, Any], reason: str) -> None:
    state = equilibrium(vehicle, 7.0, **given)
    found = modes(state)
    assert reason in state.reason
    assert found.reason == state.reason
    assert not found.stable
    assert np.isnan(found.eigenvalues).all()


def test_contradictory_requests_are_refused() -> None:
    with pytest.raises(ValueError, match="both angle_of_attack and pitch"):
        equilibrium(PETREL, 7.0, angle_of_attack=ALPHA_E, pitch=0.3)
    with pytest.raises(ValueError, match="hold: found 'power'"):
        equilibrium(PETREL, 7.0, hold="power")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="'propeller_power' and no propeller_power; give it, W"):
        equilibrium(PETREL, 7.0, thrust=3.0, hold="propeller_power")

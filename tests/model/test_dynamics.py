"""Dynamics: power balance, equilibria, mirror symmetry, refusal of unknown coefficients."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pipeline.model.dynamics import Body, body_of, derivatives, jacobian, trajectory
from pipeline.model.forces import propeller_of, thrust
from pipeline.model.steady import steady_state, trim_at_pitch
from pipeline.vehicle import Polar, Propeller, Vehicle, load

PETREL = load("petrel-ii")
BODY = Body(75.0, 95.0, 12.3, 0.5, -313.0, -7.0)
POLAR = Polar(0.1, 351.0, 7.4, 318.0, 0.0)
PROPELLER = Propeller(0.6136, -0.4091, 0.08)


@given(
    speed=st.floats(0.1, 1.5),
    gamma=st.floats(-1.4, 1.4),
    alpha=st.floats(-0.2, 0.2),
    rate=st.floats(-0.3, 0.3),
    g=st.floats(-9.0, 9.0),
    turning=st.floats(0.0, 25.0),
    lean=st.floats(-20.0, 20.0),
    right=st.floats(-20.0, 0.0),
)
def test_energy_changes_by_the_power_of_the_forces_and_moments(
    speed: float, gamma: float, alpha: float, rate: float, g: float, turning: float, lean: float, right: float
) -> None:
    # d/dt of (m1 u² + m3 w² + J2 q²)/2 is the power of thrust, drag, net buoyancy and pitching moment.
    args = (BODY, POLAR, PROPELLER, 1.0, 1020.0, g, turning, lean, right)
    v_rate, _, alpha_rate, q_rate = derivatives(speed, gamma, alpha, rate, *args)
    u, w = speed * math.cos(alpha), speed * math.sin(alpha)
    u_rate = v_rate * math.cos(alpha) - w * alpha_rate
    w_rate = v_rate * math.sin(alpha) + u * alpha_rate
    gained = BODY.mass_forward * u * u_rate + BODY.mass_normal * w * w_rate + BODY.pitch_inertia * rate * q_rate
    theta = gamma + alpha
    moment = (0.5 - 313.0 * alpha - 7.0 * rate) * speed**2 + lean * math.cos(theta) + right * math.sin(theta)
    power = (
        g * speed * math.sin(gamma)
        - (7.4 + 318.0 * alpha**2) * speed**3
        + thrust(PROPELLER, 1020.0, turning, speed) * u
        + moment * rate
    )
    assert gained == pytest.approx(power, rel=1e-9, abs=1e-9)


@given(
    g=st.floats(0.5, 9.0),
    pitch=st.floats(0.3, 1.4),
    turning=st.sampled_from([0.0, 8.0, 15.0, 23.0]),
    density=st.floats(990.0, 1050.0),
)
def test_trim_at_a_held_pitch_is_an_equilibrium_of_the_dynamics(
    g: float, pitch: float, turning: float, density: float
) -> None:
    trim = trim_at_pitch(PETREL, g, pitch, propeller_speed=turning, density=density)
    rates = derivatives(
        float(trim.speed),
        float(trim.path_angle),
        float(trim.angle_of_attack),
        0.0,
        body_of(PETREL),
        PETREL.polar,
        propeller_of(PETREL),
        density / 1020.0,
        density,
        g,
        turning,
        float(trim.required_moment) / math.cos(pitch),
        0.0,
    )
    np.testing.assert_allclose(rates, 0.0, atol=1e-12)


@given(
    g=st.floats(-9.0, 9.0).filter(lambda g: abs(g) > 0.3),
    alpha=st.floats(-0.08, 0.08),
    turning=st.sampled_from([0.0, 8.0, 15.0]),
    density=st.floats(990.0, 1050.0),
)
def test_flight_at_a_held_angle_of_attack_is_an_equilibrium_of_the_dynamics(
    g: float, alpha: float, turning: float, density: float
) -> None:
    flight = steady_state(PETREL, g, alpha, propeller_speed=turning, density=density)
    assume(np.isfinite(flight.speed))
    # The moment is balanced about the pitch by whichever part of the static moment has the longer arm there.
    theta, moment = float(flight.pitch), float(flight.required_moment)
    by_cos = abs(math.cos(theta)) > 0.5
    rates = derivatives(
        float(flight.speed),
        float(flight.path_angle),
        alpha,
        0.0,
        body_of(PETREL),
        PETREL.polar,
        propeller_of(PETREL),
        density / 1020.0,
        density,
        g,
        turning,
        moment / math.cos(theta) if by_cos else 0.0,
        0.0 if by_cos else moment / math.sin(theta),
    )
    np.testing.assert_allclose(rates, 0.0, atol=1e-12)


@given(
    speed=st.floats(0.1, 1.5),
    gamma=st.floats(-1.4, 1.4),
    alpha=st.floats(-0.2, 0.2),
    rate=st.floats(-0.3, 0.3),
    g=st.floats(-9.0, 9.0),
    turning=st.floats(0.0, 25.0),
)
def test_a_symmetric_glider_turned_upside_down_mirrors_its_motion(
    speed: float, gamma: float, alpha: float, rate: float, g: float, turning: float
) -> None:
    body, polar = BODY._replace(moment_at_zero=0.0), POLAR._replace(lift_at_zero=0.0)
    rest = (body, polar, PROPELLER, 1.0, 1020.0)
    up = derivatives(speed, gamma, alpha, rate, *rest, g, turning, 1.5, -4.0)
    down = derivatives(speed, -gamma, -alpha, -rate, *rest, -g, turning, -1.5, -4.0)
    np.testing.assert_allclose(np.array(up) * [1.0, -1.0, -1.0, -1.0], down, rtol=1e-12, atol=1e-15)


def test_jacobian_of_the_paper_s_example_has_its_eigenvalues(petrel: Vehicle) -> None:
    # Constant propeller speed for T = 7 N at V_e: -3.406 ± 6.485i are the fast modes, -0.054 the slowest.
    matrix = jacobian(
        1.36890,
        1.327352,
        -0.00253581,
        0.0,
        body_of(petrel),
        petrel.polar,
        propeller_of(petrel),
        1.0,
        1020.0,
        7.0,
        1391.0 / 60.0,
        0.0,
        0.0,
    )
    values = np.linalg.eigvals(matrix)
    fast = values[np.argmax(values.imag)]
    assert fast.real == pytest.approx(-3.406, abs=5e-3)
    assert fast.imag == pytest.approx(6.485, abs=5e-3)
    assert values.real.max() == pytest.approx(-0.054, abs=5e-4)


@settings(max_examples=5)
@given(shift=st.floats(-0.05, 0.05))
def test_trajectory_returns_to_a_stable_trim(shift: float) -> None:
    # Free pitch at T = 0, G = 7: γ_e = 83.1° and V_e = 0.972 m/s as in the reference cases.
    flown = trajectory(PETREL, [0.9717 + shift, 1.45 + shift, shift, 0.0], [0.0, 400.0], net_buoyancy=7.0)
    np.testing.assert_allclose(
        flown[-1], [0.9716998613165332, 1.450325345084387, -0.0025358092653417416, 0.0], atol=1e-6
    )


def test_trajectory_refuses_unknown_coefficients_by_name() -> None:
    with pytest.raises(ValueError, match="slocum-g2: found unknown pitch_inertia, moment_at_zero, moment_slope"):
        trajectory(load("slocum-g2"), [0.3, 0.4, 0.0, 0.0], [0.0, 1.0], net_buoyancy=1.0)


def test_trajectory_refuses_degrees_and_rpm_with_a_hint() -> None:
    with pytest.raises(ValueError, match=r"angle_of_attack: found -1.45; expected at most 0.5 rad; degrees\?"):
        trajectory(PETREL, [0.6, 0.5, -1.45, 0.0], [0.0, 1.0], net_buoyancy=3.0)
    with pytest.raises(ValueError, match=r"propeller_speed: found 1400; expected at most 100 rev/s; rev/s, not rpm\?"):
        trajectory(PETREL, [0.6, 0.5, 0.0, 0.0], [0.0, 1.0], net_buoyancy=3.0, propeller_speed=1400.0)

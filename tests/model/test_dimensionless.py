"""The dimensionless equations are the dimensional ones, and the split ones are theirs on the slow manifold."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.model.dimensionless import full_rates, scales, split_rates
from pipeline.model.dynamics import body_of, derivatives
from pipeline.model.forces import propeller_of
from pipeline.vehicle import Propeller, Vehicle, load

PETREL = load("petrel-ii")
deviations = st.tuples(st.floats(-0.5, 0.5), st.floats(-1.0, 1.0), st.floats(-0.2, 0.2), st.floats(-0.3, 0.3))


@given(deviations, st.floats(1.0, 9.0), st.sampled_from([0.0, 10.0, 20.0]), st.sampled_from([0.0, -0.4]))
def test_dimensional_and_dimensionless_rates_are_equal_at_constant_propeller_speed(
    y: tuple[float, ...], g: float, turning: float, exponent: float
) -> None:
    vehicle = PETREL.with_values({"drag_exponent": exponent, "lift_at_zero": 0.3}, "general")
    about = scales(vehicle, g, propeller_speed=turning)
    found = full_rates(y, about, hold="propeller_speed")
    state = about.state(y)
    expected = np.array(
        derivatives(*state, body_of(vehicle), vehicle.polar, propeller_of(vehicle), 1.0, 1020.0, g, turning, 0.0, 0.0)
    )
    per_second = found * [about.speed, 1.0, 1.0, about.pitch_rate_scale] / about.time_scale
    np.testing.assert_allclose(per_second, expected, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(about.deviations(state), y, rtol=0.0, atol=1e-14)


@given(deviations, st.floats(2.0, 9.0), st.floats(0.0, 6.0))
def test_dimensional_and_dimensionless_rates_are_equal_at_constant_thrust(
    y: tuple[float, ...], g: float, force: float
) -> None:
    about = scales(PETREL, g, thrust=force)
    constant = Propeller(force, 0.0, 1.0)  # T = K_1 ρ D_0⁴ n² with ρ = n = D_0 = 1
    expected = np.array(
        derivatives(*about.state(y), body_of(PETREL), PETREL.polar, constant, 1.0, 1.0, g, 1.0, 0.0, 0.0)
    )
    per_second = full_rates(y, about) * [about.speed, 1.0, 1.0, about.pitch_rate_scale] / about.time_scale
    np.testing.assert_allclose(per_second, expected, rtol=1e-9, atol=1e-11)


@given(deviations, st.floats(2.0, 9.0), st.floats(0.0, 6.0))
def test_on_the_slow_manifold_the_split_rates_are_the_full_ones_with_the_advance_ratio_held(
    y: tuple[float, ...], g: float, force: float
) -> None:
    about = scales(PETREL, g, thrust=force)
    v, gamma, _, q = y
    held = Propeller(force * (1.0 + v) ** 2, 0.0, 1.0)
    expected = np.array(
        derivatives(*about.state([v, gamma, 0.0, q]), body_of(PETREL), PETREL.polar, held, 1.0, 1.0, g, 1.0, 0.0, 0.0)
    )
    found = split_rates([v, gamma, 0.0, q], about) * [about.speed, 1.0, 1.0, about.pitch_rate_scale] / about.time_scale
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-10)


def test_steady_flight_is_the_origin() -> None:
    for about in (scales(PETREL, 7.0, thrust=7.0), scales(PETREL, -5.0), scales(PETREL, 2.5, propeller_speed=13.0)):
        np.testing.assert_allclose(full_rates(np.zeros(4), about), 0.0, atol=1e-12)
        np.testing.assert_allclose(split_rates(np.zeros(4), about), 0.0, atol=1e-12)


def test_group_f_scales_and_rates(cases: dict[str, Any], vehicle_of: Callable[[dict[str, Any]], Vehicle]) -> None:
    for case in cases["f"]:
        inputs, expected = case["inputs"], case["physical"]
        vehicle = vehicle_of(inputs)
        vehicle = vehicle.with_values({"moment_at_zero": -vehicle["moment_slope"] * inputs["alpha"]}, "reference case")
        about = scales(vehicle, inputs["G"], thrust=inputs["T"])
        assert about.time_scale == pytest.approx(expected["tau"], rel=1e-7)
        assert about.epsilon_alpha == pytest.approx(expected["eps1"], rel=1e-7)
        assert about.epsilon_pitch == pytest.approx(expected["eps2"], rel=1e-7)
        np.testing.assert_allclose(full_rates(expected["y"], about), expected["rhs_dimless"], rtol=1e-7)


def test_shapes_are_kept() -> None:
    about = scales(PETREL, 7.0, thrust=7.0)
    assert full_rates(np.zeros((3, 5, 4)), about).shape == split_rates(np.zeros((3, 5, 4)), about).shape == (3, 5, 4)


def test_what_has_no_scales_says_why() -> None:
    none = scales(PETREL, 7.0, thrust=80.0)
    assert none.reason == "no equilibrium: the forces do not balance at this angle of attack"
    assert np.isnan(none.time_scale)
    unknown = scales(load("slocum-g2"), 2.0)
    assert unknown.reason == (
        "the vehicle file leaves moment_at_zero, moment_slope, pitch_damping, pitch_inertia unknown"
    )
    assert np.isnan(full_rates(np.zeros(4), unknown)).all()

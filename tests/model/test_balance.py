"""The compiled solvers: nothing faster balances than the speed they give, and every balance is found."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pipeline.model.balance import ALPHA_LIMIT, HELD_PITCH, attack_for_normal_force, ceiling, largest_speed, residual
from pipeline.model.descent import out_of_reach
from pipeline.vehicle import Polar

polars = st.builds(
    Polar,
    st.sampled_from([0.0, -1.5, 1.5]),
    st.floats(60, 600),
    st.floats(0.7, 25),
    st.floats(30, 1800),
    st.sampled_from([0.0, -0.5, 0.2]),
)
forces = st.floats(-10, 10).filter(lambda force: abs(force) > 0.05)


@settings(max_examples=300)
@given(polars, st.floats(-1.5, 1.5), forces, st.floats(0.0, 12.0), st.floats(-9.0, 0.5))
@example(Polar(0.0, 60.0, 21.0, 30.0, 0.0), 0.0, 4.0, 1.0, 0.0)
def test_at_a_held_pitch_forces_balance_at_no_larger_speed(
    polar: Polar, pitch: float, g: float, push: float, pull: float
) -> None:
    args = (polar, 1.01, push, pull, g, 1.0)
    speed, alpha = largest_speed(HELD_PITCH, pitch, *args)
    top = ceiling(polar, 1.01, abs(g) + abs(push), pull)
    lowest = 1e-3 * top if math.isnan(speed) else speed * (1.0 + 1e-7)
    faster = np.array([residual(HELD_PITCH, v, pitch, *args) for v in np.linspace(lowest, top, 1500)])
    assert not np.any((faster[:, 0] < 0.0) & (np.abs(faster[:, 1]) <= ALPHA_LIMIT))
    if not math.isnan(speed):
        left, at = residual(HELD_PITCH, speed, pitch, *args)
        assert left == pytest.approx(0.0, abs=1e-9 * (abs(g) + abs(push) + abs(pull)))
        assert at == pytest.approx(alpha, abs=1e-9)


def test_two_speeds_that_balance_give_the_larger() -> None:
    # Much induced drag, a propeller that pushes up the slope: 1.19 m/s and 0.21 m/s both balance.
    polar = Polar(0.45348906102791986, 88.26145552865427, 0.8237980029663993, 983.1510858493655, -0.5)
    args = (polar, 1.01, 8.21284201654975, -4.862030097413016, -6.36024712968708, 1.0)
    speed, _ = largest_speed(HELD_PITCH, -0.16332669323163662, *args)
    grid = np.linspace(0.05, 2.0, 200_001)
    left = np.array([residual(HELD_PITCH, v, -0.16332669323163662, *args)[0] for v in grid])
    crossings = grid[1:][np.sign(left[1:]) != np.sign(left[:-1])]
    assert speed == pytest.approx(crossings[-1], abs=2e-5)


@given(polars.filter(lambda polar: polar.drag_exponent == 0.0), st.floats(-0.49, 0.49))
def test_angle_of_attack_is_found_from_the_normal_force_it_gives(polar: Polar, alpha: float) -> None:
    braking = polar.parasite_drag + polar.induced_drag * alpha**2
    lifting = polar.lift_at_zero + polar.lift_slope * alpha
    normal = braking * math.sin(alpha) + lifting * math.cos(alpha)
    assert attack_for_normal_force(polar, 1.0, normal) == pytest.approx(alpha, abs=1e-12)


@settings(max_examples=200)
@given(polars, st.floats(-1.57, 1.57), forces, st.floats(-3.0, 6.0), st.floats(-5.0, 0.0))
def test_what_the_bound_rules_out_balances_at_no_speed(
    polar: Polar, pitch: float, g: float, push: float, pull: float
) -> None:
    top = ceiling(polar, 1.01, abs(g) + abs(push), pull)
    axial, normal = g * math.sin(pitch), g * math.cos(pitch)
    if not out_of_reach(polar, push, pull, axial, normal, top):
        return
    rows = np.array(
        [residual(HELD_PITCH, v, pitch, polar, 1.01, push, pull, g, 1.0) for v in np.linspace(1e-3 * top, top, 2000)]
    )
    assert not np.any((rows[:, 0] <= 0.0) & (np.abs(rows[:, 1]) <= ALPHA_LIMIT))


def test_the_bound_rules_out_a_dive_of_a_light_vehicle_and_not_its_climb() -> None:
    polar = Polar(0.0, 351.357, 7.3579, 318.0849, 0.0)
    steep = 5.0 * math.sin(0.5), 5.0 * math.cos(0.5)
    assert out_of_reach(polar, 0.0, 0.0, -steep[0], steep[1], 1.0)
    assert not out_of_reach(polar, 0.0, 0.0, steep[0], steep[1], 1.0)
    assert not out_of_reach(polar, 5.0, -2.0, -steep[0], steep[1], 1.0)

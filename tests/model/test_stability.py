"""The inequalities against the paper's numbers, and how they scale."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.model.stability import stable_range, thrust_bound
from pipeline.model.steady import trim_at_pitch
from pipeline.vehicle import Vehicle, load

PETREL = load("petrel-ii")
ALPHA_E = -0.7959 / 313.8643


@pytest.mark.parametrize(
    ("g", "thrust", "lower", "bound", "upper"),
    [
        (7.0, 7.0, 0.97538, 7.57235, 1.39672),
        (7.0, 7.1025, 0.98249, 7.57235, 1.39672),
        (2.5, 2.2501, 0.55300, 7.57235 * 2.5 / 7.0, 0.83470),
    ],
)
def test_ranges_of_the_paper_in_its_signs(
    petrel: Vehicle, g: float, thrust: float, lower: float, bound: float, upper: float
) -> None:
    found = stable_range(petrel, g, ALPHA_E, thrust, signs="paper")
    assert float(found.speed_lower) == pytest.approx(lower, abs=6e-6)
    assert float(found.thrust_bound) == pytest.approx(bound, abs=6e-6)
    assert float(found.speed_upper) == pytest.approx(upper, abs=6e-6)
    assert bool(found.stable)


def test_drag_margin_of_the_paper_s_example(petrel: Vehicle) -> None:
    found = stable_range(petrel, 7.0, ALPHA_E, 7.0, signs="paper")
    assert float(found.drag_margin) == pytest.approx(3.62719, abs=1e-5)
    assert float(found.speed) == pytest.approx(1.36941, abs=1e-5)


def test_physical_signs_have_no_interior_minimum(petrel: Vehicle) -> None:
    polar = petrel.polar
    for sign, interior in ((1.0, False), (-1.0, True)):
        _, angle = thrust_bound(polar.parasite_drag, polar.induced_drag, polar.lift_at_zero, polar.lift_slope, sign)
        assert (abs(angle) < 0.2 - 1e-9) == interior


def test_infimum_is_not_undercut_by_any_angle(petrel: Vehicle) -> None:
    alpha = np.linspace(-0.2, 0.2, 40000)
    for vehicle in (petrel, petrel.with_values({"lift_at_zero": 4.0}, "cambered")):
        polar = vehicle.polar
        d = polar.parasite_drag + polar.induced_drag * alpha**2
        l = polar.lift_at_zero + polar.lift_slope * alpha  # noqa: E741
        for sign in (1.0, -1.0):
            least = (np.hypot(d, l) / np.abs(d * np.sin(alpha) + sign * l * np.cos(alpha))).min()
            bound, _ = thrust_bound(polar.parasite_drag, polar.induced_drag, polar.lift_at_zero, polar.lift_slope, sign)
            assert bound <= least * (1.0 + 1e-15)
            assert bound == pytest.approx(least, rel=1e-8)


@given(g=st.floats(0.5, 10.0), thrust=st.floats(0.0, 3.0), density=st.floats(990.0, 1050.0))
def test_denser_water_is_the_same_as_larger_coefficients(g: float, thrust: float, density: float) -> None:
    ratio = density / 1020.0
    names = ("lift_slope", "parasite_drag", "induced_drag")
    larger = PETREL.with_values({name: ratio * PETREL[name] for name in names}, "larger")
    here = stable_range(PETREL, g, ALPHA_E, thrust, density=density)
    there = stable_range(larger, g, ALPHA_E, thrust)
    for name in ("speed", "speed_lower", "speed_upper", "thrust_bound", "drag_margin", "root_margin"):
        assert float(getattr(here, name)) == pytest.approx(float(getattr(there, name)), rel=1e-9, abs=1e-9), name
    assert bool(here.stable) == bool(there.stable)


def test_level_flight_fails_the_inequality_that_is_used_to_support_it(petrel: Vehicle) -> None:
    # K_D' = 0 is γ = 0: at a pitch that descends a little, (23) does not hold although the vehicle flies.
    for pitch, holds in ((-0.06, False), (0.06, True)):
        held = trim_at_pitch(petrel, 2.5, pitch, propeller_speed=13.0)
        found = stable_range(petrel, 2.5, held.angle_of_attack, held.thrust)
        assert bool(found.drag_holds) == holds
        assert bool(found.drag_holds) == (float(held.path_angle) > 0.0)


def test_no_steady_flight_is_no_stable_flight(petrel: Vehicle) -> None:
    found = stable_range(petrel, [7.0, 7.0, np.nan], [-0.1047, ALPHA_E, ALPHA_E], [8.0, 7.0, 7.0])
    np.testing.assert_array_equal(found.stable, [False, True, False])
    assert found.reason[0] == "no equilibrium: the forces do not balance at this angle of attack"
    assert found.reason[2] == "no net_buoyancy given"


def test_lower_bound_with_a_speed_exponent_is_where_parasite_drag_is_the_thrust() -> None:
    seaglider = load("seaglider")
    found = stable_range(seaglider, 2.0, -0.03, 0.5)
    assert 3.5236 * float(found.speed_lower) ** 1.5 == pytest.approx(0.5, rel=1e-9)

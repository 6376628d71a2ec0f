"""Fastest and flattest flight: the paper's angles, closed forms, an independent maximiser, symmetry and limits."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from pipeline.model.optimum import fastest_flight, flattest_flight
from pipeline.model.steady import Signs, steady_state
from pipeline.vehicle import Vehicle, load

PETREL = load("petrel-ii")


@pytest.mark.parametrize(
    ("thrust", "signs", "alpha_deg", "path_deg"),
    [
        (None, "paper", -1.66, 36.8),  # printed: -1.8, 35
        (None, "physical", -1.66, 36.8),
        (7.0, "paper", -0.86, 19.9),  # printed: -0.9, 20
        (7.0, "physical", -0.84, 19.8),
    ],
)
def test_angles_of_the_largest_horizontal_speed_are_those_of_section_4(
    petrel: Vehicle, thrust: float | None, signs: Signs, alpha_deg: float, path_deg: float
) -> None:
    best = fastest_flight(petrel, 7.0, thrust=thrust, signs=signs)
    assert math.degrees(float(best.angle_of_attack)) == pytest.approx(alpha_deg, abs=5e-3)
    assert math.degrees(float(best.path_angle)) == pytest.approx(path_deg, abs=0.06)


@settings(max_examples=20)
@given(g=st.floats(0.5, 9.0), force=st.floats(0.0, 6.0))
def test_no_angle_of_attack_is_faster_by_an_independent_maximiser(g: float, force: float) -> None:
    def slow(alpha: float) -> float:
        # Eq. (21) in physical signs by hand: A x² + B x + C = 0 with x = V².
        d, l = 7.3579 + 318.0849 * alpha**2, 351.357 * alpha  # noqa: E741
        b = -2.0 * force * (d * math.cos(alpha) - l * math.sin(alpha))
        a, c = d**2 + l**2, force**2 - g**2
        if b**2 < 4.0 * a * c:
            return 0.0
        square = (-b + math.sqrt(b**2 - 4.0 * a * c)) / (2.0 * a)
        return (l * square + force * math.sin(alpha)) / g * math.sqrt(square) if square > 0.0 else 0.0

    grid = np.linspace(-0.19, -1e-4, 400)
    at = min(grid, key=slow)
    found = minimize_scalar(slow, bounds=(at - 1e-3, at + 1e-3), method="bounded", options={"xatol": 1e-10})
    best = fastest_flight(PETREL, g, thrust=force)
    assert float(best.speed * np.cos(best.path_angle)) == pytest.approx(-found.fun, rel=1e-9)
    assert float(best.angle_of_attack) == pytest.approx(found.x, abs=2e-6)


@given(g=st.floats(0.5, 9.0), k_d=st.floats(250.0, 1500.0), k_l=st.floats(200.0, 600.0))
def test_flattest_glide_is_that_of_equal_parasite_and_induced_drag(g: float, k_d: float, k_l: float) -> None:
    vehicle = PETREL.with_values({"induced_drag": k_d, "lift_slope": k_l}, "another")
    best = flattest_flight(vehicle, -g)
    assert float(best.angle_of_attack) == pytest.approx(math.sqrt(7.3579 / k_d), rel=1e-4)
    assert math.tan(float(best.path_angle)) == pytest.approx(-2.0 * math.sqrt(7.3579 * k_d) / k_l, rel=1e-9)


def test_thrust_makes_the_flattest_path_level() -> None:
    best = flattest_flight(PETREL, 2.5, propeller_speed=13.0)
    assert float(best.path_angle) == pytest.approx(0.0, abs=1e-7)
    assert float(best.thrust * np.cos(best.angle_of_attack)) == pytest.approx(
        (7.3579 + 318.0849 * float(best.angle_of_attack) ** 2) * float(best.speed) ** 2, rel=1e-6
    )


@given(g=st.floats(0.5, 9.0), turning=st.sampled_from([0.0, 12.0]))
def test_the_best_dive_is_the_best_climb_mirrored(g: float, turning: float) -> None:
    for best in (fastest_flight, flattest_flight):
        up, down = best(PETREL, g, propeller_speed=turning), best(PETREL, -g, propeller_speed=turning)
        assert float(up.path_angle) == pytest.approx(-float(down.path_angle), abs=1e-6)
        assert float(up.speed) == pytest.approx(float(down.speed), rel=1e-5)


def test_a_glide_s_best_angles_do_not_depend_on_net_buoyancy_and_its_speed_goes_with_the_root() -> None:
    for best in (fastest_flight, flattest_flight):
        flight = best(PETREL, [1.0, 4.0, 9.0])
        np.testing.assert_allclose(flight.path_angle, flight.path_angle[0], rtol=1e-9)
        np.testing.assert_allclose(flight.speed, flight.speed[0] * np.array([1.0, 2.0, 3.0]), rtol=1e-6)


def test_more_thrust_is_more_speed_and_a_flatter_path() -> None:
    flight = fastest_flight(PETREL, 5.0, thrust=np.linspace(0.0, 6.0, 7))
    assert (np.diff(flight.speed * np.cos(flight.path_angle)) > 0.0).all()
    assert (np.diff(flight.path_angle) < 0.0).all()


def test_optima_broadcast_and_are_steady_flights() -> None:
    flight = fastest_flight(PETREL, [[3.0], [-3.0], [0.0]], propeller_speed=[0.0, 10.0], density=1030.0)
    assert flight.speed.shape == flight.reason.shape == (3, 2)
    again = steady_state(
        PETREL, [[3.0], [-3.0]], flight.angle_of_attack[:2], propeller_speed=[0.0, 10.0], density=1030.0
    )
    np.testing.assert_array_equal(flight.speed[:2], again.speed)
    assert np.isnan(flight.speed[2]).all()
    assert flight.reason[2, 0] == "no equilibrium: neither net buoyancy nor thrust"


def test_an_optimum_beyond_the_search_is_not_claimed() -> None:
    clean = PETREL.with_values({"induced_drag": 60.0}, "little induced drag")  # best at sqrt(7.36/60) = 0.35 rad
    best = flattest_flight(clean, 3.0)
    assert np.isnan(best.speed)
    assert str(best.reason) == "the optimum lies beyond an angle of attack of 0.2 rad"


def test_wrong_units_are_refused() -> None:
    with pytest.raises(ValueError, match=r"propeller_speed: found 800; expected at most 100 rev/s; rev/s, not rpm\?"):
        fastest_flight(PETREL, 3.0, propeller_speed=800.0)

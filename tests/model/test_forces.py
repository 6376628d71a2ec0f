"""Forces against the paper's numbers and against the laws written out by hand."""

from typing import Any

import numpy as np
import pytest

from pipeline.model.forces import (
    NO_DISK,
    NO_PROPELLER,
    disk_thrust,
    drag,
    lift,
    net_buoyancy,
    pitching_moment,
    propeller_of,
    thrust,
)
from pipeline.vehicle import Disk, Vehicle, load


def test_petrel_drag_and_lift_are_those_of_section_4(petrel: Vehicle) -> None:
    # K_De at α_e = -0.0025358 and T/V² make the printed K_D' = 3.6272 kg/m at V = 1.3694 m/s, T = 7 N.
    alpha, speed = -0.0025358, 1.3694
    assert drag(petrel.polar, speed, alpha) / speed**2 - 7.0 / speed**2 * np.cos(alpha) == pytest.approx(3.6272, 1e-4)
    assert lift(petrel.polar, speed, alpha) == pytest.approx(351.357 * alpha * speed**2, rel=1e-12)


def test_parasite_drag_with_exponent_goes_with_speed_to_the_three_halves() -> None:
    polar = load("seaglider").polar
    assert drag(polar, 0.4, 0.0) / drag(polar, 0.1, 0.0) == pytest.approx(4.0**1.5, rel=1e-12)


def test_forces_at_rest_are_zero_with_and_without_exponent(petrel: Vehicle) -> None:
    for polar in (petrel.polar, load("seaglider").polar):
        assert drag(polar, 0.0, 0.1) == 0.0
        assert lift(polar, 0.0, 0.1) == 0.0


@pytest.mark.parametrize(("rpm", "speed", "force"), [(1391.0, 1.3694, 7.0), (1400.0, 1.3743, 7.1025)])
def test_thrust_law_gives_the_paper_s_pairs_of_speed_and_thrust(
    petrel: Vehicle, rpm: float, speed: float, force: float
) -> None:
    assert thrust(propeller_of(petrel), 1020.0, rpm / 60.0, speed) == pytest.approx(force, rel=1e-3)


def test_thrust_vanishes_where_the_advance_ratio_says(petrel: Vehicle) -> None:
    law = propeller_of(petrel)
    turning = 20.0
    speed = 0.6136 / 0.4091 * turning * 0.080
    assert thrust(law, 1020.0, turning, speed) == pytest.approx(0.0, abs=1e-12)
    assert thrust(law, 1020.0, turning, 1.01 * speed) < 0.0


def test_a_still_propeller_and_a_missing_one_give_no_thrust(petrel: Vehicle) -> None:
    assert thrust(propeller_of(petrel), 1020.0, 0.0, 1.0) == 0.0
    assert propeller_of(load("slocum-g2")) == NO_PROPELLER
    assert thrust(NO_PROPELLER, 1020.0, 20.0, 1.0) == 0.0


DISK = Disk(0.22, 0.5)
AREA = np.pi * 0.22**2 / 4.0


def test_thrust_by_power_at_rest_is_that_of_momentum_theory() -> None:
    # T = (2 ρ A η² P²)^(1/3): the figure of merit of a hovering rotor, Leishman (2006), Eq. 2.18
    force, _ = disk_thrust(DISK, 1025.0, 5.0, 0.0)
    assert force == pytest.approx((2.0 * 1025.0 * AREA * (0.5 * 5.0) ** 2) ** (1.0 / 3.0), rel=1e-12)


def test_thrust_by_power_at_high_speed_is_useful_power_over_speed() -> None:
    force, slope = disk_thrust(DISK, 1025.0, 5.0, 30.0)
    assert force == pytest.approx(0.5 * 5.0 / 30.0, rel=1e-5)
    assert slope == pytest.approx(-0.5 * 5.0 / 30.0**2, rel=1e-4)


@pytest.mark.parametrize("power", [0.01, 0.8, 5.0, 60.0])
@pytest.mark.parametrize("speed", [0.0, 0.05, 0.4, 1.2])
def test_thrust_by_power_obeys_momentum_and_energy_and_its_slope_is_the_difference(power: float, speed: float) -> None:
    force, slope = disk_thrust(DISK, 1025.0, power, speed)
    added = 0.5 * power / force - speed
    assert 2.0 * 1025.0 * AREA * (speed + added) * added == pytest.approx(force, rel=1e-10)
    ahead, behind = (disk_thrust(DISK, 1025.0, power, speed + step)[0] for step in (2e-5, 1e-5))
    assert slope == pytest.approx((ahead - behind) / 1e-5, rel=1e-3)


def test_without_power_or_without_a_law_a_disk_gives_no_thrust() -> None:
    assert disk_thrust(DISK, 1025.0, 0.0, 0.5) == (0.0, 0.0)
    assert disk_thrust(DISK, 1025.0, -0.3, 0.5) == (0.0, 0.0)
    assert disk_thrust(NO_DISK, 1025.0, 5.0, 0.5) == (0.0, 0.0)


def test_net_buoyancy_of_a_neutral_hull_is_that_of_its_engine() -> None:
    force = net_buoyancy(
        mass=70.0,
        volume=70.0 / 1025.0,
        buoyancy_volume=np.array([2e-4, 0.0, -2e-4, np.nan]),
        density=1025.0,
        pressure=0.0,
        temperature=15.0,
        compressibility=5e-10,
        thermal_expansion=7e-5,
        reference_temperature=15.0,
    )
    np.testing.assert_allclose(force, [9.81 * 1025.0 * 2e-4, 0.0, -9.81 * 1025.0 * 2e-4, np.nan], atol=1e-9)


def test_net_buoyancy_loses_by_pressure_and_cold_what_the_hull_does() -> None:
    # 1000 dbar = 1e7 Pa squeezes 0.5 %, 10 K less shrinks 0.07 %.
    force = net_buoyancy(
        mass=0.0,
        volume=0.07,
        buoyancy_volume=0.0,
        density=1030.0,
        pressure=1000.0,
        temperature=5.0,
        compressibility=5e-10,
        thermal_expansion=7e-5,
        reference_temperature=15.0,
        gravity=10.0,
    )
    assert float(force) == pytest.approx(10.0 * 1030.0 * 0.07 * (1.0 - 0.005 - 0.0007), rel=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass": -70.0}, "mass: found -70; expected a number that is not negative"),
        ({"volume": [0.07, -0.07]}, "volume: found -0.07; expected a number that is not negative"),
        ({"density": 0.0}, "density: found 0; expected a positive number of kg/m3"),
        ({"density": [1025.0, -1025.0]}, "density: found -1025; expected a positive number of kg/m3"),
    ],
)
def test_negative_mass_volume_or_density_is_refused(change: dict[str, Any], message: str) -> None:
    hull: dict[str, Any] = {"mass": 70.0, "volume": 0.07, "density": 1025.0}
    with pytest.raises(ValueError, match="expected") as caught:
        net_buoyancy(
            **hull | change,
            buoyancy_volume=0.0,
            pressure=0.0,
            temperature=15.0,
            compressibility=0.0,
            thermal_expansion=0.0,
            reference_temperature=15.0,
        )
    assert str(caught.value) == message


def test_pitching_moment_vanishes_at_the_paper_s_free_angle_of_attack_and_damps_pitching() -> None:
    alpha = -0.7959 / 313.8643  # α_e = −K_M0/K_M = −0.0025358 rad with both coefficients negative
    assert pitching_moment(-0.7959, -313.8643, -7.0, 1.3694, alpha, 0.0) == pytest.approx(0.0, abs=1e-12)
    assert pitching_moment(-0.7959, -313.8643, -7.0, 2.0, 0.01, 0.1) == pytest.approx(4 * (-0.7959 - 3.138643 - 0.7))

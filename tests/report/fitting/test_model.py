"""The theory as a function of its corrections: against the public trim, and every slope against finite differences."""

import math

import numpy as np
import pytest
from synthetic import SETTINGS, blocks, level_blocks

from pipeline.model.steady import trim_at_pitch
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.model import Model
from pipeline.report.fitting.parameters import CORRECTIONS
from pipeline.report.fitting.points import Configuration, Points
from pipeline.report.fitting.terms import Moments
from pipeline.vehicle import load

NAMES = (*CORRECTIONS, "parasite_drag@payload")
CARRIED = (Configuration("bare", 1, 1), Configuration("payload", 2, 2))


def points(vehicle, **options) -> Points:
    table = blocks(dives=2, powered_climbs=True, sensor=True, **options)
    count = len(table)
    table["battery_position"] = np.linspace(-0.01, 0.02, count)
    table["buoyancy_by_compression"] = np.linspace(-5e8, -1e9, count)
    table["buoyancy_by_expansion"] = np.linspace(-2e3, 4e3, count)
    table["battery_voltage"] = np.linspace(29.0, 24.0, count)
    table["buoyancy_by_lag"] = np.linspace(-1e-3, 2e-3, count)
    table["buoyancy_by_carried"] = np.linspace(2.0, -1.0, count)
    table["buoyancy_by_flushing"] = np.linspace(1e-3, -2e-3, count)
    return Points.of(table, vehicle, CARRIED)


@pytest.mark.parametrize("name", ["petrel-ii", "seaglider"])
def test_without_corrections_it_is_the_trim_at_the_measured_pitch(name):
    vehicle = load(name)
    here = Points.of(blocks(dives=2, force=2.0), vehicle)
    flight = Model(vehicle, here, ()).fly(np.zeros(0))
    trim = trim_at_pitch(vehicle, here.net_buoyancy, here.pitch, density=here.density)
    np.testing.assert_array_equal(flight.speed, trim.speed)
    np.testing.assert_array_equal(flight.path_angle, trim.path_angle)
    assert flight.horizontal_speed == pytest.approx(trim.speed * np.cos(trim.path_angle))


def test_corrections_of_coefficients_are_those_of_the_vehicle(petrel):
    here = points(petrel)
    flight = Model(petrel, here, ("parasite_drag", "induced_drag", "thrust_scale")).fly(np.array([0.7, -9.0, 0.1]))
    changed = petrel.with_values(
        {
            "parasite_drag": petrel["parasite_drag"] + 0.7,
            "induced_drag": petrel["induced_drag"] - 9.0,
            "thrust_static": 1.1 * petrel["thrust_static"],
            "thrust_slope": 1.1 * petrel["thrust_slope"],
        },
        "a test",
    )
    turning = np.where(here.powered, here.propeller_speed, 0.0)
    trim = trim_at_pitch(changed, here.net_buoyancy, here.pitch, propeller_speed=turning, density=here.density)
    np.testing.assert_allclose(flight.speed, trim.speed, rtol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_slopes_of_every_measurement_are_analytic_and_agree_with_finite_differences(petrel, name):
    here = points(petrel)
    model = Model(petrel, here, (name, "parasite_drag" if name != "parasite_drag" else "net_buoyancy"))
    terms = (*Given(SETTINGS, use_sensor=True, gps=(0.62, 0.01)).terms(here), Moments.made(model))
    size = model.correction(name).size
    x = np.array([0.3 * size, 0.1])
    flight = model.fly(x)
    felt = 0.0
    for term in terms:
        step = np.array([1e-4 * size, 0.0])
        slope = (term.residual(model.fly(x + step)) - term.residual(model.fly(x - step))) / (2.0 * step[0])
        exact = term.jacobian(flight)[:, 0]
        np.testing.assert_allclose(exact, slope, rtol=2e-4, atol=1e-5 * max(np.abs(slope).max(), 1e-9))
        felt = max(felt, float(np.abs(exact).max()))
    assert felt > 0.0


def test_slopes_with_the_speed_exponent_of_seaglider_agree_with_finite_differences():
    vehicle = load("seaglider")
    model = Model(vehicle, Points.of(blocks(dives=2, force=2.0), vehicle), ("parasite_drag", "pitch", "lift_slope"))
    x = np.array([0.2, 0.003, -20.0])
    flight = model.fly(x)
    for column, step in enumerate((1e-4, 1e-6, 1e-2)):
        change = np.eye(3)[column] * step
        ahead, behind = model.fly(x + change), model.fly(x - change)
        for name in ("depth_rate", "horizontal_speed"):
            slope = (getattr(ahead, name) - getattr(behind, name)) / (2.0 * step)
            np.testing.assert_allclose(getattr(flight, f"{name}_by")[:, column], slope, rtol=1e-5)


def test_slope_of_the_gps_speed_agrees_with_finite_differences(petrel):
    here = Points.of(level_blocks(), petrel)
    model = Model(petrel, here, ("parasite_drag", "net_buoyancy"))
    level = Given(SETTINGS, gps=(0.62, 0.01)).terms(here)[-1]
    exact = level.jacobian(model.fly(np.zeros(2)))
    assert exact.shape == (1, 2)
    for column, step in enumerate((1e-3, 1e-4)):
        change = np.eye(2)[column] * step
        slope = (level.residual(model.fly(change)) - level.residual(model.fly(-change))) / (2.0 * step)
        np.testing.assert_allclose(exact[:, column], slope, rtol=1e-4)


def test_what_cannot_fly_is_nan_not_a_number(petrel):
    here = Points.of(blocks(dives=1).assign(pitch=0.001, net_buoyancy=5.0), petrel)
    flight = Model(petrel, here, ("parasite_drag",)).fly(np.zeros(1))
    assert np.isnan(flight.speed).all()
    assert np.isnan(flight.depth_rate_by).all()


def test_drag_of_a_configuration_is_felt_by_its_dives_alone(petrel):
    model = Model(petrel, points(petrel), ("parasite_drag@payload",))
    slope = model.fly(np.zeros(1)).speed_by[:, 0]
    payload = model.points.dive == 2
    assert (slope[payload] < 0.0).all()
    assert (slope[~payload] == 0.0).all()
    item = model.correction("parasite_drag@payload")
    assert item.symbol == "ΔK_D0(payload)"
    assert "beside the first configuration" in item.meaning


def test_growing_drag_is_nothing_on_the_first_block_and_grows_with_days(petrel):
    model = Model(petrel, points(petrel), ("drag_drift",))
    slope = model.fly(np.zeros(1)).speed_by[:, 0]
    assert slope[0] == 0.0
    assert math.isclose(slope[-1] / slope[-2], model.points.days[-1] / model.points.days[-2], rel_tol=0.05)


def test_moments_of_the_vehicle_file_leave_what_an_independent_balance_leaves(petrel):
    here = points(petrel)
    model = Model(petrel, here, ())
    balance = Moments.made(model)
    flight = model.fly(np.zeros(0))
    trim = trim_at_pitch(
        petrel,
        here.net_buoyancy,
        here.pitch,
        propeller_speed=np.where(here.powered, here.propeller_speed, 0.0),
        density=here.density,
    )
    still = -petrel["battery_mass"] * 9.81 * here.battery_position * np.cos(here.pitch)
    still += petrel["righting_moment"] * np.sin(here.pitch)
    left = still - trim.required_moment
    np.testing.assert_allclose(-balance.residual(flight) * balance.scale, left, rtol=1e-9, atol=1e-12)

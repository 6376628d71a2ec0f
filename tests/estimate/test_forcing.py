"""What drives the vehicle: propeller power where it tells of thrust, and how uncertain that is."""

from __future__ import annotations

import math

import arrays
import numpy as np
import pandas as pd
import pytest

from pipeline import vehicle
from pipeline.estimate.ballast import Hull, borrowed_std, hull
from pipeline.estimate.craft import from_vehicle, thrust_std
from pipeline.estimate.forcing import forcing
from pipeline.mission import Ballast, Mission, Water
from pipeline.records import RECORDS, conform, timestamps
from pipeline.vehicle import Disk


def test_thrust_by_power_is_as_uncertain_as_diameter_and_efficiency_make_it() -> None:
    craft = arrays.craft(vehicle.load("slocum-thruster"))._replace(disk_std=Disk(0.022, 0.05))
    given = arrays.inputs(3, 0.0, 1025.0, propeller_power=5.0)
    at_rest, fast = (thrust_std(craft, [given], [np.full(3, speed)]) for speed in (0.0, 50.0))
    assert at_rest == pytest.approx(math.hypot(2.0 / 3.0 * 0.1, 2.0 / 3.0 * 0.1), rel=1e-2)
    assert fast == pytest.approx(0.1, rel=1e-2)


def test_power_tells_of_thrust_only_where_propeller_speed_does_not() -> None:
    records = conform(pd.DataFrame({"time": timestamps(1.6e9 + np.arange(4.0)), "pressure": 10.0, "pitch": -0.4,
                                    "density": 1025.0, "buoyancy_volume": -2e-4,
                                    "propeller_power": [np.nan, 5.0, -0.2, np.nan]}), RECORDS)  # fmt: skip
    mission, body = Mission(vehicle="slocum-thruster"), Hull(70.0, 70.0 / 1025.0, 1.0)
    by_power, _ = forcing(records, vehicle.load("slocum-thruster"), mission, body)
    assert by_power is not None
    assert by_power.propeller_power.tolist() == [0.0, 5.0, 0.0, 0.0]
    assert by_power.driven
    for name in ("slocum-g2", "petrel-ii"):  # no law, or one for propeller speed, which is not logged
        none, _ = forcing(records, vehicle.load(name), mission, body)
        assert none is not None
        assert not none.driven


def test_a_borrowed_density_is_in_the_one_sigma_of_net_buoyancy_and_a_measured_one_is_not() -> None:
    lent = Mission(vehicle="x", water=Water(density=1028.0, std=2.0), ballast=Ballast(volume=0.07, std=0.3))
    craft = vehicle.load("slocum-thruster")
    table = pd.DataFrame({"density": [1028.0], "absolute_salinity": [np.nan]})
    body, _ = hull(lent, craft, {}, table)
    assert body is not None
    assert body.std == pytest.approx(math.hypot(0.3, 9.81 * 0.07 * 2.0))
    measured, _ = hull(lent, craft, {}, table.assign(absolute_salinity=38.0))
    assert measured is not None
    assert measured.std == 0.3
    assert borrowed_std(Mission(vehicle="x"), table) == 0.0


def test_before_the_mission_thrust_by_power_is_as_uncertain_as_it_is_at_rest() -> None:
    body = Hull(70.0, 0.07, 1.0)
    craft = from_vehicle(vehicle.load("slocum-thruster"), Mission(vehicle="slocum-thruster"), body)
    known = dict(zip(("diameter", "efficiency"), (0.05 / 0.22, 0.3), strict=True))
    given = arrays.inputs(3, 0.0, 1025.0, propeller_power=5.0)
    assert thrust_std(craft, [given], [np.zeros(3)]) == pytest.approx(2.0 / 3.0 * math.hypot(*known.values()), rel=0.02)
    assert thrust_std(craft, [arrays.inputs(3, 0.0, 1025.0)], [np.zeros(3)]) == pytest.approx(
        2.0 / 3.0 * math.hypot(*known.values())
    )

"""Battery trim: moments found again from pitch and battery position in balance."""

import numpy as np
import pytest
from synthetic import SETTINGS, blocks

from pipeline.model.steady import trim_at_pitch
from pipeline.report.fitting.fit import fit
from pipeline.report.fitting.given import Given
from pipeline.vehicle import load


def balanced(vehicle, moment_at_zero: float):
    """Return blocks whose battery holds the pitch of a vehicle with another K_M0."""
    true = vehicle.with_values({"moment_at_zero": moment_at_zero}, "a test")
    table = blocks(dives=6, pitches_deg=(22.0, 28.0, 36.0), sigma_w=0.0, noise=1e-6)
    trim = trim_at_pitch(true, table["net_buoyancy"], table["pitch"], density=table["density"])
    static = trim.required_moment - true["righting_moment"] * np.sin(table["pitch"])
    return table.assign(battery_position=-static / (true["battery_mass"] * 9.81 * np.cos(table["pitch"])))


def trim(vehicle, table):
    return fit(table, vehicle, Given(SETTINGS), resamples=10)["battery"]


def test_a_moment_that_the_vehicle_file_lacks_is_found_from_the_battery(petrel):
    found = trim(petrel, balanced(petrel, -0.4))
    zero, slope = found["parameters"]
    assert found["blocks"] == 48
    assert abs(zero["value"] - (-0.4 - petrel["moment_at_zero"])) < 3.0 * zero["std"]
    assert abs(slope["value"]) < 3.0 * slope["std"]
    assert found["pitch_rms_after_deg"] < 0.2 * found["pitch_rms_before_deg"]


def test_battery_in_balance_asks_for_no_correction(petrel):
    found = trim(petrel, balanced(petrel, petrel["moment_at_zero"]))
    assert found["pitch_rms_before_deg"] < 0.05
    assert all(abs(item["value"]) < item["std"] for item in found["parameters"])


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({}, "no battery position is logged"),
        ({"battery_position": [0.01, 0.02] + [np.nan] * 46}, "2 blocks with a battery position: 3 are needed"),
    ],
)
def test_without_battery_positions_there_is_no_trim_and_a_reason(petrel, change, reason):
    table = blocks(dives=6).assign(**change)
    assert trim(petrel, table)["reason"] == reason


def test_unknown_moments_are_named():
    vehicle = load("slocum-g2")
    reason = trim(vehicle, blocks(dives=6).assign(battery_position=0.01))["reason"]
    assert reason.startswith("the vehicle file leaves moment_at_zero, moment_slope")

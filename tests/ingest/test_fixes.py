"""Positions that no receiver can have had are flagged, and those at the surface are not."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pipeline.ingest import fixes, quality
from pipeline.records import Quality

START = 1.5e9
METRE = 1.0 / 111_195.0  # degrees of latitude


def _streams(pressure: np.ndarray, fix_time: np.ndarray, north: np.ndarray) -> list[pd.DataFrame]:
    """Return a CTD that reports `pressure` every second and fixes at `fix_time`, `north` metres north of 54°."""
    ctd = pd.DataFrame({"time": START + np.arange(pressure.size), "pressure": pressure})
    gps = pd.DataFrame({"time": START + fix_time, "latitude": 54.0 + north * METRE, "longitude": 15.0})
    ctd.attrs, gps.attrs = {"name": "ctd.csv"}, {"name": "gps.csv"}
    return quality.checked([ctd, gps])[0]


def _flags(streams: list[pd.DataFrame]) -> tuple[list[bool], list[str]]:
    found, findings = fixes.checked(streams)
    gps = next(frame for frame in found if "latitude" in frame)
    assert gps["latitude_qc"].tolist() == gps["longitude_qc"].tolist()
    return (gps["latitude_qc"] == Quality.GOOD).tolist(), [str(finding) for finding in findings]


def test_a_receiver_that_goes_on_reporting_under_water_has_no_fixes() -> None:
    pressure = np.r_[np.full(60, 0.4), np.linspace(0.4, 30.0, 300)]
    good, findings = _flags(_streams(pressure, np.array([10.0, 50.0, 75.0, 85.0]), np.zeros(4)))
    assert good == [True, True, False, False]
    assert findings == [
        "gps.csv: latitude, record 3: found 2 of 4 positions under water; expected fixes at the surface; "
        "flagged bad and not used"
    ]


@pytest.mark.parametrize("offset", [-3.0, 0.0, 1.2])
def test_fixes_at_the_surface_stay_whatever_the_offset_of_the_sensor(offset: float) -> None:
    rng = np.random.default_rng(1)
    pressure = np.r_[0.3 + rng.uniform(-0.3, 0.3, 60), np.linspace(0.4, 30.0, 300)] + offset
    assert _flags(_streams(pressure, np.arange(5.0, 60.0, 10.0), np.zeros(6))) == ([True] * 6, [])


def test_a_fix_while_pressure_is_not_known_stays() -> None:
    streams = _streams(np.full(10, 20.0), np.array([-50.0, 500.0]), np.zeros(2))
    assert _flags(streams) == ([True, True], [])


def test_the_position_of_the_last_surfacing_and_one_gone_astray_are_flagged() -> None:
    north = np.array([5000.0, 0.0, 3.0, -2.0, 900.0, 4.0])
    good, findings = _flags(_streams(np.full(100, 0.3), np.arange(0.0, 60.0, 10.0), north))
    assert good == [False, True, True, True, False, True]
    assert findings == [
        "gps.csv: latitude, record 1: found 2 of 6 positions out of reach of the others; "
        "expected fixes that agree at 3 m/s over ground; flagged bad and not used"
    ]


def test_hours_between_surfacings_allow_for_kilometres() -> None:
    time = np.array([0.0, 10.0, 7200.0, 7210.0])
    assert fixes.consistent(time, 54.0 + np.array([0.0, 5.0, 9000.0, 9004.0]) * METRE, np.full(4, 179.9)).all()


def test_crossing_the_date_line_is_no_jump() -> None:
    longitude = np.array([179.9999, -179.9999, -179.9998])
    assert fixes.consistent(np.array([0.0, 60.0, 120.0]), np.zeros(3), longitude).all()


def test_no_fixes_are_no_trouble() -> None:
    assert fixes.consistent(np.zeros(0), np.zeros(0), np.zeros(0)).size == 0


def test_where_one_sensor_of_pressure_is_silent_another_tells_the_depth() -> None:
    ctd, gps = _streams(np.r_[np.full(60, 0.3), np.full(60, 40.0)], np.array([30.0, 90.0]), np.zeros(2))
    silent = ctd["time"] - START >= 60.0
    other = ctd.assign(pressure=ctd["pressure"] - 0.1)
    other.attrs = {"name": "vehicle.csv"}
    ctd.loc[silent, "pressure_qc"] = Quality.MISSING
    more = pd.DataFrame({"time": START - 200.0 + np.arange(100.0), "pressure": 0.3, "pressure_qc": Quality.GOOD})
    first = pd.concat([more, ctd[~silent]], ignore_index=True)
    assert _flags([first, other, gps])[0] == [True, False]
    assert _flags([first, gps])[0] == [True, True]

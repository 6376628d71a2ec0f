"""Metres between places, against published lengths of a degree."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.geodesy import LATITUDE, WGS84, apart, radii, typical_latitude

#: Lengths, m, of a degree of latitude and of longitude on WGS 84 (NGA, "Length of a degree of latitude and longitude").
DEGREE = {
    0.0: (110574.0, 111320.0),
    15.0: (110649.0, 107550.0),
    30.0: (110852.0, 96486.0),
    45.0: (111132.0, 78847.0),
    60.0: (111412.0, 55800.0),
    75.0: (111618.0, 28902.0),
}


@pytest.mark.parametrize("latitude", sorted(DEGREE))
def test_a_degree_is_as_long_as_published(latitude: float) -> None:
    east, north = apart([latitude + 0.005, latitude], [10.0, 10.01], [latitude - 0.005, latitude], 10.0)
    assert 100.0 * north[0] == pytest.approx(DEGREE[latitude][0], abs=1.0)
    assert 100.0 * east[1] == pytest.approx(DEGREE[latitude][1], abs=1.0)
    assert east[0] == pytest.approx(0.0, abs=1e-6)


def test_the_two_radii_are_one_at_a_pole() -> None:
    meridian, prime = radii([90.0, 0.0])
    axis, squeeze = WGS84
    assert meridian[0] == pytest.approx(prime[0], rel=1e-12)
    assert prime[1] == axis
    assert meridian[1] == pytest.approx(axis * (1.0 - squeeze), rel=1e-12)


@given(
    latitude=st.floats(-80.0, 80.0),
    longitude=st.floats(-180.0, 180.0),
    step=st.floats(-0.5, 0.5),
    turns=st.integers(-1, 1),
)
def test_neither_the_date_line_nor_the_way_of_counting_longitude_matters(
    latitude: float, longitude: float, step: float, turns: int
) -> None:
    east, north = apart(latitude + step, longitude + step + 360.0 * turns, latitude, longitude)
    back_east, back_north = apart(latitude, longitude, latitude + step, longitude + step)
    assert east == pytest.approx(-back_east, abs=1e-4)
    assert north == pytest.approx(-back_north, abs=1e-6)
    assert np.sign(north) == np.sign(step) or abs(step) < 1e-9


def test_a_mission_is_where_its_file_says_the_equator_too_else_at_the_median_fix() -> None:
    fixes = [np.nan, 10.0, 12.0, 40.0, 6969.7]
    assert typical_latitude(fixes, 0.0) == 0.0
    assert typical_latitude(fixes) == 12.0
    assert typical_latitude([np.nan]) == typical_latitude(None) == LATITUDE

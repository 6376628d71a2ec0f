"""Long series on the page: apexes whole, no excursion lost, no more points than wanted."""

from __future__ import annotations

import json
import re

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.report import Report
from pipeline.report.figures import interactive, series
from pipeline.report.figures.series import Apex, thinning


def test_a_short_series_is_shown_whole() -> None:
    time = np.arange(500.0)
    values = np.sin(time)
    whole = thinning(time, [], 500)
    np.testing.assert_array_equal(whole.instants(time), time)
    np.testing.assert_array_equal(whole.line(values), values)
    assert whole.longest == 1


@given(
    st.integers(2_000, 30_000),
    st.lists(st.floats(0.0, 1.0), max_size=12),
    st.integers(0, 2**32 - 1),
)
def test_no_excursion_is_lost_and_points_stay_within_the_limit(rows: int, places: list[float], seed: int) -> None:
    random = np.random.default_rng(seed)
    time = np.cumsum(random.uniform(0.5, 2.0, rows))
    values = random.standard_normal(rows)
    turns = [Apex(i, float(time[int(place * (rows - 1))])) for i, place in enumerate(sorted(places))]
    thin = thinning(time, turns, 1_000)
    points, instants = thin.line(values), thin.instants(time)
    assert points.size == instants.size <= 1_010
    assert (points.min(), points.max()) == (values.min(), values.max())
    assert np.all(np.diff(instants) >= 0.0)
    low, high = thin.band(values - 1.0, values + 1.0)
    assert np.all((low <= points) & (points <= high))
    for apex in turns:
        near = np.abs(time - apex.time) < thin.around
        assert np.isin(time[near], instants).all()


def test_what_is_unknown_stays_unknown_and_hides_nothing_known() -> None:
    time = np.arange(10_000.0)
    values = np.where((time > 4_000) & (time < 6_000), np.nan, time)
    values[8_000:9_000:2] = np.nan
    thin = thinning(time, [], 1_000)
    instants, points = thin.instants(time), thin.line(values)
    assert np.isnan(points[(instants > 4_100) & (instants < 5_900)]).all()
    assert np.isfinite(points[instants > 6_100]).all()


def test_the_longest_stretch_about_an_apex_that_leaves_half_to_the_rest_is_taken() -> None:
    time = np.arange(100_000.0)
    assert thinning(time, [Apex(1, 5e4)], 1_000).around == 120.0
    assert thinning(time, [Apex(i, 1e4 * i) for i in range(1, 9)], 1_000).around == 30.0
    assert thinning(time, [Apex(i, 100.0 * i) for i in range(1, 900)], 1_000).around == 0.0


def test_the_drawing_numbers_its_own_identifiers_and_carries_the_account(built: Report) -> None:
    item = re.search(r'id="series-item">(.*?)</script>', built.page, flags=re.DOTALL)
    assert item is not None
    found = re.findall(r'"id":"(p\d+)"', item[1])
    assert json.loads(item[1])["root_id"] in found
    assert min(int(name[1:]) for name in found) == 0
    account = built.summary["series"]
    assert account["rule"] in built.page
    assert account["points"] <= account["rows"]
    assert [apex["dive"] for apex in account["apexes"]] == sorted({apex["dive"] for apex in account["apexes"]})


def test_a_page_stays_small_however_long_the_mission() -> None:
    """Every point of either method takes a time of 8 bytes and 9 values of 4, written as base64."""
    estimates = series.MOST * (2 * 8 + 2 * 9 * 4)
    beside = interactive.BESIDE * 4 * (8 + 4)
    assert (estimates + beside) * 4 / 3 < 8e6

"""Passages between fixes, from records whose truth is known."""

import math

import numpy as np
import pandas as pd
import pytest
from voyages import DIVE_S, START, records

from pipeline.records import seconds
from pipeline.report.fitting import passages as module
from pipeline.report.fitting.passages import by_blocks, find, through_water

EAST, NORTH, WEST = math.pi / 2.0, 0.0, 1.5 * math.pi
ROUND = [(EAST,), (NORTH, WEST), (WEST,)]


def test_velocity_over_ground_is_flight_plus_current_whatever_the_surface_drift() -> None:
    found = find(records(ROUND, speed=0.3, current=0.1 - 0.05j, surface=0.4 + 0.3j))
    assert found.count == 3
    np.testing.assert_allclose(found.over_ground[[0, 2]], [0.4 - 0.05j, -0.2 - 0.05j], atol=3e-3)
    np.testing.assert_allclose(found.over_ground[1], 0.1 - 0.05j + 0.15j - 0.15, atol=3e-3)
    assert found.dive.tolist() == [1, 2, 3]
    assert np.all(found.recorded > 0.99)
    np.testing.assert_allclose(found.end - found.start, DIVE_S, atol=60.0)


def test_a_speed_all_the_way_gives_the_velocity_through_water_of_several_headings_in_one_dive() -> None:
    table = records(ROUND, speed=0.3)
    found = find(table)
    through = through_water(found, seconds(table["time"]), np.full(len(table), 0.3))
    np.testing.assert_allclose(found.over_ground - through.velocity, 0.1 - 0.05j, atol=3e-3)
    np.testing.assert_allclose(through.seen, 1.0, atol=0.01)
    assert np.all(through.std < 1e-3)


def test_where_the_speed_is_not_known_the_standard_deviation_says_so() -> None:
    table = records(ROUND, speed=0.3)
    found = find(table)
    time = seconds(table["time"])
    second = 0.5 * (found.start + found.end)[1]
    speed = np.where((time > second) & (time < second + 1200.0), np.nan, 0.3)
    through = through_water(found, time, speed)
    np.testing.assert_allclose(through.seen, [1.0, 0.75, 1.0], atol=0.02)
    np.testing.assert_allclose(through.velocity[1], -0.15 + 0.15j, atol=2e-3)
    assert through.std[1] == pytest.approx(module.UNSEEN * 0.3 * 0.25, rel=0.1)


def test_no_speed_at_all_is_no_velocity() -> None:
    table = records(ROUND)
    through = through_water(find(table), seconds(table["time"]), np.full(len(table), np.nan))
    assert np.isnan(through.velocity).all()
    assert not through.seen.any()


def test_steady_blocks_stand_for_what_is_flown_between_them() -> None:
    found = find(records(ROUND, speed=0.3))
    start = np.concatenate([[first + 300.0, first + 2700.0] for first in found.start])
    weights, seen = by_blocks(found, start, start + 1800.0)
    velocity = weights @ np.full(6, 0.3)
    np.testing.assert_allclose(velocity, [0.3, -0.15 + 0.15j, -0.3], atol=2e-3)
    np.testing.assert_allclose(seen, 0.75, atol=0.03)
    halves = weights @ np.array([0.3, 0.3, 0.4, 0.2, 0.3, 0.3])
    np.testing.assert_allclose(halves[1], 0.2j - 0.1, atol=2e-3)


def test_a_block_of_another_dive_says_nothing_of_this_one() -> None:
    found = find(records(ROUND))
    weights, seen = by_blocks(found, found.start[:1] + 300.0, found.start[:1] + 4000.0)
    assert np.all(weights.toarray()[1:] == 0.0)
    assert seen[0] > 0.7
    assert not seen[1:].any()


def test_no_blocks_are_no_weights() -> None:
    weights, seen = by_blocks(find(records(ROUND)), np.zeros(0), np.zeros(0))
    assert weights.shape == (3, 0)
    assert not seen.any()


def test_without_a_drift_measured_the_time_afloat_is_in_the_standard_deviation() -> None:
    known, unknown = find(records(ROUND)), find(records(ROUND, fixes_s=(300.0,)))
    assert unknown.count == 3
    assert np.all(unknown.over_ground_std > 2.0 * known.over_ground_std)
    error = np.abs(unknown.over_ground - known.over_ground)
    assert np.all(error < 3.0 * unknown.over_ground_std)


@pytest.mark.parametrize(
    ("spoilt", "reason"),
    [
        ({"latitude_qc": 4}, module.NO_FIXES),
        ({"latitude": np.nan}, module.NO_FIXES),
        ({"pressure_qc": 4}, module.NO_DEPTH),
        ({"heading": np.nan}, module.NO_HEADING),
    ],
)
def test_what_is_missing_is_named(spoilt: dict[str, float], reason: str) -> None:
    found = find(records(ROUND).assign(**spoilt))
    assert found.count == 0
    assert found.reason == reason
    assert through_water(found, np.arange(3.0), np.ones(3)).velocity.size == 0


def test_one_fix_is_too_few() -> None:
    table = records(ROUND)
    table.loc[table.index > int(table["latitude"].first_valid_index() or 0), ["latitude", "longitude"]] = np.nan
    assert find(table).reason == module.NO_FIXES


def test_fixes_on_one_side_of_the_dives_make_no_passage() -> None:
    table = records([(EAST,)])
    table.loc[seconds(table["time"]) > START + 700.0, ["latitude", "longitude"]] = np.nan
    assert find(table).reason == module.NO_PASSAGE


def test_a_fix_a_hundred_kilometres_off_costs_the_passages_beside_it() -> None:
    table = records([*ROUND, (EAST,)])
    rows = np.flatnonzero(table["latitude"].notna())
    table.loc[rows[5], "latitude"] += 0.9
    found = find(table)
    assert found.dive.tolist() == [1, 3, 4]
    assert [item["reason"] for item in found.left_out] == ["fixes farther apart than 3 m/s over ground"]


def _without(table: pd.DataFrame, first: float, last: float) -> pd.Series:
    """Return which rows lie between two times, s after the start."""
    after = seconds(table["time"]) - START
    return pd.Series((after > first) & (after < last))


def test_a_passage_without_heading_or_depth_half_of_the_way_is_left_out() -> None:
    table = records(ROUND)
    table.loc[_without(table, 700.0, 3000.0), "heading"] = np.nan
    found = find(table)
    assert found.dive.tolist() == [2, 3]
    assert found.left_out[0]["reason"] == "heading not recorded all the way"
    table = records(ROUND)
    found = find(table[~_without(table, 700.0, 3000.0)].reset_index(drop=True))
    assert found.dive.tolist() == [2, 3]
    assert found.left_out[0]["reason"] == "depth not recorded all the way"


def test_a_dive_that_was_not_recorded_is_no_surface_drift() -> None:
    table = records([(EAST,), (EAST,), (EAST,)], surface=0.0)
    gone = _without(table, 6010.0, 10790.0)
    found = find(table[~gone].reset_index(drop=True))
    whole = find(table)
    np.testing.assert_allclose(found.over_ground, whole.over_ground[[0, 2]], atol=1e-3)

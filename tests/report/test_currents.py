"""Depth-average current: what the fixes leave of the estimate's velocity, with its 1-sigma, or the reason for none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from pages import complete

from pipeline.report import Inputs
from pipeline.report.closures import of_mission
from pipeline.report.currents import BLIND, NOWHERE, currents
from pipeline.report.figures.track import track
from pipeline.vehicle import Vehicle


@pytest.fixture(scope="module")
def given(petrel: Vehicle) -> Inputs:
    """Return a mission of 0.5 m/s along each heading in a current of 0.1 m/s to the east, rightly estimated."""
    made = complete(petrel)
    return replace(made, estimates=made.estimates.assign(speed=0.5 / math.cos(0.5), speed_std=0.01, path_angle=0.5))


def test_the_current_is_what_the_fixes_leave_of_the_speed(given: Inputs) -> None:
    found = currents(given, of_mission(given))
    assert found["reason"] == ""
    assert found["label"] == "independent"
    assert len(found["passages"]) == 5
    for row in found["passages"]:
        assert (row["east_m_s"], row["north_m_s"]) == (pytest.approx(0.1, abs=0.004), pytest.approx(0.0, abs=0.004))
        assert row["std_m_s"] >= 0.01 * math.cos(0.5)
    assert "mean of 5 passages between fixes: +0.1" in found["sentence"]


def test_a_speed_that_is_wrong_is_in_the_current_and_in_its_uncertainty(given: Inputs) -> None:
    """10 % of the speed along the heading of each dive, and a 1-sigma as wide."""
    wrong = given.estimates.assign(speed=1.1 * given.estimates["speed"], speed_std=0.05 / math.cos(0.5))
    right, found = (currents(replace(given, estimates=table), of_mission(given)) for table in (given.estimates, wrong))
    for before, row in zip(right["passages"], found["passages"], strict=True):
        change = complex(row["east_m_s"] - before["east_m_s"], row["north_m_s"] - before["north_m_s"])
        assert abs(change) == pytest.approx(0.05, rel=0.02)
        assert row["std_m_s"] >= 0.99 * 0.05


def test_where_the_speed_is_not_known_there_is_no_current_but_a_reason(given: Inputs) -> None:
    dive = given.estimates["dive"].to_numpy()
    third = of_mission(given).dive[2]
    blind = given.estimates.assign(speed=np.where(dive == third, np.nan, given.estimates["speed"]))
    rows = currents(replace(given, estimates=blind), of_mission(given))["passages"]
    assert [row["reason"] for row in rows] == ["", "", BLIND, "", ""]
    assert math.isnan(rows[2]["east_m_s"])
    nowhere = currents(replace(given, estimates=given.estimates.assign(speed=np.nan)), of_mission(given))
    assert (nowhere["reason"], nowhere["sentence"]) == (NOWHERE, "")
    picture = track(given.records, nowhere)
    assert picture is not None
    assert f"No current is drawn: {NOWHERE}." in picture.caption


def test_without_headings_the_reason_is_said(given: Inputs) -> None:
    none = replace(given, records=given.records.assign(heading=np.nan))
    assert currents(none, of_mission(none))["reason"] == "no heading"


def test_an_estimate_that_has_used_the_fixes_is_called_circular(given: Inputs) -> None:
    used = replace(given, estimate={**given.estimate, "used": {"fixes": True}})
    found = currents(used, of_mission(used))
    assert found["label"] == "circular"
    assert "has used the same fixes" in found["sentence"]


def test_every_current_is_an_arrow_at_its_dive_and_a_row_of_the_table(given: Inputs) -> None:
    found = currents(given, of_mission(given))
    picture = track(given.records, found)
    assert picture is not None
    assert picture.table is not None
    rows = picture.table.frame[picture.table.frame["what"] == "current"]
    assert rows["current_east"].tolist() == [row["east_m_s"] for row in found["passages"]]
    assert found["sentence"] in picture.alt
    assert "shares the estimate's polar" in picture.caption

"""What the page says of the speed of every model by the fixes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pages import complete, section, with_fixes
from synthetic import blocks, inputs

from pipeline.mission import Mission
from pipeline.records import STORED, conform, seconds
from pipeline.report import Inputs, page
from pipeline.report import closures as module
from pipeline.report.closures import of_mission
from pipeline.report.figures.closure import closure
from pipeline.vehicle import Vehicle


@pytest.fixture(scope="module")
def given(petrel: Vehicle) -> Inputs:
    return complete(petrel)


@pytest.fixture(scope="module")
def found(given: Inputs) -> dict[str, Any]:
    return closures(given)


def closures(given: Inputs) -> dict[str, Any]:
    return module.closures(given, of_mission(given))


def of(found: dict[str, Any], model: str) -> dict[str, Any]:
    return next(row for row in found["models"] if row["model"] == model)


def said(verdict: str, words: str) -> float:
    assert verdict.startswith(words)
    return float(verdict.removeprefix(words).split(" ±")[0])


def test_a_speed_that_is_right_is_called_so_and_one_that_is_not_by_how_much(petrel: Vehicle, given: Inputs) -> None:
    time = given.records["time"]
    for factor in (1.0, 0.5):
        stored = conform(given.records[["time"]].assign(speed=factor * 0.5, vertical_speed=0.0), STORED)
        row = of(closures(replace(given, stored=stored)), "stored")
        assert row["beta"] == pytest.approx(1.0 / factor - 1.0, abs=0.03)
        if factor == 1.0:
            low, high = (100.0 * (row["beta"] + side * row["beta_std"]) for side in (-2.0, 2.0))
            words = f"no error seen: may have to change by {low:+.0f} to {high:+.0f} %"
            assert row["verdict"] == words.replace("-", "−")
        else:
            assert said(row["verdict"], "too slow: must rise by ") == pytest.approx(100.0, abs=3.0)
        assert row["passages"] == 5
        assert row["label"] == "independent"
    assert len(time) == len(given.estimates)


def test_too_fast_is_not_too_slow(given: Inputs) -> None:
    stored = conform(given.records[["time"]].assign(speed=1.0, vertical_speed=0.0), STORED)
    made = closures(replace(given, stored=stored))
    assert said(of(made, "stored")["verdict"], "too fast: must fall by ") == pytest.approx(50.0, abs=1.5)
    assert any("the vehicle's own stored model is too fast" in sentence for sentence in made["sentences"])


def test_horizontal_is_what_vertical_leaves(given: Inputs) -> None:
    stored = conform(given.records[["time"]].assign(speed=0.5, vertical_speed=0.3), STORED)
    assert of(closures(replace(given, stored=stored)), "stored")["speed_m_s"] == pytest.approx(0.4, abs=0.01)


def test_an_estimate_that_used_the_fixes_is_not_tested_by_them(given: Inputs) -> None:
    used = replace(given, estimate={**given.estimate, "used": {"fixes": True, "speed_sensor": False}})
    row = of(closures(used), "kinematic")
    assert row["label"] == "circular"
    assert not any("kinematic" in sentence for sentence in closures(used)["sentences"])
    unused = replace(given, estimate={**given.estimate, "used": {"fixes": False, "speed_sensor": False}})
    assert of(closures(unused), "kinematic")["label"] == "independent"


def test_a_compass_that_is_off_is_named_once(given: Inputs) -> None:
    turned = given.records.assign(heading=(given.records["heading"] - 0.5) % 6.28)
    sentences = [text for text in closures(replace(given, records=turned))["sentences"] if "headings" in text]
    assert len(sentences) == 1
    assert "degrees clockwise of those logged" in sentences[0]


def test_every_passage_says_what_each_model_lacks(given: Inputs, found: dict[str, Any]) -> None:
    assert len(found["passages"]) == 5
    first = found["passages"][0]["models"]["kinematic"]
    assert first["direction_deg"] == pytest.approx(np.degrees(1.3), abs=0.3)
    assert first["speed_m_s"] == pytest.approx(0.6 * np.cos(0.5), rel=2e-3)
    start = seconds(given.records["time"])[0]
    assert found["passages"][0]["start"].startswith(str(np.datetime64(int(start), "s"))[:13])


def test_without_fixes_the_reason_stands_in_place_of_numbers(petrel: Vehicle) -> None:
    bare = inputs(Mission(vehicle="petrel-ii", name="bare"), petrel, blocks(dives=2))
    said = closures(bare)
    assert said["reason"] == "fewer than two fixes"
    assert said["models"] == said["passages"] == said["sentences"] == []
    assert closure(said) is None


def test_one_heading_is_not_determined_and_drawn_so(given: Inputs) -> None:
    table = with_fixes(given.records.assign(dive=given.records["dive"]))
    straight = replace(given, records=table.assign(heading=1.0))
    row = of(closures(straight), "kinematic")
    assert row["verdict"].startswith("not determined: ")
    picture = closure(closures(straight))
    assert picture is not None
    assert "not determined" in picture.alt


def test_the_page_has_the_table_and_the_figure(built: tuple[dict[str, Any], str]) -> None:
    summary, text = built[0], built[1]
    words = section(text, "closure")
    assert "kinematic estimate" in words
    assert page.number(100 * of(summary["closure"], "kinematic")["beta"], 1, sign=True) in words
    picture = closure(summary["closure"])
    assert picture is not None
    assert picture.table is not None
    assert len(picture.table.frame) == 5 * len(summary["closure"]["models"])

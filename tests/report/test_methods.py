"""The methods paragraph says what was run, and cites it, no more."""

from dataclasses import replace

import pytest
from synthetic import blocks, inputs

from pipeline.mission import Mission, Water
from pipeline.records import Quality
from pipeline.report import build
from pipeline.report.figures.water import water as water_column
from pipeline.report.methods import WORKS
from pipeline.vehicle import load


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("mission.yaml", "Ballast is taken from mission.yaml, ± 1.0 N."),
        ("logs", "Mass and volume of the hull are taken from the logs' constants, ± 1.0 N."),
        (
            "assumed",
            "Nothing tells the volume of the hull: it is taken as neutral, engine at zero, in the mean density met, "
            "± 1.0 N.",
        ),
    ],
)
def test_ballast_is_said_to_be_from_where_it_is(petrel, mission, source, words):
    ballast = {"mass": 70.0, "volume": 0.068, "std": 1.0, "source": source}
    assert words in build(inputs(mission, petrel, blocks(dives=2), estimate={"ballast": ballast}))[0]["borrowed"]


def test_water_that_was_lent_is_not_called_measured(petrel):
    water = Water(density=1028.9, std=0.5, source="a cast of last year")
    lent = Mission(vehicle="petrel-ii", name="x", water=water)
    given = inputs(lent, petrel, blocks(dives=2))
    dry = replace(given, records=given.records.assign(absolute_salinity=float("nan")))
    summary = build(dry)[0]
    assert (
        "No conductivity was measured; in-situ density was taken as 1028.9 kg/m³ at the surface and 0.0045 kg/m³ more "
        "per dbar, ± 0.5 kg/m³ (a cast of last year); depth and pitch were not interpolated."
    ) in summary["methods"]
    assert any("engine volume and a density that mission.yaml lends." in line for line in summary["borrowed"])
    warm = dry.records.assign(temperature_qc=int(Quality.MISSING))
    picture = water_column(warm, dry.estimates)
    assert picture is not None
    assert picture.caption == "Measured depth against time; no temperature was measured."
    assert picture.table.frame["temperature"].isna().all()
    measured = build(replace(given, records=given.records.assign(absolute_salinity=35.0)))[0]
    assert "In-situ density follows from TEOS-10 (McDougall and Barker, 2011)" in measured["methods"]
    assert any("engine volume and the measured density." in line for line in measured["borrowed"])
    assert WORKS["McDougall and Barker"] in measured["citations"]
    assert WORKS["McDougall and Barker"] not in summary["citations"]


def test_only_works_that_are_named_are_cited(petrel, mission):
    alone = inputs(mission, petrel, blocks(dives=2))
    without = build(replace(alone, force=alone.force.iloc[:0]))[0]
    assert WORKS["Maine and Iliff"] not in without["citations"]
    assert WORKS["Eriksen et al."] not in without["citations"]
    assert WORKS["Niu et al."] in without["citations"]
    sg = build(inputs(mission, load("seaglider"), blocks(dives=2)))[0]
    assert WORKS["Eriksen et al."] in sg["citations"]

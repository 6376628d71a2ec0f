"""Missions that hold too little: each has its page, its row on the index, and a sentence that says what is missing."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import pipeline
from pipeline.findings import InputError
from pipeline.report import index

#: A vehicle whose lift and drag nobody knows.
BARE = Path(__file__).with_name("bare.yaml")
HEAD = "latitude: 18.0\nlongitude: 112.5\nballast: {neutral_density: 1025.0}\n"


def write(folder: Path, *, vehicle: str = "petrel-ii", dives: int = 1, sway_deg: float = 0.0, rows: int = -1) -> Path:
    """Write yos to 60 m in plain tables, without fixes; the pitch may sway, and records may be cut off."""
    folder.mkdir(parents=True)
    (folder / "mission.yaml").write_text(f"vehicle: {vehicle}\n{HEAD}", encoding="utf-8")
    if vehicle == BARE.name:
        shutil.copyfile(BARE, folder / vehicle)
    time = np.arange(0.0, 800.0 * dives + 40.0, 2.0)
    turns = [turn for k in range(dives) for turn in ((800.0 * k, 0.2), (800.0 * k + 400.0, 60.0))]
    depth = np.interp(time, *zip(*turns, (800.0 * dives, 0.2), (800.0 * dives + 40.0, 0.2), strict=True))
    pitch = np.interp(time % 800.0, [0.0, 390.0, 410.0, 790.0, 800.0], [-25.0, -25.0, 25.0, 25.0, 0.0])
    pitch += sway_deg * np.sin(2.0 * np.pi * time / 40.0)
    stamps = pd.Timestamp("2015-02-11T03:00:00Z") + pd.to_timedelta(time, unit="s")
    logs = {
        "ctd.csv": {
            "pressure [dbar]": depth,
            "temperature [degC]": 20.0 - 0.05 * depth,
            "conductivity [S/m]": 4.8 - 0.005 * depth,
        },
        "attitude.csv": {"pitch [deg]": pitch},
        "engine.csv": {"buoyancy volume [cc]": np.where(pitch < 0.0, -250.0, 250.0)},
    }
    for name, columns in logs.items():
        table = pd.DataFrame({"time": stamps.strftime("%Y-%m-%dT%H:%M:%SZ"), **columns})
        table.iloc[: rows if rows >= 0 else None].to_csv(folder / name, index=False)
    return folder


#: How each is written, and what its page says.
POOR: dict[str, tuple[dict[str, Any], str]] = {
    "no-steady-block": ({"sway_deg": 12.0}, "the records hold no stretch of steady flight"),
    "one-dive": ({}, "No correction is fitted: 2 steady blocks for 2 corrections: at least 3 are needed"),
    "unknown-coefficients": ({"vehicle": BARE.name, "dives": 2}, "unknown"),
}


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> dict[str, pipeline.Trial]:
    place = tmp_path_factory.mktemp("poor")
    return {name: pipeline.analyse(write(place / name, **how), threads=1) for name, (how, _words) in POOR.items()}


@pytest.mark.parametrize("name", POOR)
def test_the_page_is_made_and_says_what_is_missing(trials: dict[str, pipeline.Trial], name: str) -> None:
    trial, words = trials[name], POOR[name][1]
    text = trial.report().text
    assert words in text
    assert text.rstrip().endswith("</html>")
    sentence = trial.summary["answer"]["sentence"]
    assert sentence
    assert "\n" not in sentence
    assert trial.summary["gps"] is None or not trial.summary["gps"].get("legs")


def test_blocks_that_were_found_and_cannot_be_used_are_not_said_to_be_missing(
    trials: dict[str, pipeline.Trial],
) -> None:
    trial = trials["unknown-coefficients"]
    found, text = trial.summary["blocks"]["total"], trial.report().text
    assert found > 0
    why = f"none of {found} steady blocks is used, speed unobservable: lift and drag of the vehicle are not known"
    assert trial.summary["fit"]["reason"] == why
    assert f"What may be wrong cannot be ranked: {why}." in text
    sentence = trial.summary["answer"]["sentence"]
    assert sentence.endswith("compared: the speed is unobservable: lift and drag of the vehicle are not known.")
    assert "No figure here: no part of the mission has a speed, measured or by theory." in text
    assert "Orange: theory" not in text
    assert "Orange: theory" in trials["one-dive"].report().text


def test_the_index_has_a_row_of_each_and_a_verdict_for_each_vehicle(trials: dict[str, pipeline.Trial]) -> None:
    made = index([trial.summary for trial in trials.values()])
    assert [row["mission"] for row in made.content["missions"]] == list(POOR)
    assert made.content["missions"][0]["flags"]["blocks"] == "no steady block is used"
    assert all(vehicle["reason"].startswith("cannot be said") for vehicle in made.content["vehicles"])


def test_a_mission_without_a_record_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        pipeline.analyse(write(tmp_path / "empty", rows=0))
    assert "\n" not in str(error.value)
    assert "found a header and no records" in str(error.value)

"""The closure on simulated missions: current, surface drift, noisy fixes and compass, speed wrong by a known factor."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from pipeline.records import RECORDS, conform, seconds, timestamps
from pipeline.report.fitting.closure import Closure, close
from pipeline.report.fitting.passages import find, through_water
from pipeline.simulate import run
from pipeline.trials import trial

#: Horizontal speeds that are handed to the closure, as a share of the true ones.
FACTORS = (0.6, 1.0, 1.25)


def flown(seed: int) -> list[Closure]:
    """Return what the closure says of each of `FACTORS` on one mission of six dives on four headings."""
    plan = trial("petrel2-scs-2014")
    stages = tuple(replace(stage, value=250.0) if stage.end == "deeper" else stage for stage in plan.stages)
    made = run(replace(plan, stages=stages, nominal_depth=150.0), seed)
    streams = [
        made.streams["ctd"][["time", "pressure"]].assign(pressure_qc=1),
        made.streams["attitude"][["time", "heading"]].assign(heading_qc=1),
        made.streams["gps"].assign(latitude_qc=1, longitude_qc=1),
    ]
    table = pd.concat(streams, ignore_index=True).sort_values("time", kind="stable", ignore_index=True)
    table["time"], table["depth"] = timestamps(table["time"].to_numpy()), table["pressure"] / 1.012
    for name in ("pressure_qc", "heading_qc", "latitude_qc", "longitude_qc"):
        table[name] = table[name].fillna(9).astype(np.int8)
    passages = find(conform(table, RECORDS))
    assert passages.count == 6
    truth = made.truth
    horizontal = (truth["speed"] * np.cos(truth["path_angle"])).to_numpy()
    return [close(passages, through_water(passages, seconds(truth["time"]), factor * horizontal)) for factor in FACTORS]


@pytest.fixture(scope="module")
def missions() -> list[list[Closure]]:
    return [flown(seed) for seed in range(8)]


def test_the_factor_on_the_speed_is_recovered_within_its_interval(missions: list[list[Closure]]) -> None:
    pulls = np.array(
        [
            [(found.beta - (1.0 / factor - 1.0)) / found.beta_std for found, factor in zip(row, FACTORS, strict=True)]
            for row in missions
        ]
    )
    assert np.isfinite(pulls).all()
    assert np.mean(np.abs(pulls) < 1.96) > 0.7, "of 8 missions; more of them are drawn in test_gps_closure"
    assert np.all(np.abs(pulls) < 3.5)
    assert np.all(np.abs(pulls.mean(axis=0)) < 1.1)


def test_speeds_wrong_by_a_quarter_and_more_are_found_out_and_right_ones_are_not(missions: list[list[Closure]]) -> None:
    ratio = np.array([[found.beta / found.beta_std for found in row] for row in missions])
    assert np.all(ratio[:, 0] > 2.0)
    assert np.all(ratio[:, 2] < -2.0)
    assert np.mean(np.abs(ratio[:, 1]) < 2.0) > 0.8


def test_the_compass_is_right_within_its_interval(missions: list[list[Closure]]) -> None:
    pulls = np.array([row[1].turn / row[1].turn_std for row in missions])
    assert np.mean(np.abs(pulls) < 1.96) > 0.7

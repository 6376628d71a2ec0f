"""Phases, dives and blocks of flights whose phases are known."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.ingest.phases import sampled_seldom, with_phases
from pipeline.records import Phase

Fly = Callable[..., object]
TableOf = Callable[[object], pd.DataFrame]


def _spans(table: pd.DataFrame) -> pd.Series:
    blocks = table[table["block"] >= 0].groupby("block")["time"]
    return blocks.max() - blocks.min()


@pytest.mark.parametrize(
    ("depths", "step", "speed"),
    [
        ([0.0, *[40.0, 2.0] * 6, 0.0], 1.0, 0.35),
        ([0.0, *[40.0, 2.0] * 6, 0.0], 4.0, 0.35),
        ([2.0, *[12.0, 2.0] * 10], 1.0, 0.3),
        ([0.0, 1000.0, 0.0], 5.0, 0.3),
        ([0.0, 1000.0, 0.0, 1000.0, 0.0], 60.0, 0.3),
    ],
    ids=["40 m at 1 s", "40 m at 4 s", "10 m yos", "1000 m at 5 s", "1000 m at 60 s"],
)
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_every_leg_is_found_and_every_dive_counted(
    fly: Fly, table_of: TableOf, depths: list[float], step: float, speed: float, noise: float
) -> None:
    table = table_of(fly(depths, step=step, speed=speed))
    true = np.sign(np.gradient(table["depth"]))
    table["depth"] += np.random.default_rng(3).normal(0.0, noise, len(table))
    found = with_phases(table)
    moving = found["phase"].isin([Phase.ASCENT, Phase.DESCENT])
    assert moving.mean() > 0.8
    sense = np.where(found["phase"] == Phase.DESCENT, 1, -1)[moving]
    assert (sense == true[moving]).mean() > 0.99
    assert found["dive"].max() == sum(b > a for a, b in pairwise(depths))
    assert (np.diff(found["dive"]) >= 0).all()


def test_dives_of_a_few_samples_are_told(fly: Fly, table_of: TableOf) -> None:
    def told(step: float, depth: float) -> list[str]:
        return [str(each) for each in sampled_seldom(with_phases(table_of(fly([0.0, *[depth, 2.0] * 8], step=step))))]

    seldom = told(60.0, 40.0)
    assert [line.split(" samples")[0].rstrip("0123456789.") for line in seldom] == [
        "mission: depth: found ",
        "mission: pitch: found ",
    ]
    assert all(
        line.endswith(
            "in a dive and its climb (median); expected 10 or more; what was flown between them is guessed, and the "
            "intervals may be too narrow; if the vehicle has recorded more than it sent home, use that"
        )
        for line in seldom
    )
    assert told(4.0, 40.0) == told(60.0, 500.0) == []
    assert sampled_seldom(with_phases(table_of(fly([0.0, 40.0, 0.0], step=60.0))).assign(dive=0)) == []


def test_shallow_dives_of_two_minutes_have_blocks_of_a_minute_or_more(fly: Fly, table_of: TableOf) -> None:
    found = with_phases(table_of(fly([0.0, *[40.0, 5.0] * 8, 0.0], speed=0.6)))
    spans = _spans(found)
    assert 15 <= len(spans) <= 16
    assert spans.min() >= 60.0
    assert spans.max() < 140.0


def test_deep_dives_with_a_slow_ctd_have_equal_blocks_of_about_the_length_asked_for(
    fly: Fly, table_of: TableOf
) -> None:
    table = table_of(fly([0.0, 1000.0, 0.0], step=5.0, speed=0.3))
    sparse = np.arange(len(table)) % 12 != 0
    table.loc[sparse, ["depth", "pressure"]] = np.nan
    spans = _spans(with_phases(table))
    assert len(spans) == pytest.approx(2 * 7890 / 300, abs=3)
    assert spans.min() > 280.0
    assert spans.max() < 320.0


@pytest.mark.parametrize("block_s", [60.0, 100.0, 300.0, 1000.0])
@pytest.mark.parametrize("minimum", [30.0, 60.0, 240.0])
def test_no_block_is_shorter_than_the_minimum(fly: Fly, table_of: TableOf, block_s: float, minimum: float) -> None:
    spans = _spans(with_phases(table_of(fly([0.0, *[100.0, 5.0] * 2])), block_s=block_s, minimum_block_s=minimum))
    assert len(spans)
    assert spans.min() >= minimum


def test_a_block_lies_within_one_leg_away_from_its_turning_points(fly: Fly, table_of: TableOf) -> None:
    found = with_phases(table_of(fly([0.0, *[80.0, 5.0] * 4])))
    blocks = found[found["block"] >= 0].groupby("block")
    assert (blocks["phase"].min() == blocks["phase"].max()).all()
    assert (blocks["pitch"].agg(np.ptp) < 1e-9).all()
    assert (blocks["dive"].min() == blocks["dive"].max()).all()


def test_a_move_of_the_engine_or_of_the_pitch_in_the_middle_of_a_dive_parts_the_blocks(
    fly: Fly, table_of: TableOf
) -> None:
    table = table_of(fly([0.0, 200.0], speed=0.4))
    middle = len(table) // 2
    whole = with_phases(table, block_s=1e4)
    assert whole["block"].max() == 0
    for column, change in (("buoyancy_volume", 30e-6), ("pitch", 0.1)):
        moved = table.copy()
        moved.loc[middle:, column] += change
        if column == "buoyancy_volume":
            moved.loc[:100, column] -= 100e-6
        found = with_phases(moved, block_s=1e4)
        assert (found["block"].iloc[middle - 10 : middle + 20] == -1).all()
        assert found["block"].iloc[middle - 60] != found["block"].iloc[middle + 60]


def test_a_gap_in_the_pitch_is_no_steady_flight(fly: Fly, table_of: TableOf) -> None:
    table = table_of(fly([0.0, 200.0], speed=0.4))
    table.loc[500:800, "pitch"] = np.nan
    found = with_phases(table)
    assert (found["block"].iloc[500:800] == -1).all()
    assert found["block"].max() >= 1


def test_a_gap_of_hours_parts_the_record_and_the_count_of_dives_goes_on(fly: Fly, table_of: TableOf) -> None:
    one = table_of(fly([5.0, 100.0, 5.0]))
    two = one.assign(time=one["time"] + 7200.0)
    found = with_phases(pd.concat([one, two], ignore_index=True))
    assert found["dive"].iloc[0] == 1
    assert found["dive"].iloc[-1] == 2


def test_a_dive_interrupted_by_a_silent_ctd_stays_one_dive(fly: Fly, table_of: TableOf) -> None:
    table = table_of(fly([0.0, 400.0, 0.0], speed=0.3))
    time = table["time"] - table["time"].iloc[0]
    table.loc[(time > 800) & (time < 2000), ["depth", "pressure"]] = np.nan
    found = with_phases(table)
    assert found["dive"].max() == 1
    assert (found.loc[(time > 900) & (time < 1900), "phase"] == Phase.UNKNOWN).all()


def _level(*, powered: bool) -> pd.DataFrame:
    """Return a dive to 10 m, an hour level there at 3.5° with a slow wander, and the way up."""
    time = np.arange(0.0, 3900.0)
    depth = np.interp(time, [0.0, 150.0, 3750.0, 3900.0], [0.0, 10.0, 10.0, 0.0])
    depth += np.where((time > 150) & (time < 3750), 0.4 * np.sin(2 * np.pi * time / 200.0), 0.0)
    depth += np.random.default_rng(5).normal(0.0, 0.03, time.size)
    pitch = np.radians(np.interp(time, [0.0, 140.0, 160.0, 3740.0, 3760.0], [-15.0, -15.0, 3.5, 3.5, 15.0]))
    table = pd.DataFrame({"time": time + 1.5e9, "pressure": depth, "depth": depth, "pitch": pitch})
    return table.assign(propeller_speed=13.0 if powered else 0.0, buoyancy_volume=250e-6)


def test_level_flight_under_power_is_propelled_and_steady_without_any_yo() -> None:
    found = with_phases(_level(powered=True))
    middle = found["phase"].iloc[300:3600]
    assert (middle == Phase.PROPELLED).all()
    assert found["phase"].iloc[60] == Phase.DESCENT
    assert found["phase"].iloc[3820] == Phase.ASCENT
    assert found["dive"].max() == 1
    assert (found["block"].iloc[300:3600] >= 0).mean() > 0.95
    assert found["block"].iloc[300:3600].nunique() == pytest.approx(12, abs=1)


def test_a_turn_of_heading_parts_level_flight() -> None:
    table = _level(powered=True)
    time = table["time"].to_numpy() - 1.5e9
    table["heading"] = np.mod(np.radians(np.interp(time, [1900.0, 1960.0], [350.0, 530.0])), 2 * np.pi)
    found = with_phases(table)
    assert (found["block"].iloc[1900:1960] == -1).all()
    assert found["block"].iloc[1800] != found["block"].iloc[2100]


def test_level_without_power_is_parking_and_no_steady_flight() -> None:
    found = with_phases(_level(powered=False))
    assert (found["phase"].iloc[300:3600] == Phase.PARKING).all()
    assert (found["block"].iloc[300:3600] == -1).all()


def test_a_powered_climb_is_an_ascent(fly: Fly, table_of: TableOf) -> None:
    found = with_phases(table_of(fly([0.0, 200.0, 0.0], speed=1.2, pitch_deg=45.0)).assign(propeller_speed=23.3))
    assert Phase.PROPELLED not in found["phase"].to_numpy()
    assert (found["phase"] == Phase.ASCENT).sum() > 200


def test_drifting_at_the_surface_is_surfacing(fly: Fly, table_of: TableOf) -> None:
    dive = table_of(fly([0.0, 60.0, 0.0]))
    start = dive["time"].iloc[-1]
    drift = pd.DataFrame({"time": start + np.arange(1.0, 600.0), "depth": 0.3, "pressure": 0.3, "pitch": -0.6})
    drift["depth"] += np.random.default_rng(2).normal(0.0, 0.1, len(drift))
    again = dive.assign(time=dive["time"] - dive["time"].iloc[0] + drift["time"].iloc[-1] + 1.0)
    found = with_phases(pd.concat([dive, drift, again], ignore_index=True))
    at_surface = found[(found["time"] > start + 30) & (found["time"] < start + 570)]
    assert (at_surface["phase"] == Phase.SURFACING).all()
    assert (at_surface["block"] == -1).all()
    assert found["dive"].max() == 2


def test_without_depth_nothing_is_known() -> None:
    table = pd.DataFrame({"time": np.arange(100.0), "depth": np.nan, "pitch": 0.1})
    found = with_phases(table)
    assert (found["phase"] == Phase.UNKNOWN).all()
    assert (found["dive"] == 0).all()
    assert (found["block"] == -1).all()


MIRRORED = {Phase.ASCENT: Phase.DESCENT, Phase.DESCENT: Phase.ASCENT}


@given(
    st.lists(st.floats(15.0, 60.0), min_size=1, max_size=5),
    st.floats(0.25, 0.6),
    st.floats(15.0, 40.0),
    st.integers(0, 2**32 - 1),
)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_mission_mirrored_in_depth_and_pitch_has_mirrored_phases_and_the_same_blocks(
    fly: Fly, table_of: TableOf, heights: list[float], speed: float, pitch: float, seed: int
) -> None:
    depths = [150.0]
    for k, height in enumerate(heights):
        depths.append(depths[-1] + (height if k % 2 else -height))
    table = table_of(fly(depths, speed=speed, pitch_deg=pitch))
    noise = np.random.default_rng(seed).normal(0.0, 0.02, len(table))
    table["depth"] += noise
    mirror = table.assign(
        depth=300.0 - table["depth"], pitch=-table["pitch"], buoyancy_volume=-table["buoyancy_volume"]
    )
    one, two = with_phases(table), with_phases(mirror)
    assert [MIRRORED.get(Phase(p), Phase(p)) for p in one["phase"]] == two["phase"].tolist()
    assert one["block"].tolist() == two["block"].tolist()

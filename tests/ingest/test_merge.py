"""Merge: the union of the clocks, and nothing more."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.findings import InputError
from pipeline.ingest import merge
from pipeline.mission import PitchCorrection
from pipeline.records import Quality

NAMES = ["pressure", "pitch", "roll", "temperature"]
values = st.one_of(st.just(float("nan")), st.floats(-1e3, 1e3))


@st.composite
def streams(draw: st.DrawFn) -> list[pd.DataFrame]:
    """Return up to four instruments with quantities of their own, on clocks that may share instants."""
    out = []
    for name in draw(st.lists(st.sampled_from(NAMES), unique=True, min_size=1, max_size=4)):
        times = sorted(draw(st.lists(st.integers(0, 40), unique=True, min_size=1, max_size=20)))
        column = draw(st.lists(values, min_size=len(times), max_size=len(times)))
        frame = pd.DataFrame({"time": np.array(times, dtype=float) + 1.5e9, name: column})
        frame[f"{name}_qc"] = np.where(frame[name].isna(), Quality.MISSING, Quality.GOOD).astype(np.int8)
        out.append(frame)
    return out


@given(streams())
@settings(deadline=None)
def test_no_measurement_is_lost_or_invented_and_every_one_keeps_its_instant(instruments: list[pd.DataFrame]) -> None:
    table, _ = merge.merged(instruments)
    assert (np.diff(table["time"]) > 0).all()
    for frame in instruments:
        name = frame.columns[1]
        expected = frame.dropna(subset=[name])
        found = table.dropna(subset=[name])
        assert found["time"].tolist() == expected["time"].tolist()
        assert found[name].tolist() == expected[name].tolist()
        assert (found[f"{name}_qc"] == Quality.GOOD).all()
        assert (table.loc[table[name].isna(), f"{name}_qc"] == Quality.MISSING).all()
    measured = table[[frame.columns[1] for frame in instruments]]
    assert measured.notna().any(axis=1).all()


def test_instruments_at_one_instant_share_a_row() -> None:
    table, findings = merge.merged(
        [
            pd.DataFrame({"time": [0.0, 1.0, 2.0], "pressure": [0.0, 1.0, 2.0]}),
            pd.DataFrame({"time": [1.0, 1.5], "pitch": [0.1, 0.2]}),
        ]
    )
    expected = pd.DataFrame(
        {
            "time": [0.0, 1.0, 1.5, 2.0],
            "pressure": [0.0, 1.0, np.nan, 2.0],
            "pitch": [np.nan, 0.1, 0.2, np.nan],
        }
    )
    pd.testing.assert_frame_equal(table, expected)
    assert findings == []


def _pair(ctd: list[float], flight: list[float]) -> list[pd.DataFrame]:
    time = np.arange(float(len(flight)))
    one = pd.DataFrame({"time": time[: len(ctd)], "pressure": ctd, "temperature": 10.0, "conductivity": 3.5})
    one.attrs = {"name": "ctd.csv"}
    other = pd.DataFrame({"time": time + 0.5, "pressure": flight, "pitch": 0.1})
    other.attrs = {"name": "flight.csv"}
    return [other, one]


def test_pressure_of_the_ctd_is_taken_for_the_whole_mission_and_that_is_said() -> None:
    table, findings = merge.merged(_pair([1.0, 2.0, 3.0], [1.1, 2.1, 3.1]))
    assert table["pressure"].dropna().tolist() == [1.0, 2.0, 3.0]
    assert [str(finding) for finding in findings] == [
        "flight.csv: pressure: found 3 values of pressure; not used: ctd.csv has it too"
    ]


def test_pressure_of_the_flight_computer_is_taken_where_the_ctd_has_none() -> None:
    table, findings = merge.merged(_pair([np.nan] * 3, [1.1, 2.1, 3.1]))
    assert table["pressure"].dropna().tolist() == [1.1, 2.1, 3.1]
    assert findings == []


def test_a_ctd_that_sleeps_on_the_climbs_does_not_hide_them() -> None:
    table, findings = merge.merged(_pair(list(range(300)), list(range(600))))
    assert table["pressure"].count() == 600
    assert str(findings[0]) == "ctd.csv: pressure: found 300 values of pressure; not used: flight.csv has it too"


def test_a_ctd_that_sleeps_at_the_surface_is_the_one() -> None:
    """Ten minutes afloat before a dive of five."""
    flight = [0.1] * 600 + list(range(300))
    asleep = [np.nan] * 600 + list(range(300))
    table, _ = merge.merged(_pair(asleep, flight))
    assert table["pressure"].count() == 300


def test_a_receivers_own_fixes_go_before_those_among_reckoned_positions() -> None:
    time = np.arange(100.0)
    reckoned = pd.DataFrame(
        {"time": time, "latitude": 45.0, "longitude": 10.0, "temperature": 9.0, "conductivity": 3.0}
    )
    for name in ("latitude_qc", "longitude_qc"):
        reckoned[name] = np.where(time < 20.0, Quality.GOOD, Quality.BAD).astype(np.int8)
    fixes = pd.DataFrame({"time": [0.5, 90.5], "latitude": 45.1, "longitude": 10.1})
    fixes = fixes.assign(latitude_qc=np.int8(Quality.GOOD), longitude_qc=np.int8(Quality.GOOD))
    table, _ = merge.merged([reckoned, fixes])
    assert table["latitude"].dropna().tolist() == table["longitude"].dropna().add(35.0).tolist() == [45.1, 45.1]


def test_the_std_of_a_speed_comes_from_the_same_sensor_as_the_speed() -> None:
    dvl = pd.DataFrame(
        {"time": [0.0, 1.0], "speed_through_water": [0.3, 0.4], "speed_through_water_std": [0.01, np.nan]}
    )
    other = pd.DataFrame({"time": [0.5], "speed_through_water": [0.9], "speed_through_water_std": [0.9]})
    table, _ = merge.merged([other, dvl])
    assert table["speed_through_water"].tolist() == [0.3, 0.4]
    assert table["speed_through_water_std"].tolist()[0] == 0.01


def test_the_pitch_correction_is_applied_and_noted() -> None:
    table = pd.DataFrame({"time": [0.0, 1.0], "pitch": [0.5, np.nan]})
    found, notes = merge.with_pitch_correction(table, PitchCorrection(scale=0.86, offset_rad=-0.004))
    assert found["pitch"][0] == pytest.approx(0.426)
    assert [str(note) for note in notes] == ["mission.yaml: pitch: found pitch = 0.86 · logged -0.004 rad"]
    assert merge.with_pitch_correction(table, PitchCorrection())[1] == []


def _dives() -> pd.DataFrame:
    return pd.DataFrame({"dive": [0, 1, 1, 2, 2, 3], "block": [-1, 0, 1, 2, -1, 3]}).astype("int32")


def test_selected_dives_keep_their_numbers_and_their_blocks_begin_at_zero() -> None:
    found, notes = merge.selected(_dives(), (2, 3))
    assert found["dive"].tolist() == [2, 2, 3]
    assert found["block"].tolist() == [0, -1, 1]
    assert [str(note) for note in notes] == ["mission.yaml: dives: found dives 2 to 3 selected, 3 of 6 rows"]
    pd.testing.assert_frame_equal(merge.selected(_dives(), None)[0], _dives())


def test_dives_that_are_not_there_are_refused() -> None:
    with pytest.raises(InputError) as error:
        merge.selected(_dives(), (5, 9))
    assert str(error.value) == (
        "mission.yaml: dives: found 5 to 9; expected dives from 1 to 3; correct dives: or leave it out"
    )

"""Clocks: which records go, which stay, and what is said about it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.findings import InputError
from pipeline.ingest.clock import cleaned, longest_increase, overlapping, pausing, shifted

START = 1.5e9


def _frame(time: list[float]) -> pd.DataFrame:
    return pd.DataFrame({"time": time, "pitch": np.arange(float(len(time)))})


def test_a_clean_clock_is_left_as_it_is() -> None:
    frame, findings = cleaned(_frame([START, START + 1.25, START + 2.5]), "ctd.csv")
    assert frame["time"].tolist() == [START, START + 1.25, START + 2.5]
    assert findings == []


def test_garbage_times_are_dropped_and_the_first_is_named() -> None:
    frame, findings = cleaned(_frame([START, 1e103, START + 1, np.nan, 0.0, START + 2]), "01330005.ecd")
    assert frame["pitch"].tolist() == [0.0, 2.0, 5.0]
    assert [str(finding) for finding in findings] == [
        "01330005.ecd: record 4: found no time; expected a time; left out",
        "01330005.ecd: record 2: found an absurd time (1e+103), and 2 of 6 records like it; "
        "expected a time from 1990 to 2100; left out",
    ]


def test_times_that_go_backwards_are_dropped_and_counted() -> None:
    frame, findings = cleaned(_frame([START, START + 1, START + 1.5, START - 50, START - 49, START + 2]), "ctd.csv")
    assert frame["pitch"].tolist() == [0.0, 1.0, 2.0, 5.0]
    assert [str(finding) for finding in findings] == [
        "ctd.csv: record 4: found a time that goes backwards (2017-07-14T02:39:10Z), and 2 of 6 records like it; "
        "expected times that increase; left out"
    ]


def test_one_time_far_ahead_costs_that_record_and_not_all_that_follow() -> None:
    frame, findings = cleaned(_frame([START, START + 1, START + 1e6, START + 2, START + 3]), "ctd.csv")
    assert frame["pitch"].tolist() == [0.0, 1.0, 3.0, 4.0]
    assert len(findings) == 1


def test_records_of_one_instant_become_one_that_loses_nothing() -> None:
    frame = pd.DataFrame(
        {
            "time": [START, START + 1, START + 1 + 1e-8, START + 2],
            "pitch": [0.1, np.nan, 0.2, 0.3],
            "roll": [1.0, 1.1, 1.2, 1.3],
        }
    )
    found, findings = cleaned(frame, "attitude.csv")
    assert found["pitch"].tolist() == [0.1, 0.2, 0.3]
    assert found["roll"].tolist() == [1.0, 1.1, 1.3]
    assert [str(finding) for finding in findings] == [
        "attitude.csv: record 3: found a time that repeats (2017-07-14T02:40:01Z); expected one record an instant; "
        "merged into one record"
    ]


@given(st.lists(st.integers(0, 30), max_size=40))
def test_what_is_kept_is_in_order_and_as_much_as_can_be(values: list[int]) -> None:
    kept = np.array(values, dtype=np.int64)[longest_increase(np.array(values, dtype=np.int64))]
    assert (np.diff(kept) >= 0).all()
    best = [1] * len(values)
    for i, value in enumerate(values):
        best[i] = 1 + max((best[j] for j in range(i) if values[j] <= value), default=0)
    assert kept.size == max(best, default=0)


@given(st.lists(st.one_of(st.floats(), st.floats(1.0e9, 1.1e9)), min_size=1, max_size=40))
def test_whatever_the_times_the_result_increases_strictly(time: list[float]) -> None:
    frame, findings = cleaned(_frame(time), "x.csv")
    assert (np.diff(frame["time"]) > 0).all()
    untouched = len(frame) == len(time) and (np.diff(time) > 0).all()
    assert untouched != bool(findings)


def test_a_table_written_in_another_order_is_sorted_and_loses_nothing() -> None:
    time = np.arange(1.5e9, 1.5e9 + 100.0)
    shuffled = np.random.default_rng(3).permutation(time)
    for written in (time[::-1], np.r_[time[60:], time[:60]], shuffled):
        found, findings = cleaned(_frame(written.tolist()), "ctd.csv")
        assert found["time"].tolist() == time.tolist()
        row = 2 + int(np.argmax(np.diff(written) < 0))
        assert [str(finding) for finding in findings] == [
            f"ctd.csv: record {row}: found records that are not in the order of time, 100 in all; "
            "expected times that increase; sorted by time"
        ]


def test_a_clock_that_is_set_back_is_not_sorted() -> None:
    time = np.r_[np.arange(1.5e9, 1.5e9 + 100.0), np.arange(1.5e9 + 50.5, 1.5e9 + 200.0)]
    found, findings = cleaned(_frame(time.tolist()), "ctd.csv")
    assert "goes backwards" in str(findings[0])
    assert len(found) == 201


def _streams() -> list[pd.DataFrame]:
    time = START + np.arange(3.0)
    ctd = pd.DataFrame({"time": time, "pressure": [1.0, 2.0, 3.0], "temperature": 10.0})
    flight = pd.DataFrame({"time": time, "pitch": [0.1, 0.2, 0.3], "roll": 0.0})
    ctd.attrs, flight.attrs = {"name": "ctd.csv"}, {"name": "attitude.csv"}
    return [ctd, flight]


def test_the_clock_of_the_ctd_alone_is_moved_and_no_value_changes() -> None:
    before = _streams()
    (ctd, flight), findings = shifted(before, -2.5)
    assert ctd["time"].tolist() == [START - 2.5, START - 1.5, START - 0.5]
    pd.testing.assert_frame_equal(ctd.drop(columns="time"), before[0].drop(columns="time"))
    pd.testing.assert_frame_equal(flight, before[1])
    assert ctd.attrs == {"name": "ctd.csv"}
    assert [str(finding) for finding in findings] == [
        "mission.yaml: clock_offset: found -2.5 s on the clock of ctd.csv",
    ]


def test_pressure_in_the_table_of_pitch_is_split_off_to_be_moved() -> None:
    _, flight = _streams()
    both = flight.assign(pressure=[1.0, np.nan, 3.0], pressure_qc=np.int8(1))
    both.attrs = {"name": "all.csv"}
    streams, _ = shifted([both], 4.0)
    assert [list(frame.columns) for frame in streams] == [
        ["time", "pitch", "roll"],
        ["time", "pressure", "pressure_qc"],
    ]
    assert streams[0]["time"].tolist() == flight["time"].tolist()
    assert [frame.attrs["name"] for frame in streams] == ["all.csv", "all.csv"]
    moved = streams[1].dropna(subset=["pressure"])
    assert moved["time"].tolist() == [START + 4.0, START + 6.0]
    assert moved["pressure"].tolist() == [1.0, 3.0]


def test_without_an_offset_the_streams_are_the_same_ones() -> None:
    streams = _streams()
    assert shifted(streams, 0.0) == (streams, [])


def _instrument(name: str, column: str, first: float, last: float) -> pd.DataFrame:
    frame = pd.DataFrame({"time": [first, 0.5 * (first + last), last], column: [1.0, 2.0, 3.0]})
    frame.attrs = {"name": name}
    return frame


def test_pitch_and_pressure_that_never_report_together_stop_the_mission() -> None:
    ctd = _instrument("ctd.csv", "pressure", START, START + 3600)
    with pytest.raises(InputError) as error:
        overlapping([ctd, _instrument("attitude.csv", "pitch", START + 7200, START + 10800)])
    assert str(error.value) == (
        "attitude.csv: time: found pitch from 2017-07-14T04:40:00Z to 2017-07-14T05:40:00Z, and pressure from "
        "2017-07-14T02:40:00Z to 2017-07-14T03:40:00Z in ctd.csv; expected records of the same time; "
        "correct the unit of time or the timezone of one of them under files: in mission.yaml"
    )


def test_an_instrument_that_reports_mostly_while_pressure_does_not_is_doubted() -> None:
    ctd = _instrument("ctd.csv", "pressure", START, START + 3600)
    attitude = _instrument("attitude.csv", "pitch", START, START + 3600)
    assert overlapping([ctd, attitude, _instrument("a.csv", "buoyancy_volume", START + 1700, START + 5300)]) == []
    engine = _instrument("engine.csv", "buoyancy_volume", START + 2700, START + 6300)
    assert [str(finding) for finding in overlapping([ctd, attitude, engine])] == [
        "engine.csv: time: found records from 2017-07-14T03:25:00Z to 2017-07-14T04:25:00Z, 25% of it while pressure "
        "reports; expected records of the same time; the rest cannot be analysed; if its clock is in another zone or "
        "unit, say so under files: in mission.yaml"
    ]


def test_a_pause_of_weeks_may_be_two_missions() -> None:
    day = 86400.0
    assert pausing(np.array([])) == pausing(np.array([START])) == pausing(START + np.array([0.0, 9.9 * day])) == []
    (finding,) = pausing(START + day * np.array([0.0, 12.0, 50.0, 50.1]))
    assert str(finding) == (
        "mission: time: found no records for 38 days from 2017-07-26T02:40:00Z to 2017-09-02T02:40:00Z, and 1 more "
        "such pause; expected one mission; ballast, drag and clocks are taken to be the same throughout: if these are "
        "two missions, give each a folder of its own"
    )
    assert finding.severity == "warning"

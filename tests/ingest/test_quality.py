"""Flags: each rule on data that break it, and none on data that do not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from pipeline.findings import Finding, InputError
from pipeline.ingest import quality
from pipeline.records import Quality


def _stream(name: str = "ctd.csv", **columns: object) -> pd.DataFrame:
    frame = pd.DataFrame(columns)
    frame.attrs = {"name": name, "columns": {}}
    return frame


def _glide(n: int = 600, step: float = 1.0) -> pd.DataFrame:
    time = 1.5e9 + step * np.arange(n)
    rng = np.random.default_rng(1)
    return _stream(
        time=time,
        pressure=0.15 * (time - time[0]) + rng.normal(0.0, 0.02, n),
        temperature=10.0 - 0.001 * np.arange(n),
        pitch=-0.43 + rng.normal(0.0, 0.003, n),
    )


def test_clean_data_are_all_good_and_nothing_is_said() -> None:
    (frame,), findings = quality.checked([_glide()])
    assert findings == []
    assert all((frame[f"{name}_qc"] == Quality.GOOD).all() for name in ("pressure", "temperature", "pitch"))


def test_values_are_kept_and_only_flagged() -> None:
    glide = _glide()
    glide.loc[100, "pitch"] = 40.0
    (frame,), findings = quality.checked([glide])
    pd.testing.assert_series_equal(frame["pitch"], glide["pitch"])
    assert np.flatnonzero(frame["pitch_qc"] != Quality.GOOD).tolist() == [100]
    assert [str(finding) for finding in findings] == [
        "ctd.csv: pitch, record 101: found 1 value out of range, first 40 rad; expected -1.571 to 1.571 rad; "
        "flagged bad and not used"
    ]


@pytest.mark.parametrize("step", [0.5, 1.0, 5.0, 60.0])
@pytest.mark.parametrize("length", [1, 2, 3])
def test_a_pressure_spike_of_a_hundred_metres_is_flagged_at_any_sampling(step: float, length: int) -> None:
    glide = _glide(step=step)
    glide.loc[200 : 199 + length, "pressure"] += 100.0
    (frame,), _ = quality.checked([glide])
    assert np.flatnonzero(frame["pressure_qc"] == Quality.BAD).tolist() == list(range(200, 200 + length))


@pytest.mark.parametrize("step", [1.0, 5.0, 60.0])
def test_turning_points_and_gaps_are_no_spikes(step: float, fly: Callable[..., object]) -> None:
    yo = fly([0.0, *[300.0, 5.0] * 3], step=step)
    keep = np.random.default_rng(0).random(yo.time.size) > 0.3
    keep[200:260] = False
    (frame,), findings = quality.checked([_stream(time=yo.time[keep], pressure=yo.depth[keep])])
    assert (frame["pressure_qc"] == Quality.GOOD).all()
    assert findings == []


def test_a_rate_of_pitch_that_jumps_and_returns_is_a_spike_and_a_turn_is_none() -> None:
    turn = 0.08 * np.exp(-(np.arange(-40.0, 41.0) ** 2) / 20.0)
    assert not quality.rate_spikes(turn).any()
    turn[[20, 60]] += [0.3, -0.3]
    assert np.flatnonzero(quality.rate_spikes(turn)).tolist() == [20, 60]
    noisy = turn + 0.03 * np.random.default_rng(0).standard_normal(turn.size)
    assert np.flatnonzero(quality.rate_spikes(noisy)).tolist() == [20, 60]
    assert not quality.rate_spikes(turn[:7]).any()
    (frame,), _ = quality.checked([_stream(time=np.arange(81.0), pitch_rate=np.where(np.arange(81) == 3, 1.5, turn))])
    assert np.flatnonzero(frame["pitch_rate_qc"] == Quality.BAD).tolist() == [3, 20, 60]


def test_argos_spike_test_flags_a_temperature_that_jumps_and_returns_but_no_thermocline() -> None:
    temperature = np.r_[np.full(10, 20.0), np.full(10, 8.0)]
    assert not quality.temperature_spikes(temperature).any()
    temperature[4] += 10.0
    assert np.flatnonzero(quality.temperature_spikes(temperature)).tolist() == [4]


def test_a_stuck_pitch_is_flagged_where_the_depth_changes() -> None:
    glide = _glide()
    glide.loc[100:349, "pitch"] = -0.43
    (frame,), findings = quality.checked([glide])
    assert np.flatnonzero(frame["pitch_qc"] == Quality.BAD).tolist() == list(range(100, 350))
    assert [str(finding) for finding in findings] == [
        "ctd.csv: pitch, record 101: found 250 values of a stuck sensor, first -0.43 rad; "
        "expected changes while depth changes; flagged bad and not used"
    ]


def test_a_pitch_without_noise_is_not_stuck_unless_it_stays_through_a_turn(fly: Callable[..., object]) -> None:
    yo = fly([0.0, *[80.0, 5.0] * 2])
    (frame,), _ = quality.checked([_stream(time=yo.time, pressure=yo.depth, pitch=yo.pitch)])
    assert (frame["pitch_qc"] == Quality.GOOD).all()
    (frame,), _ = quality.checked([_stream(time=yo.time, pressure=yo.depth, pitch=-0.4)])
    assert (frame["pitch_qc"] == Quality.BAD).all()


def test_a_pressure_that_dies_below_the_surface_is_flagged_while_the_nose_is_steep(fly: Callable[..., object]) -> None:
    yo = fly([0.0, *[200.0, 5.0] * 2], step=4.0)
    alive = np.arange(yo.time.size) < 400
    frame = _stream("ctd.csv", time=yo.time, pressure=np.where(alive, yo.depth, yo.depth[400]), pitch=yo.pitch)
    (frame,), findings = quality.checked([frame])
    assert (frame["pressure_qc"] == Quality.BAD).tolist() == (~alive).tolist()
    assert [str(finding) for finding in findings] == [
        f"ctd.csv: pressure, record 401: found {int((~alive).sum())} values of a stuck sensor, "
        f"first {yo.depth[400]:.6g} dbar; expected changes while pitch is steep; flagged bad and not used"
    ]


def test_a_pressure_held_at_the_surface_or_in_level_flight_is_not_stuck() -> None:
    time = np.arange(0.0, 7200.0, 4.0)
    for pressure, pitch in ((0.0, -1.0), (4.0, -1.0), (50.0, 0.02)):
        (frame,), _ = quality.checked([_stream(time=time, pressure=pressure + 0 * time, pitch=pitch + 0 * time)])
        assert (frame["pressure_qc"] == Quality.GOOD).all()


def test_a_pitch_held_while_the_depth_is_held_is_not_stuck() -> None:
    glide = _glide().assign(pressure=10.0, pitch=0.06)
    (frame,), _ = quality.checked([glide])
    assert (frame["pitch_qc"] == Quality.GOOD).all()


def test_flags_of_the_reader_stay_where_they_are_worse() -> None:
    glide = _glide(4)
    glide["temperature_qc"] = np.array([0, 1, 3, 4], dtype=np.int8)
    (frame,), _ = quality.checked([glide])
    assert frame["temperature_qc"].tolist() == [1, 1, 3, 4]


def test_a_battery_of_no_volts_is_no_measurement() -> None:
    (frame,), findings = quality.checked([_stream(time=[0.0, 1.0, 2.0], battery_voltage=[14.2, 0.0, 28.6])])
    assert frame["battery_voltage_qc"].tolist() == [1, 4, 1]
    assert "found 1 value out of range, first 0 V; expected 1 to 500 V" in str(findings[0])


def test_what_was_not_measured_is_missing() -> None:
    glide = _glide(4)
    glide.loc[1, "pitch"] = np.nan
    (frame,), _ = quality.checked([glide])
    assert frame["pitch_qc"].tolist() == [1, 9, 1, 1]


def test_a_position_of_zero_zero_is_no_fix() -> None:
    fixes = _stream(time=[1.5e9, 1.5e9 + 1], latitude=[0.0, 54.0], longitude=[0.0, 15.0])
    (frame,), _ = quality.checked([fixes])
    assert frame["latitude_qc"].tolist() == [4, 1]


def test_a_sensor_that_only_reports_nan_is_a_finding() -> None:
    (_,), findings = quality.checked([_glide(5).assign(temperature=np.nan)])
    assert [str(finding) for finding in findings] == [
        "ctd.csv: temperature: found no number in 5 records; expected measurements; not used"
    ]


def test_a_pitch_of_nan_alone_stops_the_mission() -> None:
    streams, _ = quality.checked([_glide(5).assign(pitch=np.nan)])
    with pytest.raises(InputError) as error:
        quality.require(streams)
    assert str(error.value) == (
        "ctd.csv: column 'pitch': found no pitch in 5 records, only NaN; expected a pitch sensor that reports; "
        "the mission cannot be analysed without it"
    )


def test_a_pitch_in_degrees_declared_as_radians_stops_the_mission() -> None:
    streams, _ = quality.checked([_glide(5).assign(pitch=[-25.0, -26.0, -24.0, -25.5, -25.0])])
    with pytest.raises(InputError) as error:
        quality.require(streams)
    assert str(error.value) == (
        "ctd.csv: column 'pitch': found pitch from -26 to -24 rad; expected -1.571 to 1.571 rad; "
        "correct its unit under files: in mission.yaml"
    )


def test_no_pitch_anywhere_stops_the_mission() -> None:
    streams, _ = quality.checked(
        [_stream("attitude.csv", time=[1.5e9], roll=[0.0]), _stream("ctd.csv", time=[1.5e9], pressure=[1.0])]
    )
    with pytest.raises(InputError) as error:
        quality.require(streams)
    assert str(error.value) == (
        "mission: found no pitch in attitude.csv, ctd.csv; expected a pitch column; "
        "name it under files: … in mission.yaml"
    )


def test_an_offset_of_pressure_at_the_gps_fixes_is_noted() -> None:
    ctd = _stream(time=1.5e9 + np.arange(100.0), pressure=np.r_[np.full(50, 1.2), np.linspace(1.2, 20.0, 50)])
    gps = _stream("gps.csv", time=1.5e9 + np.arange(0.0, 10.0, 5.0), latitude=[54.0, 54.0], longitude=[15.0, 15.0])
    streams, _ = quality.checked([ctd, gps])
    assert [str(finding) for finding in quality.surface_offset(streams)] == [
        "ctd.csv: pressure: found 1.20 dbar at the GPS fixes; expected 0 dbar at the surface; "
        "not corrected: depth rates do not depend on it"
    ]


def test_negative_pressure_at_the_surface_is_noted_without_gps() -> None:
    ctd = _stream(time=1.5e9 + np.arange(100.0), pressure=np.linspace(-0.8, 20.0, 100))
    streams, _ = quality.checked([ctd])
    assert quality.surface_offset(streams)[0].found == "-0.80 dbar at its least"


def test_a_pressure_that_feels_the_atmosphere_is_doubted() -> None:
    ctd = _stream(time=1.5e9 + np.arange(100.0), pressure=np.linspace(10.1, 80.0, 100))
    streams, _ = quality.checked([ctd])
    assert [str(finding) for finding in quality.surface_offset(streams)] == [
        "ctd.csv: pressure: found 10.10 dbar at its least; expected 0 dbar at the surface; not corrected; "
        "if it is absolute pressure, give its unit as dbara (bara, psia) under files: in mission.yaml"
    ]


def test_a_pitch_that_is_mostly_out_of_range_stops_the_mission_though_some_of_it_is_not() -> None:
    pitch = np.where(np.arange(100) % 10 == 0, 0.5, 25.0)
    frame = pd.DataFrame({"time": np.arange(100.0), "pressure": 10.0, "pitch": pitch})
    frame.attrs = {"name": "attitude.csv", "columns": {"pitch": "Pitch [rad]"}}
    streams, _ = quality.checked([frame])
    with pytest.raises(InputError) as error:
        quality.require(streams)
    assert str(error.value) == (
        "attitude.csv: column 'Pitch [rad]': found pitch from 0.5 to 25 rad; expected -1.571 to 1.571 rad; "
        "correct its unit under files: in mission.yaml"
    )


def test_a_conductivity_that_is_mostly_out_of_range_asks_for_its_unit() -> None:
    frame = pd.DataFrame({"time": np.arange(50.0), "conductivity": np.linspace(40.0, 42.0, 50)})
    frame.attrs = {"name": "ctd.csv"}
    _, findings = quality.checked([frame])
    assert [str(finding) for finding in findings] == [
        "ctd.csv: conductivity, record 1: found 50 values out of range, first 40 S/m; expected 0 to 9 S/m; "
        "flagged bad and not used; is its unit mS/cm? correct it under files: in mission.yaml"
    ]


def test_what_was_left_out_is_named_where_it_is_missed() -> None:
    frame = pd.DataFrame({"time": [0.0, 1.0], "pitch": [0.1, 0.1]})
    frame.attrs = {"name": "attitude.csv"}
    streams, _ = quality.checked([frame])
    table = Finding("error", "ctd.csv", "", "no table", "a header line and records", "file left out")
    unit = Finding("warning", "ctd.csv", "column 'P'", "unit 'm' for pressure", "a unit of pressure", "column left out")
    for lost, reason in (
        ([table], "ctd.csv: found no table; expected a header line and records; file left out"),
        (
            [table, unit],
            "ctd.csv: column 'P': found unit 'm' for pressure; expected a unit of pressure; column left out",
        ),
    ):
        with pytest.raises(InputError) as error:
            quality.require(streams, lost=lost)
        line = f"mission: found no pressure in attitude.csv; expected a pressure column; {reason}"
        assert str(error.value) == line


def test_infinite_values_are_left_out_and_counted() -> None:
    frame = pd.DataFrame({"time": np.arange(4.0), "temperature": [10.0, np.inf, -np.inf, 10.1]})
    frame.attrs = {"name": "ctd.csv"}
    (found,), findings = quality.checked([frame])
    assert found["temperature"].isna().tolist() == [False, True, True, False]
    assert found["temperature_qc"].tolist() == [Quality.GOOD, Quality.MISSING, Quality.MISSING, Quality.GOOD]
    assert [str(finding) for finding in findings] == [
        "ctd.csv: temperature, record 2: found 2 infinite values; expected a number; left out"
    ]


def test_a_file_of_several_tables_is_named_once() -> None:
    frames = [pd.DataFrame({"time": [0.0], "roll": [0.0]}) for _ in range(2)]
    for frame in frames:
        frame.attrs["name"] = "unit.nc"
    with pytest.raises(InputError, match=r"^mission: found no pressure in unit\.nc; expected"):
        quality.require(frames)

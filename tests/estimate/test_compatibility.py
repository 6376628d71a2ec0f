"""Data compatibility against simulated missions: what was put in is found, what was not is not, nothing is broken."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.truth import lay_out
from pipeline import instruments, mission, simulate, trials, vehicle
from pipeline.estimate.compatibility import SIGNIFICANT, Compatibility, clock_offset, reconcile
from pipeline.estimate.lag import lag
from pipeline.estimate.series import Series, from_records
from pipeline.estimate.spikes import depth_spikes, out_and_back, pitch_spikes, speed_spikes
from pipeline.findings import Finding
from pipeline.ingest import ingest
from pipeline.mission import Mission
from pipeline.plan import Plan, Stage
from pipeline.records import Quality, seconds
from pipeline.vehicle import Vehicle

PETREL = vehicle.load("petrel-ii")
CHECK, USE = (Mission(vehicle="petrel-ii", speed_sensor=word) for word in ("check", "use"))


def plan(seed: int, legs: int = 5, depth: float = 120.0, craft: Vehicle = PETREL) -> Plan:
    """Return dives and climbs drawn at random: pitch, net buoyancy, motors, sampling and water."""
    drawn = np.random.default_rng(seed)
    pitch, force = float(drawn.uniform(20.0, 40.0)), float(drawn.uniform(3.0, 8.0))
    stages = [Stage(-pitch, 5.0, 60.0, "duration", 180.0, afloat=True)]
    for _ in range(legs):
        stages += [Stage(-pitch, -force, 60.0, "deeper", depth), Stage(pitch, force, 60.0, "shallower", 20.0)]
    return replace(
        trials.trial("petrel2-scs-2014"),
        name=f"drawn-{seed}",
        vehicle=craft,
        stages=(
            *stages,
            Stage(pitch, force, 60.0, "surface"),
            Stage(-pitch, force, 60.0, "duration", 180.0, afloat=True),
        ),
        nominal_depth=0.5 * depth,
        pitch_slew_deg=float(drawn.uniform(1.0, 4.0)),
        pump_rate=float(drawn.uniform(1.5e-5, 4e-5)),
        battery_rate=8e-3,
        attitude_s=float(drawn.choice([2.0, 4.0])),
        ctd_s=float(drawn.choice([1.0, 2.0])),
        vertical_water_std=float(drawn.uniform(0.003, 0.015)),
    )


class Flown(NamedTuple):
    """A simulated mission as ingest hands it on, and what was true at its instants."""

    records: pd.DataFrame
    truth: pd.DataFrame

    @property
    def series(self) -> Series:
        """What the estimators take from it."""
        return from_records(self.records)

    def true(self, name: str) -> np.ndarray:
        """Return a true quantity at the instants of the records."""
        at, when = seconds(self.records["time"]), seconds(self.truth["time"])
        return np.asarray(np.interp(at, when, self.truth[name].to_numpy()))

    def with_speed(self, noise: float = 0.01, seed: int = 0) -> Flown:
        """Return the mission with a sensor of speed through water that reports with each pitch."""
        there = self.records["pitch"].notna().to_numpy()
        drawn = noise * np.random.default_rng(seed).standard_normal(there.size)
        return self.changed(speed_through_water=np.where(there, self.true("speed") + drawn, np.nan))

    def changed(self, **columns: np.ndarray) -> Flown:
        """Return the mission with other measurements."""
        records = self.records.assign(**columns)
        if "speed_through_water" in columns:
            known = np.isfinite(columns["speed_through_water"])
            qc = np.where(known, np.int8(Quality.GOOD), np.int8(Quality.MISSING))
            records = records.assign(speed_through_water_qc=qc, speed_through_water_std=np.where(known, 0.01, np.nan))
        return self._replace(records=records)

    def reconciled(self, settings: Mission, craft: Vehicle = PETREL) -> Compatibility:
        """Return what the step says about it."""
        return reconcile(self.records, self.series, craft, settings)


def fly(
    folder: Path, drawn: Plan, seed: int, *, bias_deg: float = 0.0, ctd_behind: float = 0.0, yaml: str = ""
) -> Flown:
    """Return a mission flown, logged with the CTD's clock `ctd_behind` seconds behind, and read again."""
    flown = simulate.run(drawn, seed, simulate.Injection(pitch_bias_deg=bias_deg))
    streams = dict(flown.streams)
    streams["ctd"] = streams["ctd"].assign(time=streams["ctd"]["time"] - ctd_behind)
    folder.mkdir()
    instruments.write(drawn, streams, folder, seed)
    path = folder / mission.FILE
    path.write_text(path.read_text(encoding="utf-8") + yaml, encoding="utf-8")
    return Flown(ingest(mission.load(folder)).records, flown.truth)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    """Fly five dives and climbs with nothing wrong."""
    return fly(tmp_path_factory.mktemp("raw") / "plain", plan(3), 3)


@pytest.fixture(scope="module")
def biased(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    """Fly the same dives and climbs, logged with 3 degrees too much pitch, and a speed sensor."""
    return fly(tmp_path_factory.mktemp("raw") / "biased", plan(3), 3, bias_deg=3.0).with_speed()


def test_offsets_between_the_clocks_are_found_with_an_honest_uncertainty() -> None:
    pulls: dict[float, list[float]] = {-3.0: [], 0.0: [], 2.5: []}
    values: dict[float, list[float]] = {-3.0: [], 0.0: [], 2.5: []}
    for seed in range(23):
        drawn = np.random.default_rng(1000 + seed)
        craft = PETREL.with_values(
            {
                "parasite_drag": PETREL["parasite_drag"] * math.exp(0.2 * drawn.standard_normal()),
                "lift_slope": PETREL["lift_slope"] * math.exp(0.3 * drawn.standard_normal()),
            },
            "drawn",
        )
        streams = simulate.run(plan(seed, legs=4, depth=140.0, craft=craft), seed).streams
        ctd, attitude = streams["ctd"], streams["attitude"]
        start = float(ctd["time"].iloc[0])
        time, clock = (frame["time"].to_numpy() - start for frame in (ctd, attitude))
        depth = 0.993 * ctd["pressure"].to_numpy()
        for offset, found in pulls.items():
            got = lag(time - offset, depth, np.zeros(time.size, dtype=bool), clock, attitude["pitch"].to_numpy())
            if got.value is not None and got.std is not None:
                found.append((got.value - offset) / got.std)
                values[offset].append(got.value / got.std)
    every = np.concatenate([np.array(found) for found in pulls.values()])
    assert all(len(found) >= 20 for found in pulls.values())
    assert 0.4 < np.sqrt(np.mean(every**2)) < 1.1
    assert abs(np.mean(every)) < 0.6
    assert np.abs(every).max() < SIGNIFICANT
    assert not any(abs(value) > SIGNIFICANT for value in values[0.0])
    assert np.mean([value < -SIGNIFICANT for value in values[-3.0]]) > 0.7
    assert np.mean([value > SIGNIFICANT for value in values[2.5]]) > 0.6


@pytest.mark.parametrize("name", sorted(trials.TRIALS))
def test_no_offset_is_invented_in_the_field_trials(name: str) -> None:
    streams = simulate.run(trials.trial(name), 1).streams
    ctd, attitude, engine = streams["ctd"], streams["attitude"], streams["engine"]
    start = float(ctd["time"].iloc[0])
    driven = np.interp(ctd["time"], engine["time"], engine["propeller_speed"]) > 0.5
    depth, pitch = 0.993 * ctd["pressure"].to_numpy(), attitude["pitch"].to_numpy()
    got = lag(ctd["time"].to_numpy() - start, depth, driven, attitude["time"].to_numpy() - start, pitch)
    assert got.value is None or abs(got.value) < SIGNIFICANT * (got.std or 0.0)
    assert (got.value is None) == bool(got.reason)


def test_a_found_offset_names_the_key_that_sets_it_right_and_the_key_does(plain: Flown, tmp_path: Path) -> None:
    wrong = fly(tmp_path / "wrong", plan(3), 3, ctd_behind=4.0)
    entry, findings = clock_offset([wrong.series], CHECK)
    assert entry["value"] == pytest.approx(4.0, abs=SIGNIFICANT * entry["std"])
    assert entry["significant"]
    assert not entry["applied"]
    assert f"set clock_offset: {entry['value']:.1f} in mission.yaml" in "\n".join(str(item) for item in findings)
    right = fly(tmp_path / "right", plan(3), 3, ctd_behind=4.0, yaml="clock_offset: 4.0\n")
    pd.testing.assert_frame_equal(right.records, plain.records)
    assert not clock_offset([right.series], CHECK)[0]["significant"]


def test_an_offset_is_read_off_parts_of_a_mission_as_off_the_whole(tmp_path: Path) -> None:
    late = fly(tmp_path / "late", plan(3), 3, ctd_behind=4.0)
    half = len(late.records) // 2
    parts = [from_records(late.records[:half]), from_records(late.records[half:])]
    apart, whole = (clock_offset(stretches, CHECK)[0] for stretches in (parts, [late.series]))
    assert apart["windows"] == whole["windows"]
    assert apart["value"] == pytest.approx(whole["value"], abs=0.1 * whole["std"])


def test_an_offset_is_added_to_the_one_that_mission_yaml_has(plain: Flown) -> None:
    late = plain.series.time + 5.0
    moved = replace(plain.series, depth=np.interp(late, plain.series.time, plain.true("depth")))
    entry, _ = clock_offset([moved], CHECK.model_copy(update={"clock_offset": 10.0}))
    assert entry["significant"]
    assert entry["value"] == pytest.approx(5.0, abs=SIGNIFICANT * entry["std"])
    assert f"clock_offset: {10.0 + entry['value']:.1f}" in entry["reason"]
    assert "the same records" in entry["reason"]


def test_a_speed_sensor_held_out_is_not_looked_at(biased: Flown) -> None:
    blind = biased.reconciled(CHECK)
    wild = np.where(biased.records["pitch"].notna(), 9.0 * np.sin(np.arange(len(biased.records))), np.nan)
    other = biased.changed(speed_through_water=wild).reconciled(CHECK)
    assert other.report == blind.report
    assert other.findings == blind.findings
    for name, value in vars(other.series).items():
        if not name.startswith("speed"):
            np.testing.assert_array_equal(value, getattr(blind.series, name))
    np.testing.assert_array_equal(other.series.speed, wild)
    for name in ("pitch_bias", "pitch_scale"):
        assert blind.report[name]["value"] is None
        assert blind.report[name]["reason"].startswith("needs a speed sensor that may be used")


def test_a_pitch_bias_is_found_by_a_speed_sensor_and_taken_off(biased: Flown) -> None:
    got = biased.reconciled(USE)
    entry = got.report["pitch_bias"]
    assert entry["applied"]
    assert entry["value"] == pytest.approx(-math.radians(3.0), abs=SIGNIFICANT * entry["std"])
    assert not got.report["pitch_scale"]["significant"]
    known = np.isfinite(got.series.pitch)
    off = np.degrees(got.series.pitch - biased.true("pitch"))[known]
    assert abs(np.median(off)) < 1.0
    assert "set pitch: {scale: 1.000, offset_rad: " in str(got.findings[-1])


def test_the_pitch_bias_of_vehicles_unlike_their_file_lies_within_its_uncertainty(tmp_path: Path) -> None:
    pulls = []
    for seed in range(12):
        drawn = np.random.default_rng(500 + seed)
        coefficients = ("lift_slope", "parasite_drag", "induced_drag")
        craft = PETREL.with_values(
            {name: PETREL[name] + PETREL.std(name) * drawn.standard_normal() for name in coefficients}, "drawn"
        )
        bias = 2.0 * drawn.standard_normal()
        flown = fly(tmp_path / str(seed), plan(seed, legs=3, craft=craft), seed, bias_deg=bias).with_speed(seed=seed)
        sensor = flown.records["speed_through_water"].to_numpy() * (1.0 + 0.01 * drawn.standard_normal())
        report = flown.changed(speed_through_water=sensor).reconciled(USE).report
        for name, true in (("pitch_bias", -math.radians(bias)), ("pitch_scale", 1.0)):
            pulls.append((report[name]["value"] - true) / report[name]["std"])
    assert 0.6 < np.sqrt(np.mean(np.square(pulls))) < 1.3
    assert np.abs(pulls).max() < SIGNIFICANT


def test_a_pitch_scale_is_found_by_a_speed_sensor(plain: Flown) -> None:
    got = plain.with_speed().changed(pitch=plain.records["pitch"].to_numpy() / 0.86).reconciled(USE)
    entry = got.report["pitch_scale"]
    assert entry["applied"]
    assert entry["value"] == pytest.approx(0.86, abs=SIGNIFICANT * entry["std"])
    assert not got.report["pitch_bias"]["significant"]


def test_a_sensor_that_agrees_changes_nothing(plain: Flown) -> None:
    given_speed = plain.with_speed()
    series = given_speed.series
    got = reconcile(given_speed.records, series, PETREL, USE)
    assert got.series is series
    assert got.findings == []
    assert not any(entry["significant"] or entry["applied"] for entry in got.report.values())


def test_dives_alone_do_not_tell_a_bias_from_a_scale(biased: Flown) -> None:
    down = np.where(biased.true("path_angle") < 0.0, biased.records["speed_through_water"], np.nan)
    report = biased.changed(speed_through_water=down).reconciled(USE).report
    assert report["pitch_scale"]["value"] is None
    assert "tell a scale from a bias" in report["pitch_scale"]["reason"]
    assert not report["pitch_bias"]["applied"]


def test_without_a_polar_pitch_is_left_as_it_is(biased: Flown) -> None:
    report = biased.reconciled(USE, vehicle.load("bare.yaml", Path(__file__).parents[1])).report
    assert report["pitch_bias"]["value"] is None
    assert report["pitch_bias"]["reason"] == "the vehicle's polar is not known"


def test_an_offset_of_the_pressure_sensor_is_taken_off_the_depth(plain: Flown) -> None:
    moved = plain.changed(
        **{name: plain.records[name].to_numpy() + off for name, off in (("pressure", 4.0), ("depth", 3.97))}
    )
    got = moved.reconciled(CHECK)
    entry = got.report["pressure_offset"]
    assert entry["applied"]
    assert entry["value"] == pytest.approx(4.0, abs=SIGNIFICANT * entry["std"])
    below = np.isfinite(got.series.depth)
    assert np.median((got.series.depth - plain.true("depth"))[below]) == pytest.approx(0.0, abs=2.0)
    assert not plain.reconciled(CHECK).report["pressure_offset"]["significant"]


def test_a_lag_of_the_one_pressure_sensor_is_not_invented(plain: Flown) -> None:
    entry = plain.reconciled(CHECK).report["pressure_lag"]
    assert entry["value"] is None
    assert "cannot be told from the offset between the clocks" in entry["reason"]


def test_spikes_are_flagged_listed_and_nothing_else_is_lost(plain: Flown) -> None:
    flown = plain.with_speed()
    rows = {
        name: np.flatnonzero(flown.records[name].notna() & (flown.true("depth") > 30.0) & ~flown.series.manoeuvre)[
            70::90
        ][:5]
        for name in ("depth", "pitch", "speed_through_water")
    }
    columns = {name: flown.records[name].to_numpy(copy=True) for name in rows}
    for name, size in (("depth", 100.0), ("pitch", math.radians(40.0)), ("speed_through_water", 0.28)):
        columns[name][rows[name]] += size
    spoilt = flown.changed(**columns)
    got = spoilt.reconciled(USE)
    for name, column in (("depth", "depth"), ("pitch", "pitch"), ("speed", "speed_through_water")):
        entry = got.report["outliers"]["instruments"][name]
        assert entry["count"] == 5
        assert [item["time_s"] for item in entry["first"]] == spoilt.series.time[rows[column]].tolist()
        gone = np.isfinite(getattr(spoilt.series, name)) & ~np.isfinite(getattr(got.series, name))
        np.testing.assert_array_equal(np.flatnonzero(gone), rows[column])
    assert got.report["outliers"]["value"] == 15
    assert sum("outliers" in finding.found for finding in got.findings) == 3
    assert not got.report["pitch_bias"]["significant"]
    assert not clock_offset([got.series], USE)[0]["significant"]


@pytest.mark.parametrize("seed", range(3))
def test_real_motion_is_no_outlier(seed: int, tmp_path: Path) -> None:
    flown = fly(tmp_path / "raw", plan(seed), seed).with_speed(seed=seed)
    assert flown.reconciled(USE).report["outliers"]["value"] == 0


def test_a_speed_less_than_the_depth_rate_is_impossible() -> None:
    time = np.arange(200.0)
    speed = np.where(time < 100.0, 0.35, 0.0)
    found = speed_spikes(
        time, speed, np.full(200, 0.01), np.full(200, 0.15), np.full(200, -0.4), np.zeros(200, dtype=bool)
    )
    np.testing.assert_array_equal(found, time >= 100.0)


def test_a_speed_that_depth_rate_confirms_is_no_spike() -> None:
    time = 4.0 * np.arange(200.0)
    gust = np.where(np.abs(time - 400.0) < 5.0, 0.3, 0.0)
    pitch, still = np.full(200, -0.4), np.zeros(200, dtype=bool)
    noise = 0.003 * np.random.default_rng(0).standard_normal(200)

    def found(rate: np.ndarray) -> np.ndarray:
        return speed_spikes(time, 0.35 + gust + noise, np.full(200, 0.01), rate, pitch, still)

    np.testing.assert_array_equal(found(np.full(200, 0.35 * math.sin(0.4))), gust > 0.0)
    assert not found((0.35 + gust) * math.sin(0.4)).any()


@given(start=st.floats(-1.0, 1.0), stop=st.floats(-1.0, 1.0), width=st.integers(1, 40))
def test_turns_however_quick_are_no_spikes_of_pitch(start: float, stop: float, width: int) -> None:
    time = np.arange(200.0)
    turn = start + (stop - start) * np.clip((time - 100.0) / width, 0.0, 1.0)
    assert not pitch_spikes(time, turn).any()


@given(
    size=st.floats(20.0, 500.0), at=st.integers(20, 380), length=st.integers(1, 3), sign=st.sampled_from([-1.0, 1.0])
)
def test_spikes_of_depth_are_found_whatever_their_size_and_a_turn_is_none(
    size: float, at: int, length: int, sign: float
) -> None:
    time = 2.0 * np.arange(400.0)
    depth = 100.0 - 0.2 * np.abs(time - 400.0)
    assert not depth_spikes(time, depth).any()
    depth[at : at + length] += sign * size
    np.testing.assert_array_equal(np.flatnonzero(depth_spikes(time, depth)), np.arange(at, at + length))


def test_an_autopilot_that_hunts_makes_no_spikes() -> None:
    time = 4.5 * np.arange(400.0)
    noise = math.radians(0.2) * np.random.default_rng(0).standard_normal(400)
    for period in (15.0, 20.0, 30.0):
        assert not pitch_spikes(time, -0.4 + math.radians(9.0) * np.sin(2.0 * math.pi * time / period) + noise).any()
        once = np.where(np.abs(time - 900.0) < 0.5 * period, np.cos(math.pi * (time - 900.0) / period), 0.0)
        assert not pitch_spikes(time, -0.4 + math.radians(12.0) * once + noise).any()


def test_steps_are_no_spikes() -> None:
    step = np.where(np.arange(100) < 50, 0.0, 10.0)
    assert not out_and_back(step, np.full(100, 1.0)).any()


def test_comets_spike_in_yo_8_is_a_sensor_outlier_when_the_dvl_is_used(data: Path, tmp_path: Path) -> None:
    lay_out(data, tmp_path, ("comet",))
    flown = Flown(ingest(mission.load(tmp_path / "comet")).records, pd.DataFrame())
    time, speed = np.load(data / "slocum/comet2016/U_kalman_native.npy")
    at = seconds(flown.records["time"])
    column = np.full(at.size, np.nan)
    rows = np.clip(np.searchsorted(at, time), 0, at.size - 1)
    column[rows[speed > 0.0]] = speed[speed > 0.0]
    flown = flown.changed(speed_through_water=column)
    craft = vehicle.load("slocum-g2")
    outlying = np.isfinite(flown.series.speed) & ~np.isfinite(flown.reconciled(USE, craft).series.speed)
    spike = (column > 0.52) & (column < 0.61)
    assert spike.sum() == 1
    assert outlying[spike].all()
    assert outlying[column > 0.61].all()
    steady = (column > 0.2) & (column < 0.37)
    assert steady.sum() > 700
    assert not outlying[steady].any()
    assert np.isfinite(flown.reconciled(CHECK, craft).series.speed[spike]).all()


def _harm(flown: Flown, kind: str) -> Flown:
    records, drawn = flown.records, np.random.default_rng(1)
    nothing, n = np.full(len(records), np.nan), len(records)
    cuts: dict[str, Callable[[], Flown]] = {
        "none": lambda: flown._replace(records=records.iloc[:0]),
        "one": lambda: flown._replace(records=records.iloc[:1]),
        "two": lambda: flown._replace(records=records.iloc[:2]),
        "eleven": lambda: flown._replace(records=records.iloc[:11].reset_index(drop=True)),
        "no depth": lambda: flown.changed(depth=nothing, pressure=nothing),
        "no pitch": lambda: flown.changed(pitch=nothing),
        "nothing": lambda: flown.changed(
            depth=nothing, pressure=nothing, pitch=nothing, speed_through_water=nothing, latitude=nothing
        ),
        "stuck pitch": lambda: flown.changed(pitch=np.full(n, -0.4)),
        "stuck depth": lambda: flown.changed(depth=np.full(n, 50.0)),
        "stuck speed": lambda: flown.changed(speed_through_water=np.zeros(n)),
        "wild": lambda: flown.changed(
            depth=1e3 * drawn.standard_normal(n), pitch=drawn.standard_normal(n), speed_through_water=drawn.random(n)
        ),
        "dropouts": lambda: flown.changed(
            depth=np.where(drawn.random(n) < 0.4, np.nan, records["depth"]),
            pitch=np.where(drawn.random(n) < 0.4, np.nan, records["pitch"]),
        ),
        "gaps": lambda: flown._replace(
            records=records[np.arange(n) // 200 % 2 == 0]
            .assign(time=lambda part: part["time"] + pd.to_timedelta(np.arange(len(part)) // 200 * 36000, unit="s"))
            .reset_index(drop=True)
        ),
    }
    return cuts[kind]()


@pytest.mark.parametrize(
    "kind",
    [
        *("none", "one", "two", "eleven", "no depth", "no pitch", "nothing"),
        *("stuck pitch", "stuck depth", "stuck speed", "wild", "dropouts", "gaps"),
    ],
)
def test_hostile_missions_get_a_report_and_no_exception(kind: str, plain: Flown) -> None:
    harmed = _harm(plain.with_speed(), kind)
    series = harmed.series if len(harmed.records) else plain.series[:0]
    for asked in (CHECK, USE):
        got = reconcile(harmed.records, series, PETREL, asked)
        clocks, findings = clock_offset([got.series], asked)
        report = {**got.report, "clock_offset": clocks}
        assert json.loads(json.dumps(report, allow_nan=False)) == report
        assert got.series.time.size == series.time.size
        for entry in report.values():
            assert entry["value"] is not None or entry["reason"]
            assert not entry["applied"] or entry["significant"]
        assert all(isinstance(finding, Finding) for finding in [*got.findings, *findings])


@settings(max_examples=25)
@given(
    steps=st.lists(st.floats(1e-3, 5e4), min_size=1, max_size=60),
    values=st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=60),
)
def test_no_series_however_odd_breaks_the_parts(steps: list[float], values: list[float]) -> None:
    size = min(len(steps), len(values))
    time, value = np.cumsum(steps[:size]), np.array(values[:size])
    nowhere = np.zeros(size, dtype=bool)
    got = lag(time, value, nowhere, time, np.clip(value, -1.5, 1.5))
    assert got.value is None or math.isfinite(got.value)
    assert depth_spikes(time, value).shape == pitch_spikes(time, value).shape == (size,)
    assert speed_spikes(time, value, np.abs(value), value, value, nowhere).shape == (size,)

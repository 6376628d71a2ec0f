"""Simulated missions obey the dynamics, and their logs are what instruments would have written."""

from __future__ import annotations

import dataclasses
import functools
import json
import math
from pathlib import Path

import gsw
import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import lsim

from pipeline import instruments, mission, store
from pipeline.findings import InputError
from pipeline.instruments import LOGS
from pipeline.model.dynamics import body_of, jacobian
from pipeline.model.steady import trim_at_pitch
from pipeline.plan import Plan, Sea, Stage
from pipeline.records import seconds
from pipeline.simulate import TRUTH, Injection, Simulated, run, simulate
from pipeline.trials import TRIALS, trial
from pipeline.vehicle import load
from pipeline.voyage import gauss_markov

RAW = Path(__file__).parents[1] / "raw"
GLIDING, LEVEL, HYBRID = "petrel2-scs-2014", "petrel2-danjiangkou-2014", "petrel2-scs-2015"
CALM = {"vertical_water_std": 0.0, "current_std": 0.0, "heading_wander_deg": 0.0, "noise": 0.0}


@functools.cache
def flown(name: str, injection: Injection | None = None) -> tuple[Plan, Simulated]:
    """Return one dive and climb, or one leg, of a trial without disturbances or noise."""
    plan = trial(name)
    ends = [i for i, stage in enumerate(plan.stages) if stage.afloat]
    plan = dataclasses.replace(plan, stages=plan.stages[: ends[1] + 1], **CALM)
    return plan, run(plan, injection=injection)


@functools.cache
def trial_run(name: str) -> tuple[Plan, Simulated]:
    return trial(name), run(trial(name))


def held(plan: Plan, truth: pd.DataFrame, stage: int) -> pd.DataFrame:
    """Return the second half of an order, when the transients have died out."""
    part = truth[truth["stage"] == stage]
    return part.iloc[len(part) // 2 : -1]


@pytest.mark.parametrize(("name", "stage"), [(GLIDING, 1), (GLIDING, 2), (LEVEL, 5), (HYBRID, 1), (HYBRID, 3)])
def test_held_flight_agrees_with_the_analytic_steady_state(name: str, stage: int) -> None:
    plan, simulated = flown(name)
    part = held(plan, simulated.truth, stage)
    steady = trim_at_pitch(
        plan.vehicle,
        part["net_buoyancy"],
        part["pitch"],
        propeller_speed=part["propeller_speed"],
        density=Sea.of(plan, part["depth"].to_numpy()).density,
    )
    assert np.abs(part["speed"] / steady.speed - 1.0).median() < 2e-3
    assert np.abs(part["path_angle"] - steady.path_angle).median() < math.radians(0.1)
    assert np.abs(part["angle_of_attack"] - steady.angle_of_attack).median() < math.radians(0.02)


@pytest.mark.parametrize("name", TRIALS)
def test_kinetic_energy_changes_by_the_work_of_the_forces(name: str) -> None:
    plan, simulated = flown(name)
    truth = simulated.truth[~simulated.truth["afloat"]]
    v, gamma, alpha = (truth[key].to_numpy() for key in ("speed", "path_angle", "angle_of_attack"))
    q, pitch = truth["pitch_rate"].to_numpy(), truth["pitch"].to_numpy()
    car = plan.vehicle
    ratio = Sea.of(plan, truth["depth"].to_numpy()).density / car["reference_density"]
    drag = ratio * (car["parasite_drag"] + car["induced_drag"] * alpha**2) * v**2
    moment = ratio * (car["moment_at_zero"] + car["moment_slope"] * alpha + car["pitch_damping"] * q) * v**2
    moment -= car["battery_mass"] * 9.81 * truth["battery_position"].to_numpy() * np.cos(pitch)
    moment += car["righting_moment"] * np.sin(pitch)
    power = truth["net_buoyancy"] * v * np.sin(gamma) - drag * v + truth["thrust"] * v * np.cos(alpha) + moment * q
    kinetic = 0.5 * (car["mass_forward"] * v**2 + car["pitch_inertia"] * q**2)
    time = np.arange(len(truth), dtype=float)
    work = CubicSpline(time, power).antiderivative()(time)
    after = slice(30, None)  # the ease of leaving the surface is not resolved by one sample a second
    error = (kinetic - kinetic[30])[after] - (work - work[30])[after]
    spent = np.trapezoid(drag * v, time)
    assert np.abs(error).max() < 1e-3 * spent


@pytest.mark.parametrize("name", TRIALS)
def test_a_shorter_step_changes_nothing_that_matters(name: str) -> None:
    plan, simulated = flown(name)
    finer = run(dataclasses.replace(plan, step=plan.step / 2.0)).truth
    assert len(finer) == len(simulated.truth)
    for column, tolerance in (("speed", 1e-6), ("angle_of_attack", 2e-6), ("pitch", 2e-6), ("depth", 1e-5)):
        assert np.abs(finer[column] - simulated.truth[column]).max() < tolerance, column


def test_water_in_the_fairing_is_that_met_a_while_ago() -> None:
    """Net buoyancy less that of hull and engine, against a first-order lag of the potential density along the dive."""
    share, time_constant = 0.3, 700.0
    plan, bare = flown(GLIDING)
    fairing = {"carried_water": share, "flushing_time": time_constant}
    plan = dataclasses.replace(plan, vehicle=plan.vehicle.with_values(fairing, "a test"))
    truth = run(plan).truth
    sea = Sea.of(plan, truth["depth"].to_numpy())
    time, density = np.arange(len(truth), dtype=float), sea.density
    absolute = gsw.SA_from_SP(sea.salinity, sea.pressure, plan.longitude, plan.latitude)
    around = gsw.rho(absolute, gsw.CT_from_t(absolute, sea.temperature, sea.pressure), 0.0)
    _, inside, _ = lsim(([1.0], [time_constant, 1.0]), around, time, X0=[time_constant * around[0]])
    rest = sea.net_buoyancy(plan) + 9.81 * density * truth["buoyancy_volume"].to_numpy()
    found = truth["net_buoyancy"].to_numpy() - rest
    np.testing.assert_allclose(found, share * 9.81 * plan.volume * (around - inside), atol=2e-3)
    assert found.max() > 0.3
    assert found.min() < -0.3
    assert len(truth) != len(bare.truth)


@pytest.mark.parametrize("speed", [0.05, 0.2, 0.4, 0.8, 1.3, 1.6])
@pytest.mark.parametrize("alpha", [-0.3, -0.03, 0.0, 0.03, 0.3])
def test_the_step_is_stable_for_every_fast_mode(speed: float, alpha: float) -> None:
    plan = trial(HYBRID)
    state = (speed, 0.5, alpha, 0.0)
    rates = jacobian(
        *state, body_of(plan.vehicle), plan.vehicle.polar, plan.vehicle.propeller, 1.0, 1020.0, 1.0, 0.0, 0.0, -4.0
    )
    z = plan.step * np.linalg.eigvals(rates)
    fast = z[z.real < 0.0]
    growth = np.abs(1.0 + fast + fast**2 / 2.0 + fast**3 / 6.0 + fast**4 / 24.0)
    assert growth.max() <= 1.0


@pytest.mark.parametrize("name", TRIALS)
def test_depth_and_place_are_the_integrals_of_the_motion_and_the_water(name: str) -> None:
    truth = trial_run(name)[1].truth
    afloat = truth["afloat"].to_numpy()
    down = -truth["speed"] * np.sin(truth["path_angle"]) - truth["vertical_water_velocity"]
    level = truth["speed"] * np.cos(truth["path_angle"])
    east = level * np.sin(truth["heading"]) + truth["current_east"]
    north = level * np.cos(truth["heading"]) + truth["current_north"]
    starts = np.flatnonzero(afloat[:-1] & ~afloat[1:]) + 1
    ends = np.flatnonzero(~afloat[:-1] & afloat[1:]) + 1
    assert len(starts) == sum(stage.end == "surface" for stage in trial(name).stages)
    for begin, end in zip(starts, ends, strict=True):
        time = np.arange(end - begin, dtype=float)
        for rate, place in ((down, "depth"), (east, "east"), (north, "north")):
            moved = CubicSpline(time, rate[begin:end]).integrate(0.0, time[-1])
            assert moved == pytest.approx(truth[place][end - 1] - truth[place][begin], abs=0.05), place


def test_gauss_markov_has_the_stated_sigma_and_correlation_time() -> None:
    white = np.random.default_rng(5).standard_normal(400_000)
    w = gauss_markov(white, 0.01, 300.0)
    assert w.std() == pytest.approx(0.01, rel=0.05)
    assert np.corrcoef(w[:-300], w[300:])[0, 1] == pytest.approx(math.exp(-1.0), abs=0.04)
    jumps = np.diff(w)
    assert jumps.std() == pytest.approx(0.01 * math.sqrt(2.0 / 300.0), rel=0.01)


def test_vertical_water_velocity_of_a_trial_has_the_plans_sigma() -> None:
    plan, simulated = trial_run(GLIDING)
    w = simulated.truth.loc[~simulated.truth["afloat"], "vertical_water_velocity"]
    effective = len(w) / (2.0 * plan.vertical_water_time)
    assert w.std() == pytest.approx(plan.vertical_water_std, rel=4.0 / math.sqrt(2.0 * effective))


@pytest.mark.parametrize("name", TRIALS)
def test_the_logs_in_raw_are_regenerated_byte_for_byte(name: str, tmp_path: Path) -> None:
    simulate(name, tmp_path, seed=0)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"ctd.csv", "attitude.csv", "engine.csv", "gps.csv", "mission.yaml", "truth.parquet"}
    for file in names - {"truth.parquet"}:
        assert (tmp_path / file).read_bytes() == (RAW / name / file).read_bytes(), file
    assert not (RAW / name / "truth.parquet").exists()


def test_truth_is_reproducible_to_the_bit_and_another_seed_differs() -> None:
    plan = dataclasses.replace(trial(HYBRID), stages=trial(HYBRID).stages[:5])
    one, same, other = run(plan, 3), run(plan, 3), run(plan, 4)
    pd.testing.assert_frame_equal(one.truth, same.truth, check_exact=True)
    for name, stream in one.streams.items():
        pd.testing.assert_frame_equal(stream, same.streams[name], check_exact=True)
    assert not np.allclose(
        one.truth["vertical_water_velocity"][500:700], other.truth["vertical_water_velocity"][500:700]
    )


def test_the_three_trials_together_take_less_than_6_mb() -> None:
    assert sum(file.stat().st_size for name in TRIALS for file in (RAW / name).iterdir()) <= 6_000_000


def test_truth_carries_its_coefficients_and_injections(tmp_path: Path) -> None:
    simulate(HYBRID, tmp_path, seed=2, injection=Injection(extra_parasite_drag=1.5, pitch_bias_deg=0.3))
    truth = store.read_table(tmp_path / "truth.parquet")
    assert list(truth.columns) == [column.name for column in TRUTH]
    assert np.allclose(np.diff(seconds(truth["time"])), 1.0)
    metadata = store.read_metadata(tmp_path / "truth.parquet")
    assert metadata["trial"] == HYBRID
    assert metadata["seed"] == "2"
    assert json.loads(metadata["coefficients"])["parasite_drag"] == pytest.approx(7.3579 + 1.5)
    assert json.loads(metadata["injection"])["pitch_bias_deg"] == 0.3
    assert "8.85" not in (tmp_path / "mission.yaml").read_text()


@pytest.mark.parametrize("name", TRIALS)
def test_each_instrument_keeps_its_own_clock(name: str) -> None:
    plan, simulated = trial_run(name)
    streams = simulated.streams
    for key, interval in (("ctd", plan.ctd_s), ("attitude", plan.attitude_s), ("engine", plan.engine_s)):
        steps = np.diff(streams[key]["time"])
        assert steps.min() > 0.0
        assert np.median(steps) == pytest.approx(interval, rel=0.01)
        assert steps[steps < 1.5 * interval].std() > 0.005 * interval
        assert np.isclose(steps, 2.0 * interval, rtol=0.2).sum() > 0  # samples lost one by one
    assert max(np.diff(streams[key]["time"]).max() for key in ("ctd", "attitude", "engine")) > 10.0
    shared = set(streams["ctd"]["time"]) & set(streams["attitude"]["time"])
    assert len(shared) < 0.01 * len(streams["ctd"])


def test_a_gyro_is_carried_where_the_plan_says_so_and_changes_no_other_instrument(tmp_path: Path) -> None:
    plan = dataclasses.replace(trial(GLIDING), gyro_s=1.0)
    _, without = trial_run(GLIDING)
    streams = instruments.observe(plan, without.truth, 0, 0.0)
    assert "gyro" not in without.streams
    time = seconds(without.truth["time"])
    error = streams["gyro"]["pitch_rate"] - np.interp(streams["gyro"]["time"], time, without.truth["pitch_rate"])
    assert np.degrees(error.std()) == pytest.approx(0.05, rel=0.05)
    assert abs(np.degrees(error.mean())) < 3.0 * LOGS["gyro"]["pitch_rate"].offset
    for name, frame in without.streams.items():
        pd.testing.assert_frame_equal(streams[name], frame, check_exact=True)
    instruments.write(plan, {"gyro": streams["gyro"].head(3)}, tmp_path, 0)
    assert (tmp_path / "gyro.csv").read_text().startswith("time,pitch_rate [deg/s]\n")


@pytest.mark.parametrize("name", TRIALS)
def test_instruments_see_the_truth_with_the_stated_noise_and_resolution(name: str) -> None:
    plan, simulated = trial_run(name)
    truth = simulated.truth
    time = seconds(truth["time"])
    for key, column, scale, sigma in (
        ("attitude", "pitch", 180.0 / math.pi, math.hypot(0.2, 0.1 / math.sqrt(12.0))),
        ("engine", "buoyancy_volume", 1e6, math.hypot(0.5, 1.0 / math.sqrt(12.0))),
        ("engine", "battery_position", 1e3, math.hypot(0.05, 0.1 / math.sqrt(12.0))),
    ):
        stream = simulated.streams[key]
        error = scale * (stream[column] - np.interp(stream["time"], time, truth[column]))
        assert error.std() == pytest.approx(sigma, rel=0.05)
        assert abs(error.mean()) < 5.0 * sigma / math.sqrt(len(stream))
        decimals = LOGS[key][column].decimals
        assert np.allclose(scale * stream[column], np.round(scale * stream[column], decimals), atol=1e-9)
    ctd = simulated.streams["ctd"]
    depth = np.linspace(0.0, float(truth["depth"].max()) + 1.0, 5000)
    weight = np.interp(ctd["pressure"], Sea.of(plan, depth).pressure, depth)
    error = weight - np.interp(ctd["time"], time, truth["depth"])
    assert error.std() == pytest.approx(0.02, rel=0.06)
    assert abs(error.mean()) < 0.1


@pytest.mark.parametrize("name", TRIALS)
def test_pressure_is_the_weight_of_the_water_above(name: str) -> None:
    plan, _ = trial_run(name)
    depth = np.linspace(0.0, plan.water.depth[-1], 3000)
    sea = Sea.of(plan, depth)
    layers = 0.5 * (sea.density[1:] + sea.density[:-1]) * np.diff(depth) * gsw.grav(plan.latitude, 0.0)
    assert 1e4 * np.diff(sea.pressure) == pytest.approx(layers, rel=3e-4)
    assert sea.pressure[0] == 0.0


@pytest.mark.parametrize("name", TRIALS)
def test_fixes_come_at_the_surface_only_with_three_metres_of_noise(name: str) -> None:
    plan, simulated = trial_run(name)
    truth, fixes = simulated.truth, simulated.streams["gps"]
    time = seconds(truth["time"])
    assert np.interp(fixes["time"], time, truth["afloat"].astype(float)).min() > 0.4
    surfacings = 1 + (np.diff(fixes["time"]) > 300.0).sum()
    assert surfacings == sum(stage.afloat for stage in plan.stages)
    north = gsw.distance(
        np.column_stack([np.full(len(fixes), plan.longitude)] * 2),
        np.column_stack([np.full(len(fixes), plan.latitude), fixes["latitude"]]),
    )[:, 0] * np.sign(fixes["latitude"] - plan.latitude)
    error = north - np.interp(fixes["time"], time, truth["north"])
    near = np.abs(north) < 300.0  # gsw.distance is on a sphere: wrong by up to half a percent of the way
    assert error[near].std() == pytest.approx(3.0, rel=0.2)


@pytest.mark.parametrize("name", TRIALS)
def test_net_buoyancy_follows_from_the_logs_and_mission_yaml(name: str) -> None:
    simulated = trial_run(name)[1]
    config = mission.load(RAW / name)
    ctd, engine = (simulated.streams[key] for key in ("ctd", "engine"))
    p, t, c = (ctd[key].to_numpy() for key in ("pressure", "temperature", "conductivity"))
    absolute = gsw.SA_from_SP(gsw.SP_from_C(10.0 * c, t, p), p, config.longitude, config.latitude)
    if config.salinity == "fresh":
        absolute = np.zeros_like(p)
    density = gsw.rho(absolute, gsw.CT_from_t(absolute, t, p), p)
    car = load(config.vehicle)
    assert config.ballast.neutral_density is not None
    hull = car["mass"] / config.ballast.neutral_density
    hull = hull * (1.0 - car["compressibility"] * 1e4 * p + car["thermal_expansion"] * (t - 15.0))
    volume = np.interp(ctd["time"], engine["time"], engine["buoyancy_volume"])
    force = 9.81 * (density * (hull + volume) - car["mass"])
    true = np.interp(ctd["time"], seconds(simulated.truth["time"]), simulated.truth["net_buoyancy"])
    error = (force - true)[p > 1.0]
    assert np.median(np.abs(error)) < 0.02
    assert abs(error.mean()) < 0.03


def test_noise_losses_and_pauses_are_those_of_the_plan() -> None:
    plan = dataclasses.replace(
        trial(GLIDING),
        stages=trial(GLIDING).stages[:4],
        sample_noise={"pitch": 0.4, "pressure": 0.08},
        lost=0.15,
        between_gaps=1500.0,
        gap=(120.0, 200.0),
    )
    simulated = run(plan, 3)
    time = seconds(simulated.truth["time"])
    sensed, ctd = simulated.streams["attitude"], simulated.streams["ctd"]
    pitch = np.degrees(sensed["pitch"] - np.interp(sensed["time"], time, simulated.truth["pitch"]))
    assert pitch.std() == pytest.approx(0.4, rel=0.06)
    true = Sea.of(plan, np.interp(ctd["time"], time, simulated.truth["depth"])).pressure
    assert (ctd["pressure"] - true).std() == pytest.approx(0.08, rel=0.06)
    for stream, interval in ((sensed, plan.attitude_s), (ctd, plan.ctd_s)):
        pauses = np.diff(stream["time"])
        pauses = pauses[pauses > 100.0]
        # Two pauses may overlap; single losses lengthen one by a few intervals.
        assert pauses.min() > 118.0
        assert np.median(pauses) < 200.0 + 10.0 * interval
        expected = (time[-1] - time[0]) / 1500.0
        assert len(pauses) == pytest.approx(expected, abs=3.0 * math.sqrt(expected))
        there = (time[-1] - time[0] - pauses.sum()) / interval
        assert 1.0 - len(stream) / there == pytest.approx(0.15, abs=0.02)


def nominal_error(name: str, stage: Stage, shallowest: float) -> NDArray[np.float64]:
    plan, simulated = trial_run(name)
    truth = simulated.truth
    stages = [i for i, other in enumerate(plan.stages) if dataclasses.replace(other, heading_deg=0.0) == stage]
    part = truth[truth["stage"].isin(stages) & (truth["depth"] > shallowest)]
    late = part.groupby("stage").cumcount() > 240
    return np.asarray(part.loc[late, "net_buoyancy"] - stage.net_buoyancy)


@pytest.mark.parametrize(
    ("name", "stage"),
    [
        (GLIDING, Stage(-30.0, -5.0, 0.0, "deeper", 965.0)),
        (GLIDING, Stage(30.0, 5.0, 0.0, "surface")),
        (HYBRID, Stage(-45.0, -7.0, 0.0, "deeper", 485.0)),
        (HYBRID, Stage(43.5, 7.0, 0.0, "surface", rpm=1400.0)),
    ],
)
def test_net_buoyancy_in_mid_water_is_nominal_within_one_newton(name: str, stage: Stage) -> None:
    error = nominal_error(name, stage, 120.0)
    assert len(error) > 500
    assert np.abs(error).max() < 1.0
    assert abs(error.mean()) < 0.5


def test_gliding_trial_is_six_dives_and_climbs_to_975_m() -> None:
    truth = trial_run(GLIDING)[1].truth
    assert (truth["propeller_speed"] == 0.0).all()
    deepest = truth.groupby((truth["afloat"].astype(int).diff() < 0).cumsum())["depth"].max()[1:]
    assert len(deepest) == 6
    assert deepest.between(970.0, 980.0).all()


def test_hybrid_trial_reproduces_the_held_pitch_speed_of_1_294_at_the_nominal_force() -> None:
    plan, simulated = trial_run(HYBRID)
    truth = simulated.truth
    climbs = [i for i, stage in enumerate(plan.stages) if stage.rpm > 0.0]
    assert len(climbs) >= 4
    part = truth[truth["stage"].isin(climbs)]
    part = part[part.groupby("stage").cumcount() > 90]
    assert np.degrees(part["pitch"].mean()) == pytest.approx(43.5, abs=0.3)
    at_nominal = part[np.abs(part["net_buoyancy"] - 7.0) < 0.05]
    assert at_nominal["speed"].mean() == pytest.approx(1.294, abs=0.006)
    assert truth["depth"].max() == pytest.approx(500.0, abs=5.0)


def test_fixed_depth_trial_keeps_the_published_depth_pitch_and_speed() -> None:
    plan, simulated = trial_run(LEVEL)
    truth = simulated.truth
    below = truth[~truth["afloat"]]
    assert below["depth"].max() <= 13.1
    assert below["depth"].mean() == pytest.approx(10.0, abs=1.0)
    stretches = [i for i, stage in enumerate(plan.stages) if stage.pitch_deg == 3.5]
    part = truth[truth["stage"].isin(stretches)]
    part = part[part.groupby("stage").cumcount() >= 15]
    # The first stretch of a leg begins while the engine still pumps.
    settled = part[np.abs(part["net_buoyancy"] - 2.5) < 0.1]
    assert len(settled) > 0.9 * len(part)
    assert np.degrees(settled["pitch"].mean()) == pytest.approx(3.5, abs=0.1)
    assert settled["speed"].mean() == pytest.approx(0.615, abs=0.003)
    assert np.allclose(settled["propeller_speed"] * 60.0, 780.0)
    assert settled.groupby("stage").size().median() >= 100


def test_only_reciprocal_legs_give_the_speed_of_the_fixed_depth_trial() -> None:
    plan, simulated = trial_run(LEVEL)
    truth, fixes = simulated.truth, simulated.streams["gps"]
    time = seconds(truth["time"])
    degree = math.radians(1.0) * 6378137.0 / math.sqrt(1 - 0.00669438 * math.sin(math.radians(plan.latitude)) ** 2)
    east = ((fixes["longitude"] - plan.longitude) * degree * math.cos(math.radians(plan.latitude))).to_numpy()
    clock = fixes["time"].to_numpy()
    gaps = np.flatnonzero(np.diff(clock) > 300.0)
    afloat = truth["afloat"].to_numpy()
    speeds = []
    for gap in gaps:
        inside = (time > clock[gap]) & (time < clock[gap + 1])
        submerged = (inside & ~afloat).sum()
        drift = np.polyfit(clock[max(0, gap - 40) : gap + 1] - clock[gap], east[max(0, gap - 40) : gap + 1], 1)[0]
        dry = clock[gap + 1] - clock[gap] - submerged
        speeds.append((east[gap + 1] - east[gap] - drift * dry) / submerged)
        assert 840.0 < submerged < 1200.0
    assert len(speeds) == 8
    signs = np.where(np.arange(8) % 2 == 0, 1.0, -1.0)
    single = signs * speeds
    pairs = single.reshape(-1, 2).mean(axis=1)
    # Held flight at 0.615 m/s climbs at 4.5 degrees: 0.613 m/s along the ground.
    assert np.abs(single / 0.613 - 1.0).min() > 0.05
    assert np.abs(pairs / 0.613 - 1.0).max() < 0.03
    assert pairs.mean() == pytest.approx(0.613, rel=0.01)


def speed_of(simulated: Simulated, plan: Plan, stage: int) -> float:
    return float(held(plan, simulated.truth, stage)["speed"].mean())


def test_extra_drag_slows_a_glide_as_the_square_root() -> None:
    plan, clean = flown(GLIDING)
    _, dragged = flown(GLIDING, Injection(extra_parasite_drag=0.10 * 7.3579))
    # estimation.md's table: V_force falls by 4.6 % for 10 % of K_D0.
    assert speed_of(dragged, plan, 1) / speed_of(clean, plan, 1) - 1.0 == pytest.approx(-0.046, abs=0.003)


def test_buoyancy_offset_acts_on_the_motion_and_not_on_the_logs() -> None:
    plan, clean = flown(GLIDING)
    _, light = flown(GLIDING, Injection(buoyancy_offset=0.3))
    a, b = held(plan, clean.truth, 1), held(plan, light.truth, 1)
    assert b["net_buoyancy"].mean() - a["net_buoyancy"].mean() == pytest.approx(0.3, abs=0.01)
    assert b["buoyancy_volume"].mean() == pytest.approx(a["buoyancy_volume"].mean(), abs=1e-9)
    assert speed_of(light, plan, 1) < speed_of(clean, plan, 1)
    assert speed_of(light, plan, 2) > speed_of(clean, plan, 2)


def test_thrust_scale_acts_under_power_alone() -> None:
    plan, clean = flown(HYBRID)
    _, weak = flown(HYBRID, Injection(thrust_scale=0.724))
    assert speed_of(weak, plan, 1) == pytest.approx(speed_of(clean, plan, 1), abs=1e-6)
    # paper/README.md: thrust × 0.724 takes 1.294 to 1.2 m/s.
    assert speed_of(weak, plan, 3) / speed_of(clean, plan, 3) == pytest.approx(1.2 / 1.294, abs=0.005)


def test_thrust_follows_a_voltage_that_is_logged_only_where_the_plan_has_one(tmp_path: Path) -> None:
    plan, clean = flown(HYBRID)
    assert "battery" not in clean.streams
    hours = len(clean.truth) / 3600.0
    fading = dataclasses.replace(plan, battery_full=30.0, battery_fall=6.0 / hours)
    weak = run(fading, injection=Injection(thrust_by_voltage=2.0))
    truth, log = weak.truth, weak.streams["battery"]
    elapsed = seconds(truth["time"]) - plan.start
    np.testing.assert_allclose(
        log["battery_voltage"], 30.0 - 6.0 / hours * (log["time"] - plan.start) / 3600.0, atol=0.01
    )
    density = Sea.of(plan, truth["depth"].to_numpy()).density
    rotation, speed, car = truth["propeller_speed"], truth["speed"], plan.vehicle
    nominal = density * 0.08**3 * rotation * (car["thrust_static"] * 0.08 * rotation + car["thrust_slope"] * speed)
    turning = (rotation > 5.0).to_numpy()
    expected = 1.0 + 2.0 * (-6.0 / hours * elapsed / 3600.0 / 30.0)
    np.testing.assert_allclose((truth["thrust"] / nominal)[turning], expected[turning], rtol=1e-4)
    assert speed_of(weak, plan, 1) == pytest.approx(speed_of(clean, plan, 1), abs=1e-6)
    assert speed_of(weak, plan, 3) < speed_of(clean, plan, 3) - 0.02
    held_thrust = run(fading)
    pd.testing.assert_frame_equal(held_thrust.truth, clean.truth)
    pd.testing.assert_frame_equal(held_thrust.streams["engine"], clean.streams["engine"])
    instruments.write(fading, {"battery": log.head(3)}, tmp_path, 0)
    assert (tmp_path / "battery.csv").read_text().startswith("time,battery_voltage [V]\n")


def test_pitch_bias_is_logged_and_misleads_the_autopilot() -> None:
    plan, clean = flown(GLIDING)
    _, biased = flown(GLIDING, Injection(pitch_bias_deg=1.0))
    stream = biased.streams["attitude"]
    time = seconds(biased.truth["time"])
    logged = stream["pitch"] - np.interp(stream["time"], time, biased.truth["pitch"])
    assert np.degrees(logged.mean()) == pytest.approx(1.0, abs=0.01)
    shift = held(plan, biased.truth, 1)["pitch"].mean() - held(plan, clean.truth, 1)["pitch"].mean()
    assert np.degrees(shift) == pytest.approx(-1.0, abs=0.05)


def test_battery_offset_shifts_the_logged_position_that_holds_the_same_pitch() -> None:
    plan, clean = flown(GLIDING)
    _, shifted = flown(GLIDING, Injection(battery_offset=0.003))
    a, b = held(plan, clean.truth, 1), held(plan, shifted.truth, 1)
    assert b["pitch"].mean() == pytest.approx(a["pitch"].mean(), abs=math.radians(0.05))
    assert b["battery_position"].mean() - a["battery_position"].mean() == pytest.approx(-0.003, abs=2e-4)


@pytest.mark.parametrize("name", TRIALS)
def test_mission_yaml_is_a_valid_mission_that_names_the_papers_figures(name: str) -> None:
    config = mission.load(RAW / name)
    assert config.vehicle == "petrel-ii"
    assert config.description.startswith("Simulated")
    assert set(config.files["engine.csv"].columns) == {"buoyancy_volume", "battery_position", "propeller_speed"}
    assert config.nominal == list(trial(name).nominal)


def test_an_unknown_trial_is_answered_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        simulate("petrel2-scs-2104", tmp_path)
    assert str(error.value) == (
        "simulate: trial: found 'petrel2-scs-2104'; expected a known trial; did you mean 'petrel2-scs-2014'?"
    )
    assert not list(tmp_path.iterdir())


def test_orders_that_cannot_be_carried_out_are_named() -> None:
    plan = trial(GLIDING)
    stages = (dataclasses.replace(plan.stages[1], net_buoyancy=2.0), *plan.stages[2:3])
    with pytest.raises(InputError) as error:
        run(dataclasses.replace(plan, stages=stages, longest=600.0))
    assert str(error.value) == (
        "petrel2-scs-2014: order 1 of 2: found not done after 601 s, at 0 m; expected deeper 965; "
        "change the order's net buoyancy or pitch, or let the mission last longer"
    )


def test_a_vehicle_too_weak_to_surface_is_reported_and_not_tumbled_on() -> None:
    plan = trial(GLIDING)
    stages = tuple(
        dataclasses.replace(s, net_buoyancy=0.4 * s.net_buoyancy, pitch_deg=1.5 * s.pitch_deg) for s in plan.stages[:4]
    )
    with pytest.raises(InputError, match=r"order 3 of 4: found not done after \d+ s, at \d+ m; expected surface 0"):
        run(dataclasses.replace(plan, stages=stages), 1)


def test_a_vehicle_without_moments_cannot_be_simulated() -> None:
    plan = trial(GLIDING)
    poor = plan.vehicle.with_values({"moment_slope": math.nan}, "unknown")
    with pytest.raises(InputError, match=r"petrel-ii\.yaml: moment_slope: found no value; expected a number"):
        run(dataclasses.replace(plan, vehicle=poor))


def test_floating_is_not_ordered_under_water() -> None:
    plan = trial(GLIDING)
    stages = (plan.stages[0], dataclasses.replace(plan.stages[1], value=40.0), plan.stages[-1])
    with pytest.raises(InputError) as error:
        run(dataclasses.replace(plan, stages=stages))
    assert str(error.value) == (
        "petrel2-scs-2014: order 3 of 3: found afloat at 40 m; expected an order to float at the surface; "
        "end the order before it at the surface"
    )


def test_a_folder_with_files_of_others_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "ctd.csv").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError) as error:
        simulate("petrel2-scs-2014", tmp_path)
    assert "found a folder with files that no simulation wrote" in str(error.value)
    assert [path.read_text(encoding="utf-8") for path in tmp_path.iterdir()] == ["mine"]

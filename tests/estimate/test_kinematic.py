"""The kinematic estimator: against simulated truth, its symmetries, what it must not know, and real sensors."""

import math
from collections.abc import Callable
from dataclasses import replace

import arrays
import numpy as np
import pandas as pd
import pytest
from dives import fly
from truth import Trial

from benchmarks import fleet
from pipeline.estimate import kinematic, smoother, stage
from pipeline.estimate.linearise import CRUISE, FOLLOWED, SPEED, Considered, Sources, Trajectory, follow, linearise
from pipeline.estimate.settings import Settings
from pipeline.estimate.trajectory import first_guess, iterate
from pipeline.mission import Mission
from pipeline.model.steady import trim_at_pitch
from pipeline.records import ESTIMATES, Phase, conform, of_method, seconds
from pipeline.vehicle import Coefficient, Vehicle, load

GLIDING, LEVEL, CLIMBING = "petrel2-scs-2014", "petrel2-danjiangkou-2014", "petrel2-scs-2015"
TRUE_NAMES = ("speed", "angle_of_attack", "path_angle", "vertical_water_velocity")


def estimate(records: pd.DataFrame, craft: Vehicle, settings: Mission, *, engine: str = "numba") -> stage.Estimated:
    """Return what the kinematic estimator alone hands on."""
    return stage.estimate(records, craft, settings, engine=engine, methods=("kinematic",))


def of(case: Trial) -> pd.DataFrame:
    """Return the kinematic estimates of a trial."""
    found = case.estimated.estimates
    return found[found["method"] == "kinematic"].reset_index(drop=True)


def short(records: pd.DataFrame, rows: int) -> pd.DataFrame:
    """Return the first `rows` records of the first dive."""
    start = int(np.argmax(records["phase"].to_numpy() == Phase.DESCENT))
    return records.iloc[start : start + rows].reset_index(drop=True)


@pytest.mark.parametrize("name", [GLIDING, LEVEL, CLIMBING])
def test_true_speed_lies_in_the_95_percent_interval_for_90_percent_or_more(
    trial: Callable[[str], Trial], name: str
) -> None:
    """Errors within a mission go together, so that one mission may have them all inside."""
    case = trial(name)
    found = of(case)
    seen = found["observable"].to_numpy()
    gap = np.abs(found["speed"].to_numpy() - case.true("speed"))[seen]
    inside = np.mean(gap < 1.96 * found["speed_std"].to_numpy()[seen])
    assert inside >= 0.90
    assert seen.mean() > 0.6


def test_gliding_speed_and_angle_of_attack_are_as_sharp_as_depth_allows(trial: Callable[[str], Trial]) -> None:
    """Vertical water velocity of 1 cm/s at −30° leaves 2 cm/s; in steady flight the closure is exact."""
    case = trial(GLIDING)
    found = of(case)
    seen = found["observable"].to_numpy()
    error = {name: (found[name].to_numpy() - case.true(name))[seen] for name in TRUE_NAMES}
    assert np.sqrt(np.mean(error["speed"] ** 2)) < 0.025
    assert abs(np.mean(error["speed"])) < 0.01
    assert np.sqrt(np.mean(error["angle_of_attack"] ** 2)) < np.radians(0.35)
    assert np.sqrt(np.mean(error["vertical_water_velocity"] ** 2)) < 0.015


@pytest.mark.parametrize("name", ["speed", "vertical_water_velocity"])
def test_without_a_ctd_the_truth_lies_in_the_95_percent_interval_for_85_percent_or_more(
    trial: Callable[[str], Trial], name: str
) -> None:
    """What V does in water of unknown density is searched with the water's motion: fixed, it leaves w_w 38 %.

    Errors of w_w last for minutes, so that one mission may have a tenth of them outside more than another.
    """
    case = trial(GLIDING)
    water = ("temperature", "conductivity", "salinity", "absolute_salinity", "conservative_temperature", "density")
    found = estimate(case.records.assign(**dict.fromkeys(water, np.nan)), case.vehicle, case.mission).estimates
    seen = found["observable"].to_numpy()
    gap = np.abs(found[name].to_numpy() - case.true(name))[seen]
    assert np.mean(gap < 1.96 * found[f"{name}_std"].to_numpy()[seen]) >= 0.85
    assert seen.mean() > 0.6


def test_level_powered_speed_comes_from_the_fixes(trial: Callable[[str], Trial]) -> None:
    case = trial(LEVEL)
    gps = case.estimated.report["gps"]
    held = (np.abs(np.degrees(case.true("pitch")) - 3.5) < 0.5) & (case.records["block"].to_numpy() >= 0)
    truth = case.true("speed")[held].mean()
    assert truth == pytest.approx(0.615, abs=0.005)
    assert abs(gps["speed"] - truth) < 2.5 * gps["speed_std"]
    assert gps["speed_std"] < 0.02
    assert len(gps["legs"]) == 8


def test_level_powered_speed_without_fixes_is_unobservable_and_nan(trial: Callable[[str], Trial]) -> None:
    case = trial(LEVEL)
    blind = estimate(case.records, case.vehicle, case.mission.model_copy(update={"gps": "ignore"})).estimates
    held = case.records["block"].to_numpy() >= 0
    assert not blind["observable"][held].any()
    assert blind.loc[held, ["speed", "speed_std", "angle_of_attack", "path_angle"]].isna().all(axis=None)
    assert set(blind.loc[held, "reason"]) == {
        "powered and near level: depth carries no speed and no fixes determine it"
    }


@pytest.mark.parametrize("factor", [0.9, 1.1, 3.0])
def test_a_common_factor_on_all_coefficients_changes_nothing(trial: Callable[[str], Trial], factor: float) -> None:
    case = trial(CLIMBING)
    records = short(case.records, 1500)
    values = {
        name: case.vehicle[name] * factor for name in ("lift_at_zero", "lift_slope", "parasite_drag", "induced_drag")
    }
    before = estimate(records, case.vehicle, case.mission).estimates
    after = estimate(records, case.vehicle.with_values(values, "scaled"), case.mission).estimates
    for name in ("speed", "speed_std", "angle_of_attack", "angle_of_attack_std"):
        np.testing.assert_allclose(after[name], before[name], rtol=1e-12, atol=0.0, err_msg=name)


def test_net_buoyancy_thrust_and_propeller_speed_do_not_reach_the_estimate(trial: Callable[[str], Trial]) -> None:
    case = trial(CLIMBING)
    records = short(case.records, 1500)
    other = records.assign(
        buoyancy_volume=2.0 * records["buoyancy_volume"] + 1e-4, propeller_speed=1.3 * records["propeller_speed"]
    )
    stronger = case.vehicle.with_values({"thrust_static": 1.0, "mass": 99.0, "battery_mass": 3.0}, "changed")
    before = estimate(records, case.vehicle, case.mission).estimates
    after = estimate(other, stronger, case.mission).estimates
    pd.testing.assert_frame_equal(after, before, check_exact=True)


def test_a_mission_mirrored_in_depth_and_pitch_gives_mirrored_results(trial: Callable[[str], Trial]) -> None:
    case = trial(GLIDING)
    records = short(case.records, 4000).iloc[300:].reset_index(drop=True)  # the surface has no mirror image
    swap = {int(Phase.ASCENT): int(Phase.DESCENT), int(Phase.DESCENT): int(Phase.ASCENT)}
    mirrored = records.assign(
        depth=1000.0 - records["depth"], pitch=-records["pitch"], phase=records["phase"].replace(swap).astype("int8")
    )
    settings = case.mission.model_copy(update={"gps": "ignore"})
    before = estimate(records, case.vehicle, settings).estimates
    after = estimate(mirrored, case.vehicle, settings).estimates
    np.testing.assert_allclose(after["speed"], before["speed"], rtol=1e-6)
    np.testing.assert_allclose(after["speed_std"], before["speed_std"], rtol=1e-6)
    for name in ("angle_of_attack", "path_angle", "pitch", "vertical_water_velocity"):
        np.testing.assert_allclose(after[name], -before[name], rtol=1e-5, atol=1e-8, err_msg=name)


def test_filterpy_gives_the_same_estimates_to_1e9(trial: Callable[[str], Trial]) -> None:
    case = trial(CLIMBING)
    records = short(case.records, 400)
    ours = estimate(records, case.vehicle, case.mission).estimates
    theirs = estimate(records, case.vehicle, case.mission, engine="filterpy").estimates
    for name in ("speed", "speed_std", "angle_of_attack", "path_angle", "depth", "vertical_water_velocity"):
        np.testing.assert_allclose(theirs[name], ours[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_a_held_out_speed_sensor_is_compared_but_not_used(trial: Callable[[str], Trial]) -> None:
    case = trial(GLIDING)
    records = short(case.records, 4000)
    sensor = records.assign(
        speed_through_water=np.interp(np.arange(4000), [0, 3999], [0.9, 1.1]),
        speed_through_water_std=0.01,
        speed_through_water_qc=np.int8(1),
    )
    without = estimate(records, case.vehicle, case.mission)
    checked = estimate(sensor, case.vehicle, case.mission)
    pd.testing.assert_frame_equal(checked.estimates, without.estimates)
    assert without.report["coverage"] is None
    assert checked.report["coverage"]["bias"] < -0.3
    used = estimate(sensor, case.vehicle, case.mission.model_copy(update={"speed_sensor": "use"}))
    assert used.estimates["speed"].median() > 0.9


def test_speed_at_25_degrees_is_known_to_2_cm_s_in_a_dive_of_an_hour() -> None:
    """The mean over three missions: σ of w_w, which each finds for itself, makes the difference between them.

    The median of each: at the ends of steady flight the manoeuvres are still felt.
    """
    missions = [fly(seed, dives=((25.0, 3.0, 330.0),), every=4) for seed in range(3)]
    found = [estimate(flown.records, flown.vehicle, flown.mission).estimates for flown in missions]
    steady = [(flown.records["block"] >= 0).to_numpy() for flown in missions]
    assert np.mean([table["speed_std"][where].median() for table, where in zip(found, steady, strict=True)]) < 0.02
    errors = [
        (table["speed"] - flown.truth["speed"])[where]
        for flown, table, where in zip(missions, found, steady, strict=True)
    ]
    assert np.sqrt(np.mean([np.mean(error**2) for error in errors])) < 0.02
    for flown in missions:
        assert 3000.0 < (flown.truth["time"].iloc[-1] - flown.truth["time"].iloc[0]).total_seconds() < 4200.0


def test_a_speed_sensor_alone_in_level_flight_is_known_no_better_than_its_scale(trial: Callable[[str], Trial]) -> None:
    case = trial(LEVEL)
    level = (case.records["block"].to_numpy() >= 0) & (np.abs(np.degrees(case.true("pitch")) - 3.5) < 0.5)
    first = int(np.argmax(level))
    part = slice(first, first + int(np.argmin(level[first:])))
    truth = case.true("speed")[part]
    rng = np.random.default_rng(3)
    sensor = case.records.iloc[part].assign(
        speed_through_water=0.96 * truth + 0.01 * rng.standard_normal(truth.size),
        speed_through_water_std=0.01,
        speed_through_water_qc=np.int8(1),
    )
    settings = {"speed_sensor": "use", "speed_sensor_scale_std": 0.05}
    found = estimate(sensor.reset_index(drop=True), case.vehicle, case.mission.model_copy(update=settings))
    error, std = found.estimates["speed"] - truth, found.estimates["speed_std"]
    assert (std > 0.045 * truth).all()
    assert (np.abs(error) < 1.96 * std).all()
    entry = found.report["speed_scale"]["kinematic"]
    assert not entry["determined"]
    assert entry["std"] == pytest.approx(0.05, rel=0.1)


def test_a_speed_sensor_of_1_cm_s_gives_speed_to_4_mm_s(trial: Callable[[str], Trial]) -> None:
    case = trial(GLIDING)
    truth = case.true("speed")
    rng = np.random.default_rng(1)
    sensor = case.records.assign(
        speed_through_water=truth + 0.01 * rng.standard_normal(truth.size),
        speed_through_water_std=0.01,
        speed_through_water_qc=np.int8(1),
    )
    found = estimate(sensor, case.vehicle, case.mission.model_copy(update={"speed_sensor": "use"})).estimates
    steady = case.records["block"].to_numpy() >= 0
    assert np.sqrt(np.mean((found["speed"] - truth)[steady] ** 2)) < 0.004
    assert found["speed_std"][steady].mean() < 0.004


@pytest.mark.parametrize(
    "damage", ["one sample", "two samples", "no pitch", "no depth", "gap", "dropouts", "stuck", "spikes"]
)
def test_hostile_series_give_finite_numbers_or_nan_with_a_reason(trial: Callable[[str], Trial], damage: str) -> None:
    case = trial(GLIDING)
    records = short(case.records, 3000)
    rng = np.random.default_rng(2)
    if damage == "one sample":
        records = records.iloc[:1]
    elif damage == "two samples":
        records = records.iloc[:2]
    elif damage == "no pitch":
        records = records.assign(pitch=np.nan)
    elif damage == "no depth":
        records = records.assign(depth=np.nan, pressure=np.nan)
    elif damage == "gap":
        records = pd.concat([records.iloc[:800], records.iloc[2200:]]).reset_index(drop=True)
    elif damage == "dropouts":
        keep = rng.random(3000) > 0.4
        records = records[keep].reset_index(drop=True)
    elif damage == "stuck":
        records = records.assign(pitch=records["pitch"].where(records["pitch"].isna(), records["pitch"].median()))
    else:
        spike = np.where(rng.random(3000) < 0.01, 100.0, 0.0)
        records = records.assign(depth=records["depth"] + spike)
    found = estimate(records, case.vehicle, case.mission).estimates
    conform(found, ESTIMATES)
    seen = found["observable"].to_numpy()
    numbers = found[["speed", "speed_std", "angle_of_attack", "path_angle", "vertical_water_velocity"]].to_numpy()
    assert np.isfinite(numbers[seen]).all()
    assert np.isnan(numbers[~seen]).all()
    assert (found.loc[~seen, "reason"] != "").all()
    if damage in ("one sample", "two samples", "no pitch", "no depth"):
        assert not seen.any()
    else:
        truth = np.interp(
            found["time"].astype("int64"), case.truth["time"].astype("int64"), case.truth["speed"].to_numpy()
        )
        far = np.abs(found["speed"].to_numpy() - truth)[seen] > 1.96 * found["speed_std"].to_numpy()[seen]
        assert far.mean() < 0.2


def test_an_unknown_engine_is_refused_with_the_nearest_name(trial: Callable[[str], Trial]) -> None:
    case = trial(GLIDING)
    with pytest.raises(ValueError, match=r"^engine: found 'filterpi'; did you mean 'filterpy'\?$"):
        estimate(case.records, case.vehicle, case.mission, engine="filterpi")


# --- How V follows the pitch under power ------------------------------------------------------------------------------


def test_what_v_follows_of_the_pitch_under_power_is_within_what_is_taken() -> None:
    """Theory of Petrel-II at 600 to 1400 rpm: a share between 0 and 1 of what V would do in a glide."""
    rng = np.random.default_rng(0)
    side, step = rng.choice([-1.0, 1.0], 2000), 1e-4
    pitch, force = side * np.radians(rng.uniform(15.0, 50.0, 2000)), side * rng.uniform(2.0, 12.0, 2000)
    turning = rng.uniform(10.0, 23.0, 2000)
    here, more, less = (
        trim_at_pitch(load("petrel-ii"), force, pitch + change, propeller_speed=turning)
        for change in (0.0, step, -step)
    )
    share = (more.speed - less.speed) / (2.0 * step) / here.speed * 2.0 * np.tan(here.path_angle)
    share = share[np.isfinite(share)]
    assert share.size > 1900
    assert share.min() > 0.0
    assert share.max() < 1.0
    assert np.all(np.abs(share - FOLLOWED[0]) < 1.96 * FOLLOWED[1])


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_only_under_power_is_it_open_how_v_follows_the_pitch(side: float) -> None:
    """A dive that flattens, a climb that steepens: half of a glide's change of V, late by ℓ/2V, with its 1-sigma."""
    time, polar = np.arange(0.0, 40.0, 4.0), load("petrel-ii").polar
    pitch = side * np.linspace(0.6, 0.62, time.size)
    at = Trajectory(np.full(time.size, 0.5), pitch, np.zeros(time.size), np.zeros(time.size))
    unknown = Considered(0.0, np.empty((0, 2, 5)))
    still = replace(arrays.series(time, pitch), stratification=np.zeros(time.size))
    gliding, driven = (
        linearise(series, follow(series, polar, at, unknown), Settings(), Sources(False, False))
        for series in (replace(still, powered=np.full(time.size, on)) for on in (False, True))
    )
    assert not gliding.shift[:, :, 2].any()
    late, steps = pitch[0], []
    for ahead in pitch[1:]:
        steps.append((ahead - late) * (1.0 - math.exp(-4.0 * 2.0 * 0.5 / 11.5)))
        late += steps[-1]
    gained = 0.5 * np.array(steps) / np.tan(pitch[:-1])
    assert gained.min() > 0.0
    np.testing.assert_allclose(driven.rows[:-1, 1, SPEED] - 1.0, FOLLOWED[0] * gained, rtol=1e-9)
    np.testing.assert_allclose(driven.shift[:-1, 1, 2], 0.5 * FOLLOWED[1] * gained, rtol=1e-9)


def test_the_speed_of_a_cruise_moves_the_position_and_not_the_depth() -> None:
    """At 3° of pitch depth would tell V by a twentieth, and what is wrong with the pitch would be taken for speed."""
    time, polar, pitch = np.arange(0.0, 40.0, 4.0), load("petrel-ii").polar, 0.05
    still = replace(arrays.series(time, pitch), powered=np.ones(time.size, dtype=bool), heading=np.zeros(time.size))
    at = Trajectory(np.full(time.size, 0.8), still.pitch, np.zeros(time.size), np.zeros(time.size))
    cruise, other = (
        linearise(series, follow(series, polar, at, None), Settings(), Sources(False, True))
        for series in (replace(still, cruising=np.full(time.size, on)) for on in (True, False))
    )
    np.testing.assert_array_equal(cruise.rows[:-1, 0, [SPEED, CRUISE]], 0.0)
    np.testing.assert_allclose(other.rows[:-1, 0, SPEED], -4.0 * np.sin(pitch))
    np.testing.assert_allclose(cruise.rows[:-1, 3, CRUISE], 4.0 * np.cos(pitch))
    np.testing.assert_allclose(cruise.shift[:-1, 0, 0], other.shift[:-1, 0, 0] - 4.0 * 0.8 * np.sin(pitch))


@pytest.mark.parametrize("seed", [41003, 41062])
def test_short_yos_whose_turns_pitch_does_not_show_do_not_become_motion_of_the_water(
    seed: int,
) -> None:
    """Legs of two minutes, pitch once a minute: what it was between two samples is open, not on a straight line."""
    _, flown = fleet.first_flown(seed, fleet.SPARSE_S)
    found = of_method(stage.estimate(flown.records, flown.vehicle, flown.mission).estimates, "kinematic")
    true = np.interp(seconds(flown.records["time"]), seconds(flown.truth["time"]), flown.truth["speed"])
    seen = found["observable"].to_numpy()
    gap = np.abs(found["speed"] - true)[seen]
    assert seen.mean() > 0.05
    assert np.mean(gap < 1.96 * found["speed_std"][seen]) > 0.9
    assert np.sqrt(np.mean(gap**2)) < 0.15
    assert np.abs(found["vertical_water_velocity"][seen]).max() < 0.1


def test_slow_changes_of_the_depth_rate_under_power_do_not_draw_the_speed_up() -> None:
    """Half of each is taken for α's. At a higher V a smaller δ explains the same, and is the more probable one."""
    time, speed, pitch, found = np.arange(0.0, 1500.0, 3.0), 0.9, 0.26, []
    settings, polar = Settings(sigma_w=0.02, tau_w=500.0), load("petrel-ii").polar
    for seed in range(6):
        rng = np.random.default_rng(seed)
        steps = rng.standard_normal((3, time.size))
        water, left = np.zeros(time.size), np.exp(-3.0 / settings.tau_w)
        for k in range(1, time.size):
            water[k] = left * water[k - 1] + settings.sigma_w * np.sqrt(1.0 - left**2) * steps[0, k]
        depth = 300.0 - 3.0 * np.cumsum(speed * np.sin(pitch) + water) + settings.depth_noise * steps[1]
        flown = replace(
            arrays.series(time, pitch + settings.pitch_noise * steps[2], depth),
            **dict.fromkeys(("powered", "gentle"), np.ones(time.size, dtype=bool)),
            pitch_guess=np.full(time.size, pitch),
            depth_rate_guess=np.full(time.size, -speed * np.sin(pitch)),
            stratification=np.zeros(time.size),
        )
        at = iterate(flown, polar, settings, first_guess(flown, polar), Sources(False, False), smoother.solve, 12)
        found.append(at.speed[time.size // 2])
    assert np.mean(found) == pytest.approx(speed, abs=0.03)


@pytest.mark.parametrize(("value", "std"), [(-2.0, 1.0), (0.01, 5.0), (-0.5, 5.0), (0.0, 1.0)])
def test_lift_at_zero_is_moved_by_its_whole_1_sigma_whatever_its_sign(value: float, std: float) -> None:
    borrowed = load("petrel-ii")
    lift = Coefficient(value, std, "kg/m", "made up")
    moved = replace(borrowed, coefficients={**borrowed.coefficients, "lift_at_zero": lift})
    assert kinematic._moved(moved, "lift_at_zero") == (value + std, value - std)
    sure = replace(borrowed.coefficients["parasite_drag"], value=1.0, std=5.0)
    up, down = kinematic._moved(replace(borrowed, coefficients={"parasite_drag": sure}), "parasite_drag")
    assert up == 6.0
    assert 0.0 < down < 1.0

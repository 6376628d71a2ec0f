"""Thrust that follows the battery's voltage: found where it does, left alone where it does not, absent without one."""

import dataclasses
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from synthetic import blocks, inputs, steady

from pipeline import instruments, mission
from pipeline.estimate.stage import InMemory, stream
from pipeline.ingest import ingest
from pipeline.mission import Mission
from pipeline.plan import Plan, Stage
from pipeline.report import build
from pipeline.report.fitting.experiment import candidates
from pipeline.report.fitting.fit import FREE, fit
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.hypotheses import rank
from pipeline.report.fitting.points import Points
from pipeline.report.fitting.sea import sea
from pipeline.report.fitting.selection import experiment
from pipeline.report.rounding import uncertainty
from pipeline.simulate import Injection, run
from pipeline.trials import trial
from pipeline.vehicle import Coefficient, Vehicle

CALM = {"sigma_w": 0.002, "tau_w": 300.0}
NAME = "thrust_by_voltage"
FULL, EMPTY = 30.0, 24.0


def flown(exponent: float, *, full: float = FULL, empty: float = EMPTY, seed: int = 0) -> pd.DataFrame:
    """Return dives with powered climbs, the voltage falling from `full` to `empty`, thrust U to the `exponent`."""
    table = blocks(dives=10, powered_climbs=True, sigma_w=CALM["sigma_w"], seed=seed)
    table["battery_voltage"] = np.linspace(full, empty, len(table))
    middle = table.loc[table["powered"], "battery_voltage"].mean()
    for i, row in table[table["powered"]].iterrows():
        setting = (row["net_buoyancy"], row["pitch"], row["propeller_speed"])
        factor = 1.0 + exponent * (row["battery_voltage"] / middle - 1.0)
        (logged, path), (true, true_path) = steady(*setting), steady(*setting, thrust=factor)
        table.loc[i, "depth_rate"] += logged * math.sin(path) - true * math.sin(true_path)
    return table


def solve(vehicle: Vehicle, table: pd.DataFrame, free=None, **options):
    return fit(table, vehicle, Given(**({"settings": CALM} | options)), free=free, resamples=10)


def found(result) -> dict[str, dict]:
    return {item["name"]: item for item in result["parameters"]}


def mentioned(result) -> set[str]:
    """Return every correction that a fit speaks of: fitted, tried, borrowed."""
    chosen = result["selection"]
    lists = (result["parameters"], chosen["accepted"], chosen["rejected"], result["borrowed"])
    return {item["name"] for items in lists for item in items}


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_thrust_that_follows_the_voltage_is_freed_and_its_interval_holds_the_truth(petrel, exponent):
    result = solve(petrel, flown(exponent))
    assert NAME in [item["name"] for item in result["selection"]["accepted"]], result["text"]
    item = found(result)[NAME]
    low, high = item["interval_95"]
    assert low < exponent < high
    assert 4.0 * item["std"] < exponent
    assert item["verdict"] == "determined by the data"
    assert item["prior_std"] == 1.0
    assert "b_U     freed" in result["text"]


def test_a_voltage_that_thrust_does_not_follow_is_tried_and_not_freed(petrel):
    for seed in range(5):
        result = solve(petrel, flown(0.0, seed=seed))
        assert list(found(result)) == list(FREE)
        tried = {item["name"]: item["why"] for item in result["selection"]["rejected"]}
        assert tried[NAME].startswith("not needed: Schwarz's criterion changes by")


def test_asked_for_it_holds_nought_where_thrust_does_not_follow(petrel):
    held = 0
    for seed in range(8):
        item = found(solve(petrel, flown(0.0, seed=seed), free=(*FREE, NAME)))[NAME]
        held += item["interval_95"][0] < 0.0 < item["interval_95"][1]
    assert held >= 6  # of 8 at 95 %: fewer has a chance of 0.6 %


@pytest.mark.parametrize(
    "table",
    [
        flown(0.0, full=28.0, empty=28.0),
        flown(0.0, full=28.1, empty=27.9),
        flown(0.0).assign(battery_voltage=math.nan),
        flown(0.0).assign(powered=False, propeller_speed=0.0),
    ],
    ids=["constant", "within 1 %", "not logged", "propeller off"],
)
def test_it_is_absent_where_voltage_can_tell_nothing(petrel, table):
    assert NAME not in mentioned(solve(petrel, table))
    untested = rank(table, petrel, Given(CALM))["untested"]
    reason = next(row["reason"] for row in untested if "Thrust that follows the battery's voltage" in row["words"])
    off = not table["powered"].any()
    expected = "steady flight under propeller" if off else "logged battery voltage that changes under propeller"
    assert reason == f"no {expected}"


def test_asked_for_without_a_voltage_it_is_refused_with_the_experiment(petrel):
    table = flown(0.0).assign(battery_voltage=math.nan)
    reason = solve(petrel, table, free=(*FREE, NAME))["reason"]
    assert reason.startswith("refused, a singular set (limit 1000): ΔK_D0 and ΔG and b_U cannot be told apart")
    assert "the same propeller setting at a full and at a nearly empty battery, with glides in between" in reason


def test_always_under_power_the_propeller_off_is_asked_for_too(petrel):
    here = Points.of(flown(0.0).query("powered"), petrel)
    assert experiment((NAME,), here) == "would be resolved by the same pitch with the propeller on and off"


def test_drag_that_grows_while_the_battery_empties_is_told_apart_by_the_glides_between(exact):
    table = flown(2.0)
    middle = 0.5 * (FULL + EMPTY)
    assert np.ptp(Points.of(table, exact).relative_voltage) == pytest.approx((FULL - EMPTY) / middle, rel=0.02)
    both = solve(exact, table, free=(*FREE, NAME, "drag_drift"))
    apart = found(both)
    assert abs(apart[NAME]["value"] - 2.0) < 3.0 * apart[NAME]["std"]
    assert abs(apart["drag_drift"]["value"]) < 3.0 * apart["drag_drift"]["std"]
    alone = solve(exact, table.query("powered"), free=("parasite_drag", NAME, "drag_drift"))
    assert "cannot be told apart" in found(alone)[NAME]["verdict"] or "cannot be told apart" in alone["reason"]


def test_blocks_without_a_voltage_are_taken_at_the_mean(petrel):
    table = flown(2.0)
    some = table.assign(battery_voltage=table["battery_voltage"].where(np.arange(len(table)) % 7 > 0))
    here = Points.of(some, petrel)
    assert (here.relative_voltage[::7] == 0.0).all()
    assert here.relative_voltage[here.powered].sum() == pytest.approx(0.0, abs=1e-12)


@pytest.fixture(scope="module")
def sure(petrel: Vehicle) -> Vehicle:
    """Petrel-II with every 1-sigma 2 %, as an earlier mission may have calibrated it."""
    known = {
        name: Coefficient(item.value, 0.02 * abs(item.value), item.unit, item.source)
        for name, item in petrel.coefficients.items()
    }
    return replace(petrel, coefficients=known)


def test_it_is_named_as_the_cause_and_not_a_loss_of_thrust(sure):
    result = rank(flown(1.6), sure, Given(CALM, ballast_std=0.05, pitch_std=math.radians(0.1)))
    assert result["named"] == ["battery voltage"], result["verdict"]
    words = "Thrust that follows the battery's voltage explains how the blocks differ from theory: b_U = "
    assert result["verdict"].startswith(words)
    assert result["verdict"].endswith(f" ± {uncertainty(result['rows'][0]['parameters'][0]['std'])}.")
    (item,) = result["rows"][0]["parameters"]
    assert abs(item["value"] - 1.6) < 3.0 * item["std"]


def test_it_is_not_named_where_thrust_does_not_follow(sure):
    for seed in range(5):
        table = flown(0.0, seed=seed)
        result = rank(table, sure, Given(CALM, ballast_std=0.05, pitch_std=math.radians(0.1)))
        assert "battery voltage" not in result["named"]
        assert "battery voltage" in [row["name"] for row in result["rows"] if math.isfinite(row["ratio"])]


def test_a_battery_run_down_is_offered_as_an_experiment_where_voltage_is_logged_under_power():
    words = "the same flown again with the battery run down by a tenth of its voltage"
    offered = {text: table for text, table, _ in candidates(flown(0.0), False)}
    half = len(offered[words]) // 2
    before, after = (offered[words]["battery_voltage"].to_numpy()[part] for part in (slice(half), slice(half, None)))
    np.testing.assert_allclose(after, 0.9 * before)
    for table in (flown(0.0).assign(battery_voltage=math.nan), flown(0.0).query("~powered")):
        assert words not in [text for text, _, _ in candidates(table, False)]


def test_page_and_methods_say_what_it_is(petrel):
    estimate = {"settings": CALM, "findings": []}
    report = build(inputs(Mission(vehicle="petrel-ii", name="synthetic"), petrel, flown(2.0), estimate=estimate))
    row = next(row for row in report.summary["fit"]["parameters"] if row["name"] == NAME)
    assert (row["symbol"], row["unit"]) == ("b_U", "1")
    assert "b_U, thrust per battery voltage, each relative to its mean under propeller" in report.page
    assert "b_U were fitted to the mean depth rates" in report.summary["methods"]
    assert "b_U is the relative change of thrust per relative change of the battery" in report.summary["methods"]


# --- a campaign of which the truth is known -------------------------------------------------------------------------

#: Dives, each a glide down and a climb under propeller, to how many metres, and by what share the voltage falls.
DIVES, DEPTH, FALL = 10, 120.0, 0.2


@cache
def orders() -> tuple[Plan, float]:
    """Return the plan of a campaign, and how many hours it takes."""
    stages: list[Stage] = []
    for dive in range(DIVES):
        pitch, heading = (25.0, 35.0)[dive % 2], 90.0 * dive
        stages += [
            Stage(-pitch, 7.0, heading, "duration", 240.0, afloat=True),
            Stage(-pitch, -7.0, heading, "deeper", DEPTH),
            Stage(pitch, 7.0, heading, "duration", 60.0),
            Stage(pitch, 7.0, heading, "surface", rpm=700.0),
        ]
    stages.append(Stage(-25.0, 7.0, 0.0, "duration", 240.0, afloat=True))
    plan = dataclasses.replace(
        trial("petrel2-scs-2015"), stages=tuple(stages), nominal_depth=60.0, nominal=(), vertical_water_std=0.003,
        battery_full=FULL, pump_rate=4e-5, battery_rate=8e-3, pitch_slew_deg=1.5,
    )  # fmt: skip
    return plan, len(run(plan).truth) / 3600.0


def campaign(exponent: float, fall: float, seed: int, folder: Path) -> tuple[pd.DataFrame, Vehicle, Given]:
    """Return blocks of a campaign flown and read back, its vehicle, and what is given.

    Thrust is that of the vehicle file at a voltage of 1 - `fall`/2 of the first, and has `exponent` there.
    """
    plan, hours = orders()
    plan = dataclasses.replace(plan, battery_fall=fall * FULL / hours)
    middle = 1.0 - 0.5 * fall
    since_start = exponent / (middle + exponent * (1.0 - middle))
    scale = 1.0 / (1.0 + since_start * (middle - 1.0))
    simulated = run(plan, seed, Injection(thrust_scale=scale, thrust_by_voltage=since_start))
    instruments.write(plan, simulated.streams, folder, seed)
    settings = mission.load(folder).model_copy(update={"block_s": 120.0})
    made = stream(
        InMemory(ingest(settings).records), plan.vehicle, settings, lambda _part: None,
        constants={}, methods=("kinematic",),
    )  # fmt: skip
    given = Given(made.report["settings"], ballast_std=settings.ballast.std, pitch_std=math.radians(0.3))
    return made.blocks, plan.vehicle, replace(given, settings=sea(made.blocks, plan.vehicle, given))


def test_a_campaign_whose_thrust_follows_the_voltage_tells_by_how_much(tmp_path):
    held = []
    for seed in range(3):
        table, vehicle, given = campaign(2.0, FALL, seed, tmp_path / str(seed))
        result = fit(table, vehicle, given, resamples=10)
        low, high = found(result)[NAME]["interval_95"]
        held.append(low < 2.0 < high)
        assert high - low < 2.0
        assert rank(table, vehicle, given)["named"] == ["battery voltage"]
    assert sum(held) >= 2  # of 3 at 95 %: fewer has a chance of 0.7 %


def test_a_campaign_whose_thrust_does_not_follow_the_voltage_blames_nothing(tmp_path):
    for seed in range(3):
        table, vehicle, given = campaign(0.0, FALL, seed, tmp_path / str(seed))
        result = fit(table, vehicle, given, resamples=10)
        assert NAME in mentioned(result)
        assert NAME not in found(result)
        assert rank(table, vehicle, given)["named"] == []


def test_a_campaign_on_one_voltage_leaves_it_out(tmp_path):
    table, vehicle, given = campaign(2.0, 0.0, 0, tmp_path / "m")
    assert table["battery_voltage"].to_numpy() == pytest.approx(FULL, abs=0.2)
    assert NAME not in mentioned(fit(table, vehicle, given, resamples=10))

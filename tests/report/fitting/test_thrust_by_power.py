"""Corrections of a vehicle whose propeller's power alone is logged: a mission of known truth, and a real one."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from synthetic import blocks, steady

from benchmarks.truth import read
from pipeline.estimate.stage import InMemory, stream
from pipeline.mission import Mission
from pipeline.model.predict import predict
from pipeline.report.compare import compare
from pipeline.report.fitting.fit import fit
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.hypotheses import rank
from pipeline.report.nominal import table
from pipeline.report.propulsion import setting, strength
from pipeline.vehicle import Coefficient, Vehicle

CALM = {"sigma_w": 0.003, "tau_w": 300.0}
EFFICIENCY, DIAMETER = 0.5, 0.08


@pytest.fixture(scope="module")
def by_power(exact: Vehicle) -> Vehicle:
    """Petrel-II with exact coefficients, its thrust by power known to 5 %."""
    known = {
        "propulsive_efficiency": Coefficient(EFFICIENCY, 0.025, "1", "a test"),
        "propeller_diameter": Coefficient(DIAMETER, 0.0, "m", "a test"),
        "thrust_static": Coefficient(math.nan, math.nan, "1", "a test"),
    }
    return replace(exact, coefficients={**exact.coefficients, **known})


def true_speed(table: pd.DataFrame) -> np.ndarray:
    """Return the speeds that the blocks were flown with, m/s, thrust following the propeller's speed."""
    return np.array([steady(row.net_buoyancy, row.pitch, row.propeller_speed)[0] for row in table.itertuples()])


def logged_by_power(factor: float = 1.0, **options) -> pd.DataFrame:
    """Return blocks whose propeller's power is logged, thrust being `factor` times what it says by momentum theory."""
    table = blocks(powered_climbs=True, sigma_w=CALM["sigma_w"], **options)
    turning, speed = table["propeller_speed"].to_numpy(), true_speed(table)
    thrust = 1020.0 * 0.08**3 * turning * (0.6136 * 0.08 * turning - 0.4091 * speed) / factor
    area = 0.25 * math.pi * DIAMETER**2
    through = 0.5 * speed + np.sqrt(0.25 * speed**2 + thrust / (2.0 * 1020.0 * area))
    power = np.where(table["powered"], thrust * through / EFFICIENCY, 0.0)
    return table.assign(propeller_power=power, propeller_speed=np.where(table["powered"], math.nan, 0.0))


def test_a_thrust_that_is_as_its_power_says_leaves_nothing(by_power: Vehicle) -> None:
    predictions = predict(by_power, logged_by_power())
    speed = predictions.loc[predictions["trim"] == "pitch", "speed"].to_numpy()
    np.testing.assert_allclose(speed, true_speed(blocks(powered_climbs=True)), rtol=1e-7)


def test_a_part_of_a_mission_that_is_driven_by_power_has_its_theory(by_power: Vehicle) -> None:
    flown = logged_by_power(dives=4)
    comparison = compare(flown, predict(by_power, flown), by_power, settings=CALM)
    mission = Mission(vehicle="petrel-ii")
    down, up = table(mission, by_power, flown, comparison, {"settings": CALM})
    assert (down["powered"], setting(down["propeller_speed_rpm"], down["propeller_power_W"])) == (False, "")
    middle = float(np.median(flown.loc[flown["powered"], "propeller_power"]))
    assert up["propeller_power_W"] == pytest.approx(middle)
    by_speed = blocks(powered_climbs=True, dives=4).query("powered")
    assert up["held_speed_m_s"] == pytest.approx(np.mean(true_speed(by_speed)), rel=1e-3)
    assert up["held_reason"] == ""
    assert strength(up) > strength(down)


@pytest.mark.parametrize(
    ("speed_rpm", "power", "words"),
    [(1400.0, 0.0, "1400 rpm"), (0.0, 4.91, "4.9 W"), (0.0, 0.0, ""), (math.nan, math.nan, ""), (None, None, "")],
)
def test_what_turns_a_propeller_in_words(speed_rpm: float | None, power: float | None, words: str) -> None:
    assert setting(speed_rpm, power) == words


def test_a_propeller_of_which_nothing_is_known_is_driven_harder_than_none() -> None:
    unknown = {"propeller_speed_rpm": None, "propeller_power_W": math.nan, "powered": True}
    assert strength(unknown) > strength({"propeller_speed_rpm": 0.0, "propeller_power_W": 0.0, "powered": False})


def test_a_loss_of_thrust_is_found_and_named(by_power: Vehicle) -> None:
    table = logged_by_power(0.8, dives=12)
    given = Given(CALM, ballast_std=0.05, pitch_std=math.radians(0.1))
    found = fit(table, by_power, given, free=("thrust_scale", "net_buoyancy"), resamples=10)
    scale = found["parameters"][0]
    assert scale["value"] == pytest.approx(-0.2, abs=3.0 * scale["std"])
    assert scale["std"] < 0.05
    assert scale["prior_std"] == pytest.approx(0.05, rel=0.3)
    ranked = rank(table, by_power, given)
    assert ranked["named"] == ["thrust loss"], ranked["verdict"]


def test_power_without_a_law_is_refused(by_power: Vehicle) -> None:
    unknown = {**by_power.coefficients, "propulsive_efficiency": Coefficient(math.nan, math.nan, "1", "a test")}
    table = logged_by_power().query("powered")
    found = fit(table, replace(by_power, coefficients=unknown), Given(CALM))
    assert found["reason"] == "no steady block with a thrust that follows from what is logged"


def test_kolumbo_is_predicted_and_fitted_by_the_power_of_its_propeller(data: Path, tmp_path: Path) -> None:
    real = read("kolumbo", data, tmp_path)
    made = stream(
        InMemory(real.records), real.vehicle, real.mission, lambda _: None,
        constants=real.constants, methods=("kinematic",),
    )  # fmt: skip
    table = made.blocks
    assert table["powered"].all()
    power = table["propeller_power"].to_numpy()
    assert ((power > 4.0) & (power < 5.5)).all()
    predictions = predict(real.vehicle, table)
    held = predictions[predictions["trim"] == "pitch"]
    assert held["speed"].between(0.6, 0.9).all()
    compared = compare(table, predictions, real.vehicle, settings=made.report["settings"])
    rates = compared[(compared["quantity"] == "depth_rate") & (compared["trim"] == "pitch")]
    assert len(rates) == len(table)
    assert (rates["significance"] < 2.5).all()
    given = Given(made.report["settings"], real.mission.ballast.std, math.radians(real.mission.pitch.std_deg))
    found = fit(table, real.vehicle, given, free=("thrust_scale",), resamples=10)["parameters"][0]
    assert abs(found["value"]) < 2.0 * found["std"]
    assert "thrust loss" in {row["name"] for row in rank(table, real.vehicle, given)["rows"]}

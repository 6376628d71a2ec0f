"""Predictions per block: which trims can be had, why not, and whether their 1-sigma are what Monte Carlo says."""

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from pipeline.model.predict import free_angle_of_attack, nominal, predict
from pipeline.model.steady import trim_at_moment, trim_at_pitch
from pipeline.records import BLOCKS, PREDICTIONS, conform
from pipeline.vehicle import Vehicle, load

SETTING: dict[str, Any] = {
    "dive": 1,
    "direction": 1,
    "powered": True,
    "used": True,
    "net_buoyancy": 7.0,
    "net_buoyancy_std": 0.3,
    "pitch": 0.759,
    "pitch_std": 0.005,
    "propeller_speed": 1400.0 / 60.0,
    "propeller_speed_std": 0.1,
    "battery_position": 0.02,
    "battery_position_std": 0.001,
    "density": 1025.0,
    "density_std": 0.1,
}


def blocks(*changes: dict[str, Any]) -> pd.DataFrame:
    rows = [SETTING | {"block": number} | change for number, change in enumerate(changes)]
    return conform(pd.DataFrame(rows), BLOCKS)


def one(frame: pd.DataFrame, trim: str, block: int = 0) -> Any:
    rows = frame[(frame["block"] == block) & (frame["trim"] == trim)]
    assert len(rows) == 1
    return rows.iloc[0]


def test_every_block_has_the_three_trims_in_order(petrel: Vehicle) -> None:
    found = predict(petrel, blocks({}, {"powered": False}))
    assert list(found.columns) == [column.name for column in PREDICTIONS]
    assert list(found["block"]) == [0, 0, 0, 1, 1, 1]
    assert list(found["trim"]) == ["pitch", "battery", "fixed_alpha"] * 2


def test_no_blocks_give_no_predictions(petrel: Vehicle) -> None:
    found = predict(petrel, blocks({}).iloc[:0])
    assert len(found) == 0
    assert list(found.columns) == [column.name for column in PREDICTIONS]


def test_held_pitch_is_the_trim_at_the_block_s_pitch_and_density(petrel: Vehicle) -> None:
    row = one(predict(petrel, blocks({})), "pitch")
    state = trim_at_pitch(petrel, 7.0, 0.759, propeller_speed=1400.0 / 60.0, density=1025.0)
    assert row["speed"] == float(state.speed)
    assert row["pitch"] == 0.759
    assert row["pitch_std"] == pytest.approx(0.005)
    assert row["thrust"] == float(state.thrust)
    assert row["reason"] == ""


def test_battery_trim_is_the_moment_balance(petrel: Vehicle) -> None:
    row = one(predict(petrel, blocks({})), "battery")
    state = trim_at_moment(petrel, 7.0, battery_position=0.02, propeller_speed=1400.0 / 60.0, density=1025.0)
    assert row["speed"] == float(state.speed)
    assert row["pitch"] == float(state.pitch)


def test_fixed_alpha_is_the_ratio_of_the_moment_coefficients(petrel: Vehicle) -> None:
    row = one(predict(petrel, blocks({})), "fixed_alpha")
    assert row["angle_of_attack"] == pytest.approx(-0.0025358, abs=5e-8)
    # α_e = K_M0/K_M: relative 1-sigma of both, independent.
    relative = math.hypot(0.16 / 0.7959, 62.8 / 313.8643)
    assert row["angle_of_attack_std"] == pytest.approx(0.0025358 * relative, rel=1e-4)


def test_a_propeller_that_is_not_turning_needs_no_log(petrel: Vehicle) -> None:
    found = predict(petrel, blocks({"powered": False, "propeller_speed": math.nan, "propeller_speed_std": math.nan}))
    row = one(found, "pitch")
    assert row["thrust"] == 0.0
    assert math.isfinite(row["speed_std"])


@pytest.mark.parametrize("together", [False, True], ids=["K_1 and K_2 apart", "one factor on thrust"])
def test_std_are_the_spread_of_a_monte_carlo(petrel: Vehicle, together: bool) -> None:
    # A tenth of every 1-sigma, so that first order holds; 300 draws give the spread to about 4 %.
    rng = np.random.default_rng(7)
    setting = {"battery_position": 0.03, "battery_position_std": 1e-4}
    setting |= {f"{name}_std": 0.1 * SETTING[f"{name}_std"] for name in ("net_buoyancy", "pitch", "propeller_speed")}
    drawn = []
    for _ in range(300):
        changes = {name: petrel[name] + 0.1 * petrel.std(name) * rng.standard_normal() for name in petrel.coefficients}
        if together:  # K_2 is negative
            share = (changes["thrust_static"] - petrel["thrust_static"]) / petrel.std("thrust_static")
            changes["thrust_slope"] = petrel["thrust_slope"] - share * petrel.std("thrust_slope")
        moved = {
            name: (SETTING | setting)[name] + setting[f"{name}_std"] * rng.standard_normal()
            for name in ("net_buoyancy", "pitch", "propeller_speed", "battery_position")
        }
        drawn.append(predict(petrel.with_values(changes, "a draw"), blocks(setting | moved)))
    narrow = Vehicle(
        petrel.name,
        petrel.description,
        {name: c.__class__(c.value, 0.1 * c.std, c.unit, c.source) for name, c in petrel.coefficients.items()},
        {("thrust_slope", "thrust_static"): -1.0} if together else {},
    )
    found = predict(narrow, blocks(setting))
    for row, trim in enumerate(("pitch", "battery", "fixed_alpha")):
        for name in ("speed", "path_angle", "angle_of_attack"):
            spread = np.std([frame[name].iloc[row] for frame in drawn])
            assert one(found, trim)[f"{name}_std"] == pytest.approx(spread, rel=0.15), (trim, name)


SLOCUM = load("slocum-g2")


@pytest.mark.parametrize(
    ("vehicle", "change", "trim", "reason"),
    [
        (SLOCUM, {}, "pitch", "powered, but the vehicle file has no thrust law"),
        (SLOCUM, {"powered": False}, "battery", "the vehicle file gives no battery mass"),
        (
            SLOCUM,
            {"powered": False},
            "fixed_alpha",
            "the vehicle file leaves moment_at_zero, moment_slope unknown",
        ),
        (load("petrel-ii"), {"battery_position": math.nan}, "battery", "no battery position is logged"),
        (
            load("petrel-ii"),
            {"propeller_speed": math.nan},
            "pitch",
            "powered, but neither speed nor power of the propeller is known",
        ),
        (load("petrel-ii"), {"propeller_speed": 1400.0}, "pitch", "propeller speed above 100 rev/s: rpm for rev/s?"),
        (load("petrel-ii"), {"pitch": 43.5}, "pitch", "pitch beyond 90 degrees: degrees for radians?"),
        (load("petrel-ii"), {"density": math.nan}, "fixed_alpha", "density is missing or not positive"),
        (load("petrel-ii"), {"pitch": math.nan}, "pitch", "no pitch given"),
        (load("petrel-ii"), {"net_buoyancy": math.nan}, "pitch", "no net_buoyancy given"),
    ],
)
def test_what_cannot_be_predicted_is_nan_with_its_reason(
    vehicle: Vehicle, change: dict[str, Any], trim: str, reason: str
) -> None:
    found = predict(vehicle, blocks(change, {"powered": False, "propeller_speed": 0.0}))
    row = one(found, trim)
    assert row["reason"] == reason
    assert np.isnan(
        row[["speed", "speed_std", "path_angle", "angle_of_attack", "pitch", "pitch_std"]].astype(float)
    ).all()
    assert not row["stable"]
    assert one(found, "pitch", block=1)["reason"] == ""


def test_unknown_std_of_a_coefficient_that_matters_is_not_taken_for_zero(petrel: Vehicle) -> None:
    unsure = Vehicle(
        petrel.name,
        petrel.description,
        petrel.coefficients
        | {"parasite_drag": petrel.coefficients["parasite_drag"].__class__(7.3579, math.nan, "kg/m", "a guess")},
    )
    row = one(predict(unsure, blocks({})), "pitch")
    assert math.isfinite(row["speed"])
    assert math.isnan(row["speed_std"])


# The rows of Section 5


def test_nominal_row_of_danjiangkou(petrel: Vehicle) -> None:
    row = nominal(petrel, net_buoyancy=2.5, propeller_speed=13.0, pitch=math.radians(3.5))
    assert row["free_pitch"]["speed"] == pytest.approx(0.789, abs=5e-4)
    assert row["free_pitch_paper"]["speed"] == pytest.approx(0.789, abs=5e-4)
    assert math.degrees(row["free_pitch_paper"]["pitch"]) == pytest.approx(77.2, abs=0.1)
    assert row["held_pitch"]["speed"] == pytest.approx(0.615, abs=5e-4)
    assert row["held_pitch"]["required_moment"] == pytest.approx(-1.88, abs=5e-3)
    assert row["range_paper"]["speed_upper"] == pytest.approx(0.83470, abs=1e-5)


def test_nominal_row_of_the_south_china_sea(petrel: Vehicle) -> None:
    row = nominal(petrel, net_buoyancy=7.0, propeller_speed=1400.0 / 60.0, pitch=math.radians(43.5))
    assert row["free_pitch"]["speed"] == pytest.approx(1.374, abs=5e-4)
    assert math.degrees(row["free_pitch_paper"]["pitch"]) == pytest.approx(76.096, abs=5e-3)
    assert row["held_pitch"]["speed"] == pytest.approx(1.294, abs=5e-4)
    assert row["range_paper"]["thrust_bound"] == pytest.approx(7.57235, abs=1e-5)
    assert row["range_paper"]["speed_upper"] == pytest.approx(1.39672, abs=1e-5)


def test_nominal_std_agree_with_the_implicit_derivatives(petrel: Vehicle) -> None:
    row = nominal(
        petrel,
        net_buoyancy=7.0,
        propeller_speed=1400.0 / 60.0,
        pitch=0.759,
        density=1025.0,
        net_buoyancy_std=0.3,
        propeller_speed_std=0.1,
        pitch_std=0.005,
    )
    found = predict(petrel, blocks({}))
    for part, trim in (("held_pitch", "pitch"), ("free_pitch", "fixed_alpha")):
        for name in ("speed", "path_angle", "angle_of_attack"):
            assert row[part][name] == pytest.approx(one(found, trim)[name], rel=1e-12)
            assert row[part][f"{name}_std"] == pytest.approx(one(found, trim)[f"{name}_std"], rel=2e-3)


def test_nominal_without_a_measured_pitch_or_moments_says_so() -> None:
    row = nominal(SLOCUM, net_buoyancy=3.0, propeller_speed=0.0, pitch=None)
    assert row["held_pitch"]["reason"] == "no pitch given"
    assert row["free_pitch"]["reason"] == "the vehicle file leaves moment_at_zero, moment_slope unknown"
    assert math.isnan(row["range"]["speed_upper"])
    assert row["range"]["reason"] == row["free_pitch"]["reason"]


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        (
            {"moment_slope": 0.0},
            "no equilibrium: the pitching moment does not depend on the angle of attack",
        ),
        ({"moment_at_zero": -300.0}, "no equilibrium: -K_M0/K_M is -0.96 rad, beyond 0.5 rad"),
    ],
)
def test_free_angle_of_attack_that_is_none_says_why(petrel: Vehicle, values: dict[str, float], reason: str) -> None:
    alpha, found = free_angle_of_attack(petrel.with_values(values, "odd"))
    assert math.isnan(alpha)
    assert found == reason

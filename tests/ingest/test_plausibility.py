"""Units that are declared wrongly give themselves away; flights as they are do not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from pipeline.findings import InputError
from pipeline.ingest import plausibility
from pipeline.records import Quality

Fly = Callable[..., object]
TableOf = Callable[[object], pd.DataFrame]

CTD = {"file": "ctd.csv", "column": "P"}
ATTITUDE = {"file": "attitude.csv", "column": "Pitch"}


def _check(table: pd.DataFrame) -> list[str]:
    plausibility.require(table, CTD, ATTITUDE)
    return [str(finding) for finding in plausibility.with_pitch_checked(table, ATTITUDE, vouched=True)[1]]


def _scaled(table: pd.DataFrame, factor: float) -> pd.DataFrame:
    return table.assign(depth=table["depth"] * factor, pressure=table["pressure"] * factor)


@pytest.mark.parametrize(
    ("speed", "pitch"), [(0.15, 30.0), (0.25, 15.0), (0.35, 25.0), (0.5, 45.0), (1.2, 43.5), (2.0, 20.0)]
)
def test_flights_that_gliders_fly_are_plausible(fly: Fly, table_of: TableOf, speed: float, pitch: float) -> None:
    assert _check(table_of(fly([0.0, *[200.0, 5.0] * 2], speed=speed, pitch_deg=pitch))) == []


@pytest.mark.parametrize(("speed", "pitch"), [(0.2, 30.0), (0.35, 25.0), (0.5, 45.0), (1.15, 43.5)])
def test_bar_declared_as_dbar_is_caught(fly: Fly, table_of: TableOf, speed: float, pitch: float) -> None:
    table = table_of(fly([0.0, *[500.0, 5.0] * 2], speed=speed, pitch_deg=pitch))
    with pytest.raises(InputError, match="is the unit of pressure bar"):
        _check(_scaled(table, 0.1))


@pytest.mark.parametrize(("speed", "pitch"), [(0.35, 25.0), (0.5, 45.0), (1.2, 43.5)])
def test_dbar_declared_as_bar_is_caught(fly: Fly, table_of: TableOf, speed: float, pitch: float) -> None:
    table = table_of(fly([0.0, *[500.0, 5.0] * 2], speed=speed, pitch_deg=pitch))
    with pytest.raises(InputError, match="is the unit of pressure dbar"):
        _check(_scaled(table, 10.0))


def test_the_message_says_what_was_found_what_was_expected_and_the_likely_unit(fly: Fly, table_of: TableOf) -> None:
    table = table_of(fly([0.0, *[500.0, 5.0] * 2], speed=0.35, pitch_deg=25.0))
    with pytest.raises(InputError) as error:
        _check(_scaled(table, 0.1))
    assert str(error.value) == (
        "ctd.csv: column 'P': found depth changing by 0.015 m/s at 25° of pitch, a speed of 0.035 m/s; "
        "expected 0.12 to 2.2 m/s through the water; "
        "is the unit of pressure bar? correct it under files: in mission.yaml"
    )


def test_radians_declared_as_degrees_are_caught(fly: Fly, table_of: TableOf) -> None:
    table = table_of(fly([0.0, *[500.0, 5.0] * 2]))
    with pytest.raises(InputError) as error:
        _check(table.assign(pitch=np.radians(table["pitch"])))
    assert str(error.value) == (
        "attitude.csv: column 'Pitch': found pitch of 0.44° while depth changes by 0.15 m/s; "
        "expected a speed through water of 0.12 to 2.2 m/s; "
        "is the unit of pitch rad, declared as deg? correct it under files: in mission.yaml"
    )


DOUBT = (
    "attitude.csv: column 'Pitch': found nose up on the way down; expected pitch with nose up positive; "
    "if its sign is reversed, pitch: {scale: -1} in mission.yaml turns it; "
    "or are the clocks of pitch and pressure in different zones?"
)


def test_a_pitch_with_nose_down_positive_is_turned_where_the_engine_beside_it_vouches_for_its_clock(
    fly: Fly, table_of: TableOf
) -> None:
    table = table_of(fly([0.0, *[200.0, 5.0] * 2]))
    found, findings = plausibility.with_pitch_checked(table.assign(pitch=-table["pitch"]), ATTITUDE, vouched=True)
    np.testing.assert_array_equal(found["pitch"], table["pitch"])
    assert [str(finding) for finding in findings] == [
        "attitude.csv: column 'Pitch': found nose up on the way down and down on the way up in 30 minutes of dives and "
        "30 minutes of climbs, with the engine as on a glider; expected pitch with nose up positive; "
        "its sign is turned; pitch: {scale: -1} in mission.yaml says the same"
    ]


@pytest.mark.parametrize("case", ["another file", "no engine", "engine reversed", "gyro", "propeller", "half of it"])
def test_a_reversed_pitch_is_doubted_and_not_turned_where_its_clock_may_be_wrong(
    fly: Fly, table_of: TableOf, case: str
) -> None:
    table = table_of(fly([0.0, *[200.0, 5.0] * 2]))
    table["pitch"] *= -1
    match case:
        case "no engine":
            table = table.drop(columns="buoyancy_volume")
        case "engine reversed":
            table["buoyancy_volume"] *= -1
        case "gyro":
            table["pitch_rate"] = 0.0
        case "propeller":
            table["propeller_speed"] = 10.0
        case "half of it":
            dives = table["depth"].diff() > 0
            rows = np.arange(len(table)) % 1000 < 150
            table.loc[dives & rows, "pitch"] *= -1
    found, findings = plausibility.with_pitch_checked(table, ATTITUDE, vouched=case != "another file")
    np.testing.assert_array_equal(found["pitch"], table["pitch"])
    assert [str(finding) for finding in findings] == [DOUBT]


def test_an_engine_logged_larger_on_dives_than_on_climbs_is_flagged_bad(fly: Fly, table_of: TableOf) -> None:
    table = table_of(fly([0.0, *[200.0, 5.0] * 2]))
    source = {"file": "engine.csv", "column": "ballast"}
    found, findings = plausibility.with_engine_checked(table, source)
    assert findings == []
    assert "buoyancy_volume_qc" not in found
    turned = table.assign(buoyancy_volume=-table["buoyancy_volume"])
    found, findings = plausibility.with_engine_checked(turned, source)
    assert (found["buoyancy_volume_qc"] == Quality.BAD).all()
    assert [str(finding) for finding in findings] == [
        "engine.csv: column 'ballast': found an engine volume 460 cm3 larger on dives than on climbs; "
        "expected volume with light positive; flagged bad and not used; if its sign is reversed, give its unit with a "
        "minus sign (-cc) under files: in mission.yaml; or are the clocks of engine and pressure in different zones?"
    ]


@pytest.mark.parametrize(("name", "turning"), [("propeller_speed", 10.0), ("propeller_power", 5.0)])
def test_under_propeller_a_vehicle_may_climb_heavy(fly: Fly, table_of: TableOf, name: str, turning: float) -> None:
    table = table_of(fly([0.0, *[200.0, 5.0] * 2]))
    climbing = table["depth"].diff() < 0
    heavy = table.assign(buoyancy_volume=np.where(climbing, -50e-6, 0.0), **{name: np.where(climbing, turning, 0.0)})
    assert plausibility.with_engine_checked(heavy, {"file": "a.csv", "column": "b"})[1] == []


def test_level_powered_flight_is_not_mistaken_for_a_wrong_unit() -> None:
    time = np.arange(0.0, 7200.0)
    depth = np.interp(time, [0.0, 100.0, 7100.0, 7200.0], [0.0, 10.0, 10.0, 0.0])
    depth += np.random.default_rng(1).normal(0.0, 0.05, time.size) + 0.5 * np.sin(time / 40.0)
    table = pd.DataFrame({"time": time, "pressure": depth, "depth": depth, "pitch": np.radians(3.5)})
    assert _check(table) == []


def test_instruments_that_never_report_together_say_nothing() -> None:
    table = pd.DataFrame(
        {"time": [0.0, 1.0], "pressure": [1.0, np.nan], "depth": [1.0, np.nan], "pitch": [np.nan, 0.1]}
    )
    assert _check(table) == []


def test_slow_clocks_and_gaps_do_no_harm(fly: Fly, table_of: TableOf) -> None:
    table = table_of(fly([0.0, *[900.0, 5.0] * 2], step=5.0))
    rows = np.arange(len(table))
    table.loc[rows % 12 != 0, ["pressure", "depth"]] = np.nan
    table.loc[rows % 6 != 1, "pitch"] = np.nan
    assert _check(table.drop(index=range(200, 400))) == []

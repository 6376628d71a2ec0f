"""Block means: against truth, hand numbers and every way in which something may be missing."""

from collections.abc import Callable
from dataclasses import replace

import gsw
import numpy as np
import pandas as pd
import pytest
from truth import Trial

from pipeline.estimate.ballast import ASSUMED_STD, hull
from pipeline.estimate.blocks import means
from pipeline.estimate.stage import estimate
from pipeline.mission import Ballast, Mission
from pipeline.model.forces import disk_thrust
from pipeline.records import BLOCKS, ESTIMATES, RECORDS, conform, of_method, timestamps
from pipeline.vehicle import Coefficient, Vehicle, load

VEHICLE = load("petrel-ii")
HYBRID = load("slocum-thruster")
GLIDING, LEVEL, CLIMBING = "petrel2-scs-2014", "petrel2-danjiangkou-2014", "petrel2-scs-2015"


def line(n: int = 121, rate: float = 0.2) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return records and estimates of one block of steady sinking, a sample every 2 s."""
    time = 2.0 * np.arange(n)
    measured = {
        "pressure": 50.0 + rate * time,
        "temperature": 10.0,
        "pitch": -0.4,
        "buoyancy_volume": -2e-4,
        "battery_position": 0.003,
    }
    records = pd.DataFrame({"time": timestamps(time), **measured, "depth": 50.0 + rate * time, "density": 1025.0})
    flags = {f"{name}_qc": np.int8(1) for name in measured}
    records = conform(records.assign(**flags, dive=1, block=0, phase=2), RECORDS)
    estimates = pd.DataFrame(
        {
            "time": records["time"],
            "dive": 1,
            "method": "kinematic",
            "speed": 0.5,
            "speed_std": 0.02,
            "path_angle": -0.42,
            "path_angle_std": 0.01,
            "angle_of_attack": 0.02,
            "angle_of_attack_std": 0.005,
            "pitch": -0.4,
            "observable": True,
        }
    )
    return records, conform(estimates, ESTIMATES)


def averaged(records: pd.DataFrame, estimates: pd.DataFrame, craft: Vehicle, mission: Mission) -> pd.DataFrame:
    """Return the means over the blocks of a mission whose logs carry no constants."""
    return means(records, estimates, craft, mission, hull(mission, craft, {}, records)[0])


def test_a_steady_line_gives_its_own_numbers() -> None:
    records, estimates = line()
    mission = Mission(vehicle="petrel-ii", ballast=Ballast(neutral_density=1025.0))
    blocks = averaged(records, estimates, VEHICLE, mission)
    block = blocks.iloc[0]
    assert list(blocks.columns) == [column.name for column in BLOCKS]
    assert (block["direction"], block["dive"], block["powered"], block["used"]) == (-1, 1, False, True)
    assert block["depth_rate"] == pytest.approx(0.2, rel=1e-9)
    assert block["speed"] == pytest.approx(0.5)
    assert block["speed_std"] == pytest.approx(0.02), "errors within a block are one and the same"
    assert block["pitch_std"] == pytest.approx(np.radians(0.3), rel=1e-6)
    # hull neutral in 1025 kg/m3 at the surface and 15 degC: engine, pressure and cold take buoyancy away
    pressure, volume = 50.0 + 0.2 * 120.0, 70.0 / 1025.0
    squeezed = volume * (1.0 - 4.2e-10 * 1e4 * pressure - 7.05e-5 * 5.0)
    assert block["net_buoyancy"] == pytest.approx(9.81 * (1025.0 * (squeezed - 2e-4) - 70.0), rel=5e-3)
    assert block["battery_position"] == pytest.approx(0.003)


@pytest.mark.parametrize("name", [GLIDING, CLIMBING, LEVEL])
def test_block_means_agree_with_the_simulated_truth(trial: Callable[[str], Trial], name: str) -> None:
    case = trial(name)
    blocks = averaged(case.records, of_method(case.estimated.estimates, "kinematic"), case.vehicle, case.mission)
    assert blocks["used"].mean() > 0.9
    inside = case.records["block"].to_numpy()
    for truth, column, tolerance in (
        ("net_buoyancy", "net_buoyancy", 0.15),
        ("pitch", "pitch", np.radians(0.3)),
        ("propeller_speed", "propeller_speed", 0.3),
    ):
        expected = [case.true(truth)[inside == block].mean() for block in blocks["block"]]
        np.testing.assert_allclose(blocks[column], expected, atol=tolerance, err_msg=column)
    speed = np.array([case.true("speed")[inside == block].mean() for block in blocks["block"]])
    good = blocks["used"].to_numpy()
    ratio = ((blocks["speed"] - speed) / blocks["speed_std"])[good]
    assert np.mean(np.abs(ratio) < 1.96) > 0.85


def test_directions_tell_dives_climbs_and_level_flight_apart(trial: Callable[[str], Trial]) -> None:
    for name, expected in ((GLIDING, {-1, 1}), (LEVEL, {0}), (CLIMBING, {-1, 1})):
        case = trial(name)
        blocks = averaged(case.records, of_method(case.estimated.estimates, "kinematic"), case.vehicle, case.mission)
        assert set(blocks["direction"]) == expected
        assert set(blocks.loc[blocks["powered"], "direction"]) <= {0, 1}


def test_a_block_whose_speed_is_unobservable_is_not_used_and_says_why() -> None:
    records, estimates = line()
    estimates = estimates.assign(observable=False, reason="near level: depth carries no speed", speed=np.nan)
    blocks = averaged(records, estimates, VEHICLE, Mission(vehicle="petrel-ii"))
    assert not blocks["used"].iloc[0]
    assert blocks["reason"].iloc[0] == "speed unobservable: near level: depth carries no speed"
    assert np.isnan(blocks["speed"].iloc[0])
    assert blocks["depth_rate"].iloc[0] == pytest.approx(0.2)


def test_no_block_at_all_gives_an_empty_table() -> None:
    records, estimates = line()
    blocks = averaged(records.assign(block=-1), estimates, VEHICLE, Mission(vehicle="petrel-ii"))
    assert len(blocks) == 0
    assert list(blocks.columns) == [column.name for column in BLOCKS]


def test_without_engine_volume_there_is_no_net_buoyancy_and_it_is_said() -> None:
    records, estimates = line()
    records, mission = records.assign(buoyancy_volume=np.nan), Mission(vehicle="petrel-ii")
    blocks, findings = averaged(records, estimates, VEHICLE, mission), estimate(records, VEHICLE, mission).findings
    assert np.isnan(blocks["net_buoyancy"].iloc[0])
    assert "records: buoyancy_volume: found no engine volume; expected one; no net buoyancy, no theory" in [
        str(finding) for finding in findings
    ]


def test_without_temperature_the_hull_is_as_warm_as_its_reference() -> None:
    records, estimates = line()
    mission = Mission(vehicle="petrel-ii", ballast=Ballast(neutral_density=1025.0))
    block = averaged(records.assign(temperature=np.nan), estimates, VEHICLE, mission).iloc[0]
    as_reference = records.assign(temperature=VEHICLE["reference_temperature"])
    same = averaged(as_reference, estimates, VEHICLE, mission).iloc[0]
    assert np.isfinite(block["net_buoyancy"])
    assert block["net_buoyancy"] == same["net_buoyancy"]


def test_ballast_is_taken_from_mission_then_logs_then_assumed() -> None:
    records, _ = line()
    by_volume, _ = hull(Mission(vehicle="x", ballast=Ballast(mass=60.0, volume=0.06)), VEHICLE, {}, records)
    by_density, _ = hull(Mission(vehicle="x", ballast=Ballast(neutral_density=1000.0)), VEHICLE, {}, records)
    by_logs, _ = hull(Mission(vehicle="x"), VEHICLE, {"mass": 56.0, "hull_volume": 0.055}, records)
    assumed, findings = hull(Mission(vehicle="x"), VEHICLE, {}, records)
    assert by_volume is not None
    assert (by_volume.mass, by_volume.volume) == (60.0, 0.06)
    assert by_density is not None
    assert by_density.volume == pytest.approx(0.07)
    assert by_logs is not None
    assert (by_logs.mass, by_logs.volume) == (56.0, 0.055)
    assert assumed is not None
    assert assumed.volume == pytest.approx(70.0 / 1025.0)
    assert assumed.std == ASSUMED_STD
    assert [str(finding) for finding in findings] == [
        "mission.yaml: ballast: found neither volume nor neutral_density; expected one of them; "
        "taken as neutral in 1025.00 kg/m3, the mean density met, with a 1-sigma of 2 N"
    ]


def test_without_any_density_the_ballast_cannot_be_assumed() -> None:
    records, _ = line()
    nothing, findings = hull(Mission(vehicle="x"), VEHICLE, {}, records.assign(density=np.nan))
    assert nothing is None
    assert str(findings[0]) == (
        "records: density: found no density; expected temperature and conductivity; no net buoyancy"
    )


def test_what_compression_and_expansion_do_to_net_buoyancy_is_its_slope_in_them() -> None:
    records, estimates = line()
    mission = Mission(vehicle="petrel-ii", ballast=Ballast(neutral_density=1025.0))

    def block(**changes: float) -> pd.Series:
        return averaged(records, estimates, VEHICLE.with_values(changes, "a test"), mission).iloc[0]

    for name, column in (
        ("compressibility", "buoyancy_by_compression"),
        ("thermal_expansion", "buoyancy_by_expansion"),
    ):
        step = 0.1 * VEHICLE[name]
        ahead, behind = (block(**{name: VEHICLE[name] + sign * step})["net_buoyancy"] for sign in (1.0, -1.0))
        assert block()[column] == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-9)


def test_net_buoyancy_has_the_water_carried_and_its_slopes_are_told() -> None:
    records, estimates = line()
    salty = records.assign(absolute_salinity=np.linspace(30.0, 34.0, len(records)), conservative_temperature=10.0)
    mission = Mission(vehicle="petrel-ii", ballast=Ballast(neutral_density=1025.0))

    def block(share: float, time: float, stds: tuple[float, float] = (0.0, 0.0)) -> pd.Series:
        fairing = {
            "carried_water": Coefficient(share, stds[0], "1", "a test"),
            "flushing_time": Coefficient(time, stds[1], "s", "a test"),
        }
        craft = replace(VEHICLE, coefficients={**VEHICLE.coefficients, **fairing})
        return averaged(salty, estimates, craft, mission).iloc[0]

    none, here = block(0.0, 200.0), block(0.3, 200.0, (0.05, 40.0))
    # 4 g/kg in 240 s: 0.0128 kg/m3 more a second; with T = 240 s, a lag of τ holds τ (1 - τ/T (1 - e^{-T/τ})) s of it
    held = 200.0 * (1.0 - 200.0 / 240.0 * (1.0 - np.exp(-1.2)))
    rate = (gsw.sigma0(34.0, 10.0) - gsw.sigma0(30.0, 10.0)) / 240.0
    assert here["buoyancy_by_carried"] == pytest.approx(9.81 * 70.0 / 1025.0 * rate * held, rel=2e-3)
    assert here["net_buoyancy"] - none["net_buoyancy"] == pytest.approx(0.3 * here["buoyancy_by_carried"], rel=1e-9)
    slope = (block(0.3, 202.0)["net_buoyancy"] - block(0.3, 198.0)["net_buoyancy"]) / 4.0
    assert here["buoyancy_by_flushing"] == pytest.approx(slope, rel=1e-2)
    more = np.hypot(0.05 * here["buoyancy_by_carried"], 40.0 * here["buoyancy_by_flushing"])
    assert here["net_buoyancy_std"] == pytest.approx(np.hypot(none["net_buoyancy_std"], more), rel=1e-9)


def test_without_salinity_or_a_file_that_names_it_nothing_is_carried() -> None:
    records, estimates = line()
    mission = Mission(vehicle="petrel-ii", ballast=Ballast(neutral_density=1025.0))
    plain = averaged(records, estimates, VEHICLE, mission)
    named = averaged(records, estimates, VEHICLE.with_values({"carried_water": 0.3}, "a test"), mission)
    pd.testing.assert_frame_equal(plain, named)
    assert plain["buoyancy_by_carried"].tolist() == plain["buoyancy_by_flushing"].tolist() == [0.0]
    salty = records.assign(absolute_salinity=np.linspace(30.0, 34.0, len(records)), conservative_temperature=10.0)
    same = averaged(salty, estimates, VEHICLE, mission)
    assert same["net_buoyancy"].tolist() == plain["net_buoyancy"].tolist()
    assert same["net_buoyancy_std"].tolist() == plain["net_buoyancy_std"].tolist()


def test_mean_heading_is_that_of_the_unit_vectors() -> None:
    records, estimates = line()
    north = np.where(np.arange(len(records)) % 2, 0.1, 2.0 * np.pi - 0.1)
    flags = {f"{name}_qc": np.int8(1) for name in ("heading", "roll")}
    records = records.assign(heading=north, roll=0.05, **flags)
    block = averaged(records, estimates, VEHICLE, Mission(vehicle="petrel-ii")).iloc[0]
    assert np.cos(block["heading"]) == pytest.approx(1.0, abs=1e-4)
    assert block["roll"] == pytest.approx(0.05)


def test_the_battery_voltage_of_a_block_is_the_mean_of_its_good_samples_and_is_not_filled_in() -> None:
    records, estimates = line()
    place = np.arange(len(records))
    voltage = np.where(place % 3 == 0, 14.0 - 0.01 * place, np.nan)
    voltage[60] = 0.0
    flags = np.where(np.isnan(voltage), 9, np.where(voltage > 0.0, 1, 4)).astype(np.int8)
    mission = Mission(vehicle="petrel-ii")
    logged = records.assign(battery_voltage=voltage, battery_voltage_qc=flags)
    kept = np.setdiff1d(place[place % 3 == 0], [60])
    block = averaged(logged, estimates, VEHICLE, mission).iloc[0]
    assert block["battery_voltage"] == pytest.approx(14.0 - 0.01 * kept.mean())
    assert np.isnan(averaged(records, estimates, VEHICLE, mission).iloc[0]["battery_voltage"])


def test_the_power_of_a_block_is_the_constant_one_of_the_same_mean_thrust() -> None:
    records, estimates = line()
    power = np.where(np.arange(len(records)) % 2, 2.0, 8.0)
    table = means(records.assign(propeller_power=power), estimates, HYBRID, Mission(vehicle="slocum-thruster"), None)
    row, disk = table.iloc[0], HYBRID.disk
    assert disk is not None
    share = np.mean([disk_thrust(disk, 1025.0, each, 0.5)[0] for each in power])
    assert disk_thrust(disk, 1025.0, row["propeller_power"], 0.5)[0] == pytest.approx(share, rel=1e-9)
    assert row["propeller_power"] < power.mean() - 0.05
    assert np.isnan(row["propeller_speed"])
    without = means(records.assign(propeller_power=power), estimates, VEHICLE, Mission(vehicle="petrel-ii"), None)
    assert without.iloc[0]["propeller_power"] == pytest.approx(power.mean())

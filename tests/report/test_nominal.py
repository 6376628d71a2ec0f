"""The table of the paper's Section 5 against its numbers, and for missions that publish none."""

import math

import pytest
from synthetic import SETTINGS, blocks, inputs, level_blocks

from pipeline.mission import Mission, Nominal
from pipeline.model.predict import predict
from pipeline.report import build
from pipeline.report.compare import compare
from pipeline.report.nominal import gps_speed, parts, table
from pipeline.report.rounding import uncertainty

DANJIANGKOU = Nominal(
    name="fixed depth 10 m",
    net_buoyancy=2.5,
    propeller_speed_rpm=780.0,
    pitch_deg=3.5,
    published_speed=0.62,
    published_theory_speed=0.7979,
    published_theory_pitch_deg=76.91,
    powered=True,
)
SOUTH_CHINA_SEA = Nominal(
    name="climb", net_buoyancy=7.0, propeller_speed_rpm=1400.0, pitch_deg=43.5, direction="up", powered=True
)
GPS = {"gps": {"legs": [{}, {}], "speed": 0.62, "speed_std": 0.01}, "settings": SETTINGS}


def rows(vehicle, frame, *nominal: Nominal, estimate=None, gps=None):
    mission = Mission(vehicle="petrel-ii", name="x", nominal=list(nominal))
    comparison = compare(frame, predict(vehicle, frame), vehicle, settings=SETTINGS, gps=gps)
    return table(mission, vehicle, frame, comparison, estimate or {"settings": SETTINGS})


def test_danjiangkou_free_pitch_predicts_0_789_at_77_degrees_and_held_pitch_0_615(petrel):
    row = rows(petrel, level_blocks(), DANJIANGKOU, estimate=GPS, gps=(0.62, 0.01))[0]
    assert row["free_speed_m_s"] == pytest.approx(0.789, abs=5e-4)
    assert row["free_pitch_deg"] == pytest.approx(77.0, abs=0.5)
    assert row["held_speed_m_s"] == pytest.approx(0.615, abs=5e-4)
    assert row["measured_speed_m_s"] == 0.62
    assert row["measured_from"] == "GPS fixes at the ends of 2 submerged legs, current cancelled"
    assert row["error_m_s"] == pytest.approx(-0.005, abs=5e-4)
    assert row["label"] == "independent"


def test_danjiangkou_is_said_not_to_be_exact_depth_keeping(petrel):
    row = rows(petrel, level_blocks(), DANJIANGKOU)[0]
    assert row["held_path_angle_deg"] == pytest.approx(4.6, abs=0.06)
    assert row["notes"] == [
        "At a pitch of 3.5° and a net buoyancy of +2.5 N theory climbs at 4.6°: this is not exact depth keeping."
    ]


def test_without_gps_legs_the_speed_of_level_flight_is_unobservable_with_a_reason(petrel):
    row = rows(petrel, level_blocks(), DANJIANGKOU)[0]
    assert math.isnan(row["measured_speed_m_s"])
    assert row["measured_reason"].startswith("unobservable: depth carries no speed here")


def test_the_estimators_own_reason_is_passed_on(petrel):
    frame = level_blocks().assign(used=False, reason="speed unobservable: powered and near level: no fixes")
    assert rows(petrel, frame, DANJIANGKOU)[0]["measured_reason"] == "unobservable: powered and near level: no fixes"


def test_south_china_sea_held_pitch_predicts_1_294_and_free_pitch_1_374(petrel):
    row = rows(petrel, blocks(dives=1, powered_climbs=True), SOUTH_CHINA_SEA)[0]
    assert row["held_speed_m_s"] == pytest.approx(1.294, abs=5e-4)
    assert row["held_path_angle_deg"] == pytest.approx(43.98, abs=5e-3)
    assert row["held_angle_of_attack_deg"] == pytest.approx(-0.48, abs=5e-3)
    assert row["free_speed_m_s"] == pytest.approx(1.374, abs=5e-4)
    assert row["held_moment_N_m"] == pytest.approx(-3.11, abs=5e-3)
    assert row["stable_speed_lower_as_printed_m_s"] == pytest.approx(0.9825, abs=5e-4)
    assert row["stable_speed_upper_as_printed_m_s"] == pytest.approx(1.3968, abs=5e-4)


def test_a_part_that_was_never_flown_has_no_measured_speed(petrel):
    row = rows(petrel, blocks(dives=1), SOUTH_CHINA_SEA)[0]
    assert row["measured_reason"] == "unobservable: no steady block of this kind"
    assert row["blocks"] == 0
    assert row["stable_holds_measured"] is None


def test_a_mission_without_nominal_settings_gets_a_row_per_direction_as_flown(petrel):
    frame = blocks(dives=4, powered_climbs=True)
    both = rows(petrel, frame)
    assert [row["name"] for row in both] == ["dives", "climbs under propeller"]
    assert both[0]["net_buoyancy_N"] == pytest.approx(-5.0)
    assert both[1]["propeller_speed_rpm"] == pytest.approx(1400.0)
    assert both[0]["measured_from"] == "kinematic estimate, 16 steady blocks by 1/u_val²"
    assert abs(both[0]["error_m_s"]) < 2.0 * both[0]["u_val_m_s"]


def test_without_net_buoyancy_there_is_no_part_to_show(petrel):
    assert parts(Mission(vehicle="petrel-ii"), petrel, blocks(dives=1).assign(net_buoyancy=math.nan)) == []


@pytest.mark.parametrize(
    "legs", [None, [], {}, {"speed": None, "speed_std": None}, {"speed": math.nan, "speed_std": 0.1}]
)
def test_legs_without_a_speed_give_none(legs):
    assert gps_speed({"gps": legs}) is None


def test_fit_theory_and_words_take_ballast_as_uncertain_as_the_estimate_did(petrel):
    """Stage 2 knows where ballast comes from; mission.yaml says 1 N where nobody wrote anything."""
    asked = Mission(vehicle="petrel-ii", name="x", nominal=[Nominal(name="dive", net_buoyancy=-5.0, pitch_deg=-30.0)])
    held = []
    for std in (0.1, 2.0):
        estimate = {"ballast": {"mass": 70.0, "volume": 0.068, "std": std, "source": "logs"}}
        found = build(inputs(asked, petrel, blocks(dives=2), estimate=estimate))[0]
        priors = {item["name"]: item["prior_std"] for item in found["fit"]["parameters"]}
        assert priors["net_buoyancy"] == std
        words = f"Mass and volume of the hull are taken from the logs' constants, ± {uncertainty(std)} N."
        assert words in found["borrowed"]
        held.append(found["parts"][0]["held_speed_std_m_s"])
    assert held[1] > 2.0 * held[0]

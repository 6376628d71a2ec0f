"""The check of the vehicle's own stored flight model."""

import numpy as np
import pandas as pd
import pytest
from synthetic import SETTINGS, blocks, inputs, stored_model

from pipeline.records import seconds
from pipeline.report.stored import block_average, check

CONSTANTS = {"hd_a": 0.0036, "mass": 52.0}


def test_no_stored_solution_is_said():
    result = check(None, blocks(dives=1), pd.DataFrame())
    assert result["reason"] == "the logs hold no flight model solution"
    assert result["sentences"] == []


def test_a_stored_model_that_is_right_is_not_blamed(mission, petrel):
    table = blocks(dives=6, sensor=True)
    result = check(stored_model(table, 1.0), table, inputs(mission, petrel, table).records, settings=SETTINGS)
    assert result["reason"] == ""
    assert result["sentences"] == []
    assert [row["blocks"] for row in result["depth_rate"]] == [24, 24]


def test_a_stored_model_24_percent_too_slow_is_found_in_depth_rate_and_sensor(mission, petrel):
    table = blocks(dives=6, sensor=True, sigma_w=0.002)
    records = inputs(mission, petrel, table).records
    result = check(stored_model(table, 0.76), table, records, constants=CONSTANTS, settings=SETTINGS)
    for row in result["depth_rate"]:
        assert row["difference_m_s"] == pytest.approx(-0.24 * row["measured_m_s"], rel=5e-3)
        assert row["difference_std_m_s"] > 0.0
    sensor = result["sensor_blocks"]
    assert sensor["difference_m_s"] == pytest.approx(
        0.76 * table["speed"].mean() - table["sensor_speed"].mean(), rel=5e-3
    )
    (sentence,) = result["sentences"]
    assert sentence.startswith("The stored coefficients (hd_a = 0.0036) disagree with the depth rate: dives ")
    assert "and with the speed sensor: stored speed" in sentence
    assert "cm/s too slow (24 %)" in sentence


def test_a_stored_model_that_is_right_on_average_but_scatters_is_found():
    table = blocks(dives=6, sigma_w=0.001)
    stored = stored_model(table, 1.0)
    stored["vertical_speed"] += 0.05 * np.where(seconds(stored["time"]) % 1800.0 < 900.0, 1.0, -1.0)
    (sentence,) = check(stored, table, _no_sensor(table), settings={"sigma_w": 0.001, "tau_w": 300.0})["sentences"]
    assert "cm/s RMS where the water explains 0." in sentence


def test_a_stored_model_that_goes_wrong_with_pitch_alone_is_found():
    table = blocks(dives=8, sigma_w=0.004, pitches_deg=(22.0, 26.0, 30.0, 34.0))
    stored = stored_model(table, 1.0)
    dive = np.repeat(table["dive"].to_numpy(), 10)
    off = 0.003 * (np.array([22.0, 26.0, 30.0, 34.0])[(dive - 1) % 4] - 28.0)  # 0.3 cm/s per degree, none on average
    stored["vertical_speed"] += np.where(stored["vertical_speed"] < 0, 1.0, -1.0) * off
    result = check(stored, table, _no_sensor(table), settings={"sigma_w": 0.004, "tau_w": 300.0})
    for row in result["depth_rate"]:
        assert row["per_degree_m_s"] == pytest.approx(-0.003, rel=0.1)
    assert "the steeper the slower, by 0.30" in result["sentences"][0]


def test_sensor_instants_are_compared_where_the_stored_solution_is_near(mission, petrel):
    table = blocks(dives=1)
    records = inputs(mission, petrel, table).records
    records["speed_through_water"], records["speed_through_water_qc"] = 0.5, 1
    stored = stored_model(table, 1.0).assign(speed=0.4)
    instants = check(stored, table, records, settings=SETTINGS)["sensor_instants"]
    assert instants["difference_m_s"] == pytest.approx(-0.1)
    assert instants["rms_m_s"] == pytest.approx(0.1)
    assert 0 < instants["samples"] < len(records)


def test_block_average_is_the_mean_of_the_samples_inside_and_nan_where_they_are_few():
    table = blocks(dives=1, each=1)
    time = seconds(table["start"])[0] + np.arange(0.0, 300.0, 10.0)
    values = np.arange(30.0)
    values[3] = np.nan
    average = block_average(time, values, table)
    assert average[0] == pytest.approx(np.nanmean(values))
    assert np.isnan(average[1])


def _no_sensor(table):
    return pd.DataFrame(
        {"time": table["start"], "speed_through_water": np.nan, "speed_through_water_qc": 9}, index=table.index
    )


def test_sg171_stored_coefficients_disagree_with_depth_rate_and_adcp(data, tmp_path):
    from shutil import copy

    from pipeline.estimate.ballast import hull
    from pipeline.estimate.blocks import means
    from pipeline.estimate.stage import estimate
    from pipeline.ingest import ingest
    from pipeline.mission import load
    from pipeline.records import of_method
    from pipeline.vehicle import load as vehicle

    for file in (data / "seaglider" / "sg171_ekamsat2024").glob("*.nc"):
        copy(file, tmp_path)
    (tmp_path / "mission.yaml").write_text("vehicle: seaglider\n")
    mission, glider = load(tmp_path), vehicle("seaglider")
    given = ingest(mission)
    found = estimate(given.records, glider, mission)
    body, _ = hull(mission, glider, given.constants, given.records)
    table = means(given.records, of_method(found.estimates, "kinematic"), glider, mission, body)
    result = check(given.stored, table, given.records, constants=given.constants, settings=found.report["settings"])
    (sentence,) = result["sentences"]
    assert sentence.startswith("The stored coefficients (hd_a = 0.0007079")
    assert "disagree with the depth rate" in sentence
    assert "and with the speed sensor: stored speed" in sentence
    assert "cm/s too slow" in sentence
    # data/README.md: 8.5 cm/s (24 %) too slow against the ADCP's steady ensembles.
    assert result["sensor_instants"]["difference_m_s"] == pytest.approx(-0.085, abs=0.012)

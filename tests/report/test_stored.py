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

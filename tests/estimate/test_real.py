"""Speeds of real gliders by both methods against the speed that they measured and that the estimator did not see."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.truth import (
    Real,
    by_unadjusted_force,
    estimated,
    read,
    score_comet,
    score_sg171,
    water_rms,
    with_dvl,
    with_stored_polar,
)
from pipeline.estimate.stage import Estimated
from pipeline.records import Quality, of_method


@pytest.fixture(scope="module")
def comet(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Real:
    return read("comet", data, tmp_path_factory.mktemp("comet"))


@pytest.fixture(scope="module")
def sg171(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Real:
    return read("sg171", data, tmp_path_factory.mktemp("sg171"))


def test_decimated_logs_from_stratified_water_have_a_speed(data: Path, tmp_path: Path) -> None:
    """Depth twice a minute, pitch less often: V must not grow without bounds where it is slow and nothing is seen."""
    found = of_method(estimated(read("maria", data, tmp_path)).estimates, "kinematic")
    seen = found["observable"].to_numpy()
    assert seen.mean() > 0.5
    assert "no finite estimate was found" not in set(found["reason"])
    assert 0.25 < found["speed"][seen].median() < 0.45


def test_a_seaexplorers_assumed_polar_has_intervals_that_hold_the_speed_of_its_profiler(
    data: Path, tmp_path: Path
) -> None:
    """Its own pitch reads 2° off that of the profiler."""
    real = read("sea063", data, tmp_path)
    found = of_method(estimated(real).estimates, "kinematic")
    measured, flag = real.records["speed_through_water"], real.records["speed_through_water_qc"]
    seen = found["observable"].to_numpy() & (flag == Quality.GOOD).to_numpy() & measured.notna().to_numpy()
    assert seen.sum() > 40
    gap = np.abs(found["speed"] - measured)[seen]
    assert np.mean(gap < 1.96 * np.hypot(found["speed_std"], real.records["speed_through_water_std"])[seen]) > 0.9


@pytest.fixture(scope="module")
def of_comet(comet: Real) -> Estimated:
    return estimated(comet)


@pytest.fixture(scope="module")
def of_sg171(sg171: Real) -> Estimated:
    return estimated(sg171)


def test_comet_kinematic_speed_agrees_with_its_dvl_in_steady_flight(data: Path, of_comet: Estimated) -> None:
    score = score_comet(data, of_method(of_comet.estimates, "kinematic"), 12.0, 35.0)
    assert score["samples"] > 350
    assert score["n"] > 0.95 * score["samples"]
    assert score["rmse"] <= 0.0095
    assert abs(score["bias"]) <= 0.003
    assert score["coverage"] > 0.9


def test_comet_force_speed_agrees_with_its_dvl_through_the_apex(data: Path, of_comet: Estimated) -> None:
    score = score_comet(data, of_method(of_comet.estimates, "force"), 12.0, 1e4)
    assert score["n"] > 0.95 * score["samples"]
    assert score["rmse"] <= 0.0115
    assert abs(score["bias"]) <= 0.003
    assert score["coverage"] > 0.9


def test_comet_spike_of_yo_8_is_flagged_when_its_dvl_is_used_and_the_sensor_is_believed_elsewhere(
    data: Path, comet: Real
) -> None:
    real = with_dvl(comet, data)
    assert len(real.records) > len(comet.records) + 800
    found = estimated(real)
    flagged = found.report["compatibility"]["outliers"]["instruments"]["speed"]
    spikes = [one for one in flagged["first"] if 5700.0 < one["time_s"] < 5760.0]
    assert [round(one["value"], 2) for one in spikes] == [0.60]
    assert flagged["count"] < 12
    assert any(finding.file == "speed record" for finding in found.findings)
    assert score_comet(data, of_method(found.estimates, "kinematic"), 12.0, 35.0)["rmse"] < 0.006


@pytest.mark.parametrize("method", ["kinematic", "force"])
def test_sg171_speed_agrees_with_its_adcp_within_an_honest_interval(
    data: Path, sg171: Real, of_sg171: Estimated, method: str
) -> None:
    table = of_method(of_sg171.estimates, method)
    score = score_sg171(data, table)
    assert score["n"] > 0.85 * score["samples"]
    assert score["rmse"] <= 0.044
    assert score["rmse"] < 0.5 * score["stored_rmse"]
    assert score["coverage"] >= 0.9
    assert score["stored_bias"] == pytest.approx(-0.085, abs=0.01)
    # Of the kinematic estimate, which fits nothing, w_w of a leg may be an error of V.
    assert water_rms(table, sg171.records)["with_std"] <= (0.017 if method == "force" else 0.03)
    assert of_sg171.report["consistency"][method]["sensor"]["n"] > 200


def test_sg171_polar_kept_in_its_logs_gives_a_speed_far_too_slow_where_nothing_is_adjusted(
    data: Path, sg171: Real
) -> None:
    score = score_sg171(data, by_unadjusted_force(sg171, with_stored_polar(sg171)))
    assert score["bias"] < -0.06
    assert score["rmse"] > 0.07

"""The kinematic speed of real gliders against the speed that they measured and that the estimator did not see."""

from pathlib import Path

import pytest

from benchmarks.truth import lay_out, score_comet, score_sg171
from pipeline import mission, vehicle
from pipeline.estimate.stage import Estimated, estimate
from pipeline.ingest import ingest


def run(name: str, data: Path, scratch: Path) -> Estimated:
    """Return the estimates of a real mission."""
    lay_out(data, scratch, (name,))
    settings = mission.load(scratch / name)
    return estimate(ingest(settings).records, vehicle.load(settings.vehicle), settings)


def test_comet_speed_agrees_with_its_dvl(data: Path, tmp_path: Path) -> None:
    score = score_comet(data, run("comet", data, tmp_path).estimates, 12.0, 35.0)
    assert score["samples"] > 350
    assert score["n"] > 0.95 * score["samples"]
    assert score["rmse"] <= 0.012
    assert abs(score["bias"]) < 0.01
    assert score["coverage"] > 0.9


def test_sg171_speed_is_far_closer_to_its_adcp_than_the_stored_solution(data: Path, tmp_path: Path) -> None:
    estimated = run("sg171", data, tmp_path)
    score = score_sg171(data, estimated.estimates)
    assert score["n"] > 0.85 * score["ensembles"]
    assert score["rmse"] < 0.045
    assert score["rmse"] < 0.5 * score["stored_rmse"]
    assert score["stored_bias"] == pytest.approx(-0.085, abs=0.01)
    assert estimated.report["coverage"]["n"] > 200

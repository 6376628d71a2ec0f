"""The force model fitted on some dives and measured on others."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks import heldout
from benchmarks.truth import Real, read, score_comet
from pipeline.records import RECORDS, Phase, conform, timestamps


@pytest.fixture(scope="module")
def comet(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Real:
    return read("comet", data, tmp_path_factory.mktemp("comet"))


def sinking(rate: float, *, seconds: int = 900) -> pd.DataFrame:
    """Return records of one steady dive with this depth rate, m/s."""
    clock = np.arange(0.0, seconds, 5.0)
    depth = 20.0 + rate * clock
    table = pd.DataFrame({"time": timestamps(1.6e9 + clock), "depth": depth, "pressure": depth / 0.99, "pitch": -0.4})
    return conform(table.assign(phase=np.int8(Phase.DESCENT), dive=1, block=0), RECORDS)


def test_every_dive_is_fitted_on_once_and_measured_once_and_never_both() -> None:
    records = pd.DataFrame({"dive": np.repeat([0, 1, 2, 3, 4, 5], 4)})
    for one, other in zip(heldout.splits(records), reversed(list(heldout.splits(records))), strict=True):
        fitted, measured = set(one.fitted["dive"]), set(one.measured["dive"])
        assert not fitted & measured
        assert fitted | measured == {1, 2, 3, 4, 5}
        assert (records["dive"].isin(fitted).sum(), records["dive"].isin(measured).sum()) == (
            len(one.fitted),
            len(one.measured),
        )
        assert measured == set(other.fitted["dive"])


@pytest.mark.parametrize("rising", [-0.02, 0.0, 0.015])
def test_w_is_what_the_water_does_to_a_glider_whose_speed_is_known(rising: float) -> None:
    path_angle, speed = -0.45, 0.3
    records = sinking(-speed * np.sin(path_angle) - rising)
    table = pd.DataFrame({"time": records["time"], "speed": speed, "path_angle": path_angle})
    stored = pd.DataFrame({"time": records["time"], "vertical_speed": speed * np.sin(path_angle) - 0.05})
    met = heldout.water(records, table, stored)
    assert met.model.size > 100
    np.testing.assert_allclose(met.model, rising, atol=1e-9)
    np.testing.assert_allclose(met.stored, rising + 0.05, atol=1e-9)
    assert met.sinking.all()


def test_what_a_powered_mission_without_ctd_lacks_is_named(data: Path, tmp_path: Path) -> None:
    real = read("kolumbo", data, tmp_path)
    assert heldout.what_lacks(real) == []
    dry = heldout.without_thrust(real)._replace(records=real.records.assign(density=np.nan))
    lacking = heldout.what_lacks(dry)
    assert [text.split(":")[0] for text in lacking] == ["no density", "no thrust law for what is logged"]


def test_the_prediction_sees_no_depth_rate_and_forgets_where_it_started(comet: Real) -> None:
    first, measured = (comet.records[comet.records["dive"] == dive].reset_index(drop=True) for dive in (1, 2))
    prepared = heldout.fitted(comet, first)
    deep = measured["pressure"].to_numpy() > 12.0
    found = heldout.predicted(measured, prepared)["speed"][deep]
    assert found.min() > 0.1
    faster = heldout.predicted(measured, prepared, start=0.6)["speed"][deep]
    assert np.max(np.abs(faster - found)) < 1e-3
    deeper = heldout.predicted(measured.assign(depth=1.1 * measured["depth"]), prepared)["speed"][deep]
    assert np.median(np.abs(deeper - found)) < 1e-3  # a tenth of V is 3e-2


def test_comet_is_predicted_on_dives_left_out_both_ways(
    data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["heldout.py", str(data), "comet"])
    assert heldout.main() in (0, 1)
    said = capsys.readouterr().out
    assert said.count("measured on") == 2
    assert "PASS  comet, V >= 12 dbar" in said
    (steady,) = [line for line in said.splitlines() if line[6:].startswith("comet, V 12-35 dbar")]
    odd, even = (float(word) for word in steady.split("RMS ")[1].split(" cm/s")[0].split(" and "))
    assert max(odd, even) < 1.2


def test_scoring_knows_a_perfect_prediction_from_a_biased_one(data: Path) -> None:
    time, speed = np.load(data / "slocum/comet2016/U_kalman_native.npy")
    table = pd.DataFrame({"time": timestamps(time), "speed": speed + 0.01, "speed_std": 0.02, "observable": True})
    score = score_comet(data, table, 12.0, 35.0)
    assert (score["bias"], score["rmse"]) == pytest.approx((0.01, 0.01))

"""The account of a mission: of both methods, and as much of parts as of the whole."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from dives import Flown

from pipeline.estimate import stage
from pipeline.estimate.account import as_buoyancy
from pipeline.estimate.preparation import METHODS
from pipeline.estimate.settings import Settings
from pipeline.estimate.stage import Estimated, estimate
from pipeline.records import ESTIMATES, of_method

NUMBERS = [column.name for column in ESTIMATES if column.dtype == "float64"]


def test_the_report_tells_of_both(found: Estimated) -> None:
    report = found.report
    assert set(report) == {
        "observable_share", "reasons", "consistency", "coverage", "gps", "share_of_variance", "settings", "used",
        "compatibility", "force", "speed_scale", "ballast",
    }  # fmt: skip
    assert set(report["consistency"]) == set(METHODS)
    known = {"reason", "parameters", "untouched", "correlation", "converged", "observable_share", "reasons", "settings"}
    assert set(report["force"]) == known
    assert report["force"]["reason"] == ""
    for method, told in (("kinematic", report), ("force", report["force"])):
        rows = of_method(found.estimates, method)
        assert told["observable_share"] == pytest.approx(rows["observable"].mean(), rel=1e-12)
        hidden = rows.loc[~rows["observable"], "reason"]
        assert told["reasons"] == {str(text): int(n) for text, n in sorted(hidden.value_counts().items())}


def test_without_the_engine_there_is_no_force_estimate_and_the_report_says_why(flown: Flown) -> None:
    blind = flown.records.assign(buoyancy_volume=np.nan)
    result = estimate(blind, flown.vehicle, flown.mission)
    assert set(result.estimates["method"]) == {"kinematic"}
    assert result.report["force"] == {"reason": "no buoyancy engine volume: no net buoyancy"}
    assert set(result.report["consistency"]) == {"kinematic"}


def test_a_part_without_density_has_no_force_estimate_and_says_so_row_by_row(
    flown: Flown, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The CTD is switched off for the first dive: the force model stays adjusted by the second."""
    half = int(np.argmax(flown.records["dive"].to_numpy() == 2))
    records = flown.records.assign(density=flown.records["density"].where(np.arange(len(flown.records)) >= half))
    monkeypatch.setattr(stage, "cuts", lambda records: [(0, half), (half, len(records))])
    monkeypatch.setattr(stage, "windows", lambda m: [(0, half), (half, m)])
    result = estimate(records, flown.vehicle, flown.mission)
    rows = of_method(result.estimates, "force")
    pd.testing.assert_series_equal(rows["time"], records["time"], check_names=False)
    assert set(rows["reason"][:half]) == {"no density: no net buoyancy"}
    assert rows[NUMBERS][:half].isna().all(axis=None)
    assert rows["observable"][half:].mean() > 0.5
    report = result.report["force"]
    assert report["reasons"]["no density: no net buoyancy"] == half
    assert report["observable_share"] == pytest.approx(rows["observable"].mean())
    assert set(result.report["consistency"]) == set(METHODS)


def test_counts_of_parts_add_up_to_those_of_the_whole(
    flown: Flown, found: Estimated, monkeypatch: pytest.MonkeyPatch
) -> None:
    half = int(np.argmax(flown.records["dive"].to_numpy() == 2))
    monkeypatch.setattr(stage, "cuts", lambda records: [(0, half), (half, len(records))])
    result = estimate(flown.records, flown.vehicle, flown.mission)
    assert result.report["force"]["parameters"] == found.report["force"]["parameters"]
    for method in METHODS:
        whole, parts = of_method(found.estimates, method), of_method(result.estimates, method)
        pd.testing.assert_series_equal(parts["time"], whole["time"])
        assert (parts["observable"] == whole["observable"]).mean() > 0.97
        both = (parts["observable"] & whole["observable"]).to_numpy()
        for name in ("speed", "path_angle", "angle_of_attack", "depth"):
            gap = (np.abs(parts[name] - whole[name]) / whole[f"{name}_std"]).to_numpy()[both]
            assert np.median(gap) < 0.1, (method, name)
            assert gap.max() < 1.0, (method, name)
        told = result.report if method == "kinematic" else result.report["force"]
        assert sum(told["reasons"].values()) == (~parts["observable"]).sum()


def test_waves_that_the_force_estimate_may_take_for_buoyancy_are_told() -> None:
    calm, moving = Settings(sigma_w=0.005, load=0.6), Settings(sigma_w=0.03)
    (told,) = as_buoyancy(moving, calm)
    assert str(told) == (
        "force estimate: found an error of net buoyancy that comes and goes by 0.60 N, and water that moves by "
        "0.5 cm/s; expected water that moves by 3.0 cm/s, as the kinematic estimate has it; it may take waves for "
        "buoyancy, with intervals that are too narrow; those of the kinematic estimate hold"
    )
    assert as_buoyancy(moving, calm._replace(load=0.1)) == []
    assert as_buoyancy(moving, calm._replace(sigma_w=0.02)) == []

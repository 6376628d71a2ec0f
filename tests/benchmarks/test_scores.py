"""Scores of missions whose errors are known."""

from __future__ import annotations

import functools
import math

import numpy as np
import pandas as pd
import pytest

from benchmarks import scores
from benchmarks.fleet import Flight, Flown, fly, plan_of
from pipeline.estimate.stage import Estimated
from pipeline.records import seconds

STD = {"speed": 0.02, "angle_of_attack": 0.005, "path_angle": 0.008, "vertical_water_velocity": 0.01}


@functools.cache
def flown() -> tuple[Flight, Flown]:
    flight = plan_of(5000)
    return flight, fly(flight)


def estimated(stated: float, *, seed: int = 1) -> Estimated:
    """Return the truth with normal errors of `STD`, said to be `stated` times as large, by a method of two."""
    _, mission = flown()
    rng = np.random.default_rng(seed)
    clock, time = seconds(mission.truth["time"]), seconds(mission.records["time"])
    table = pd.DataFrame({"time": mission.records["time"], "method": "kinematic"})
    for name, std in STD.items():
        table[name] = np.interp(time, clock, mission.truth[name]) + std * rng.standard_normal(time.size)
        table[f"{name}_std"] = stated * std
    table["observable"] = np.interp(time, clock, mission.truth["afloat"].astype(float)) < 0.5
    other = table.assign(method="force", observable=table["observable"] & (np.arange(len(table)) % 2 == 0))
    depth = {"instrument": "depth", "nis": 1.02, "low_effective": 0.97, "high_effective": 1.03, "n": 5000}
    report = {"consistency": {"kinematic": {"innovations": [depth]}}}
    return Estimated(pd.concat([table, other], ignore_index=True), report, [])


def rows(stated: float, samples: str = "all") -> pd.DataFrame:
    flight, mission = flown()
    table = pd.DataFrame(scores.score(flight, mission, estimated(stated)))
    return table[table["samples"] == samples].set_index("method")


def test_honest_normal_errors_are_covered_95_percent_and_have_mean_square_1() -> None:
    found = rows(1.0)
    for method in ("kinematic", "force"):
        tolerance = 5.0 / math.sqrt(found.loc[method, "n"])
        for name, std in STD.items():
            assert found.loc[method, f"cover_{name}"] == pytest.approx(0.95, abs=0.22 * tolerance)
            assert found.loc[method, f"nees_{name}"] == pytest.approx(1.0, abs=1.5 * tolerance)
            assert found.loc[method, f"rms_{name}"] == pytest.approx(std, rel=tolerance)
            assert found.loc[method, f"std_{name}"] == pytest.approx(std)


def test_errors_twice_as_large_as_stated_are_covered_as_the_normal_distribution_says() -> None:
    found = rows(0.5)
    for name in STD:
        assert found.loc["kinematic", f"cover_{name}"] == pytest.approx(0.6729, abs=0.03)  # 2 Φ(0.98) − 1
        assert found.loc["kinematic", f"nees_{name}"] == pytest.approx(4.0, rel=0.1)


def test_the_share_observable_is_of_the_samples_under_water() -> None:
    found = rows(1.0)
    assert found.loc["kinematic", "observable"] == 1.0
    assert found.loc["force", "observable"] == pytest.approx(0.5, abs=0.01)
    assert found.loc["kinematic", "nis_depth"] == 1.02
    assert found.loc["kinematic", "in_band_depth"] == 1.0


def test_classes_of_samples_divide_the_whole() -> None:
    flight, mission = flown()
    table = pd.DataFrame(scores.score(flight, mission, estimated(1.0)))
    count = table[table["method"] == "kinematic"].set_index("samples")["n"]
    for parts in (("down", "up"), ("steady block", "outside blocks")):
        assert count[list(parts)].sum() == count["all"]
    assert count.filter(like="|pitch|").sum() == pytest.approx(count["all"], abs=4 * scores.LEAST_SAMPLES)


def test_uncertainty_and_band_of_a_mean_are_found_among_missions() -> None:
    figures = pd.Series(np.random.default_rng(2).normal(0.9, 0.3, 400))
    mean, error = scores.mean_over_missions(figures)
    assert mean == pytest.approx(figures.mean())
    assert error == pytest.approx(0.3 / 20.0, rel=0.1)
    low, high = scores.band(figures)
    assert (high - low) / 2.0 == pytest.approx(1.96 * error, rel=0.1)
    assert low < mean < high


def claims(cover: float, nees: float, nis: float) -> list[bool]:
    rng = np.random.default_rng(3)
    table = pd.DataFrame({"samples": ["all"] * 200, "in_band_depth": 1.0})
    for name in scores.QUANTITIES:
        table[f"cover_{name}"] = cover
        table[f"nees_{name}"] = nees + 0.5 * rng.standard_normal(200)
    table["nis_depth"], table["std_nis_depth"] = nis + 0.05 * rng.standard_normal(200), 0.05
    return [ok for ok, _ in scores.verdicts(table)]


def test_the_claim_holds_only_within_its_bands() -> None:
    assert claims(0.95, 1.0, 1.0) == [True] * 9
    assert claims(0.92, 1.0, 1.0) == [False] * 4 + [True] * 5
    assert claims(0.98, 1.3, 0.9) == [False] * 9

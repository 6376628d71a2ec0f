"""What the parts of a mission say together of a quantity that each estimates by itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from dives import fly
from scipy.stats import chi2

from pipeline.estimate import stage
from pipeline.estimate.together import together


def test_the_mean_is_weighted_and_shared_errors_are_not_averaged_away() -> None:
    found = together([(0.02, 0.01), (0.03, 0.02), (0.01, 0.01)])
    assert found is not None
    assert found.value == pytest.approx(np.average([0.02, 0.03, 0.01], weights=[4.0, 1.0, 4.0]))
    assert found.std == pytest.approx(np.average([0.01, 0.02, 0.01], weights=[4.0, 1.0, 4.0]))
    assert (found.lowest, found.highest, found.known, found.of) == (0.01, 0.03, 3, 3)
    assert found.agree


def test_parts_that_differ_by_more_than_chance_are_called_so_and_widen_the_interval() -> None:
    values = np.array([0.0, 0.05, 0.1])
    found = together([(value, 0.01) for value in values])
    assert found is not None
    statistic = float(np.sum((values - values.mean()) ** 2)) / 0.01**2
    assert found.chi_square == pytest.approx(statistic)
    assert statistic > chi2.ppf(0.975, 2)
    assert not found.agree
    assert found.std == pytest.approx(0.01 * math.sqrt(statistic / 2.0))


def test_chance_lets_parts_agree_in_975_missions_of_1000() -> None:
    rng = np.random.default_rng(4)
    drawn = rng.standard_normal((2000, 5)) * 0.02
    share = np.mean([together([(value, 0.02) for value in row]).agree for row in drawn])  # type: ignore[union-attr]
    assert share == pytest.approx(0.975, abs=0.012)


def test_parts_that_do_not_tell_are_counted_and_none_is_none() -> None:
    found = together([None, (0.5, 0.1), None])
    assert found is not None
    assert (found.value, found.std, found.known, found.of, found.agree) == (0.5, 0.1, 1, 3, True)
    assert together([None, None]) is None


def test_the_scale_of_a_mission_in_parts_is_that_of_all_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """The sensor reads 4 % too much; each half finds it by itself, and the account names both."""
    flown = fly(2, dives=((25.0, 4.0, 300.0), (25.0, 4.0, 300.0)), every=8)
    rng = np.random.default_rng(5)
    speed = flown.truth["speed"].to_numpy()
    records = flown.records.assign(
        speed_through_water=1.04 * speed + 0.005 * rng.standard_normal(speed.size),
        speed_through_water_std=0.005,
        speed_through_water_qc=np.int8(1),
    )
    mission = flown.mission.model_copy(update={"speed_sensor": "use", "speed_sensor_scale_std": 0.1})
    half = int(np.argmax(records["dive"].to_numpy() == 2))
    monkeypatch.setattr(stage, "cuts", lambda records: [(0, half), (half, len(records))])
    report = stage.estimate(records, flown.vehicle, mission).report
    for method in ("kinematic", "force"):
        entry = report["speed_scale"][method]
        parts = entry["parts"]
        assert (parts["known"], parts["of"]) == (2, 2)
        assert parts["lowest"] < entry["value"] < parts["highest"]
        assert abs(entry["value"] - 0.04) < 2.5 * entry["std"]
        assert f"{100.0 * entry['std']:.2g} % now" in entry["reason"]
    assert report["compatibility"]["pressure_offset"]["parts"]["of"] == 2

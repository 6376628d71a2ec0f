"""A part of a mission solved by both methods: the table of its estimates."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import arrays
import numpy as np
import pandas as pd
import pytest
from dives import Flown

from pipeline.estimate.linearise import PITCH, SLIP, SPEED
from pipeline.estimate.preparation import METHODS
from pipeline.estimate.stage import Estimated
from pipeline.estimate.told import nothing
from pipeline.estimate.trajectory import flight
from pipeline.estimate.verdict import verdict
from pipeline.model.closure import glide_angle
from pipeline.records import ESTIMATES, of_method
from pipeline.vehicle import load

NUMBERS = [column.name for column in ESTIMATES if column.dtype == "float64"]
ANGLES = ("pitch", "angle_of_attack", "path_angle", "vertical_water_velocity")


def test_both_methods_are_in_one_canonical_table_each_in_time_order(flown: Flown, found: Estimated) -> None:
    table = found.estimates
    assert list(table.columns) == [column.name for column in ESTIMATES]
    assert list(dict.fromkeys(table["method"])) == ["kinematic", "force"]
    for method in METHODS:
        rows = of_method(table, method)
        pd.testing.assert_series_equal(rows["time"], flown.records["time"], check_names=False)
        np.testing.assert_array_equal(rows["dive"], flown.records["dive"])


@pytest.mark.parametrize("method", METHODS)
def test_what_is_not_observable_is_nan_and_says_why_but_for_pitch_and_depth(found: Estimated, method: str) -> None:
    rows = of_method(found.estimates, method)
    seen = rows["observable"].to_numpy()
    assert 0.5 < seen.mean() < 1.0
    assert (rows.loc[seen, "reason"] == "").all()
    assert (rows.loc[~seen, "reason"] != "").all()
    assert np.isfinite(rows.loc[seen, NUMBERS]).all(axis=None)
    hidden = [name for name in NUMBERS if not name.startswith(("pitch", "depth"))]
    assert rows.loc[~seen, hidden].isna().all(axis=None)
    assert np.isfinite(rows[["pitch", "pitch_std", "depth", "depth_std"]]).all(axis=None)
    assert (rows.loc[seen, [f"{name}_std" for name in ("speed", *ANGLES, "depth")]] > 0.0).all(axis=None)


@pytest.mark.parametrize(("method", "least"), [("kinematic", 0.8), ("force", 0.85)])
def test_both_find_the_true_speed(flown: Flown, found: Estimated, method: str, least: float) -> None:
    rows = of_method(found.estimates, method)
    seen = rows["observable"].to_numpy()
    gap = (rows["speed"].to_numpy() - flown.truth["speed"].to_numpy())[seen]
    assert np.mean(np.abs(gap) < 1.96 * rows["speed_std"].to_numpy()[seen]) > least
    assert np.sqrt(np.mean(gap**2)) < 0.05


def test_the_force_method_sees_through_manoeuvres_that_the_kinematic_does_not(found: Estimated) -> None:
    shares = [of_method(found.estimates, method)["observable"].mean() for method in ("force", "kinematic")]
    assert shares[0] > shares[1]


def test_under_power_an_angle_of_attack_beyond_a_glides_is_no_measurement_where_depth_alone_tells() -> None:
    time = np.arange(0.0, 40.0, 4.0)
    series = replace(arrays.series(time, 0.4), powered=np.ones(time.size, dtype=bool))
    speed, std, steady = np.full(time.size, 1.3), np.full(time.size, 0.1), np.ones(time.size, dtype=bool)
    beyond = time > 20.0
    found = verdict(series, speed, std, steady, beyond, depth_alone=True)
    assert set(found[beyond]) == {"powered: the angle of attack found is more than a glide's, and depth alone tells"}
    assert set(found[~beyond]) == {""}
    assert set(verdict(series, speed, std, steady, beyond, depth_alone=False)) == {""}


@pytest.mark.parametrize(
    ("known", "why"), [(True, "no finite estimate was found"), (False, "lift and drag of the vehicle are not known")]
)
def test_where_no_speed_was_found_the_polar_is_blamed_only_if_it_is_unknown(known: bool, why: str) -> None:
    time = np.arange(0.0, 40.0, 4.0)
    glides = np.ones(time.size, dtype=bool)
    for value in (np.nan, np.inf):
        speed = np.full(time.size, value)
        found = verdict(arrays.series(time, 0.4), speed, speed, glides, ~glides, depth_alone=True, polar_known=known)
        assert set(found) == {why}


@pytest.mark.parametrize(("side", "most"), [(-1.0, 1.19), (1.0, 1.21)])
def test_it_is_beyond_where_it_is_a_fifth_more_than_a_glides(side: float, most: float) -> None:
    polar, time = load("petrel-ii").polar, np.arange(0.0, 40.0, 4.0)
    glide = glide_angle(polar, 0.5, side * 0.4)[0]
    mean = np.zeros((time.size, 6, 1))
    mean[:, SPEED, 0], mean[:, PITCH, 0], mean[:, SLIP, 0] = 0.5, side * 0.4, most * glide
    covariance = np.broadcast_to(1e-6 * np.eye(6), (time.size, 6, 6)).copy()
    series = replace(arrays.series(time, side * 0.4), powered=np.ones(time.size, dtype=bool))
    solution = SimpleNamespace(mean=mean, covariance=covariance)
    found = flight(series, polar, solution, np.empty((time.size, 0)), nothing(0))  # type: ignore[arg-type]
    assert set(found.beyond) == {most > 1.2}
    gliding = replace(series, powered=np.zeros(time.size, dtype=bool))
    assert not flight(gliding, polar, solution, np.empty((time.size, 0)), nothing(0)).beyond.any()  # type: ignore[arg-type]

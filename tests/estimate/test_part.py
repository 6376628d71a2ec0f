"""A part of a mission solved by both methods: the table of its estimates."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from dives import Flown

from pipeline.estimate.preparation import METHODS
from pipeline.estimate.stage import Estimated
from pipeline.records import ESTIMATES, of_method

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

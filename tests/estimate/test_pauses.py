"""A pause of months in the records leaves finite, honest numbers on both sides of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from truth import Trial

from pipeline.estimate.stage import estimate
from pipeline.records import seconds


@pytest.mark.parametrize("years", [0.1, 10.0])
def test_flight_after_a_pause_of_years_is_estimated_as_without_it(trial: Callable[[str], Trial], years: float) -> None:
    given = trial("petrel2-scs-2015")
    records = given.records.copy()
    later = np.arange(len(records)) >= 6000
    records.loc[later, "time"] += pd.Timedelta(days=365.0 * years)
    plain = estimate(given.records, given.vehicle, given.mission).estimates
    found = estimate(records, given.vehicle, given.mission).estimates
    for column in ("speed_std", "depth_std", "pitch_std"):
        assert (found[column].dropna() > 0).all()
    assert np.isfinite(found["depth_std"]).all()
    both = (plain["observable"] & found["observable"]).to_numpy()
    assert both.mean() > 0.9 * plain["observable"].mean()
    gap = np.abs(found["speed"] - plain["speed"])[both]
    assert gap.median() < 0.005


def test_a_part_that_is_missing_without_a_gap_in_time_leaves_both_sides_as_they_are(
    trial: Callable[[str], Trial],
) -> None:
    given = trial("petrel2-scs-2015")
    records, time = given.records, seconds(given.records["time"])
    depth = records["depth"].to_numpy()
    first = int(np.argmax(depth > 250.0))  # on the first dive; it goes on in the last climb
    last = int(np.flatnonzero(depth > 100.0)[-1])
    kept = np.r_[0:first, last : len(records)]
    joined = records.iloc[kept].reset_index(drop=True)
    joined.loc[first:, "time"] -= pd.Timedelta(seconds=time[last] - time[first] - 1.0)
    plain = estimate(records, given.vehicle, given.mission)
    found = estimate(joined, given.vehicle, given.mission)
    (told,) = (str(finding) for finding in found.findings if "leaps" in str(finding))
    assert "depth leaps from 249 to 101 m within 3 s" in told
    assert "expected what a vehicle can do, at most 2.5 m/s; nothing is carried across" in told
    assert not any("leaps" in str(finding) for finding in plain.findings)
    for method, table in found.estimates.groupby("method"):
        before = plain.estimates[plain.estimates["method"] == method].iloc[kept].reset_index(drop=True)
        table = table.reset_index(drop=True)
        both = (before["observable"] & table["observable"]).to_numpy()
        assert both.mean() > 0.8 * before["observable"].mean()
        gap = np.abs(table["speed"] - before["speed"]) / before["speed_std"]
        assert gap[both].quantile(0.95) < 1.96
        assert np.isfinite(table["depth_std"]).all()

"""A pause of months in the records leaves finite, honest numbers on both sides of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from truth import Trial

from pipeline.estimate.stage import estimate


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

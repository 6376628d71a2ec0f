"""Goodness of the fit: χ² against its own distribution, where the water moved as assumed, less, and more."""

from __future__ import annotations

import math

import pytest
from scipy.stats import chi2
from synthetic import blocks

from pipeline.report.fitting.fit import fit
from pipeline.report.fitting.given import Given
from pipeline.vehicle import Vehicle


def judged(vehicle: Vehicle, assumed: float) -> dict[str, float | str]:
    """Return what is said of a fit to 96 blocks in water of 1 cm/s if it is `assumed` [m/s] to move otherwise."""
    given = Given(settings={"sigma_w": assumed, "tau_w": 300.0})
    return fit(blocks(dives=12, seed=3), vehicle, given, resamples=10)["goodness"]


@pytest.mark.parametrize(("assumed", "verdict"), [(0.01, "ordinary"), (0.03, "low"), (0.004, "high")])
def test_water_that_moved_less_or_more_than_assumed_is_told_by_chi_square(
    exact: Vehicle, assumed: float, verdict: str
) -> None:
    found = judged(exact, assumed)
    assert found["verdict"] == verdict
    freedom = found["degrees_of_freedom"]
    assert 0.0 < freedom <= 96 - 2
    assert found["low"] == pytest.approx(chi2.ppf(0.025, freedom) / freedom)
    assert found["high"] == pytest.approx(chi2.ppf(0.975, freedom) / freedom)


def test_the_sentence_says_which_way_the_uncertainties_are_wrong(exact: Vehicle) -> None:
    low, high = judged(exact, 0.03), judged(exact, 0.004)
    assert "the 1σ of the corrections are too wide" in str(low["sentence"])
    assert low["reduced"] == pytest.approx((0.01 / 0.03) ** 2, rel=0.4)
    assert "times as much as measurement and moving water explain" in str(high["sentence"])


def test_without_a_fit_nothing_is_said(exact: Vehicle) -> None:
    found = fit(blocks(dives=2).assign(used=False), exact)["goodness"]
    assert found["sentence"] == ""
    assert math.isnan(found["reduced"])

"""Figures of the fit: what they draw, what they tell a reader who cannot see them, and when they are not there."""

import math

import pytest
from synthetic import SETTINGS, blocks

from pipeline.report.figures.corrections import corrections
from pipeline.report.figures.profiles import profiles
from pipeline.report.figures.residuals import residuals
from pipeline.report.fitting.fit import fit
from pipeline.report.fitting.given import Given


@pytest.fixture(scope="module")
def fitted(exact):
    return fit(blocks(dives=6), exact, Given(SETTINGS))


@pytest.mark.parametrize("figure", [corrections, profiles, residuals])
def test_without_a_fit_there_is_no_figure(exact, figure):
    assert figure(fit(blocks(dives=2).assign(used=False), exact)) is None


def test_profiles_have_a_row_for_every_value_tried_and_the_intervals_in_words(fitted):
    picture = profiles(fitted)
    table = picture.table.frame
    assert len(table) == 2 * len(fitted["profiles"][0]["value"])
    assert table["correction"].unique().tolist() == ["ΔK_D0", "ΔG"]
    assert table["delta_chi_square"].min() == 0.0
    low, high = fitted["profiles"][0]["interval_95"]
    assert f"ΔK_D0: 95 % interval from {low:+.3g} to {high:+.3g} kg/m" in picture.alt


def test_a_profile_that_never_rises_is_said_to_be_open(fitted):
    flat = dict(fitted["profiles"][0], interval_95=[math.nan, 1.0])
    assert "ΔK_D0: open on a side" in profiles(fitted | {"profiles": [flat, fitted["profiles"][1]]}).alt


def test_residuals_are_drawn_against_what_was_measured_only(fitted):
    picture = residuals(fitted)
    assert "of 48 blocks against 4 quantities" in picture.alt
    table = picture.table.frame
    assert table["after_m_s"].tolist() == fitted["residuals"]["after_m_s"]
    known = fitted["residuals"] | {"heading_deg": [10.0] * 48}
    assert "against 5 quantities" in residuals(fitted | {"residuals": known}).alt


def test_the_ellipse_is_that_of_the_first_two_of_several_corrections(exact):
    three = fit(blocks(dives=6, sigma_w=0.001), exact, free=("parasite_drag", "net_buoyancy", "pitch"), resamples=10)
    assert "Confidence ellipse of ΔK_D0" in corrections(three).alt
    one = fit(blocks(dives=6), exact, free=("parasite_drag",), resamples=10)
    assert corrections(one) is None
    assert "ΔK_D0" in profiles(one).alt

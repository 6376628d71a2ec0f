"""The two drags of a page: when they agree, and what is said when they do not."""

import math

import pytest
from synthetic import SETTINGS, blocks

from pipeline.report.fitting.counterpart import counterpart
from pipeline.report.fitting.fit import fit
from pipeline.report.fitting.given import Given


def force(value: float, std: float) -> dict:
    return {"parameters": {"parasite_drag": {"value": value, "std": std}}}


@pytest.fixture(scope="module")
def fitted(petrel):
    return fit(blocks(dives=8, extra_drag=1.53), petrel, Given(SETTINGS), resamples=10)


def test_values_within_their_1_sigma_agree(fitted):
    row = fitted["parameters"][0]
    found = counterpart(fitted, force(row["percent_with_prior"] / 100.0, 0.03), sensor_used=False)
    assert found["agree"]
    assert found["fit_percent"] == row["percent_with_prior"]
    assert found["sentences"][1].startswith("The two differ by less than twice the 1σ of both together")


#: A fit that with lift kept gives what the force estimate gives, -30 %.
EXPLAINED = {"lift_kept": {"percent": -27.0, "percent_std": 2.0}}


@pytest.mark.parametrize("sensor", [False, True])
def test_values_apart_are_explained_by_what_is_borrowed(fitted, sensor):
    found = counterpart(fitted | EXPLAINED, force(-0.3, 0.02), sensor_used=sensor)
    assert not found["agree"]
    assert found["sentences"][1].startswith("They differ because they borrow differently")
    assert ("a speed sensor, or GPS fixes" in found["sentences"][2]) is not sensor
    assert found["kept_percent"] == -27.0


@pytest.mark.parametrize("compared", [["depth rates"], ["depth rates", "displacements between fixes"]])
def test_what_is_borrowed_is_not_the_reason_where_the_same_borrowing_leaves_the_difference(fitted, compared):
    found = counterpart(fitted | {"compared_with": compared}, force(-0.3, 0.02), sensor_used=False)
    assert found["kept_percent"] == fitted["lift_kept"]["percent"] > 15.0
    assert found["sentences"][1].startswith("They borrow differently, but that is not why they differ")
    assert "trust neither" in found["sentences"][2]


def test_a_fit_that_was_held_to_fixes_too_is_the_one_to_trust(fitted):
    held = fitted | EXPLAINED | {"compared_with": ["depth rates", "displacements between fixes"]}
    found = counterpart(held, force(-0.3, 0.02), sensor_used=False)
    assert found["sentences"][2].startswith("This fit was also held to displacements between fixes")
    assert "trust this fit" in found["sentences"][2]


def test_with_lift_kept_the_drag_has_a_smaller_1_sigma(fitted, exact):
    assert fitted["lift_kept"]["percent_std"] < fitted["parameters"][0]["percent_std"]
    alone = fit(blocks(dives=8), exact, Given(SETTINGS, pitch_std=0.0), resamples=10)
    assert alone["lift_kept"]["percent"] == pytest.approx(alone["parameters"][0]["percent"])


def test_without_both_there_is_nothing_to_compare(fitted, exact):
    nothing = counterpart(fitted, {}, sensor_used=False)
    assert nothing["agree"] is None
    assert nothing["sentences"] == []
    refused = fit(blocks(dives=4).assign(used=False), exact, Given(SETTINGS))
    assert counterpart(refused, force(0.1, 0.1), sensor_used=False)["sentences"] == []
    other = fit(blocks(dives=4), exact, Given(SETTINGS), free=("net_buoyancy",), resamples=10)
    assert math.isnan(other["lift_kept"]["percent"])

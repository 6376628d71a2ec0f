"""The water behind block means against simulated water, whatever the smoother took it for."""

import math

import numpy as np
import pytest
from synthetic import SETTINGS, blocks

from pipeline.report.fitting.given import Given
from pipeline.report.fitting.hypotheses import rank
from pipeline.report.fitting.sea import STRENGTH, sea


@pytest.mark.parametrize(("sigma", "tau"), [(0.005, 1800.0), (0.018, 100.0)])
def test_strength_and_time_are_found_from_the_blocks_whatever_was_taken_for_them(petrel, sigma, tau):
    taken = {"sigma_w": sigma, "tau_w": tau}
    found = [sea(blocks(dives=12, each=6, seed=seed), petrel, Given(taken)) for seed in range(8)]
    strength = np.median([item["sigma_w"] for item in found]) / SETTINGS["sigma_w"]
    time = np.median([item["tau_w"] for item in found]) / SETTINGS["tau_w"]
    assert 0.75 < strength < 1.33
    assert 0.6 < time < 1.7


def test_a_cause_is_not_taken_for_water(petrel):
    clean, caused = (
        sea(blocks(dives=12, extra_drag=drag, extra_force=force), petrel, Given(SETTINGS))
        for drag, force in ((0.0, 0.0), (1.5, 0.5))
    )
    assert caused["sigma_w"] == pytest.approx(clean["sigma_w"], rel=0.15)


def test_a_few_blocks_leave_the_water_as_the_smoother_has_it(petrel):
    found = sea(blocks(dives=1, each=1), petrel, Given(SETTINGS))
    assert abs(math.log(found["sigma_w"] / SETTINGS["sigma_w"])) <= STRENGTH


def test_what_else_was_set_is_kept(petrel):
    assert sea(blocks(dives=2), petrel, Given(SETTINGS | {"engine": "numba"}))["engine"] == "numba"


def test_without_blocks_or_without_water_nothing_is_changed(petrel):
    assert sea(blocks(dives=1).assign(used=False), petrel, Given(SETTINGS)) == SETTINGS
    still = {"sigma_w": 0.0, "tau_w": 300.0}
    assert sea(blocks(dives=1), petrel, Given(still)) == still


def test_a_sensor_that_is_used_counts_too(petrel):
    table = blocks(dives=6, sensor=True)
    found = sea(table, petrel, Given(SETTINGS, use_sensor=True))
    assert 0.5 < found["sigma_w"] / SETTINGS["sigma_w"] < 2.0


def test_errors_widen_less_where_the_water_is_found_first(exact):
    rough = blocks(dives=8, sigma_w=0.02)
    before = rank(rough, exact, Given(SETTINGS))["std_factors"]["depth rates"]
    after = rank(rough, exact, Given(sea(rough, exact, Given(SETTINGS))))
    assert before > 1.5
    assert after["std_factors"]["depth rates"] < 1.2
    assert after["sigma_w_m_s"] == pytest.approx(0.02, rel=0.4)

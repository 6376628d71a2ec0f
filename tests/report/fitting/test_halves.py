"""Dives are dealt out so that no part lacks a setting that the others have, in whatever rhythm settings alternate."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import blocks

from pipeline.report.fitting.fit import solvable
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.halves import parts_of
from pipeline.report.fitting.heldout import left_out_dives
from pipeline.report.fitting.points import Configuration, Points


def points_of(petrel, table, **given) -> Points:
    return solvable(table, petrel, Given(**given))[0].points


def of_dives(points: Points, part: np.ndarray) -> dict[int, set[int]]:
    return {number: set(points.dive[part == number].tolist()) for number in range(part.max() + 1)}


def driven(points: Points, dives: set[int]) -> Points:
    """Return the points with the propeller on in `dives` alone."""
    on = np.isin(points.dive, list(dives))
    return replace(points, powered=on, propeller_speed=np.where(on, 20.0, 0.0))


@pytest.mark.parametrize("rhythm", [1, 2, 3, 4, 6])
def test_halves_see_every_setting_alike_in_whatever_rhythm_it_alternates(petrel, rhythm):
    table = blocks(dives=12, pitches_deg=(30.0,))
    on = {dive for dive in range(1, 13) if ((dive - 1) // rhythm) % 2}
    points = driven(points_of(petrel, table), on)
    halves = of_dives(points, parts_of(points, 2))
    assert [len(half) for half in halves.values()] == [6, 6]
    assert [len(half & on) for half in halves.values()] == [len(on) // 2] * 2


def test_pitches_that_alternate_with_the_dives_are_in_both_halves(petrel):
    points = points_of(petrel, blocks(dives=8, pitches_deg=(25.0, 35.0)))
    for half in of_dives(points, parts_of(points, 2)).values():
        assert len({dive % 2 for dive in half}) == 2
        assert len(half) == 4


def test_configurations_are_in_both_halves(petrel):
    worn = (Configuration("bare", 1, 4), Configuration("pod", 5, 8))
    points = points_of(petrel, blocks(dives=8, pitches_deg=(30.0,)), configurations=worn)
    assert {len(half & {5, 6, 7, 8}) for half in of_dives(points, parts_of(points, 2)).values()} == {2}


def test_dives_flown_alike_are_dealt_out_so_that_a_drift_in_time_cancels(petrel):
    points = points_of(petrel, blocks(dives=8, pitches_deg=(30.0,)))
    halves = of_dives(points, parts_of(points, 2))
    assert halves == {0: {1, 4, 5, 8}, 1: {2, 3, 6, 7}}


@pytest.mark.parametrize(("dives", "count"), [(2, 2), (3, 2), (7, 2), (5, 5), (11, 5), (13, 5)])
def test_every_part_has_as_many_whole_dives_within_one(petrel, dives, count):
    points = points_of(petrel, blocks(dives=dives))
    part = parts_of(points, count)
    for dive in np.unique(points.dive):
        assert np.unique(part[points.dive == dive]).size == 1
    sizes = [len(each) for each in of_dives(points, part).values()]
    assert len(sizes) == count
    assert max(sizes) - min(sizes) <= 1
    assert sum(sizes) == dives


def test_held_out_dives_have_settings_that_were_fitted_to(petrel):
    """Thrust and drag alike are told where the propeller goes on and off with the dives."""
    table = blocks(dives=8, pitches_deg=(30.0,), powered_climbs=True, extra_drag=1.0)
    glides = blocks(dives=8, pitches_deg=(30.0,), extra_drag=1.0)
    odd = table["dive"] % 2 == 1
    table[odd.to_numpy()] = glides[odd.to_numpy()]
    made, _ = solvable(table, petrel, Given(ballast_std=0.1))
    found = left_out_dives(made.freeing(("parasite_drag", "thrust_scale")))
    assert found["reason"] == ""
    assert sorted(found["halves"][0] + found["halves"][1]) == list(range(1, 9))
    assert {len({dive % 2 for dive in half}) for half in found["halves"]} == {2}
    assert found["rmse_after_m_s"] < found["rmse_before_m_s"]

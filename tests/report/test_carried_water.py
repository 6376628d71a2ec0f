"""Water that a fairing carries along: found where it is flown, and in the theory where the vehicle file names it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from benchmarks.carried import SHARE, SHARE_STD, TIME, Trial, analysed, errors, felt, flown, named, share_in_blocks
from pipeline.mission import Mission
from pipeline.report.fitting.fit import fit
from pipeline.report.fitting.given import Given
from pipeline.vehicle import Vehicle


@pytest.fixture(scope="module")
def halocline() -> tuple[Mission, pd.DataFrame]:
    """Return a mission where no hull that lags behind the water's temperature looks like water carried along."""
    return flown("halocline", 4)


@pytest.fixture(scope="module")
def unnamed(halocline: tuple[Mission, pd.DataFrame], petrel: Vehicle) -> Trial:
    return analysed(*halocline, petrel)


@pytest.fixture(scope="module")
def known(halocline: tuple[Mission, pd.DataFrame], petrel: Vehicle) -> Trial:
    return analysed(*halocline, named(petrel))


def test_the_adjustment_finds_share_and_time_within_their_intervals(unnamed: Trial) -> None:
    found = unnamed.report["force"]["parameters"]
    for name, value in (("carried_water", SHARE), ("flushing_time", TIME)):
        assert found[name]["verdict"] == "determined"
        assert abs(found[name]["value"] - value) < 1.96 * found[name]["std"]
        assert found[name]["std"] < 0.25 * value


def test_theory_without_it_is_wrong_where_the_water_met_changes(unnamed: Trial) -> None:
    table = errors(unnamed)
    inside = felt(table)
    assert inside.sum() > 8
    assert np.sqrt(np.mean(table["error"][inside] ** 2)) > 0.02
    assert np.sqrt(np.mean(table["error"][~inside] ** 2)) < 0.015
    assert np.corrcoef(table["error"], table["buoyancy_by_carried"])[0, 1] > 0.7
    value, std = share_in_blocks(unnamed)
    assert value > 5.0 * std


def test_theory_with_it_agrees_everywhere(known: Trial) -> None:
    table = errors(known)
    assert np.abs(table["error"] / table["u_val"]).max() < 1.96
    assert np.sqrt(np.mean(table["error"] ** 2)) < 0.008
    assert abs(np.corrcoef(table["error"], table["buoyancy_by_carried"])[0, 1]) < 0.4
    value, std = share_in_blocks(known)
    assert abs(value) < 1.96 * std


def test_what_is_not_known_of_it_is_in_the_uncertainty_of_the_theory(known: Trial, unnamed: Trial) -> None:
    """0.02 of share and 50 s: by the share alone where it has come to rest, more in a pycnocline."""
    with_it, without = errors(known).set_index("block"), errors(unnamed).set_index("block")
    more = np.sqrt(with_it["net_buoyancy_std"] ** 2 - without["net_buoyancy_std"] ** 2)
    assert np.all(more >= 0.999 * SHARE_STD * with_it["buoyancy_by_carried"].abs())
    assert more.max() > 0.04


def test_the_fit_asks_for_it_where_the_vehicle_file_names_it_alone(known: Trial, unnamed: Trial) -> None:
    names = {"carried_water", "flushing_time"}
    for trial, asked in ((known, names), (unnamed, set())):
        found = fit(trial.blocks, trial.vehicle, Given(settings=trial.report["settings"]))
        tried = {item["name"] for item in (*found["selection"]["rejected"], *found["parameters"], *found["borrowed"])}
        assert tried & names == asked

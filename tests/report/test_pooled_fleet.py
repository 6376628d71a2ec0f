"""What several missions say of a vehicle: what they borrowed in common counts once, and what cannot be said is said."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest

from pipeline.report import fleet
from pipeline.report.fleet import common, found_by, together

BASE, LIFT_STD, PITCH_STD = 7.36, 90.0, 0.005
NAMES = ["parasite_drag", "net_buoyancy", "lift_slope", "pitch"]


def likelihood(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return what the data of one mission say of `NAMES`: a random precision, and that times the best values."""
    scale = np.array([0.3, 0.05, 400.0, 0.02])
    slope = rng.standard_normal((6, 4)) / scale
    return slope.T @ slope, slope.T @ rng.standard_normal(6)


def summary(name: str, said: tuple[np.ndarray, np.ndarray], start: str = "2014-03-01") -> dict[str, Any]:
    """Return the part of a summary that tells of a fit, held by the priors of what is borrowed alone."""
    precision = said[0] + np.diag([0.0, 0.0, LIFT_STD**-2, PITCH_STD**-2])
    covariance = np.linalg.inv(precision)
    value = covariance @ said[1]
    stds = np.sqrt(np.diag(covariance))
    parameters = [
        {"name": "parasite_drag", "symbol": "ΔK_D0", "meaning": "drag", "unit": "kg/m", "value": value[0],
         "std": stds[0], "vehicle_value": BASE, "prior_std": 0.7},
        {"name": "net_buoyancy", "symbol": "ΔG", "meaning": "ballast", "unit": "N", "value": value[1],
         "std": stds[1], "vehicle_value": math.nan, "prior_std": 0.3},
    ]  # fmt: skip
    borrowed = [{"name": "lift_slope", "prior_std": LIFT_STD}, {"name": "pitch", "prior_std": PITCH_STD}]
    joint = {"names": NAMES, "value": value.tolist(), "covariance": covariance.tolist()}
    fit = {"reason": "", "parameters": parameters, "borrowed": borrowed, "joint": joint, "std_inflation": 1.0}
    vehicle = {"name": "petrel-ii", "coefficients": [{"name": "lift_slope", "value": 351.4}]}
    end = f"{start}T12:00:00Z"
    return {
        "mission": name,
        "vehicle": vehicle,
        "data": {"start": f"{start}T00:00:00Z", "end": end},
        "fit": fit,
    }


@pytest.fixture
def said() -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(7)
    return [likelihood(rng) for _ in range(5)]


@pytest.fixture
def missions(said: list[tuple[np.ndarray, np.ndarray]]) -> list[dict[str, Any]]:
    return [summary(f"m{k}", each, f"201{k}-03-01") for k, each in enumerate(said)]


def test_missions_with_a_common_prior_are_what_one_fit_to_all_their_data_gives(
    said: list[tuple[np.ndarray, np.ndarray]], missions: list[dict[str, Any]]
) -> None:
    # One problem of 5 x (drag, ballast, pitch) and one lift slope, each prior once.
    n = len(said)
    precision, right = np.zeros((3 * n + 1, 3 * n + 1)), np.zeros(3 * n + 1)
    for k, (own, pull) in enumerate(said):
        place = [3 * k, 3 * k + 1, 3 * n, 3 * k + 2]
        precision[np.ix_(place, place)] += own
        right[place] += pull
        precision[3 * k + 2, 3 * k + 2] += PITCH_STD**-2
    precision[-1, -1] += LIFT_STD**-2
    covariance = np.linalg.inv(precision)
    drags = list(range(0, 3 * n, 3))
    shared = common(missions)
    assert shared == {"lift_slope": LIFT_STD}
    found = [each for summary in missions if (each := found_by(summary, "parasite_drag", shared)) is not None]
    value, spread = together(found, shared)
    assert value == pytest.approx(BASE + (covariance @ right)[drags], rel=1e-9)
    assert spread == pytest.approx(covariance[np.ix_(drags, drags)], rel=1e-7)


def test_what_is_said_of_the_vehicle_narrows_with_the_missions_but_not_beyond_what_they_borrowed(
    missions: list[dict[str, Any]],
) -> None:
    few, many = (next(iter(fleet.fleet(chosen)))["coefficients"][0] for chosen in (missions[:2], missions))
    assert many["std"] < few["std"]
    assert (many["symbol"], many["unit"], many["vehicle_value"]) == ("K_D0", "kg/m", BASE)
    assert many["with_prior_std"] < many["std"]
    assert many["next_std"] > many["std"]
    assert [each["mission"] for each in many["missions"]] == ["m0", "m1", "m2", "m3", "m4"]
    assert all(each["shrunken_std"] < 1.2 * each["std"] for each in many["missions"])
    assert few["drift"]["reason"] == "a drift in time would take 4 missions"


def test_a_vehicle_that_fouls_drifts(said: list[tuple[np.ndarray, np.ndarray]]) -> None:
    grown = []
    for k, (precision, _pull) in enumerate(said):
        true = np.array([0.5 * k, 0.0, 0.0, 0.0])
        grown.append(summary(f"m{k}", (1e3 * precision, 1e3 * precision @ true), f"201{k}-03-01"))
    drag, ballast = fleet.fleet(grown)[0]["coefficients"]
    assert drag["drift"]["supported"]
    assert drag["drift"]["value"] == pytest.approx(0.5, abs=0.02)  # kg/m a year
    assert "it drifts in time: Schwarz" in drag["verdict"]
    assert not ballast["drift"]["supported"]
    assert ballast["verdict"].startswith("the missions agree within their 1σ; the vehicle is as in its file")


def test_missions_on_one_day_tell_no_drift(said: list[tuple[np.ndarray, np.ndarray]]) -> None:
    found = fleet.fleet([summary(f"m{k}", each) for k, each in enumerate(said)])[0]["coefficients"][0]
    assert found["drift"]["reason"] == "a drift in time would take missions more than a week apart"


def test_what_cannot_be_said_has_its_reason(missions: list[dict[str, Any]]) -> None:
    refused = {"reason": "no steady block", "parameters": [], "borrowed": [], "joint": {}}
    empty = {"data": {"start": "", "end": ""}}
    lost = [{**missions[k], "fit": refused, **empty} for k in (0, 1)]
    failed = {"mission": "z", "error": "no pitch"}
    assert fleet.fleet([]) == []
    assert fleet.fleet([failed]) == []
    one = fleet.fleet([missions[0], failed])[0]
    assert (one["reason"], one["coefficients"], one["missions"]) == ("cannot be said: one mission only", [], ["m0"])
    none = fleet.fleet(lost)[0]
    assert none["reason"] == "cannot be said: 0 of 2 missions have a fit"
    assert none["left_out"] == [{"mission": name, "reason": "no steady block"} for name in ("m0", "m1")]
    assert fleet.fleet([missions[2], lost[0]])[0]["reason"] == "cannot be said: 1 of 2 missions has a fit"


def test_a_coefficient_that_one_mission_alone_determines_is_no_matter_of_the_vehicle(
    missions: list[dict[str, Any]],
) -> None:
    several = copy.deepcopy(missions[:3])
    for each in several[1:]:
        each["fit"]["parameters"].pop()
    drag, ballast = fleet.fleet(several)[0]["coefficients"]
    assert drag["reason"] == ""
    assert ballast["reason"] == "cannot be said: 1 mission determines it"


def test_missions_that_start_from_different_vehicle_files_have_no_common_prior(missions: list[dict[str, Any]]) -> None:
    several = copy.deepcopy(missions[:3])
    several[0]["fit"]["parameters"][0]["vehicle_value"] = 8.0
    several[0]["vehicle"]["coefficients"][0]["value"] = 300.0
    assert common(several) == {}
    drag = fleet.fleet(several)[0]["coefficients"][0]
    assert math.isnan(drag["vehicle_value"])
    assert drag["with_prior_std"] == drag["std"]
    assert drag["missions"][0]["value"] == pytest.approx(8.0 + several[0]["fit"]["parameters"][0]["value"])

"""The vehicle as corrected by a mission: what was injected is in the file, and another mission flies by it."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pages import adjusted

from pipeline import campaign, mission, simulate, store, vehicle
from pipeline.estimate.stage import estimate
from pipeline.ingest import ingest
from pipeline.mission import Ballast, Mission
from pipeline.report.corrected import FILE, Corrected, account, correct, text
from pipeline.roster import Job
from pipeline.vehicle import Vehicle, load

TRIAL = "petrel2-scs-2015"
EXTRA = 1.5  # kg/m, 20 % of K_D0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a simulated mission whose drag is greater than its vehicle file says."""
    out = tmp_path_factory.mktemp("raw") / TRIAL
    simulate.simulate(TRIAL, out, seed=3, injection=simulate.Injection(extra_parasite_drag=EXTRA))
    return out


@pytest.fixture(scope="module")
def report(folder: Path) -> dict[str, Any]:
    settings = mission.load(folder)
    return estimate(ingest(settings).records, load(settings.vehicle), settings, methods=("force",)).report


@pytest.fixture(scope="module")
def found(folder: Path, report: dict[str, Any], petrel: Vehicle) -> Corrected:
    return correct(petrel, mission.load(folder), report)


def given_force(**changes: Any) -> dict[str, Any]:
    """Return a report on a force estimate of thrust, drag and ballast that depend on each other."""
    entry = {"before": 0.0, "verdict": "determined"}
    parameters = {
        "parasite_drag": {**entry, "value": 0.1, "std": 0.02, "std_before": 0.1},
        "net_buoyancy": {**entry, "value": -0.7, "std": 0.1, "std_before": 1.0},
        "thrust": {**entry, "value": -0.2, "std": 0.03, "std_before": 0.3},
    }
    matrix = [[1.0, -0.3, 0.6], [-0.3, 1.0, 0.1], [0.6, 0.1, 1.0]]
    force = {
        "parameters": {name: item | changes.get(name, {}) for name, item in parameters.items()},
        "correlation": {"names": list(parameters), "matrix": matrix},
        "converged": changes.get("converged", True),
    }
    return {"force": force}


class TestASimulatedMission:
    def test_finds_the_drag_that_was_injected(self, found: Corrected, petrel: Vehicle) -> None:
        true = petrel["parasite_drag"] + EXTRA
        new = found.vehicle
        assert abs(new["parasite_drag"] - true) < 3.0 * new.std("parasite_drag")
        assert abs(new["parasite_drag"] - true) < 0.3 * EXTRA
        assert new.std("parasite_drag") < 0.5 * petrel.std("parasite_drag")

    def test_changes_no_other_coefficient_that_it_did_not_determine(self, found: Corrected, petrel: Vehicle) -> None:
        changed = {change.name for change in found.changes if change.changed}
        assert "parasite_drag" in changed
        assert changed < set(petrel.coefficients)
        kept = {name: item for name, item in petrel.coefficients.items() if name not in changed}
        assert kept == {name: found.vehicle.coefficients[name] for name in kept}
        assert all(TRIAL in found.vehicle.coefficients[name].source for name in changed)

    def test_correlations_are_those_of_the_adjustment(self, found: Corrected, report: dict[str, Any]) -> None:
        names, matrix = report["force"]["correlation"].values()
        table = np.array(matrix)
        np.testing.assert_allclose(np.diag(table), 1.0)
        np.testing.assert_allclose(table, table.T)
        assert np.linalg.eigvalsh(table)[0] > -1e-12
        assert bool(found.vehicle.correlations) == (sum(change.changed for change in found.changes) > 1)
        for (first, second), value in found.vehicle.correlations.items():
            assert value == pytest.approx(table[names.index(first), names.index(second)], abs=1e-4)

    def test_another_mission_runs_with_the_file(self, found: Corrected, folder: Path, tmp_path: Path) -> None:
        other = tmp_path / "raw" / "other"
        other.mkdir(parents=True)
        for log in folder.glob("*.csv"):
            (other / log.name).write_text("".join(log.read_text().splitlines(keepends=True)[:250]))
        settings = yaml.safe_load((folder / mission.FILE).read_text())
        (other / mission.FILE).write_text(yaml.safe_dump(settings | {"vehicle": FILE, "name": "other"}))
        (other / FILE).write_text(text(found, TRIAL))
        job = Job(other, "other", tmp_path / "processed" / "other", tmp_path / "reports" / "other")
        for stage in ("ingest", "estimate"):
            assert campaign.run_stage(job, stage).error == ""
        before = store.read_json(job.path("estimate.json"))["force"]["parameters"]["parasite_drag"]["std_before"]
        assert before == pytest.approx(found.vehicle.std("parasite_drag") / found.vehicle["parasite_drag"])


def test_the_file_is_read_back_to_the_last_digit(found: Corrected, tmp_path: Path) -> None:
    (tmp_path / FILE).write_text(text(found, TRIAL), encoding="utf-8")
    assert load(FILE, tmp_path) == found.vehicle


@pytest.mark.parametrize("name", vehicle.names())
def test_every_vehicle_comes_back_as_it_was_where_nothing_was_found(name: str, tmp_path: Path) -> None:
    craft = load(name)
    same = correct(craft, Mission(vehicle=name, name="m"), {"force": {"reason": "no mass or no density"}})
    assert same.remarks == ("Nothing is corrected: no mass or no density.",)
    (tmp_path / FILE).write_text(text(same, "m"), encoding="utf-8")
    again = load(FILE, tmp_path)
    assert (again.name, again.description) == (craft.name, craft.description)
    for key, item in craft.coefficients.items():
        other = again.coefficients[key]
        np.testing.assert_array_equal([other.value, other.std], [item.value, item.std])
        assert (other.unit, other.source) == (item.unit, item.source)


def test_thrust_scales_both_of_its_coefficients_and_they_go_together(petrel: Vehicle, mission: Mission) -> None:
    new = correct(petrel, mission, given_force()).vehicle
    for name in ("thrust_static", "thrust_slope"):
        assert new[name] == pytest.approx(0.8 * petrel[name])
        assert new.std(name) == pytest.approx(0.03 * abs(petrel[name]))
    assert new.correlations == {
        ("parasite_drag", "thrust_static"): 0.6,
        ("parasite_drag", "thrust_slope"): -0.6,  # K_2 is negative: more thrust is a lower K_2
        ("thrust_static", "thrust_slope"): -1.0,
    }
    J = 0.7  # the 1-sigma of K_1 + K_2 J by the file is that of the factor on thrust
    gradient, stds = np.array([1.0, J]), np.array([new.std("thrust_static"), new.std("thrust_slope")])
    covariance = np.outer(stds, stds) * [[1.0, -1.0], [-1.0, 1.0]]
    assert math.sqrt(gradient @ covariance @ gradient) == pytest.approx(
        0.03 * (petrel["thrust_static"] + petrel["thrust_slope"] * J)
    )


def test_a_surprise_is_taken_only_if_the_data_determine_it(petrel: Vehicle, mission: Mission) -> None:
    surprise = {"value": 0.5, "verdict": "contradicts what was known before, by 5.0 sigma"}
    sharp = correct(petrel, mission, given_force(parasite_drag={**surprise, "std": 0.04}))
    blunt = correct(petrel, mission, given_force(parasite_drag={**surprise, "std": 0.06}))
    assert sharp.vehicle["parasite_drag"] == pytest.approx(1.5 * petrel["parasite_drag"])
    assert "contradicts" in sharp.vehicle.coefficients["parasite_drag"].source
    assert blunt.vehicle["parasite_drag"] == petrel["parasite_drag"]


def test_nothing_is_taken_from_an_adjustment_that_did_not_converge(petrel: Vehicle, mission: Mission) -> None:
    same = correct(petrel, mission, given_force(converged=False))
    assert same.vehicle == petrel
    assert same.remarks == ("Nothing is corrected: the adjustment did not converge.",)


def test_a_value_that_cannot_be_is_not_taken(petrel: Vehicle, mission: Mission) -> None:
    same = correct(petrel, mission, given_force(parasite_drag={"value": -1.2}))
    assert same.vehicle["parasite_drag"] == petrel["parasite_drag"]
    assert "expected a positive number" in next(c.why for c in same.changes if c.name == "parasite_drag")


@pytest.mark.parametrize(
    "ballast", [{"neutral_density": 1024.0}, {"volume": 0.0683}, {"mass": 71.0, "neutral_density": 1024.0}, {}]
)
def test_the_line_for_ballast_gives_the_net_buoyancy_found(petrel: Vehicle, ballast: dict[str, float]) -> None:
    def force(keys: Ballast) -> float:
        mass = keys.mass or petrel["mass"]
        volume = keys.volume or mass / (keys.neutral_density or 1026.0)
        return 9.81 * (1026.0 * volume - mass)

    given_as = Mission(vehicle="petrel-ii", name="m", ballast=ballast)
    line = correct(petrel, given_as, given_force(), neutral_density=1026.0).ballast
    new = Mission(vehicle="petrel-ii", **yaml.safe_load(line)).ballast
    assert force(new) - force(given_as.ballast) == pytest.approx(-0.7, rel=0.01)
    assert new.std == 0.1


def test_what_was_not_determined_says_so_in_the_file(petrel: Vehicle, mission: Mission) -> None:
    said = text(correct(petrel, mission, {"force": adjusted()}), "m")
    assert "# compressibility: kept: not determined by these data" in said
    assert "never adjusted" in said


def test_the_account_is_of_every_coefficient_that_could_change(petrel: Vehicle, mission: Mission) -> None:
    rows = account(correct(petrel, mission, given_force()))["changes"]
    assert [row["name"] for row in rows] == ["parasite_drag", "thrust_static", "thrust_slope"]
    assert [row["unit"] for row in rows] == ["kg/m", "1", "1"]


@given(st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9), st.floats(-0.9, 3.0), st.floats(0.0, 1.0))
def test_any_correlation_of_errors_can_be_read_back(roots: list[float], value: float, std: float) -> None:
    root = np.array(roots).reshape(3, 3) + 0.1 * np.eye(3)
    covariance = root @ root.T + 1e-6 * np.eye(3)
    scale = np.sqrt(np.diag(covariance))
    report = given_force(parasite_drag={"value": value, "std": std + 1e-3})
    report["force"]["correlation"]["matrix"] = (covariance / np.outer(scale, scale)).tolist()
    new = correct(load("petrel-ii"), Mission(vehicle="petrel-ii", name="m"), report)
    again = vehicle.parse(yaml.safe_load(text(new, "m")), FILE)
    assert again == new.vehicle
    assert all(abs(again.correlations.get(pair, 0.0)) <= 1.0 for pair in itertools.permutations(again.coefficients, 2))

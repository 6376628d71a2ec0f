"""Both estimators side by side: the table, the report, and that the kinematic one knows nothing of forces."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import dives
import numpy as np
import pandas as pd
import pytest
from dives import PETREL, Flown

import pipeline
from pipeline.estimate import kinematic, smoother, stage
from pipeline.estimate.compatibility import reconcile
from pipeline.estimate.series import from_records
from pipeline.estimate.stage import Estimated, estimate
from pipeline.mission import Ballast
from pipeline.records import ESTIMATES, of_method, seconds
from pipeline.vehicle import Polar, Vehicle

NUMBERS = [column.name for column in ESTIMATES if column.dtype == "float64"]
ANGLES = ("pitch", "angle_of_attack", "path_angle", "vertical_water_velocity")


@pytest.fixture(scope="module")
def flown() -> Flown:
    """Return two dives, climbs under power."""
    return dives.fly(11, dives=((25.0, 4.0, 120.0), (35.0, 6.0, 120.0)), power=700.0)


@pytest.fixture(scope="module")
def found(flown: Flown) -> Estimated:
    """Return what both methods find."""
    return estimate(flown.records, flown.vehicle, flown.mission)


# --- The table --------------------------------------------------------------------------------------------------------


def test_both_methods_are_in_one_canonical_table_each_in_time_order(flown: Flown, found: Estimated) -> None:
    table = found.estimates
    assert list(table.columns) == [column.name for column in ESTIMATES]
    assert list(dict.fromkeys(table["method"])) == ["kinematic", "force"]
    for method in stage.METHODS:
        rows = of_method(table, method)
        pd.testing.assert_series_equal(rows["time"], flown.records["time"], check_names=False)
        np.testing.assert_array_equal(rows["dive"], flown.records["dive"])


@pytest.mark.parametrize("method", stage.METHODS)
def test_what_is_not_observable_is_nan_and_says_why_but_for_pitch_and_depth(found: Estimated, method: str) -> None:
    rows = of_method(found.estimates, method)
    seen = rows["observable"].to_numpy()
    assert 0.5 < seen.mean() < 1.0
    assert (rows.loc[seen, "reason"] == "").all()
    assert (rows.loc[~seen, "reason"] != "").all()
    assert np.isfinite(rows.loc[seen, NUMBERS]).all(axis=None)
    hidden = [name for name in NUMBERS if not name.startswith(("pitch", "depth"))]
    assert rows.loc[~seen, hidden].isna().all(axis=None)
    assert np.isfinite(rows[["pitch", "pitch_std", "depth", "depth_std"]]).all(axis=None)
    assert (rows.loc[seen, [f"{name}_std" for name in ("speed", *ANGLES, "depth")]] > 0.0).all(axis=None)


@pytest.mark.parametrize(("method", "least"), [("kinematic", 0.8), ("force", 0.85)])
def test_both_find_the_true_speed(flown: Flown, found: Estimated, method: str, least: float) -> None:
    rows = of_method(found.estimates, method)
    seen = rows["observable"].to_numpy()
    gap = (rows["speed"].to_numpy() - flown.truth["speed"].to_numpy())[seen]
    assert np.mean(np.abs(gap) < 1.96 * rows["speed_std"].to_numpy()[seen]) > least
    assert np.sqrt(np.mean(gap**2)) < 0.05


def test_the_force_method_sees_through_manoeuvres_that_the_kinematic_does_not(found: Estimated) -> None:
    shares = [of_method(found.estimates, method)["observable"].mean() for method in ("force", "kinematic")]
    assert shares[0] > shares[1]


# --- The report -------------------------------------------------------------------------------------------------------


def test_the_report_tells_of_both(found: Estimated) -> None:
    report = found.report
    assert set(report) == {
        "observable_share", "reasons", "consistency", "coverage", "gps", "share_of_variance", "settings", "used",
        "compatibility", "force",
    }  # fmt: skip
    assert set(report["consistency"]) == set(stage.METHODS)
    known = {"reason", "parameters", "correlation", "converged", "observable_share", "reasons", "settings"}
    assert set(report["force"]) == known
    assert report["force"]["reason"] == ""
    for method, told in (("kinematic", report), ("force", report["force"])):
        rows = of_method(found.estimates, method)
        assert told["observable_share"] == pytest.approx(rows["observable"].mean(), rel=1e-12)
        hidden = rows.loc[~rows["observable"], "reason"]
        assert told["reasons"] == {str(text): int(n) for text, n in sorted(hidden.value_counts().items())}


def test_without_the_engine_there_is_no_force_estimate_and_the_report_says_why(flown: Flown) -> None:
    blind = flown.records.assign(buoyancy_volume=np.nan)
    result = estimate(blind, flown.vehicle, flown.mission)
    assert set(result.estimates["method"]) == {"kinematic"}
    assert result.report["force"] == {"reason": "no buoyancy engine volume: no net buoyancy"}
    assert set(result.report["consistency"]) == {"kinematic"}


def test_a_part_without_density_has_no_force_estimate_and_says_so_row_by_row(
    flown: Flown, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The CTD is switched off for the first dive: the force model stays adjusted by the second."""
    half = int(np.argmax(flown.records["dive"].to_numpy() == 2))
    records = flown.records.assign(density=flown.records["density"].where(np.arange(len(flown.records)) >= half))
    monkeypatch.setattr(stage, "cuts", lambda records: [(0, half), (half, len(records))])
    monkeypatch.setattr(stage, "windows", lambda m: [(0, half), (half, m)])
    result = estimate(records, flown.vehicle, flown.mission)
    rows = of_method(result.estimates, "force")
    pd.testing.assert_series_equal(rows["time"], records["time"], check_names=False)
    assert set(rows["reason"][:half]) == {"no density: no net buoyancy"}
    assert rows[NUMBERS][:half].isna().all(axis=None)
    assert rows["observable"][half:].mean() > 0.5
    report = result.report["force"]
    assert report["reasons"]["no density: no net buoyancy"] == half
    assert report["observable_share"] == pytest.approx(rows["observable"].mean())
    assert set(result.report["consistency"]) == set(stage.METHODS)


def test_counts_of_parts_add_up_to_those_of_the_whole(
    flown: Flown, found: Estimated, monkeypatch: pytest.MonkeyPatch
) -> None:
    half = int(np.argmax(flown.records["dive"].to_numpy() == 2))
    monkeypatch.setattr(stage, "cuts", lambda records: [(0, half), (half, len(records))])
    result = estimate(flown.records, flown.vehicle, flown.mission)
    assert result.report["force"]["parameters"] == found.report["force"]["parameters"]
    for method in stage.METHODS:
        whole, parts = of_method(found.estimates, method), of_method(result.estimates, method)
        pd.testing.assert_series_equal(parts["time"], whole["time"])
        assert (parts["observable"] == whole["observable"]).mean() > 0.97
        both = (parts["observable"] & whole["observable"]).to_numpy()
        for name in ("speed", "path_angle", "angle_of_attack", "depth"):
            gap = (np.abs(parts[name] - whole[name]) / whole[f"{name}_std"]).to_numpy()[both]
            assert np.median(gap) < 0.1, (method, name)
            assert gap.max() < 1.0, (method, name)
        told = result.report if method == "kinematic" else result.report["force"]
        assert sum(told["reasons"].values()) == (~parts["observable"]).sum()


# --- The kinematic method knows nothing of forces ---------------------------------------------------------------------


def kinematic_of(records: pd.DataFrame, vehicle: Vehicle, flown: Flown, **mission: object) -> pd.DataFrame:
    """Return the estimates of the kinematic method alone."""
    settings = flown.mission.model_copy(update=mission)
    return estimate(records, vehicle, settings, methods=("kinematic",)).estimates


def test_it_is_the_same_to_the_last_bit_whether_the_force_method_runs_or_not(flown: Flown, found: Estimated) -> None:
    alone = kinematic_of(flown.records, flown.vehicle, flown)
    pd.testing.assert_frame_equal(alone, of_method(found.estimates, "kinematic"), check_exact=True)


CHANGES: Mapping[str, tuple[Mapping[str, float], float, float, float, Ballast | None]] = {
    "engine volume": ({}, 1.5, 1e-4, 1.0, None),
    "ballast": ({}, 1.0, 0.0, 1.0, Ballast(volume=0.1, std=2.0)),
    "mass": ({"mass": 2.0, "mass_forward": 3.0, "mass_normal": 0.5, "pitch_inertia": 4.0}, 1.0, 0.0, 1.0, None),
    "hull": ({"compressibility": 5.0, "thermal_expansion": 0.1}, 1.0, 0.0, 1.0, None),
    "thrust": ({"thrust_static": 3.0, "propeller_diameter": 2.0}, 1.0, 0.0, 1.0, None),
    "propeller speed": ({}, 1.0, 0.0, 1.4, None),
}


@pytest.mark.parametrize("what", CHANGES)
def test_what_makes_a_force_does_not_reach_it(flown: Flown, found: Estimated, what: str) -> None:
    factors, volume, more, turning, ballast = CHANGES[what]
    records = flown.records.assign(
        buoyancy_volume=volume * flown.records["buoyancy_volume"] + more,
        propeller_speed=turning * flown.records["propeller_speed"],
    )
    other = PETREL.with_values({name: factor * PETREL[name] for name, factor in factors.items()}, "changed")
    after = kinematic_of(records, other, flown, **({"ballast": ballast} if ballast else {}))
    pd.testing.assert_frame_equal(after, of_method(found.estimates, "kinematic"), rtol=1e-12, atol=0.0)


def test_nor_does_a_common_factor_on_lift_and_drag(flown: Flown, found: Estimated) -> None:
    """A power of two is exact in binary: what differs then would be a use of more than ratios, not rounding."""
    names = ("lift_at_zero", "lift_slope", "parasite_drag", "induced_drag")
    twice = PETREL.with_values({name: 2.0 * PETREL[name] for name in names}, "scaled")
    after = kinematic_of(flown.records, twice, flown)
    pd.testing.assert_frame_equal(after, of_method(found.estimates, "kinematic"), rtol=1e-12, atol=0.0)


FORCES = {
    *(f"pipeline.estimate.{name}" for name in ("force", "forcing", "adjust", "ballast")),
    *(f"pipeline.model.{name}" for name in ("forces", "dynamics", "steady", "balance", "predict")),
}
ROOT = Path(pipeline.__file__).parents[1]


def reached(name: str, done: set[str]) -> None:
    """Add to `done` the modules of the package that module `name` imports, directly or not."""
    path = ROOT.joinpath(*name.split(".")).with_suffix(".py")
    if name in done or not path.is_file():
        return
    done.add(name)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                reached(alias.name, done)
        elif isinstance(node, ast.ImportFrom) and node.module:
            reached(node.module, done)
            for alias in node.names:
                reached(f"{node.module}.{alias.name}", done)


@pytest.mark.parametrize("module", ["kinematic", "series", "compatibility", "verdict", "legs", "consistency"])
def test_nothing_that_it_is_made_of_imports_a_force(module: str) -> None:
    done: set[str] = set()
    reached(f"pipeline.estimate.{module}", done)
    assert not done & FORCES
    assert {name for name in done if name.startswith("pipeline.model")} <= {"pipeline.model.closure"}
    if module == "kinematic":
        own = {"kinematic", "linearise", "trajectory", "noise", "settings", "series", "smoother"}
        assert {name.rsplit(".", 1)[1] for name in done if name.startswith("pipeline.estimate.")} == own


def test_the_forces_are_found_where_they_are() -> None:
    """The search above would find them: the force model does import them."""
    done: set[str] = set()
    reached("pipeline.estimate.adjust", done)
    assert {"pipeline.estimate.force", "pipeline.estimate.forcing", "pipeline.model.forces"} <= done


@dataclass(frozen=True)
class Guarded(Vehicle):
    """A vehicle that shows nobody more than its lift and drag."""

    def __getitem__(self, name: str) -> float:
        """Return a coefficient of lift or drag."""
        assert name in Polar._fields, f"the kinematic estimate asked for {name}"
        return super().__getitem__(name)

    def std(self, name: str) -> float:
        """Return the 1-sigma of a coefficient of lift or drag."""
        assert name in Polar._fields, f"the kinematic estimate asked for the 1-sigma of {name}"
        return super().std(name)


def test_it_asks_the_vehicle_for_lift_and_drag_alone(flown: Flown, found: Estimated) -> None:
    guarded = Guarded(PETREL.name, PETREL.description, PETREL.coefficients)
    compatible = reconcile(flown.records, from_records(flown.records), guarded, flown.mission)
    model = kinematic.prepare(compatible.series, guarded, flown.mission, smoother.solve, fixes=False)
    assert set(model.names) <= {"pitch", *Polar._fields}
    result = kinematic.solve(compatible.series, model)
    rows = of_method(found.estimates, "kinematic")
    seen = rows["observable"].to_numpy()
    np.testing.assert_array_equal(result.flight.state[0][seen], rows["speed"].to_numpy()[seen])
    with pytest.raises(AssertionError, match="asked for mass"):
        guarded["mass"]


# --- Engines and methods ----------------------------------------------------------------------------------------------


def test_filterpy_gives_the_same_force_estimates_to_1e9(flown: Flown) -> None:
    first = int(np.argmax(flown.records["phase"].to_numpy() == 2))
    records = flown.records.iloc[first : first + 60].reset_index(drop=True)
    ours = of_method(estimate(records, flown.vehicle, flown.mission).estimates, "force")
    theirs = of_method(estimate(records, flown.vehicle, flown.mission, engine="filterpy").estimates, "force")
    assert ours["observable"].any()
    for name in ("speed", "speed_std", "angle_of_attack", "path_angle", "depth", "vertical_water_velocity"):
        np.testing.assert_allclose(theirs[name], ours[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_a_method_not_asked_for_is_left_out(flown: Flown) -> None:
    result = estimate(flown.records.iloc[:60], flown.vehicle, flown.mission, methods=("kinematic",))
    assert set(result.estimates["method"]) == {"kinematic"}
    assert result.report["force"] == {"reason": "not asked for"}


def test_no_records_give_an_empty_table(flown: Flown) -> None:
    result = estimate(flown.records.iloc[:0], flown.vehicle, flown.mission)
    assert list(result.estimates.columns) == [column.name for column in ESTIMATES]
    assert len(result.estimates) == 0
    assert result.report["force"] == {"reason": "no records"}
    assert seconds(result.estimates["time"]).size == 0

"""The kinematic method knows nothing of forces."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from dives import PETREL, Flown

import pipeline
from pipeline.estimate import kinematic, smoother
from pipeline.estimate.compatibility import reconcile
from pipeline.estimate.series import from_records
from pipeline.estimate.stage import Estimated, estimate
from pipeline.mission import Ballast
from pipeline.records import of_method
from pipeline.vehicle import Polar, Vehicle


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
        own = {"kinematic", "linearise", "trajectory", "noise", "settings", "series", "problem", "kalman"}
        own |= {"gyro", "lag", "sensors", "spikes", "told"}
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
    assert set(model.names) <= {"pitch", "speed_by_pitch", *Polar._fields}
    result = kinematic.solve(compatible.series, model)
    rows = of_method(found.estimates, "kinematic")
    seen = rows["observable"].to_numpy()
    np.testing.assert_array_equal(result.flight.state[0][seen], rows["speed"].to_numpy()[seen])
    with pytest.raises(AssertionError, match="asked for mass"):
        guarded["mass"]

"""Reference cases of the paper's equations, computed elsewhere with plain scipy."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipeline.vehicle import Vehicle, load

NAMES = {
    "KL0": "lift_at_zero",
    "KL": "lift_slope",
    "KD0": "parasite_drag",
    "KD": "induced_drag",
    "KM0": "moment_at_zero",
    "KM": "moment_slope",
    "Kq": "pitch_damping",
    "J2": "pitch_inertia",
    "m1": "mass_forward",
    "m3": "mass_normal",
    "rho": "reference_density",
    "K1": "thrust_static",
    "K2": "thrust_slope",
    "D0": "propeller_diameter",
}


@pytest.fixture(scope="session")
def cases(data: Path) -> dict[str, Any]:
    """Return the groups of reference cases, and the header's nominal parameters."""
    path = data.parent / "paper" / "cases.json"
    if not path.is_file():
        pytest.skip(f"no reference cases: {path} does not exist")
    content = json.loads(path.read_text())
    return content["cases"] | {"nominal": content["header"]["nominal_params"]}


@pytest.fixture(scope="session")
def vehicle_of(cases: dict[str, Any]) -> Callable[[dict[str, Any]], Vehicle]:
    """Return a maker of the vehicle of one case: the nominal parameters with the case's own on top."""

    def make(inputs: dict[str, Any]) -> Vehicle:
        values = cases["nominal"] | inputs["params"]
        changes = {NAMES[symbol]: value for symbol, value in values.items() if symbol in NAMES}
        return load("petrel-ii").with_values(changes, "reference case")

    return make


@pytest.fixture(scope="session")
def petrel() -> Vehicle:
    return load("petrel-ii")

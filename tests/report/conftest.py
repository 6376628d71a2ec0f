"""What the tests of the report share."""

import math

import pytest
from matplotlib.figure import Figure
from pages import caught, complete

from pipeline.mission import Mission
from pipeline.report import Report, build
from pipeline.vehicle import Coefficient, Vehicle, load


@pytest.fixture(scope="session")
def petrel() -> Vehicle:
    return load("petrel-ii")


@pytest.fixture(scope="session")
def exact(petrel: Vehicle) -> Vehicle:
    """Petrel-II whose borrowed coefficients are known exactly; the drag that is fitted keeps its 1-sigma."""
    known = {
        name: Coefficient(item.value, item.std if name == "parasite_drag" else 0.0, item.unit, item.source)
        for name, item in petrel.coefficients.items()
    }
    return Vehicle(petrel.name, petrel.description, known)


@pytest.fixture(scope="session")
def unknown(petrel: Vehicle) -> Vehicle:
    """Petrel-II whose drag nobody knows."""
    changed = dict(petrel.coefficients)
    item = changed["parasite_drag"]
    changed["parasite_drag"] = Coefficient(math.nan, math.nan, item.unit, "unknown")
    return Vehicle(petrel.name, petrel.description, changed)


@pytest.fixture
def mission() -> Mission:
    return Mission(vehicle="petrel-ii", name="synthetic")


@pytest.fixture(scope="session")
def looked_at(petrel: Vehicle) -> tuple[Report, dict[str, Figure]]:
    """Summary and page of a mission that has everything, and its figures as they were drawn."""
    with caught() as drawn:
        return build(complete(petrel)), drawn


@pytest.fixture(scope="session")
def built(looked_at: tuple[Report, dict[str, Figure]]) -> Report:
    """Summary and page of a mission that has everything."""
    return looked_at[0]

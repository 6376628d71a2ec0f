"""Simulated trials with their truth, read by the pipeline's own ingest; each is made once."""

from collections.abc import Callable
from pathlib import Path

import dives
import pytest
from dives import Flown
from truth import Trial

from pipeline import mission, simulate, store, vehicle
from pipeline.estimate.stage import Estimated, estimate
from pipeline.ingest import ingest


@pytest.fixture(scope="session")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Trial]:
    """Return a function that gives a trial by name."""
    made: dict[str, Trial] = {}

    def give(name: str) -> Trial:
        if name not in made:
            folder = Path(tmp_path_factory.mktemp("raw")) / name
            simulate.simulate(name, folder, seed=0)
            settings = mission.load(folder)
            craft = vehicle.load(settings.vehicle, folder)
            records = ingest(settings).records
            made[name] = Trial(
                settings, craft, records, estimate(records, craft, settings), store.read_table(folder / "truth.parquet")
            )
        return made[name]

    return give


@pytest.fixture(scope="session")
def flown() -> Flown:
    """Return two dives, climbs under power."""
    return dives.fly(11, dives=((25.0, 4.0, 120.0), (35.0, 6.0, 120.0)), power=700.0)


@pytest.fixture(scope="session")
def found(flown: Flown) -> Estimated:
    """Return what both methods find."""
    return estimate(flown.records, flown.vehicle, flown.mission)

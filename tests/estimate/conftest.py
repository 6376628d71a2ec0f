"""Simulated trials with their truth, read by the pipeline's own ingest; each is made once."""

from collections.abc import Callable
from pathlib import Path

import pytest
from truth import Trial

from pipeline import mission, simulate, store, vehicle
from pipeline.estimate.stage import estimate
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

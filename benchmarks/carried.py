"""Missions of a vehicle whose fairing carries water along, that its file names or not: what each stage finds of it.

They dive through a layer that is as dense below as above it is light, by salt (halocline) or by warmth (thermocline):
there a hull that takes time to follow the water's temperature does the same to net buoyancy.

Usage: ``python benchmarks/carried.py [MISSIONS]`` in each water (6).
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from pipeline import instruments, mission, trials, vehicle
from pipeline.estimate import adjust, force
from pipeline.estimate.ballast import hull
from pipeline.estimate.craft import CARRIED, HULL_TIME, from_vehicle
from pipeline.estimate.forcing import forcing
from pipeline.estimate.series import from_records
from pipeline.estimate.stage import InMemory, stream
from pipeline.estimate.trajectory import first_guess
from pipeline.ingest import ingest
from pipeline.mission import Mission
from pipeline.model.exchange import CARRIED_STD
from pipeline.model.predict import predict
from pipeline.plan import Stage, Water
from pipeline.report.compare import compare
from pipeline.report.fitting.fit import fit
from pipeline.report.fitting.given import Given
from pipeline.simulate import run
from pipeline.vehicle import Coefficient, Vehicle

#: What is carried, of the hull's volume, and the time in which it is renewed, s; and how well the file that names it
#: knows them.
SHARE, TIME = 0.3, 600.0
SHARE_STD, TIME_STD = 0.02, 50.0
DEPTH = (0.0, 60.0, 80.0, 100.0, 120.0, 160.0, 400.0, 1200.0)
WATERS = {
    "halocline": Water(DEPTH, (8.0,) * 8, (28.0, 28.0, 29.0, 31.0, 33.5, 34.5, 34.6, 34.7)),
    "thermocline": Water(DEPTH, (24.0, 24.0, 21.0, 15.0, 10.0, 9.0, 8.0, 5.0), (34.0,) * 8),
}
FOUND = ("carried_water", "hull_time")
FREE = ("parasite_drag", "net_buoyancy", "carried_water")
#: N per share of the hull's volume beyond which a block is said to feel the water carried.
FELT = 0.5


class Trial(NamedTuple):
    """A mission after stage 3."""

    vehicle: Vehicle
    mission: Mission
    blocks: pd.DataFrame
    predictions: pd.DataFrame
    report: dict[str, Any]


def named(craft: Vehicle) -> Vehicle:
    """Return `craft` with what its fairing carries in its file."""
    fairing = {
        "carried_water": Coefficient(SHARE, SHARE_STD, "1", "as flown"),
        "flushing_time": Coefficient(TIME, TIME_STD, "s", "as flown"),
    }
    return replace(craft, coefficients={**craft.coefficients, **fairing})


def flown(water: str, seed: int) -> tuple[Mission, pd.DataFrame]:
    """Return mission and records of Petrel-II with water in a fairing: four dives through one of `WATERS`."""
    stages = []
    for pitch, buoyancy in ((25.0, 4.0), (40.0, 6.0)) * 2:
        stages += [
            Stage(-pitch, buoyancy, 0.0, "duration", 120.0, afloat=True),
            Stage(-pitch, -buoyancy, 0.0, "deeper", 300.0),
            Stage(pitch, buoyancy, 0.0, "surface"),
        ]
    plan = replace(
        trials.trial("petrel2-scs-2014"),
        name=water,
        vehicle=named(vehicle.load("petrel-ii")),
        stages=(*stages, Stage(-25.0, 4.0, 0.0, "duration", 60.0, afloat=True)),
        nominal=(),
        nominal_depth=150.0,
        water=WATERS[water],
        vertical_water_std=0.005,
    )
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / plan.name
        instruments.write(plan, run(plan, seed).streams, folder, seed)
        settings = mission.load(folder)
        return settings, ingest(settings).records


def analysed(settings: Mission, records: pd.DataFrame, craft: Vehicle) -> Trial:
    """Return what stages 2 and 3 make of a mission with this vehicle file."""
    found = stream(InMemory(records), craft, settings, lambda part: None, constants={})
    return Trial(craft, settings, found.blocks, predict(craft, found.blocks), found.report)


def errors(trial: Trial) -> pd.DataFrame:
    """Return theory less measurement of each block's depth rate, and what carried water does there."""
    table = compare(trial.blocks, trial.predictions, trial.vehicle, settings=trial.report["settings"])
    table = table[(table["trim"] == "pitch") & (table["quantity"] == "depth_rate")]
    return table.merge(trial.blocks[["block", "net_buoyancy_std", "buoyancy_by_carried"]], on="block")


def share_in_blocks(trial: Trial) -> tuple[float, float]:
    """Return the share of the hull's volume that block means tell beyond the vehicle file, and its 1-sigma."""
    found = fit(trial.blocks, trial.vehicle, Given(settings=trial.report["settings"]), free=FREE)
    return next((item["value"], item["std"]) for item in found["parameters"] if item["name"] == "carried_water")


def felt(table: pd.DataFrame) -> pd.Series:
    """Return which blocks feel the water carried."""
    return table["buoyancy_by_carried"].abs() > FELT


def from_another_start(settings: Mission, records: pd.DataFrame, craft: Vehicle) -> dict[str, Any]:
    """Return the parameters that the adjustment ends at when it begins with a fairing and a hull without lag."""
    body, _ = hull(settings, craft, {}, records)
    assert body is not None
    inputs, reason = forcing(records, craft, settings, body)
    assert inputs is not None, reason
    series, begun = from_records(records), from_vehicle(craft, settings, body)
    guess = first_guess(series, craft.polar)
    value = begun.value.copy()
    value[CARRIED], value[HULL_TIME] = CARRIED_STD, 0.0
    path = force.path(series, guess.speed, guess.pitch)
    found = adjust.adjust([adjust.Stretch(series, inputs)], begun._replace(value=value), [path], speed=False)
    return dict(found.report["parameters"])


def main(missions: int) -> None:
    """Print what stages 2 to 4 find, water by water and mission by mission."""
    file = vehicle.load("petrel-ii")
    print(f"{SHARE:g} of the hull's volume carried, renewed in {TIME:g} s; where no file names it: share, hull time s,")
    print("by the force estimate | from another start | share by blocks | E of the depth rate in blocks that feel it,")
    print("rms in cm/s | the same with a file that names it")
    for water in WATERS:
        for seed in range(missions):
            settings, records = flown(water, seed)
            none, with_it = (analysed(settings, records, craft) for craft in (file, named(file)))
            ends = (none.report["force"]["parameters"], from_another_start(settings, records, file))
            shares = [", ".join(f"{end[key]['value']:.2f} ± {end[key]['std']:.2f}" for key in FOUND) for end in ends]
            by_blocks = "{:.2f} ± {:.2f}".format(*share_in_blocks(none))
            gaps = [errors(trial) for trial in (none, with_it)]
            rms = [100.0 * np.sqrt(np.mean(gap["error"][felt(gap)] ** 2)) for gap in gaps]
            print(f"{water:11} {seed} | {shares[0]:>27} | {shares[1]:>27} | {by_blocks} | {rms[0]:.1f} | {rms[1]:.1f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 6)

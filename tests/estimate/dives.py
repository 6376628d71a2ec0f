"""Missions flown by the full dynamics and sampled at once as canonical records, with their truth."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline import trials, vehicle
from pipeline.mission import Ballast, Mission, PitchCorrection
from pipeline.plan import Plan, Sea, Stage
from pipeline.records import MEASURED, RECORDS, Phase, Quality, conform, seconds
from pipeline.simulate import Injection, run
from pipeline.vehicle import Vehicle

PETREL = vehicle.load("petrel-ii")


class Flown(NamedTuple):
    """A mission as the estimator gets it, and its truth at the instants of the records."""

    records: pd.DataFrame
    vehicle: Vehicle
    mission: Mission
    truth: pd.DataFrame


def fly(
    seed: int = 0,
    *,
    changes: Mapping[str, float] | None = None,
    injection: Injection | None = None,
    dives: tuple[tuple[float, float, float], ...] = ((25.0, 4.0, 400.0), (40.0, 7.0, 400.0)),
    power: float = 0.0,
    ballast_std: float = 0.3,
    every: int = 6,
    water: tuple[float, float] | None = None,
) -> Flown:
    """Return a mission of Petrel-II.

    Parameters
    ----------
    seed
        Of the water's motion and of the noise.
    changes
        Factors on its coefficients, that the file given to the estimator does not know.
    injection
        Bias of pitch and offset of net buoyancy.
    dives
        Pitch [deg], net buoyancy [N] and depth [m] of each.
    power
        Propeller [1/min] in climbs.
    ballast_std
        1-sigma of net buoyancy that the mission states, N.
    every
        Sampling interval, s.
    water
        σ [m/s] and τ [s] of its vertical velocity, as in the trial if left out.
    """
    true = PETREL.with_values({name: factor * PETREL[name] for name, factor in (changes or {}).items()}, "true")
    stages: list[Stage] = []
    for pitch, force, depth in dives:
        stages += [
            Stage(-pitch, force, 0.0, "duration", 120.0, afloat=True),
            Stage(-pitch, -force, 0.0, "deeper", depth),
            Stage(pitch, force, 0.0, "surface", rpm=power),
        ]
    plan = _plan()
    if water:
        plan = replace(plan, vertical_water_std=water[0], vertical_water_time=water[1])
    plan = replace(
        plan,
        vehicle=true,
        stages=(*stages, Stage(-25.0, 4.0, 0.0, "duration", 60.0, afloat=True)),
        nominal_depth=0.5 * dives[0][2],
    )
    injection = injection or Injection()
    truth = run(plan, seed, injection).truth.iloc[::every].reset_index(drop=True)
    mission = Mission(
        vehicle="petrel-ii",
        latitude=plan.latitude,
        ballast=Ballast(neutral_density=plan.neutral_density, std=ballast_std),
        pitch=PitchCorrection(std_deg=0.3),
    )
    return Flown(_records(plan, truth, injection, seed), PETREL, mission, truth)


@functools.cache
def _plan() -> Plan:
    return trials.trial("petrel2-scs-2014")


def _records(plan: Plan, truth: pd.DataFrame, injection: Injection, seed: int) -> pd.DataFrame:
    """Return canonical records with 2 cm of noise in depth and 0.1 degrees in pitch."""
    rng = np.random.default_rng([seed, 7])
    m = len(truth)
    depth, afloat = truth["depth"].to_numpy(), truth["afloat"].to_numpy()
    sea = Sea.of(plan, np.maximum(depth, 0.0))
    flying = np.where(truth["pitch"] < 0.0, Phase.DESCENT, Phase.ASCENT)
    values = {
        "time": truth["time"],
        "depth": depth + 0.02 * rng.standard_normal(m),
        "pressure": sea.pressure,
        "temperature": sea.temperature,
        "density": sea.density,
        "absolute_salinity": sea.salinity,
        "conservative_temperature": sea.temperature,
        "pitch": truth["pitch"] + np.radians(injection.pitch_bias_deg + 0.1 * rng.standard_normal(m)),
        "buoyancy_volume": truth["buoyancy_volume"],
        "propeller_speed": truth["propeller_speed"],
        "phase": np.where(afloat, Phase.SURFACING, flying).astype(np.int8),
        "dive": np.cumsum(np.diff(afloat.astype(int), prepend=1) == -1),
        "block": np.where(afloat, -1, np.cumsum(np.diff(truth["stage"], prepend=0) != 0)),
    }
    values |= {f"{column.name}_qc": int(Quality.GOOD) for column in MEASURED if column.name in values}
    return conform(pd.DataFrame(values), RECORDS)


def at(flown: Flown, name: str, time: pd.Series) -> np.ndarray:
    """Return a true quantity at some instants."""
    return np.interp(seconds(time), seconds(flown.truth["time"]), flown.truth[name])

"""What the vehicle weighs and displaces: from mission.yaml, the logs' calibration, or an assumption that is said."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from pipeline.findings import Finding
from pipeline.mission import Mission
from pipeline.model.forces import GRAVITY
from pipeline.vehicle import Vehicle

#: 1-sigma (N) of net buoyancy where nothing is known but that the vehicle can both sink and float.
ASSUMED_STD = 2.0
#: The same where the logs carry the hull's volume and mission.yaml no 1-sigma.
LOGGED_STD = 0.5


@dataclass(frozen=True)
class Hull:
    """Mass [kg], volume at the surface with the engine at zero [m3], the 1-sigma of net buoyancy [N]; who says so."""

    mass: float
    volume: float
    std: float
    source: Literal["mission.yaml", "logs", "assumed"] = "assumed"


def borrowed_std(mission: Mission, records: pd.DataFrame) -> float:
    """Return the 1-sigma [kg/m3] of a density that mission.yaml lends to `records`; 0 where it was measured."""
    if mission.water is None or records["absolute_salinity"].notna().any():
        return 0.0
    return mission.water.std


def hull(
    mission: Mission, vehicle: Vehicle, constants: Mapping[str, float], records: pd.DataFrame
) -> tuple[Hull | None, list[Finding]]:
    """Return mass and volume of the vehicle, and what had to be assumed.

    The first of these that is given: ``ballast.volume``; ``ballast.neutral_density``; the hull volume in the logs'
    calibration constants; else the vehicle is taken to be neutral, engine at zero, in the mean density of its dives.

    Parameters
    ----------
    mission, vehicle
        Mission and vehicle.
    constants
        Calibration constants from the logs (``mass`` [kg], ``hull_volume`` [m3]).
    records
        Canonical records (density).
    """
    mass = mission.ballast.mass or constants.get("mass", vehicle["mass"])
    if not math.isfinite(mass):
        return None, [
            Finding(
                "warning",
                "mission.yaml",
                "ballast.mass",
                "no mass, in the vehicle file neither",
                "a mass in kg",
                "there is no net buoyancy and no theory without it",
            )
        ]
    lent = borrowed_std(mission, records)

    def known(volume: float, std: float, source: Literal["mission.yaml", "logs"]) -> tuple[Hull, list[Finding]]:
        return Hull(mass, volume, math.hypot(std, GRAVITY * volume * lent), source), []

    if mission.ballast.volume is not None:
        return known(mission.ballast.volume, mission.ballast.std, "mission.yaml")
    if mission.ballast.neutral_density is not None:
        return known(mass / mission.ballast.neutral_density, mission.ballast.std, "mission.yaml")
    if "hull_volume" in constants:
        stated = "std" in mission.ballast.model_fields_set
        return known(constants["hull_volume"], mission.ballast.std if stated else LOGGED_STD, "logs")
    density = records["density"].to_numpy()
    if not np.isfinite(density).any():
        return None, [
            Finding("warning", "records", "density", "no density", "temperature and conductivity", "no net buoyancy")
        ]
    neutral, std = float(np.nanmean(density)), max(mission.ballast.std, ASSUMED_STD)
    note = Finding(
        "warning",
        "mission.yaml",
        "ballast",
        "neither volume nor neutral_density",
        "one of them",
        f"taken as neutral in {neutral:.2f} kg/m3, the mean density met, with a 1-sigma of {std:g} N",
    )
    return Hull(mass, mass / neutral, std), [note]

"""Measurements and inputs of the estimators made of plain arrays, without records."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from pipeline.estimate.craft import HULL_TIME, PARAMETERS, Craft
from pipeline.estimate.forcing import Forcing
from pipeline.estimate.series import Series
from pipeline.model.forces import NO_DISK, propeller_of
from pipeline.vehicle import Vehicle


def series(time: np.ndarray, pitch: np.ndarray | float, depth: np.ndarray | float = np.nan) -> Series:
    """Return steady, unpowered flight, pitch and depth measured at every instant (m,)."""
    m = time.size
    pitch, depth = np.broadcast_to(pitch, m).copy(), np.broadcast_to(depth, m).copy()
    nothing, never = np.full(m, np.nan), np.zeros(m, dtype=bool)
    still = dict.fromkeys(("depth_rate_guess", "turning", "loose", "swinging", "hiding"), np.zeros(m))
    measured = {"depth": depth, "pitch": pitch, "pitch_guess": pitch, **still}
    unmeasured = dict.fromkeys(("turn", "speed", "speed_std", "east", "north", "heading", "stratification"), nothing)
    flags = {field.name for field in fields(Series)} - {"start", "time", *measured, *unmeasured}
    return Series(start=0.0, time=time, **measured, **unmeasured, **dict.fromkeys(flags, never))


def inputs(
    m: int, net_buoyancy: np.ndarray | float, density: float, propeller_speed: float = 0.0, **others: float
) -> Forcing:
    """Return inputs at m instants; `others` are the fields beginning with by_, and propeller_power."""

    def held(value: np.ndarray | float) -> np.ndarray:
        return np.broadcast_to(value, m).astype(np.float64)

    rest = [
        name for name in Forcing._fields if name.startswith("by_") or name in ("propeller_power", "switching", "doubt")
    ]
    by = {name: held(others.get(name, 0.0)) for name in rest}
    given = {"net_buoyancy": net_buoyancy, "density": density, "propeller_speed": propeller_speed}
    return Forcing(**{name: held(value) for name, value in given.items()}, **by)


def craft(vehicle: Vehicle, **values: float) -> Craft:
    """Return `vehicle` as the force model sees it, its hull as warm as the water, every 1-sigma 1.

    Mass along the nose is 1.1 of the mass where it is not known; `values` are those of `PARAMETERS`.
    """
    c = len(PARAMETERS)
    value = np.array([values.get(name, 0.0) for name in PARAMETERS])
    value[HULL_TIME] = values.get("hull_time", 0.0)
    inertia = vehicle["mass_forward"]
    return Craft(
        vehicle.polar,
        propeller_of(vehicle),
        inertia if np.isfinite(inertia) else 1.1 * vehicle["mass"],
        vehicle["reference_density"],
        0.0 if np.isnan(vehicle["thermal_expansion"]) else vehicle["thermal_expansion"],
        np.zeros(c),
        np.ones(c),
        value,
        disk=vehicle.disk or NO_DISK,
    )

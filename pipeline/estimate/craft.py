"""The vehicle as the force model sees it: its coefficients, what is not known of them, and what a mission adjusted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pipeline.estimate.ballast import Hull
from pipeline.estimate.forcing import Forcing
from pipeline.estimate.settings import Noise
from pipeline.mission import Mission
from pipeline.model.exchange import CARRIED_STD, FLUSHING_BEFORE, HULL_TIME_BEFORE, HULL_TIME_STD, fairing_of
from pipeline.model.forces import NO_DISK, disk_thrust_std, law_thrust_std, propeller_of
from pipeline.vehicle import Disk, Polar, Propeller, PropellerError, Vehicle

#: What the force model is told and does not know exactly, in the order of their columns; unit of a change of 1.
PARAMETERS = (
    "pitch",  # rad, bias of the measured pitch
    "parasite_drag",  # relative
    "lift_slope",  # relative
    "induced_drag",  # relative
    "lift_at_zero",  # kg/m
    "net_buoyancy",  # N
    "compressibility",  # 1/Pa
    "thermal_expansion",  # 1/K
    "thrust",  # relative
    "hull_time",  # s, in which the hull takes on the temperature of the water
    "carried_water",  # share of the hull's volume: water in the fairing that is renewed slowly
    "flushing_time",  # natural logarithm of the time in which it is, over `FLUSHING_BEFORE`
)
BIAS, BUOYANCY, EXPANSION, THRUST, HULL_TIME, CARRIED, FLUSHING = (
    PARAMETERS.index(name)
    for name in (
        "pitch",
        "net_buoyancy",
        "thermal_expansion",
        "thrust",
        "hull_time",
        "carried_water",
        "flushing_time",
    )
)
#: Mass along the nose over mass, where added mass is not known.
ADDED = 1.1


class Craft(NamedTuple):
    """A vehicle as the force model sees it; the parameters' 1-sigma and current values in the order of `PARAMETERS`."""

    polar: Polar
    propeller: Propeller
    inertia: float  # kg, mass along the nose, added mass included
    density: float  # kg/m3, at which the polar holds
    expansion: float  # 1/K
    centre: np.ndarray  # (c,): values before the mission
    std: np.ndarray  # (c,): 1-sigma before the mission
    value: np.ndarray  # (c,): values now
    propeller_std: PropellerError = PropellerError(0.0, 0.0, 0.0)
    disk: Disk = NO_DISK  # thrust where it is known by power
    disk_std: Disk = NO_DISK  # its 1-sigma


class Adjusted(NamedTuple):
    """The craft with adjusted values, what is left open of all parameters together, and the account of it."""

    craft: Craft
    noise: Noise
    columns: np.ndarray  # (c, k): square root of the parameters' covariance
    report: dict[str, Any]


def from_vehicle(vehicle: Vehicle, mission: Mission, body: Hull) -> Craft:
    """Return the vehicle as the force model sees it before the mission.

    Parameters
    ----------
    vehicle
        Coefficients with 1-sigma; what it does not know is taken as zero and known, but for the water that a fairing
        carries along, which is open by `CARRIED_STD` where the vehicle file says nothing of it.
    mission
        1-sigma of the bias of pitch.
    body
        Mass, and 1-sigma of net buoyancy.
    """
    fairing = fairing_of(vehicle)
    stated = "carried_water" in vehicle.coefficients and math.isfinite(vehicle.std("carried_water"))
    std = {
        "pitch": math.radians(mission.pitch.std_deg),
        "lift_at_zero": vehicle.std("lift_at_zero"),
        "net_buoyancy": body.std,
        "compressibility": vehicle.std("compressibility"),
        "thermal_expansion": vehicle.std("thermal_expansion"),
        "thrust": _thrust_std(vehicle),
        "hull_time": HULL_TIME_STD,
        "carried_water": fairing.share_std if stated else CARRIED_STD,
        "flushing_time": fairing.time_std / fairing.time,
    }
    std |= {name: vehicle.std(name) / vehicle[name] for name in ("parasite_drag", "lift_slope", "induced_drag")}
    known = np.nan_to_num(np.array([std[name] for name in PARAMETERS]))
    centre = np.zeros(len(PARAMETERS))
    centre[HULL_TIME] = HULL_TIME_BEFORE
    centre[CARRIED] = fairing.share
    centre[FLUSHING] = math.log(fairing.time / FLUSHING_BEFORE)
    forward = vehicle["mass_forward"]
    return Craft(
        vehicle.polar,
        propeller_of(vehicle),
        forward if math.isfinite(forward) else ADDED * body.mass,
        vehicle["reference_density"],
        float(np.nan_to_num(vehicle["thermal_expansion"])),
        centre,
        known,
        centre.copy(),
        vehicle.propeller_error if vehicle.propeller else PropellerError(0.0, 0.0, 0.0),
        vehicle.disk or NO_DISK,
        Disk(vehicle.std("propeller_diameter"), vehicle.std("propulsive_efficiency")) if vehicle.disk else NO_DISK,
    )


def thrust_std(craft: Craft, forces: Sequence[Forcing], speeds: Sequence[np.ndarray]) -> float:
    """Return the relative 1-sigma of thrust where the propeller turns.

    By the propeller's speed it is that of K_1 and K_2 at the median advance ratio; by power, T goes with η and D to
    powers that change from 2/3 at rest to 1 and 0 at high speed.

    Parameters
    ----------
    craft
        Thrust law and 1-sigma of its coefficients.
    forces, speeds
        Inputs, and V [m/s] at the same instants, of each stretch.
    """
    speed = np.concatenate(speeds)
    power = np.concatenate([force.propeller_power for force in forces])
    if (power > 0.0).any():
        typical = (float(np.median(value[power > 0.0])) for value in (power, speed))
        return float(disk_thrust_std(craft.disk, craft.disk_std, craft.density, *typical))
    rotation = np.concatenate([force.propeller_speed for force in forces])
    turning = np.abs(rotation) > 0.0
    if not turning.any() or not craft.propeller_std.static + craft.propeller_std.slope > 0.0:
        return float(craft.std[THRUST])
    ratio = float(np.median(speed[turning] / np.abs(rotation[turning])))  # J D_0
    return float(law_thrust_std(craft.propeller, craft.propeller_std, 1.0, ratio))


def _thrust_std(vehicle: Vehicle) -> float:
    """Return the relative 1-sigma of thrust at rest; 0 for a vehicle without a thrust law."""
    if vehicle.propeller is not None:
        return vehicle.std("thrust_static") / vehicle["thrust_static"]
    if vehicle.disk is None:
        return 0.0
    return (
        math.hypot(*(vehicle.std(name) / vehicle[name] for name in ("propeller_diameter", "propulsive_efficiency")))
        / 1.5
    )

"""Inputs of steady flight: broadcast, checked, and laid out flat for the compiled solvers."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.model.forces import propeller_of
from pipeline.vehicle import KNOWN, POSITIVE, Polar, Vehicle

Array = NDArray[np.float64]

#: Larger ones are refused: degrees for radians, rpm for rev/s.
MAX_ANGLE_OF_ATTACK = 0.5
MAX_PROPELLER_SPEED = 100.0
ATTACK_EXPECTED = f"at most {MAX_ANGLE_OF_ATTACK:.4g} rad; degrees?"
SPEED_EXPECTED = f"at most {MAX_PROPELLER_SPEED:g} rev/s; rev/s, not rpm?"

NO_THRUST_LAW = "powered, but the vehicle file has no thrust law"


@dataclass(frozen=True)
class Case:
    """Inputs broadcast to one shape and laid out flat: thrust as a + b V, density as a ratio."""

    shape: tuple[int, ...]
    net_buoyancy: Array
    held: Array
    push: Array
    pull: Array
    ratio: Array
    density: Array
    propeller_speed: Array
    propeller_power: Array
    no_thrust_law: NDArray[np.bool_]

    def repeated(self, count: int) -> Case:
        """Return every case `count` times in a row, along a new last axis."""
        arrays = (getattr(self, field.name) for field in fields(self)[1:])
        return Case((*self.shape, count), *(np.repeat(array, count) for array in arrays))

    @property
    def size(self) -> int:
        """Number of cases n."""
        return self.held.size

    @classmethod
    def of(
        cls,
        vehicle: Vehicle,
        net_buoyancy: ArrayLike,
        held: ArrayLike,
        thrust: ArrayLike | None,
        propeller_speed: ArrayLike | None,
        propeller_power: ArrayLike | None,
        density: ArrayLike | None,
    ) -> Case:
        """Return the inputs of `steady_state` and its kin as one case each.

        Raises
        ------
        ValueError
            If both thrust and speed or power of the propeller are given, a density is not positive, a power is
            negative, or a speed looks like rpm.
        """
        for name, driving in (("propeller_speed", propeller_speed), ("propeller_power", propeller_power)):
            if thrust is not None and driving is not None:
                raise ValueError(f"found both thrust and {name}; give one of them")
        reference = vehicle["reference_density"]
        arrays = np.broadcast_arrays(
            np.asarray(net_buoyancy, dtype=np.float64),
            np.asarray(held, dtype=np.float64),
            np.asarray(0.0 if thrust is None else thrust, dtype=np.float64),
            np.asarray(0.0 if propeller_speed is None else propeller_speed, dtype=np.float64),
            np.asarray(0.0 if propeller_power is None else propeller_power, dtype=np.float64),
            np.asarray(reference if density is None else density, dtype=np.float64),
        )
        shape = arrays[0].shape
        buoyancy, angle, given, turning, power, actual = (np.array(array, dtype=np.float64).ravel() for array in arrays)
        refuse("density", actual, actual <= 0.0, "a positive number of kg/m3")
        refuse("propeller_speed", turning, np.abs(turning) > MAX_PROPELLER_SPEED, SPEED_EXPECTED)
        refuse("propeller_power", power, power < 0.0, "0 W or more")
        law = propeller_of(vehicle)
        flow = actual * law.diameter**3 * turning
        push = np.where(turning == 0.0, given, flow * law.thrust_static * law.diameter * turning)
        missing = (turning != 0.0) & (vehicle.propeller is None) | (power != 0.0) & (vehicle.disk is None)
        pull, ratio = flow * law.thrust_slope, actual / reference
        return cls(shape, buoyancy, angle, push, pull, ratio, actual, turning, power, missing)

    def reason(self, unusable: str, held: str) -> NDArray[Any]:
        """Return why a case cannot be computed at all, "" where it can, shape (n,)."""
        reason = np.full(self.size, "", dtype=object)
        idle = (self.push == 0.0) & (self.propeller_power == 0.0)
        reason[(self.net_buoyancy == 0.0) & idle] = "no equilibrium: neither net buoyancy nor thrust"
        reason[self.no_thrust_law] = NO_THRUST_LAW
        for name, values in (
            ("density", self.density),
            ("propeller_speed or thrust", self.push),
            ("propeller_power", self.propeller_power),
            (held, self.held),
            ("net_buoyancy", self.net_buoyancy),
        ):
            reason[~np.isfinite(values)] = f"no {name} given"
        if unusable:
            reason[:] = unusable
        return reason


def driven(
    vehicle: Vehicle, powered: NDArray[np.bool_], propeller_speed: Array, propeller_power: Array
) -> tuple[Array, Array]:
    """Return speed [rev/s] and power [W] of the propeller that thrust follows from: both 0 where it does not turn.

    By speed where that is known and the vehicle has a law for it, or else by power, if that is known: then the speed
    is 0, and otherwise the power. Both NaN where thrust does not follow from what is known.

    Parameters
    ----------
    vehicle
        Gives the laws.
    powered
        Whether the propeller turns, shape (n,).
    propeller_speed, propeller_power
        As logged, shape (n,), NaN where they are not.
    """
    by_speed = np.isfinite(propeller_speed) & (vehicle.propeller is not None)
    by_power = ~by_speed & np.isfinite(propeller_power) & (vehicle.disk is not None)
    speed = np.where(by_speed, propeller_speed, np.where(by_power, 0.0, np.nan))
    power = np.where(by_power, propeller_power, np.where(by_speed, 0.0, np.nan))
    return np.where(powered, speed, 0.0), np.where(powered, power, 0.0)


def plain(vehicle: Vehicle) -> Polar:
    """Return the polar as floats, so that the compiled kernels see one type."""
    return Polar(*(float(value) for value in vehicle.polar))


def unusable(vehicle: Vehicle, names: tuple[str, ...]) -> str:
    """Return why the coefficients `names` of `vehicle` will not do, and its propeller; "" where they do."""
    unknown = [name for name in names if math.isnan(vehicle[name])]
    if unknown:
        return f"the vehicle file leaves {', '.join(unknown)} unknown"
    for name in (*names, "propeller_diameter"):
        if name in POSITIVE and vehicle[name] <= 0.0:
            return f"{name} is {vehicle[name]:g} {KNOWN[name].unit}; expected a positive number"
    return ""


def refuse(name: str, values: Array, wrong: NDArray[np.bool_], expected: str) -> None:
    """Raise ValueError for the first of `values` that is `wrong`, saying what is `expected`."""
    if wrong.any():
        raise ValueError(f"{name}: found {values[wrong][0]:g}; expected {expected}")

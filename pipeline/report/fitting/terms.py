"""What is compared with the theory: depth rates, speeds by a sensor or by GPS, and the balance of moments.

Everything that tells of the corrections is a `Constraint`: residuals, each divided by its 1-sigma or whitened, and
their slopes in the corrections. To add one, as the closure of GPS displacements, write a frozen dataclass with the
five members of the protocol and hand it to `regression.Problem` (or to `fit.fit` by `given.Given`)::

    @dataclass(frozen=True)
    class Closure:
        legs: Legs                      # whatever it needs, of the dives it is for
        name: str = "GPS closure"
        tells_speed: bool = True        # whether lift may be freed thanks to it

        @property
        def dives(self): ...            # dive of each residual, shape (m,); -1 belongs to no dive in particular

        def of(self, points): ...       # the same for the dives of `points` alone

        def residual(self, flight): ... # (measured − theory)/1-sigma, shape (m,)

        def jacobian(self, flight): ... # slopes of `residual` in flight.x, shape (m, k)

`flight` is the theory at the blocks with the corrections made; where others are needed,
``flight.model.at(points).fly(flight.x)`` is the theory there, with its slopes. A nuisance that the constraint alone
has (as a current that is unknown) is best projected out of its residuals and slopes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.model.forces import GRAVITY
from pipeline.report.covariance import Whitener, water, with_measurement
from pipeline.report.fitting.model import Flight, Model
from pipeline.report.fitting.points import Array, Points
from pipeline.vehicle import Vehicle

#: Least 1-sigma of a mean depth rate, m/s: the resolution of a pressure sensor over a block.
FLOOR = 1e-4
#: 1-sigma of a mean depth rate of which none is known, m/s.
UNKNOWN = 0.01
#: 1-sigma, rad, of what the moment balance says of the pitch at least: no theory of moments is better.
PITCH_FLOOR = math.radians(0.5)


class Constraint(Protocol):
    """Whitened residuals that tell of the corrections, and their slopes; see the module."""

    @property
    def name(self) -> str:
        """What it is, for a reader."""

    @property
    def tells_speed(self) -> bool:
        """Whether it tells of speed apart from depth rate."""

    @property
    def dives(self) -> NDArray[np.int64]:
        """Dive of each residual, shape (m,); -1 for one that belongs to none in particular."""

    def of(self, points: Points) -> Constraint:
        """Return the same constraint for the dives of `points` alone."""

    def residual(self, flight: Flight) -> Array:
        """Return measured less theory over 1-sigma, shape (m,)."""

    def jacobian(self, flight: Flight) -> Array:
        """Return the slopes of `residual` in the corrections, shape (m, k)."""


@dataclass(frozen=True)
class DepthRates:
    """Depth rates of all blocks, whitened by their covariance: measurement, and water that neighbours share."""

    points: Points
    sigma: float  # m/s, of the vertical velocity of the water
    tau: float  # s, its correlation time
    whiten: Whitener
    std: Array  # (n,) m/s, 1-sigma of each by itself
    name: str = "depth rates"
    tells_speed: bool = False

    @classmethod
    def made(cls, points: Points, sigma: float, tau: float) -> DepthRates:
        """Return the depth rates of `points` in water of this strength, m/s, and correlation time, s."""
        measurement = np.maximum(np.nan_to_num(points.depth_rate_std, nan=UNKNOWN), FLOOR)
        noise = with_measurement(water(points.start, points.end, sigma, tau), measurement)
        return cls(points, sigma, tau, noise.whitener(), np.sqrt(noise.band[0]))

    @property
    def dives(self) -> NDArray[np.int64]:
        """Dive of each block."""
        return self.points.dive

    def of(self, points: Points) -> DepthRates:
        """Return the depth rates of other blocks in the same water."""
        return DepthRates.made(points, self.sigma, self.tau)

    def widened(self, factor: float) -> DepthRates:
        """Return the same depth rates in water that moves `factor` times as much."""
        return DepthRates.made(self.points, self.sigma * factor, self.tau)

    def residual(self, flight: Flight) -> Array:
        """Return the whitened differences, shape (n,)."""
        return self.whiten(self.points.depth_rate - flight.depth_rate)

    def jacobian(self, flight: Flight) -> Array:
        """Return their slopes, shape (n, k)."""
        return -self.whiten(flight.depth_rate_by)


@dataclass(frozen=True)
class SensorSpeeds:
    """Speeds through water by a sensor, where a block has one."""

    points: Points
    name: str = "speeds by a sensor"
    tells_speed: bool = True

    @property
    def rows(self) -> NDArray[np.int64]:
        """Blocks that have one."""
        known = np.isfinite(self.points.sensor_speed) & (self.points.sensor_speed_std > 0.0)
        return np.flatnonzero(known)

    @property
    def dives(self) -> NDArray[np.int64]:
        """Dive of each speed."""
        return self.points.dive[self.rows]

    def of(self, points: Points) -> SensorSpeeds:
        """Return those of other blocks."""
        return SensorSpeeds(points)

    def residual(self, flight: Flight) -> Array:
        """Return the differences over their 1-sigma, shape (m,)."""
        rows = self.rows
        return (self.points.sensor_speed[rows] - flight.speed[rows]) / self.points.sensor_speed_std[rows]

    def jacobian(self, flight: Flight) -> Array:
        """Return their slopes, shape (m, k)."""
        rows = self.rows
        return -flight.speed_by[rows] / self.points.sensor_speed_std[rows, None]


@dataclass(frozen=True)
class LevelSpeed:
    """Speed of level powered flight by GPS fixes at the ends of submerged legs: one number for all such blocks."""

    points: Points
    speed: float  # m/s
    std: float
    name: str = "speed of level flight by GPS"
    tells_speed: bool = True

    @property
    def rows(self) -> NDArray[np.int64]:
        """Blocks of level powered flight."""
        return np.flatnonzero((self.points.direction == 0) & self.points.powered)

    @property
    def dives(self) -> NDArray[np.int64]:
        """No dive in particular, shape (1,), or (0,) without level flight."""
        return np.full(min(self.rows.size, 1), -1, dtype=np.int64)

    def of(self, points: Points) -> LevelSpeed:
        """Return the same for other blocks."""
        return LevelSpeed(points, self.speed, self.std)

    def residual(self, flight: Flight) -> Array:
        """Return the difference of the means over its 1-sigma, shape (1,)."""
        rows = self.rows
        if not rows.size:
            return np.zeros(0)
        return np.array([(self.speed - flight.speed[rows].mean()) / self.std])

    def jacobian(self, flight: Flight) -> Array:
        """Return its slopes, shape (1, k)."""
        rows = self.rows
        if not rows.size:
            return np.zeros((0, flight.x.size))
        return np.asarray(-flight.speed_by[rows].mean(axis=0, keepdims=True) / self.std)


@dataclass(frozen=True)
class Moments:
    """Balance of pitching moments at the measured pitch and battery position: (7) of Niu et al. (2017), at rest.

    r (K_M0 + K_M α) V² + (m_3 − m_1) V² sin α cos α − m̄ g (r_P1 − r_P0) cos θ + M_s sin θ = 0; what is left of it is
    divided by what an error of the pitch of `std` leaves before any correction.
    """

    points: Points
    std: float  # rad, 1-sigma of the pitch that the balance is held to
    scale: Array  # (m,) N m
    name: str = "moment balance with the battery as logged"
    tells_speed: bool = False

    @classmethod
    def made(cls, model: Model, std: float = PITCH_FLOOR) -> Moments:
        """Return the balance at the points of `model`, its scale taken from the theory without corrections."""
        plain = cls(model.points, std, np.ones(model.points.size))
        free = Model(model.vehicle, model.points, ("pitch",))
        slope = plain._slopes(free.fly(np.zeros(1)))[:, 0]
        return Moments(model.points, std, np.abs(slope) * std)

    @property
    def rows(self) -> NDArray[np.int64]:
        """Blocks with a battery position and a scale."""
        return np.flatnonzero(np.isfinite(self.points.battery_position) & (self.scale > 0.0))

    @property
    def dives(self) -> NDArray[np.int64]:
        """Dive of each."""
        return self.points.dive[self.rows]

    def of(self, points: Points) -> Moments:
        """Return the balance at some of these points."""
        inside = np.isin(self.points.block, points.block)
        return Moments(points, self.std, self.scale[inside])

    def residual(self, flight: Flight) -> Array:
        """Return what is left of the balance over its 1-sigma, shape (m,)."""
        rows = self.rows
        return -self._left(flight)[rows] / self.scale[rows]

    def jacobian(self, flight: Flight) -> Array:
        """Return its slopes, shape (m, k)."""
        rows = self.rows
        return -self._slopes(flight)[rows] / self.scale[rows, None]

    def _left(self, flight: Flight) -> Array:
        """Return the moment left, N m, nose up, shape (n,)."""
        vehicle, v, a = flight.model.vehicle, flight.speed, flight.angle_of_attack
        ratio = self.points.density / vehicle["reference_density"]
        flow = flight.model.value("moment_at_zero", flight.x) + flight.model.value("moment_slope", flight.x) * a
        munk = _munk(vehicle) * np.sin(a) * np.cos(a)
        return np.asarray(
            (ratio * flow + munk) * v**2
            - vehicle["battery_mass"] * GRAVITY * self._offset(flight) * np.cos(flight.pitch)
            + flight.model.value("righting_moment", flight.x) * np.sin(flight.pitch)
        )

    def _offset(self, flight: Flight) -> Array:
        return self.points.battery_position - flight.model.value("battery_neutral_position", flight.x)

    def _slopes(self, flight: Flight) -> Array:
        """Return the slopes of the moment left, shape (n, k)."""
        vehicle, model, v, a = flight.model.vehicle, flight.model, flight.speed, flight.angle_of_attack
        ratio = self.points.density / vehicle["reference_density"]
        slope = model.value("moment_slope", flight.x)
        flow = model.value("moment_at_zero", flight.x) + slope * a
        munk = _munk(vehicle)
        weight = vehicle["battery_mass"] * GRAVITY
        by_speed = 2.0 * v * (ratio * flow + munk * np.sin(a) * np.cos(a))
        by_attack = (ratio * slope + munk * np.cos(2.0 * a)) * v**2
        by_pitch = weight * self._offset(flight) * np.sin(flight.pitch) + model.value(
            "righting_moment", flight.x
        ) * np.cos(flight.pitch)
        pitch_by = flight.path_by + flight.attack_by
        out = by_speed[:, None] * flight.speed_by + by_attack[:, None] * flight.attack_by + by_pitch[:, None] * pitch_by
        direct = {
            "moment_at_zero": ratio * v**2,
            "moment_slope": ratio * a * v**2,
            "righting_moment": np.sin(flight.pitch),
            "battery_neutral_position": weight * np.cos(flight.pitch),
        }
        for column, name in enumerate(model.names):
            if name in direct:
                out[:, column] += direct[name]
        return np.asarray(out)


def _munk(vehicle: Vehicle) -> float:
    """Return m_3 − m_1, kg; 0 where added mass is not known."""
    difference = vehicle["mass_normal"] - vehicle["mass_forward"]
    return difference if math.isfinite(difference) else 0.0

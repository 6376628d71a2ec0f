"""The theory as a function of its corrections, with analytic slopes by the implicit function theorem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pipeline.model.forces import disk_of, propeller_of
from pipeline.model.tangent import BASICS, fly
from pipeline.report.fitting.parameters import MOMENT, WATER, Correction, correction
from pipeline.report.fitting.points import Array, Points
from pipeline.vehicle import Vehicle

PITCH, FORCE = BASICS.index("pitch"), BASICS.index("net_buoyancy")


@dataclass(frozen=True)
class Flight:
    """The theory at `points` with the corrections `x` made: n points, k corrections.

    Attributes
    ----------
    model, x
        Where it comes from; shape (k,).
    speed, angle_of_attack, path_angle, pitch
        V [m/s], α, γ, θ [rad], shape (n,); NaN where there is no steady flight.
    water
        Vertical velocity of the water that is a correction, m/s, up, shape (n,).
    speed_by, attack_by, path_by, water_by
        Slopes in x, shape (n, k).
    """

    model: Model
    x: Array
    speed: Array
    angle_of_attack: Array
    path_angle: Array
    pitch: Array
    water: Array
    speed_by: Array
    attack_by: Array
    path_by: Array
    water_by: Array

    @cached_property
    def depth_rate(self) -> Array:
        """Rate of depth, m/s, positive sinking, shape (n,): −V sin γ − w_w."""
        return -self.speed * np.sin(self.path_angle) - self.water

    @cached_property
    def depth_rate_by(self) -> Array:
        """Slopes of `depth_rate`, shape (n, k)."""
        sine, cosine = np.sin(self.path_angle)[:, None], np.cos(self.path_angle)[:, None]
        return -self.speed_by * sine - self.speed[:, None] * cosine * self.path_by - self.water_by

    @cached_property
    def horizontal_speed(self) -> Array:
        """V cos γ, m/s, shape (n,)."""
        return self.speed * np.cos(self.path_angle)

    @cached_property
    def horizontal_speed_by(self) -> Array:
        """Slopes of `horizontal_speed`, shape (n, k)."""
        sine, cosine = np.sin(self.path_angle)[:, None], np.cos(self.path_angle)[:, None]
        return self.speed_by * cosine - self.speed[:, None] * sine * self.path_by


@dataclass(frozen=True)
class Model:
    """The theory at some points as a function of the corrections `names`, which order the vector x.

    `extra` are corrections of the caller's own, found before those of `parameters.CORRECTIONS`.
    """

    vehicle: Vehicle
    points: Points
    names: tuple[str, ...]
    extra: Mapping[str, Correction] = field(default_factory=dict)

    def at(self, points: Points) -> Model:
        """Return the same theory at other points."""
        return replace(self, points=points)

    def correction(self, name: str) -> Correction:
        """Return the correction `name`."""
        return self.extra[name] if name in self.extra else correction(name)

    def value(self, name: str, x: Array) -> float:
        """Return coefficient `name` of the vehicle with the corrections `x` made."""
        return self.vehicle[name] + (float(x[self.names.index(name)]) if name in self.names else 0.0)

    @cached_property
    def _weights(self) -> list[tuple[str, Array]]:
        items = [self.correction(name) for name in self.names]
        return [(item.changes, np.asarray(item.weight(self.points), dtype=np.float64)) for item in items]

    @cached_property
    def _before(self) -> Array:
        basics = np.empty((self.points.size, len(BASICS)))
        for column, name in enumerate(BASICS):
            basics[:, column] = 1.0 if name == "thrust" else self.vehicle[name] if name not in NOT_COEFFICIENTS else 0.0
        basics[:, FORCE], basics[:, PITCH] = self.points.net_buoyancy, self.points.pitch
        return basics

    def fly(self, x: NDArray[np.float64]) -> Flight:
        """Return steady flight with the measured pitch held and the corrections `x`, shape (k,), made."""
        points, n, k = self.points, self.points.size, len(self.names)
        basics, water, water_by = self._before.copy(), np.zeros(n), np.zeros((n, k))
        for j, (changes, weight) in enumerate(self._weights):
            if changes == WATER:
                water += x[j] * weight
                water_by[:, j] = weight
            elif changes != MOMENT:
                basics[:, BASICS.index(changes)] += x[j] * weight
        ratio = points.density / self.vehicle["reference_density"]
        exponent = float(self.vehicle["drag_exponent"])
        speed, attack, by_speed, by_attack = fly(
            basics, exponent, propeller_of(self.vehicle), disk_of(self.vehicle), ratio, points.density,
            points.propeller_speed, points.propeller_power,
        )  # fmt: skip
        speed_by, attack_by, pitch_by = np.zeros((n, k)), np.zeros((n, k)), np.zeros((n, k))
        for j, (changes, weight) in enumerate(self._weights):
            if changes in BASICS:
                column = BASICS.index(changes)
                speed_by[:, j], attack_by[:, j] = by_speed[:, column] * weight, by_attack[:, column] * weight
                if column == PITCH:
                    pitch_by[:, j] = weight
        pitch = basics[:, PITCH]
        path = np.where(np.isfinite(speed), pitch - attack, np.nan)
        return Flight(
            self, np.asarray(x, dtype=np.float64), speed, attack, path, pitch, water,
            speed_by, attack_by, pitch_by - attack_by, water_by,
        )  # fmt: skip


#: Of `BASICS`, those that come with the points and not with the vehicle.
NOT_COEFFICIENTS = ("thrust", "net_buoyancy", "pitch")

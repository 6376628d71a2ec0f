"""The regression behind the fit: block means, the theory as a function of its corrections, and their solution.

Residuals are whitened by the covariance of the block means; the Jacobian is analytic, by the implicit function
theorem at each block's trim. Unknowns that are borrowed rather than fitted are held by their prior 1-sigma.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.model.sensitivity import sensitivities
from pipeline.model.steady import trim_at_pitch
from pipeline.records import seconds
from pipeline.report.compare import density_of, floats
from pipeline.report.covariance import Whitener, water, water_of, with_measurement
from pipeline.vehicle import Vehicle

Array = NDArray[np.float64]

#: Least 1-sigma of a mean depth rate, m/s: the resolution of a pressure sensor over a block.
FLOOR = 1e-4
#: Corrections that are added to a coefficient of the vehicle.
COEFFICIENTS = ("parasite_drag", "lift_at_zero", "lift_slope", "induced_drag")


@dataclass(frozen=True)
class Quantity:
    """A correction: symbol, unit and what it means to a reader."""

    symbol: str
    unit: str
    meaning: str


CORRECTIONS = {
    "parasite_drag": Quantity("ΔK_D0", "kg/m", "drag at zero angle of attack, as of sensors on the hull"),
    "net_buoyancy": Quantity("ΔG", "N", "constant part of net buoyancy, ballast"),
    "lift_at_zero": Quantity("ΔK_L0", "kg/m", "lift at zero angle of attack"),
    "lift_slope": Quantity("ΔK_L", "kg/m/rad", "lift per angle of attack"),
    "induced_drag": Quantity("ΔK_D", "kg/m/rad2", "drag per squared angle of attack"),
    "thrust_scale": Quantity("Δscale_T", "1", "thrust, relative"),
    "pitch": Quantity("Δθ", "rad", "pitch bias"),
}


@dataclass(frozen=True)
class Data:
    """What is fitted: depth rates of blocks, speeds by a sensor, and a speed by GPS.

    Attributes
    ----------
    blocks
        Blocks that enter, in time order, n rows.
    whiten
        Applies the inverse square root of the depth rates' covariance.
    std
        1-sigma of each depth rate, measurement and moving water, m/s, shape (n,).
    sensor
        Rows of `blocks` whose sensor speed is fitted too, shape (m,).
    level
        Rows whose mean speed is compared with `gps`, shape (l,); empty without GPS legs.
    gps
        Speed of level powered flight and its 1-sigma, m/s.
    """

    blocks: pd.DataFrame
    whiten: Whitener
    std: Array
    sensor: NDArray[np.int64]
    level: NDArray[np.int64]
    gps: tuple[float, float]

    @property
    def size(self) -> int:
        """Number of fitted values."""
        return len(self.blocks) + self.sensor.size + (1 if self.level.size else 0)


@dataclass(frozen=True)
class Model:
    """The theory as a function of its corrections; `names` orders the vector x."""

    vehicle: Vehicle
    names: tuple[str, ...]

    def changed(self, x: Array) -> tuple[Vehicle, float, float]:
        """Return the vehicle with the corrections `x` made, and those of net buoyancy [N] and pitch [rad]."""
        given = dict(zip(self.names, x, strict=True))
        values = {name: self.vehicle[name] + given[name] for name in COEFFICIENTS if name in given}
        if "thrust_scale" in given:
            factor = 1.0 + given["thrust_scale"]
            values |= {name: self.vehicle[name] * factor for name in ("thrust_static", "thrust_slope")}
        vehicle = self.vehicle.with_values(values, "fit") if values else self.vehicle
        return vehicle, given.get("net_buoyancy", 0.0), given.get("pitch", 0.0)

    def predict(self, blocks: pd.DataFrame, x: Array) -> tuple[Array, Array]:
        """Return speed and depth rate with the measured pitch held, m/s, each of shape (n,)."""
        vehicle, buoyancy, bias = self.changed(x)
        trim = trim_at_pitch(
            vehicle,
            floats(blocks, "net_buoyancy") + buoyancy,
            floats(blocks, "pitch") + bias,
            propeller_speed=np.nan_to_num(floats(blocks, "propeller_speed")),
            density=density_of(blocks, vehicle),
        )
        return trim.speed, -trim.speed * np.sin(trim.path_angle)

    def slopes(self, blocks: pd.DataFrame, x: Array) -> tuple[Array, Array]:
        """Return the derivatives of speed and depth rate in x, each of shape (n, len(names)), analytic."""
        vehicle, buoyancy, bias = self.changed(x)
        force, pitch = floats(blocks, "net_buoyancy") + buoyancy, floats(blocks, "pitch") + bias
        inputs: dict[str, Any] = {
            "propeller_speed": np.nan_to_num(floats(blocks, "propeller_speed")),
            "density": density_of(blocks, vehicle),
        }
        trim = trim_at_pitch(vehicle, force, pitch, **inputs)
        speed, path = trim.speed, trim.path_angle
        slope = sensitivities("pitch", vehicle, force, speed, path, trim.angle_of_attack, **inputs)
        given = dict(zip(self.names, x, strict=True))
        by_speed, by_rate = np.zeros((len(blocks), x.size)), np.zeros((len(blocks), x.size))
        for column, name in enumerate(self.names):
            d_speed, d_path = slope[name].speed, slope[name].path_angle
            # The theory's scale is relative to the corrected propeller, ours to the one in the vehicle file.
            factor = 1.0 / (1.0 + given[name]) if name == "thrust_scale" else 1.0
            by_speed[:, column] = factor * d_speed
            by_rate[:, column] = -factor * (d_speed * np.sin(path) + speed * np.cos(path) * d_path)
        return by_speed, by_rate


@dataclass(frozen=True)
class Solution:
    """Values and covariance of all unknowns, and the χ² of the data alone."""

    x: Array
    covariance: Array
    chi_square: float
    converged: bool


def assemble(
    blocks: pd.DataFrame,
    settings: Mapping[str, Any] | None,
    use_sensor: bool,
    gps: tuple[float, float] | None,
) -> Data:
    """Return the fitted values of `blocks` (in time order) with their covariance."""
    sigma, tau = water_of(settings)
    measurement = np.maximum(np.nan_to_num(floats(blocks, "depth_rate_std"), nan=0.01), FLOOR)
    noise = with_measurement(water(seconds(blocks["start"]), seconds(blocks["end"]), sigma, tau), measurement)
    held = np.isfinite(floats(blocks, "sensor_speed")) & (floats(blocks, "sensor_speed_std") > 0)
    level = (blocks["direction"].to_numpy() == 0) & blocks["powered"].to_numpy(dtype=bool)
    known = gps is not None and all(math.isfinite(number) for number in gps) and gps[1] > 0
    none = np.zeros(0, dtype=np.int64)
    return Data(
        blocks,
        noise.whitener(),
        np.sqrt(noise.band[0]),
        np.flatnonzero(held) if use_sensor else none,
        np.flatnonzero(level) if known else none,
        gps if gps is not None and known else (math.nan, math.nan),
    )


def residuals(data: Data, model: Model, x: Array) -> Array:
    """Return measured less predicted, whitened, shape (data.size,)."""
    speed, rate = model.predict(data.blocks, x)
    parts = [data.whiten(floats(data.blocks, "depth_rate") - rate)]
    if data.sensor.size:
        measured, std = (floats(data.blocks, name)[data.sensor] for name in ("sensor_speed", "sensor_speed_std"))
        parts.append((measured - speed[data.sensor]) / std)
    if data.level.size:
        parts.append(np.array([(data.gps[0] - speed[data.level].mean()) / data.gps[1]]))
    return np.nan_to_num(np.concatenate(parts), nan=1e3)


def jacobian(data: Data, model: Model, x: Array) -> Array:
    """Return the derivatives of `residuals` in x, shape (data.size, len(x))."""
    by_speed, by_rate = model.slopes(data.blocks, x)
    parts = [-data.whiten(by_rate)]
    if data.sensor.size:
        std = floats(data.blocks, "sensor_speed_std")[data.sensor]
        parts.append(-by_speed[data.sensor] / std[:, np.newaxis])
    if data.level.size:
        parts.append(-by_speed[data.level].mean(axis=0, keepdims=True) / data.gps[1])
    return np.nan_to_num(np.concatenate(parts))


def condition_index(data: Data, model: Model, x: Array, free: int) -> float:
    """Return the condition index of the free columns of the Jacobian, each scaled to length one."""
    columns = jacobian(data, model, x)[:, :free]
    length = np.linalg.norm(columns, axis=0)
    if not np.all(length > 0):
        return math.inf
    values = np.linalg.svd(columns / length, compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 0 else math.inf


def solve(data: Data, model: Model, priors: Mapping[str, float], *, prior_on_free: bool, free: int) -> Solution | None:
    """Return the least-squares solution, or None where the normal matrix is singular.

    Borrowed corrections are always held by their prior, the `free` first ones only with `prior_on_free`.
    """
    from scipy.optimize import least_squares

    scale = np.array([priors[name] if priors[name] > 0 else 1.0 for name in model.names])
    held = np.array(
        [(i >= free or prior_on_free) and priors[name] > 0 for i, name in enumerate(model.names)], dtype=bool
    )
    pull = np.eye(len(model.names))[held]

    def function(y: Array) -> Array:
        return np.concatenate([residuals(data, model, y * scale), y[held]])

    def slope(y: Array) -> Array:
        return np.concatenate([jacobian(data, model, y * scale) * scale, pull])

    result = least_squares(function, np.zeros(scale.size), jac=slope, method="trf", x_scale="jac", max_nfev=60)
    normal = result.jac.T @ result.jac
    try:
        covariance = np.linalg.inv(normal)
    except np.linalg.LinAlgError:
        return None
    chi_square = float(np.sum(residuals(data, model, result.x * scale) ** 2))
    return Solution(
        result.x * scale,
        covariance * np.outer(scale, scale),
        chi_square,
        bool(result.success and np.all(np.isfinite(covariance)) and np.all(np.diag(covariance) > 0)),
    )

"""The regression behind the fit: block means with their covariance, and the solution for the corrections.

Residuals are whitened by the covariance of the block means; the Jacobian is analytic. Unknowns that are borrowed
rather than fitted are held by their prior 1-sigma.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.records import seconds
from pipeline.report.compare import floats
from pipeline.report.covariance import Whitener, water, water_of, with_measurement
from pipeline.report.fitting.model import Array, Model

#: Least 1-sigma of a mean depth rate, m/s: the resolution of a pressure sensor over a block.
FLOOR = 1e-4


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

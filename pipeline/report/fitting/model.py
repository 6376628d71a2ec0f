"""The theory as a function of its corrections, with analytic slopes by the implicit function theorem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.model.sensitivity import sensitivities
from pipeline.model.steady import trim_at_pitch
from pipeline.report.compare import density_of, floats
from pipeline.report.fitting.parameters import COEFFICIENTS
from pipeline.vehicle import Vehicle

Array = NDArray[np.float64]


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

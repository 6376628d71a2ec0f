"""What is given beside blocks and vehicle: the water, what a mission states of itself, what else may be compared."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from pipeline.report.covariance import water_of
from pipeline.report.fitting.parameters import prior_stds
from pipeline.report.fitting.points import Configuration, Points
from pipeline.report.fitting.terms import Constraint, DepthRates, LevelSpeed, SensorSpeeds
from pipeline.vehicle import Vehicle


@dataclass(frozen=True)
class Given:
    """What is given beside blocks and vehicle.

    Attributes
    ----------
    settings
        The estimator's ``sigma_w`` [m/s] and ``tau_w`` [s].
    ballast_std, pitch_std
        Prior 1-sigma of the constant part of net buoyancy, N, and of the pitch bias, rad.
    use_sensor
        Whether speeds by the sensor are fitted, rather than held out.
    gps
        Speed of level powered flight and its 1-sigma, m/s.
    configurations
        What the vehicle carried on which dives; the first is the one of reference.
    constraints
        What else tells of the corrections, see `terms.Constraint`.
    """

    settings: Mapping[str, Any] | None = None
    ballast_std: float = 0.3
    pitch_std: float = math.radians(0.3)
    use_sensor: bool = False
    gps: tuple[float, float] | None = None
    configurations: tuple[Configuration, ...] = ()
    constraints: tuple[Constraint, ...] = ()

    def points(self, blocks: pd.DataFrame, vehicle: Vehicle) -> Points:
        """Return the rows of `blocks`, table `records.BLOCKS`, in time order, each in its configuration."""
        return Points.of(blocks, vehicle, self.configurations)

    def terms(self, points: Points) -> tuple[Constraint, ...]:
        """Return what is compared: depth rates, speeds by sensor and GPS where there are any, further constraints."""
        terms: list[Constraint] = [DepthRates.made(points, *water_of(self.settings))]
        sensor = SensorSpeeds(points)
        if self.use_sensor and sensor.rows.size:
            terms.append(sensor)
        if self.gps is not None and all(math.isfinite(number) for number in self.gps) and self.gps[1] > 0.0:
            level = LevelSpeed(points, *self.gps)
            if level.rows.size:
                terms.append(level)
        return (*terms, *(constraint.of(points) for constraint in self.constraints))

    def priors(self, vehicle: Vehicle, points: Points) -> dict[str, float]:
        """Return the prior 1-sigma of every correction of the forces that `points` feel, see `prior_stds`."""
        return prior_stds(vehicle, points, self.ballast_std, self.pitch_std)


#: What is given where nothing is said.
DEFAULT = Given()

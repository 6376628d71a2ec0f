"""What hypotheses are put to: all that was measured, as a function of everything that is not known.

Beside the terms of the fit stands the battery's position: the one that holds the measured pitch against the pitching
moments, Eqs. (4) and (7) of Niu et al. (2017), doi:10.1007/s13344-017-0061-y,
r = r_P0 + [ρ/ρ_0 (K_M0 + K_M α) V² + (m_3 − m_1) V² sin α cos α + M_s sin θ] / (m̄ g cos θ).
Here every coefficient of it keeps its 1-sigma, and the position its own: an offset of a millimetre is looked for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.model.forces import GRAVITY
from pipeline.report.fitting.causes import DRAG, TURNING
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.model import Flight, Model
from pipeline.report.fitting.parameters import MOMENT, UNSTATED, WATER, Correction, of_configurations
from pipeline.report.fitting.points import Array, Points
from pipeline.report.fitting.regression import Problem
from pipeline.vehicle import KNOWN, Vehicle

#: Coefficients of the moment balance, besides those of the flight.
BALANCE = (
    "moment_at_zero",
    "moment_slope",
    "mass_normal",
    "mass_forward",
    "righting_moment",
    "battery_mass",
    "battery_neutral_position",
)
#: Least 1-sigma of a block's battery position, m: autopilots leave small errors of pitch alone.
POSITION_FLOOR = 0.0005
#: Always among the unknowns, however well they are known: causes change them.
ALWAYS = ("parasite_drag", "net_buoyancy", "pitch", "thrust_scale")


@dataclass(frozen=True)
class BatteryPositions:
    """Battery positions, where a block has one, against those that hold the pitch; a `terms.Constraint`."""

    points: Points
    name: str = "battery positions"
    tells_speed: bool = False

    @property
    def rows(self) -> NDArray[np.int64]:
        """Blocks that have one."""
        return np.flatnonzero(np.isfinite(self.points.battery_position))

    @property
    def dives(self) -> NDArray[np.int64]:
        """Dive of each position."""
        return self.points.dive[self.rows]

    @property
    def std(self) -> Array:
        """1-sigma of each position, m."""
        return np.maximum(np.nan_to_num(self.points.battery_position_std[self.rows]), POSITION_FLOOR)

    def of(self, points: Points) -> BatteryPositions:
        """Return those of other blocks."""
        return BatteryPositions(points)

    def residual(self, flight: Flight) -> Array:
        """Return the differences over their 1-sigma, shape (m,)."""
        held, _slope = self._held(flight)
        return (self.points.battery_position - held)[self.rows] / self.std

    def jacobian(self, flight: Flight) -> Array:
        """Return their slopes, shape (m, k)."""
        return -self._held(flight)[1][self.rows] / self.std[:, np.newaxis]

    def _held(self, flight: Flight) -> tuple[Array, Array]:
        """Return the positions that hold the pitch, m, shape (n,), and their slopes, shape (n, k)."""
        model, v, alpha, pitch = flight.model, flight.speed, flight.angle_of_attack, flight.pitch
        c = {name: model.value(name, flight.x) for name in BALANCE}
        ratio = self.points.density / model.vehicle["reference_density"]
        munk = c["mass_normal"] - c["mass_forward"]
        twist = np.sin(alpha) * np.cos(alpha)
        flow = ratio * (c["moment_at_zero"] + c["moment_slope"] * alpha) + munk * twist
        arm = c["battery_mass"] * GRAVITY * np.cos(pitch)
        moment = flow * v**2 + c["righting_moment"] * np.sin(pitch)
        by_speed = 2.0 * flow * v / arm
        by_attack = (ratio * c["moment_slope"] + munk * np.cos(2.0 * alpha)) * v**2 / arm
        by_pitch = (c["righting_moment"] * np.cos(pitch) + moment * np.tan(pitch)) / arm
        slope = by_speed[:, None] * flight.speed_by + by_attack[:, None] * flight.attack_by
        slope += by_pitch[:, None] * (flight.path_by + flight.attack_by)
        direct = {
            "moment_at_zero": ratio * v**2 / arm,
            "moment_slope": ratio * alpha * v**2 / arm,
            "mass_normal": twist * v**2 / arm,
            "mass_forward": -twist * v**2 / arm,
            "righting_moment": np.sin(pitch) / arm,
            "battery_mass": -moment / (arm * c["battery_mass"]),
            "battery_neutral_position": np.ones_like(v),
        }
        for column, name in enumerate(model.names):
            if name in direct:
                slope[:, column] += direct[name]
        return c["battery_neutral_position"] + moment / arm, slope


def observe(blocks: pd.DataFrame, vehicle: Vehicle, given: Given) -> Problem:
    """Return what is observed in `blocks` and all that is not known of it, nothing free.

    Parameters
    ----------
    blocks
        Steady blocks that theory can fly, as `fit.select` gives them.
    vehicle, given
        As for `fit.fit`; the drag of a configuration beside the first is an unknown of the size of `causes.DRAG`.
    """
    points = given.points(blocks, vehicle)
    terms, priors = given.terms(points), given.priors(vehicle, points)
    priors = {name: std for name, std in priors.items() if std > 0.0 or name in ALWAYS} | {WATER: 0.0}
    priors |= {name: 0.0 for name in UNSTATED if name in priors}
    priors |= dict.fromkeys(of_configurations(points), DRAG * vehicle["parasite_drag"])
    extra: dict[str, Correction] = {}
    if np.nanmax(np.abs(points.roll), initial=0.0) > 0.0:
        lift = vehicle["lift_slope"]
        lost = TURNING._replace(weight=lambda p: -lift * (1.0 - np.cos(np.nan_to_num(p.roll))))
        extra["turning"], priors["turning"] = lost, 0.0
    battery = BatteryPositions(points)
    if battery.rows.size and all(math.isfinite(vehicle[name]) for name in BALANCE):
        terms = (*terms, battery)
        priors |= {name: vehicle.std(name) for name in BALANCE}
        for name in ("mass_normal", "mass_forward", "battery_mass"):
            known = KNOWN[name]
            extra[name] = Correction(f"Δ{known.symbol}", known.unit, known.meaning, MOMENT, _none, 1.0)
    priors = {name: float(np.nan_to_num(std)) for name, std in priors.items()}
    return Problem(Model(vehicle, points, tuple(priors), extra), terms, priors, 0)


def _none(points: Points) -> Array:
    """Return the weight of what changes no force."""
    return np.zeros(points.size)

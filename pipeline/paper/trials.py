"""The two powered trials of Niu et al. (2017), Section 5, with the pitch that the vehicle held.

The paper's theory leaves the pitch free; the vehicle holds it with its battery. Source: doi:10.1007/s13344-017-0061-y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, fsolve

from pipeline.model.predict import free_angle_of_attack
from pipeline.model.steady import steady_state, trim_at_pitch
from pipeline.vehicle import Vehicle


@dataclass(frozen=True)
class Trial:
    """A powered trial as published: settings, means measured, and what the paper's theory says."""

    name: str
    net_buoyancy: float
    rpm: float
    pitch_deg: float
    speed: float
    theory_speed: float
    theory_pitch_deg: float
    theory_rpm: float


DANJIANGKOU = Trial("Danjiangkou, July 2014, level at 10 m", 2.5, 780.0, 3.5, 0.62, 0.7979, 76.91, 800.0)
SOUTH_CHINA_SEA = Trial(
    "South China Sea, February 2015, climbs from 500 m", 7.0, 1400.0, 43.5, 1.2, 1.3743, 76.14, 1400.0
)
TRIALS = (DANJIANGKOU, SOUTH_CHINA_SEA)


def held_speed(
    vehicle: Vehicle,
    trial: Trial,
    *,
    extra_drag: float = 0.0,
    thrust_scale: float = 1.0,
    rpm: float | None = None,
    net_buoyancy: float | None = None,
) -> float:
    """Return the speed of theory with the measured pitch held, m/s, after a correction.

    Parameters
    ----------
    vehicle
        Petrel-II.
    trial
        The trial whose settings hold.
    extra_drag, thrust_scale
        Added to K_D0, kg/m; factor on thrust.
    rpm, net_buoyancy
        Propeller speed, rev/min, and net buoyancy, N, instead of the trial's.
    """
    changes = {
        "parasite_drag": vehicle["parasite_drag"] + extra_drag,
        "thrust_static": vehicle["thrust_static"] * thrust_scale,
        "thrust_slope": vehicle["thrust_slope"] * thrust_scale,
    }
    state = trim_at_pitch(
        vehicle.with_values(changes, "a correction"),
        trial.net_buoyancy if net_buoyancy is None else net_buoyancy,
        math.radians(trial.pitch_deg),
        propeller_speed=(trial.rpm if rpm is None else rpm) / 60.0,
    )
    return float(state.speed)


def compared(vehicle: Vehicle, trial: Trial) -> dict[str, Any]:
    """Return measured and computed speed of a trial: theory of the paper, pitch free, pitch held, and what is left."""
    alpha, _ = free_angle_of_attack(vehicle)
    free = steady_state(vehicle, trial.net_buoyancy, alpha, propeller_speed=trial.rpm / 60.0)
    held = trim_at_pitch(vehicle, trial.net_buoyancy, math.radians(trial.pitch_deg), propeller_speed=trial.rpm / 60.0)
    gap = trial.theory_speed - trial.speed
    return {
        "name": trial.name,
        "net_buoyancy_N": trial.net_buoyancy,
        "propeller_speed_rpm": trial.rpm,
        "measured_speed_m_s": trial.speed,
        "measured_pitch_deg": trial.pitch_deg,
        "published_theory_speed_m_s": trial.theory_speed,
        "published_theory_pitch_deg": trial.theory_pitch_deg,
        "published_theory_rpm": trial.theory_rpm,
        "free_pitch_speed_m_s": float(free.speed),
        "free_pitch_deg": math.degrees(float(free.pitch)),
        "held_pitch_speed_m_s": float(held.speed),
        "held_pitch_path_angle_deg": math.degrees(float(held.path_angle)),
        "held_pitch_angle_of_attack_deg": math.degrees(float(held.angle_of_attack)),
        "held_pitch_at_published_rpm_m_s": held_speed(vehicle, trial, rpm=trial.theory_rpm),
        "required_moment_N_m": float(held.required_moment),
        "gap_closed_percent": 100.0 * (trial.theory_speed - float(held.speed)) / gap,
        "left_m_s": float(held.speed) - trial.speed,
    }


def remainder(vehicle: Vehicle) -> dict[str, Any]:
    """Return what would explain what is left of the second trial, one cause at a time, and two at once.

    Two averages fix two unknowns, but only just: the correlation of (ΔK_D0, thrust scale), for equal relative errors
    of the two speeds, is that of a pair which cannot be told apart.
    """
    trial = SOUTH_CHINA_SEA

    def root(name: str, low: float, high: float) -> float:
        return float(brentq(lambda x: held_speed(vehicle, trial, **{name: x}) - trial.speed, low, high, xtol=1e-10))

    drag = root("extra_drag", 0.0, 10.0)
    both = fsolve(lambda x: _misfits(vehicle, x), [drag, 1.0])
    return {
        "extra_parasite_drag_kg_m": drag,
        "extra_parasite_drag_percent": 100.0 * drag / vehicle["parasite_drag"],
        "thrust_scale": root("thrust_scale", 0.1, 1.0),
        "propeller_speed_rpm": root("rpm", 800.0, 1400.0),
        "net_buoyancy_N": root("net_buoyancy", 1.0, 7.0),
        "first_trial_with_that_drag_m_s": held_speed(vehicle, DANJIANGKOU, extra_drag=drag),
        "both_extra_parasite_drag_kg_m": float(both[0]),
        "both_thrust_scale": float(both[1]),
        "both_correlation": _correlation(vehicle, both),
    }


def _misfits(vehicle: Vehicle, x: Any) -> list[float]:
    """Return the relative misfits of both trials with x = (ΔK_D0, thrust scale)."""
    return [held_speed(vehicle, trial, extra_drag=x[0], thrust_scale=x[1]) / trial.speed - 1.0 for trial in TRIALS]


def _correlation(vehicle: Vehicle, x: Any) -> float:
    """Return the correlation of (ΔK_D0, thrust scale) at `x`, the two speeds having equal relative errors."""
    step = 1e-4
    columns = []
    for k in range(2):
        ahead, behind = np.array(x), np.array(x)
        ahead[k] += step
        behind[k] -= step
        columns.append(np.subtract(_misfits(vehicle, ahead), _misfits(vehicle, behind)) / (2.0 * step))
    slopes = np.column_stack(columns)
    covariance = np.linalg.inv(slopes.T @ slopes)
    return float(covariance[0, 1] / math.sqrt(covariance[0, 0] * covariance[1, 1]))

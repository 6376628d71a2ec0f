"""Noise levels of the estimators: those found in a mission, and those that hold for all."""

from __future__ import annotations

import math
from typing import NamedTuple


class Settings(NamedTuple):
    """Noise levels: those found in each mission, by `noise`, `gyro` or mission.yaml, and those that hold for all.

    The first group, to `turn_drift_manoeuvre`, and `unsteadiness` are found in the mission; what is written here is
    what they are where nothing tells. `speed_scale` is as mission.yaml says.
    """

    sigma_w: float = 0.01  # m/s, vertical water velocity
    tau_w: float = 300.0  # s, its correlation time
    depth_noise: float = 0.05  # m
    swell: float = 1e-5  # m2/s, random walk of depth: vertical motion too quick to last, such as waves
    pitch_noise: float = math.radians(0.2)  # rad
    pitch_drift: float = math.radians(0.05) ** 2  # rad2/s, random walk of θ in steady flight
    turn_drift: float = math.nan  # rad2/s, of θ less the integrated pitch rate in steady flight; NaN: no gyro is used
    turn_drift_manoeuvre: float = math.nan  # rad2/s, the same in manoeuvres

    gyro_bias: float = math.radians(0.5)  # rad/s, 1-sigma of the bias of a gyro
    gyro_bias_drift: float = math.radians(0.02) ** 2 / 3600.0  # rad2/s3, random walk of it
    current_drift: float = 7e-7  # m2/s3, random walk of the current
    unsteadiness: float = (
        0.5  # factor on the variances by which V departs from a steady glide, with density known or not
    )
    speed_drift: float = 1e-7  # m2/s3, random walk of V in steady flight in homogeneous water
    speed_drift_blind: float = 2e-5  # m2/s3, the same where density is not known
    speed_drift_manoeuvre: float = 3e-5  # m2/s3
    speed_turn: float = 0.05  # m2/s2, random walk of V in manoeuvres per radian of pitch
    speed_drift_gentle: float = 3e-4  # m2/s3, in manoeuvres under steady power
    speed_drift_surface: float = 1e-2  # m2/s3, at the surface: what V was there says nothing about the dive
    stratification: float = 0.04  # m3/kg, relative change of V per change of density that κ leaves, as a random walk
    pitch_share: float = 0.3  # 1-sigma of what V does when the pitch wanders over what a steady glide's would do
    response: float = 0.02  # m5/s2/kg, κ: loss of V²/2 per change of density met, g·volume·sin γ/2K_D0; its 1-sigma
    response_drift: float = 1e-6  # m10/s5/kg2, random walk of κ in manoeuvres
    least_speed: float = 0.1  # m/s, below which V no longer falls faster
    pitch_drift_manoeuvre: float = math.radians(1.0) ** 2  # rad2/s
    slip: float = math.radians(0.1)  # rad, 1-sigma of δ in steady unpowered flight
    slip_manoeuvre: float = math.radians(0.7)
    slip_manoeuvre_force: float = math.radians(0.3)  # rad, 1-sigma of what the lift balance leaves of α in manoeuvres
    settling: float = 0.5  # s in which α settles: what a turning vehicle's α is off the lift balance, over pitch rate
    slip_time: float = 15.0  # s
    slip_time_manoeuvre: float = 10.0
    slip_time_powered: float = 3600.0  # net buoyancy and thrust last, and with them what they do to α
    speed_scale: float = 0.005  # 1-sigma of the scale error of a speed sensor that is used
    fix_noise: float = 5.0  # m
    position_drift: float = 0.05  # m2/s, dead reckoning below the surface
    surface_drift: float = 4.0  # m2/s, at the surface
    heave_drift: float = 0.2  # m2/s, depth in manoeuvres and at the surface
    cruise_drift: float = 3e-8  # m2/s3, random walk of the speed of powered level flight
    continuity: float = 0.02  # m/s, 1-sigma by which V just before and after differs from it
    force_drift: float = 1e-6  # m2/s3, what the force model leaves of V' in steady flight
    force_drift_manoeuvre: float = 7e-5  # m2/s3
    load: float = 0.1  # N, 1-sigma of the slow error of net buoyancy: hull and water not of one temperature, air
    load_time: float = 600.0  # s
    heave_drift_force: float = 0.01  # m2/s, depth in manoeuvres, in the force model
    initial_speed: float = 0.5  # m/s, 1-sigma
    initial_current: float = 0.3  # m/s, 1-sigma


class Noise(NamedTuple):
    """Noise levels of a mission, and the same moved by 1-sigma along each axis of what is open of them."""

    settings: Settings
    moved: tuple[Settings, ...] = ()

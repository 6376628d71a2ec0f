"""The kinematic model, linear along a trajectory: from arrays and settings to a state-space problem."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.estimate.series import Series
from pipeline.estimate.smoother import Problem
from pipeline.model.closure import glide_angle
from pipeline.vehicle import Polar

#: States, in order; the last five only where there are fixes and a heading. CRUISE is the speed of powered level
#: flight: at one propeller setting it is the same from one stretch to the next.
SPEED, PITCH, DEPTH, WATER, SLIP, EAST, NORTH, CURRENT_EAST, CURRENT_NORTH, CRUISE = range(10)
#: Kinds of measurement, in order; the last three only where there are fixes and a heading. The last ties V to CRUISE
#: where a cruise begins and ends.
MEASURED = ("depth", "pitch", "speed", "east", "north", "continuity")


#: 1-sigma of α under power as a share of the glide's α at the same pitch. With thrust T ≥ 0 less lift is needed than
#: in the glide, so that |α| lies between zero and the glide's; near level, net buoyancy of either sign can be carried.
SPAN = 0.6


#: Over a pause in the records (s) longer than this nothing is carried: the states are as open as after it, and the
#: position anywhere (m). Their covariance would outgrow double precision.
LONGEST, ANYWHERE = 21_600.0, 1e5


@dataclass(frozen=True)
class Settings:
    """Noise levels; the first group is estimated from the mission, the second is general."""

    sigma_w: float = 0.01  # m/s, vertical water velocity
    depth_noise: float = 0.05  # m
    swell: float = 1e-5  # m2/s, random walk of depth: vertical motion too quick to last, such as waves
    pitch_noise: float = math.radians(0.2)  # rad
    pitch_drift: float = math.radians(0.05) ** 2  # rad2/s, random walk of θ in steady flight

    tau_w: float = 300.0  # s, correlation time of vertical water velocity
    current_drift: float = 7e-7  # m2/s3, random walk of the current
    speed_drift: float = 3e-7  # m2/s3, random walk of V in steady flight in homogeneous water
    speed_drift_blind: float = 2e-5  # m2/s3, the same where density is not known
    speed_drift_manoeuvre: float = 3e-3  # m2/s3
    speed_drift_gentle: float = 2e-5  # m2/s3, manoeuvres under steady power
    speed_drift_surface: float = 1e-2  # m2/s3, at the surface: what V was there says nothing about the dive
    stratification: float = 0.2  # m3/kg, relative change of V per change of density: g·volume/2G for G of 1 to 5 N
    pitch_drift_manoeuvre: float = math.radians(1.0) ** 2  # rad2/s
    slip: float = math.radians(0.1)  # rad, 1-sigma of δ in steady unpowered flight
    slip_manoeuvre: float = math.radians(1.0)
    slip_time: float = 15.0  # s
    slip_time_manoeuvre: float = 10.0
    slip_time_powered: float = 3600.0  # net buoyancy and thrust last, and with them what they do to α
    fix_noise: float = 5.0  # m
    position_drift: float = 0.05  # m2/s, dead reckoning below the surface
    surface_drift: float = 4.0  # m2/s, at the surface
    heave_drift: float = 0.2  # m2/s, depth in manoeuvres and at the surface
    cruise_drift: float = 3e-8  # m2/s3, random walk of the speed of powered level flight
    continuity: float = 0.02  # m/s, 1-sigma by which V just before and after differs from it
    initial_speed: float = 0.5  # m/s, 1-sigma
    initial_current: float = 0.3  # m/s, 1-sigma


class Trajectory(NamedTuple):
    """Where the model is linearised: V, θ and δ, each of shape (m,)."""

    speed: np.ndarray
    pitch: np.ndarray
    slip: np.ndarray


@njit(cache=True)
def _integrated(sigma: float, tau: float, dt: float) -> tuple[float, float, float, float]:
    """Return decay, mean weight and noise (variance, covariance, variance of integral) of a Gauss–Markov process."""
    phi = math.exp(-dt / tau)
    weight = tau * (1.0 - phi)
    variance = sigma * sigma * (1.0 - phi * phi)
    covariance = sigma * sigma * tau * (1.0 - phi) ** 2
    integral = sigma * sigma * tau * max(2.0 * dt - tau * (3.0 - 4.0 * phi + phi * phi), 0.0)
    return weight, variance, covariance, integral


@njit(cache=True)
def _fill(
    polar: Polar,
    time: np.ndarray,
    heading: np.ndarray,
    stratification: np.ndarray,
    powered: np.ndarray,
    manoeuvre: np.ndarray,
    gentle: np.ndarray,
    surfaced: np.ndarray,
    cruising: np.ndarray,
    new_setting: np.ndarray,
    speed: np.ndarray,
    pitch: np.ndarray,
    slip: np.ndarray,
    drifts: tuple[float, float, float, float, float, float, float, float, float],
    water: tuple[float, float],
    slips: tuple[float, float, float, float, float],
    positions: tuple[float, float, float, float],
    cruise: tuple[float, float],
    transition: np.ndarray,
    shift: np.ndarray,
    process: np.ndarray,
) -> None:
    """Fill transition, shift and process noise along the trajectory; the arrays come in as zeros."""
    m, n = shift.shape
    for k in range(m - 1):
        pause = time[k + 1] - time[k]
        dt = min(max(pause, 1e-3), LONGEST)
        glide, by_pitch, by_speed, steady = glide_angle(polar, speed[k], pitch[k])
        share = 0.0 if powered[k] else 1.0  # under power the closure says only how far α may be from zero
        gamma = pitch[k] - share * glide - slip[k]
        sine, cosine = math.sin(gamma), math.cos(gamma)
        turn_v, turn_t = -share * by_speed, 1.0 - share * by_pitch  # ∂γ/∂V, ∂γ/∂θ; ∂γ/∂δ = −1
        v = speed[k]
        # rate of depth and its slopes
        rate = -v * sine
        z_v, z_t, z_s = -sine - v * cosine * turn_v, -v * cosine * turn_t, v * cosine
        quick = manoeuvre[k]
        if surfaced[k]:
            q_v = drifts[8]
        elif quick:
            q_v = drifts[7] if gentle[k] else drifts[1]
        elif math.isnan(stratification[k]):
            q_v = drifts[5]
        else:
            # a change of 1 kg/m3 moves V by about drifts[6] V, in either direction
            q_v = drifts[0] + (drifts[6] * v) ** 2 * stratification[k]
        q_t = drifts[3] if quick else drifts[2]
        sigma_s, tau_s = (slips[1], slips[3]) if quick else (slips[0], slips[2])
        if powered[k]:
            sigma_s = max(sigma_s, SPAN * abs(glide))
            if gentle[k]:
                tau_s = slips[4]
        if not steady:
            sigma_s = max(sigma_s, slips[1])
        w_weight, w_var, w_cov, w_int = _integrated(water[0], water[1], dt)
        s_weight, s_var, s_cov, s_int = _integrated(sigma_s, tau_s, dt)
        F, c, Q = transition[k], shift[k], process[k]
        for i in range(n):
            F[i, i] = 1.0
        F[3, 3] = math.exp(-dt / water[1])
        F[4, 4] = math.exp(-dt / tau_s)
        source = CRUISE if n > CRUISE and cruising[k] else SPEED  # the state that is V at this instant
        F[2, source], F[2, 1], F[2, 3], F[2, 4] = z_v * dt, z_t * dt, -w_weight, z_s * s_weight
        c[2] = dt * (rate - z_v * v - z_t * pitch[k]) - z_s * s_weight * slip[k]
        Q[0, 0] = q_v * dt
        Q[1, 1] = q_t * dt
        Q[3, 3], Q[4, 4] = w_var, s_var
        if source == SPEED:
            Q[2, 0] = Q[0, 2] = z_v * q_v * dt * dt / 2.0
        Q[2, 1] = Q[1, 2] = z_t * q_t * dt * dt / 2.0
        Q[2, 3] = Q[3, 2] = -w_cov
        Q[2, 4] = Q[4, 2] = z_s * s_cov
        Q[2, 2] = (z_v**2 * q_v + z_t**2 * q_t) * dt**3 / 3.0 + w_int + z_s**2 * s_int + positions[3] * dt
        if surfaced[k] or quick:
            Q[2, 2] += positions[2] * dt  # sinking nose up, rising nose down, waves: not the polar's flight
        if n > 5:
            sin_h, cos_h = math.sin(heading[k]), math.cos(heading[k])
            x_v = cosine - v * sine * turn_v
            x_t, x_s = -v * sine * turn_t, v * sine
            forward = v * cosine - x_v * v - x_t * pitch[k] - x_s * slip[k]
            for row, along in ((5, sin_h), (6, cos_h)):
                F[row, source], F[row, 1], F[row, 4] = along * x_v * dt, along * x_t * dt, along * x_s * dt
                F[row, row + 2] = dt
                c[row] = along * forward * dt
                Q[row, row] = (positions[1] if surfaced[k] else positions[0]) * dt
                if pause > LONGEST:
                    Q[row, row] += ANYWHERE**2
                Q[row + 2, row + 2] = drifts[4] * dt
        if n > CRUISE:
            Q[CRUISE, CRUISE] = cruise[0] * dt + (cruise[1] ** 2 if new_setting[k] else 0.0)
            if cruising[k]:  # meanwhile the other speed is at large: it is tied to this one where the cruise ends
                Q[0, 0] = drifts[1] * dt


def linearise(
    series: Series,
    polar: Polar,
    settings: Settings,
    at: Trajectory,
    *,
    use_speed: bool,
    use_fixes: bool,
    pitch_shift: float = 0.0,
) -> Problem:
    """Return the state-space problem of the kinematic model, linear along the trajectory `at`.

    Parameters
    ----------
    series
        Measurements and flags, m instants.
    polar
        Lift and drag coefficients; only their ratios matter.
    settings
        Noise levels.
    at
        Trajectory of V, θ, δ.
    use_speed, use_fixes
        Whether the speed sensor and the fixes are measurements.
    pitch_shift
        Added to every measured pitch, rad.

    Returns
    -------
    Problem
        With 5 states, or 10 if `use_fixes`.
    """
    m = series.time.size
    n = 10 if use_fixes else 5
    transition, shift, process = np.zeros((m, n, n)), np.zeros((m, n)), np.zeros((m, n, n))
    s = settings
    _fill(
        polar,
        series.time,
        series.heading,
        series.stratification,
        series.powered,
        series.manoeuvre,
        series.gentle,
        series.surfaced,
        series.cruising,
        series.new_setting,
        at.speed,
        at.pitch,
        at.slip,
        (
            s.speed_drift,
            s.speed_drift_manoeuvre,
            s.pitch_drift,
            s.pitch_drift_manoeuvre,
            s.current_drift,
            s.speed_drift_blind,
            s.stratification,
            s.speed_drift_gentle,
            s.speed_drift_surface,
        ),
        (s.sigma_w, s.tau_w),
        (s.slip, s.slip_manoeuvre, s.slip_time, s.slip_time_manoeuvre, s.slip_time_powered),
        (s.position_drift, s.surface_drift, s.heave_drift, s.swell),
        (s.cruise_drift, s.initial_speed),
        transition,
        shift,
        process,
    )
    kinds = len(MEASURED) if use_fixes else 3
    observed, variance, design = np.full((m, kinds), np.nan), np.ones((m, kinds)), np.zeros((kinds, n))
    for j, state in enumerate((DEPTH, PITCH, SPEED, EAST, NORTH, SPEED)[:kinds]):
        design[j, state] = 1.0
    observed[:, 0], variance[:, 0] = series.depth, s.depth_noise**2
    observed[:, 1], variance[:, 1] = series.pitch + pitch_shift, s.pitch_noise**2
    if use_speed:
        observed[:, 2], variance[:, 2] = series.speed, np.maximum(series.speed_std, 1e-3) ** 2
    if use_fixes:
        observed[:, 3], observed[:, 4] = series.east, series.north
        variance[:, 3:5] = s.fix_noise**2
        design[5, CRUISE] = -1.0
        bounds = np.diff(series.cruising, append=False) | np.diff(series.cruising, prepend=False)
        observed[bounds & series.cruising, 5], variance[:, 5] = 0.0, s.continuity**2
    first = np.flatnonzero(np.isfinite(series.depth))
    mean = np.zeros(n)
    mean[SPEED], mean[PITCH] = at.speed[0], at.pitch[0]
    mean[DEPTH] = series.depth[first[0]] if first.size else 0.0
    if use_fixes:
        mean[CRUISE] = float(np.median(at.speed))
    flight = [s.initial_speed, 0.2, 5.0, s.sigma_w, s.slip_manoeuvre]
    spread = np.array([*flight, 1e3, 1e3, s.initial_current, s.initial_current, s.initial_speed])
    return Problem(mean, np.diag(spread[:n] ** 2), transition, shift, process, design, observed, variance)

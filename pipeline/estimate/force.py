"""The force model, linear along a trajectory: speed from net buoyancy, thrust and drag, alpha from the lift balance.

State V, θ, z, w_w and a slow error of net buoyancy. Along the path m_1 V' = T cos α − D + G sin γ; normal to the body
L cos α + D sin α + G cos θ = m_1 V q cos α, so that α is slaved to pitch, speed and pitch rate q (Niu et al. 2017,
Eqs. 1 to 8, doi:10.1007/s13344-017-0061-y; the fast mode that settles α lasts less than a second). Speed is carried
over a step by the exponential of its own decay, which is stable whatever the step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.estimate.craft import BIAS, CARRIED, EXPANSION, FLUSHING, HULL_TIME, Craft
from pipeline.estimate.forcing import Forcing, with_carried_water, with_thermal_lag
from pipeline.estimate.linearise import ANY_DEPTH, LONGEST, depth_at_start, integrated, measured, pitching
from pipeline.estimate.problem import Problem
from pipeline.estimate.sensors import around, scale_of, with_rate, with_scale
from pipeline.estimate.series import PAUSE, Series, increasing
from pipeline.estimate.settings import Settings
from pipeline.model.exchange import FLUSHING_BEFORE
from pipeline.model.forces import disk_thrust, thrust
from pipeline.vehicle import Disk, Polar, Propeller

#: States, in order.
SPEED, PITCH, DEPTH, WATER, LOAD = range(5)
#: Bounds of the path: V [m/s], θ [rad], q [rad/s].
LEAST, MOST, STEEPEST, TURNING = 0.02, 4.0, 1.5, 0.2
#: Below this speed (m/s) the lift balance is not asked for α, and α is at most this (rad): beyond, flow is separated.
SLOW, STALLED = 0.08, 0.30
#: A step of Newton's for α below this (rad) leaves nothing to go, and the slopes are those at its end.
CLOSE = 1e-8
#: Time, s, over which an unrecorded motion of the engine is taken to last.
UNKNOWN = 60.0
#: At the surface V falls to nothing within this time (s).
STOPPING = 10.0


class Path(NamedTuple):
    """Where the force model is linearised: V [m/s], θ [rad], q [rad/s], shape (m,); scale error of a speed sensor."""

    speed: np.ndarray
    pitch: np.ndarray
    pitch_rate: np.ndarray
    scale: float = 0.0


class Bends(NamedTuple):
    """How depth follows V and θ along a path, and how long V remembers; each of shape (m,)."""

    by_speed: np.ndarray  # ∂z'/∂V
    by_pitch: np.ndarray  # ∂z'/∂θ, m/s
    memory: np.ndarray  # s; NaN where what V was says nothing about what comes after
    pushed: np.ndarray  # m/s, 1-sigma of V by not knowing when the propeller's setting changed


class Along(NamedTuple):
    """A path, and the model linear along it but for its noise; m instants."""

    at: Path
    rows: np.ndarray  # (m, 2, 5): of F, for V and depth; what w_w adds to depth is left out
    shift: np.ndarray  # (m, 2, 1 + c)
    bends: Bends
    observed_by: np.ndarray  # (3, c)
    bias: float  # rad, of pitch
    doubt: np.ndarray  # (m,): N, of net buoyancy while the engine moves and nobody knows when
    alphas: np.ndarray  # (m, 3 + c): α, its slopes in V and θ, and its change with each considered column


@njit(cache=True, nogil=True)
def _thrust(propeller: Propeller, disk: Disk, push: float, force: Forcing, k: int, speed: float) -> tuple[float, float]:
    """Return the thrust at record k times `push`, N, and its slope in speed, N s/m."""
    if force.propeller_power[k] > 0.0:
        by_power, by_power_v = disk_thrust(disk, force.density[k], force.propeller_power[k], speed)
        return push * by_power, push * by_power_v
    turning = force.propeller_speed[k]
    if turning == 0.0:
        return 0.0, 0.0
    slope = propeller.thrust_slope * force.density[k] * propeller.diameter**3 * turning
    return push * thrust(propeller, force.density[k], turning, speed), push * slope


@njit(cache=True, nogil=True)
def _attack(
    polar: Polar, ratio: float, inertia: float, force: float, v: float, cos_t: float, sin_t: float, q: float
) -> tuple[float, float, float, float]:
    """Return α of the lift balance and its slopes in V, θ and per newton of normal force; 0 slopes where stalled."""
    speed = max(v, SLOW)
    square = ratio * speed * speed
    drag_0 = polar.parasite_drag * speed**polar.drag_exponent if polar.drag_exponent != 0.0 else polar.parasite_drag
    normal = force * cos_t - inertia * speed * q
    alpha = -(normal + square * polar.lift_at_zero) / (square * (polar.lift_slope + drag_0))
    slope = 1.0
    for _ in range(4):
        alpha = min(max(alpha, -STALLED), STALLED)
        cos_a, sin_a = math.cos(alpha), math.sin(alpha)
        lift = square * (polar.lift_at_zero + polar.lift_slope * alpha)
        drag = square * (drag_0 + polar.induced_drag * alpha * alpha)
        value = (lift - inertia * speed * q) * cos_a + drag * sin_a + force * cos_t
        slope = (
            square * (polar.lift_slope * cos_a + 2.0 * polar.induced_drag * alpha * sin_a)
            - (lift - inertia * speed * q) * sin_a
            + drag * cos_a
        )
        step = value / slope
        alpha -= step
        if abs(step) < CLOSE:
            break
    if abs(alpha) >= STALLED or v < SLOW:
        return min(max(alpha, -STALLED), STALLED), 0.0, 0.0, 0.0
    drag_by_v = (2.0 * drag + polar.drag_exponent * square * drag_0) / speed
    by_v = (2.0 * lift / speed - inertia * q) * cos_a + drag_by_v * sin_a
    return alpha, -by_v / slope, force * sin_t / slope, -1.0 / slope


@njit(cache=True, nogil=True)
def _follow(
    polar: Polar,
    propeller: Propeller,
    disk: Disk,
    inertia: float,
    density_0: float,
    values: np.ndarray,
    columns: np.ndarray,
    time: np.ndarray,
    afloat: np.ndarray,
    leaping: np.ndarray,
    force: Forcing,
    at: Path,
    rows: np.ndarray,
    shift: np.ndarray,
    bends: Bends,
    alphas: np.ndarray,
) -> None:
    """Fill F, shift, `Bends` and α with its slopes (V, θ, every column of changes of the parameters) along the path."""
    m = len(rows)
    c = columns.shape[1]
    drag_by, lift_by, induced_by = values[1], values[2], values[3]
    polar = Polar(
        polar.lift_at_zero + values[4],
        polar.lift_slope * (1.0 + lift_by),
        polar.parasite_drag * (1.0 + drag_by),
        polar.induced_drag * (1.0 + induced_by),
        polar.drag_exponent,
    )
    push = 1.0 + values[8]
    rate_by, alpha_by = np.zeros(c), np.zeros(c)
    for k in range(m):
        last = k == m - 1
        pause = 1.0 if last else time[k + 1] - time[k]
        dt = min(max(pause, 1e-3), LONGEST)
        j = k if last else k + 1
        v, pitch = at.speed[k], 0.5 * (at.pitch[k] + at.pitch[j])
        buoyancy = 0.5 * (force.net_buoyancy[k] + force.net_buoyancy[j]) + values[5]
        buoyancy += values[6] * force.by_compression[k] + values[7] * force.by_expansion[k]
        buoyancy += values[10] * force.by_carried[k]
        ratio = force.density[k] / density_0
        q = at.pitch_rate[k]
        cos_t, sin_t = math.cos(pitch), math.sin(pitch)
        alpha, a_v, a_t, a_n = _attack(polar, ratio, inertia, buoyancy, v, cos_t, sin_t, q)
        here = max(v, SLOW)
        cos_a, sin_a = math.cos(alpha), math.sin(alpha)
        sine, cosine = sin_t * cos_a - cos_t * sin_a, cos_t * cos_a + sin_t * sin_a  # of γ = θ − α
        square = ratio * here * here
        parasite = polar.parasite_drag
        if polar.drag_exponent != 0.0:
            parasite *= here**polar.drag_exponent
        drag = square * (parasite + polar.induced_drag * alpha * alpha)
        pushing, pushing_v = _thrust(propeller, disk, push, force, k, here)
        if force.switching[k] > 0.0:
            jump = _thrust(propeller, disk, push, force, j, here)[0] - pushing
            bends.pushed[k] = abs(jump) / inertia * force.switching[k] / math.sqrt(12.0)
        rate = (pushing * cos_a - drag + buoyancy * sine) / inertia
        # V' and γ in α, then in V and θ with α slaved
        rate_a = (-pushing * sin_a - 2.0 * square * polar.induced_drag * alpha - buoyancy * cosine) / inertia
        rate_v = (pushing_v * cos_a - (2.0 * drag + square * parasite * polar.drag_exponent) / here) / inertia
        rate_v = min(rate_v + rate_a * a_v, -1e-3)
        rate_t = buoyancy * cosine / inertia + rate_a * a_t
        # the considered, per 1-sigma: direct, and through α by the change of normal force
        if c > 0:
            lifting = square * polar.lift_slope * alpha * cos_a
            direct = (
                0.0,
                -square * parasite / (1.0 + drag_by),
                0.0,
                -square * polar.induced_drag / (1.0 + induced_by) * alpha * alpha,
                0.0,
                sine,
                force.by_compression[k] * sine,
                force.by_expansion[k] * sine,
                pushing * cos_a / push if push != 0.0 else 0.0,
                force.by_time[k] * sine,
                force.by_carried[k] * sine,
                force.by_flushing[k] * sine,
            )
            normal = (
                0.0,
                square * parasite / (1.0 + drag_by) * sin_a,
                lifting / (1.0 + lift_by),
                square * polar.induced_drag / (1.0 + induced_by) * alpha * alpha * sin_a,
                square * cos_a,
                cos_t,
                force.by_compression[k] * cos_t,
                force.by_expansion[k] * cos_t,
                0.0,
                force.by_time[k] * cos_t,
                force.by_carried[k] * cos_t,
                force.by_flushing[k] * cos_t,
            )
            alpha_by[:], rate_by[:] = 0.0, 0.0
            for i in range(len(normal)):
                through = a_n * normal[i]
                straight = direct[i] / inertia + rate_a * through
                for q in range(c):
                    alpha_by[q] += through * columns[i, q]
                    rate_by[q] += straight * columns[i, q]
        alphas[k, 0], alphas[k, 1], alphas[k, 2] = alpha, a_v, a_t
        for i in range(c):
            alphas[k, 3 + i] = alpha_by[i]
        if last:
            break
        F, b = rows[k], shift[k]
        tau = -1.0 / rate_v
        phi_v = math.exp(-dt / tau)
        reach = tau * (1.0 - phi_v)  # ∫ of the decay over the step
        farther = tau * (dt - reach)  # and of that
        F[1, DEPTH] = 1.0
        if afloat[k] or pause > PAUSE or leaping[k] or v + rate * reach < 0.0:
            # afloat, unrecorded, leaping, or pushed to a stop: what V was here says nothing about what comes after
            F[0, SPEED], bends.memory[k] = math.exp(-dt / STOPPING), math.nan
            continue
        z_v = -sine + v * cosine * a_v
        z_t = -v * cosine * (1.0 - a_t)
        bends.by_speed[k], bends.by_pitch[k], bends.memory[k] = z_v, z_t, tau
        F[0, SPEED], F[0, PITCH] = phi_v, rate_t * reach
        b[0, 0] = v * (1.0 - phi_v) + rate * reach - rate_t * reach * at.pitch[k]
        F[1, SPEED], F[1, PITCH] = z_v * reach, z_t * dt + z_v * rate_t * farther
        b[1, 0] = -v * sine * dt + z_v * rate * farther - z_v * reach * v - F[1, PITCH] * at.pitch[k]
        load_a = a_n * cos_t
        load_v = sine / inertia + rate_a * load_a
        F[0, LOAD], F[1, LOAD] = load_v * reach, v * cosine * load_a * dt + z_v * load_v * farther
        for i in range(c):
            b[0, 1 + i] = rate_by[i] * reach
            b[1, 1 + i] = v * cosine * alpha_by[i] * dt + z_v * rate_by[i] * farther


@njit(cache=True, nogil=True)
def _fill(
    time: np.ndarray,
    manoeuvre: np.ndarray,
    leaping: np.ndarray,
    drift: np.ndarray,
    doubt: np.ndarray,
    bends: Bends,
    s: Settings,
    decay: np.ndarray,
    rows: np.ndarray,
    noise: np.ndarray,
    cross: np.ndarray,
) -> None:
    """Fill the diagonal of F, how depth follows w_w, and Q."""
    dt_0, phi_w, phi_load = -1.0, 1.0, 1.0
    for k in range(len(decay) - 1):
        pause = time[k + 1] - time[k]
        dt = min(max(pause, 1e-3), LONGEST)
        d, w, x, quick = decay[k], noise[k], cross[k], manoeuvre[k]
        if dt != dt_0:
            phi_w, phi_load, dt_0 = math.exp(-dt / s.tau_w), math.exp(-dt / s.load_time), dt
        w_weight, w_var, w_cov, w_int = integrated(s.sigma_w, s.tau_w, dt, phi_w)
        d[:] = 1.0
        d[WATER], rows[k, 1, WATER] = phi_w, -w_weight
        if doubt[k] > 0.0:  # the engine moved, nobody knows when
            d[LOAD] = math.exp(-dt / UNKNOWN)
            w[LOAD] = doubt[k] ** 2 * (1.0 - d[LOAD] ** 2)
        elif k > 0 and doubt[k - 1] > 0.0:
            d[LOAD], w[LOAD] = 0.0, s.load**2
        else:
            d[LOAD], w[LOAD] = phi_load, s.load**2 * (1.0 - phi_load**2)
        tau, z_v, z_t, q_t = bends.memory[k], bends.by_speed[k], bends.by_pitch[k], drift[k]
        w[PITCH], w[WATER], x[WATER] = q_t * dt, w_var, -w_cov
        if math.isnan(tau):
            _, w[SPEED], _, _ = integrated(s.initial_speed, STOPPING, dt, math.exp(-dt / STOPPING))
            w[DEPTH] = w_int + s.heave_drift * dt
            if pause > PAUSE:
                w[DEPTH] += (s.initial_speed * dt) ** 2
            if leaping[k]:
                w[DEPTH] += ANY_DEPTH**2
            continue
        unrest = math.sqrt(0.5 * tau * (s.force_drift_manoeuvre if quick else s.force_drift))
        _, w[SPEED], v_cov, v_int = integrated(unrest, tau, dt, rows[k, 0, SPEED])
        w[SPEED] += bends.pushed[k] ** 2
        w[DEPTH] = z_v**2 * v_int + z_t**2 * q_t * dt**3 / 3.0 + w_int + s.swell * dt
        x[SPEED], x[PITCH] = z_v * v_cov, z_t * q_t * dt * dt / 2.0
        if quick:
            w[DEPTH] += s.heave_drift_force * dt


def follow(series: Series, force: Forcing, craft: Craft, at: Path, columns: np.ndarray | None = None) -> Along:
    """Return the force model linear along a path, but for its noise.

    Parameters
    ----------
    series
        Measurements and flags, m instants.
    force
        Inputs, the hull as warm as the water.
    craft
        Coefficients with the present values of the parameters.
    at
        Path of V, θ, q.
    columns
        Changes of the parameters that are considered, in the parameters' own units, shape (c, k); their present
        1-sigma each if left out.
    """
    m = series.time.size
    columns = np.diag(craft.std) if columns is None else np.ascontiguousarray(columns)
    c = columns.shape[1]
    force = with_thermal_lag(force, series.time, craft.expansion, craft.value[HULL_TIME], change=craft.value[EXPANSION])
    force = with_carried_water(
        force, series.time, craft.value[CARRIED], FLUSHING_BEFORE * math.exp(craft.value[FLUSHING])
    )
    rows, shift, alphas = np.zeros((m, 2, LOAD + 1)), np.zeros((m, 2, 1 + c)), np.zeros((m, 3 + c))
    bends, observed_by = Bends(*np.zeros((4, m))), np.zeros((3, c))
    _follow(
        craft.polar,
        craft.propeller,
        craft.disk,
        craft.inertia,
        craft.density,
        craft.value,
        columns,
        series.time,
        series.afloat | series.standing,
        series.leaping,
        force,
        at,
        rows,
        shift,
        bends,
        alphas,
    )
    observed_by[1] = columns[BIAS]
    return Along(at, rows, shift, bends, observed_by, float(craft.value[BIAS]), force.doubt, alphas)


def linearise(series: Series, along: Along, settings: Settings, *, speed: bool) -> Problem:
    """Return the state-space problem of the force model, linear along a path.

    Parameters
    ----------
    series
        Measurements and flags, m instants.
    along
        The path, as from `follow`.
    settings
        Noise levels.
    speed
        Whether the speed sensor is a measurement.
    """
    m, n, p, s, at = series.time.size, LOAD + 1, 3, settings, along.at
    decay, noise, cross, rows = np.zeros((m, n)), np.zeros((m, n)), np.zeros((m, n)), along.rows.copy()
    moving, turning = pitching(series, s)
    _fill(
        series.time,
        series.manoeuvre,
        series.leaping,
        moving.drift,
        along.doubt,
        along.bends,
        s,
        decay,
        rows,
        noise,
        cross,
    )
    observed, variance = measured(series, s, p, speed=speed)
    observed[:, 1] += along.bias
    seen, weight = np.zeros((p, 2), dtype=np.int64), np.zeros((p, 2))
    seen[:, 0], weight[:, 0] = (DEPTH, PITCH, SPEED), 1.0
    problem = Problem(
        np.array([at.speed[0], at.pitch[0], depth_at_start(series), 0.0, 0.0]),
        np.diag([s.initial_speed, 0.2, 5.0, s.sigma_w, s.load]) ** 2,
        decay,
        np.array([SPEED, DEPTH]),
        rows,
        along.shift,
        noise,
        cross,
        DEPTH,
        seen,
        weight,
        observed,
        along.observed_by,
        variance,
    )
    problem = with_rate(problem, series.time, PITCH, moving.turn, turning, (s.gyro_bias, s.gyro_bias_drift))
    if not speed:
        return problem
    return with_scale(problem, series.time, np.maximum(at.speed, LEAST), at.scale, s.speed_scale, (2,))


def path(series: Series, speed: np.ndarray, pitch: np.ndarray, scale: float = 0.0) -> Path:
    """Return the path through V and θ, shape (m,) each, with the pitch rate that they have."""
    if series.time.size < 2:
        return Path(speed, pitch, np.zeros_like(pitch), scale)
    rate = np.gradient(pitch, increasing(series.time))
    turning = np.clip(rate, -TURNING, TURNING)
    return Path(np.clip(speed, LEAST, MOST), np.clip(pitch, -STEEPEST, STEEPEST), turning, scale)


def smoothed(series: Series, mean: np.ndarray, at: Path, *, scaled: bool) -> Path:
    """Return the path through smoothed states, shape (m, n), linear along `at`, the last a sensor's if `scaled`."""
    scale = 0.0
    if scaled:
        scale = around(scale_of(mean[:, -1], np.maximum(at.speed, LEAST), at.scale), np.isfinite(series.speed))
    return path(series, mean[:, SPEED], mean[:, PITCH], scale)

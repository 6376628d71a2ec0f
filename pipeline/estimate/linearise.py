"""The kinematic model, linear along a trajectory: from arrays and settings to a state-space problem."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.estimate.lag import LENGTH as LENGTHS
from pipeline.estimate.problem import Problem
from pipeline.estimate.sensors import with_rate, with_scale
from pipeline.estimate.series import Series
from pipeline.estimate.settings import Settings
from pipeline.model.closure import Best, best_glides, glide_near, parasite
from pipeline.vehicle import Polar

#: States, in order; the last five only where there are fixes and a heading, and the last of them only where there is
#: powered level flight, whose speed CRUISE is: at one propeller setting it is the same from one stretch to the next.
SPEED, PITCH, DEPTH, WATER, SLIP, RESPONSE, EAST, NORTH, CURRENT_EAST, CURRENT_NORTH, CRUISE = range(11)
#: Kinds of measurement, in order, and the state measured; the last four only where these states are. "continuity" ties
#: V to CRUISE where a cruise begins and ends; the last is a speed sensor's, if used, in a cruise.
MEASURED = {
    "depth": DEPTH,
    "pitch": PITCH,
    "speed": SPEED,
    "east": EAST,
    "north": NORTH,
    "continuity": SPEED,
    "cruising speed": CRUISE,
}

#: 1-sigma of α under power as a share of the glide's α at the same pitch. With thrust T ≥ 0 less lift is needed than
#: in the glide, so that |α| lies between zero and the glide's; near level, net buoyancy of either sign can be carried.
SPAN = 0.6

#: Relative change of V per change of pitch (1/rad) is taken to be at most this.
STEEPEST_TURN = 5.0
#: V is late by ℓ/2V behind the steady glide at the pitch it has, ℓ = m/K_D [m], which is nearly the same for all
#: gliders (see `lag`): no coefficient is looked at. Below the latter speed [m/s] it is no later.
LENGTH, SLOWEST = LENGTHS[0], 0.1

#: Under power V² goes with thrust and the weight along the path together, in a glide with the latter alone: of a
#: glide's change of V per change of pitch V follows a share between 0 and 1; this one, with its 1-sigma; and the most
#: that a glide's is taken for.
FOLLOWED, STEEPEST_DRIVEN = (0.5, 0.3), 1.5

#: Over a pause in the records (s) longer than this nothing is carried: the states are as open as after it, and the
#: position anywhere (m). Their covariance would outgrow double precision.
LONGEST, ANYWHERE = 21_600.0, 1e5
#: Over a leap of depth this is how far depth may go, m.
ANY_DEPTH = 1e3


class Sources(NamedTuple):
    """Which measurements are used besides depth and pitch."""

    speed: bool
    fixes: bool


class Considered(NamedTuple):
    """What is not exactly known: the bias of pitch, c − 2 coefficients, and how V follows the pitch under power."""

    pitch: float  # rad, 1-sigma
    polars: np.ndarray  # (c - 2, 2, 5): the polar with one coefficient moved by its 1-sigma each, up and down


class Trajectory(NamedTuple):
    """Where the model is linearised: V, θ, δ and κ, each of shape (m,), and the scale error of a speed sensor."""

    speed: np.ndarray
    pitch: np.ndarray
    slip: np.ndarray
    response: np.ndarray
    scale: float = 0.0


class Course(NamedTuple):
    """What the model takes from `Series` besides measurements; see there."""

    time: np.ndarray
    heading: np.ndarray
    stratification: np.ndarray
    powered: np.ndarray
    manoeuvre: np.ndarray
    turning: np.ndarray
    loose: np.ndarray
    gentle: np.ndarray
    resting: np.ndarray
    cruising: np.ndarray
    new_setting: np.ndarray
    leaping: np.ndarray


class Slopes(NamedTuple):
    """How depth moves along a trajectory, whatever the noise: each of shape (m,)."""

    alpha: np.ndarray  # rad: α of a glide, under power too
    steady: np.ndarray  # whether there is one
    by_turn: np.ndarray  # 1/rad: relative change of V per change of pitch
    turned: np.ndarray  # by how much V changes with pitch until the next instant, relative
    sine: np.ndarray  # of γ
    cosine: np.ndarray
    sine_held: np.ndarray  # of γ without δ: as V changes, V δ is held, lest V grow so that a smaller δ does
    cosine_held: np.ndarray
    turn_v: np.ndarray  # ∂γ/∂V, s/m
    turn_t: np.ndarray  # ∂γ/∂θ; ∂γ/∂δ = −1


class Along(NamedTuple):
    """A trajectory, and what the model linear along it takes from there."""

    at: Trajectory
    slopes: Slopes
    considered: Considered | None
    changes: np.ndarray  # (m, c - 2): rad, of a glide's α per 1-sigma of each coefficient; 0 under power


class Pitching(NamedTuple):
    """How θ moves from one record to the next, each of shape (m,)."""

    turn: np.ndarray  # rad, by a gyro; 0 where none is used
    drift: np.ndarray  # rad2/s, random walk


@njit(cache=True, nogil=True)
def integrated(sigma: float, tau: float, dt: float, phi: float) -> tuple[float, float, float, float]:
    """Return mean weight and noise (variance, covariance, variance of integral) of a Gauss–Markov process.

    Parameters
    ----------
    sigma, tau
        1-sigma and correlation time, s.
    dt
        Time step, s.
    phi
        exp(−dt/tau).
    """
    weight = tau * (1.0 - phi)
    variance = sigma * sigma * (1.0 - phi * phi)
    covariance = sigma * sigma * tau * (1.0 - phi) ** 2
    integral = sigma * sigma * tau * max(2.0 * dt - tau * (3.0 - 4.0 * phi + phi * phi), 0.0)
    return weight, variance, covariance, integral


@njit(cache=True, nogil=True)
def change_of_glide(moved: np.ndarray, known: np.ndarray, speed: float, pitch: float) -> float:
    """Return the change of a glide's α, rad, per 1-sigma of a coefficient: half of that between up and down.

    With 1-sigma of 20 to 50 % α is far from linear in lift and drag; the difference upwards alone is a fifth short of
    the standard deviation of α.

    Parameters
    ----------
    moved
        The two polars, shape (2, 5).
    known
        What is known of their glides, shape (2, 7), NaN at first and brought up to date: the flattest ones, and α, its
        slope in pitch and pitch of the last one looked for, with which the search begins.
    speed, pitch
        V [m/s] and θ [rad].
    """
    change = 0.0
    for side in range(2):
        polar = Polar(moved[side, 0], moved[side, 1], moved[side, 2], moved[side, 3], moved[side, 4])
        drag_0, of = parasite(polar, speed), known[side]
        if polar.drag_exponent != 0.0 or math.isnan(of[0]):
            of[0], of[1], of[2], of[3] = best_glides(polar, drag_0)
        guess = of[4] + of[5] * (pitch - of[6])
        alpha, of[5], _, _ = glide_near(polar, drag_0, Best(of[0], of[1], of[2], of[3]), speed, pitch, guess)
        of[4], of[6] = alpha, pitch
        change += 0.5 * alpha if side == 0 else -0.5 * alpha
    return change


@njit(cache=True, nogil=True)
def _follow(
    polar: Polar, moved: np.ndarray, course: Course, at: Trajectory, slopes: Slopes, changes: np.ndarray
) -> None:
    """Fill `slopes` along the trajectory, and `changes` by the polars `moved` of the considered parameters."""
    m, c = changes.shape
    known = np.full((c, 2, 7), np.nan)
    drag_0, alpha, by_pitch, before = parasite(polar, 1.0), math.nan, 0.0, 0.0
    best, lagging = best_glides(polar, drag_0), at.pitch[0]
    for k in range(m):
        v, pitch, powered = at.speed[k], at.pitch[k], course.powered[k]
        if course.manoeuvre[k] or course.resting[k]:
            lagging = pitch
        if polar.drag_exponent != 0.0:
            drag_0 = parasite(polar, v)
            best = best_glides(polar, drag_0)
        alpha += by_pitch * (lagging - before)
        alpha, by_pitch, by_speed, steady = glide_near(polar, drag_0, best, v, lagging, alpha)
        before = lagging
        share = 0.0 if powered else 1.0  # under power the closure says only how far α may be from zero
        gamma = pitch - share * alpha - at.slip[k]
        sine, cosine = math.sin(gamma), math.cos(gamma)
        by_turn, followed = 0.5 * cosine / math.copysign(max(abs(sine), 1e-3), sine), 1.0
        if powered:
            by_turn, followed = min(max(by_turn, -STEEPEST_DRIVEN), STEEPEST_DRIVEN), FOLLOWED[0]
        elif steady:
            drag = drag_0 + polar.induced_drag * alpha**2
            by_turn = by_turn * (1.0 - by_pitch) - polar.induced_drag * alpha * by_pitch / drag
            by_turn = min(max(by_turn, -STEEPEST_TURN), STEEPEST_TURN)
        else:
            by_turn = 0.0
        slopes.alpha[k], slopes.steady[k], slopes.by_turn[k] = alpha, steady, by_turn
        slopes.turned[k], of_speed = 0.0, lagging
        if k < m - 1 and not (course.manoeuvre[k] or course.resting[k]):
            pause = course.time[k + 1] - course.time[k]
            step = (at.pitch[k + 1] - lagging) * -math.expm1(-2.0 * pause * max(v, SLOWEST) / LENGTH)
            slopes.turned[k] = followed * by_turn * step
            lagging += step
        slopes.sine[k], slopes.cosine[k] = sine, cosine
        slopes.sine_held[k], slopes.cosine_held[k] = math.sin(gamma + at.slip[k]), math.cos(gamma + at.slip[k])
        slopes.turn_v[k], slopes.turn_t[k] = -share * by_speed, 1.0 - share * by_pitch
        for i in range(c):
            changes[k, i] = 0.0 if powered else change_of_glide(moved[i], known[i], v, of_speed)


@njit(cache=True, nogil=True)
def _fill(
    course: Course,
    pitching: Pitching,
    at: Trajectory,
    slopes: Slopes,
    changes: np.ndarray,
    s: Settings,
    decay: np.ndarray,
    rows: np.ndarray,
    shift: np.ndarray,
    noise: np.ndarray,
    cross: np.ndarray,
) -> None:
    """Fill F, shift and Q along the trajectory."""
    m, n = decay.shape
    c = changes.shape[1]
    dt_0, tau_0 = -1.0, -1.0
    phi_w, phi_s = 1.0, 1.0
    for k in range(m - 1):
        pause = course.time[k + 1] - course.time[k]
        dt = min(max(pause, 1e-3), LONGEST)
        v, pitch, quick, resting = at.speed[k], at.pitch[k], course.manoeuvre[k], course.resting[k]
        powered, gentle, cruising = course.powered[k], course.gentle[k], course.cruising[k]
        steady, sine, cosine = slopes.steady[k], slopes.sine[k], slopes.cosine[k]
        turn_v, turn_t = slopes.turn_v[k], slopes.turn_t[k]
        met = course.stratification[k]
        slowing = 0.0 if math.isnan(met) or resting or cruising else met
        rate = -v * sine
        z_v, z_t, z_s = -slopes.sine_held[k] - v * cosine * turn_v, -v * cosine * turn_t, v * cosine
        turned = 0.0
        if cruising:  # depth bears no speed in level flight: only how far the path is off level
            z_v = 0.0
        if resting:
            q_v = s.speed_drift_surface
        elif quick and gentle:
            q_v = s.speed_drift_gentle
        elif quick:
            q_v = s.speed_drift_manoeuvre + s.speed_turn * course.turning[k] + s.initial_speed**2 * course.loose[k]
        elif math.isnan(met):
            q_v = s.speed_drift_blind * s.unsteadiness
        else:
            turned = slopes.turned[k]
            q_v = s.speed_drift + (s.stratification * v) ** 2 * met
            if powered or not steady:
                q_v += (0.5 * v) ** 2 * s.pitch_drift * min(cosine**2 / max(sine**2, 1e-3), 25.0)
            else:
                q_v += (s.pitch_share * slopes.by_turn[k] * v) ** 2 * s.pitch_drift
            q_v *= s.unsteadiness
        q_t = pitching.drift[k]
        sigma_s, tau_s = (s.slip_manoeuvre, s.slip_time_manoeuvre) if quick else (s.slip, s.slip_time)
        if powered:
            sigma_s = max(sigma_s, SPAN * abs(slopes.alpha[k]))
            if gentle and not quick:
                tau_s = s.slip_time_powered
        if not steady:
            sigma_s = max(sigma_s, s.slip_manoeuvre)
        if dt != dt_0:
            phi_w = math.exp(-dt / s.tau_w)
        if dt != dt_0 or tau_s != tau_0:
            phi_s = math.exp(-dt / tau_s)
        dt_0, tau_0 = dt, tau_s
        w_weight, w_var, w_cov, w_int = integrated(s.sigma_w, s.tau_w, dt, phi_w)
        s_weight, s_var, s_cov, s_int = integrated(sigma_s, tau_s, dt, phi_s)
        if resting:  # afloat, neither flight nor water moves it up and down
            rate, z_v, z_t, z_s, w_weight, w_cov, w_int = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        d, q, x, F, b = decay[k], noise[k], cross[k], rows[k], shift[k]
        d[:] = 1.0
        d[WATER], d[SLIP] = phi_w, phi_s
        source = CRUISE if n > CRUISE and cruising else SPEED  # the state that is V at this instant
        slowing *= dt / max(v, s.least_speed)
        F[1, SPEED], F[1, RESPONSE] = 1.0 + turned, -slowing
        if powered and b.shape[1] > 2 + c:
            b[1, 2 + c] = v * turned * FOLLOWED[1] / FOLLOWED[0]
        q[RESPONSE] = (s.response_drift if quick else 0.0) * dt
        F[0, source], F[0, PITCH], F[0, DEPTH] = z_v * dt, z_t * dt, 1.0
        F[0, WATER], F[0, SLIP] = -w_weight, z_s * s_weight
        b[0, 0] = dt * (rate - z_v * v - z_t * (pitch - 0.5 * pitching.turn[k])) - z_s * s_weight * at.slip[k]
        q[SPEED], q[PITCH], q[WATER], q[SLIP] = q_v * dt, q_t * dt, w_var, s_var
        if source == SPEED:
            x[SPEED] = z_v * q_v * dt * dt / 2.0
        x[PITCH], x[WATER], x[SLIP] = z_t * q_t * dt * dt / 2.0, -w_cov, z_s * s_cov
        q[DEPTH] = (z_v**2 * q_v + z_t**2 * q_t) * dt**3 / 3.0 + w_int + z_s**2 * s_int + s.swell * dt
        if resting or quick:
            q[DEPTH] += s.heave_drift * dt  # sinking nose up, rising nose down, waves: not the polar's flight
        if course.leaping[k]:
            q[DEPTH] += ANY_DEPTH**2
            q[SPEED] += s.initial_speed**2
        if n > EAST:
            along = (math.sin(course.heading[k]), math.cos(course.heading[k]))
            x_v = slopes.cosine_held[k] - v * sine * turn_v
            x_t, x_s = -v * sine * turn_t, v * sine
            if resting:
                x_v, x_t, x_s = 0.0, 0.0, 0.0
            forward = 0.0 if resting else v * cosine - x_v * v - x_t * pitch - x_s * at.slip[k]
            unknown = pause > LONGEST or course.leaping[k]
            for i in range(2):
                F[2 + i, source], F[2 + i, PITCH] = along[i] * x_v * dt, along[i] * x_t * dt
                F[2 + i, SLIP], F[2 + i, EAST + i], F[2 + i, CURRENT_EAST + i] = along[i] * x_s * dt, 1.0, dt
                b[2 + i, 0] = along[i] * forward * dt
                q[EAST + i] = (s.surface_drift if resting else s.position_drift) * dt
                if unknown:
                    q[EAST + i] += ANYWHERE**2
                q[CURRENT_EAST + i] = s.current_drift * dt
            if n > CRUISE:
                q[CRUISE] = s.cruise_drift * dt + (s.initial_speed**2 if course.new_setting[k] else 0.0)
            if cruising:  # meanwhile the other speed is at large: it is tied to this one where the cruise ends
                q[SPEED] = s.speed_drift_surface * dt
        if not powered and not resting:
            for i in range(c):
                b[0, 2 + i] = v * cosine * changes[k, i] * dt
                if n > EAST:
                    b[2, 2 + i] = along[0] * v * sine * changes[k, i] * dt
                    b[3, 2 + i] = along[1] * v * sine * changes[k, i] * dt


def pitching(series: Series, settings: Settings) -> tuple[Pitching, np.ndarray]:
    """Return how θ moves, and where a gyro says so, boolean of shape (m,)."""
    s, quick = settings, series.manoeuvre
    left = np.where(quick, s.turn_drift_manoeuvre, s.turn_drift)
    seen = np.isfinite(series.turn) & np.isfinite(left)
    drift = np.maximum(np.where(quick, s.pitch_drift_manoeuvre, s.pitch_drift + series.swinging), series.hiding)
    return Pitching(np.where(seen, series.turn, 0.0), np.where(seen, left, drift)), seen


def measured(series: Series, settings: Settings, kinds: int, *, speed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return measurements and their variances, shape (m, kinds): depth, pitch and speed first, NaN where there is none.

    Parameters
    ----------
    series, settings
        Measurements and their noise.
    kinds
        How many kinds there are, three or more.
    speed
        Whether the speed sensor is one of them.
    """
    shape = (series.time.size, kinds)
    observed, variance = np.full(shape, np.nan), np.ones(shape)
    observed[:, 0], variance[:, 0] = series.depth, settings.depth_noise**2
    observed[:, 1], variance[:, 1] = series.pitch, settings.pitch_noise**2
    if speed:
        observed[:, 2], variance[:, 2] = series.speed, np.maximum(series.speed_std, 1e-3) ** 2
    return observed, variance


def depth_at_start(series: Series) -> float:
    """Return the first depth measured, m; 0 without any."""
    known = series.depth[np.isfinite(series.depth)]
    return float(known[0]) if known.size else 0.0


def _course(series: Series) -> Course:
    return Course(*(getattr(series, name) for name in Course._fields))


def follow(series: Series, polar: Polar, at: Trajectory, considered: Considered | None = None) -> Along:
    """Return what the kinematic model takes from a trajectory, whatever the noise.

    Parameters
    ----------
    series
        Measurements and flags, m instants.
    polar
        Lift and drag coefficients; only their ratios matter.
    at
        Trajectory of V, θ, δ, κ.
    considered
        What is not exactly known; nothing if left out.
    """
    m, moved = series.time.size, considered.polars if considered else np.empty((0, 2, 5))
    changes = np.empty((m, len(moved)))
    slopes = Slopes(*(np.empty(m, dtype=np.bool_ if name == "steady" else np.float64) for name in Slopes._fields))
    _follow(polar, moved, _course(series), at, slopes, changes)
    return Along(at, slopes, considered, changes)


def linearise(
    series: Series,
    along: Along,
    settings: Settings,
    sources: Sources,
) -> Problem:
    """Return the state-space problem of the kinematic model, linear along a trajectory.

    Parameters
    ----------
    series
        Measurements and flags, m instants.
    along
        The trajectory, as from `follow`.
    settings
        Noise levels.
    sources
        Whether the speed sensor and the fixes are measurements.

    Returns
    -------
    Problem
        With 6 states, or 10 with fixes, or 11 with powered level flight too; then one for the bias of a gyro, and one,
        the last, for the scale of a speed sensor.
    """
    m, s, at = series.time.size, settings, along.at
    n, p = (10, 5) if sources.fixes else (6, 3)
    cruises = sources.fixes and bool(series.cruising.any())
    if cruises:
        n, p = 11, 6 + sources.speed
    considered = along.considered
    c = 2 + len(considered.polars) if considered else 0
    coupled = np.array([DEPTH, SPEED, EAST, NORTH] if sources.fixes else [DEPTH, SPEED])
    r = coupled.size
    decay, rows, shift = np.zeros((m, n)), np.zeros((m, r, n)), np.zeros((m, r, 1 + c))
    noise, cross = np.zeros((m, n)), np.zeros((m, n))
    moving, seen_turning = pitching(series, s)
    _fill(
        _course(series),
        moving,
        at,
        along.slopes,
        along.changes,
        settings,
        decay,
        rows,
        shift,
        noise,
        cross,
    )
    seen, weight = np.zeros((p, 2), dtype=np.int64), np.zeros((p, 2))
    seen[:, 0], weight[:, 0] = list(MEASURED.values())[:p], 1.0
    observed, variance = measured(series, s, p, speed=sources.speed)
    observed_by = np.zeros((p, c))
    if considered:
        observed_by[1, 0] = considered.pitch
    if sources.fixes:
        observed[:, 3], observed[:, 4] = series.east, series.north
        variance[:, 3:5] = s.fix_noise**2
    if cruises:
        seen[5, 1], weight[5, 1] = CRUISE, -1.0
        bounds = np.diff(series.cruising, append=False) | np.diff(series.cruising, prepend=False)
        observed[bounds & series.cruising, 5], variance[:, 5] = 0.0, s.continuity**2
        if sources.speed:
            observed[:, 6], variance[:, 6] = np.where(series.cruising, observed[:, 2], np.nan), variance[:, 2]
            observed[series.cruising, 2] = np.nan
    mean = np.zeros(n)
    mean[SPEED], mean[PITCH] = at.speed[0], at.pitch[0]
    mean[DEPTH], mean[RESPONSE] = depth_at_start(series), s.response
    if cruises:
        mean[CRUISE] = float(np.median(at.speed))
    flight = [s.initial_speed, 0.2, 5.0, s.sigma_w, s.slip_manoeuvre, s.response]
    spread = np.array([*flight, 1e3, 1e3, s.initial_current, s.initial_current, s.initial_speed])
    problem = Problem(
        mean,
        np.diag(spread[:n] ** 2),
        decay,
        coupled,
        rows,
        shift,
        noise,
        cross,
        DEPTH,
        seen,
        weight,
        observed,
        observed_by,
        variance,
    )
    problem = with_rate(problem, series.time, PITCH, moving.turn, seen_turning, (s.gyro_bias, s.gyro_bias_drift))
    if not sources.speed:
        return problem
    kinds = (2, 6) if cruises else (2,)
    return with_scale(problem, series.time, at.speed, at.scale, s.speed_scale, kinds)

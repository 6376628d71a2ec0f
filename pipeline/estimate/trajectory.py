"""The trajectory that the kinematic model is linearised along, and the flight that its smoothed states describe."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numba import njit

from pipeline.estimate.linearise import (
    CRUISE,
    DEPTH,
    PITCH,
    RESPONSE,
    SLIP,
    SPEED,
    WATER,
    Sources,
    Trajectory,
    follow,
    linearise,
)
from pipeline.estimate.problem import Problem, Solution
from pipeline.estimate.sensors import around, scale_of
from pipeline.estimate.series import Series
from pipeline.estimate.settings import Settings
from pipeline.estimate.told import Told
from pipeline.model.closure import best_glides, glide_angles, glide_near, parasite
from pipeline.vehicle import Polar

#: Bounds within which the model is linearised: V [m/s], θ [rad] and δ [rad].
SLOWEST, FASTEST, STEEPEST, SLIPPED = 0.02, 4.0, 1.5, 0.3
#: A trajectory stands still when the next step would move V nowhere below the surface by more than this (m/s) in steady
#: flight, and in manoeuvres: a fifth of the 1-sigma that V has at best. The last solution is that step.
STILL, STILL_MANOEUVRE = 2e-3, 1e-2


class Solve(Protocol):
    """An engine that solves linear problems."""

    def __call__(self, problem: Problem, *, whole: bool = True, room: int = 0) -> Solution:
        """Return the solution of `problem`; without its covariances unless `whole`, with `room` for more columns."""


#: Thrust makes a vehicle faster and its α less than in a glide at the same pitch: beyond this share of a glide's α, and
#: with depth alone to tell, it is not the flight that is described.
FARTHEST = 1.2


class Flight(NamedTuple):
    """What an estimate says of the flight: V, θ, α, γ, w_w, z, in this order along the first axis."""

    state: np.ndarray  # (6, m)
    std: np.ndarray  # (6, m): all that is not known, the considered parameters included
    by: np.ndarray  # (c, m): change of V per 1-sigma of each considered parameter, as far as it is still open
    steady: np.ndarray  # (m,): steep enough for a glide
    beyond: np.ndarray  # (m,): under power, and α is farther from zero than `FARTHEST` of a glide's


def first_guess(series: Series, polar: Polar) -> Trajectory:
    """Return a trajectory to linearise along: V from the smoothed depth rate, where the path is steep enough."""
    m = series.time.size
    speed = np.full(m, 0.4)
    share = np.where(series.powered, 0.0, 1.0)
    for _ in range(3 if polar.drag_exponent else 1):
        alpha, _, _, steady = glide_angles(polar, speed, series.pitch_guess)
        sine = np.sin(series.pitch_guess - share * alpha)
        good = steady & (np.abs(sine) > 0.15) & ~series.manoeuvre
        ratio = np.where(good, -series.depth_rate_guess / np.where(good, sine, 1.0), np.nan)
        good &= (ratio > 0.03) & (ratio < 3.0)
        if not good.any():
            break
        speed = np.interp(series.time, series.time[good], ratio[good])
    return Trajectory(speed, np.clip(series.pitch_guess, -STEEPEST, STEEPEST), np.zeros(m), np.zeros(m))


def iterate(
    series: Series,
    polar: Polar,
    settings: Settings,
    at: Trajectory,
    sources: Sources,
    solve: Solve,
    times: int,
) -> Trajectory:
    """Return the trajectory, linearised along and solved for until it stands still, at most so many times."""
    steps: list[float] = []
    for _ in range(times):
        mean = solve(linearise(series, follow(series, polar, at), settings, sources), whole=False).mean[:, :, 0]
        speed = mean[:, SPEED]
        if sources.fixes and series.cruising.any():
            speed = np.where(series.cruising, mean[:, CRUISE], speed)
        speed = np.clip(speed, SLOWEST, FASTEST)
        steps.append(step(series, speed, at.speed))
        pitch, slip = np.clip(mean[:, PITCH], -STEEPEST, STEEPEST), np.clip(mean[:, SLIP], -SLIPPED, SLIPPED)
        scale = 0.0
        if sources.speed and settings.speed_scale > 0.0:
            scale = around(scale_of(mean[:, -1], at.speed, at.scale), np.isfinite(series.speed))
        at = Trajectory(speed, pitch, slip, np.clip(mean[:, RESPONSE], -1.0, 1.0), scale)
        if still(steps):
            break
    return at


def step(series: Series, speed: np.ndarray, before: np.ndarray) -> float:
    """Return how far V, m/s, shape (m,), is from where it was `before`, at most, as a share of what standing still is.

    Afloat it means nothing.
    """
    most = np.where(series.manoeuvre, STILL_MANOEUVRE, STILL)
    return float(np.max(np.abs(speed - before) / most, initial=0.0, where=~(series.afloat | series.standing)))


def still(steps: Sequence[float]) -> bool:
    """Return whether the step after the last of `steps` would be within what standing still is.

    It shrinks as the last one did, if that did, or faster: linear models along a trajectory are Newton's steps.
    """
    *before, last = steps
    shrinking = min(last / before[-1], 1.0) if before else 1.0
    return last * shrinking <= 1.0


def flight(series: Series, polar: Polar, solution: Solution, changes: np.ndarray, told: Told) -> Flight:
    """Return the flight that smoothed states describe, with what the states and the borrowed leave open.

    Parameters
    ----------
    series
        Flags, m instants.
    polar, solution
        What was solved, and for what.
    changes
        Of a glide's α, as in `linearise.Along`.
    told
        What is known of the borrowed.
    """
    m, n, columns = solution.mean.shape
    state, std = np.empty((6, m)), np.empty((6, m))
    by, steady, beyond = np.empty((columns - 1, m)), np.empty(m, dtype=np.bool_), np.empty(m, dtype=np.bool_)
    cruising = series.cruising & (n > CRUISE)
    _describe(
        polar,
        changes,
        told,
        series.powered,
        cruising,
        solution.mean,
        solution.covariance,
        state,
        std,
        by,
        steady,
        beyond,
    )
    return Flight(state, std, by, steady, beyond)


@njit(cache=True, nogil=True)
def _describe(
    polar: Polar,
    changes: np.ndarray,
    told: Told,
    powered: np.ndarray,
    cruising: np.ndarray,
    mean: np.ndarray,
    covariance: np.ndarray,
    state: np.ndarray,
    std: np.ndarray,
    by: np.ndarray,
    steady: np.ndarray,
    beyond: np.ndarray,
) -> None:
    """Fill what `Flight` holds; α = glide(V, θ) + δ, γ = θ − α, linear in the states around them."""
    m, _, columns = mean.shape
    change, c = np.empty((6, columns - 1)), changes.shape[1]
    drag_0, glide, by_pitch, before = parasite(polar, 1.0), math.nan, 0.0, 0.0
    best = best_glides(polar, drag_0)
    for k in range(m):
        x, P = mean[k], covariance[k]
        source = CRUISE if cruising[k] else SPEED
        speed = min(max(x[source, 0], SLOWEST), FASTEST)
        if polar.drag_exponent != 0.0:
            drag_0 = parasite(polar, speed)
            best = best_glides(polar, drag_0)
        pitch = x[PITCH, 0]
        glide += by_pitch * (pitch - before)
        glide, by_pitch, by_speed, steady[k] = glide_near(polar, drag_0, best, speed, pitch, glide)
        before = pitch
        share = 0.0 if powered[k] else 1.0
        alpha = share * glide + x[SLIP, 0]
        state[0, k], state[1, k], state[2, k] = x[source, 0], pitch, alpha
        state[3, k], state[4, k], state[5, k] = pitch - alpha, x[WATER, 0], x[DEPTH, 0]
        a, b = share * by_speed, share * by_pitch  # α in V and θ; in δ it is 1
        across = a * P[source, PITCH] + b * P[PITCH, PITCH] + P[SLIP, PITCH]
        var_alpha = a * a * P[source, source] + b * b * P[PITCH, PITCH] + P[SLIP, SLIP]
        var_alpha += 2.0 * (a * b * P[source, PITCH] + a * P[source, SLIP] + b * P[PITCH, SLIP])
        std[0, k], std[1, k], std[2, k] = P[source, source], P[PITCH, PITCH], var_alpha
        std[3, k] = P[PITCH, PITCH] + var_alpha - 2.0 * across
        std[4, k], std[5, k] = P[WATER, WATER], P[DEPTH, DEPTH]
        for q in range(columns - 1):
            direct = changes[k, q - 1] if 0 < q < 1 + c else 0.0
            change[0, q], change[1, q] = x[source, 1 + q], x[PITCH, 1 + q]
            change[2, q] = a * x[source, 1 + q] + b * x[PITCH, 1 + q] + x[SLIP, 1 + q] + direct
            change[3, q], change[4, q] = change[1, q] - change[2, q], x[WATER, 1 + q]
            change[5, q] = x[DEPTH, 1 + q]
            by[q, k] = change[0, q] * math.sqrt(told.covariance[q, q])
        for i in range(6):
            for q in range(columns - 1):
                with_others = 0.0
                for r in range(columns - 1):
                    with_others += told.covariance[q, r] * change[i, r]
                std[i, k] += change[i, q] * with_others
                state[i, k] += change[i, q] * told.value[q]
        for i in range(6):
            std[i, k] = np.sqrt(max(std[i, k], 0.0))
        beyond[k] = powered[k] and steady[k] and abs(state[2, k]) > FARTHEST * abs(glide)

"""A stretch of a mission flown by the force model: the path sought, solved along, and what is left open of it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.estimate import told
from pipeline.estimate.craft import CARRIED, FLUSHING, PARAMETERS, THRUST, Adjusted
from pipeline.estimate.force import (
    DEPTH,
    LEAST,
    MOST,
    PITCH,
    SPEED,
    STALLED,
    WATER,
    Along,
    Path,
    follow,
    linearise,
    smoothed,
)
from pipeline.estimate.forcing import Forcing
from pipeline.estimate.noise import fill_left_open
from pipeline.estimate.problem import Problem, Solution, unconsidered
from pipeline.estimate.sensors import Scale, scale_found
from pipeline.estimate.series import Series
from pipeline.estimate.settings import Settings
from pipeline.estimate.trajectory import Flight, Solve, step, still

#: The path is solved for at most so many times.
ITERATIONS = 8


class Flown(NamedTuple):
    """A stretch of a mission, solved."""

    flight: Flight
    problem: Problem  # the last one solved
    solution: Solution
    scale: Scale | None  # of the speed sensor, if it is used


def solve(
    series: Series,
    force: Forcing,
    adjusted: Adjusted,
    at: Path,
    *,
    speed: bool,
    solver: Solve,
) -> Flown:
    """Return the flight by the force model.

    Parameters
    ----------
    series, force
        Measurements and inputs, m instants.
    adjusted
        Craft, noise levels, and the columns of what is left open.
    at
        Where to linearise at first.
    speed
        Whether the speed sensor is a measurement.
    solver
        Engine.
    """
    settings, nothing = adjusted.noise.settings, np.empty((len(PARAMETERS), 0))
    scaled = speed and settings.speed_scale > 0.0

    def mean_at(settings: Settings, along: Along) -> np.ndarray:
        problem = unconsidered(linearise(series, along, settings, speed=speed))
        return solver(problem, whole=False).mean[:, :, 0]

    steps: list[float] = []
    for _ in range(ITERATIONS):
        along = follow(series, force, adjusted.craft, at, nothing)
        new = smoothed(series, mean_at(settings, along), at, scaled=scaled)
        steps.append(step(series, new.speed, at.speed))
        at = new
        if still(steps):
            break
    along = follow(series, force, adjusted.craft, at, _left_open(adjusted, force))
    problem = linearise(series, along, settings, speed=speed)
    solution = solver(problem, room=len(adjusted.noise.moved))
    fill_left_open(adjusted.noise, solution.mean, lambda moved: mean_at(moved, along))
    scale = None
    if scaled:
        held = told.nothing(solution.mean.shape[2] - 1)
        scale = scale_found(series, solution, np.maximum(at.speed, LEAST), at.scale, held)
    return Flown(_flight(solution, along.alphas, unsettled(series, at, settings)), problem, solution, scale)


def _left_open(adjusted: Adjusted, force: Forcing) -> np.ndarray:
    """Return the columns of what is left open, shape (c, k), but for that of parameters that nothing depends on."""
    columns = adjusted.columns.copy()
    if not force.driven:
        columns[THRUST] = 0.0
    if adjusted.craft.value[CARRIED] == 0.0:
        columns[FLUSHING] = 0.0
    return np.asarray(columns[:, columns.any(axis=0)])


def unsettled(series: Series, at: Path, settings: Settings) -> np.ndarray:
    """Return the 1-sigma, rad, of what the lift balance leaves of α, shape (m,).

    The mode that settles α lasts up to a second: the faster the vehicle turns, the farther α is from its balance.
    """
    steady = np.where(series.manoeuvre, settings.slip_manoeuvre_force, settings.slip)
    return np.asarray(np.hypot(steady, settings.settling * at.pitch_rate))


def _flight(solution: Solution, alphas: np.ndarray, slip: np.ndarray) -> Flight:
    """Return the flight that smoothed states describe, with what states, parameters and the slaving of α leave open."""
    m = slip.size
    state, std = np.empty((6, m)), np.empty((6, m))
    mean = solution.mean
    _describe(mean, solution.covariance, alphas, slip, state, std)
    beyond = (state[0] < LEAST) | (state[0] > MOST)  # where the path was not followed, nothing is known of V
    std[0] = np.where(beyond, MOST + np.abs(state[0]), std[0])
    return Flight(state, std, mean[:, SPEED, 1:].T, np.ones(m, dtype=bool), np.zeros(m, dtype=bool))


@njit(cache=True, nogil=True)
def _describe(
    mean: np.ndarray, covariance: np.ndarray, alphas: np.ndarray, slip: np.ndarray, state: np.ndarray, std: np.ndarray
) -> None:
    """Fill states and 1-sigma of `Flight`; α is linear in V and θ, and anything where flow is separated."""
    for k in range(slip.size):
        x, P = mean[k], covariance[k]
        alpha, by_v, by_t = alphas[k, 0], alphas[k, 1], alphas[k, 2]
        across = by_v * P[SPEED, PITCH] + by_t * P[PITCH, PITCH]
        var_alpha = by_v**2 * P[SPEED, SPEED] + by_t * (across + by_v * P[SPEED, PITCH]) + slip[k] ** 2
        if by_v == 0.0 and by_t == 0.0:
            var_alpha = STALLED**2
        state[0, k], state[1, k], state[2, k] = x[SPEED, 0], x[PITCH, 0], alpha
        state[3, k], state[4, k], state[5, k] = x[PITCH, 0] - alpha, x[WATER, 0], x[DEPTH, 0]
        std[0, k], std[1, k], std[2, k] = P[SPEED, SPEED], P[PITCH, PITCH], var_alpha
        std[3, k] = P[PITCH, PITCH] + var_alpha - 2.0 * across
        std[4, k], std[5, k] = P[WATER, WATER], P[DEPTH, DEPTH]
        for i in range(6):
            std[i, k] = max(std[i, k], 0.0)
        for q in range(1, x.shape[1]):
            change = by_v * x[SPEED, q] + by_t * x[PITCH, q]
            if 2 + q < alphas.shape[1]:
                change += alphas[k, 2 + q]
            std[0, k] += x[SPEED, q] ** 2
            std[1, k] += x[PITCH, q] ** 2
            std[2, k] += change**2
            std[3, k] += (x[PITCH, q] - change) ** 2
            std[4, k] += x[WATER, q] ** 2
            std[5, k] += x[DEPTH, q] ** 2
        for i in range(6):
            std[i, k] = math.sqrt(std[i, k])

"""The trajectory that the kinematic model is linearised along, found by linearising and solving in turn."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pipeline.estimate.linearise import CRUISE, PITCH, SLIP, SPEED, WATER, Settings, Trajectory, linearise
from pipeline.estimate.series import Series
from pipeline.estimate.smoother import Problem, Solution
from pipeline.model.closure import glide_angles
from pipeline.vehicle import Polar


class Options(NamedTuple):
    """What does not change between iterations: which measurements are used, and the engine."""

    use_speed: bool
    use_fixes: bool
    solve: Callable[[Problem], Solution]


def first_guess(series: Series, polar: Polar) -> Trajectory:
    """Return a trajectory to linearise along: V from the smoothed depth rate, where the path is steep enough."""
    m = series.time.size
    speed = np.full(m, 0.4)
    for _ in range(3 if polar.drag_exponent else 1):
        alpha, _, _, steady = glide_angles(polar, speed, series.pitch_guess)
        sine = np.sin(series.pitch_guess - share_of_glide(series) * alpha)
        good = steady & (np.abs(sine) > 0.15) & ~series.manoeuvre
        ratio = np.where(good, -series.depth_rate_guess / np.where(good, sine, 1.0), np.nan)
        good &= (ratio > 0.03) & (ratio < 3.0)
        if not good.any():
            break
        speed = np.interp(series.time, series.time[good], ratio[good])
    return Trajectory(speed, series.pitch_guess, np.zeros(m))


def iterate(
    series: Series,
    polar: Polar,
    settings: Settings,
    at: Trajectory,
    options: Options,
    times: int,
    pitch_shift: float = 0.0,
) -> tuple[Trajectory, Solution]:
    """Linearise and solve until the trajectory stands still, at most `times` times."""
    for _ in range(times):
        problem = linearise(
            series,
            polar,
            settings,
            at,
            use_speed=options.use_speed,
            use_fixes=options.use_fixes,
            pitch_shift=pitch_shift,
        )
        solution = options.solve(problem)
        speed = np.clip(speed_of(series, solution)[0], 0.02, 4.0)
        pitch = np.clip(solution.mean[:, PITCH], -1.5, 1.5)
        slip = np.clip(solution.mean[:, SLIP], -0.3, 0.3)
        change = float(np.max(np.abs(speed - at.speed)))
        at = Trajectory(speed, pitch, slip)
        if change < 1e-7:
            break
    return at, solution


def speed_of(series: Series, solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """Return V and the state that it is at each instant (SPEED or CRUISE), shape (m,) each."""
    n = solution.mean.shape[1]
    state = np.where(series.cruising & (n > CRUISE), min(CRUISE, n - 1), SPEED)
    return np.take_along_axis(solution.mean, state[:, None], axis=1)[:, 0], state


def share_of_glide(series: Series) -> np.ndarray:
    """Return the expected share of the glide's angle of attack: all of it, none under power; shape (m,)."""
    return np.where(series.powered, 0.0, 1.0)


def angles(series: Series, polar: Polar, solution: Solution) -> np.ndarray:
    """Return V, θ, α, γ and w_w of smoothed states, shape (5, m)."""
    speed, _ = speed_of(series, solution)
    pitch = solution.mean[:, PITCH]
    glide, _, _, _ = glide_angles(polar, np.clip(speed, 0.02, 4.0), pitch)
    alpha = share_of_glide(series) * glide + solution.mean[:, SLIP]
    return np.stack([speed, pitch, alpha, pitch - alpha, solution.mean[:, WATER]])

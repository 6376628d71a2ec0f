"""What a sensor that is optional adds to a linear problem: a state for its own error, which nothing has without it.

A speed sensor reads (1 + s) V, s a factor that hardly changes. Around V_0 and s_0 that is linear in V and in
u = s V_0 / (1 + s_0), a speed; divided by 1 + s_0 the weights of both are one, and u follows V_0 from instant to
instant. A gyro's rate of pitch is an input, see `gyro`, and its bias the state.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pipeline.estimate.problem import Problem, Solution
from pipeline.estimate.series import Series
from pipeline.estimate.told import Told

#: Time, s, in which the scale wanders by as much as it may be off at first: a month, a fifth of it in a day.
LASTING = 30.0 * 86_400.0
#: A scale error is not followed beyond this.
MOST = 0.5


class Scale(NamedTuple):
    """Scale error of the speed sensor over a part of a mission, its mean, with 1-sigma."""

    value: float
    std: float


def with_rate(
    problem: Problem,
    time: np.ndarray,
    pitch: int,
    turn: np.ndarray,
    turning: np.ndarray,
    bias: tuple[float, float],
) -> Problem:
    """Return `problem` with pitch moved by a gyro, whose bias is one more state, the last.

    Parameters
    ----------
    problem
        The problem, in which pitch is a random walk; m instants, n states.
    time
        Instants, s, shape (m,).
    pitch
        The state that is pitch.
    turn
        By how much the gyro says that pitch turns from each instant to the next, bias included, rad, shape (m,).
    turning
        Where it says so, boolean of shape (m,); if nowhere the problem stays as it is.
    bias
        1-sigma of the bias before the mission, rad/s, and its random walk, rad²/s³.
    """
    if not turning.any():
        return problem
    (m, n), r = problem.decay.shape, len(problem.coupled)
    step = np.append(np.maximum(np.diff(time), 1e-3), 0.0)
    rows, shift = np.zeros((m, r + 1, n + 1)), np.zeros((m, r + 1, problem.shift.shape[2]))
    rows[:, :r, :n], shift[:, :r] = problem.rows, problem.shift
    rows[:, r, pitch], rows[:, r, n], shift[:, r, 0] = 1.0, np.where(turning, -step, 0.0), turn
    covariance = np.zeros((n + 1, n + 1))
    covariance[:n, :n], covariance[n, n] = problem.covariance_0, bias[0] ** 2
    return problem._replace(
        mean_0=np.append(problem.mean_0, 0.0),
        covariance_0=covariance,
        decay=np.column_stack([problem.decay, np.ones(m)]),
        coupled=np.append(problem.coupled, pitch),
        rows=rows,
        shift=shift,
        noise=np.column_stack([problem.noise, bias[1] * step]),
        cross=np.column_stack([problem.cross, np.zeros(m)]),
    )


def with_scale(
    problem: Problem, time: np.ndarray, speed: np.ndarray, scale: float, std: float, kinds: Sequence[int]
) -> Problem:
    """Return `problem` with the scale error of the speed sensor, as u, for one more state, the last.

    Parameters
    ----------
    problem
        The problem of a sensor with no error but noise; m instants, n states.
    time
        Instants, s, shape (m,).
    speed
        V_0, m/s, above zero, shape (m,).
    scale
        s_0, around which the measurement is linear.
    std
        1-sigma of the scale before the mission; with none the problem stays as it is.
    kinds
        The kinds of measurement that are the sensor's, of one state each.
    """
    if std == 0.0:
        return problem
    m, n = problem.decay.shape
    size = speed / (1.0 + scale)  # m/s of u in one of s
    decay, noise = np.ones(m), np.zeros(m)
    decay[:-1] = size[1:] / size[:-1]
    noise[:-1] = (std * size[1:]) ** 2 * np.diff(time) / LASTING
    seen, weight = problem.seen.copy(), problem.weight.copy()
    observed, variance = problem.observed.copy(), problem.variance.copy()
    for kind in kinds:
        seen[kind, 1], weight[kind, 1] = n, 1.0
        observed[:, kind] = observed[:, kind] / (1.0 + scale) + scale * size
        variance[:, kind] /= (1.0 + scale) ** 2
    covariance = np.zeros((n + 1, n + 1))
    covariance[:n, :n], covariance[n, n] = problem.covariance_0, (std * size[0]) ** 2
    return problem._replace(
        mean_0=np.append(problem.mean_0, 0.0),
        covariance_0=covariance,
        decay=np.column_stack([problem.decay, decay]),
        rows=np.concatenate([problem.rows, np.zeros((m, len(problem.coupled), 1))], axis=2),
        noise=np.column_stack([problem.noise, noise]),
        cross=np.column_stack([problem.cross, np.zeros(m)]),
        seen=seen,
        weight=weight,
        observed=observed,
        variance=variance,
    )


def scale_of(u: np.ndarray, speed: np.ndarray, scale: float) -> np.ndarray:
    """Return s, or its changes, from u, shape (m, …); `speed` and `scale` as given to `with_scale`."""
    size = speed / (1.0 + scale)
    return np.asarray(u / size.reshape(-1, *[1] * (u.ndim - 1)))


def around(s: np.ndarray, reported: np.ndarray) -> float:
    """Return the scale error to linearise around: the mean of `s` where the sensor `reported`, both of shape (m,)."""
    return float(np.clip(s[reported].mean(), -MOST, MOST)) if reported.any() else 0.0


def scale_found(series: Series, solution: Solution, speed: np.ndarray, scale: float, told: Told) -> Scale | None:
    """Return the mean scale error over the readings of the speed sensor; None without any.

    Parameters
    ----------
    series
        Its readings, m instants.
    solution
        Of a problem as from `with_scale`; `speed` and `scale` as given to it.
    told
        What is known of the considered parameters.
    """
    reported = np.isfinite(series.speed)
    if not reported.any():
        return None
    s = scale_of(solution.mean[:, -1], speed, scale)[reported]
    variance = scale_of(np.sqrt(solution.covariance[:, -1, -1]), speed, scale)[reported] ** 2 + told.left_open(s)
    return Scale(float(told.moved(s).mean()), float(np.sqrt(variance.mean())))

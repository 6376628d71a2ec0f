"""The smoother once more, by filterpy: slow, and for that independent.

filterpy 2 is frozen and only parts of it are right: `KalmanFilter` (linear) and its time-varying `rts_smoother` are;
the smoothers for its EKF and UKF are missing or wrong. So the estimator hands the same *linearised* problem to
either engine.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.estimate.problem import Problem, Solution, design, process, transition


def solve(problem: Problem, *, whole: bool = True, room: int = 0) -> Solution:
    """Return what `pipeline.estimate.smoother.solve` returns, computed by ``filterpy.kalman.KalmanFilter``.

    Parameters
    ----------
    problem
        The state-space problem; m instants, n states, p kinds of measurement.
    whole
        Whether covariances are wanted; without them it is no faster.
    room
        So many more columns of the mean are zero, for the caller to fill.

    Returns
    -------
    Solution
        Smoothed moments, innovations and the log-likelihood of the measurements.
    """
    columns = [_solve(problem, q) for q in range(1 + problem.observed_by.shape[1])]
    mean = np.stack([column.mean[:, :, 0] for column in columns], axis=-1)
    mean[:, :, 1:] -= mean[:, :, :1]
    mean = np.pad(mean, ((0, 0), (0, 0), (0, room)))
    return columns[0]._replace(mean=mean, covariance=columns[0].covariance if whole else columns[0].covariance[:0])


def _solve(problem: Problem, column: int) -> Solution:
    """Solve with one considered parameter (column > 0) moved by its 1-sigma."""
    from filterpy.kalman import KalmanFilter

    (m, p), n = problem.observed.shape, problem.mean_0.size
    F, Q, H = transition(problem), process(problem), design(problem)
    shift, observed = np.zeros((m, n)), problem.observed
    shift[:, problem.coupled] = problem.shift[:, :, 0]
    if column:
        shift[:, problem.coupled] += problem.shift[:, :, column]
        observed = observed + problem.observed_by[:, column - 1]
    engine = KalmanFilter(dim_x=n, dim_z=1)
    engine.x = problem.mean_0.copy()
    engine.P = problem.covariance_0.copy()
    means, covariances = np.empty((m, n)), np.empty((m, n, n))
    innovation, variance = np.full((m, p), np.nan), np.full((m, p), np.nan)
    log_likelihood = 0.0
    for k in range(m):
        for j in np.flatnonzero(np.isfinite(observed[k])):
            engine.update(observed[k, j], R=np.array([[problem.variance[k, j]]]), H=H[j : j + 1])
            innovation[k, j], variance[k, j] = float(engine.y.item()), float(engine.S.item())
            log_likelihood -= 0.5 * (math.log(2.0 * math.pi * variance[k, j]) + innovation[k, j] ** 2 / variance[k, j])
        means[k], covariances[k] = engine.x, engine.P
        if k < m - 1:
            engine.predict(u=shift[k], B=np.eye(n), F=F[k], Q=Q[k])
    # filterpy's RTS knows no shift: with x_k = s_k + o_k, o_{k+1} = F_k o_k + shift_k, the deviations s_k obey a
    # problem without one. It steps with Fs[k+1] and Qs[k+1], so both lists are moved by one.
    origin = np.zeros((m, n))
    for k in range(m - 1):
        origin[k + 1] = F[k] @ origin[k] + shift[k]
    smoothed, smoothed_covariances, _, _ = engine.rts_smoother(
        means - origin, covariances, Fs=[np.eye(n), *F[: m - 1]], Qs=[np.zeros((n, n)), *Q[: m - 1]], inv=np.linalg.inv
    )
    return Solution((smoothed + origin)[:, :, None], smoothed_covariances, innovation, variance, log_likelihood)

"""The smoother once more, by filterpy: slow, and for that independent.

filterpy 2 is frozen and only parts of it are right: `KalmanFilter` (linear) and its time-varying `rts_smoother` are;
the smoothers for its EKF and UKF are missing or wrong. So the estimator hands the same *linearised* problem to
either engine.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.estimate.smoother import Problem, Solution


def solve(problem: Problem) -> Solution:
    """Return what `pipeline.estimate.smoother.solve` returns, computed by ``filterpy.kalman.KalmanFilter``.

    Parameters
    ----------
    problem
        The state-space problem; m instants, n states, p kinds of measurement.

    Returns
    -------
    Solution
        Smoothed moments, innovations and the log-likelihood of the measurements.
    """
    from filterpy.kalman import KalmanFilter

    m, p = problem.observed.shape
    n = problem.mean_0.size
    engine = KalmanFilter(dim_x=n, dim_z=1)
    engine.x = problem.mean_0.copy()
    engine.P = problem.covariance_0.copy()
    means, covariances = np.empty((m, n)), np.empty((m, n, n))
    innovation, variance = np.full((m, p), np.nan), np.full((m, p), np.nan)
    log_likelihood = 0.0
    for k in range(m):
        for j in np.flatnonzero(np.isfinite(problem.observed[k])):
            engine.update(problem.observed[k, j], R=np.array([[problem.variance[k, j]]]), H=problem.design[j : j + 1])
            innovation[k, j], variance[k, j] = float(engine.y.item()), float(engine.S.item())
            log_likelihood -= 0.5 * (math.log(2.0 * math.pi * variance[k, j]) + innovation[k, j] ** 2 / variance[k, j])
        means[k], covariances[k] = engine.x, engine.P
        if k < m - 1:
            engine.predict(u=problem.shift[k], B=np.eye(n), F=problem.transition[k], Q=problem.process[k])
    smoothed, smoothed_covariances = _smooth(engine, problem, means, covariances)
    return Solution(smoothed, smoothed_covariances, innovation, variance, log_likelihood)


def _smooth(
    engine: object, problem: Problem, means: np.ndarray, covariances: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Smooth with filterpy's RTS, which knows no shift: it is moved into the state's own frame first.

    With x_k = s_k + o_k and o_{k+1} = F_k o_k + shift_k the deviations s_k obey a problem without shift.
    filterpy's `rts_smoother` steps with Fs[k+1] and Qs[k+1], so both lists are moved by one.
    """
    m, n = means.shape
    origin = np.zeros((m, n))
    for k in range(m - 1):
        origin[k + 1] = problem.transition[k] @ origin[k] + problem.shift[k]
    transitions = [np.eye(n), *problem.transition[: m - 1]]
    noises = [np.zeros((n, n)), *problem.process[: m - 1]]
    smoothed, smoothed_covariances, _, _ = engine.rts_smoother(  # type: ignore[attr-defined]
        means - origin, covariances, Fs=transitions, Qs=noises, inv=np.linalg.inv
    )
    return smoothed + origin, smoothed_covariances

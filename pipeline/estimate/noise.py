"""Noise levels of a mission: read off its own records, or at the maximum of likelihood."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from pipeline.estimate import smoother
from pipeline.estimate.linearise import Sources, Trajectory, linearise
from pipeline.estimate.series import Series, near
from pipeline.estimate.settings import Settings
from pipeline.vehicle import Polar

#: What is found by likelihood, with the 1-sigma of the logarithm around its value in `Settings`.
SEARCHED = {"sigma_w": 1.0, "tau_w": 0.7, "depth_noise": 1.0, "swell": 2.0, "stratification": 1.0}
#: Flight this long (s) before and after a manoeuvre says nothing of σ of w_w: what is left of the manoeuvre looks alike.
BEFORE, AFTER = 60.0, 120.0
#: The noise of depth (m) is not believed below this.
QUIET = 0.005


def noise_from(series: Series) -> Settings:
    """Return settings with the sensors' noise read off the high-frequency part of their own records."""
    depth_noise, _ = _noise_and_drift(series.time, series.depth, ~series.manoeuvre)
    pitch_noise, pitch_drift = _noise_and_drift(series.time, series.pitch, ~series.manoeuvre)
    return Settings(
        depth_noise=float(np.clip(depth_noise, 0.01, 1.0)),
        pitch_noise=float(np.clip(pitch_noise, np.radians(0.05), np.radians(2.0))),
        pitch_drift=float(np.clip(pitch_drift, np.radians(0.01) ** 2, np.radians(0.5) ** 2)),
    )


def likeliest(series: Series, polar: Polar, settings: Settings, at: Trajectory, speed: bool) -> Settings:
    """Return settings with σ and τ of w_w, swell and the noise of depth at the maximum of likelihood times prior.

    How much of the slow change of depth rate is the water's and how much is V's, the likelihood may hardly say. So
    σ of w_w is the root mean square over its posterior (log-normal, by the curvature at the maximum): what is not
    known of it widens the intervals.
    """
    calm = replace(series, manoeuvre=near(series.time, series.manoeuvre, BEFORE, AFTER))
    names = list(SEARCHED)
    median = np.log([getattr(settings, name) for name in names])
    spread = np.array(list(SEARCHED.values()))

    def cost(u: np.ndarray) -> float:
        trial = settings._replace(**dict(zip(names, np.exp(median + spread * u).tolist(), strict=True)))
        problem = linearise(calm, polar, trial, at, Sources(speed, fixes=False))
        return 0.5 * float(u @ u) - smoother.log_likelihood(problem)

    best = minimize(
        cost, np.zeros(len(names)), method="L-BFGS-B", bounds=[(-4.0, 4.0)] * len(names), options={"eps": 1e-3}
    )
    found = dict(zip(names, np.exp(median + spread * best.x).tolist(), strict=True))
    found["sigma_w"] *= float(np.exp(_variance(cost, best.x)[0] * spread[0] ** 2))
    found["depth_noise"] = max(found["depth_noise"], QUIET)
    return settings._replace(**{name: float(f"{value:.3g}") for name, value in found.items()})  # more is not known


def _variance(cost: Callable[[np.ndarray], float], at: np.ndarray) -> np.ndarray:
    """Return the variances of u by the curvature of `cost` at its minimum `at`; at most 1, that of the prior."""
    step, n = 0.2, at.size
    here = cost(at)
    unit = step * np.eye(n)
    ahead = np.array([cost(at + unit[i]) for i in range(n)])
    curvature = np.empty((n, n))
    for i in range(n):
        curvature[i, i] = ahead[i] + cost(at - unit[i]) - 2.0 * here
        for j in range(i):
            curvature[i, j] = curvature[j, i] = cost(at + unit[i] + unit[j]) - ahead[i] - ahead[j] + here
    value, vector = np.linalg.eigh(curvature / step**2)
    return np.asarray((vector**2) @ (1.0 / np.maximum(value, 1.0)))


def _noise_and_drift(time: np.ndarray, value: np.ndarray, where: np.ndarray) -> tuple[float, float]:
    """Return the 1-sigma of white noise and the random-walk intensity of a series with a linear trend.

    From third differences (a cubic cancels; 20 σ² for white noise) and from second differences over eight samples,
    both by their median absolute value.
    """
    known = np.isfinite(value) & where
    x, t = value[known], time[known]
    if x.size < 40:
        return 0.0, 0.0
    third = np.diff(x, 3)
    noise = float(np.median(np.abs(third))) / 0.6745 / np.sqrt(20.0)
    lag = 8
    bend = x[2 * lag :] - 2.0 * x[lag:-lag] + x[: -2 * lag]
    span = float(np.median(t[lag:] - t[:-lag]))
    total = (float(np.median(np.abs(bend))) / 0.6745) ** 2
    return noise, max(total - 6.0 * noise**2, 0.0) / max(2.0 * span, 1e-3)

"""Noise levels of a mission: read off its own records, or at the maximum of likelihood."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from pipeline.estimate import smoother
from pipeline.estimate.linearise import Settings, Trajectory, linearise
from pipeline.estimate.series import Series
from pipeline.vehicle import Polar

#: What is found by likelihood, with the 1-sigma of the logarithm around its value in `Settings`.
SEARCHED = {"sigma_w": 0.3, "depth_noise": 1.0, "swell": 2.0}
#: Depth alone cannot show water stiller than this (m/s): a slow change of V looks the same.
STILL = 0.009
#: Nor is its own noise (m) believed below this.
QUIET = 0.005


def noise_from(series: Series) -> Settings:
    """Return settings with the sensors' noise read off the high-frequency part of their own records."""
    depth_noise, _ = _noise_and_drift(series.time, series.depth, ~series.manoeuvre)
    pitch_noise, pitch_drift = _noise_and_drift(series.time, series.pitch, ~series.manoeuvre)
    return replace(
        Settings(),
        depth_noise=float(np.clip(depth_noise, 0.01, 1.0)),
        pitch_noise=float(np.clip(pitch_noise, np.radians(0.05), np.radians(2.0))),
        pitch_drift=float(np.clip(pitch_drift, np.radians(0.01) ** 2, np.radians(0.5) ** 2)),
    )


def likeliest(series: Series, polar: Polar, settings: Settings, at: Trajectory, use_speed: bool) -> Settings:
    """Return settings with the σ of w_w, swell and the noise of depth at the maximum of likelihood times prior.

    How much of the slow change of depth rate is the water's and how much is V's, the likelihood hardly says, so σ of
    w_w is not believed below `STILL`: intervals then hold either way.
    """
    names = list(SEARCHED)
    median = np.log([getattr(settings, name) for name in names])
    spread = np.array([SEARCHED[name] for name in names])

    def cost(u: np.ndarray) -> float:
        trial = replace(settings, **dict(zip(names, np.exp(median + spread * u).tolist(), strict=True)))
        problem = linearise(series, polar, trial, at, use_speed=use_speed, use_fixes=False)
        return 0.5 * float(u @ u) - smoother.log_likelihood(problem)

    simplex = np.vstack([np.zeros(len(names)), np.eye(len(names))])
    best = minimize(
        cost,
        simplex[0],
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": 200, "xatol": 0.05, "fatol": 0.1},
    )
    found = dict(zip(names, np.exp(median + spread * best.x).tolist(), strict=True))
    found |= {"sigma_w": max(found["sigma_w"], STILL), "depth_noise": max(found["depth_noise"], QUIET)}
    return replace(settings, **found)


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

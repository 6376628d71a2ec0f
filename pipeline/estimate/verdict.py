"""What may be said of an estimate: where it is observable, whether it is consistent, what a sensor says of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.estimate.series import LEVEL, Series

#: A speed is called observable when its 1-sigma is below this share of it.
OBSERVABLE = 0.2


def verdict(
    series: Series, speed: np.ndarray, speed_std: np.ndarray, steady: np.ndarray, *, depth_alone: bool
) -> np.ndarray:
    """Return for every record why its speed is unobservable, or "" where the data determine it; shape (m,).

    Parameters
    ----------
    series
        Measurements and flags.
    speed, speed_std
        Estimated speed and its 1-sigma.
    steady
        Where the pitch is steep enough for a glide.
    depth_alone
        Neither a speed sensor nor fixes are used: then powered level flight is unobservable whatever the filter says.
    """
    weak = ~(speed_std <= OBSERVABLE * speed)
    level = series.powered & (np.abs(series.pitch_guess) < LEVEL)
    reason = np.full(speed.size, "", dtype=object)
    reason[weak] = "the 1-sigma exceeds 20 % of the speed"
    reason[weak & series.manoeuvre] = "manoeuvre: no steady flight to borrow the polar from"
    reason[weak & ~steady] = "near level: depth carries no speed"
    reason[level & (weak | depth_alone)] = "powered and near level: depth carries no speed and no fixes determine it"
    reason[series.unmeasured] = "no depth or no pitch within two minutes"
    reason[series.surfaced] = "at the surface"
    return reason


def consistency(innovation: np.ndarray, series: Series) -> dict[str, Any]:
    """Return the mean normalised innovation squared of depth and pitch in steady flight, with its 95 % band.

    Parameters
    ----------
    innovation
        Normalised innovations of depth and pitch, shape (2, m), NaN where there is none.
    series
        Measurements and flags, m instants.
    """
    from scipy.stats import chi2

    result: dict[str, Any] = {}
    for name, normalised in zip(("depth", "pitch"), innovation, strict=True):
        nis = normalised[~series.manoeuvre] ** 2
        nis = nis[np.isfinite(nis)]
        if nis.size:
            low, high = chi2.ppf((0.025, 0.975), nis.size) / nis.size
            result[name] = {"nis": float(nis.mean()), "low": float(low), "high": float(high), "n": int(nis.size)}
    return result


def coverage(series: Series, speed: np.ndarray, speed_std: np.ndarray, seen: np.ndarray) -> dict[str, Any] | None:
    """Return how the estimate compares with a speed sensor, at the sensor's own instants; None without one."""
    both = seen & np.isfinite(series.speed)
    if not both.any():
        return None
    gap = speed[both] - series.speed[both]
    sigma = np.hypot(speed_std[both], series.speed_std[both])
    return {
        "n": int(both.sum()),
        "bias": float(gap.mean()),
        "rmse": float(np.sqrt(np.mean(gap**2))),
        "coverage95": float(np.mean(np.abs(gap) < 1.96 * sigma)),
    }

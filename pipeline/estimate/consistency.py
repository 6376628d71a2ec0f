"""Whether an estimate is consistent: its errors, where they can be seen, have the size and colour that it claims.

Four questions, after Bar-Shalom, Li & Kirubarajan (2001, *Estimation with Applications*, sec. 5.4):

- innovations: is their mean normalised square (NIS) one?
- innovations: are they white (Ljung & Box 1978, doi:10.1093/biomet/65.2.297)?
- predictions 1, 10 and 60 rows ahead, with no measurement in between: are they as good as their variance says?
- speed: does the 95 % interval hold a sensor's speed as often, where the estimate has not seen the sensor?

A mission is solved in parts. Of each a `Tally` of sums is kept, of a size that does not depend on the part; tallies
add, and `report` reads the answers off the sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from scipy.special import chdtrc, chdtri

from pipeline.estimate.kalman import predictions
from pipeline.estimate.problem import Problem, Solution
from pipeline.estimate.series import PAUSE

#: Rows ahead, and the least distance of the rows that predictions start from; no two of the same length overlap.
STEPS, STRIDE = (1, 10, 60), 20
#: Lags of the test for whiteness.
LAGS = 20
#: Correlation of successive innovations below this is called weak: it changes a 1-sigma by some per cent at most.
WEAK = 0.1
#: A size is called off in the sentence when it is outside its band and by more than this share; one of many bands
#: is missed by chance, and with many samples the smallest difference is outside.
FAR = 0.1
AS_PREDICTED = "as large as predicted"
#: Fewer samples than this say nothing.
FEWEST = 30
#: Units that predictions are reported in, with their size in SI.
UNITS = {"depth": ("m", 1.0), "pitch": ("deg", math.pi / 180.0), "speed": ("cm/s", 0.01)}


@dataclass(frozen=True)
class Tally:
    """Sums over a part of a mission; i instruments, s steps, lags 0 … L."""

    instruments: tuple[str, ...]
    #: (i, 5, 1 + L), over pairs of normalised innovations that far apart: how many, Σ(z + z'), Σ z z', and for
    #: squares Σ(z² + z'²), Σ z² z'²
    lagged: np.ndarray
    #: (i, s, 5), over predictions: how many, Σ error², Σ variance, Σ error²/variance, how many within 1.96 sigma
    ahead: np.ndarray
    #: (4,), over speeds by a sensor that was left out: how many, Σ gap, Σ gap², how many within 1.96 sigma
    sensor: np.ndarray

    def __add__(self, other: Tally) -> Tally:
        if self.instruments != other.instruments:
            raise ValueError(f"instruments: found {other.instruments}; expected {self.instruments}, as in the sum")
        sums = (self.lagged + other.lagged, self.ahead + other.ahead, self.sensor + other.sensor)
        return Tally(self.instruments, *sums)


@njit(cache=True, nogil=True)
def _lagged(z: np.ndarray, run: np.ndarray, sums: np.ndarray) -> None:
    """Add the sums of `Tally.lagged` over pairs in the same run."""
    for k in range(z.size):
        square = z[k] * z[k]
        for lag in range(min(sums.shape[1], k + 1)):
            if run[k - lag] != run[k]:
                break
            before = z[k - lag]
            sums[0, lag] += 1.0
            sums[1, lag] += z[k] + before
            sums[2, lag] += z[k] * before
            sums[3, lag] += square + before * before
            sums[4, lag] += square * before * before


def tally(
    problem: Problem,
    solution: Solution,
    time: np.ndarray,
    steady: np.ndarray,
    *,
    instruments: tuple[str, ...] = ("depth", "pitch"),
    held_out: np.ndarray | None = None,
) -> Tally:
    """Return the sums that a part of a mission adds.

    Parameters
    ----------
    problem, solution
        The last linear problem and what was found; m instants. Its first kinds of measurement are `instruments`.
    time
        Instants, s, shape (m,); a run of steady flight ends at a pause in them.
    steady
        Where flight is steady: no manoeuvre, not at the surface; shape (m,).
    instruments
        Names of the kinds of measurement to judge, keys of `UNITS`.
    held_out
        Speed less that of a sensor that was not used, and the 1-sigma of this, shape (2, m); NaN where either is
        not known. Nothing if left out.

    Returns
    -------
    Tally
        Sums over innovations and predictions in steady flight.
    """
    m = time.size
    broken = np.ones(m, dtype=bool)
    broken[1:] = ~(steady[1:] & steady[:-1]) | (np.diff(time) > PAUSE)
    run = np.cumsum(broken)
    ends = np.append(np.flatnonzero(broken)[1:] - 1, m - 1)
    last = np.where(steady, ends[run - 1], -1) if m else np.zeros(0, dtype=np.int64)
    error, variance = predictions(problem, STEPS, STRIDE, last)
    lagged = np.zeros((len(instruments), 5, 1 + LAGS))
    ahead = np.zeros((len(instruments), len(STEPS), 5))
    for i in range(len(instruments)):
        z = solution.innovation[:, i] / np.sqrt(solution.innovation_variance[:, i])
        seen = steady & np.isfinite(z)
        _lagged(z[seen], run[seen], lagged[i])
        for s in range(len(STEPS)):
            known = np.isfinite(error[:, s, i])
            gap, spread = error[known, s, i], variance[known, s, i]
            within = np.abs(gap) < 1.96 * np.sqrt(spread)
            ahead[i, s] = gap.size, np.sum(gap**2), np.sum(spread), np.sum(gap**2 / spread), np.sum(within)
    return Tally(instruments, lagged, ahead, _against(held_out))


def _against(held_out: np.ndarray | None) -> np.ndarray:
    """Return the sums of `Tally.sensor`."""
    if held_out is None:
        return np.zeros(4)
    gap, sigma = held_out[:, np.isfinite(held_out).all(axis=0)]
    return np.array([gap.size, gap.sum(), np.sum(gap**2), np.sum(np.abs(gap) < 1.96 * sigma)])


def report(total: Tally) -> dict[str, Any]:
    """Return what the sums say, in plain numbers, with a verdict in words on each.

    Parameters
    ----------
    total
        Sums over a whole mission.

    Returns
    -------
    dict
        ``innovations``, ``predictions`` (lists, one entry an instrument, or an instrument and a number of steps),
        ``sensor`` (None without one) and ``sentence``. Where there is too little, numbers are None with a ``reason``.
    """
    innovations = [
        {"instrument": name, **_innovations(lagged)}
        for name, lagged in zip(total.instruments, total.lagged, strict=True)
    ]
    ahead = [
        {"instrument": name, "unit": UNITS[name][0], "steps": step, **_prediction(sums, UNITS[name][1])}
        for name, rows in zip(total.instruments, total.ahead, strict=True)
        for step, sums in zip(STEPS, rows, strict=True)
    ]
    n, gap, square, within = total.sensor.tolist()
    sensor = None
    if n:
        sensor = {"n": int(n), "bias": gap / n, "rmse": math.sqrt(square / n), "coverage95": within / n}
    return {
        "innovations": innovations,
        "predictions": ahead,
        "sensor": sensor,
        "sentence": _sentence(innovations, ahead),
    }


def _innovations(sums: np.ndarray) -> dict[str, Any]:
    """Return NIS with its bands, and the test for whiteness."""
    n = int(sums[0, 0])
    if n < FEWEST:
        names = ("nis", "low", "high", "n_effective", "low_effective", "high_effective", "ljung_box", "p")
        nothing: dict[str, Any] = dict.fromkeys((*names, "greatest_correlation", "greatest_lag"))
        reason = f"{n} measurements in steady flight; at least {FEWEST} are needed"
        return {"n": n, **nothing, "lags": LAGS, "verdict": reason, "whiteness": reason, "reason": reason}
    nis = float(sums[2, 0]) / n
    low, high = _band(n)
    # successive squares that are alike count for less; Bartlett's weights keep the number positive
    squares = _correlations(sums[[0, 3, 4]])
    weights = 1.0 - np.arange(1, LAGS + 1) / (LAGS + 1.0)
    effective = n / max(1.0, 1.0 + 2.0 * float(weights @ squares))
    low_effective, high_effective = _band(effective)
    correlations = _correlations(sums[:3])
    statistic = (n + 2.0) / n * float(sums[0, 1:] @ correlations**2)
    return {
        "n": n,
        "nis": nis,
        "low": low,
        "high": high,
        "n_effective": effective,
        "low_effective": low_effective,
        "high_effective": high_effective,
        "verdict": _size(nis, low_effective, high_effective),
        "lags": LAGS,
        "ljung_box": statistic,
        **_whiteness(statistic, correlations),
        "reason": "",
    }


def _correlations(sums: np.ndarray) -> np.ndarray:
    """Return correlations at lags 1 … L from numbers of pairs, sums and sums of products, shape (3, 1 + L)."""
    count = np.maximum(sums[0], 1.0)
    mean = sums[1, 0] / (2.0 * count[0])
    products = sums[2] / count - mean * sums[1] / count + mean**2 * (sums[0] > 0.0)
    return np.asarray(products[1:] / products[0]) if products[0] > 0.0 else np.zeros(sums.shape[1] - 1)


def _band(n: float) -> tuple[float, float]:
    """Return the 95 % band of a mean of `n` squares of independent standard normal numbers."""
    low, high = chdtri(n, (0.975, 0.025)) / n
    return float(low), float(high)


def _size(square: float, low: float, high: float) -> str:
    if low <= square <= high:
        return AS_PREDICTED
    share = 100.0 * (math.sqrt(square) - 1.0)
    return f"{abs(share):.0f} % {'larger' if square > high else 'smaller'} than predicted"


def _whiteness(statistic: float, correlations: np.ndarray) -> dict[str, Any]:
    """Return the p-value of Ljung and Box's statistic, and what it means."""
    p = float(chdtrc(correlations.size, statistic))
    lag = int(np.argmax(np.abs(correlations)))
    greatest = float(correlations[lag])
    if p >= 0.05:
        words = "white"
    elif abs(greatest) < WEAK:
        words = "not quite white"
    else:
        words = "correlated"
    return {"p": p, "greatest_correlation": greatest, "greatest_lag": lag + 1, "whiteness": words}


def _prediction(sums: np.ndarray, unit: float) -> dict[str, Any]:
    """Return how good predictions some steps ahead were, beside how good they were said to be."""
    n = int(sums[0])
    if n < FEWEST:
        names = ("rms_error", "predicted_rms", "normalised", "low", "high", "coverage95")
        reason = f"{n} stretches of steady flight as long; at least {FEWEST} are needed"
        return {"n": n, **dict.fromkeys(names), "verdict": reason, "reason": reason}
    low, high = _band(n)
    normalised = float(sums[3]) / n
    return {
        "n": n,
        "rms_error": math.sqrt(float(sums[1]) / n) / unit,
        "predicted_rms": math.sqrt(float(sums[2]) / n) / unit,
        "normalised": normalised,
        "low": low,
        "high": high,
        "coverage95": float(sums[4]) / n,
        "verdict": _size(normalised, low, high),
        "reason": "",
    }


def _sentence(innovations: list[dict[str, Any]], ahead: list[dict[str, Any]]) -> str:
    """Return one sentence on the whole; what matters for intervals is size, of innovations and far ahead."""
    judged = [row for row in innovations if row["nis"] is not None]
    if not judged:
        return "Nothing can be said of its consistency: too little steady flight was measured."
    rows = [("innovations", row["instrument"], row["nis"], row["verdict"]) for row in judged]
    rows += [
        (f"predictions {row['steps']} rows ahead", row["instrument"], row["normalised"], row["verdict"])
        for row in ahead
        if row["normalised"] is not None
    ]
    off = [row for row in rows if row[3] != AS_PREDICTED and abs(math.sqrt(row[2]) - 1.0) > FAR]
    coloured = [row["instrument"] for row in judged if row["whiteness"] == "correlated"]
    colour = f" Innovations of {' and '.join(coloured)} are correlated in time." if coloured else ""
    if not off:
        return f"It is consistent: its errors are as large as it predicts, within {100 * FAR:.0f} %." + colour
    kind, name, _, words = max(off, key=lambda row: abs(math.log(max(row[2], 1e-12))))
    return f"It is not quite consistent: {kind} of {name} are {words}, the farthest off of all looked at." + colour

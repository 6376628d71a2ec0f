"""Covariance of block means: the vertical water velocity that neighbouring blocks share.

The water's vertical velocity is a Gauss–Markov process, covariance σ² exp(−|Δt|/τ). Its mean over a block is what
stands between a measured depth rate and the depth rate through water, and blocks closer than a few τ share it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Beyond this many correlation times two blocks are taken as independent (correlation below 1e-5).
REACH = 12.0

#: Default strength and correlation time of the vertical water velocity where the estimator gives none.
WATER = {"sigma_w": 0.01, "tau_w": 300.0}


@dataclass(frozen=True)
class Noise:
    """Covariance of n block means in time order, as the lower band of a symmetric matrix.

    Attributes
    ----------
    band
        Shape (k + 1, n): ``band[d, i]`` is the covariance of blocks i and i + d.
    """

    band: Array

    def variance(self, weights: ArrayLike) -> float:
        """Return the variance of the weighted sum of the block means, `weights` of shape (n,)."""
        w = np.asarray(weights, dtype=np.float64)
        total = float(np.sum(self.band[0] * w * w))
        for lag in range(1, self.band.shape[0]):
            total += 2.0 * float(np.sum(self.band[lag, :-lag] * w[:-lag] * w[lag:]))
        return total

    def scaled(self, factors: ArrayLike) -> Noise:
        """Return the covariance of the block means multiplied each by its factor, shape (n,)."""
        f = np.asarray(factors, dtype=np.float64)
        band = self.band * f
        for lag in range(band.shape[0]):
            band[lag, : f.size - lag] *= f[lag:]
        return Noise(band)

    def whitener(self) -> Whitener:
        """Return the inverse of the lower Cholesky factor, as something that can be applied.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the covariance is not positive definite.
        """
        from scipy.linalg import cholesky_banded

        return Whitener(cholesky_banded(self.band, lower=True))


@dataclass(frozen=True)
class Whitener:
    """Lower Cholesky factor of a banded covariance, shape (k + 1, n)."""

    factor: Array

    def __call__(self, values: Array) -> Array:
        """Return L⁻¹ `values`, for `values` of shape (n,) or (n, m)."""
        from scipy.linalg.lapack import dtbtrs

        columns = values.reshape(values.shape[0], -1)
        if columns.shape[1] == 0:
            return values
        white, _info = dtbtrs(self.factor, columns, uplo="L")
        return np.asarray(white, dtype=np.float64).reshape(values.shape)


def water(start: ArrayLike, end: ArrayLike, sigma: float, tau: float) -> Noise:
    """Return the covariance of the block means of a Gauss–Markov process.

    With a = τ(1 − exp(−T/τ)) the mean over a block of length T has variance 2σ²τ(T − a)/T², and two blocks with a
    gap g between them the covariance σ² a₁ a₂ exp(−g/τ)/(T₁T₂): the double integral of σ² exp(−|t − t'|/τ).

    Parameters
    ----------
    start, end
        Bounds of the blocks, s, shape (n,), in time order and not overlapping.
    sigma
        Standard deviation of the process, m/s.
    tau
        Correlation time, s.

    Returns
    -------
    Noise
        Covariance in (m/s)².
    """
    begin = np.asarray(start, dtype=np.float64)
    finish = np.asarray(end, dtype=np.float64)
    length = np.maximum(finish - begin, 1e-9)
    decay = tau * -np.expm1(-length / tau)
    short = length < 1e-4 * tau  # T - a loses its digits there; the mean is the process itself
    own = np.where(short, 1.0, 2.0 * tau * (length - decay) / length**2)
    width = _bandwidth(begin, finish, REACH * tau)
    band = np.zeros((width + 1, begin.size))
    band[0] = sigma**2 * own
    share = decay / length
    for lag in range(1, width + 1):
        gap = np.maximum(begin[lag:] - finish[:-lag], 0.0)
        near = gap < REACH * tau
        band[lag, :-lag] = np.where(near, sigma**2 * share[lag:] * share[:-lag] * np.exp(-gap / tau), 0.0)
    return Noise(band)


def _bandwidth(start: Array, end: Array, reach: float) -> int:
    """Return how many later blocks at most begin within `reach` of a block's end."""
    if start.size < 2:
        return 0
    last = np.searchsorted(start, end + reach, side="left") - 1
    return int(max(0, np.max(last - np.arange(start.size))))


def with_measurement(noise: Noise, std: ArrayLike) -> Noise:
    """Return `noise` plus independent measurement errors of 1-sigma `std`, shape (n,)."""
    band = noise.band.copy()
    band[0] += np.square(np.asarray(std, dtype=np.float64))
    return Noise(band)


def water_of(settings: Mapping[str, Any] | None) -> tuple[float, float]:
    """Return σ_w [m/s] and τ_w [s] of the estimator, or their defaults."""
    given = settings or {}
    out = []
    for name, default in WATER.items():
        value = given.get(name)
        out.append(float(value) if isinstance(value, int | float) and math.isfinite(value) else default)
    return out[0], out[1]

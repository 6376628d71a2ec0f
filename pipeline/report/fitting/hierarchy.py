"""What several missions say together of a coefficient: mean of the vehicle, scatter between missions, drift in time.

Random effects: mission i has a coefficient θ_i of its own, scattered about the vehicle's, X β, by τ; what its data say
of it is y_i, with a covariance S, between missions that of what they borrowed in common: y ~ N(X β, S + τ² 1). β is
integrated analytically and τ on a grid, so that the intervals hold for two missions as well as for twenty. The prior
of τ is half-Cauchy (Gelman 2006, doi:10.1214/06-BA117A), its scale what is known of the vehicle: missions are not
expected to differ by much more than published values do. With nothing but the likelihood of τ, marginal in β, it would
be restricted maximum likelihood.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Values of τ that are summed over.
GRID = 600
#: By so much must Schwarz's criterion fall for a drift in time: positive evidence (Kass and Raftery 1995).
EVIDENCE = 2.0
#: Least missions for a drift: three always lie near a line.
LEAST_DRIFT = 4
LOG_2PI = math.log(2.0 * math.pi)


class Prior(NamedTuple):
    """What is known of the vehicle's coefficient beforehand: mean and 1-sigma, applied once."""

    mean: float
    std: float


class Spread(NamedTuple):
    """A number with its uncertainty: best value, 1-sigma (half of the middle 68.3 %), ends of the 95 % interval."""

    value: float
    std: float
    low: float
    high: float


class Pooled(NamedTuple):
    """What several missions say together.

    Attributes
    ----------
    vehicle
        The vehicle's coefficient; at the mean of the times of the missions if it drifts.
    next
        What a further mission is expected to have, then.
    scatter
        τ, the 1-sigma between missions; its interval is the shortest.
    drift
        Change of the vehicle's coefficient per unit of time; None where it was not asked for.
    missions
        Each mission's own, shrunken towards the vehicle's.
    """

    vehicle: Spread
    next: Spread
    scatter: Spread
    drift: Spread | None
    missions: tuple[Spread, ...]


class Conditional(NamedTuple):
    """What is known where the scatter is: at each of g values of τ.

    Attributes
    ----------
    log_likelihood
        Of τ, β integrated over, shape (g,): restricted likelihood where there is no prior.
    log_maximum
        Of τ with β at its best, shape (g,).
    mean, covariance
        Of β, shapes (g, p) and (g, p, p).
    """

    log_likelihood: Array
    log_maximum: Array
    mean: Array
    covariance: Array


def conditional(
    value: Array, covariance: Array, scatter: Array, *, time: Array | None = None, prior: Prior | None = None
) -> Conditional:
    """Return likelihood and regression coefficients at given scatter between missions.

    Parameters
    ----------
    value
        What the data of each mission say, shape (n,).
    covariance
        Of that, shape (n, n).
    scatter
        Values of τ, shape (g,).
    time
        Of each mission, shape (n,), centred; None for no drift.
    prior
        Of the vehicle's coefficient.
    """
    size, axes = np.linalg.eigh(covariance)
    y, design = axes.T @ value, axes.T @ _design(value.size, time)
    weight = 1.0 / (size + scatter[:, None] ** 2)
    precision = np.einsum("gn,np,nq->gpq", weight, design, design)
    right = np.einsum("gn,np,n->gp", weight, design, y)
    square = weight @ y**2
    best = np.linalg.solve(precision, right[..., None])[..., 0]
    log_width = 0.5 * np.log(weight).sum(axis=1) - 0.5 * value.size * LOG_2PI
    log_maximum = log_width - 0.5 * (square - np.einsum("gp,gp->g", right, best))
    if prior is not None:
        precision[:, 0, 0] += prior.std**-2
        right[:, 0] += prior.mean / prior.std**2
        square = square + (prior.mean / prior.std) ** 2
    variance = np.linalg.inv(precision)
    mean = np.einsum("gpq,gq->gp", variance, right)
    _sign, log_determinant = np.linalg.slogdet(precision)
    log_likelihood = log_width - 0.5 * (log_determinant + square - np.einsum("gp,gp->g", right, mean))
    return Conditional(log_likelihood, log_maximum, mean, variance)


def pool(
    value: Array, covariance: Array, scale: float, *, time: Array | None = None, prior: Prior | None = None
) -> Pooled:
    """Return what several missions say together of a coefficient.

    Parameters
    ----------
    value, covariance, time, prior
        As in `conditional`; two missions or more.
    scale
        Median of the prior of τ.

    Raises
    ------
    ValueError
        If there is one mission only.
    """
    if value.size < 2:
        raise ValueError(f"found {value.size} mission; expected two or more")
    tau, log_prior = _grid(np.sqrt(np.diag(covariance)), scale)
    found = conditional(value, covariance, tau, time=time, prior=prior)
    weight = found.log_likelihood + log_prior
    chance = np.exp(weight - weight.max())
    chance /= chance.sum()
    mean, std = found.mean, np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    own_mean, own_std = _shrunken(value, covariance, tau, found, _design(value.size, time))
    return Pooled(
        _mixture(chance, mean[:, 0], std[:, 0]),
        _mixture(chance, mean[:, 0], np.hypot(std[:, 0], tau)),
        _shortest(tau, chance),
        None if time is None else _mixture(chance, mean[:, 1], std[:, 1]),
        tuple(_mixture(chance, own_mean[:, i], own_std[:, i]) for i in range(value.size)),
    )


def homogeneity(value: Array, covariance: Array) -> tuple[float, float]:
    """Return Cochran's Q of the missions, and its probability were they all of one coefficient.

    Cochran (1954), doi:10.2307/3001666, with the covariance between missions.
    """
    from scipy.special import chdtrc

    inverse = np.linalg.inv(covariance)
    left = value - inverse.sum(axis=0) @ value / inverse.sum()
    statistic = float(left @ inverse @ left)
    return statistic, float(chdtrc(value.size - 1, statistic))


def evidence(value: Array, covariance: Array, time: Array, scale: float) -> float:
    """Return by how much Schwarz's criterion changes if the vehicle's coefficient may drift in time; minus is for it.

    Parameters
    ----------
    value, covariance, time, scale
        As in `pool`.
    """
    tau, _prior = _grid(np.sqrt(np.diag(covariance)), scale)
    without, drifting = (
        float(np.max(conditional(value, covariance, tau, time=each).log_maximum)) for each in (None, time)
    )
    return -2.0 * (drifting - without) + math.log(value.size)


def _design(n: int, time: Array | None) -> Array:
    return np.ones((n, 1)) if time is None else np.column_stack([np.ones(n), time])


def _grid(std: Array, scale: float) -> tuple[Array, Array]:
    """Return values of τ, dense below the 1-sigma of the missions and reaching far beyond, and log prior weights."""
    dense = min(float(np.median(std)), scale)
    tau = dense * np.tan(0.5 * math.pi * (np.arange(GRID) + 0.5) / GRID)
    return tau, np.log1p((tau / dense) ** 2) - np.log1p((tau / scale) ** 2)


def _shrunken(value: Array, covariance: Array, tau: Array, found: Conditional, design: Array) -> tuple[Array, Array]:
    """Return mean and 1-sigma of each mission's own coefficient at each τ, shapes (g, n)."""
    size, axes = np.linalg.eigh(covariance)
    pull = size / (size + tau[:, None] ** 2)  # (g, n), along the axes
    left = (value - found.mean @ design.T) @ axes
    mean = value - (pull * left) @ axes.T
    kept = np.einsum("in,gn,in->gi", axes, size * (1.0 - pull), axes)
    by_vehicle = np.einsum("in,gn,np->gip", axes, pull, axes.T @ design)
    variance = kept + np.einsum("gip,gpq,giq->gi", by_vehicle, found.covariance, by_vehicle)
    return mean, np.sqrt(variance)


def _mixture(chance: Array, mean: Array, std: Array) -> Spread:
    """Return the mean of a mixture of normal distributions, with its 1-sigma and 95 % interval."""
    from scipy.special import ndtr

    shares = np.array([0.025, 0.15866, 0.84134, 0.975])
    low = np.full(shares.size, np.min(mean - 9.0 * std))
    high = np.full(shares.size, np.max(mean + 9.0 * std))
    for _ in range(45):
        middle = 0.5 * (low + high)
        below = ndtr((middle[:, None] - mean) / std) @ chance < shares
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return Spread(float(chance @ mean), float(0.5 * (high[2] - high[1])), float(high[0]), float(high[3]))


def _shortest(tau: Array, chance: Array) -> Spread:
    """Return median and 1-sigma of the scatter, and its shortest 95 % interval, which may begin at zero."""
    below = np.concatenate([[0.0], np.cumsum(chance)])
    edges = np.concatenate([[0.0], np.sqrt(tau[1:] * tau[:-1]), tau[-1:]])
    starts = edges[below <= 0.05]
    ends = np.interp(below[below <= 0.05] + 0.95, below, edges)
    k = int(np.argmin(ends - starts))
    low, median, high = np.interp([0.15866, 0.5, 0.84134], below, edges).tolist()
    return Spread(median, 0.5 * (high - low), float(starts[k]), float(ends[k]))

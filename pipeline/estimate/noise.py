"""Noise levels of a mission: read off its own records, or at the maximum of likelihood."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np
from scipy.optimize import brentq, minimize

from pipeline.estimate import kalman
from pipeline.estimate.gyro import walks
from pipeline.estimate.linearise import Sources, Trajectory, follow, linearise
from pipeline.estimate.problem import Problem
from pipeline.estimate.series import Series
from pipeline.estimate.settings import Noise, Settings
from pipeline.vehicle import Polar

A = TypeVar("A")
B = TypeVar("B")

#: What is found by likelihood, with the 1-sigma of the logarithm around its value in `Settings`; σ and τ of w_w first.
SEARCHED = {"sigma_w": 0.8, "tau_w": 0.7, "unsteadiness": 1.0, "depth_noise": 1.0, "swell": 2.0}
#: The search ends when a step gains less than this share of the logarithm of likelihood; slopes are read off steps of
#: this size.
ENOUGH, SLIGHT = 1e-8, 1e-3
#: The least variance that a search is believed to have guessed, over that of what was known before; and by how much the
#: logarithm of likelihood changes over steps that its curvature is read off.
TINY, RISE = 1e-6, 0.05
#: Where the posterior of a variance ends, in 1-sigma of its logarithm.
TAIL = 8.0
#: No level is farther from its median than this many 1-sigma.
BOUND = 4.0
#: Median of σ of w_w (m/s) before the search.
WATER = 0.015
#: What is left of a manoeuvre looks like the water's motion: the search leaves out this much time (s) after one and
#: before one, besides the margins of `Series`, but no more than this share of the flight between two.
SETTLING, LEADING, SHARE = 75.0, 45.0, 0.25
#: Noise is read off at least this many samples; the ordinary one counts as much as so many.
FEWEST, ORDINARY = 20, 100.0
#: Its random walk shows in second differences over one of so many samples.
LAGS = (8, 4, 2)
#: Bounds of the noise of pitch (rad) and of its random walk (rad²/s) as they are read off.
QUIETEST = (math.radians(0.05), math.radians(0.01) ** 2)
LOUDEST = (math.radians(2.0), math.radians(0.5) ** 2)
#: Noise of depth (m) and of pitch (rad) are not believed below these.
QUIET, QUIET_PITCH = 0.005, math.radians(0.01)
#: An innovation beyond this many standard deviations says nothing of their level; and the logarithm by which the noise
#: of depth may be off.
OUTLYING, FARTHEST = 6.0, 0.7


class Each(Protocol):
    """How something is done for each of some items, independent of each other: `map`, or that of a pool of threads."""

    def __call__(self, do: Callable[[A], B], items: Iterable[A], /) -> Iterable[B]:
        """Return the results in the order of `items`."""


def noise_from(series: Series) -> Settings:
    """Return settings with the sensors' noise read off the high-frequency part of their own records."""
    calm, usual = ~series.manoeuvre, Settings()
    depth_noise, _, _ = _noise_and_drift(series.time, series.depth, calm, (usual.depth_noise, 0.0))
    pitch_noise, pitch_drift, count = _noise_and_drift(
        series.time, series.pitch, calm, (usual.pitch_noise, usual.pitch_drift)
    )
    found = np.clip((pitch_noise, pitch_drift), QUIETEST, LOUDEST)
    said = count / (count + ORDINARY)
    pitch_noise, pitch_drift = (found**said * np.array((usual.pitch_noise, usual.pitch_drift)) ** (1.0 - said)).tolist()
    left = walks(series.time, series.pitch, series.turn, series.manoeuvre, ~series.afloat, pitch_noise)
    return Settings(
        depth_noise=float(np.clip(depth_noise, 0.01, 1.0)),
        pitch_noise=pitch_noise,
        turn_drift=left.steady,
        turn_drift_manoeuvre=left.manoeuvre,
        pitch_drift=pitch_drift,
    )


def likeliest(
    series: Series, polar: Polar, settings: Settings, at: Trajectory, speed: bool, each: Each = map
) -> tuple[Settings, np.ndarray]:
    """Return settings with the noise levels `SEARCHED` at their most probable values, and what is open of those.

    As from `most_probable`, by the kinematic model along the trajectory `at`; in manoeuvres V may be anything, lest
    what the vehicle does be taken for the water's motion.
    """
    calm = replace(series, manoeuvre=series.manoeuvre | _unsettled(series.time, series.manoeuvre))
    settings, along = settings._replace(sigma_w=WATER), follow(calm, polar, at)

    def log_likelihood(trial: Settings) -> float:
        free = trial._replace(speed_drift_manoeuvre=trial.speed_drift_surface)
        return kalman.log_likelihood(linearise(calm, along, free, Sources(speed, fixes=False)))

    return most_probable(settings, settings, SEARCHED, log_likelihood, each)


def most_probable(
    start: Settings,
    median: Settings,
    searched: Mapping[str, float],
    log_likelihood: Callable[[Settings], float],
    each: Each = map,
) -> tuple[Settings, np.ndarray]:
    """Return settings with some noise levels at the maximum of likelihood times prior, and what is open of those.

    How much of a slow change of depth rate is the water's and how much is V's, the likelihood may hardly say. So where
    the water is searched, 1-sigmas are means over their posterior (see `mean_over_mode`) in place of the values at the
    maximum: σ² of w_w; σ²τ, on which its mean over a long glide depends; and V's unsteadiness. What is not known
    of them widens the intervals; how far the estimate itself moves with them is for `moved` to tell.

    Parameters
    ----------
    start
        Where the search begins; all that is not searched stays.
    median
        Medians of the prior.
    searched
        1-sigma of the logarithm of each of k levels; σ and τ of w_w are first, or absent.
    log_likelihood
        Of the measurements at any settings.
    each
        How it is asked for at several settings.

    Returns
    -------
    settings : Settings
        Noise levels.
    covariance : ndarray
        Of the logarithms of those searched, shape (k, k); (0, 0) where the water is not among them.
    """
    names, spread = list(searched), np.array(list(searched.values()))
    middle, first = (np.log([getattr(levels, name) for name in names]) for levels in (median, start))

    def levels(u: np.ndarray) -> dict[str, float]:
        return dict(zip(names, np.exp(middle + spread * u).tolist(), strict=True))

    def cost(u: np.ndarray) -> float:
        return 0.5 * float(u @ u) - log_likelihood(start._replace(**levels(u)))

    def cost_and_slope(u: np.ndarray) -> tuple[float, np.ndarray]:
        steps = np.where(u + SLIGHT > BOUND, -SLIGHT, SLIGHT)
        here, *there = each(cost, [u, *(u + np.diag(steps))])
        return here, (np.array(there) - here) / steps

    best = minimize(
        cost_and_slope,
        (first - middle) / spread,
        method="L-BFGS-B",
        jac=True,
        bounds=[(-BOUND, BOUND)] * len(names),
        options={"ftol": ENOUGH},
    )
    found = levels(best.x)
    if "sigma_w" not in found:
        return start._replace(**found), np.empty((0, 0))
    open_ = covariance(cost, best.x, best.hess_inv.todense(), each) * np.outer(spread, spread)
    strength, diffusion = np.zeros((2, len(names)))
    strength[0], diffusion[:2] = 2.0, (2.0, 1.0)
    growth = mean_over_mode(strength, spread, open_)
    found["sigma_w"] *= growth**0.5
    found["tau_w"] *= mean_over_mode(diffusion, spread, open_) / growth
    if "unsteadiness" in found:
        k = names.index("unsteadiness")
        found["unsteadiness"] *= mean_over_mode(np.eye(len(names))[k], spread, open_)
    return start._replace(**found), open_


def mean_over_mode(powers: np.ndarray, spread: np.ndarray, covariance: np.ndarray) -> float:
    """Return by how much a variance exceeds its value where noise levels are most probable if its 1-sigma is the mean.

    That is over the posterior: intervals are nearly as wide as 1-sigmas, not variances, are large. The likelihood of a
    variance is that of an inverse gamma, which falls off slowly towards large ones: by few correlation times they are
    excluded less than a log-normal of the same curvature would say. The posterior is that times a log-normal prior, of
    the curvature that was found.

    Parameters
    ----------
    powers
        The variance is the product of the k levels to these powers.
    spread
        1-sigma of the logarithms before.
    covariance
        Of the logarithms, by the curvature of the posterior at its mode, shape (k, k).
    """
    before, after = float(powers**2 @ spread**2), float(powers @ covariance @ powers)
    fall = max(1.0 / after - 1.0 / before, 0.0)
    x = math.sqrt(after) * np.linspace(-TAIL, TAIL, 401)
    logarithm = -0.5 * x**2 / before - fall * (x + np.exp(-x))
    weight = np.exp(logarithm - logarithm.max())
    return float((np.sum(weight * np.exp(0.5 * x)) / np.sum(weight)) ** 2)


def levelled(settings: Settings, steady: np.ndarray, problem_of: Callable[[Settings], Problem]) -> Settings:
    """Return `settings` with noise of depth and pitch such that innovations in steady flight are as large as predicted.

    Levels read off quick changes, or most probable along a first trajectory, are not quite those of the last one. Of
    pitch, noise and random walk keep their ratio, so that it is smoothed as before.

    Parameters
    ----------
    settings
        Noise levels found.
    steady
        Where flight is steady, boolean of shape (m,).
    problem_of
        Gives the problem at any settings; depth and pitch are its first kinds of measurement.
    """

    def sizes(trial: Settings) -> list[float]:
        found, variance = kalman.innovations(problem_of(trial))
        square = found[steady, :2, 0] ** 2 / variance[steady, :2]
        counted = [each[each < OUTLYING**2] for each in square.T]
        return [float(np.mean(each)) if each.size >= FEWEST else 1.0 for each in counted]

    def pitch_levelled(settings: Settings) -> Settings:
        by = max(sizes(settings)[1], (QUIET_PITCH / settings.pitch_noise) ** 2)
        moves = {name: by * getattr(settings, name) for name in ("pitch_drift", "turn_drift")}
        return settings._replace(pitch_noise=by**0.5 * settings.pitch_noise, **moves)

    def excess(logarithm: float) -> float:
        return sizes(settings._replace(depth_noise=math.exp(logarithm)))[0] - 1.0

    settings = pitch_levelled(settings)
    here = math.log(settings.depth_noise)
    low, high = max(here - FARTHEST, math.log(QUIET)), here + FARTHEST
    if excess(low) > 0.0 > excess(high):  # else it is not the noise of depth that is amiss
        here = brentq(excess, low, high, xtol=0.005)
    return pitch_levelled(settings._replace(depth_noise=math.exp(here)))


def rounded(settings: Settings, names: Sequence[str]) -> Settings:
    """Return `settings` with three digits of the levels `names`: more is not known of them, and rounding stays out."""
    return settings._replace(**{name: float(f"{getattr(settings, name):.3g}") for name in names})


def moved(settings: Settings, names: Sequence[str], covariance: np.ndarray) -> tuple[Settings, Settings]:
    """Return `settings` with σ of w_w 1-sigma higher, and with τ so at the same σ, and all that goes along with them.

    Parameters
    ----------
    settings
        Noise levels found.
    names
        Those that were searched, σ and τ of w_w first; k of them.
    covariance
        Of their logarithms, shape (k, k).
    """
    factors = np.exp(np.linalg.cholesky(covariance)[:, :2]).T.tolist()
    sigma, tau = (
        settings._replace(**{name: getattr(settings, name) * by for name, by in zip(names, axis, strict=True)})
        for axis in factors
    )
    return sigma, tau


def fill_left_open(noise: Noise, mean: np.ndarray, solve: Callable[[Settings], np.ndarray]) -> None:
    """Fill the last columns of `mean` with its changes when noise levels are moved along what is open of them.

    Parameters
    ----------
    noise
        With k axes.
    mean
        Smoothed states at ``noise.settings``, and room behind, shape (m, n, 1 + c + k).
    solve
        Gives the smoothed states, shape (m, n), at other settings.
    """
    for column, settings in enumerate(noise.moved, mean.shape[2] - len(noise.moved)):
        np.subtract(solve(settings), mean[:, :, 0], out=mean[:, :, column])


def _unsettled(time: np.ndarray, manoeuvre: np.ndarray) -> np.ndarray:
    """Return where steady flight has just begun or is about to end, boolean of shape (m,)."""
    unsettled = np.zeros(time.size, dtype=bool)
    bounds = np.flatnonzero(np.diff(~manoeuvre, prepend=False, append=False))
    for first, last in zip(bounds[::2], bounds[1::2], strict=True):
        clock = time[first:last]
        most = SHARE * (clock[-1] - clock[0])
        unsettled[first:last] = (clock - clock[0] < min(SETTLING, most)) | (clock[-1] - clock < min(LEADING, most))
    return unsettled


def covariance(cost: Callable[[np.ndarray], float], at: np.ndarray, guess: np.ndarray, each: Each = map) -> np.ndarray:
    """Return the covariance of u by the curvature of `cost` at its minimum; at most that of the prior, 1; shape (k, k).

    Differences are central, along the axes of a guess at that covariance, and over steps in which the cost rises by
    about `RISE`: along the axes of u a valley that is steep one way and flat another would be told by differences of
    numbers that are all large.

    Parameters
    ----------
    cost
        Minus the logarithm of likelihood times prior of u, shape (k,), whose prior is standard normal.
    at
        The minimum, shape (k,).
    guess
        The search's own estimate of the covariance, shape (k, k).
    each
        How the cost is asked for at several u.
    """
    n = at.size
    spread, vector = np.linalg.eigh(guess)
    axes = vector * np.sqrt(np.clip(spread, TINY, 1.0))
    for last in (False, True):
        here, *beside = each(cost, [at, *(at + axes.T), *(at - axes.T)])
        single = np.array(beside[:n]) + np.array(beside[n:]) - 2.0 * here
        if not last:
            axes = axes * np.sqrt(2.0 * RISE / np.maximum(single, np.sum(axes**2, axis=0)))
    i, j = np.tril_indices(n, -1)
    both = (axes[:, i] + axes[:, j]).T
    double = np.sum(np.reshape(list(each(cost, [*(at + both), *(at - both)])), (2, -1)), axis=0) - 2.0 * here
    curvature = np.diag(single)
    curvature[i, j] = curvature[j, i] = 0.5 * (double - single[i] - single[j])
    inverse = np.linalg.inv(axes)
    value, vector = np.linalg.eigh(inverse.T @ curvature @ inverse)
    return np.asarray((vector / np.maximum(value, 1.0)) @ vector.T)


def _noise_and_drift(
    time: np.ndarray, value: np.ndarray, where: np.ndarray, usual: tuple[float, float]
) -> tuple[float, float, int]:
    """Return the 1-sigma of white noise and the random-walk intensity of a series with a linear trend, and of how many.

    From third differences (a cubic cancels) and from second differences over L samples, both by their median absolute
    value: white noise of variance r and a walk of q a sample give 20 r + 6 q and 6 r + 2 L q. Of stretches of samples
    `where` flight is steady, L as long as enough of them are; of all samples if those are few; `usual` if all are few.
    """
    known = np.isfinite(value)
    x, t, calm = value[known], time[known], where[known]
    if np.sum(_unbroken(calm, 3)) < FEWEST:
        calm = np.ones_like(calm)
    if np.sum(_unbroken(calm, 3)) < FEWEST:
        return *usual, 0
    lag = next((lag for lag in LAGS if np.sum(_unbroken(calm, 2 * lag)) >= FEWEST), LAGS[-1])
    short = (float(np.median(np.abs(np.diff(x, 3)[_unbroken(calm, 3)]))) / 0.6745) ** 2
    bend = x[2 * lag :] - 2.0 * x[lag:-lag] + x[: -2 * lag]
    within = _unbroken(calm, 2 * lag)
    long = (float(np.median(np.abs(bend[within]))) / 0.6745) ** 2
    step = max(float(np.median((t[2 * lag :] - t[: -2 * lag])[within])) / (2 * lag), 1e-3)
    walk = max((20.0 * long - 6.0 * short) / (20.0 * 2.0 * lag - 36.0), 0.0)
    return float(np.sqrt(max(short - 6.0 * walk, 0.0) / 20.0)), walk / step, int(calm.sum())


def _unbroken(calm: np.ndarray, span: int) -> np.ndarray:
    """Return which samples, but the last `span`, are calm and so many after them, boolean of shape (n - span,)."""
    past = np.cumsum(~calm)
    return np.asarray(calm[:-span] & (past[span:] == past[:-span]))

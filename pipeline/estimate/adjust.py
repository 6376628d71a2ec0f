"""Parameters of the force model adjusted to the depth rate: maximum of likelihood times prior by the filter itself.

Filter-error method (Maine & Iliff 1985, NASA RP-1138): the innovations of the filter, weighted by their variance, are
made smallest by Gauss–Newton steps; their derivatives are those of the filter's own considered parameters. Lift,
induced drag and the bias of pitch are never adjusted, since depth rate alone does not tell them from drag and
buoyancy: they are considered, and what they leave open in the others stays in the covariance (Schmidt 1966). A speed
sensor enters only if the mission says so, and then all are adjusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

from pipeline.estimate import kalman, smoother
from pipeline.estimate.craft import (
    BUOYANCY,
    CARRIED,
    FLUSHING,
    HULL_TIME,
    PARAMETERS,
    THRUST,
    Adjusted,
    Craft,
    thrust_std,
)
from pipeline.estimate.force import Path, follow, linearise, smoothed
from pipeline.estimate.forcing import Forcing
from pipeline.estimate.noise import WATER, Each, levelled, most_probable, moved, noise_from
from pipeline.estimate.problem import Problem, unconsidered
from pipeline.estimate.series import Series
from pipeline.estimate.settings import Noise, Settings
from pipeline.model.exchange import FLUSHING_BEFORE

#: What the depth rate may adjust; thrust only where the propeller turned. With a speed sensor all may be.
ADJUSTED = (
    "parasite_drag",
    "net_buoyancy",
    "compressibility",
    "thermal_expansion",
    "thrust",
    "hull_time",
    "carried_water",
    "flushing_time",
)
#: Changes of coefficients relative to themselves, and the least of them: lift and drag keep their sign.
RELATIVE = [PARAMETERS.index(name) for name in ("parasite_drag", "lift_slope", "induced_drag", "thrust")]
LEAST = -0.8
#: What is never negative.
UNSIGNED = [HULL_TIME, CARRIED]
#: An innovation beyond this many standard deviations counts less (Huber 1964, doi:10.1214/aoms/1177703732).
HUBER = 3.0
#: Steps at most, and the change, in prior 1-sigma, below which they end.
STEPS, STILL = 30, 5e-3
#: What is searched while parameters are adjusted. All else stays as in `Settings`, ordinary: a water that is found to
#: move for as long as a leg lasts takes the leg's mean depth rate, and with it what tells of drag; and as long as
#: parameters are wrong, an error of V̇ or of net buoyancy as large as theirs would be found, and would hold them there.
INSTRUMENTS = ("depth_noise", "swell")
#: Steps after which they are.
SEARCHES = (2, 5)
#: s, τ of w_w while parameters are adjusted. It is less than the water's, so that means over minutes count for more
#: than what depth rate does within them: there a model that is steady but for V is wrong sooner than in the mean.
BRIEF = 100.0
#: The prior of net buoyancy is quadratic within this many 1-sigma and linear beyond: ballast is what is most often
#: not as believed, and contradicted by the data it gives way.
YIELDING = 2.0
#: A value this many 1-sigma from what was known before contradicts it.
CONTRADICTED = 2.0
#: The data are said to determine a parameter when its 1-sigma falls below this share of what it was.
DETERMINED = 0.5
#: How much the data must tell of the hull's lag to be felt, over what was known before, both as inverse variances; and
#: how far apart, in 1-sigma before, two explanations are two.
FELT, APART = 0.05, 0.5
#: Noise levels found by likelihood, with the 1-sigma of the logarithm.
SEARCHED = {"sigma_w": 0.8, "tau_w": 0.7, "depth_noise": 1.0, "swell": 2.0, "force_drift": 2.0, "load": 1.0}


class Stretch(NamedTuple):
    """A part of the mission with its inputs."""

    series: Series
    force: Forcing


class _Normal(NamedTuple):
    """Normal equations of one step: sums over innovations."""

    matrix: np.ndarray  # (c, c)
    vector: np.ndarray  # (c,)
    cost: float


def adjust(
    stretches: Sequence[Stretch],
    craft: Craft,
    paths: Sequence[Path],
    *,
    speed: bool,
    speed_scale: float = Settings._field_defaults["speed_scale"],
    noise: Noise | None = None,
    each: Each = map,
) -> Adjusted:
    """Return the craft adjusted to the depth (and speed, if used) measured in `stretches`.

    The parameters are found at ordinary noise levels, those of the mission are found at these parameters. Were the
    latter known, the parameters found at them would be the efficient ones, whose difference from ours is independent of
    them (Hausman 1978, doi:10.2307/1913827): to their covariance comes the step that is left to go there, as a column.
    They are known as far as ``noise.moved`` says: how that step changes along each axis has a column too.

    Parameters
    ----------
    stretches
        Parts of the mission.
    craft
        Coefficients with their 1-sigma before the mission.
    paths
        Where each stretch is linearised at first.
    speed
        Whether the speed sensor is a measurement.
    speed_scale
        1-sigma of its scale error.
    noise
        Noise levels that are known; searched for if left out.
    each
        How stretches, and noise levels that are tried, are gone through.
    """
    search = noise is None
    if noise is None:
        settings = noise_from(stretches[0].series)._replace(tau_w=BRIEF, speed_scale=speed_scale)
    else:
        settings = noise.settings
    powered = any(stretch.force.driven for stretch in stretches)
    if powered:
        std = craft.std.copy()
        std[THRUST] = thrust_std(craft, [stretch.force for stretch in stretches], [at.speed for at in paths])
        craft = craft._replace(std=std)
    adjusted = set(PARAMETERS if speed else ADJUSTED) - (set() if powered else {"thrust"})
    free = np.array([name in adjusted for name in PARAMETERS]) & (craft.std > 0.0)

    def descend(craft: Craft, settings: Settings, paths: Sequence[Path], *, search: bool) -> _End:
        return _descend(stretches, craft, settings, list(paths), free, search=search, speed=speed, each=each)

    end = descend(craft, settings, paths, search=search)
    astray = np.empty((free.size, 0))
    if free[HULL_TIME] and free[CARRIED] and _felt(end):
        end, astray = _likelier(end, descend(_otherwise(end.craft), end.settings, end.paths, search=False))
    craft, paths = end.craft, end.paths
    if noise is None:
        names = tuple(SEARCHED)
        noise = _likeliest(stretches[:1], craft, end.settings, paths[:1], names, speed=speed, each=each)

    def at(settings: Settings) -> tuple[_Normal, np.ndarray, np.ndarray]:
        normal = _equations(stretches, craft, settings, list(paths), speed=speed, each=each)
        matrix, gradient = _with_prior(normal, craft)
        return normal, matrix, _step(matrix, gradient, free)

    normal, matrix, step = at(noise.settings)
    touched = np.diag(normal.matrix) > 0.0
    farther = [at(settings)[2] - step for settings in noise.moved]
    left = np.column_stack([_root(matrix, free), step, *farther, touched[:, None] * astray])
    columns = left * craft.std[:, None]
    return Adjusted(craft, noise, columns, _report(craft, columns, free, touched, end.converged))


class _End(NamedTuple):
    """Where Gauss–Newton steps ended."""

    craft: Craft
    settings: Settings
    paths: list[Path]
    matrix: np.ndarray  # (c, c), of the normal equations, prior included
    cost: float  # -2 ln of likelihood times prior, but for a constant
    converged: bool


def _descend(
    stretches: Sequence[Stretch],
    craft: Craft,
    settings: Settings,
    paths: list[Path],
    free: np.ndarray,
    *,
    search: bool,
    speed: bool,
    each: Each,
) -> _End:
    """Return where steps of the `free` parameters end; on the way noise levels are searched if `search` says so."""
    converged, share, last = False, 1.0, np.zeros(free.size)
    for step in range(STEPS):
        normal = _equations(stretches, craft, settings, paths, speed=speed, each=each)
        matrix, gradient = _with_prior(normal, craft)
        cost = normal.cost + _prior_cost(craft)
        least = -craft.value[UNSIGNED] / np.maximum(craft.std[UNSIGNED], 1e-9)
        change = _step(matrix, gradient, free, least)
        if change @ last < -0.5 * float(np.linalg.norm(change) * np.linalg.norm(last)):
            share *= 0.5  # turned back: the cost bends more than its Gauss–Newton approximation
        last = change
        change = change * min(share, 2.0 / max(float(np.max(np.abs(change))), 1e-9))
        value = craft.value + change * craft.std
        value[UNSIGNED] = np.maximum(value[UNSIGNED], 0.0)
        value[RELATIVE] = np.maximum(value[RELATIVE], LEAST)
        craft = craft._replace(value=value)
        if search and step in SEARCHES:
            settings = _likeliest(
                stretches[:1], craft, settings, paths[:1], INSTRUMENTS, speed=speed, each=each
            ).settings
        elif np.max(np.abs(change)) < STILL and (step > SEARCHES[-1] or not search):
            converged = True
            break
    return _End(craft, settings, paths, matrix, cost, converged)


def _felt(end: _End) -> bool:
    """Return whether the data say anything of the time in which the hull takes on the water's temperature."""
    return bool(end.matrix[HULL_TIME, HULL_TIME] > 1.0 + FELT)


def _otherwise(craft: Craft) -> Craft:
    """Return `craft` with what looks like what was found: a hull without lag in a full fairing, or the other way round.

    Where temperature makes the density, a hull that lags behind it and water that is carried along both hold the
    vehicle up as it sinks and down as it rises; the cost has two minima.
    """
    value = craft.value.copy()
    if value[CARRIED] < 0.5 * craft.std[CARRIED]:
        value[CARRIED], value[HULL_TIME] = craft.centre[CARRIED] + craft.std[CARRIED], 0.0
    else:
        value[CARRIED], value[HULL_TIME] = 0.0, craft.centre[HULL_TIME] + craft.std[HULL_TIME]
    return craft._replace(value=value)


def _likelier(first: _End, second: _End) -> tuple[_End, np.ndarray]:
    """Return the likelier of two ends, and the column of covariance, per prior 1-sigma, that the other one leaves open.

    The column is the way to the other, times the root of its probability: that of a mixture about the likelier.
    """
    best, other = (first, second) if first.cost <= second.cost else (second, first)
    way = (other.craft.value - best.craft.value) / np.where(best.craft.std > 0.0, best.craft.std, 1.0)
    if not other.converged or np.max(np.abs(way[[HULL_TIME, CARRIED]])) < APART:
        return first, np.empty((way.size, 0))
    probability = 1.0 / (1.0 + np.exp(min(0.5 * (other.cost - best.cost), 50.0)))
    return best, probability**0.5 * way[:, None]


def unadjusted(found: Adjusted) -> Adjusted:
    """Return `found` with every parameter as it was before the mission, and as uncertain; its noise levels stay."""
    craft = found.craft._replace(value=found.craft.centre.copy())
    return found._replace(
        craft=craft, columns=np.diag(craft.std), report={"parameters": {}, "untouched": [], "converged": True}
    )


def _equations(
    stretches: Sequence[Stretch], craft: Craft, settings: Settings, paths: list[Path], *, speed: bool, each: Each
) -> _Normal:
    """Return the normal equations of all stretches, and put their smoothed paths into `paths`."""

    def one(flown: tuple[Stretch, Path]) -> tuple[_Normal, Path]:
        (series, force), at = flown
        problem = linearise(series, follow(series, force, craft, at), settings, speed=speed)
        return _normal(problem, series), _smoothed(problem, series, at)

    found = list(each(one, zip(stretches, paths, strict=True)))
    paths[:] = [at for _, at in found]
    return reduce(_summed, [normal for normal, _ in found])


def _normal(problem: Problem, series: Series) -> _Normal:
    """Return the normal equations of one stretch per prior 1-sigma.

    Left out are the surface, and pitch in manoeuvres. Depth in manoeuvres counts: there w_w and V are told apart.
    """
    found, variance = kalman.innovations(problem)
    found = found / np.sqrt(variance)[:, :, None]
    used = np.isfinite(found[:, :, 0])
    used[series.afloat | series.standing] = False
    used[series.manoeuvre, 1] = False
    residual, slope = found[used][:, 0], found[used][:, 1:]
    weight = np.minimum(1.0, HUBER / np.maximum(np.abs(residual), 1e-9))
    return _Normal(slope.T @ (slope * weight[:, None]), slope.T @ (weight * residual), float(weight @ residual**2))


def _summed(a: _Normal, b: _Normal) -> _Normal:
    return _Normal(a.matrix + b.matrix, a.vector + b.vector, a.cost + b.cost)


def _with_prior(normal: _Normal, craft: Craft) -> tuple[np.ndarray, np.ndarray]:
    """Return matrix and gradient with the prior's; `linearise` gives columns per 1-sigma, and so are these."""
    known = craft.std > 0.0
    departure = np.where(known, (craft.value - craft.centre) / np.where(known, craft.std, 1.0), 0.0)
    weight = np.ones(known.size)
    weight[BUOYANCY] = min(1.0, YIELDING / max(abs(departure[BUOYANCY]), 1e-9))
    return normal.matrix + np.diag(weight), normal.vector + weight * departure


def _prior_cost(craft: Craft) -> float:
    """Return -2 ln of the prior, but for a constant, whose gradient `_with_prior` takes."""
    known = craft.std > 0.0
    departure = np.abs(craft.value - craft.centre) / np.where(known, craft.std, np.inf)
    within = np.where(np.arange(known.size) == BUOYANCY, np.minimum(departure, YIELDING), departure)
    return float(np.sum(within * (2.0 * departure - within)))


def _step(matrix: np.ndarray, gradient: np.ndarray, free: np.ndarray, least: np.ndarray | None = None) -> np.ndarray:
    """Return the Newton step of the free parameters, shape (c,); those of `UNSIGNED` are no lower than `least`."""
    step, moving = np.zeros(free.size), free.copy()
    while True:
        pull = gradient + matrix @ np.where(moving, 0.0, step)
        step[moving] = -np.linalg.solve(matrix[np.ix_(moving, moving)], pull[moving])
        beyond = [] if least is None else [i for i, low in zip(UNSIGNED, least, strict=True) if step[i] < low]
        if least is None or not beyond:
            return step
        for i in beyond:
            step[i], moving[i] = least[UNSIGNED.index(i)], False


def _root(matrix: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return columns whose outer products sum to the covariance of all parameters, per 1-sigma; shape (c, c).

    The considered keep their prior; the adjusted have the covariance of the fit, and move with the considered.
    """
    columns = np.zeros_like(matrix)
    inverse = np.linalg.inv(matrix[np.ix_(free, free)])
    columns[np.ix_(free, free)] = np.linalg.cholesky(inverse)
    columns[np.ix_(~free, ~free)] = np.eye(int((~free).sum()))
    columns[np.ix_(free, ~free)] = -inverse @ matrix[np.ix_(free, ~free)]
    return columns


def _smoothed(problem: Problem, series: Series, at: Path) -> Path:
    mean = smoother.solve(unconsidered(problem), whole=False).mean[:, :, 0]
    return smoothed(series, mean, at, scaled=bool(problem.weight[2, 1]))


def _likeliest(
    stretches: Sequence[Stretch],
    craft: Craft,
    settings: Settings,
    paths: Sequence[Path],
    names: tuple[str, ...],
    *,
    speed: bool,
    each: Each,
) -> Noise:
    """Return settings with the noise levels `names` of `SEARCHED` at their most probable values, see `most_probable`.

    Where the water is among them, what is open of it goes along, and innovations are made as large as predicted.
    """
    nothing = np.empty((len(PARAMETERS), 0))
    followed = [
        (series, follow(series, force, craft, at, nothing))
        for (series, force), at in zip(stretches, paths, strict=True)
    ]

    def log_likelihood(trial: Settings) -> float:
        return sum(kalman.log_likelihood(linearise(*each, trial, speed=speed)) for each in followed)

    median = Settings(sigma_w=WATER, depth_noise=settings.depth_noise)
    settings, open_ = most_probable(settings, median, {name: SEARCHED[name] for name in names}, log_likelihood, each)
    if not open_.size:
        return Noise(settings)
    series, along = followed[0]
    steady = ~(series.manoeuvre | series.afloat)
    settings = levelled(settings, steady, lambda trial: linearise(series, along, trial, speed=speed))
    return Noise(settings, moved(settings, names, open_))


def _in_seconds(folds: float, std: float) -> tuple[float, float]:
    """Return the time in which water carried along is renewed, and its 1-sigma, s, from its logarithm's."""
    time = FLUSHING_BEFORE * np.exp(folds)
    return time, time * std


def _report(
    craft: Craft, columns: np.ndarray, free: np.ndarray, touched: np.ndarray, converged: bool
) -> dict[str, Any]:
    """Return every parameter with value, 1-sigma before and after, and whether the data determine it.

    Of those that no measurement depends on at the values found, as thrust where the propeller never turns, nothing is
    found, and they are named apart. With the others goes the correlation of the adjusted, what the considered leave
    open included.
    """
    free = free & touched
    after = np.sqrt(np.sum(columns**2, axis=1))
    table = {}
    for i, name in enumerate(PARAMETERS):
        if craft.std[i] <= 0.0 or not touched[i]:
            continue
        departure = abs(craft.value[i] - craft.centre[i]) / craft.std[i]
        if not free[i]:
            verdict = "considered: depth rate alone does not tell it from the others"
        elif departure > CONTRADICTED:
            verdict = f"contradicts what was known before, by {departure:.1f} sigma"
        elif after[i] < DETERMINED * craft.std[i]:
            verdict = "determined"
        else:
            verdict = "not determined by these data: mostly as before the mission"
        now, before = (craft.value[i], after[i]), (craft.centre[i], craft.std[i])
        if i == FLUSHING:
            now, before = (_in_seconds(*one) for one in (now, before))
        table[name] = {
            "value": float(now[0]),
            "std": float(now[1]),
            "before": float(before[0]),
            "std_before": float(before[1]),
            "verdict": verdict,
        }
    rows = columns[free] / after[free, None]
    correlation = {
        "names": [name for name, adjusted in zip(PARAMETERS, free, strict=True) if adjusted],
        "matrix": np.clip(rows @ rows.T, -1.0, 1.0).tolist(),
    }
    untouched = [name for name, std, at in zip(PARAMETERS, craft.std, touched, strict=True) if std > 0.0 and not at]
    return {"parameters": table, "untouched": untouched, "correlation": correlation, "converged": converged}

"""Speed through water and angle of attack from depth and pitch, borrowing only the ratio of lift to drag.

State V, θ, z, w_w and δ, where α = α_closure(θ, V) + δ: the polar closure gives the angle of attack of an unpowered
steady glide, and δ, a Gauss–Markov process, says how far it may be off: little in steady flight, more in
manoeuvres. Under power the closure is not borrowed: α = δ, with the glide's α as its span. Depth obeys
ż = −V sin(θ − α) − w_w. Where there are fixes and a heading, position, current and the speed of powered level
flight join the state, so that the displacement between fixes carries the speed that depth cannot. Net buoyancy,
thrust and propeller speed never enter, and a common factor on all coefficients changes nothing.

The problem is linearised along the smoothed trajectory and solved again until that stands still (iterated
extended Kalman smoother; Bell 1994, doi:10.1137/0804035). What the coefficients and the pitch bias leave open
is added as the change of the result when each is moved by its 1-sigma.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pipeline.estimate.linearise import CURRENT_EAST, DEPTH, PITCH, Considered, Sources, follow, linearise
from pipeline.estimate.noise import SEARCHED, Each, fill_left_open, levelled, likeliest, moved, noise_from, rounded
from pipeline.estimate.problem import Problem, Solution, unconsidered
from pipeline.estimate.sensors import Scale, scale_found
from pipeline.estimate.series import Series
from pipeline.estimate.settings import Noise, Settings
from pipeline.estimate.told import nothing, told
from pipeline.estimate.trajectory import Flight, Solve, first_guess, flight, iterate
from pipeline.mission import Mission
from pipeline.vehicle import POSITIVE, Polar, Vehicle

#: A measurement farther than this many standard deviations from the smoothed trajectory is left out.
GATE = 6.0
#: A coefficient moved down by its 1-sigma keeps at least this share of its value.
LEAST = 0.2
#: The trajectory is solved for at most so many times; before the noise of the water is searched along it, so many.
ITERATIONS, ROUGH = 9, 2
#: What the estimate borrows, besides the pitch as logged; each is moved by its 1-sigma.
BORROWED = ("pitch", "lift_slope", "parasite_drag", "induced_drag", "lift_at_zero")
#: What is found in the mission and not exactly known either.
OPEN = ("sigma_w", "tau_w")


class Model(NamedTuple):
    """What the estimator is told: ratios of coefficients, what is not known of them, noise, and what it may use."""

    polar: Polar
    names: list[str]  # what is considered, in the order of its columns
    considered: Considered
    noise: Noise
    sources: Sources
    solve: Solve

    @property
    def open(self) -> list[str]:
        """What every interval has a share of, in the order of the columns of a solution."""
        return [*self.names, *OPEN[: len(self.noise.moved)]]


class Part(NamedTuple):
    """A stretch of a mission, solved; m instants."""

    flight: Flight
    series: Series  # without what was left out
    current: np.ndarray  # (2, m): east and north, NaN without fixes
    scale: Scale | None  # of the speed sensor, if it is used
    problem: Problem  # the last one solved
    solution: Solution
    outlying: np.ndarray  # (2, m): depth and pitch left out


def prepare(
    series: Series, vehicle: Vehicle, mission: Mission, solve: Solve, *, fixes: bool, each: Each = map
) -> Model:
    """Return the model of a mission: its noise is that of `series`, a stretch of it.

    Parameters
    ----------
    series
        Measurements and flags.
    vehicle
        Its polar is borrowed (ratios of coefficients only).
    mission
        Whether a speed sensor is used, and the 1-sigma of the pitch bias.
    solve
        Engine that solves the linear problems.
    fixes
        Whether fixes are measurements.
    each
        How likelihoods are asked for at several noise levels.
    """
    sources = Sources(mission.speed_sensor == "use", fixes)
    settings = noise_from(series)._replace(speed_scale=mission.speed_sensor_scale_std)
    polar = _ratios(vehicle.polar)
    if any(math.isnan(value) for value in polar):
        return Model(polar, *_considered(vehicle, mission), Noise(settings), sources, solve)
    at = iterate(series, polar, settings, first_guess(series, polar), sources, solve, ROUGH)
    settings, spread = likeliest(series, polar, settings, at, sources.speed, each)
    at = iterate(series, polar, settings, at, sources, solve, ITERATIONS)
    steady = ~(series.manoeuvre | series.afloat)
    along = follow(series, polar, at)
    settings = levelled(settings, steady, lambda trial: linearise(series, along, trial, sources))
    names = tuple(SEARCHED)
    noise = Noise(rounded(settings, names), tuple(rounded(each, names) for each in moved(settings, names, spread)))
    return Model(polar, *_considered(vehicle, mission), noise, sources, solve)


def solve(series: Series, model: Model) -> Part:
    """Return a stretch of the mission solved: iterated, outliers left out, with what the borrowed leaves open."""
    polar, settings, sources, room = model.polar, model.noise.settings, model.sources, len(model.noise.moved)
    at = iterate(series, polar, settings, first_guess(series, polar), sources, model.solve, ITERATIONS)
    along = follow(series, polar, at, model.considered)
    problem = linearise(series, along, settings, sources)
    solution = model.solve(problem, room=room)
    outlying = _outlying(series, settings, solution)
    if outlying.any():
        series = replace(
            series,
            depth=np.where(outlying[0], np.nan, series.depth),
            pitch=np.where(outlying[1], np.nan, series.pitch),
        )
        at = iterate(series, polar, settings, at, sources, model.solve, ITERATIONS)
        along = follow(series, polar, at, model.considered)
        problem = linearise(series, along, settings, sources)
        solution = model.solve(problem, room=room)
    steady = ~(series.manoeuvre | series.afloat)  # what a manoeuvre leaves would be taken for lift and drag
    known = told(problem, steady) if sources.speed else nothing(len(model.names))
    fill_left_open(
        model.noise,
        solution.mean,
        lambda moved: model.solve(unconsidered(linearise(series, along, moved, sources)), whole=False).mean[:, :, 0],
    )
    known = known.beside(room)
    currents = known.moved(solution.mean[:, CURRENT_EAST : CURRENT_EAST + 2]).T
    return Part(
        flight(series, polar, solution, along.changes, known),
        series,
        currents if sources.fixes else np.full((2, series.time.size), np.nan),
        scale_found(series, solution, at.speed, at.scale, known) if sources.speed and settings.speed_scale else None,
        problem,
        solution,
        outlying,
    )


def _considered(vehicle: Vehicle, mission: Mission) -> tuple[list[str], Considered]:
    """Return what is not exactly known: names, and the polars moved by 1-sigma up and down."""
    polar = vehicle.polar
    names = [name for name in BORROWED[1:] if vehicle.std(name) > 0.0]
    moved = [[_ratios(polar._replace(**{name: value})) for value in _moved(vehicle, name)] for name in names]
    pitch = float(np.radians(mission.pitch.std_deg))
    return ["pitch", *names, "speed_by_pitch"], Considered(
        pitch, np.array(moved, dtype=np.float64).reshape(-1, 2, len(polar))
    )


def _ratios(polar: Polar) -> Polar:
    """Return `polar` per parasite drag, to twelve digits: on more than ratios nothing depends, not even by rounding."""
    unit = polar.parasite_drag if polar.parasite_drag > 0.0 else math.nan
    ratios = [float(f"{value / unit:.12g}") for value in polar[:-1]]
    return Polar._make([*ratios, polar.drag_exponent])


def _moved(vehicle: Vehicle, name: str) -> tuple[float, float]:
    """Return a coefficient moved by its 1-sigma up and down; one that is positive stays so."""
    value, std = vehicle[name], vehicle.std(name)
    down = value - std
    return value + std, max(down, LEAST * value) if name in POSITIVE else down


def _outlying(series: Series, settings: Settings, solution: Solution) -> np.ndarray:
    """Return where the smoothed trajectory contradicts depth and pitch, boolean of shape (2, m)."""
    far = []
    for value, state, noise in (
        (series.depth, DEPTH, settings.depth_noise),
        (series.pitch, PITCH, settings.pitch_noise),
    ):
        sigma = np.sqrt(noise**2 + solution.covariance[:, state, state])
        with np.errstate(invalid="ignore"):
            far.append(np.abs(value - solution.mean[:, state, 0]) > GATE * sigma)
    return np.stack(far)

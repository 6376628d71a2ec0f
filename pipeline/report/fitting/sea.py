"""The moving water behind block means: its strength and correlation time, from what all corrections at once leave.

The smoother finds both from samples a few seconds apart, where slow errors of its own model pass for slow water. What
counts for block means is how they scatter from block to block: the restricted likelihood of the depth rates, with every
reason for a difference and all that is stated integrated out (Patterson and Thompson 1971,
doi:10.1093/biomet/58.3.545), and what is known of water beforehand.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from pipeline.report.covariance import WATER, water_of
from pipeline.report.fitting.causes import CAUSES
from pipeline.report.fitting.evidence import Prior, posterior, stated, with_cause
from pipeline.report.fitting.fit import select
from pipeline.report.fitting.given import DEFAULT, Given
from pipeline.report.fitting.observations import observe
from pipeline.report.fitting.regression import Problem
from pipeline.report.fitting.terms import DepthRates
from pipeline.vehicle import Vehicle

#: Beforehand the strength is the smoother's within a factor of 2, the correlation time 300 s within a factor of 2.5.
STRENGTH, TIME = math.log(2.0), math.log(2.5)
#: Values tried in units of these: far apart first, then about the best.
COARSE, FINE = np.linspace(-2.4, 2.4, 7), np.linspace(-0.6, 0.6, 7)


def sea(blocks: pd.DataFrame, vehicle: Vehicle, given: Given = DEFAULT) -> dict[str, Any]:
    """Return the settings given with ``sigma_w`` [m/s] and ``tau_w`` [s] as the depth rates of the blocks have them.

    As they are where the blocks cannot be fitted.

    Parameters
    ----------
    blocks, vehicle, given
        As for `fit.fit`.
    """
    chosen, reason = select(blocks, vehicle)
    settings = dict(given.settings or {})
    if reason or not water_of(settings)[0] > 0.0:
        return settings
    problem = observe(chosen, vehicle, given)
    prior = every_cause(problem)
    sigma, tau = likeliest(problem, prior)
    return settings | {"sigma_w": sigma, "tau_w": tau}


def every_cause(problem: Problem) -> Prior:
    """Return the unknowns with every cause at once that the problem feels."""
    prior, names = stated(problem), problem.model.names
    for cause in CAUSES:
        if cause.unknown in names:
            spread = cause.spread(problem.model.vehicle, problem.priors[cause.unknown])
            prior = with_cause(prior, names.index(cause.unknown), spread)
    return prior


def likeliest(problem: Problem, prior: Prior) -> tuple[float, float]:
    """Return the strength [m/s] and correlation time [s] of the water that the depth rates make most probable.

    Theory is taken as linear around the best values of the unknowns.
    """
    rates = next(term for term in problem.terms if isinstance(term, DepthRates))
    found = posterior(problem, prior)
    flight = problem.model.fly(found.x)
    left, slope = rates.points.depth_rate - flight.depth_rate, flight.depth_rate_by @ prior.root
    left = left + slope @ found.y  # what the unknowns have to explain, theory linear
    others = replace(problem, terms=tuple(term for term in problem.terms if term is not rates))
    rest, by_rest = _others(others, found.x, prior)
    rest = rest - by_rest @ found.y

    def cost(a: float, b: float) -> float:
        sigma, tau = _scaled(rates, a, b)
        term = DepthRates.made(rates.points, sigma, tau)
        y = np.concatenate([term.whiten(left), rest])
        design = np.concatenate([term.whiten(slope), -by_rest])
        inner, project = np.eye(design.shape[1]) + design.T @ design, design.T @ y
        minus_two_log = float(y @ y - project @ np.linalg.solve(inner, project)) + float(np.linalg.slogdet(inner)[1])
        return minus_two_log + 2.0 * float(np.sum(np.log(term.whiten.factor[0]))) + a**2 + b**2

    best = (0.0, 0.0)
    for steps in (COARSE, FINE):
        best = min(((best[0] + a, best[1] + b) for a, b in product(steps, steps)), key=lambda pair: cost(*pair))
    return _scaled(rates, *best)


def _scaled(rates: DepthRates, a: float, b: float) -> tuple[float, float]:
    """Return strength [m/s] and correlation time [s] so many 1-sigma off what is known beforehand."""
    return rates.sigma * math.exp(STRENGTH * a), WATER["tau_w"] * math.exp(TIME * b)


def _others(problem: Problem, x: np.ndarray, prior: Prior) -> tuple[np.ndarray, np.ndarray]:
    """Return the residuals of the other terms and their slopes in the prior's units; of shape (0,) without any."""
    if not problem.terms:
        return np.zeros(0), np.zeros((0, prior.root.shape[1]))
    left, slope = problem.evaluate(x)
    return left, slope @ prior.root

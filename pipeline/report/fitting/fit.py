"""Which correction explains the difference: corrections fitted to the means of steady blocks.

Generalised least squares: the residual is the measured depth rate less the one that theory gives with the measured
pitch held and the propeller speed as logged; its covariance is the measurement's and that of the water's vertical
velocity, which neighbouring blocks share. What the fit does not free but borrows – lift, induced drag, thrust, hull,
pitch bias – stays in it as an unknown held by its 1-sigma, so that the standard deviations of what is free are honest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from pipeline.report.fitting import battery
from pipeline.report.fitting.account import account, inflation_of, outliers, refused, residuals
from pipeline.report.fitting.counterpart import with_lift_kept
from pipeline.report.fitting.given import DEFAULT, Given
from pipeline.report.fitting.goodness import goodness
from pipeline.report.fitting.heldout import left_out_dives
from pipeline.report.fitting.model import Model
from pipeline.report.fitting.parameters import of_configurations
from pipeline.report.fitting.points import Points
from pipeline.report.fitting.regression import Problem, Solution, outlying, solve
from pipeline.report.fitting.selection import Choice, choose, condition_index, fitted, refusal
from pipeline.report.fitting.terms import Constraint
from pipeline.report.fitting.text import text
from pipeline.report.fitting.uncertainty import RESAMPLES, bootstrap, colour, profile
from pipeline.report.fitting.weighing import weighed
from pipeline.report.rounding import counted
from pipeline.vehicle import Vehicle

#: What is fitted first; the drag of further sensor configurations joins it.
FREE = ("parasite_drag", "net_buoyancy")


def fit(
    blocks: pd.DataFrame,
    vehicle: Vehicle,
    given: Given = DEFAULT,
    *,
    free: Sequence[str] | None = None,
    resamples: int = RESAMPLES,
) -> dict[str, Any]:
    """Return the fitted corrections with everything a reader needs to trust or doubt them.

    Parameters
    ----------
    blocks
        The canonical table `records.BLOCKS`.
    vehicle
        The vehicle whose coefficients are corrected; its 1-sigma are the priors.
    given
        What else is known and compared.
    free
        What is fitted, of `parameters.CORRECTIONS`; if left out, chosen by what the data can tell, from `FREE` on.
    resamples
        Of the bootstrap.

    Returns
    -------
    dict
        For summary.json: ``parameters`` (from the data alone, with prior, bootstrap and verdict; ``interval_95`` by
        profile likelihood, which holds where theory bends over a 1-sigma, too), ``correlation``,
        ``condition_index``, ``condition_limits``, ``chi_square``, ``selection`` (what was freed beside the first set,
        what was not, and why), ``robust``, ``colour``, ``goodness``, ``bootstrap``, ``profiles``, ``battery``,
        ``lift_kept``, ``left_out_dives``, ``borrowed``, ``contradictions``, ``residuals``, ``text``; ``reason`` where
        there is no fit, and then no value.

    Raises
    ------
    KeyError
        If there is no such correction as one of `free`.
    """
    problem, reason = solvable(blocks, vehicle, given)
    points = problem.points
    used = int(blocks["used"].sum()) if len(blocks) else 0
    first = tuple(free) if free is not None else (*FREE, *of_configurations(points))
    problem = problem.freeing(first)
    sizes: dict[str, Any] = {
        "blocks_steady": used,
        "blocks": points.size,
        "dives": int(np.unique(points.dive).size),
        "sensor_speeds": _count(problem.terms, "speeds by a sensor"),
        "gps_speeds": _count(problem.terms, "speed of level"),
    }
    if reason:
        return refused(problem, sizes, reason, math.nan)
    reason, condition = refusal(problem), condition_index(problem)
    if not reason and problem.size <= len(first):
        found, needed = counted(points.size, "steady block"), len(first) + 1
        reason = f"{found} for {len(first)} corrections: at least {needed} are needed"
    if reason:
        return refused(problem, sizes, reason, condition)
    choice, scatter = _chosen(problem, asked=free is not None)
    both = None if choice is None else solve(choice.problem, prior_on_free=True, weights=choice.solution.weights)
    if choice is None or both is None or not both.converged:
        return refused(problem, sizes, "the fit does not converge: look at pitch and buoyancy of the blocks", condition)
    result = _finished(choice, both, vehicle, resamples, scatter) | sizes | {"depth_rate_scatter": scatter}
    return result | {"text": text(result)}


def solvable(blocks: pd.DataFrame, vehicle: Vehicle, given: Given = DEFAULT) -> tuple[Problem, str]:
    """Return the problem that `fit` solves, nothing free yet, and why it cannot be: then it compares nothing.

    ``problem.freeing(names)`` frees a set, `selection.refusal` says whether the data can carry it, `selection.fitted`
    solves it, and `heldout.left_out_dives` scores it.

    Parameters
    ----------
    blocks, vehicle, given
        As for `fit`.
    """
    points, reason = selected(blocks, vehicle, given)
    terms = () if reason else given.terms(points)
    return Problem(Model(vehicle, points, ()), terms, given.priors(vehicle, points), 0).freeing(()), reason


def select(blocks: pd.DataFrame, vehicle: Vehicle) -> tuple[pd.DataFrame, str]:
    """Return the rows of `blocks` that theory can predict, in time order, and why there are none."""
    points, reason = selected(blocks, vehicle)
    used = blocks["used"].to_numpy(dtype=bool) & np.isin(blocks["block"].to_numpy(), points.block)
    return blocks[used].sort_values("start", kind="stable").reset_index(drop=True), reason


def selected(blocks: pd.DataFrame, vehicle: Vehicle, given: Given = DEFAULT) -> tuple[Points, str]:
    """Return the blocks that theory can predict, and why there are none."""
    used = blocks["used"].to_numpy(dtype=bool)
    points = given.points(blocks if used.all() else blocks[used], vehicle)
    if not points.size:
        return points, _none_used(blocks)
    present = np.ones(points.size, dtype=bool)
    needed = {
        "depth_rate": "depth rate", "net_buoyancy": "net buoyancy", "pitch": "pitch",
        "propeller_speed": "thrust that follows from what is logged",
    }  # fmt: skip
    for name, words in needed.items():
        finite = np.isfinite(getattr(points, name))
        if not finite.any():
            return points.only(finite), f"no steady block with a {words}"
        present &= finite
    unknown = [name for name in ("lift_slope", "parasite_drag", "induced_drag") if not math.isfinite(vehicle[name])]
    if unknown:
        return points.only(np.zeros(0, dtype=np.int64)), f"the vehicle file leaves {', '.join(unknown)} unknown"
    present &= np.isfinite(Model(vehicle, points, ()).fly(np.zeros(0)).speed)
    if not present.any():
        return points.only(present), "theory has no steady flight at the pitch and buoyancy of any block"
    return points if present.all() else points.only(present), ""


def _none_used(blocks: pd.DataFrame) -> str:
    """Return that there is no steady block, or that none of them is used and the commonest reason."""
    if blocks.empty:
        return "no steady block"
    reason = str(blocks["reason"].astype(str).value_counts().idxmax())
    return f"none of {len(blocks)} steady blocks is used{f', {reason}' if reason else ''}"


def _chosen(problem: Problem, *, asked: bool) -> tuple[Choice | None, float]:
    """Return the free set, chosen or as `asked` for, solved, and how many times as much depth rates scatter as said.

    The scatter is that about the first set while others are tried, and then that about the one chosen.
    """
    choice = None if asked else choose(weighed(problem)[0])
    if choice is None and not asked:
        return None, 1.0
    alone = problem if choice is None else replace(choice.problem, terms=problem.terms)
    final, scatter = weighed(alone)
    solution = fitted(final)
    accepted, rejected = ((), ()) if choice is None else (choice.accepted, choice.rejected)
    return (None if solution is None else Choice(final, solution, accepted, rejected)), scatter


def _count(terms: Sequence[Constraint], name: str) -> int:
    return sum(int(term.dives.size) for term in terms if term.name.startswith(name))


def _finished(choice: Choice, both: Solution, vehicle: Vehicle, resamples: int, scatter: float) -> dict[str, Any]:
    """Return the account of a fit that was made, with all that says how far to trust it."""
    problem, alone = choice.problem, choice.solution
    shade = colour(alone.residual[: problem.points.size] * np.sqrt(alone.weights[: problem.points.size]))
    inflation = inflation_of(problem, alone, shade.effective)
    result = account(problem, alone, both, inflation)
    resampled = bootstrap(problem, alone, resamples=resamples)
    for item, std in zip(result["parameters"], resampled["std"], strict=True):
        item["bootstrap_std"] = std
    profiles = [profile(problem, alone, place, inflation=inflation) for place in range(problem.free)]
    for item, found in zip(result["parameters"], profiles, strict=True):
        item["interval_95"] = found["interval_95"]
    result |= {
        "selection": {"accepted": list(choice.accepted), "rejected": list(choice.rejected)},
        "robust": outliers(problem, outlying(alone.residual)),
        "colour": shade._asdict(),
        "goodness": goodness(problem, alone, shade.effective, scatter),
        "bootstrap": resampled,
        "profiles": [
            {"name": item["name"], "symbol": item["symbol"], "unit": item["unit"]} | found
            for item, found in zip(result["parameters"], profiles, strict=True)
        ],
        "battery": battery.trim(problem, alone, vehicle),
        "lift_kept": with_lift_kept(problem, alone, inflation),
        "residuals": residuals(problem, alone),
        "left_out_dives": left_out_dives(problem),
    }
    return result

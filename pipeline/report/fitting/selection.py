"""Which corrections the data can tell: condition index, correlation and Schwarz's criterion, with the verdict in words.

A set that is singular is refused, and the experiment named that would resolve it. Above the condition indices of
Belsley, Kuh and Welsch (1980), doi:10.1002/0471725153, a set is doubted (30) or refused (1000).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.report.fitting.parameters import AT, BALLAST, LIFT
from pipeline.report.fitting.points import Array, Points
from pipeline.report.fitting.regression import Problem, Solution, robust, solve
from pipeline.report.rounding import signed

#: Above these a pair cannot be told apart, the free set is doubted, and is refused.
CORRELATION = 0.95
CONDITION_DOUBTED = 30.0
CONDITION_REFUSED = 1000.0
#: What is said of a candidate that these data do not tell from a correction that is free.
NOT_APART = "cannot be told apart from"
#: By so much must Schwarz's criterion fall for a further correction: strong evidence (Kass and Raftery 1995).
EVIDENCE = 6.0
#: What may be freed beside the first set, in this order where two explain as much.
CANDIDATES = (
    "thrust_scale",
    "thrust_by_voltage",
    "compressibility",
    "thermal_expansion",
    "hull_time",
    "carried_water",
    "flushing_time",
    "pitch",
    "drag_drift",
    "lift_slope",
    "induced_drag",
    "lift_at_zero",
)
#: Voltages all within this share of their mean are nearly one.
SAME_VOLTAGE = 0.05
#: Least number of dives, and of days between the first and the last block, for a drift in time.
DRIFT_DIVES, DRIFT_DAYS = 4, 1.0


@dataclass(frozen=True)
class Choice:
    """The free set that was chosen, its problem and solution, and what was rejected and why."""

    problem: Problem
    solution: Solution
    accepted: tuple[dict[str, Any], ...]
    rejected: tuple[dict[str, Any], ...]


def condition_index(problem: Problem) -> float:
    """Return the condition index of the free columns of the Jacobian without corrections, each scaled to length one."""
    _left, slope = problem.evaluate(np.zeros(len(problem.model.names)))
    columns = slope[:, : problem.free]
    length = np.linalg.norm(columns, axis=0)
    if not (np.isfinite(length).all() and np.all(length > 0.0)):
        return math.inf
    values = np.linalg.svd(columns / length, compute_uv=False)
    if values.size < problem.free:
        return math.inf
    return float(values[0] / values[-1]) if values[-1] > 1e-14 * values[0] else math.inf


def correlation(covariance: Array) -> Array:
    """Return the correlation matrix of a covariance, shape (k, k)."""
    std = np.sqrt(np.diag(covariance))
    return np.asarray(covariance / np.outer(std, std))


def refusal(problem: Problem) -> str:
    """Return why the free set of `problem` cannot be fitted to these data at all, and what would help; "" if it can."""
    free = problem.model.names[: problem.free]
    symbols = [problem.model.correction(name).symbol for name in free]
    same = [symbol for name, symbol in zip(free, symbols, strict=True) if name in BALLAST]
    if len(same) > 1:
        return (
            f"refused, {' and '.join(same)} are one and the same to these data: the constant part of net buoyancy; "
            "would be resolved by weighing the vehicle"
        )
    lifting = [symbol for name, symbol in zip(free, symbols, strict=True) if name in LIFT]
    if lifting and not problem.tells_speed:
        return (
            f"refused, {' and '.join(lifting)}: depth rates alone do not tell lift, a wrong one is made up for by a "
            f"wrong speed; {experiment(free, problem.points)}"
        )
    index = condition_index(problem)
    if not index <= CONDITION_REFUSED:
        words = f"condition index {index:.0f}" if index < 1e9 else "a singular set"
        cannot = " and ".join(symbols) + " cannot be told apart"
        return f"refused, {words} (limit {CONDITION_REFUSED:.0f}): {cannot}; {experiment(free, problem.points)}"
    return ""


def experiment(names: Iterable[str], points: Points) -> str:
    """Return which experiment would separate the corrections `names`, given what these blocks already have."""
    wanted_of = {name.partition(AT)[0] for name in names}
    down, up = (bool((points.direction == side).any()) for side in (-1, 1))
    propeller = any(np.unique(points.powered[points.direction == side]).size > 1 for side in (-1, 0, 1))
    wanted = []
    if {"net_buoyancy", "parasite_drag"} <= wanted_of and not (down and up):
        missing = ("climbs", "dives") if down else ("dives", "climbs")
        wanted.append(f"{missing[0]} flown like the {missing[1]}" if down or up else "dives and climbs flown alike")
    if {"thrust_scale", "thrust_by_voltage"} & wanted_of and not propeller:
        wanted.append("the same pitch with the propeller on and off")
    voltages = np.abs(points.relative_voltage[points.powered])
    if "thrust_by_voltage" in wanted_of and np.max(voltages, initial=0.0) < SAME_VOLTAGE:
        wanted.append("the same propeller setting at a full and at a nearly empty battery, with glides in between")
    if set(LIFT) & wanted_of:
        wanted.append("a speed sensor, or GPS fixes on many headings")
    if "compressibility" in wanted_of:
        wanted.append("deeper dives")
    if "thermal_expansion" in wanted_of:
        wanted.append("dives through a sharper thermocline")
    if {"carried_water", "flushing_time"} & wanted_of:
        wanted.append("dives through a sharper pycnocline, with a stay below it")
    if "drag_drift" in wanted_of:
        wanted.append("more dives over more days")
    if "pitch" in wanted_of or not wanted:
        wanted.append("two buoyancies and two pitches in both directions")
    return "would be resolved by " + " and ".join(wanted)


def fitted(problem: Problem) -> Solution | None:
    """Return the solution from the data alone, outliers weighted down; None where there is none."""
    plain = solve(problem)
    if plain is None or not plain.converged:
        return None
    return robust(problem, plain)


def choose(problem: Problem, candidates: Sequence[str] = CANDIDATES) -> Choice | None:
    """Return the free set that the data can tell, beginning with that of `problem`, which is not refused.

    In each round the candidate goes in that lowers Schwarz's criterion most, if it does by `EVIDENCE`, is told better
    than it was known before, and neither condition index nor a correlation says that it cannot be told apart from
    what is free already. Of one that cannot, this is said whatever the criterion: that it changes nothing does not say
    then that nothing is wrong there. Where the residuals scatter more than was assumed, the criterion is taken with
    their scatter.

    Returns
    -------
    Choice or None
        None where the first set does not converge.
    """
    base = fitted(problem)
    if base is None:
        return None
    left = [name for name in candidates if _felt(name, problem)]
    accepted: list[dict[str, Any]] = []
    verdicts: dict[str, dict[str, Any]] = {}
    while left:
        trials = {name: _trial(problem, base, name) for name in left}
        verdicts |= {name: trial[0] for name, trial in trials.items()}
        able = [name for name in left if not trials[name][0]["why"]]
        if not able:
            break
        best = min(able, key=lambda name: trials[name][0]["delta_bic"])
        account, larger, solution = trials[best]
        assert solution is not None
        accepted.append(account)
        problem, base = larger, solution
        left.remove(best)
        del verdicts[best]
    return Choice(problem, base, tuple(accepted), tuple(verdicts.values()))


def _felt(name: str, problem: Problem) -> bool:
    """Return whether the blocks feel the correction `name`, which is not free yet."""
    if name in problem.model.names[: problem.free]:
        return False
    points = problem.points
    if name == "drag_drift":
        return np.unique(points.dive).size >= DRIFT_DIVES and float(np.ptp(points.days)) >= DRIFT_DAYS
    return problem.priors.get(name, 0.0) != 0.0


def _trial(problem: Problem, base: Solution, name: str) -> tuple[dict[str, Any], Problem, Solution | None]:
    """Return the account of freeing one correction more, ``why`` not, the larger problem and its solution."""
    free = problem.model.names[: problem.free]
    larger = problem.freeing((*free, name))
    item = problem.model.correction(name)
    account: dict[str, Any] = {
        "name": name,
        "symbol": item.symbol,
        "meaning": item.meaning,
        "delta_bic": math.nan,
        "condition_index": condition_index(larger),
        "correlation": math.nan,
        "correlated_with": "",
        "why": refusal(larger),
    }
    if account["why"]:
        return account, larger, None
    start = _onto(base.x, problem.model.names, larger.model.names)
    solution = solve(larger, weights=base.weights, start=start)
    if solution is None or not solution.converged:
        return account | {"why": "does not converge"}, larger, None
    excess = max(1.0, base.chi_square / max(problem.size - problem.free, 1))
    gain = (base.chi_square + base.penalty - solution.chi_square - solution.penalty) / excess
    account["delta_bic"] = math.log(problem.size) - gain
    std = math.sqrt(excess * solution.covariance[problem.free, problem.free])
    prior = problem.priors.get(name, math.nan)
    with_others = correlation(solution.covariance[: larger.free, : larger.free])[-1, :-1]
    worst = int(np.argmax(np.abs(with_others)))
    account["correlation"] = float(with_others[worst])
    account["correlated_with"] = problem.model.correction(free[worst]).symbol
    apart = experiment((*free, name), problem.points)
    if abs(account["correlation"]) > CORRELATION:
        account["why"] = (
            f"{NOT_APART} {account['correlated_with']} (correlation {signed(account['correlation'], 3)}); {apart}"
        )
    elif account["condition_index"] > CONDITION_DOUBTED:
        account["why"] = f"condition index {account['condition_index']:.0f} (limit {CONDITION_DOUBTED:.0f}); {apart}"
    elif account["delta_bic"] > -EVIDENCE:
        account["why"] = (
            f"not needed: Schwarz's criterion changes by {signed(account['delta_bic'])}, evidence is a fall by "
            f"{EVIDENCE:.0f}"
        )
    elif std > prior:
        account["why"] = f"told less well, ±{std:.2g} {item.unit}, than it was known before, ±{prior:.2g}"
    return account, larger, solution


def _onto(x: Array, names: Sequence[str], others: Sequence[str]) -> Array:
    """Return the values of the corrections `names` in the order of `others`, 0 for one that is new."""
    given = dict(zip(names, x, strict=True))
    return np.array([given.get(name, 0.0) for name in others])

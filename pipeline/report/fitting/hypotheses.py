"""Hypotheses: which of the paper's reasons explains the difference, whether any is needed, and what would tell.

Each hypothesis lets one thing be wrong beyond what is stated; all else keeps to its stated 1-sigma. They are ranked by
their evidence; BIC stands beside it, and how well each predicts dives that it has not seen. A cause is named only when
all causes together are `STRONG` against none, and it against every other: where nothing is wrong a ratio of
probabilities exceeds 20 in at most one case of 20, however many causes are tried, since its mean is 1. The steps of
the scale are those of Kass & Raftery (1995), doi:10.1080/01621459.1995.10476572.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from pipeline.report.covariance import water_of
from pipeline.report.fitting.causes import CAUSES, Cause
from pipeline.report.fitting.evidence import Posterior, Prior, information, posterior, stated, with_cause
from pipeline.report.fitting.experiment import Pair, experiment
from pipeline.report.fitting.fit import select
from pipeline.report.fitting.given import DEFAULT, Given
from pipeline.report.fitting.halves import parts_of
from pipeline.report.fitting.judgement import CONTRADICTED, NOTHING, POSITIVE, STRONG, Judged, Tried, sentence
from pipeline.report.fitting.observations import BALANCE, BatteryPositions, observe
from pipeline.report.fitting.parameters import COEFFICIENTS
from pipeline.report.fitting.regression import Problem
from pipeline.report.rounding import counted
from pipeline.vehicle import Vehicle

#: A cause would be seen where one of its size moves the data by this χ² (3-sigma).
SEEN = 9.0
#: A cause that would be seen only at so many times its size is not seen at any.
BLIND = 100.0
#: Terms whose scatter shows whether it is as assumed.
SCATTERS = ("depth rates", BatteryPositions.name)
#: Least number of blocks.
LEAST = 3
#: Scatter over that assumed beyond which no reason is told: it would hide in an error that has none of them.
UNEXPLAINED = 3.0
#: At most so many parts are left out in turn, each of whole dives.
FOLDS = 5


def rank(
    blocks: pd.DataFrame, vehicle: Vehicle, given: Given = DEFAULT, *, causes: Sequence[Cause] = CAUSES
) -> dict[str, Any]:
    """Return the hypotheses in the order of their evidence, and the verdict.

    Parameters
    ----------
    blocks, vehicle, given
        As for `fit.fit`.
    causes
        What is tried; their order does not matter.

    Returns
    -------
    dict
        For summary.json: ``rows``, ``untested`` (what these data cannot put to the test: ``reason``, ``names``
        and ``words``), ``verdict`` (a sentence), ``named`` (the causes it leaves), ``hinted`` (more
        probable than nothing, but too little), ``hidden`` (in ordinary size these data could not show them),
        ``told_apart``, ``experiment``, and ``reason`` where there is no ranking.
    """
    chosen, reason = select(blocks, vehicle)
    if not reason and len(chosen) < LEAST:
        reason = (
            f"{counted(len(chosen), 'steady block')}: at least {LEAST} are needed to rank what may be wrong with them"
        )
    if reason:
        return _refusal(reason)

    def observed(table: pd.DataFrame, sensor: bool) -> Problem:
        return observe(table, vehicle, replace(given, use_sensor=sensor))

    problem = observed(chosen, given.use_sensor)
    known = stated(problem)
    possible = {cause: _spread(cause, problem) for cause in causes if not _untestable(cause, problem)}
    problem = _widened(problem, known, possible)
    beyond = max(problem.std_factors.values(), default=1.0)
    if beyond > UNEXPLAINED:
        return _refusal(
            f"even all reasons at once leave {beyond:.0f} times the scatter between blocks that was assumed; look for "
            "a wrong number in the vehicle file or in mission.yaml"
        )
    none = posterior(problem, known)
    tried = []
    for cause, spread in possible.items():
        column = problem.model.names.index(cause.unknown)
        prior = with_cause(known, column, spread, cause.expected)
        found, free = (posterior(problem, prior, free=flag) for flag in (False, True))
        ratio = none.minus_two_log_evidence - found.minus_two_log_evidence
        tried.append(Tried(cause, column, spread, prior, found, free, ratio))
    tried.sort(key=lambda one: (-one.ratio, one.cause.name))
    judged = _judged(problem, known, none, tried)
    what = experiment(chosen, observed, known, judged.pairs, given.use_sensor) if judged.pairs else ""
    sigma, tau = water_of(given.settings)
    return {
        "rows": judged.rows,
        "untested": _untested([cause for cause in causes if cause not in possible], problem),
        "verdict": sentence(judged, what),
        "named": [one.cause.name for one in judged.apart or []],
        "hidden": [one.cause.name for one in (*judged.covered, *judged.unseen)],
        "hinted": [one.cause.name for one in judged.hinted],
        "told_apart": judged.told_apart,
        "experiment": what,
        "ratio_together": together([one.ratio for one in tried]) if tried else math.nan,
        "std_factors": dict(problem.std_factors),
        "sigma_w_m_s": sigma,
        "tau_w_s": tau,
        "reason": "",
    }


def together(ratios: Sequence[float]) -> float:
    """Return 2 ln of the mean of the ratios of probabilities of which `ratios` holds 2 ln; −∞ without any.

    Examples
    --------
    >>> round(together([6.0, 6.0]), 6)
    6.0
    """
    if not ratios:
        return -math.inf
    most = max(ratios)
    return most + 2.0 * math.log(sum(math.exp(0.5 * (ratio - most)) for ratio in ratios) / len(ratios))


def _judged(problem: Problem, known: Prior, none: Posterior, tried: Sequence[Tried]) -> Judged:
    """Return rows and verdict of the causes `tried`, the best first."""
    covered, unseen = _hidden(problem, known, tried)
    apart = None
    if tried and together([one.ratio for one in tried]) >= STRONG:
        apart = [one for one in tried if tried[0].ratio - one.ratio < STRONG]
    pairs: list[Pair]
    if apart is None:
        pairs = [(one.cause.unknown, None, _size(one)) for one in unseen]
    else:
        change = float(apart[0].found.x[apart[0].column])
        pairs = [(apart[0].cause.unknown, other.cause.unknown, change) for other in apart[1:]]
    rows = _rows(problem, known, none, tried)
    by_name = {one.cause.name: one for one in tried}
    for row in rows:
        one = by_name.get(row["name"])
        if one is not None:
            row |= {"verdict": _verdict(one, apart, covered, unseen), "seen_from": _seen_from(problem, known, one)}
        else:
            row |= {"verdict": "suffices" if apart is None else "does not suffice", "seen_from": math.nan}
    return Judged(rows, tried, apart, covered, unseen, pairs)


def _size(one: Tried) -> float:
    """Return by how much the cause, of ordinary size, changes its unknown."""
    return math.hypot(one.spread, one.cause.expected)


def _seen_from(problem: Problem, known: Prior, one: Tried) -> float:
    """Return the least change by the cause that these data would show, in its unit; NaN where no size of it shows."""
    least = math.sqrt(SEEN / max(float(information(problem, known, [one.column])[0, 0]), 1e-300))
    return least if least < BLIND * _size(one) else math.nan


def _hidden(problem: Problem, known: Prior, tried: Sequence[Tried]) -> tuple[list[Tried], list[Tried]]:
    """Return the causes that in ordinary size are covered by the stated 1-sigma, and those that the data do not see."""
    covered, unseen = [], []
    for one in tried:
        sure = known.root.copy()
        sure[one.column] = 0.0
        own, alone = (
            float(information(problem, Prior(known.mean, root), [one.column])[0, 0]) * _size(one) ** 2
            for root in (known.root, sure)
        )
        if alone <= SEEN:
            unseen.append(one)
        elif own <= SEEN * (1.0 + 1e-9):
            covered.append(one)
    return covered, unseen


def _untestable(cause: Cause, problem: Problem) -> str:
    """Return why a cause cannot be put to the test, "" where it can."""
    if cause.unknown in problem.model.names:
        return ""
    if cause.unknown == "battery_neutral_position":
        unknown = [name for name in BALANCE if not math.isfinite(problem.model.vehicle[name])]
        return f"the vehicle file leaves {unknown[0]} unknown" if unknown else "no battery position is logged"
    if cause.unknown in ("thrust_scale", "thrust_by_voltage"):
        if not problem.points.powered.any():
            return "no steady flight under propeller"
        if "thrust_scale" not in problem.model.names:
            return "the vehicle file has no thrust law"
        return "no logged battery voltage that changes under propeller"
    return "no roll is logged"


def _spread(cause: Cause, problem: Problem) -> float:
    return cause.spread(problem.model.vehicle, problem.priors[cause.unknown])


def _widened(problem: Problem, known: Prior, causes: Mapping[Cause, float]) -> Problem:
    """Return `problem` with wider 1-sigma where even all causes at once leave more scatter than was assumed."""
    from scipy.special import chdtri

    prior = known
    for cause, spread in causes.items():
        prior = with_cause(prior, problem.model.names.index(cause.unknown), spread)
    full = posterior(problem, prior)
    factors: dict[str, float] = {}
    first = 0
    for term in problem.terms:
        rows = slice(first, first + term.dives.size)
        first = rows.stop
        if term.name not in SCATTERS:
            continue
        chi_square, freedom = float(np.sum(full.residual[rows] ** 2)), float(np.sum(1.0 - full.leverage[rows]))
        excessive = freedom > 1.0 and chi_square > float(chdtri(freedom, 0.025))
        factors[term.name] = math.sqrt(chi_square / freedom) if excessive else 1.0
    return replace(problem, std_factors=factors)


def _rows(problem: Problem, known: Prior, none: Posterior, tried: Sequence[Tried]) -> list[dict[str, Any]]:
    """Return one row a hypothesis, by falling evidence."""
    vehicle, paid = problem.model.vehicle, math.log(problem.size)
    rows: list[dict[str, Any]] = [
        {
            "name": NOTHING,
            "words": "Nothing is wrong beyond what is stated",
            "parameters": _pulls(problem, none, 1.0),
            "contradicted": _pulls(problem, none, CONTRADICTED),
            "bic": none.minus_two_log_evidence,
            "left_out_rmse_m_s": left_out(problem, known, none),
            "ratio": 0.0,
        }
    ]
    rows += [
        {
            "name": one.cause.name,
            "words": one.cause.words,
            "parameters": [_parameter(problem, one.found, one.column, one.spread, vehicle)],
            "contradicted": _pulls(problem, one.found, CONTRADICTED, but=one.column),
            "bic": one.free.minus_two_log_evidence + paid,
            "left_out_rmse_m_s": left_out(problem, one.prior, one.found),
            "ratio": one.ratio,
        }
        for one in tried
    ]
    least = min(row["bic"] for row in rows)
    # Nothing weighs as much beforehand as all causes together.
    odds = [row["ratio"] - (2.0 * math.log(len(tried)) if row["name"] != NOTHING else 0.0) for row in rows]
    total = sum(math.exp(0.5 * (value - max(odds))) for value in odds)
    for row, value in zip(rows, odds, strict=True):
        row |= {"delta_bic": row["bic"] - least, "weight": math.exp(0.5 * (value - max(odds))) / total}
    return sorted(rows, key=lambda row: (-row["weight"], row["name"]))


def _parameter(problem: Problem, found: Posterior, column: int, size: float, vehicle: Vehicle) -> dict[str, Any]:
    """Return an unknown after the data; `size` is its 1-sigma before them."""
    name = problem.model.names[column]
    item = problem.model.correction(name)
    value, std = float(found.x[column]), math.sqrt(found.covariance[column, column])
    base = vehicle[name] if name in COEFFICIENTS else math.nan
    share = 100.0 / base if base and math.isfinite(base) else math.nan
    return {
        "name": name,
        "symbol": item.symbol,
        "value": value,
        "std": std,
        "unit": item.unit,
        "percent": share * value,
        "percent_std": share * std,
        "size": size,
    }


def _pulls(problem: Problem, found: Posterior, least: float, but: int = -1) -> list[dict[str, Any]]:
    """Return the unknowns, `but` one, that were moved by so many stated 1-sigma or more, the most moved first."""
    stds = [problem.priors[name] for name in problem.model.names]
    moved = [(abs(float(found.x[i])) / std, i) for i, std in enumerate(stds) if std > 0.0 and i != but]
    return [
        _parameter(problem, found, i, stds[i], problem.model.vehicle)
        for pull, i in sorted(moved, reverse=True)
        if pull >= least
    ]


def _verdict(one: Tried, apart: Sequence[Tried] | None, covered: Sequence[Tried], unseen: Sequence[Tried]) -> str:
    if apart is not None and one in apart:
        return "explains the difference" if len(apart) == 1 else "may explain the difference"
    if apart is None and one.ratio >= POSITIVE:
        return "hinted at"
    if one in unseen:
        return "would not be seen in these data"
    if one in covered:
        return "would lie within what is stated"
    return "not needed" if apart is None else "not needed beside the better ones"


def _untested(causes: Sequence[Cause], problem: Problem) -> list[dict[str, Any]]:
    """Return why causes cannot be put to the test, and which of them for each reason."""
    alike: dict[str, list[Cause]] = {}
    for cause in causes:
        alike.setdefault(_untestable(cause, problem), []).append(cause)
    return [
        {"reason": reason, "names": [one.name for one in those], "words": [one.words for one in those]}
        for reason, those in alike.items()
    ]


def left_out(problem: Problem, prior: Prior, found: Posterior) -> float:
    """Return the RMSE of the depth rates of dives left out, by the hypothesis fitted to the others, m/s.

    Theory is taken as linear around `found`. NaN with one dive only.
    """
    dives = np.unique(problem.points.dive)
    if dives.size < 2:
        return math.nan
    flight = problem.model.fly(found.x)
    rest, by_rest = problem.points.depth_rate - flight.depth_rate, flight.depth_rate_by @ prior.root
    squares = 0.0
    count = min(FOLDS, dives.size)
    part_of = parts_of(problem.points, count)
    for part in range(count):
        outside = part_of == part
        left, slope = problem.of(problem.points.only(~outside)).evaluate(found.x)
        slope = slope @ prior.root
        change = np.linalg.solve(slope.T @ slope + np.eye(found.y.size), -slope.T @ left - found.y)
        squares += float(np.sum((rest[outside] - by_rest[outside] @ change) ** 2))
    return math.sqrt(squares / problem.points.size)


def _refusal(reason: str) -> dict[str, Any]:
    return {
        "rows": [],
        "untested": [],
        "verdict": f"What may be wrong cannot be ranked: {reason}.",
        "named": [],
        "hidden": [],
        "hinted": [],
        "told_apart": False,
        "experiment": "",
        "ratio_together": math.nan,
        "std_factors": {},
        "sigma_w_m_s": math.nan,
        "tau_w_s": math.nan,
        "reason": reason,
    }

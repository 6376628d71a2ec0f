"""The fit as summary.json tells it: values with prior and verdict, what was borrowed, what was refused and why."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.report.fitting.goodness import NONE
from pipeline.report.fitting.heldout import LEFT_OUT
from pipeline.report.fitting.model import Model
from pipeline.report.fitting.parameters import AT, COEFFICIENTS, NEVER_NEGATIVE
from pipeline.report.fitting.regression import Problem, Solution
from pipeline.report.fitting.selection import (
    CONDITION_DOUBTED,
    CONDITION_REFUSED,
    CORRELATION,
    condition_index,
    correlation,
    experiment,
)
from pipeline.report.fitting.terms import DepthRates
from pipeline.report.fitting.text import text
from pipeline.report.rounding import amount

#: Beyond so many 1-sigma a value strains its prior, and contradicts it.
STRAIN = 2.0
CONTRADICTION = 3.0
#: From this share of the prior's 1-sigma on a value is told by data and prior together, not by the data alone.
SHARED = 0.5
#: Condition indices above which a set of corrections is doubted, and refused.
LIMITS = {"doubted": CONDITION_DOUBTED, "refused": CONDITION_REFUSED}


def account(problem: Problem, alone: Solution, both: Solution, inflation: float) -> dict[str, Any]:
    """Return what was found, from the data alone and with the priors of what is free.

    Parameters
    ----------
    problem
        What was fitted.
    alone, both
        Its solution without and with the priors of what is free.
    inflation
        Factor on all 1-sigma for scatter and colour beyond what was assumed.
    """
    count, model = problem.free, problem.model
    free, condition = model.names[:count], condition_index(problem)
    covariance = alone.covariance[:count, :count] * inflation**2
    correlations = correlation(covariance)
    apart = [
        (i, j)
        for i in range(count)
        for j in range(i + 1, count)
        if abs(correlations[i, j]) > CORRELATION or condition > CONDITION_DOUBTED
    ]
    parameters = []
    for i, name in enumerate(free):
        found = (float(alone.x[i]), math.sqrt(covariance[i, i]))
        with_prior = (float(both.x[i]), math.sqrt(both.covariance[i, i]) * inflation)
        prior = problem.priors.get(name, math.nan)
        parameters.append(
            parameter(name, model, found, with_prior, prior) | {"verdict": _verdict(i, apart, problem, found, prior)}
        )
    freedom = problem.size - count
    return {
        "reason": "",
        "parameters": parameters,
        "correlation": correlations.tolist(),
        "covariance": covariance.tolist(),
        "joint": {
            "names": list(model.names),
            "value": alone.x.tolist(),
            "covariance": alone.covariance.tolist(),
        },
        "condition_index": condition,
        "condition_limits": LIMITS,
        "values_fitted": problem.size,
        "degrees_of_freedom": freedom,
        "chi_square": alone.chi_square,
        "reduced_chi_square": alone.chi_square / freedom if freedom > 0 else math.nan,
        "bic": alone.bic(count),
        "std_inflation": inflation,
        "compared_with": [term.name for term in problem.terms if term.dives.size],
        "borrowed": [
            _borrowing(name, model, problem.priors[name], float(both.x[i] / problem.priors[name]))
            for i, name in enumerate(model.names)
            if i >= count
        ],
        "contradictions": [
            f"{item['symbol']} is {amount(item['value'], item['std'])} {item['unit']} by the data and "
            f"0 ± {item['prior_std']:.2g} by the vehicle file: both cannot be right"
            for item in parameters
            if item["verdict"].endswith("against the prior")
        ]
        + [sentence for item in parameters if (sentence := impossible(item))],
    }


def residuals(problem: Problem, alone: Solution) -> dict[str, list[float]]:
    """Return each block's depth rate less the predicted one, before and after the corrections from the data alone."""
    points = problem.points
    before, after = (problem.model.fly(x) for x in (np.zeros_like(alone.x), alone.x))
    std = next(term.std for term in problem.terms if isinstance(term, DepthRates))
    return {
        "block": points.block.tolist(),
        "time_s": (0.5 * (points.start + points.end)).tolist(),
        "before_m_s": (points.depth_rate - before.depth_rate).tolist(),
        "after_m_s": (points.depth_rate - after.depth_rate).tolist(),
        "std_m_s": std.tolist(),
        "direction": points.direction.tolist(),
        "pitch_deg": np.degrees(points.pitch).tolist(),
        "depth_m": points.depth.tolist(),
        "speed_m_s": after.speed.tolist(),
        "heading_deg": np.degrees(points.heading).tolist(),
    }


def refused(problem: Problem, sizes: Mapping[str, Any], reason: str, condition: float) -> dict[str, Any]:
    """Return a fit without values, and why."""
    none, model = (math.nan, math.nan), problem.model
    result: dict[str, Any] = {
        "reason": reason,
        "parameters": [
            parameter(name, model, none, none, problem.priors.get(name, math.nan)) | {"verdict": reason}
            for name in model.names[: problem.free]
        ],
        "correlation": [],
        "covariance": [],
        "joint": {"names": [], "value": [], "covariance": []},
        "condition_index": condition,
        "condition_limits": LIMITS,
        "values_fitted": 0,
        "degrees_of_freedom": 0,
        "chi_square": math.nan,
        "reduced_chi_square": math.nan,
        "bic": math.nan,
        "std_inflation": math.nan,
        "depth_rate_scatter": math.nan,
        "compared_with": [],
        "borrowed": [],
        "contradictions": [],
        "residuals": {},
        "selection": {"accepted": [], "rejected": []},
        "robust": {"loss": "none", "outliers": 0, "sentence": ""},
        "colour": None,
        "goodness": dict(NONE),
        "bootstrap": None,
        "profiles": [],
        "battery": None,
        "lift_kept": {"percent": math.nan, "percent_std": math.nan},
        **sizes,
        "left_out_dives": dict.fromkeys(LEFT_OUT) | {"dives": sizes["dives"], "halves": [], "reason": reason},
    }
    result["text"] = text(result)
    return result


def parameter(
    name: str, model: Model, alone: tuple[float, float], both: tuple[float, float], prior: float
) -> dict[str, Any]:
    """Return one row of the table: value and 1-sigma from the data alone, with the prior, and as a percentage."""
    item = model.correction(name)
    kind = name.partition(AT)[0]
    base = model.vehicle[kind] if kind in COEFFICIENTS else math.nan
    relative = 100.0 / base if base and math.isfinite(base) else math.nan
    return {
        "name": name,
        "symbol": item.symbol,
        "unit": item.unit,
        "meaning": item.meaning,
        "value": alone[0],
        "std": alone[1],
        "value_with_prior": both[0],
        "std_with_prior": both[1],
        "prior_std": prior,
        "vehicle_value": base,
        "percent": alone[0] * relative,
        "percent_std": alone[1] * relative,
        "percent_with_prior": both[0] * relative,
        "percent_std_with_prior": both[1] * relative,
        "interval_95": [math.nan, math.nan],
        "bootstrap_std": math.nan,
    }


def told(std: float, prior_std: float) -> bool:
    """Return whether the data alone tell a correction at least as well as was known before, by both 1-sigma."""
    return not std > prior_std


def _verdict(
    i: int,
    apart: Sequence[tuple[int, int]],
    problem: Problem,
    found: tuple[float, float],
    prior: float,
) -> str:
    """Return what the data say of correction `i`, `found` with its 1-sigma."""
    free = problem.model.names[: problem.free]
    others = [free[b if a == i else a] for a, b in apart if i in (a, b)]
    if others:
        symbols = " and ".join(problem.model.correction(other).symbol for other in others)
        return f"cannot be told apart from {symbols}; {experiment(free, problem.points)}"
    value, std = found
    if math.isfinite(prior) and std > prior and abs(value) < CONTRADICTION * std:
        return "not determined: prior decides"
    if math.isfinite(prior) and std > SHARED * prior and abs(value) < CONTRADICTION * std:
        return "partly determined: prior says as much"
    if math.isfinite(prior) and abs(value) > CONTRADICTION * math.hypot(std, prior):
        return "determined by the data, against the prior"
    return "determined by the data"


def impossible(item: Mapping[str, Any]) -> str:
    """Return a sentence on what comes out negative by more than `STRAIN` 1-sigma and cannot be, "" on all else."""
    base = NEVER_NEGATIVE.get(item["name"])
    if base is None:
        return ""
    whole = item["value"] + (item["vehicle_value"] if math.isnan(base) else base)
    if not whole < -STRAIN * item["std"]:
        return ""
    found = f"{item['symbol']} is {amount(item['value'], item['std'])} {item['unit']} by the data"
    return (
        f"{found}: {item['meaning']}, in all, would be negative, which it cannot be; "
        "something else acts that is not in the model"
    )


def _held(pull: float) -> str:
    """Return in words how far what is borrowed was pulled from its prior, in 1-sigma."""
    if pull > CONTRADICTION:
        return "contradicts its prior"
    return "strains its prior" if pull > STRAIN else "held within its prior"


def _borrowing(name: str, model: Model, prior: float, pull: float) -> dict[str, Any]:
    item = model.correction(name)
    return {
        "name": name,
        "symbol": item.symbol,
        "unit": item.unit,
        "meaning": item.meaning,
        "prior_std": prior,
        "pull_std": pull,
        "verdict": _held(abs(pull)),
    }


def inflation_of(problem: Problem, alone: Solution, effective: float) -> float:
    """Return the factor on all 1-sigma for scatter beyond what was assumed and for coloured residuals."""
    from scipy.special import chdtri

    freedom = problem.size - problem.free
    excessive = freedom > 0 and alone.chi_square > float(chdtri(freedom, 0.025))
    scatter = alone.chi_square / freedom if excessive else 1.0
    return math.sqrt(scatter * max(problem.points.size / effective, 1.0))


def outliers(problem: Problem, places: NDArray[np.int64]) -> dict[str, Any]:
    """Return which residuals were weighted down, for a reader."""
    count = int(places.size)
    blocks = [int(problem.points.block[place]) for place in places if place < problem.points.size]
    sentence = ""
    if count:
        verbs = "is an outlier and counts" if count == 1 else "are outliers and count"
        sentence = f"{count} of {problem.size} values {verbs} for less (Huber's loss)"
    if blocks:
        listed = ", ".join(str(block) for block in blocks[:10]) + ("" if len(blocks) <= 10 else " …")
        sentence += f": {'block' if len(blocks) == 1 else 'blocks'} {listed}"
    return {"loss": "huber" if count else "none", "outliers": count, "blocks": blocks, "sentence": sentence}

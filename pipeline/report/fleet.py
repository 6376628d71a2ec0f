"""The vehicles of a campaign: what several missions of one vehicle say together of each of its coefficients.

What a mission's data say is taken, not what came out with the prior of the vehicle file; that prior, and those of what
all missions borrowed from the same file, are applied once. What a mission borrowed of its own, the bias of its pitch
sensor or its ballast, is in its own 1-sigma.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.report.fitting.hierarchy import (
    EVIDENCE,
    LEAST_DRIFT,
    Pooled,
    Prior,
    Spread,
    evidence,
    homogeneity,
    pool,
)
from pipeline.report.fitting.parameters import AT, COEFFICIENTS, correction
from pipeline.report.rounding import amount

Array = NDArray[np.float64]

#: Below this probability missions are said to differ; beyond so many 1-sigma a mean, to differ from the vehicle file.
DIFFERENT, SIGNIFICANT = 0.05, 2.0
#: s; a drift is per year, and is not looked for where missions are closer together than a week.
YEAR, WEEK = 365.25 * 86400.0, 7 * 86400.0


class Found(NamedTuple):
    """What one mission's data say of a coefficient, were what is borrowed in common known.

    Attributes
    ----------
    mission
        Its name.
    time
        Of its middle, s since 1970.
    value, variance
        With the common unknowns at 0, and the variance that is its own.
    std
        As the mission reports it, with all that it borrowed.
    slope
        Change of the value per unit of each common unknown.
    information, pull
        What its data say of the common unknowns: inverse covariance, and that times their value.
    base, prior
        Value in the vehicle file and its 1-sigma.
    """

    mission: str
    time: float
    value: float
    variance: float
    std: float
    slope: Array
    information: Array
    pull: Array
    base: float
    prior: float


def fleet(summaries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return what the missions say together of each vehicle, in the order of their names.

    Parameters
    ----------
    summaries
        The content of each summary.json; missions that failed are left out.

    Returns
    -------
    list of dict
        For each vehicle ``vehicle``, ``missions``, ``reason`` why nothing can be said, ``left_out`` (missions without a
        fit, and why) and ``coefficients``.
    """
    done = [summary for summary in summaries if "error" not in summary]
    names = sorted({str(summary["vehicle"]["name"]) for summary in done})
    return [_vehicle(name, [each for each in done if each["vehicle"]["name"] == name]) for name in names]


def _vehicle(name: str, flown: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    flown = sorted(flown, key=lambda summary: (summary["data"]["start"], summary["mission"]))
    left_out = [
        {"mission": summary["mission"], "reason": summary["fit"]["reason"]}
        for summary in flown
        if summary["fit"]["reason"]
    ]
    fitted = [summary for summary in flown if not summary["fit"]["reason"]]
    free = dict.fromkeys(item["name"] for summary in fitted for item in summary["fit"]["parameters"])
    reason = ""
    if len(flown) < 2:
        reason = "cannot be said: one mission only"
    elif len(fitted) < 2:
        have = "has" if len(fitted) == 1 else "have"
        reason = f"cannot be said: {len(fitted)} of {len(flown)} missions {have} a fit"
    return {
        "vehicle": name,
        "missions": [summary["mission"] for summary in flown],
        "reason": reason,
        "left_out": left_out,
        "coefficients": [] if reason else [_coefficient(each, fitted) for each in free],
    }


def common(fitted: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return what all of some missions borrowed from one value of the vehicle file, and its 1-sigma there."""
    found: dict[str, set[tuple[Any, float]]] = {}
    for summary in fitted:
        values = {item["name"]: item["value"] for item in summary["vehicle"]["coefficients"]}
        for item in summary["fit"]["borrowed"]:
            name = item["name"]
            if name in COEFFICIENTS or name == "thrust_scale":
                base = values.get("thrust_static" if name == "thrust_scale" else name)
                found.setdefault(name, set()).add((base, float(item["prior_std"])))
    return {name: next(iter(pairs))[1] for name, pairs in found.items() if len(pairs) == 1}


def found_by(summary: Mapping[str, Any], name: str, shared: Mapping[str, float]) -> Found | None:
    """Return what one mission's data say of the coefficient `name`, None if they say nothing.

    Parameters
    ----------
    summary
        The content of its summary.json.
    name
        One of the corrections of `fitting.parameters`.
    shared
        Common unknowns with their prior 1-sigma.
    """
    fit = summary["fit"]
    item = next((item for item in fit["parameters"] if item["name"] == name), None)
    if item is None or not _known(item["value"]) or not _known(item["std"]) or not item["std"] > 0.0:
        return None
    names, joint = list(fit["joint"]["names"]), np.asarray(fit["joint"]["covariance"], dtype=np.float64)
    place, value = names.index(name), np.asarray(fit["joint"]["value"], dtype=np.float64)
    inflation = float(fit["std_inflation"]) ** 2
    own = [k for k, other in enumerate(shared) if other in names and other != name]
    at = [names.index(list(shared)[k]) for k in own]
    slope, information, pull = np.zeros(len(shared)), np.zeros((len(shared),) * 2), np.zeros(len(shared))
    variance = joint[place, place]
    if at:
        inverse = np.linalg.inv(joint[np.ix_(at, at)])
        slope[own] = joint[place, at] @ inverse
        variance -= slope[own] @ joint[at, place]
        prior = np.diag([shared[names[k]] ** -2 for k in at])
        information[np.ix_(own, own)] = _positive(inverse - prior) / inflation
        pull[own] = inverse @ value[at] / inflation
    base = float(item["vehicle_value"]) if _known(item["vehicle_value"]) and AT not in name else 0.0
    return Found(
        str(summary["mission"]),
        _middle(summary["data"]),
        base + float(value[place] - slope[own] @ value[at]),
        float(variance * inflation),
        float(item["std"]),
        slope,
        information,
        pull,
        base,
        float(item["prior_std"]) if _known(item["prior_std"]) else math.nan,
    )


def together(found: Sequence[Found], shared: Mapping[str, float]) -> tuple[Array, Array]:
    """Return what each mission's data say of a coefficient, shape (n,), and the covariance of that, shape (n, n).

    What all of them borrowed is known by its prior, once, and by what every mission's data say of it.
    """
    own = np.diag([each.variance for each in found])
    value = np.array([each.value for each in found])
    if not shared:
        return value, own
    slope = np.stack([each.slope for each in found])
    precision = np.diag([std**-2 for std in shared.values()]) + np.sum([each.information for each in found], axis=0)
    covariance = np.linalg.inv(precision)
    best = covariance @ np.sum([each.pull for each in found], axis=0)
    return value + slope @ best, own + slope @ covariance @ slope.T


def _coefficient(name: str, fitted: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return what the missions say together of one coefficient."""
    shared = common(fitted)
    shared.pop(name, None)
    listed = [item for summary in fitted for item in summary["fit"]["parameters"] if item["name"] == name]
    found = [each for summary in fitted if (each := found_by(summary, name, shared)) is not None]
    size = correction(name.partition(AT)[0]).size
    first = listed[0]
    bases, priors = {each.base for each in found}, {each.prior for each in found}
    one_file = len(bases) == 1 and len(priors) == 1
    base, prior_std = found[0].base if one_file else math.nan, found[0].prior if one_file else math.nan
    relative = base != 0.0 and first["name"] in COEFFICIENTS
    whole = {item["vehicle_value"] for item in listed if _known(item["vehicle_value"])}
    out: dict[str, Any] = {
        "name": name,
        "symbol": first["symbol"].removeprefix("Δ") if relative else first["symbol"],
        "meaning": first["meaning"],
        "unit": first["unit"],
        "vehicle_value": base,
        "relative_to": whole.pop() if len(whole) == 1 else math.nan,
        "prior_std": prior_std,
        "reason": "",
    }
    if len(found) < 2:
        return out | {"reason": f"cannot be said: {len(found)} mission determines it", "verdict": "", "missions": []}
    value, covariance = together(found, shared)
    time = np.array([each.time for each in found])
    scale = prior_std if math.isfinite(prior_std) and prior_std > 0.0 else size
    years = (time - time.mean()) / YEAR
    drift = _drift(value, covariance, years, scale)
    pooled = pool(value, covariance, scale, time=years if drift["supported"] else None)
    held = pooled
    if math.isfinite(prior_std) and prior_std > 0.0:
        held = pool(value, covariance, scale, time=years if drift["supported"] else None, prior=Prior(base, prior_std))
    statistic, probability = homogeneity(value, covariance)
    out |= {
        **_spread("", pooled.vehicle),
        **_spread("with_prior_", held.vehicle),
        **_spread("next_", pooled.next),
        **_spread("scatter_", pooled.scatter),
        "homogeneity_q": statistic,
        "homogeneity_p": probability,
        "drift": drift,
        "missions": [
            {"mission": each.mission, "time": _date(each.time), "value": float(value[i]), "std": each.std}
            | _spread("shrunken_", pooled.missions[i])
            for i, each in enumerate(found)
        ],
    }
    return out | {"verdict": _verdict(out, pooled)}


def _drift(value: Array, covariance: Array, years: Array, scale: float) -> dict[str, Any]:
    """Return whether the data tell a drift in time, how large it is, or why that cannot be said."""
    out: dict[str, Any] = {"supported": False, "delta_bic": math.nan, **_spread("", Spread(*[math.nan] * 4))}
    if value.size < LEAST_DRIFT:
        return out | {"reason": f"a drift in time would take {LEAST_DRIFT} missions"}
    if float(np.ptp(years)) * YEAR < WEEK:
        return out | {"reason": "a drift in time would take missions more than a week apart"}
    change = evidence(value, covariance, years, scale)
    slope = pool(value, covariance, scale, time=years).drift
    assert slope is not None
    supported = change < -EVIDENCE and not slope.low <= 0.0 <= slope.high
    words = "it drifts in time" if supported else "no drift in time is told"
    return out | {
        "supported": supported,
        "delta_bic": change,
        **_spread("", slope),
        "reason": f"{words}: Schwarz's criterion changes by {change:+.1f}".replace("-", "−"),
    }


def _verdict(found: Mapping[str, Any], pooled: Pooled) -> str:
    """Return what the missions say together, in words."""
    if found["homogeneity_p"] < DIFFERENT:
        words = "the missions differ by more than their 1σ"
    else:
        words = "the missions agree within their 1σ"
    gap = pooled.vehicle.value - found["vehicle_value"]
    if math.isfinite(gap):
        if abs(gap) > SIGNIFICANT * pooled.vehicle.std:
            size = amount(gap, pooled.vehicle.std, sign=True)
            words += f"; the vehicle differs from its file by {size} {found['unit']}"
        else:
            words += "; the vehicle is as in its file"
    return words + (f"; {found['drift']['reason']}" if found["drift"]["supported"] else "")


def _spread(prefix: str, spread: Spread) -> dict[str, float]:
    return {f"{prefix}{name}": value for name, value in spread._asdict().items()}


def _positive(matrix: NDArray[Any]) -> Array:
    """Return a symmetric matrix without what is negative in it, which can only be by rounding."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _known(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)


def _middle(data: Mapping[str, Any]) -> float:
    ends = [datetime.fromisoformat(str(data[name]).replace("Z", "+00:00")).timestamp() for name in ("start", "end")]
    return 0.5 * (ends[0] + ends[1])


def _date(time: float) -> str:
    from datetime import UTC

    return f"{datetime.fromtimestamp(time, UTC):%Y-%m-%d}"

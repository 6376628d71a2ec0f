"""Which correction explains the difference: drag and buoyancy fitted to block means of the depth rate.

Generalised least squares on the means of steady blocks: the residual is the measured depth rate less the one that
theory gives with the measured pitch held and the propeller speed as logged; its covariance is the measurement's and
that of the water's vertical velocity, which neighbouring blocks share. What the fit does not free but borrows – lift,
induced drag, thrust, pitch bias – stays in it as an unknown held by its 1-sigma, so that the standard deviations of
what is free are honest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from pipeline.records import seconds
from pipeline.report.compare import floats
from pipeline.report.fitting.model import Array, Model
from pipeline.report.fitting.parameters import COEFFICIENTS, CORRECTIONS, prior_stds
from pipeline.report.fitting.regression import Data, Solution, assemble, condition_index, solve
from pipeline.report.fitting.text import text
from pipeline.vehicle import Vehicle

#: What is fitted unless something else is asked for.
FREE = ("parasite_drag", "net_buoyancy")
#: Above these a pair cannot be told apart, the free set is doubted, and is refused (Belsley et al. 1980).
CORRELATION = 0.95
CONDITION_DOUBTED = 30.0
CONDITION_REFUSED = 1000.0
#: Beyond this many 1-sigma a value contradicts its prior.
CONTRADICTION = 3.0

LEFT_OUT = ("rmse_before_m_s", "rmse_after_m_s", "speed_rmse_before_m_s", "speed_rmse_after_m_s")


def fit(
    blocks: pd.DataFrame,
    vehicle: Vehicle,
    *,
    settings: Mapping[str, Any] | None = None,
    free: Sequence[str] = FREE,
    ballast_std: float = 0.3,
    pitch_std: float = math.radians(0.3),
    use_sensor: bool = False,
    gps: tuple[float, float] | None = None,
) -> dict[str, Any]:
    """Return the fitted corrections with everything a reader needs to trust or doubt them.

    Parameters
    ----------
    blocks
        The canonical table `records.BLOCKS`.
    vehicle
        The vehicle whose coefficients are corrected; its 1-sigma are the priors.
    settings
        The estimator's ``sigma_w`` [m/s] and ``tau_w`` [s].
    free
        What is fitted, of `CORRECTIONS`.
    ballast_std, pitch_std
        Prior 1-sigma of the constant part of net buoyancy, N, and of the pitch bias, rad.
    use_sensor
        Whether speeds by the sensor are fitted, rather than held out.
    gps
        Speed of level powered flight and its 1-sigma, m/s.

    Returns
    -------
    dict
        For summary.json: ``parameters`` (from the data alone, with prior, verdict), ``correlation``,
        ``condition_index``, ``chi_square``, ``left_out_dives``, ``borrowed``, ``text``; ``reason`` where there is
        no fit, and then no value either.
    """
    chosen, reason = select(blocks, vehicle)
    priors = prior_stds(vehicle, chosen, ballast_std, pitch_std)
    borrowed = tuple(name for name, std in priors.items() if name not in free and std > 0)
    model = Model(vehicle, (*free, *borrowed))
    used = int(blocks["used"].sum()) if len(blocks) else 0
    sizes = {"blocks_steady": used, "blocks": len(chosen), "dives": int(chosen["dive"].nunique())}
    if not reason and len(chosen) <= len(free):
        reason = f"{len(chosen)} steady block(s) for {len(free)} corrections: at least {len(free) + 1} are needed"
    if reason:
        return _refusal(model, free, priors, sizes, reason, math.nan)
    data = assemble(chosen, settings, use_sensor, gps)
    sizes |= {"sensor_speeds": int(data.sensor.size), "gps_speeds": int(data.level.size > 0)}
    condition = condition_index(data, model, np.zeros(len(model.names)), len(free))
    if not condition <= CONDITION_REFUSED:
        words = f"condition index {condition:.0f}" if condition < 1e9 else "a singular set"
        reason = f"refused, {words} (limit {CONDITION_REFUSED:.0f}): {_cannot(free)}; {experiment(free, chosen)}"
        return _refusal(model, free, priors, sizes, reason, condition)
    alone = solve(data, model, priors, prior_on_free=False, free=len(free))
    both = solve(data, model, priors, prior_on_free=True, free=len(free))
    if alone is None or both is None:
        reason = "the fit does not converge: look at pitch and buoyancy of the blocks"
        return _refusal(model, free, priors, sizes, reason, condition)
    result = _result(data, model, alone, both, priors, free, condition) | sizes
    result["residuals"] = _residuals(data, model, alone)
    result["left_out_dives"] = left_out_dives(data, model, priors, settings, len(free))
    result["text"] = text(result)
    return result


def select(blocks: pd.DataFrame, vehicle: Vehicle) -> tuple[pd.DataFrame, str]:
    """Return the blocks that theory can predict, in time order, and why there are none."""
    used = blocks[blocks["used"].to_numpy(dtype=bool)].sort_values("start", kind="stable").reset_index(drop=True)
    if used.empty:
        return used, "no steady block"
    present = np.ones(len(used), dtype=bool)
    for name, words in {"depth_rate": "depth rate", "net_buoyancy": "net buoyancy", "pitch": "pitch"}.items():
        finite = np.isfinite(floats(used, name))
        if not finite.any():
            return used[finite], f"no steady block with a {words}"
        present &= finite
    unknown = [name for name in ("lift_slope", "parasite_drag", "induced_drag") if not math.isfinite(vehicle[name])]
    if unknown:
        return used.iloc[:0], f"the vehicle file leaves {', '.join(unknown)} unknown"
    used = used[present].reset_index(drop=True)
    speed, _rate = Model(vehicle, ()).predict(used, np.zeros(0))
    flies = np.isfinite(speed)
    if not flies.any():
        return used[flies], "theory has no steady flight at the pitch and buoyancy of any block"
    return used[flies].reset_index(drop=True), ""


def left_out_dives(
    data: Data, model: Model, priors: Mapping[str, float], settings: Mapping[str, Any] | None, free: int
) -> dict[str, Any]:
    """Return how well corrections fitted on every other dive predict the others.

    Returns
    -------
    dict
        RMSE of the depth rate, and of the sensor's speed where there is one, before and after the corrections, m/s,
        every block predicted by the half of the dives that it is not in; ``reason`` where that cannot be had.
    """
    dives = np.unique(data.blocks["dive"].to_numpy())
    out: dict[str, Any] = dict.fromkeys(LEFT_OUT) | {"dives": int(dives.size), "reason": ""}
    if dives.size < 2:
        return out | {"reason": "one dive only: none can be left out"}
    zero = np.zeros(len(model.names))
    before_speed, before_rate = model.predict(data.blocks, zero)
    after_speed, after_rate = np.full_like(before_speed, np.nan), np.full_like(before_rate, np.nan)
    for part in (0, 1):
        inside = np.isin(data.blocks["dive"].to_numpy(), dives[part::2])
        half = data.blocks[inside].reset_index(drop=True)
        training = assemble(half, settings, data.sensor.size > 0, data.gps if data.level.size else None)
        known = len(half) > free and condition_index(training, model, zero, free) <= CONDITION_REFUSED
        solution = solve(training, model, priors, prior_on_free=True, free=free) if known else None
        if solution is None:
            return out | {"reason": "half of the dives does not determine the corrections"}
        speed, rate = model.predict(data.blocks, solution.x)
        after_speed[~inside], after_rate[~inside] = speed[~inside], rate[~inside]
    measured, sensed = floats(data.blocks, "depth_rate"), floats(data.blocks, "sensor_speed")
    differences = (measured - before_rate, measured - after_rate, sensed - before_speed, sensed - after_speed)
    return out | {key: _rms(values) for key, values in zip(LEFT_OUT, differences, strict=True)}


def experiment(names: Sequence[str], blocks: pd.DataFrame) -> str:
    """Return which experiment would separate the corrections `names`, given what these blocks already have."""
    down, up = (bool((blocks["direction"] == side).any()) for side in (-1, 1))
    propeller = blocks["powered"].any() and not blocks["powered"].all()
    wanted = []
    if {"net_buoyancy", "parasite_drag"} <= set(names) and not (down and up):
        missing = ("climbs", "dives") if down else ("dives", "climbs")
        wanted.append(f"{missing[0]} flown like the {missing[1]}" if down or up else "dives and climbs flown alike")
    if "thrust_scale" in names and not propeller:
        wanted.append("the same pitch with the propeller on and off")
    if {"lift_slope", "induced_drag"} & set(names):
        wanted.append("a speed sensor, or GPS fixes on many headings")
    if "pitch" in names or not wanted:
        wanted.append("two buoyancies and two pitches in both directions")
    return "would be resolved by " + " and ".join(wanted)


def _result(
    data: Data,
    model: Model,
    alone: Solution,
    both: Solution,
    priors: Mapping[str, float],
    free: Sequence[str],
    condition: float,
) -> dict[str, Any]:
    """Return the fit for summary.json, without the dives left out."""
    from scipy.special import chdtri

    count = len(free)
    freedom = data.size - count
    excessive = freedom > 0 and alone.chi_square > float(chdtri(freedom, 0.025))
    inflation = alone.chi_square / freedom if excessive else 1.0
    covariance = alone.covariance[:count, :count] * inflation
    correlation = covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    apart = [
        (i, j)
        for i in range(count)
        for j in range(i + 1, count)
        if abs(correlation[i, j]) > CORRELATION or condition > CONDITION_DOUBTED
    ]
    parameters = []
    for i, name in enumerate(free):
        std = math.sqrt(covariance[i, i])
        prior_std = math.sqrt(both.covariance[i, i] * inflation)
        parameters.append(
            _parameter(name, model.vehicle, (alone.x[i], std), (both.x[i], prior_std), priors[name])
            | {"verdict": _verdict(i, apart, free, (alone.x[i], std), priors[name], data.blocks)}
        )
    return {
        "reason": "",
        "parameters": parameters,
        "correlation": correlation.tolist(),
        "covariance": covariance.tolist(),
        "condition_index": condition,
        "values_fitted": data.size,
        "degrees_of_freedom": freedom,
        "chi_square": alone.chi_square,
        "reduced_chi_square": alone.chi_square / freedom if freedom > 0 else math.nan,
        "std_inflation": math.sqrt(inflation),
        "borrowed": [
            _borrowing(name, priors[name], float(both.x[i] / priors[name]))
            for i, name in enumerate(model.names)
            if i >= count
        ],
    }


def _residuals(data: Data, model: Model, alone: Solution) -> dict[str, list[float]]:
    """Return each block's depth rate less the predicted one, before and after the corrections from the data alone."""
    measured = floats(data.blocks, "depth_rate")
    before, after = (measured - model.predict(data.blocks, x)[1] for x in (np.zeros_like(alone.x), alone.x))
    middle = 0.5 * (seconds(data.blocks["start"]) + seconds(data.blocks["end"]))
    return {
        "block": data.blocks["block"].tolist(),
        "time_s": middle.tolist(),
        "before_m_s": before.tolist(),
        "after_m_s": after.tolist(),
        "std_m_s": data.std.tolist(),
    }


def _parameter(
    name: str, vehicle: Vehicle, alone: tuple[float, float], both: tuple[float, float], prior: float
) -> dict[str, Any]:
    quantity = CORRECTIONS[name]
    base = vehicle[name] if name in COEFFICIENTS else math.nan
    relative = 100.0 / base if base and math.isfinite(base) else math.nan
    return {
        "name": name,
        "symbol": quantity.symbol,
        "unit": quantity.unit,
        "meaning": quantity.meaning,
        "value": alone[0],
        "std": alone[1],
        "value_with_prior": both[0],
        "std_with_prior": both[1],
        "prior_std": prior,
        "vehicle_value": base,
        "percent": alone[0] * relative,
        "percent_std": alone[1] * relative,
    }


def _verdict(
    i: int,
    apart: Sequence[tuple[int, int]],
    free: Sequence[str],
    found: tuple[float, float],
    prior: float,
    blocks: pd.DataFrame,
) -> str:
    """Return what the data say of correction `i`, `found` with its 1-sigma."""
    others = [free[b if a == i else a] for a, b in apart if i in (a, b)]
    if others:
        symbols = " and ".join(CORRECTIONS[other].symbol for other in others)
        return f"cannot be told apart from {symbols}; {experiment(free, blocks)}"
    value, std = found
    if math.isfinite(prior) and std > prior and abs(value) < CONTRADICTION * std:
        return "not determined: prior decides"
    if math.isfinite(prior) and abs(value) > CONTRADICTION * math.hypot(std, prior):
        return "determined by the data, against the prior"
    return "determined by the data"


def _borrowing(name: str, prior: float, pull: float) -> dict[str, Any]:
    quantity = CORRECTIONS[name]
    return {
        "name": name,
        "symbol": quantity.symbol,
        "unit": quantity.unit,
        "meaning": quantity.meaning,
        "prior_std": prior,
        "pull_std": pull,
        "verdict": "contradicts its prior" if abs(pull) > CONTRADICTION else "held within its prior",
    }


def _cannot(free: Sequence[str]) -> str:
    return " and ".join(CORRECTIONS[name].symbol for name in free) + " cannot be told apart"


def _refusal(
    model: Model,
    free: Sequence[str],
    priors: Mapping[str, float],
    sizes: Mapping[str, int],
    reason: str,
    condition: float,
) -> dict[str, Any]:
    """Return a fit without values, and why."""
    none = (math.nan, math.nan)
    result: dict[str, Any] = {
        "reason": reason,
        "parameters": [
            _parameter(name, model.vehicle, none, none, priors.get(name, math.nan)) | {"verdict": reason}
            for name in free
        ],
        "correlation": [],
        "covariance": [],
        "condition_index": condition,
        "values_fitted": 0,
        "degrees_of_freedom": 0,
        "chi_square": math.nan,
        "reduced_chi_square": math.nan,
        "std_inflation": math.nan,
        "borrowed": [],
        "residuals": {},
        **sizes,
        "left_out_dives": dict.fromkeys(LEFT_OUT) | {"dives": sizes["dives"], "reason": reason},
    }
    result["text"] = text(result)
    return result


def _rms(values: Array) -> float | None:
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else None

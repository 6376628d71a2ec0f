"""Averages of comparisons: per direction, and even and odd in dive and climb.

What the blocks have in common – coefficients, pitch bias, ballast, thrust – does not average out; the noise of the
measured side does, as far as neighbouring blocks do not share the water's motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.report.compare import EFFECTS, SHARED, floats
from pipeline.report.covariance import Noise, water, water_of
from pipeline.report.theil import split, unsplit

Array = NDArray[np.float64]


def means(table: pd.DataFrame, settings: Mapping[str, Any] | None = None) -> pd.DataFrame:
    """Return the weighted mean of every comparison per direction and powered or not.

    Weights are 1/u_val².

    Returns
    -------
    DataFrame
        One row per trim, quantity, direction and powered: ``blocks``, ``dives``, ``predicted``, ``predicted_std``,
        ``measured``, ``measured_std``, ``error``, ``u_val``, ``significance``, ``relative_error``, ``label``, ``why``,
        the shares of `theil.split`, and ``split_reason`` why there are none.
    """
    rows: list[dict[str, Any]] = []
    for _key, group in table.groupby(["trim", "quantity", "direction", "powered"], sort=True):
        weights = 1.0 / np.maximum(floats(group, "u_val"), 1e-12) ** 2
        row = combine(group, weights / weights.sum(), settings)
        sides = floats(group, "predicted"), floats(group, "measured"), weights
        parts, unsaid = split(*sides), unsplit(*sides)
        if (group["label"] == "circular").all():
            row["significance"] = math.nan
            parts, unsaid = dict.fromkeys(parts, math.nan), "circular: E says nothing"
        rows.append(
            {
                **_key_of(group, "trim", "quantity", "direction", "powered"),
                "blocks": len(group),
                "dives": int(group["dive"].nunique()),
                **row,
                **parts,
                "split_reason": unsaid,
                "label": group["label"].iloc[0],
                "why": group["why"].iloc[0],
            }
        )
    return pd.DataFrame(rows)


def parity(table: pd.DataFrame, settings: Mapping[str, Any] | None = None, *, by_dive: bool = False) -> pd.DataFrame:
    """Return the even and odd part of the error in dive and climb pairs.

    Of a dive and its climb flown alike, (E_dive + E_climb)/2 holds what drag and lift do and half the difference
    holds ballast, pitch bias and moving water. Depth rate and pitch count by their size. Comparisons that are
    circular are left out.

    Returns
    -------
    DataFrame
        One row per trim, quantity and powered, and with `by_dive` per ``dive``: ``dives``, ``even``, ``even_u``,
        ``odd``, ``odd_u``.
    """
    rows: list[dict[str, Any]] = []
    slanting = table[(table["direction"] != 0) & (table["label"] != "circular")]
    kind = ["trim", "quantity", "powered"]
    sides = slanting.groupby([*kind, "dive"])["direction"].transform("nunique")
    paired = slanting[sides == 2]
    paired = paired.assign(count=paired.groupby([*kind, "dive", "direction"])["error"].transform("size"))
    keys = kind + ["dive"] * by_dive
    for _key, group in paired.groupby(keys, sort=True):
        dives = int(group["dive"].nunique())
        weights = 0.5 / (floats(group, "count") * dives) * _size(group)
        sign = np.where(group["direction"].to_numpy() < 0, 1.0, -1.0)
        weighed = _weighed(group, settings)
        even, odd = weighed(weights), weighed(weights * sign)
        rows.append(
            {
                **_key_of(group, *keys),
                "dives": dives,
                "even": even["error"],
                "even_u": even["u_val"],
                "odd": odd["error"],
                "odd_u": odd["u_val"],
            }
        )
    return pd.DataFrame(rows)


def _size(group: pd.DataFrame) -> Array:
    """Return the sign that turns a quantity into its size: depth rates sink in dives, pitch rises in climbs."""
    side = np.sign(floats(group, "direction"))
    quantity = group["quantity"].iloc[0]
    if quantity == "depth_rate":
        return -side
    return side if quantity in ("pitch", "path_angle") else np.ones_like(side)


def combine(group: pd.DataFrame, weights: Array, settings: Mapping[str, Any] | None = None) -> dict[str, float]:
    """Return the weighted sum of comparisons of one kind, with its uncertainty.

    Parameters
    ----------
    group
        Rows of `compare` of one trim and quantity.
    weights
        Shape (n,).
    settings
        The estimator's ``sigma_w`` and ``tau_w``.
    """
    return _weighed(group, settings)(weights)


def _weighed(group: pd.DataFrame, settings: Mapping[str, Any] | None) -> Callable[[Array], dict[str, float]]:
    """Return what gives the weighted sum of comparisons of one kind by its weights, as `combine`."""
    order = np.argsort(floats(group, "start_s"), kind="stable")
    group = group.iloc[order]
    common = group["common"].to_numpy(dtype=bool)
    noise = _correlated(group, *water_of(settings))
    error, predicted, measured = (floats(group, name) for name in ("error", "predicted", "measured"))
    own_measured, own_input = floats(group, "own_measured") * common, floats(group, "own_input")
    theory = np.array([floats(group, f"predicted_{name}") for name in EFFECTS])
    shared = np.array(
        [floats(group, f"measured_{name}") if name in SHARED else np.zeros(len(group)) for name in EFFECTS]
    )

    def squared(effects: Array) -> float:
        """Return the variance by effects, one a row, each of which the comparisons have in common."""
        return float(np.sum(np.sum(effects, axis=1) ** 2))

    def combined(weights: Array) -> dict[str, float]:
        w = weights[order]
        random = noise.variance(np.where(common, 0.0, w)) + float(np.sum(w * own_measured)) ** 2
        inputs = float(np.sum(np.abs(w) * own_input)) ** 2
        mean = float(np.sum(w * measured))
        found = float(np.sum(w * error))
        total = math.sqrt(random + squared(w * (theory - shared)) + inputs)
        return {
            "predicted": float(np.sum(w * predicted)),
            "predicted_std": math.sqrt(squared(w * theory) + inputs),
            "measured": mean,
            "measured_std": math.sqrt(random + squared(w * shared)),
            "error": found,
            "u_val": total,
            "significance": abs(found) / total if total > 0 else math.nan,
            "relative_error": found / abs(mean) if mean else math.nan,
        }

    return combined


def _correlated(group: pd.DataFrame, sigma: float, tau: float) -> Noise:
    """Return the covariance of the measured side's own noise, neighbouring blocks sharing the water's motion."""
    own, sign = floats(group, "own_measured"), floats(group, "water_sign")
    start, end = floats(group, "start_s"), floats(group, "end_s")
    if sigma <= 0 or not sign.any():
        return Noise(own[np.newaxis, :] ** 2)
    shared = water(start, end, sigma, tau)
    unit = shared.scaled(1.0 / np.sqrt(shared.band[0]))
    return unit.scaled(own * sign)


def _key_of(group: pd.DataFrame, *names: str) -> dict[str, Any]:
    return {name: group[name].iloc[0] for name in names}

"""Measured against theory as rows of summary.json: in units that people read, trims and flights in words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from pipeline.records import TRIMS
from pipeline.report import averages
from pipeline.report.compare import DIRECTIONS, QUANTITIES, floats
from pipeline.report.theil import SHARES

TRIM_WORDS = {
    "pitch": "measured pitch held",
    "battery": "moment balance with the battery as logged",
    "fixed_alpha": "pitch left free, α = −K_M0/K_M",
}


def errors(comparison: pd.DataFrame, predictions: pd.DataFrame, settings: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return by how much theory misses in the mean, even and odd in dive and climb, per block, and where it is none.

    Parameters
    ----------
    comparison
        As from `compare.compare`.
    predictions
        Table `records.PREDICTIONS`.
    settings
        The estimator's noise levels.
    """
    return {
        "means": [_mean(row) for row in averages.means(comparison, settings).to_dict("records")],
        "even_odd": [_even_odd(row) for row in averages.parity(comparison, settings).to_dict("records")],
        "no_prediction": _no_prediction(predictions),
        "blocks": _per_block(comparison),
    }


def _in_units(quantity: str) -> tuple[float, str]:
    """Return the factor from SI and the unit in which a quantity is shown."""
    return (180.0 / math.pi, "deg") if quantity in ("pitch", "path_angle") else (100.0, "cm/s")


def _mean(row: Mapping[Any, Any]) -> dict[str, Any]:
    factor, unit = _in_units(row["quantity"])
    scaled = {name: factor * row[name] for name in ("predicted", "measured", "measured_std", "error", "u_val")}
    return {
        "trim": row["trim"],
        "trim_meaning": TRIM_WORDS[row["trim"]],
        "quantity": row["quantity"],
        "quantity_meaning": QUANTITIES[row["quantity"]],
        "flight": _flight(int(row["direction"]), bool(row["powered"])),
        "blocks": row["blocks"],
        "dives": row["dives"],
        "unit": unit,
        **scaled,
        "relative_error_percent": 100.0 * row["relative_error"] if unit == "cm/s" else math.nan,
        "significance": row["significance"],
        **{f"{name}_percent": 100.0 * row[name] for name in SHARES},
        "split_reason": row["split_reason"],
        "label": row["label"],
        "why": row["why"],
    }


def _even_odd(row: Mapping[Any, Any]) -> dict[str, Any]:
    factor, unit = _in_units(row["quantity"])
    return {
        "trim": row["trim"],
        "trim_meaning": TRIM_WORDS[row["trim"]],
        "quantity": row["quantity"],
        "quantity_meaning": QUANTITIES[row["quantity"]],
        "powered": bool(row["powered"]),
        "dives": row["dives"],
        "unit": unit,
        **{name: factor * row[name] for name in ("even", "even_u", "odd", "odd_u")},
    }


def _flight(direction: int, powered: bool) -> str:
    return DIRECTIONS[direction] + (" under propeller" if powered else "")


def _no_prediction(predictions: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the trims that have no prediction for some block, and why."""
    out = []
    for trim in TRIMS:
        rows = predictions[(predictions["trim"] == trim) & ~np.isfinite(floats(predictions, "speed"))]
        counts = rows["reason"].astype(str).value_counts(sort=False).sort_index()
        out += [
            {"trim": trim, "trim_meaning": TRIM_WORDS[trim], "reason": reason or "no reason given", "blocks": int(n)}
            for reason, n in counts.items()
        ]
    return out


def _per_block(comparison: pd.DataFrame) -> dict[str, Any]:
    """Return every comparison as columns, in SI units and radians, six digits."""
    columns: dict[str, Any] = {
        "unit": "SI: m/s and rad",
        **{name: comparison[name].tolist() for name in ("block", "dive", "direction", "powered", "trim", "quantity")},
    }
    for name in ("predicted", "measured", "error", "u_num", "u_input", "u_measured", "covariance", "u_val"):
        columns[name] = [float(f"{value:.6g}") for value in floats(comparison, name)]
    columns["label"] = comparison["label"].tolist()
    return columns


def stability(blocks: pd.DataFrame, predictions: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the stable range of the paper's inequalities at the pitch held, beside the measured speed."""
    used = blocks[blocks["used"].to_numpy(dtype=bool)]
    held = predictions[predictions["trim"] == "pitch"]
    both = used.merge(held, on="block", suffixes=("", "_theory"))
    both = both[np.isfinite(floats(both, "speed_theory"))]
    rows = []
    for _key, group in both.groupby(["direction", "powered"], sort=True):
        low, high, speed = (floats(group, name) for name in ("speed_lower", "speed_upper", "speed"))
        known = np.isfinite(low) & np.isfinite(high) & np.isfinite(speed)
        rows.append(
            {
                "flight": _flight(int(group["direction"].iloc[0]), bool(group["powered"].iloc[0])),
                "blocks": len(group),
                "speed_lower_m_s": _median(low),
                "speed_upper_m_s": _median(high),
                "measured_speed_m_s": _median(speed),
                "measured_inside_percent": (
                    100.0 * float(np.mean((speed > low)[known] & (speed < high)[known])) if known.any() else math.nan
                ),
                "all_inequalities_percent": 100.0 * float(group["stable"].to_numpy(dtype=bool).mean()),
            }
        )
    return rows


def _median(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else math.nan

"""Whether each model's horizontal speed is right, by the fixes: theory, both estimates, the vehicle's own solution."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pipeline.records import seconds, timestamps
from pipeline.report.compare import floats
from pipeline.report.fitting.closure import Closure, close
from pipeline.report.fitting.passages import NEEDED, Passages, ThroughWater, by_blocks, find, mean_of, through_water
from pipeline.report.rounding import amount, signed

if TYPE_CHECKING:
    from pipeline.report import Inputs
    from pipeline.table import Columns

#: What each model is called, and how its table names it.
MODELS = {
    "theory": "theory, measured pitch held",
    "kinematic": "kinematic estimate",
    "force": "force estimate",
    "stored": "the vehicle's own stored model",
}
#: Beyond this many 1-sigma a speed is wrong; a compass, of which nobody thinks, only beyond more.
SIGNIFICANT, SIGNIFICANT_TURN = 2.0, 3.0

INDEPENDENT, CIRCULAR = "independent", "circular"


def closures(inputs: Inputs, passages: Passages) -> dict[str, Any]:
    """Return what the fixes say of the speed of every model of a mission.

    Parameters
    ----------
    inputs
        What the earlier stages hand over.
    passages
        Between its fixes.

    Returns
    -------
    dict
        For summary.json: ``reason`` where there is nothing to say, ``passages`` (one a passage), ``left_out``,
        ``models`` (one a model: ``beta``, ``beta_std``, ``turn_deg``, ``verdict``, ``label``, ...) and ``sentences``
        for what is significant.
    """
    used = inputs.estimate.get("used") or {}
    rows, said = [], {}
    if not passages.reason:
        for name, through in velocities(passages, inputs).items():
            found = close(passages, through)
            rows.append(_row(name, found, through, fixes_used=bool(used.get("fixes")) and name == "kinematic"))
            said[name] = _by_passage(passages, through, found)
    return {
        "reason": passages.reason or ("" if rows else "no model has a speed"),
        "passages": _passages(passages, said),
        "left_out": [
            {"start": _stamp(float(item["start"])), "reason": str(item["reason"])} for item in passages.left_out
        ],
        "models": rows,
        "sentences": [*(sentence for row in rows if (sentence := _sentence(row))), *_compass(rows)],
    }


def of_mission(inputs: Inputs) -> Passages:
    """Return the passages between the fixes of a mission.

    Parameters
    ----------
    inputs
        What the earlier stages hand over.
    """
    return find(inputs.records[list(NEEDED)])


def velocities(passages: Passages, inputs: Inputs) -> dict[str, ThroughWater]:
    """Return the velocity through water of every model that has one, by name as in `MODELS`.

    Parameters
    ----------
    passages
        Between fixes.
    inputs
        What the earlier stages hand over.
    """
    out = {}
    held = inputs.predictions[inputs.predictions["trim"] == "pitch"]
    table = inputs.blocks[inputs.blocks["used"].to_numpy(dtype=bool)].merge(held, on="block", suffixes=("", "_theory"))
    table = table.sort_values("start", kind="stable")
    speed = floats(table, "speed_theory") * np.cos(floats(table, "path_angle_theory"))
    flown = table[np.isfinite(speed)]
    if len(flown):
        weights, seen = by_blocks(passages, seconds(flown["start"]), seconds(flown["end"]))
        out["theory"] = mean_of(weights, seen, speed[np.isfinite(speed)])
    for name, estimates in (("kinematic", inputs.estimates), ("force", inputs.force)):
        if len(estimates):
            out[name] = by_estimate(passages, estimates)
    if inputs.stored is not None and len(inputs.stored):
        out["stored"] = through_water(passages, seconds(inputs.stored["time"]), horizontal_of(inputs.stored))
    return out


def by_estimate(passages: Passages, estimates: Columns) -> ThroughWater:
    """Return the velocity through water of an estimate, table `records.ESTIMATES`, in each passage."""
    table = estimates[["time", "speed", "path_angle"]]
    horizontal = floats(table, "speed") * np.cos(floats(table, "path_angle"))
    return through_water(passages, seconds(table["time"]), horizontal)


def horizontal_of(stored: pd.DataFrame) -> np.ndarray:
    """Return the horizontal speed of the vehicle's own solution, table `records.STORED`, m/s, shape (n,)."""
    speed, vertical = floats(stored, "speed"), floats(stored, "vertical_speed")
    return np.sqrt(np.maximum(speed**2 - vertical**2, 0.0))


def _row(name: str, found: Closure, through: ThroughWater, *, fixes_used: bool) -> dict[str, Any]:
    """Return one model for summary.json."""
    mean = float(np.mean(np.abs(through.velocity[found.used]))) if found.used.any() else math.nan
    row: dict[str, Any] = {
        "model": name,
        "meaning": MODELS[name],
        "beta": found.beta,
        "beta_std": found.beta_std,
        "speed_m_s": mean,
        "turn_deg": math.degrees(found.turn),
        "turn_std_deg": math.degrees(found.turn_std),
        "spread_deg": math.degrees(found.spread),
        "condition_index": found.condition_index,
        "assumed_percent": 100.0 * found.assumed,
        "passages": int(found.used.sum()),
        "current_change_m_s": found.current.strength,
        "current_time_h": found.current.lasting / 3600.0,
        "reason": found.reason,
        "label": CIRCULAR if fixes_used else INDEPENDENT,
        "why": "has used these fixes (gps: use)" if fixes_used else "has not seen the fixes",
    }
    return row | {"verdict": _verdict(row)}


def _verdict(row: Mapping[str, Any]) -> str:
    """Return in words what β says of a model's speed."""
    if row["reason"]:
        return f"not determined: {row['reason']}"
    size = f"{amount(abs(100.0 * row['beta']), 100.0 * row['beta_std'], sign=False)} %"
    if abs(row["beta"]) <= SIGNIFICANT * row["beta_std"]:
        low, high = (signed(100.0 * (row["beta"] + side * SIGNIFICANT * row["beta_std"]), 0) for side in (-1.0, 1.0))
        return f"no error seen: may have to change by {low} to {high} %"
    return f"too slow: must rise by {size}" if row["beta"] > 0.0 else f"too fast: must fall by {size}"


def _sentence(row: Mapping[str, Any]) -> str:
    """Return a sentence where the speed of a model that has not seen the fixes is significantly wrong, "" else."""
    if row["reason"] or row["label"] == CIRCULAR or abs(row["beta"]) <= SIGNIFICANT * row["beta_std"]:
        return ""
    return f"By the fixes, the horizontal speed of {row['meaning']} is {row['verdict']}."


def _compass(rows: list[dict[str, Any]]) -> list[str]:
    """Return a sentence where headings are significantly off, by the model that tells it best."""
    known = [row for row in rows if not row["reason"]]
    if not known:
        return []
    best = min(known, key=lambda row: float(row["turn_std_deg"]))
    turn, std = best["turn_deg"], best["turn_std_deg"]
    if abs(turn) <= SIGNIFICANT_TURN * std:
        return []
    side = "clockwise" if turn > 0.0 else "anticlockwise"
    return [
        f"By the fixes, true headings are {amount(abs(turn), std, sign=False)} degrees {side} of those logged: "
        "look at the declination and the compass."
    ]


def _by_passage(passages: Passages, through: ThroughWater, found: Closure) -> list[dict[str, Any]]:
    """Return what one model makes of each passage.

    ``along`` and ``across`` (clockwise) are what the model's velocity lacks of that over ground, less the constant
    current that goes with β, seen from the direction flown.
    """
    constant = complex(found.residual[found.used].mean()) if found.used.any() else complex(math.nan, math.nan)
    lacking = passages.over_ground - through.velocity - constant
    with np.errstate(invalid="ignore"):
        flown = through.velocity / np.abs(through.velocity)
    apart = lacking * np.conj(flown)
    direction = np.degrees(np.angle(1j * np.conj(flown))) % 360.0
    return [
        {
            "used": bool(found.used[k]),
            "direction_deg": float(direction[k]),
            "speed_m_s": float(np.abs(through.velocity[k])),
            "speed_known_percent": 100.0 * float(through.seen[k]),
            "along_m_s": float(apart[k].real),
            "across_m_s": float(-apart[k].imag),
            "current_east_m_s": float(found.residual[k].real),
            "current_north_m_s": float(found.residual[k].imag),
        }
        for k in range(passages.count)
    ]


def _passages(passages: Passages, said: Mapping[str, list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Return each passage for summary.json, with what every model makes of it."""
    return [
        {
            "dive": int(passages.dive[k]),
            "start": _stamp(float(passages.start[k])),
            "duration_h": float(passages.end[k] - passages.start[k]) / 3600.0,
            "over_ground_east_m_s": float(passages.over_ground[k].real),
            "over_ground_north_m_s": float(passages.over_ground[k].imag),
            "over_ground_std_m_s": float(passages.over_ground_std[k]),
            "models": {name: rows[k] for name, rows in said.items()},
        }
        for k in range(passages.count)
    ]


def _stamp(posix: float) -> str:
    return f"{timestamps(np.array([posix]))[0]:%Y-%m-%dT%H:%M:%SZ}"

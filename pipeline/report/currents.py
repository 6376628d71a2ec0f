"""Depth-average current of each dive: over ground by the fixes, less through water by the kinematic estimate."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.records import seconds, timestamps
from pipeline.report.closures import CIRCULAR, INDEPENDENT, by_estimate
from pipeline.report.compare import floats
from pipeline.report.fitting.passages import SEEN, Passages, through_water
from pipeline.report.rounding import amount, counted

if TYPE_CHECKING:
    from pipeline.report import Inputs

BLIND = f"the speed is known in less than {100.0 * SEEN:.0f} % of the passage"
NOWHERE = f"the speed is known in less than {100.0 * SEEN:.0f} % of every passage"


def currents(inputs: Inputs, passages: Passages) -> dict[str, Any]:
    """Return the mean current between the fixes before and after each dive.

    It rests on the estimate's ratio of lift to drag, on the headings as logged, and on nothing else of the theory.

    Parameters
    ----------
    inputs
        What the earlier stages hand over.
    passages
        Between its fixes.

    Returns
    -------
    dict
        For summary.json: ``reason`` where there is none at all, ``passages`` (``east_m_s``, ``north_m_s`` and
        ``std_m_s``, the 1-sigma of either, NaN with a ``reason`` where there is none), ``label`` and ``sentence``.
    """
    used = bool((inputs.estimate.get("used") or {}).get("fixes"))
    reason = passages.reason or ("" if len(inputs.estimates) else "there are no estimates")
    rows = [] if reason else _rows(inputs, passages)
    known = [row for row in rows if not row["reason"]]
    reason = reason or ("" if known else NOWHERE)
    return {
        "reason": reason,
        "label": CIRCULAR if used else INDEPENDENT,
        "passages": rows,
        "sentence": "" if reason else _sentence(known, used=used),
    }


def _rows(inputs: Inputs, passages: Passages) -> list[dict[str, Any]]:
    through = by_estimate(passages, inputs.estimates)
    table = inputs.estimates[["time", "speed_std", "path_angle"]]
    # An error of the ratio of lift to drag is the same all along a passage: it adds up as the speed does.
    slip = floats(table, "speed_std") * np.cos(floats(table, "path_angle"))
    alike = np.abs(through_water(passages, seconds(table["time"]), slip).velocity)
    current = passages.over_ground - through.velocity
    std = np.sqrt(passages.over_ground_std**2 + through.std**2 + alike**2)
    known = np.isfinite(current) & np.isfinite(std) & (through.seen >= SEEN)
    current, std = np.where(known, current, complex(math.nan, math.nan)), np.where(known, std, math.nan)
    stamps = timestamps(0.5 * (passages.start + passages.end))
    return [
        {
            "dive": int(passages.dive[k]),
            "time": f"{stamps[k]:%Y-%m-%dT%H:%M:%SZ}",
            "duration_h": float(passages.end[k] - passages.start[k]) / 3600.0,
            "east_m_s": float(current[k].real),
            "north_m_s": float(current[k].imag),
            "std_m_s": float(std[k]),
            "reason": "" if known[k] else BLIND,
        }
        for k in range(passages.count)
    ]


def _sentence(known: list[dict[str, Any]], *, used: bool) -> str:
    """Return the mean current in words: errors are taken as alike in all passages, so that none average out."""
    east, north, std = (float(np.mean([row[name] for row in known])) for name in ("east_m_s", "north_m_s", "std_m_s"))
    dives = f"{counted(len(known), 'passage')} between fixes"
    words = f"Depth-average current, mean of {dives}: {amount(east, std)} m/s east, {amount(north, std)} m/s north."
    return words + (" The estimate has used the same fixes (gps: use)." if used else "")

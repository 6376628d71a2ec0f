"""Submerged legs between fixes: what the displacement over ground says about the speed through water."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from pipeline.estimate.series import Series

#: A leg shorter than this (s) says nothing that the fixes' own error would not drown.
SHORTEST = 120.0


def legs(
    series: Series, speed: np.ndarray, speed_std: np.ndarray, current: np.ndarray, seen: np.ndarray
) -> dict[str, Any] | None:
    """Return every submerged leg, and the speed that the displacements determine in powered level flight.

    Parameters
    ----------
    series
        Measurements, m instants.
    speed, speed_std
        Estimated speed and its 1-sigma, shape (m,).
    current
        Estimated current, east and north, shape (2, m).
    seen
        Where the speed is observable, shape (m,).

    Returns
    -------
    dict or None
        ``legs`` (start_s, end_s, heading_deg, displacement_m, duration_s, powered, speed, speed_std, current_east,
        current_north), and ``speed`` with ``speed_std`` [m/s] of powered level flight, None where the fixes do not
        determine it; None without legs. The speed at one setting is one unknown, so its 1-sigma is the estimate's own.
    """
    fixes = np.flatnonzero(np.isfinite(series.east))
    table: list[dict[str, Any]] = []
    for first, last in pairwise(fixes):
        inside = np.arange(first, last + 1)
        submerged = inside[~series.surfaced[inside]]
        duration = float(series.time[last] - series.time[first])
        if duration < SHORTEST or submerged.size < 0.5 * inside.size:
            continue
        east, north = series.east[last] - series.east[first], series.north[last] - series.north[first]
        heading = series.heading[submerged]
        observed = submerged[seen[submerged]]
        level = observed[series.cruising[observed]]
        chosen = level if level.size else observed
        table.append(
            {
                "start_s": float(series.time[first]),
                "end_s": float(series.time[last]),
                "heading_deg": float(np.degrees(np.arctan2(np.sin(heading).mean(), np.cos(heading).mean())) % 360.0),
                "displacement_m": float(np.hypot(east, north)),
                "duration_s": duration,
                "powered": bool(level.size > 0),
                "speed": float(speed[chosen].mean()) if chosen.size else None,
                "speed_std": float(speed_std[chosen].mean()) if chosen.size else None,
                "current_east": float(current[0, submerged].mean()),
                "current_north": float(current[1, submerged].mean()),
            }
        )
    if not table:
        return None
    result: dict[str, Any] = {"legs": table, "speed": None, "speed_std": None}
    level = series.cruising & seen
    if level.any():
        result |= {"speed": float(speed[level].mean()), "speed_std": float(speed_std[level].mean())}
    return result

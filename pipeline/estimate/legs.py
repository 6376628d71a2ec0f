"""Submerged legs between fixes: what the displacement over ground says about the speed through water."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from pipeline.estimate.linearise import CURRENT_EAST, CURRENT_NORTH
from pipeline.estimate.series import Series

#: A leg shorter than this (s) says nothing that the fixes' own error would not drown.
SHORTEST = 120.0


def legs(series: Series, mean: np.ndarray, covariance: np.ndarray, seen: np.ndarray) -> dict[str, Any] | None:
    """Return every submerged leg, and the speed that the displacements determine in powered level flight.

    Parameters
    ----------
    series
        Measurements, m instants.
    mean, covariance
        Smoothed states, shapes (m, 9) and (m, 9, 9).
    seen
        Where the speed is observable, shape (m,).

    Returns
    -------
    dict or None
        ``legs`` (start_s, end_s, heading_deg, displacement_m, duration_s, speed, speed_std, current_east,
        current_north), and ``speed`` with ``speed_std`` [m/s] over the powered legs that are seen; None without legs.
        The 1-sigma of the mean is the larger of the legs' scatter over √n and the smoother's own over √(n/2): two
        reciprocal legs are needed to tell speed from current.
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
        level = observed[series.powered[observed]]
        chosen = level if level.size else observed
        table.append(
            {
                "start_s": float(series.time[first]),
                "end_s": float(series.time[last]),
                "heading_deg": float(np.degrees(np.arctan2(np.sin(heading).mean(), np.cos(heading).mean())) % 360.0),
                "displacement_m": float(np.hypot(east, north)),
                "duration_s": duration,
                "powered": bool(level.size > 0),
                "speed": float(mean[chosen, 0].mean()) if chosen.size else None,
                "speed_std": float(np.sqrt(covariance[chosen, 0, 0].mean())) if chosen.size else None,
                "current_east": float(mean[submerged, CURRENT_EAST].mean()),
                "current_north": float(mean[submerged, CURRENT_NORTH].mean()),
            }
        )
    if not table:
        return None
    result: dict[str, Any] = {"legs": table, "speed": None, "speed_std": None}
    known = [leg for leg in table if leg["powered"]]
    if known:
        speed = np.array([leg["speed"] for leg in known])
        own = float(np.sqrt(np.mean([leg["speed_std"] ** 2 for leg in known]) / max(len(known) / 2.0, 1.0)))
        scatter = float(speed.std(ddof=1) / np.sqrt(len(known))) if len(known) > 1 else 0.0
        result |= {"speed": float(speed.mean()), "speed_std": max(own, scatter)}
    return result

"""Submerged legs between fixes: what the displacement over ground says about the speed through water."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from pipeline.estimate.series import Series
from pipeline.estimate.trajectory import Flight

#: A leg shorter than this (s) says nothing that the fixes' own error would not drown.
SHORTEST = 120.0


Leg = dict[str, Any]


def legs(series: Series, flight: Flight, current: np.ndarray, seen: np.ndarray) -> list[Leg]:
    """Return every submerged leg between two fixes.

    Parameters
    ----------
    series
        Measurements, m instants.
    flight
        Estimated flight.
    current
        Estimated current, east and north, shape (2, m).
    seen
        Where the speed is observable, shape (m,).

    Returns
    -------
    list of dict
        start_s and end_s [POSIX], heading_deg, displacement_m, duration_s, powered, speed, speed_std, current_east,
        current_north, and how many instants of powered level flight the speed is the mean of (level).
    """
    speed, speed_std = flight.state[0], flight.std[0]
    fixes = np.flatnonzero(np.isfinite(series.east))
    table: list[Leg] = []
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
                "start_s": series.start + float(series.time[first]),
                "end_s": series.start + float(series.time[last]),
                "heading_deg": float(np.degrees(np.arctan2(np.sin(heading).mean(), np.cos(heading).mean())) % 360.0),
                "displacement_m": float(np.hypot(east, north)),
                "duration_s": duration,
                "powered": bool(level.size > 0),
                "level": int(level.size),
                "speed": float(speed[chosen].mean()) if chosen.size else None,
                "speed_std": float(speed_std[chosen].mean()) if chosen.size else None,
                "current_east": float(current[0, submerged].mean()),
                "current_north": float(current[1, submerged].mean()),
            }
        )
    return table


def flown(table: list[Leg]) -> dict[str, Any] | None:
    """Return ``legs`` and the ``speed`` [m/s] of powered level flight with ``speed_std``; None without legs.

    The speed at one setting is one unknown, so its 1-sigma is the estimate's own; both are None where the fixes do
    not determine it.

    Parameters
    ----------
    table
        Legs of the whole mission.
    """
    if not table:
        return None
    level = [leg for leg in table if leg["level"]]
    count = sum(leg["level"] for leg in level)
    mean = {
        name: sum(leg["level"] * leg[name] for leg in level) / count if count else None
        for name in ("speed", "speed_std")
    }
    return {"legs": table, **mean}

"""How well corrections fitted on some dives predict the others."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.report.fitting.halves import parts_of
from pipeline.report.fitting.points import Array
from pipeline.report.fitting.regression import Problem, solve
from pipeline.report.fitting.selection import CONDITION_REFUSED, condition_index

LEFT_OUT = ("rmse_before_m_s", "rmse_after_m_s", "speed_rmse_before_m_s", "speed_rmse_after_m_s")


def left_out_dives(problem: Problem) -> dict[str, Any]:
    """Return how well corrections fitted on half of the dives predict the others, which were flown alike.

    Returns
    -------
    dict
        RMSE of the depth rate, and of the sensor's speed where there is one, before and after the corrections, m/s,
        every block predicted by the half of the dives that it is not in; ``halves``, the dives of either; ``reason``
        where that cannot be had.
    """
    points = problem.points
    dives = np.unique(points.dive)
    out: dict[str, Any] = dict.fromkeys(LEFT_OUT) | {"dives": int(dives.size), "halves": [], "reason": ""}
    if dives.size < 2:
        return out | {"reason": "one dive only: none can be left out"}
    half_of = parts_of(points, 2)
    out["halves"] = [np.unique(points.dive[half_of == part]).tolist() for part in (0, 1)]
    before = problem.model.fly(np.zeros(len(problem.model.names)))
    speed, rate = np.full(points.size, np.nan), np.full(points.size, np.nan)
    for part in (0, 1):
        inside = half_of == part
        half = problem.of(points.only(inside))
        known = half.size > half.free and condition_index(half) <= CONDITION_REFUSED
        solution = solve(half, prior_on_free=True) if known else None
        if solution is None:
            return out | {"reason": "half of the dives does not determine the corrections"}
        after = problem.model.fly(solution.x)
        speed[~inside], rate[~inside] = after.speed[~inside], after.depth_rate[~inside]
    differences = (
        points.depth_rate - before.depth_rate,
        points.depth_rate - rate,
        points.sensor_speed - before.speed,
        points.sensor_speed - speed,
    )
    return out | {key: _rms(values) for key, values in zip(LEFT_OUT, differences, strict=True)}


def _rms(values: Array) -> float | None:
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else None

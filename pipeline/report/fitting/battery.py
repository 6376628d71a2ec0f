"""Battery trim: moments that make the measured pitch the one in balance with the battery as logged."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.report.fitting.parameters import correction
from pipeline.report.fitting.regression import Problem, Solution, solve
from pipeline.report.fitting.selection import CONDITION_REFUSED, condition_index
from pipeline.report.fitting.terms import Moments
from pipeline.report.rounding import counted
from pipeline.vehicle import Vehicle

#: What is fitted to the balance, and what is borrowed beside what the flight leaves open.
FREE = ("moment_at_zero", "moment_slope")
HELD = ("righting_moment", "battery_neutral_position")
NEEDED = (*FREE, *HELD, "battery_mass")


def trim(flight: Problem, solution: Solution, vehicle: Vehicle) -> dict[str, Any]:
    """Return the moments fitted to measured pitch and battery position, the flight as fitted already.

    The balance is not part of the fit of the forces: trusted there, it would make lift look better known than it is.

    Returns
    -------
    dict
        ``parameters`` (name, symbol, unit, value, std, prior_std, vehicle_value), ``correlation`` of the two,
        ``pitch_rms_before_deg`` and ``pitch_rms_after_deg``; ``reason`` where the balance cannot be had.
    """
    out: dict[str, Any] = {"parameters": [], "correlation": math.nan, "reason": ""}
    out |= {"pitch_rms_before_deg": math.nan, "pitch_rms_after_deg": math.nan, "blocks": 0}
    unknown = [name for name in NEEDED if not math.isfinite(vehicle[name])]
    if unknown:
        return out | {"reason": f"the vehicle file leaves {', '.join(unknown)} unknown"}
    balance = Moments.made(flight.model)
    if not balance.rows.size:
        return out | {"reason": "no battery position is logged"}
    if balance.rows.size <= len(FREE):
        return out | {"reason": f"{counted(balance.rows.size, 'block')} with a battery position: 3 are needed"}
    names = (*FREE, *(name for name in HELD if vehicle.std(name) > 0.0))
    priors: Mapping[str, float] = {name: vehicle.std(name) for name in names}
    model = replace(flight.model, names=(*names, *flight.model.names))
    problem = Problem(model, (balance,), priors, len(FREE))
    start = np.concatenate([np.zeros(len(names)), solution.x])
    if not condition_index(problem) <= CONDITION_REFUSED:
        return out | {"reason": "ΔK_M0 and ΔK_M cannot be told apart: would be resolved by blocks at several pitches"}
    found = solve(problem, start=start, held=range(len(names), start.size))
    if found is None or not found.converged:
        return out | {"reason": "the fit of the moments does not converge"}
    freedom = problem.size - problem.free
    scatter = max(1.0, found.chi_square / freedom)
    std = np.sqrt(np.diag(found.covariance)[: len(FREE)] * scatter)
    before, _slope = problem.evaluate(start)
    degrees = math.degrees(balance.std)
    return out | {
        "blocks": int(balance.rows.size),
        "parameters": [
            {
                "name": name,
                "symbol": correction(name).symbol,
                "unit": correction(name).unit,
                "meaning": correction(name).meaning,
                "value": float(found.x[i]),
                "std": float(std[i]),
                "prior_std": vehicle.std(name),
                "vehicle_value": vehicle[name],
            }
            for i, name in enumerate(FREE)
        ],
        "correlation": float(found.covariance[0, 1] / math.sqrt(found.covariance[0, 0] * found.covariance[1, 1])),
        "pitch_rms_before_deg": float(np.sqrt(np.mean(before**2))) * degrees,
        "pitch_rms_after_deg": float(np.sqrt(np.mean(found.residual**2))) * degrees,
    }

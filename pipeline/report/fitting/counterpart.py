"""The drag of the block fit beside the one that the force estimate was adjusted to: do they agree, and if not, why."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pipeline.report.fitting.parameters import LIFT
from pipeline.report.fitting.regression import Problem, Solution, solve
from pipeline.report.rounding import amount

#: What the force estimate takes from the vehicle file as it is, and this fit borrows with its 1-sigma.
KEPT = (*LIFT, "pitch")
#: Two values differ if by more than this many 1-sigma of both.
APART = 2.0


def with_lift_kept(problem: Problem, solution: Solution, inflation: float) -> dict[str, float]:
    """Return the drag with lift, induced drag and pitch bias kept as in the vehicle file, % of it, and its 1-sigma."""
    names = problem.model.names
    free = names[: problem.free]
    nothing = {"percent": math.nan, "percent_std": math.nan}
    if "parasite_drag" not in free:
        return nothing
    held = [place for place, name in enumerate(names) if name in KEPT and place >= problem.free]
    start = solution.x.copy()
    start[held] = 0.0
    found = solve(problem, weights=solution.weights, start=start, held=held)
    if found is None or not found.converged:
        return nothing
    place, relative = free.index("parasite_drag"), 100.0 / problem.model.vehicle["parasite_drag"]
    std = float(np.sqrt(found.covariance[place, place])) * inflation
    return {"percent": float(found.x[place]) * relative, "percent_std": std * relative}


def counterpart(fitted: Mapping[str, Any], force: Mapping[str, Any], *, sensor_used: bool) -> dict[str, Any]:
    """Return both values of the drag and what to make of them.

    Parameters
    ----------
    fitted
        The result of `fit.fit`.
    force
        The account of the force estimate, with ``parameters``; may be empty.
    sensor_used
        Whether a speed sensor was used by both.

    Returns
    -------
    dict
        ``fit_percent``, ``force_percent``, ``kept_percent`` (the fit with lift and pitch bias as in the vehicle file),
        each with ``_std``; ``agree``, None where there is nothing to compare; ``sentences``.
    """
    out: dict[str, Any] = {"agree": None, "sentences": []}
    out |= {f"{name}_percent{kind}": math.nan for name in ("fit", "force", "kept") for kind in ("", "_std")}
    rows = {item["name"]: item for item in fitted["parameters"]}
    found = (force.get("parameters") or {}).get("parasite_drag")
    if fitted["reason"] or found is None or "parasite_drag" not in rows:
        return out
    row, kept = rows["parasite_drag"], fitted["lift_kept"]
    ours = (row["percent_with_prior"], row["percent_std_with_prior"])
    theirs = (100.0 * found["value"], 100.0 * found["std"])
    out |= {"fit_percent": ours[0], "fit_percent_std": ours[1], "force_percent": theirs[0]}
    out |= {"force_percent_std": theirs[1], "kept_percent": kept["percent"], "kept_percent_std": kept["percent_std"]}
    out["agree"] = bool(abs(ours[0] - theirs[0]) <= APART * math.hypot(ours[1], theirs[1]))
    out["sentences"] = [
        f"Drag at zero angle of attack, with the prior of the vehicle file: {amount(*ours)} % by this fit of block "
        f"means, {amount(*theirs)} % by the force estimate, which is adjusted to every sample."
    ]
    if out["agree"]:
        out["sentences"].append("The two differ by less than twice the 1σ of both together; either may be taken.")
        return out
    pulls = [item for item in fitted["borrowed"] if item["name"] in KEPT and abs(item["pull_std"]) > 1.0]
    moved = ", ".join(f"{item['symbol']} by {item['pull_std']:+.1f}σ".replace("-", "−") for item in pulls)
    borrowing = (
        f"this fit lets lift, induced drag and pitch bias move within their 1σ{f' ({moved})' if moved else ''}, the "
        "force estimate keeps them as the vehicle file has them and lets net buoyancy wander slowly instead. With them "
        f"kept, and without the prior of the drag, this fit gives {amount(kept['percent'], kept['percent_std'])} %"
    )
    explained = abs(kept["percent"] - theirs[0]) <= APART * math.hypot(kept["percent_std"], theirs[1])
    if not explained:
        out["sentences"] += [
            f"They borrow differently, but that is not why they differ: {borrowing}.",
            "Drag, ballast and thrust share the misfit in one way here and in another there: trust neither better than "
            "to the difference of the two.",
        ]
        return out
    out["sentences"].append(f"They differ because they borrow differently: {borrowing}.")
    more = " and ".join(name for name in fitted["compared_with"] if name != "depth rates")
    if sensor_used:
        words = "A speed sensor was used by both: what is left of the difference is the shape of the theory."
    elif more:
        words = (
            f"This fit was also held to {more}, which the force estimate has not seen and which tell drag from lift: "
            "trust this fit, and take the difference as what lift leaves open in the other."
        )
    else:
        words = (
            "Depth rates alone do not tell drag from lift, so trust neither better than to the difference of the two; "
            "a speed sensor, or GPS fixes on many headings, would decide."
        )
    out["sentences"].append(words)
    return out

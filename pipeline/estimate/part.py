"""One part of a mission solved by both estimators: its estimates, and what it adds to the account of the whole."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from pipeline.estimate import flown, force, kinematic
from pipeline.estimate.blocks import means
from pipeline.estimate.compatibility import reconcile
from pipeline.estimate.consistency import Tally, tally
from pipeline.estimate.forcing import forcing
from pipeline.estimate.legs import Leg, legs
from pipeline.estimate.preparation import Prepared
from pipeline.estimate.sensors import Scale
from pipeline.estimate.series import Series, from_records
from pipeline.estimate.trajectory import Flight
from pipeline.estimate.verdict import verdict
from pipeline.findings import Finding
from pipeline.records import ESTIMATES, conform

NAMES = ("speed", "pitch", "angle_of_attack", "path_angle", "vertical_water_velocity", "depth")


class Part(NamedTuple):
    """What one part of a mission adds to the whole."""

    estimates: list[pd.DataFrame]  # one table of each method
    blocks: pd.DataFrame
    engine: bool  # whether the volume of the buoyancy engine is known
    tallies: dict[str, Tally]
    reasons: dict[str, dict[str, int]]  # how many records of each method are unobservable, by reason
    observable: dict[str, tuple[int, int]]  # how many are observable, of how many
    shares: np.ndarray  # (c,): sums of the shares of the variance of V that the borrowed leave open
    legs: list[Leg]
    compatibility: dict[str, Any]
    scales: dict[str, Scale | None]  # of a speed sensor that is used, by method; empty if none is
    findings: list[Finding]


def solve(records: pd.DataFrame, prepared: Prepared) -> Part:
    """Return the estimates of a part of a mission by both methods.

    Parameters
    ----------
    records
        Canonical records of the part, at least one row.
    prepared
        What is known of the whole mission.
    """
    mission = prepared.mission
    compatible = reconcile(records, from_records(records), prepared.vehicle, mission)
    model = prepared.kinematic
    series = compatible.series
    if model.sources.fixes and not series.heading_known:
        model = model._replace(sources=model.sources._replace(fixes=False))
    found = kinematic.solve(series, model)
    tables, tallies, reasons, observable = [], {}, {}, {}
    depth_alone = not (model.sources.speed or model.sources.fixes)
    flights = [("kinematic", found.flight, found.problem, found.solution, depth_alone)]
    scales: dict[str, Scale | None] = {"kinematic": found.scale}
    if prepared.adjusted is not None and prepared.body is not None:
        inputs, missing = forcing(records, prepared.vehicle, mission, prepared.body)
        if inputs is not None:
            start = force.path(found.series, found.flight.state[0], found.flight.state[1])
            by_force = flown.solve(
                found.series, inputs, prepared.adjusted, start, speed=model.sources.speed, solver=model.solve
            )
            flights.append(("force", by_force.flight, by_force.problem, by_force.solution, False))
            scales["force"] = by_force.scale
    steady = ~(series.manoeuvre | series.resting)
    for method, flight, problem, solution, by_depth in flights:
        reason = verdict(
            series,
            flight.state[0],
            flight.std[0],
            flight.steady,
            flight.beyond,
            depth_alone=by_depth,
            glide=method == "kinematic",
            polar_known=not np.isnan(prepared.vehicle.polar).any(),
        )
        tables.append(_table(records, method, flight, reason))
        seen = reason == ""
        held_out = _held_out(series, flight, seen) if mission.speed_sensor == "check" else None
        instruments = ("depth", "pitch", "speed") if model.sources.speed else ("depth", "pitch")
        tallies[method] = tally(problem, solution, series.time, steady, instruments=instruments, held_out=held_out)
        texts, counts = np.unique(reason[~seen].astype(str), return_counts=True)
        reasons[method] = dict(zip(texts.tolist(), counts.tolist(), strict=True))
        observable[method] = (int(seen.sum()), int(seen.size))
        if method == "kinematic":
            shares = np.sum((flight.by**2 / np.maximum(flight.std[0], 1e-12) ** 2)[:, seen], axis=1)
            located = legs(series, flight, found.current, seen) if model.sources.fixes else []
    if prepared.adjusted is not None and "force" not in tallies:
        tables.append(_blank(records, "force", missing))
        reasons["force"], observable["force"] = {missing: len(records)}, (0, len(records))
    return Part(
        tables,
        means(records, tables[0], prepared.vehicle, mission, prepared.body),
        bool(records["buoyancy_volume"].notna().any()),
        tallies,
        reasons,
        observable,
        shares,
        located,
        compatible.report,
        scales if model.sources.speed and mission.speed_sensor_scale_std else {},
        [*compatible.findings, *_left_out(series, found.outlying)],
    )


def _table(records: pd.DataFrame, method: str, flight: Flight, reason: np.ndarray) -> pd.DataFrame:
    """Return the canonical estimates of one method; what is not observable is NaN but for pitch and depth."""
    seen = reason == ""
    table: dict[str, Any] = {"time": records["time"].array, "dive": records["dive"].to_numpy(), "method": method}
    for name, value, std in zip(NAMES, flight.state, flight.std, strict=True):
        shown = np.where(seen | (name in ("pitch", "depth")), 1.0, np.nan)
        table |= {name: value * shown, f"{name}_std": std * shown}
    return conform(pd.DataFrame(table | {"observable": seen, "reason": reason}), ESTIMATES)


def _blank(records: pd.DataFrame, method: str, reason: str) -> pd.DataFrame:
    """Return the canonical estimates of a method that has none for a part, and why."""
    named = {"time": records["time"].array, "dive": records["dive"].to_numpy(), "method": method}
    return conform(pd.DataFrame(named | {"observable": False, "reason": reason}), ESTIMATES)


def _held_out(series: Series, flight: Flight, seen: np.ndarray) -> np.ndarray | None:
    """Return the estimated speed less that of a sensor it has not seen, and the 1-sigma of this, shape (2, m)."""
    if not np.isfinite(series.speed).any():
        return None
    gap = np.where(seen, flight.state[0] - series.speed, np.nan)
    return np.stack([gap, np.hypot(flight.std[0], series.speed_std)])


def _left_out(series: Series, outlying: np.ndarray) -> list[Finding]:
    """Return a finding for each instrument some of whose measurements contradict the smoothed trajectory."""
    return [
        Finding(
            "warning",
            f"{name} record",
            f"{int(far.sum())} of {int(np.isfinite(value).sum())} samples, "
            f"the first {float(series.time[np.argmax(far)]):.0f} s in",
            f"values more than {kinematic.GATE:g} standard deviations from the smoothed trajectory",
            "values within",
            "left out of the estimate",
        )
        for name, value, far in zip(("depth", "pitch"), (series.depth, series.pitch), outlying, strict=True)
        if far.any()
    ]

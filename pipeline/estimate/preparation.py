"""What the parts of a mission need to know of the whole: noise levels, and the force model adjusted to its depth rate.

It is found on a few stretches of the mission, whatever its length.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from pipeline.estimate import adjust, force, kinematic, smoother
from pipeline.estimate.ballast import Hull
from pipeline.estimate.compatibility import clock_offset, reconcile
from pipeline.estimate.craft import Adjusted, from_vehicle
from pipeline.estimate.forcing import forcing
from pipeline.estimate.noise import Each
from pipeline.estimate.series import Series, from_records
from pipeline.estimate.trajectory import Solve, first_guess
from pipeline.estimate.verdict import UNKNOWN_POLAR
from pipeline.findings import Finding
from pipeline.mission import Mission
from pipeline.vehicle import Polar, Vehicle

METHODS = ("kinematic", "force")
#: A mission is prepared on at most this many stretches of as many records.
STRETCHES, STRETCH_RECORDS = 3, 20_000


class Prepared(NamedTuple):
    """All that a part needs to know of the whole mission."""

    vehicle: Vehicle
    mission: Mission
    engine: str
    kinematic: kinematic.Model
    body: Hull | None
    adjusted: Adjusted | None
    reason: str  # why there is no force model, where there is none
    clocks: dict[str, Any]  # the report on the offset between the clocks of pressure and pitch
    findings: list[Finding]


def windows(m: int) -> list[tuple[int, int]]:
    """Return the stretches that a mission of `m` records is prepared on: all of it, or some spread over it."""
    if m <= STRETCHES * STRETCH_RECORDS:
        return [(first, min(first + STRETCH_RECORDS, m)) for first in range(0, m, STRETCH_RECORDS)]
    starts = np.linspace(0, m - STRETCH_RECORDS, STRETCHES).astype(int).tolist()
    return [(first, first + STRETCH_RECORDS) for first in starts]


def prepare(
    stretches: Sequence[pd.DataFrame],
    vehicle: Vehicle,
    mission: Mission,
    body: tuple[Hull | None, list[Finding]],
    *,
    engine: str = "numba",
    methods: Sequence[str] = METHODS,
    threads: int = 1,
) -> Prepared:
    """Return what parts need to know of the whole mission, from some stretches of its records.

    Parameters
    ----------
    stretches
        Canonical records, at least one row each.
    body
        As from `ballast.hull` for the whole mission.
    vehicle, mission, engine, methods, threads
        As in `stage.estimate`; the two estimators can be prepared at the same time.
    """
    found = [reconcile(records, from_records(records), vehicle, mission).series for records in stretches]
    clocks, doubts = clock_offset(found, mission)
    findings = [*body[1], *doubts, *_assumed(vehicle)]
    located = mission.gps == "use" and any(series.located for series in found)

    def prepared(each: Each = map) -> kinematic.Model:
        return kinematic.prepare(found[0], vehicle, mission, _solver(engine), fixes=located, each=each)

    if "force" not in methods:
        return Prepared(vehicle, mission, engine, prepared(), body[0], None, "not asked for", clocks, findings)
    if threads == 1:
        model, (adjusted, reason) = prepared(), _adjusted(stretches, found, vehicle, mission, body[0])
    else:
        with ThreadPoolExecutor(threads) as pool, ThreadPoolExecutor(1) as beside:
            waiting = beside.submit(prepared, pool.map)
            adjusted, reason = _adjusted(stretches, found, vehicle, mission, body[0], pool.map)
            model = waiting.result()
    return Prepared(vehicle, mission, engine, model, body[0], adjusted, reason, clocks, findings)


def _assumed(vehicle: Vehicle) -> list[Finding]:
    """Return a warning where lift or drag are not the vehicle's own."""
    names = vehicle.assumed(vehicle.coefficients)
    if not set(names) & set(Polar._fields):
        return []
    return [
        Finding(
            "warning",
            "vehicle",
            vehicle.name,
            f"{', '.join(names)} assumed, from other gliders",
            "its own",
            "intervals are as wide as that; dives at several pitches and a speed sensor tell more, and vehicle.yaml in "
            "the report's folder keeps it",
        )
    ]


def _solver(engine: str) -> Solve:
    if engine == "filterpy":
        from pipeline.estimate.reference import solve

        return solve
    return smoother.solve


def _adjusted(
    stretches: Sequence[pd.DataFrame],
    found: Sequence[Series],
    vehicle: Vehicle,
    mission: Mission,
    body: Hull | None,
    each: Each = map,
) -> tuple[Adjusted | None, str]:
    """Return the force model adjusted to the depth rate, or why there is none."""
    if body is None:
        return None, "no mass or no density: no net buoyancy"
    if any(np.isnan(vehicle.polar)):
        return None, UNKNOWN_POLAR
    driven, paths = [], []
    for records, series in zip(stretches, found, strict=True):
        inputs, reason = forcing(records, vehicle, mission, body)
        if inputs is not None:
            driven.append(adjust.Stretch(series, inputs))
            guess = first_guess(series, vehicle.polar)
            paths.append(force.path(series, guess.speed, guess.pitch))
    if not driven:
        return None, reason
    craft = from_vehicle(vehicle, mission, body)
    use, scale = mission.speed_sensor == "use", mission.speed_sensor_scale_std
    return adjust.adjust(driven, craft, paths, speed=use, speed_scale=scale, each=each), ""

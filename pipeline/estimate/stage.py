"""Stage 2: records to estimates, by both estimators, part by part.

A mission is prepared on a few stretches of it: noise levels, and what the depth rate says of the force model's
parameters. Then it is solved in parts, cut at the surface and never within a block, on several threads; each part's
estimates are handed on as soon as they are there, so that memory does not grow with the mission. What is said of the
whole is a sum over the parts. Where a mission is cut does not depend on the number of threads, nor does any number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np
import pandas as pd

from pipeline.estimate import adjust, force, kinematic, smoother
from pipeline.estimate.ballast import Hull, hull
from pipeline.estimate.blocks import NO_ENGINE, means
from pipeline.estimate.compatibility import reconcile
from pipeline.estimate.consistency import Tally, tally
from pipeline.estimate.consistency import report as consistency
from pipeline.estimate.craft import Adjusted, from_vehicle
from pipeline.estimate.forcing import forcing
from pipeline.estimate.legs import Leg, flown, legs
from pipeline.estimate.series import Series, from_records
from pipeline.estimate.trajectory import Flight, first_guess
from pipeline.estimate.verdict import verdict
from pipeline.findings import Finding, nearest
from pipeline.mission import Mission
from pipeline.records import BLOCKS, ESTIMATES, Phase, conform
from pipeline.vehicle import Vehicle

ENGINES = ("numba", "filterpy")
METHODS = ("kinematic", "force")
#: A mission is solved in parts of about this many records, cut at the surface, so that memory does not grow with it.
PART_RECORDS = 60_000
#: It is prepared on at most this many stretches of as many records.
STRETCHES, STRETCH_RECORDS = 3, 20_000

NAMES = ("speed", "pitch", "angle_of_attack", "path_angle", "vertical_water_velocity", "depth")


class Source(Protocol):
    """Canonical records that can be read in parts."""

    @property
    def rows(self) -> int:
        """How many records there are."""

    def read(self, first: int = 0, last: int | None = None, columns: Sequence[str] | None = None) -> pd.DataFrame:
        """Return records `first` up to and without `last`, all columns or some."""


class InMemory(NamedTuple):
    """Records that are at hand."""

    records: pd.DataFrame

    @property
    def rows(self) -> int:
        """How many records there are."""
        return len(self.records)

    def read(self, first: int = 0, last: int | None = None, columns: Sequence[str] | None = None) -> pd.DataFrame:
        """Return records `first` up to and without `last`, all columns or some."""
        part = self.records.iloc[first:last]
        return part if columns is None else part[list(columns)]


class Summary(NamedTuple):
    """What is said of a whole mission: means over its blocks, the report, and what was doubted."""

    blocks: pd.DataFrame
    report: dict[str, Any]
    findings: list[Finding]


@dataclass(frozen=True)
class Estimated:
    """What the estimators hand on: the canonical estimates, what they rest on, and what was doubted."""

    estimates: pd.DataFrame
    report: dict[str, Any]
    findings: list[Finding]


class Prepared(NamedTuple):
    """All that a part needs to know of the whole mission."""

    vehicle: Vehicle
    mission: Mission
    engine: str
    kinematic: kinematic.Model
    body: Hull | None
    adjusted: Adjusted | None
    reason: str  # why there is no force model, where there is none
    findings: list[Finding]


class Part(NamedTuple):
    """What one part of a mission adds to the whole."""

    estimates: pd.DataFrame
    blocks: pd.DataFrame
    engine: bool  # whether the volume of the buoyancy engine is known
    tallies: dict[str, Tally]
    reasons: dict[str, dict[str, int]]  # how many records of each method are unobservable, by reason
    observable: dict[str, tuple[int, int]]  # how many are observable, of how many
    shares: np.ndarray  # (c,): sums of the shares of the variance of V that the borrowed leave open
    legs: list[Leg]
    compatibility: dict[str, Any]
    findings: list[Finding]


def estimate(
    records: pd.DataFrame,
    vehicle: Vehicle,
    mission: Mission,
    *,
    constants: Mapping[str, float] | None = None,
    engine: str = "numba",
    methods: Sequence[str] = METHODS,
    threads: int = 1,
) -> Estimated:
    """Return speed through water, angle of attack, path angle and vertical water velocity with their 1-sigma.

    Parameters
    ----------
    records
        Canonical records, one row per instant.
    vehicle
        The kinematic estimate borrows its polar (ratios of coefficients only), the force estimate all of it.
    mission
        Whether a speed sensor and fixes are used, 1-sigma of pitch bias and ballast.
    constants
        Calibration constants from the logs.
    engine
        ``numba``, or ``filterpy`` for the same linear problems by an independent implementation.
    methods
        Which of `METHODS`.
    threads
        On how many threads parts are solved.

    Returns
    -------
    Estimated
        Estimates at every record for each method; an unobservable speed is NaN with a reason.

    Raises
    ------
    ValueError
        If `engine` is not known.
    """
    tables: list[pd.DataFrame] = []
    summary = stream(
        InMemory(records),
        vehicle,
        mission,
        tables.append,
        constants=constants or {},
        engine=engine,
        methods=methods,
        threads=threads,
    )
    return Estimated(pd.concat(tables, ignore_index=True), summary.report, summary.findings)


def stream(
    source: Source,
    vehicle: Vehicle,
    mission: Mission,
    take: Callable[[pd.DataFrame], None],
    *,
    constants: Mapping[str, float],
    engine: str = "numba",
    methods: Sequence[str] = METHODS,
    threads: int = 1,
) -> Summary:
    """Estimate a mission part by part, and return what is said of the whole.

    Parameters
    ----------
    source
        Canonical records.
    take
        Called with the canonical estimates of each part, in order.
    vehicle, mission, constants, engine, methods, threads
        As in `estimate`.
    """
    if engine not in ENGINES:
        raise ValueError(f"engine: found '{engine}'; {nearest(engine, list(ENGINES))}")
    if not source.rows:
        take(conform(pd.DataFrame(), ESTIMATES))
        return Summary(conform(pd.DataFrame(), BLOCKS), _nothing(), [])
    bounds = cuts(source.read(columns=("phase", "block")))
    mission = _located(mission, source.read(columns=("latitude",)))
    body = hull(mission, vehicle, constants, source.read(columns=("density",)))
    stretches = [source.read(first, last) for first, last in windows(source.rows)]
    prepared = prepare(stretches, vehicle, mission, body, engine=engine, methods=methods)
    stretches.clear()
    parts: list[Part] = []
    for part in solved((source.read(first, last) for first, last in bounds), prepared, threads=threads):
        take(part.estimates)
        parts.append(part._replace(estimates=pd.DataFrame()))
    return Summary(pd.concat([part.blocks for part in parts], ignore_index=True), *merged(parts, prepared))


def _located(mission: Mission, records: pd.DataFrame) -> Mission:
    """Return `mission` with the latitude of its fixes, for parts of it that have none."""
    fixes = records["latitude"].dropna()
    return mission.model_copy(update={"latitude": float(fixes.median())}) if len(fixes) else mission


def windows(m: int) -> list[tuple[int, int]]:
    """Return the stretches that a mission of `m` records is prepared on: all of it, or some spread over it."""
    if m <= STRETCHES * STRETCH_RECORDS:
        return [(first, min(first + STRETCH_RECORDS, m)) for first in range(0, m, STRETCH_RECORDS)]
    starts = np.linspace(0, m - STRETCH_RECORDS, STRETCHES).astype(int).tolist()
    return [(first, first + STRETCH_RECORDS) for first in starts]


def cuts(records: pd.DataFrame, size: int | None = None) -> list[tuple[int, int]]:
    """Return where a mission is cut into parts of about `size` records, no block being cut in two.

    At the surface if it is met within half of `size` from there, else outside blocks or between two; beyond that only
    where a block is longer than that.

    Parameters
    ----------
    records
        Columns phase and block, m rows.
    size
        Records in a part, `PART_RECORDS` if left out.
    """
    size = size or PART_RECORDS
    block = records["block"].to_numpy()
    apart = block < 0
    apart[1:] |= block[1:] != block[:-1]
    surfaced = apart & (records["phase"].to_numpy() == Phase.SURFACING)
    m, bounds = len(records), [0]
    while m - bounds[-1] > 1.5 * size:
        aim = bounds[-1] + size
        first, last = aim - size // 2, aim + size // 2
        near = first + np.flatnonzero(surfaced[first:last])
        if not near.size:
            near = first + np.flatnonzero(apart[first:last])
        if not near.size:
            near = last + np.flatnonzero(apart[last:])[:1]
        if not near.size:
            break
        bounds.append(int(near[np.argmin(np.abs(near - aim))]))
    return list(pairwise([*bounds, m]))


def prepare(
    stretches: Sequence[pd.DataFrame],
    vehicle: Vehicle,
    mission: Mission,
    body: tuple[Hull | None, list[Finding]],
    *,
    engine: str = "numba",
    methods: Sequence[str] = METHODS,
) -> Prepared:
    """Return what parts need to know of the whole mission, from some stretches of its records.

    Parameters
    ----------
    stretches
        Canonical records, at least one row each.
    body
        As from `ballast.hull` for the whole mission.
    vehicle, mission, engine, methods
        As in `estimate`.
    """
    found = [reconcile(part, from_records(part), vehicle, mission).series for part in stretches]
    located = mission.gps == "use" and any(series.located for series in found)
    model = kinematic.prepare(found[0], vehicle, mission, _solver(engine), fixes=located)
    adjusted, reason = None, "not asked for"
    if "force" in methods:
        adjusted, reason = _adjusted(stretches, found, vehicle, mission, body[0])
    return Prepared(vehicle, mission, engine, model, body[0], adjusted, reason, body[1])


def _solver(engine: str) -> Callable[[smoother.Problem], smoother.Solution]:
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
) -> tuple[Adjusted | None, str]:
    """Return the force model adjusted to the depth rate, or why there is none."""
    if body is None:
        return None, "no mass or no density: no net buoyancy"
    if any(np.isnan(vehicle.polar)):
        return None, "lift and drag of the vehicle are not known"
    parts = []
    for records, series in zip(stretches, found, strict=True):
        inputs, reason = forcing(records, vehicle, mission, body)
        if inputs is not None:
            parts.append(adjust.Stretch(series, inputs))
    if not parts:
        return None, reason
    craft = from_vehicle(vehicle, mission, body)
    paths = []
    for part in parts:
        guess = first_guess(part.series, vehicle.polar)
        paths.append(force.path(part.series, guess.speed, guess.pitch))
    return adjust.adjust(parts, craft, paths, speed=mission.speed_sensor == "use"), ""


def solved(pieces: Iterable[pd.DataFrame], prepared: Prepared, *, threads: int = 1) -> Iterable[Part]:
    """Yield each part of a mission solved, in order; `threads` of them at a time."""
    if threads == 1:
        for piece in pieces:
            yield part(piece, prepared)
        return
    with ThreadPoolExecutor(threads) as pool:
        waiting = []
        for piece in pieces:
            waiting.append(pool.submit(part, piece, prepared))
            if len(waiting) > threads:  # no more than one beyond those at work, whatever the mission's length
                yield waiting.pop(0).result()
        for future in waiting:
            yield future.result()


def part(records: pd.DataFrame, prepared: Prepared) -> Part:
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
    flights = [("kinematic", found.flight, found.problem, found.solution, not any(model.sources))]
    if prepared.adjusted is not None and prepared.body is not None:
        inputs, missing = forcing(records, prepared.vehicle, mission, prepared.body)
        if inputs is not None:
            start = force.path(found.series, found.flight.state[0], found.flight.state[1])
            by_force = force.solve(
                found.series, inputs, prepared.adjusted, start, speed=model.sources.speed, solver=model.solve
            )
            flights.append(("force", *by_force, False))
    steady = ~(series.manoeuvre | series.surfaced)
    for method, flight, problem, solution, depth_alone in flights:
        reason = verdict(
            series,
            flight.state[0],
            flight.std[0],
            flight.steady,
            depth_alone=depth_alone,
            glide=method == "kinematic",
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
        pd.concat(tables, ignore_index=True),
        means(records, tables[0], prepared.vehicle, mission, prepared.body),
        bool(records["buoyancy_volume"].notna().any()),
        tallies,
        reasons,
        observable,
        shares,
        located,
        compatible.report,
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


def merged(parts: Sequence[Part], prepared: Prepared) -> tuple[dict[str, Any], list[Finding]]:
    """Return what is said of the whole mission, and every finding.

    Parameters
    ----------
    parts
        All parts, in order; their estimates are not looked at.
    prepared
        What they had in common.
    """
    model, adjusted = prepared.kinematic, prepared.adjusted
    judged = {}
    for method in dict.fromkeys(method for part in parts for method in part.tallies):
        total = reduce(lambda a, b: a + b, [part.tallies[method] for part in parts if method in part.tallies])
        judged[method] = consistency(total)
    seen, size = _sum(parts, "kinematic")
    shares = np.sum([part.shares for part in parts], axis=0)
    report: dict[str, Any] = {
        "observable_share": seen / size,
        "reasons": _reasons(parts, "kinematic"),
        "consistency": judged,
        "coverage": judged["kinematic"]["sensor"],
        "gps": flown([leg for part in parts for leg in part.legs]) if model.sources.fixes else None,
        "share_of_variance": {
            name: float(share) / seen if seen else None for name, share in zip(model.names, shares, strict=True)
        },
        "settings": model.settings._asdict()
        | {"engine": prepared.engine, "pitch_std_deg": prepared.mission.pitch.std_deg},
        "used": {"speed_sensor": model.sources.speed, "fixes": model.sources.fixes},
        "compatibility": parts[0].compatibility if len(parts) == 1 else _joined(parts),
    }
    report["force"] = {"reason": prepared.reason}
    if adjusted is not None:
        seen, size = _sum(parts, "force")
        report["force"] |= {
            **adjusted.report,
            "observable_share": seen / size if size else 0.0,
            "reasons": _reasons(parts, "force"),
            "settings": adjusted.settings._asdict(),
        }
    findings = list(prepared.findings)
    if not any(part.engine for part in parts):
        findings.append(NO_ENGINE)
    for finding in (item for part in parts for item in part.findings):
        if finding not in findings:
            findings.append(finding)
    return report, findings


def _sum(parts: Sequence[Part], method: str) -> tuple[int, int]:
    counts = [part.observable.get(method, (0, 0)) for part in parts]
    return sum(seen for seen, _ in counts), sum(size for _, size in counts)


def _reasons(parts: Sequence[Part], method: str) -> dict[str, int]:
    total: dict[str, int] = {}
    for part in parts:
        for text, count in part.reasons.get(method, {}).items():
            total[text] = total.get(text, 0) + count
    return dict(sorted(total.items()))


def _joined(parts: Sequence[Part]) -> dict[str, Any]:
    """Return the compatibility of the part that determines each quantity best; outliers are summed."""
    result = dict(parts[0].compatibility)
    for name in result:
        entries = [part.compatibility[name] for part in parts]
        if name == "outliers":
            total = {key: dict(value) for key, value in entries[0]["instruments"].items()}
            for entry in entries[1:]:
                for key, value in entry["instruments"].items():
                    had = total.setdefault(key, {"count": 0, "first": []})
                    had["count"] += value["count"]
            count = sum(entry["value"] or 0 for entry in entries)
            result[name] = {**entries[0], "value": count, "instruments": total}
        else:
            known = [entry for entry in entries if entry["value"] is not None and entry["std"]]
            result[name] = min(known, key=lambda entry: entry["std"]) if known else entries[0]
    return result


def _nothing() -> dict[str, Any]:
    """Return the report on a mission without records."""
    return {
        "observable_share": 0.0,
        "reasons": {},
        "consistency": {},
        "coverage": None,
        "gps": None,
        "share_of_variance": {},
        "settings": {},
        "used": {"speed_sensor": False, "fixes": False},
        "compatibility": {},
        "force": {"reason": "no records"},
    }

"""Stage 2: records to estimates, by both estimators, part by part.

What is flagged bad or probably bad does not enter: it is NaN from here on. A mission is prepared on a few stretches of
it: noise levels, and what the depth rate says of the force model's parameters. Then it is solved in parts, cut at the
surface and never within a block, on several threads; each part's estimates are handed on as soon as they are there, so
that memory does not grow with the mission. What is said of the whole is a sum over the parts. Where a mission is cut
does not depend on the number of threads, nor does any number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np
import pandas as pd

from pipeline.estimate.account import account, nothing
from pipeline.estimate.ballast import hull
from pipeline.estimate.part import Part, solve
from pipeline.estimate.preparation import METHODS, Prepared, prepare, windows
from pipeline.findings import Finding, nearest
from pipeline.geodesy import typical_latitude
from pipeline.mission import Mission
from pipeline.records import BLOCKS, ESTIMATES, Phase, conform, undoubted
from pipeline.vehicle import Vehicle

ENGINES = ("numba", "filterpy")
#: A mission is solved in parts of about this many records, cut at the surface, so that memory does not grow with it.
PART_RECORDS = 60_000


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
        Called with the canonical estimates of each part by each method, in order.
    vehicle, mission, constants, engine, methods, threads
        As in `estimate`.
    """
    if engine not in ENGINES:
        raise ValueError(f"engine: found '{engine}'; {nearest(engine, list(ENGINES))}")
    if not source.rows:
        take(conform(pd.DataFrame(), ESTIMATES))
        return Summary(conform(pd.DataFrame(), BLOCKS), nothing(), [])
    bounds = cuts(source.read(columns=("phase", "block")))
    fixes = undoubted(source.read(columns=("latitude", "latitude_qc")))
    latitude = typical_latitude(fixes["latitude"], mission.latitude)  # one for all parts
    mission = mission.model_copy(update={"latitude": latitude})
    body = hull(mission, vehicle, constants, source.read(columns=("density", "absolute_salinity")))
    stretches = [undoubted(source.read(first, last)) for first, last in windows(source.rows)]
    prepared = prepare(stretches, vehicle, mission, body, engine=engine, methods=methods, threads=threads)
    stretches.clear()
    parts: list[Part] = []
    for part in solved((undoubted(source.read(first, last)) for first, last in bounds), prepared, threads=threads):
        for table in part.estimates:
            take(table)
        parts.append(part._replace(estimates=[]))
    return Summary(pd.concat([part.blocks for part in parts], ignore_index=True), *account(parts, prepared))


def cuts(records: pd.DataFrame, size: int | None = None) -> list[tuple[int, int]]:
    """Return where a mission is cut into parts of about `size` records, no block being cut in two.

    They are equally long and even in number as far as that goes, so that two threads end together. A cut is at the
    surface if it is met within half a part from there, else outside blocks or between two; beyond that only where a
    block is longer than that.

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
    even = m / (2 * round(m / (2 * size))) if m > 1.5 * size else m
    while (left := m - bounds[-1]) > 1.5 * even:
        length = round(left / round(left / even))
        aim = bounds[-1] + length
        first, last = aim - length // 2, aim + length // 2
        near = first + np.flatnonzero(surfaced[first:last])
        if not near.size:
            near = first + np.flatnonzero(apart[first:last])
        if not near.size:
            near = last + np.flatnonzero(apart[last:])[:1]
        if not near.size:
            break
        bounds.append(int(near[np.argmin(np.abs(near - aim))]))
    return list(pairwise([*bounds, m]))


def solved(pieces: Iterable[pd.DataFrame], prepared: Prepared, *, threads: int = 1) -> Iterable[Part]:
    """Yield each part of a mission solved, in order; `threads` of them at a time."""
    if threads == 1:
        for piece in pieces:
            yield solve(piece, prepared)
        return
    with ThreadPoolExecutor(threads) as pool:
        waiting = []
        for piece in pieces:
            waiting.append(pool.submit(solve, piece, prepared))
            if len(waiting) > threads:  # no more than one beyond those at work, whatever the mission's length
                yield waiting.pop(0).result()
        for future in waiting:
            yield future.result()

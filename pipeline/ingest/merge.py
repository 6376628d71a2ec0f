"""Merge: the union of the clocks. One row an instant, NaN where an instrument did not report, nothing interpolated."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.findings import Finding, InputError
from pipeline.ingest.pressures import unlike
from pipeline.mission import PitchCorrection
from pipeline.records import Quality, microseconds

Array = npt.NDArray[np.float64]

#: Columns that belong together: the companion comes from the stream that its leader comes from.
_COMPANIONS = {"speed_through_water_std": "speed_through_water", "longitude": "latitude"}
_CTD = ("conductivity", "temperature")
#: Pressure of the CTD is taken where it covers at least this share of the other instrument's record under water
#: (dbar), which is where a value of it is as near as this (s).
_COVERAGE, _UNDER_WATER, _NEAR = 0.8, 2.0, 120.0


def merged(streams: list[pd.DataFrame]) -> tuple[pd.DataFrame, list[Finding]]:
    """Return all streams in one table on the union of their clocks, and which of several sensors was taken.

    Where two instruments carry the same quantity one is taken for the whole mission: the one with CTD data (and of the
    others the one with most values). For pressure the CTD must cover 80 % of the other's record, else a CTD that
    sleeps on climbs would hide them.

    Parameters
    ----------
    streams
        Frames with a strictly increasing ``time`` [s since 1970-01-01 UTC, whole microseconds].

    Returns
    -------
    table, findings
        ``time`` [s] strictly increasing and one column each for whatever the streams carry.
    """
    findings: list[Finding] = []
    owner = _owners(streams, findings)
    clocks = [_micro(frame) for k, frame in enumerate(streams) if k in set(owner.values())]
    instants = np.sort(np.concatenate(clocks), kind="stable") if clocks else np.zeros(0, dtype=np.int64)
    instants = instants[np.diff(instants, prepend=-1) > 0]
    columns: dict[str, npt.NDArray[np.generic]] = {"time": instants / 1e6}
    rows = {k: np.searchsorted(instants, _micro(streams[k])) for k in set(owner.values())}
    for name, k in owner.items():
        values = streams[k][name].to_numpy()
        if name.endswith("_qc"):
            column = np.full(instants.size, Quality.MISSING, dtype=np.int8)
        else:
            column = np.full(instants.size, np.nan)
        column[rows[k]] = values
        columns[name] = column
    table = pd.DataFrame(columns, copy=False)
    told = np.zeros(instants.size, dtype=bool)
    for name in owner:
        if not name.endswith("_qc"):
            told |= ~np.isnan(columns[name])
    return table[told].reset_index(drop=True) if not told.all() else table, findings


def with_pitch_correction(table: pd.DataFrame, correction: PitchCorrection) -> tuple[pd.DataFrame, list[Finding]]:
    """Return `table` with pitch = scale · logged + offset, and a note if that changes anything."""
    if correction.scale == 1.0 and correction.offset_rad == 0.0:
        return table, []
    pitch = correction.scale * table["pitch"] + correction.offset_rad
    note = Finding(
        "note", "mission.yaml", "pitch", f"pitch = {correction.scale:g} · logged {correction.offset_rad:+g} rad"
    )
    return table.assign(pitch=pitch), [note]


def selected(table: pd.DataFrame, dives: tuple[int, int] | None) -> tuple[pd.DataFrame, list[Finding]]:
    """Return the rows of the dives from the first to the last of `dives`, blocks numbered anew from 0.

    Raises
    ------
    InputError
        If there is no such dive.
    """
    if dives is None:
        return table, []
    first, last = dives
    dive = table["dive"].to_numpy()
    rows = (dive >= first) & (dive <= last)
    if not rows.any():
        raise InputError(
            "mission.yaml",
            "dives",
            found=f"{first} to {last}",
            expected=f"dives from 1 to {int(dive.max(initial=0))}",
            remedy="correct dives: or leave it out",
        )
    part = table[rows].reset_index(drop=True)
    block = part["block"].to_numpy()
    part["block"] = np.where(block >= 0, block - block[block >= 0].min(initial=block.max(initial=0)), -1).astype(
        np.int32
    )
    found = f"dives {first} to {last} selected, {len(part)} of {len(table)} rows"
    return part, [Finding("note", "mission.yaml", "dives", found)]


def _owners(streams: list[pd.DataFrame], findings: list[Finding]) -> dict[str, int]:
    """Return which stream each column comes from."""
    names = dict.fromkeys(name for frame in streams for name in frame.columns if name != "time")
    owner: dict[str, int] = {}
    for name in sorted(names, key=lambda name: (name in _COMPANIONS, name.endswith("_qc"))):
        carriers = [k for k, frame in enumerate(streams) if name in frame]
        leader = _COMPANIONS.get(name, name.removesuffix("_qc"))
        if leader != name and owner.get(leader) in carriers:
            owner[name] = owner[leader]
            continue
        counts = {k: _count(streams[k], name) for k in carriers}
        best = max(carriers, key=lambda k: (counts[k] > 0, _has_ctd(streams[k]), counts[k], -k))
        if name == "pressure":
            best = _covering(streams, carriers, counts, best)
        if name == "latitude":
            best = max(carriers, key=lambda k: (*_fixes(streams[k]), -k))
        owner[name] = best
        for k in carriers:
            if k != best and counts[k] and not name.endswith("_qc"):
                if name == "pressure" and (found := _unlike(streams, best, k)):
                    findings.append(found)
                    continue
                findings.append(
                    Finding(
                        "note",
                        _name(streams[k], k),
                        name,
                        f"{counts[k]} values of {name}",
                        "",
                        f"not used: {_name(streams[best], best)} has it too",
                    )
                )
    return owner


def _unlike(streams: list[pd.DataFrame], best: int, other: int) -> Finding | None:
    """Return a warning where the pressure of stream `other`, which is not used, is not that of `best`."""
    columns = [streams[k][name].to_numpy(dtype=np.float64) for k in (best, other) for name in ("time", "pressure")]
    found = unlike(*columns)
    if found is None:
        return None
    ours, theirs = _name(streams[best], best), _name(streams[other], other)
    remedy = (
        "not used; its unit?"
        if found.by_unit
        else f"not used; if the clock of {theirs} is wrong, so are its other columns: give its timezone under files: "
        "in mission.yaml, or clock_offset"
    )
    return Finding("warning", theirs, "pressure", f"{found.found} of {ours}", "the same", remedy)


def _fixes(frame: pd.DataFrame) -> tuple[bool, int]:
    """Return whether most positions of a stream are fixes, as a receiver's own are, and how many."""
    known = np.isfinite(frame["latitude"].to_numpy(dtype=np.float64))
    good = known & (frame["latitude_qc"] == Quality.GOOD).to_numpy() if "latitude_qc" in frame else known
    return bool(2 * good.sum() > known.sum()), int(good.sum())


def _covering(streams: list[pd.DataFrame], carriers: list[int], counts: dict[int, int], best: int) -> int:
    """Return `best`, or the stream with most of the record where `best` leaves out too much of it."""
    series = {k: streams[k][["time", "pressure"]].to_numpy(dtype=np.float64).T for k in carriers}
    for k in sorted(carriers, key=lambda k: -counts[k]):
        if k != best and counts[k] and counts[best] and not covers(*series[best], *series[k]):
            return k
    return best


def covers(time: Array, pressure: Array, other_time: Array, other_pressure: Array) -> bool:
    """Return whether a record of pressure leaves out little of another one under water; a CTD may sleep on climbs.

    Parameters
    ----------
    time, pressure
        s and dbar, NaN where not measured, times increasing; shape (m,).
    other_time, other_pressure
        The same of the other; shape (n,).
    """
    known = time[np.isfinite(time) & np.isfinite(pressure)]
    others = other_time[np.isfinite(other_time) & (other_pressure > _UNDER_WATER)]
    if not known.size or not others.size:
        return bool(known.size)
    after = np.clip(np.searchsorted(known, others), 0, known.size - 1)
    gap = np.minimum(np.abs(known[after] - others), np.abs(others - known[np.maximum(after - 1, 0)]))
    return bool(np.mean(gap < _NEAR) >= _COVERAGE)


def _count(frame: pd.DataFrame, name: str) -> int:
    if name.endswith("_qc"):
        return int((frame[name] != Quality.MISSING).sum())
    return int(np.isfinite(frame[name].to_numpy(dtype=np.float64)).sum())


def _has_ctd(frame: pd.DataFrame) -> int:
    return sum(1 for name in _CTD if name in frame and frame[name].notna().any())


def _micro(frame: pd.DataFrame) -> npt.NDArray[np.int64]:
    return microseconds(frame["time"].to_numpy(dtype=np.float64))


def _name(frame: pd.DataFrame, k: int) -> str:
    return str(frame.attrs.get("name", f"stream {k + 1}"))

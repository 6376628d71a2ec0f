"""Clocks: each instrument's times made strictly increasing, and every record that had to go counted."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.findings import Finding, InputError
from pipeline.records import microseconds

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

#: Times outside are no times, s since 1970-01-01 UTC.
EARLIEST, LATEST = (pd.Timestamp(day, tz="UTC").timestamp() for day in ("1990-01-01", "2100-01-01"))
#: Records in order that are a stretch of a table, not a handful of garbage.
_STRETCH = 25
#: A pause in the records of one mission is shorter, s; and a day, s.
LONGEST_PAUSE, DAY = 10 * 86_400.0, 86_400.0
#: What the CTD measures, and the pressure lent to one without a sensor of its own.
_OF_CTD = ("pressure", "pressure_interpolated", "temperature", "conductivity")


def cleaned(frame: pd.DataFrame, name: str) -> tuple[pd.DataFrame, list[Finding]]:
    """Return the records of one instrument with strictly increasing times, and what was wrong with the others.

    Times are rounded to the microsecond. Records without a time, before 1990 or after 2100 are dropped; of records out
    of order the fewest are dropped that leave the rest in order, unless the table was merely written in another order
    (`unsorted`) and is put in that of time; records of one instant become one, each column its first value.
    """
    time = frame["time"].to_numpy(dtype=np.float64)
    findings: list[Finding] = []
    absent = ~np.isfinite(time)
    absurd = ~absent & ((time < EARLIEST) | (time >= LATEST))
    kept = np.flatnonzero(~absent & ~absurd)
    micro = microseconds(time[kept])
    steps = np.diff(micro)
    backwards = np.zeros(0, dtype=np.int64)
    if (steps < 0).any():
        inside = longest_increase(micro)
        if unsorted(micro, inside):
            findings.append(_sorted(name, kept, steps))
            order = np.argsort(micro, kind="stable")
            kept, micro = kept[order], micro[order]
        else:
            backwards = kept[~inside]
            kept, micro = kept[inside], micro[inside]
        steps = np.diff(micro)
    repeated = kept[1:][steps == 0]
    for rows, what, expected in (
        (np.flatnonzero(absent), "no time", "a time"),
        (np.flatnonzero(absurd), "an absurd time", "a time from 1990 to 2100"),
        (backwards, "a time that goes backwards", "times that increase"),
        (repeated, "a time that repeats", "one record an instant"),
    ):
        if rows.size:
            findings.append(_finding(name, int(rows[0]), rows.size, len(frame), time, what, expected))
    if kept.size == len(frame) and (np.diff(kept) == 1).all() and not repeated.size:
        result = frame.assign(time=micro / 1e6)
    else:
        result = frame.iloc[kept].assign(time=micro / 1e6)
        if repeated.size:
            result = _first_of_each(result, micro)
        result = result.reset_index(drop=True)
    result.attrs = frame.attrs
    return result, findings


def shifted(streams: list[pd.DataFrame], offset: float) -> tuple[list[pd.DataFrame], list[Finding]]:
    """Return `streams` with `offset` seconds added to the clock of the CTD, and a note if that changes anything.

    The CTD's clock is that of pressure, temperature and conductivity: of every stream with pressure or conductivity.
    From one that has pitch too these columns are split off, so that they move and the rest stays.
    """
    if offset == 0.0:
        return streams, []
    out, moved = [], []
    for frame in streams:
        columns = [name for name in frame.columns if name.removesuffix("_qc") in _OF_CTD]
        if not {"pressure", "conductivity"} & set(columns):
            out.append(frame)
            continue
        name = str(frame.attrs.get("name", "CTD"))
        part = frame
        if "pitch" in frame:
            rest = frame.drop(columns=columns)
            part = frame[["time", *columns]]
            part = part[part[columns].notna().any(axis=1)].reset_index(drop=True)
            rest.attrs, part.attrs = frame.attrs, frame.attrs
            out.append(rest)
        later = part.assign(time=microseconds(part["time"].to_numpy(dtype=np.float64) + offset) / 1e6)
        later.attrs = frame.attrs
        out.append(later)
        moved.append(name)
    return out, [Finding("note", "mission.yaml", "clock_offset", f"{offset:+g} s on the clock of {', '.join(moved)}")]


def overlapping(streams: list[pd.DataFrame]) -> list[Finding]:
    """Return a warning about each instrument that reports for less than half of its record while pressure does.

    Raises
    ------
    InputError
        If pitch and pressure never report at the same time: a zone, a unit of time or a date is wrong.
    """
    spans = {
        name: [span for frame in streams if name in frame and (span := _span(frame, name)) is not None]
        for name in ("pressure", "pitch")
    }
    if not all(spans.values()):
        return []
    if not any(_shared(pitch, spans["pressure"]) > 0 for pitch in spans["pitch"]):
        file, *pitch = spans["pitch"][0]
        other, *pressure = spans["pressure"][0]
        raise InputError(
            file,
            "time",
            found=f"pitch from {_readable(pitch[0])} to {_readable(pitch[1])}, and pressure from "
            f"{_readable(pressure[0])} to {_readable(pressure[1])} in {other}",
            expected="records of the same time",
            remedy="correct the unit of time or the timezone of one of them under files: in mission.yaml",
        )
    findings = []
    for frame in streams:
        span = _span(frame, "time")
        if span is None or "pressure" in frame:
            continue
        share = _shared(span, spans["pressure"])
        if share < 0.5:
            during = f"records from {_readable(span[1])} to {_readable(span[2])}"
            findings.append(
                Finding(
                    "warning",
                    span[0],
                    "time",
                    f"{during}, {share:.0%} of it while pressure reports",
                    "records of the same time",
                    "the rest cannot be analysed; if its clock is in another zone or unit, say so under files: in "
                    "mission.yaml",
                )
            )
    return findings


def pausing(time: Array) -> list[Finding]:
    """Return a warning where the records of a mission, `time` in s and sorted, pause for so long that it may be two."""
    if time.size < 2:
        return []
    pauses = np.diff(time)
    k = int(np.argmax(pauses))
    if pauses[k] < LONGEST_PAUSE:
        return []
    more = int((pauses >= LONGEST_PAUSE).sum()) - 1
    found = f"no records for {pauses[k] / DAY:.0f} days from {_readable(time[k])} to {_readable(time[k + 1])}" + (
        f", and {more} more such pause{'s' if more > 1 else ''}" if more else ""
    )
    remedy = (
        "ballast, drag and clocks are taken to be the same throughout: if these are two missions, give each a folder "
        "of its own"
    )
    return [Finding("warning", "mission", "time", found, "one mission", remedy)]


def _span(frame: pd.DataFrame, name: str) -> tuple[str, float, float] | None:
    """Return the name of a stream, and its first and last time with a value of column `name`."""
    time = frame["time"].to_numpy(dtype=np.float64)[frame[name].notna().to_numpy()]
    return (str(frame.attrs.get("name", "stream")), float(time[0]), float(time[-1])) if time.size else None


def _shared(span: tuple[str, float, float], others: list[tuple[str, float, float]]) -> float:
    """Return the share of a span of time that lies within that of one of `others`; 1 for an instant within it."""
    length = span[2] - span[1]
    return max(
        max(0.0, min(span[2], end) - max(span[1], begin)) / length if length else float(begin <= span[1] <= end)
        for _, begin, end in others
    )


def unsorted(micro: npt.NDArray[np.int64], inside: Mask) -> bool:
    """Return whether times, shape (n,), are those of a good clock written in another order.

    So they are where most records are out of order, or where the table is made of stretches, each in order and at
    least `_STRETCH` records long, that do not overlap in time. A clock that is set back goes twice through the same
    time.

    Parameters
    ----------
    micro
        Times, µs.
    inside
        Which of them are in order (`longest_increase`).
    """
    if 2 * int(inside.sum()) < inside.size:
        return True
    starts = np.r_[0, np.flatnonzero(np.diff(micro) < 0) + 1]
    ends = np.r_[starts[1:], micro.size]
    if (ends - starts).min() < _STRETCH:
        return False
    order = np.argsort(micro[starts], kind="stable")
    first, last = micro[starts[order]], micro[ends[order] - 1]
    return bool((first[1:] > last[:-1]).all())


def longest_increase(values: npt.NDArray[np.int64]) -> Mask:
    """Return which of `values`, shape (n,), form a longest non-decreasing subsequence, as a mask of shape (n,).

    What is in order with everything before and after it belongs to one in any case; the rest is found by patience
    sorting (Fredman 1975, doi:10.1016/0012-365X(75)90103-X), O(n log n).
    """
    least_after = np.minimum.accumulate(values[::-1])[::-1]
    mask = (values >= np.maximum.accumulate(values)) & (values <= least_after)
    mask[~mask] = _patience(values[~mask])
    return np.asarray(mask)


def _patience(values: npt.NDArray[np.int64]) -> Mask:
    tails: list[int] = []
    at: list[int] = []
    before = np.full(values.size, -1, dtype=np.int64)
    for i, value in enumerate(values.tolist()):
        place = bisect_left(tails, value + 1)
        if place == len(tails):
            tails.append(value)
            at.append(i)
        else:
            tails[place] = value
            at[place] = i
        before[i] = at[place - 1] if place else -1
    mask = np.zeros(values.size, dtype=bool)
    i = at[-1] if at else -1
    while i >= 0:
        mask[i] = True
        i = int(before[i])
    return mask


def _first_of_each(frame: pd.DataFrame, micro: npt.NDArray[np.int64]) -> pd.DataFrame:
    """Return one record per instant, NaN in its first record filled from the later ones of the same instant."""
    new = np.r_[True, np.diff(micro) > 0]
    group = np.cumsum(new) - 1
    out = frame[new].copy()
    twins = np.isin(group, group[~new])
    filled = frame[twins].groupby(group[twins]).first()
    rows = np.flatnonzero(np.isin(group[new], filled.index.to_numpy()))
    for column in frame.columns:
        values = out[column].to_numpy(copy=True)
        values[rows] = filled[column].to_numpy()
        out[column] = values
    return out


def _sorted(name: str, kept: npt.NDArray[np.int64], steps: npt.NDArray[np.int64]) -> Finding:
    row = int(kept[1:][steps < 0][0])
    found = f"records that are not in the order of time, {kept.size} in all"
    return Finding("warning", name, f"record {row + 1}", found, "times that increase", "sorted by time")


def _finding(name: str, row: int, count: int, total: int, time: Array, what: str, expected: str) -> Finding:
    value = "" if not np.isfinite(time[row]) else f" ({_readable(float(time[row]))})"
    return Finding(
        "warning",
        name,
        f"record {row + 1}",
        f"{what}{value}, and {count} of {total} records like it" if count > 1 else f"{what}{value}",
        expected,
        "merged into one record" if "repeats" in what else "left out",
    )


def _readable(time: float) -> str:
    """Return a POSIX time as UTC text where the calendar has it, else as a number."""
    return f"{pd.Timestamp(time, unit='s').round('us').isoformat()}Z" if EARLIEST <= time < LATEST else f"{time:g}"

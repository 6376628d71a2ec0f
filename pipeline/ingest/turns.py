"""Turns: which tables are one instrument's, each file of it reporting while the others are silent."""

from __future__ import annotations

import math

import pandas as pd

from pipeline.findings import Finding
from pipeline.ingest.clock import EARLIEST, LATEST
from pipeline.records import Quality


def joined(streams: list[pd.DataFrame]) -> list[pd.DataFrame]:
    """Return `streams` with those of the same columns that follow each other in time put together."""
    groups: dict[tuple[str, ...], list[list[pd.DataFrame]]] = {}
    for frame in sorted(streams, key=lambda frame: _span(frame)[0]):
        rows = groups.setdefault(tuple(sorted(frame.columns)), [])
        for row in rows:
            if _span(row[-1])[1] < _span(frame)[0]:
                row.append(frame)
                break
        else:
            rows.append([frame])
    out = [_together(row) for rows in groups.values() for row in rows]
    return sorted(out, key=lambda frame: str(frame.attrs["name"]))


def taken(streams: list[pd.DataFrame]) -> tuple[list[pd.DataFrame], list[Finding]]:
    """Return `streams` with those put together that take turns: one instrument, some files with a column more or less.

    They have at least half of the columns of one of them in common, and no file of one reports while a file of another
    does. Apart, each would be a second sensor of the same quantity, of which one is used for the whole mission.
    """
    rows: list[list[pd.DataFrame]] = []
    for frame in sorted(streams, key=len, reverse=True):
        for row in rows:
            if all(_alike(frame, other) for other in row) and _apart([*row, frame]):
                row.append(frame)
                break
        else:
            rows.append([frame])
    findings = []
    for row in rows:
        if len(row) > 1:
            every = set().union(*(_measured(frame) for frame in row))
            for frame in row:
                if lacking := sorted(every - _measured(frame)):
                    found = f"files of one instrument without {', '.join(lacking)}, which others have"
                    findings.append(Finding("note", str(frame.attrs["name"]), "", found, "", "put together in time"))
    out = [_together([piece for frame in row for piece in _pieces(frame)]) if len(row) > 1 else row[0] for row in rows]
    return sorted(out, key=lambda frame: str(frame.attrs["name"])), findings


def _together(frames: list[pd.DataFrame]) -> pd.DataFrame:
    """Return `frames` one after the other in the order of their first times, their files remembered."""
    ordered = sorted(frames, key=lambda frame: _span(frame)[0])
    joined = pd.concat(ordered, ignore_index=True) if len(ordered) > 1 else ordered[0]
    flags = [name for name in joined if str(name).endswith("_qc") and joined[name].dtype.kind == "f"]
    joined = joined.assign(**{str(name): joined[name].fillna(Quality.MISSING).astype("int8") for name in flags})
    names = [str(frame.attrs["name"]) for frame in ordered]
    label = ", ".join(names) if len(names) < 4 else f"{names[0]} … {names[-1]}"
    joined.attrs = {
        **ordered[0].attrs,
        "name": label,
        "files": [(name, len(frame)) for name, frame in zip(names, ordered, strict=True)],
    }
    return joined


def _pieces(frame: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the files that `frame` was put together from."""
    out, begin = [], 0
    for name, count in frame.attrs["files"]:
        piece = frame.iloc[begin : begin + count]
        piece.attrs = {**frame.attrs, "name": name}
        out.append(piece)
        begin += count
    return out


def _span(frame: pd.DataFrame) -> tuple[float, float]:
    time = frame["time"][frame["time"].between(EARLIEST, LATEST)]
    return float(time.min()), float(time.max())


def _apart(frames: list[pd.DataFrame]) -> bool:
    """Return whether no file of one of `frames` reports while a file of another does."""
    spans = sorted((*_span(piece), k) for k, frame in enumerate(frames) for piece in _pieces(frame))
    ends = [-math.inf] * len(frames)
    for begin, end, k in spans:
        if not all(other < begin for j, other in enumerate(ends) if j != k):
            return False
        ends[k] = max(ends[k], end)
    return True


def _alike(frame: pd.DataFrame, other: pd.DataFrame) -> bool:
    """Return whether two tables have at least half of the columns of one of them in common."""
    ours, theirs = _measured(frame), _measured(other)
    return 2 * len(ours & theirs) >= min(len(ours), len(theirs))


def _measured(frame: pd.DataFrame) -> set[str]:
    return {str(name) for name in frame if name != "time" and not str(name).endswith("_qc")}

"""Turns: which tables are one instrument's, each file of it reporting while the others are silent."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from pipeline.findings import Finding
from pipeline.ingest.clock import EARLIEST, LATEST
from pipeline.records import Quality

#: Of the records of a file that another one covers so many, or this share of them, may be unlike those of the other:
#: a line that was torn as one file ended, a value that one of them lacks.
TORN, DIFFERING = 1, 0.1


def joined(streams: list[pd.DataFrame]) -> tuple[list[pd.DataFrame], list[Finding]]:
    """Return `streams` with those of the same columns that follow each other in time put together.

    Where a file begins before another ends and repeats its records, as pieces of a download do, or all of it, they
    follow each other too, and what is repeated is used once.
    """
    groups: dict[tuple[str, ...], list[list[tuple[pd.DataFrame, float]]]] = {}
    findings = []
    for (begin, end), frame in sorted(((_span(frame), frame) for frame in streams), key=lambda each: each[0][0]):
        rows = groups.setdefault(tuple(sorted(frame.columns)), [])
        for row in rows:
            again = _repeated(frame, begin, row)
            if again is None:
                continue
            if again.any():
                found = f"{again.sum()} of {len(frame)} records that another file has, too"
                findings.append(Finding("note", str(frame.attrs["name"]), "", found, "", "used once"))
            if not again.all():
                rest = frame[~again]
                rest.attrs = frame.attrs
                row.append((rest, max(end, row[-1][1])))
            break
        else:
            rows.append([(frame, end)])
    out = [_together([frame for frame, _ in row]) for rows in groups.values() for row in rows]
    return sorted(out, key=lambda frame: str(frame.attrs["name"])), findings


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


def _repeated(frame: pd.DataFrame, begin: float, row: list[tuple[pd.DataFrame, float]]) -> np.ndarray | None:
    """Return which records of `frame`, which begins at `begin`, those of `row` repeat; None if it reports of its own.

    With each of `row` goes when the last of it and of those before it ends.
    """
    end = row[-1][1]
    if end < begin:
        return np.zeros(len(frame), dtype=bool)
    during = frame["time"].between(begin, end).to_numpy()
    if not during.any():
        return None
    others = np.concatenate([_digest(other, frame) for other, last in row if last >= begin])
    again = np.asarray(during & np.isin(_digest(frame, frame), others))
    return again if np.sum(during & ~again) <= max(TORN, DIFFERING * during.sum()) else None


def _digest(frame: pd.DataFrame, like: pd.DataFrame) -> np.ndarray:
    """Return a number for each record, shape (len(frame),), that is the same where time and all columns are."""
    numbers = frame[list(like.columns)].astype("float64")
    return np.asarray(pd.util.hash_pandas_object(numbers, index=False))


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
    """Return whether no file of one of `frames` reports while a file of another does; one may end as another begins."""
    spans = sorted((*_span(piece), k) for k, frame in enumerate(frames) for piece in _pieces(frame))
    ends = [-math.inf] * len(frames)
    for begin, end, k in spans:
        if not all(other <= begin for j, other in enumerate(ends) if j != k):
            return False
        ends[k] = max(ends[k], end)
    return True


def _alike(frame: pd.DataFrame, other: pd.DataFrame) -> bool:
    """Return whether two tables have at least half of the columns of one of them in common."""
    ours, theirs = _measured(frame), _measured(other)
    return 2 * len(ours & theirs) >= min(len(ours), len(theirs))


def _measured(frame: pd.DataFrame) -> set[str]:
    return {str(name) for name in frame if name != "time" and not str(name).endswith("_qc")}

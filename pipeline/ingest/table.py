"""Plain tables: CSV, text and Parquet files, one instrument clock each; those of SeaExplorer and of ``dbd2asc`` too.

Columns, units and time zone come from ``files:`` in mission.yaml; what is left out there is guessed from the header
and the range of the values, and every guess is a finding.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.findings import Finding, InputError, nearest
from pipeline.ingest.columns import Candidates, Source, chosen, converted, listed, match
from pipeline.ingest.fills import without_fills
from pipeline.ingest.units import by_range
from pipeline.mission import Mission, Table

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.ingest.logs import Logs

TRUTH = "truth.parquet"
#: Names of plain tables; SeaExplorer numbers its files behind ``gli.sub`` and the like.
_NAME = re.compile(
    r".+\.(parquet|(csv|txt|tsv|asc|dba|[dsmnet]bdasc)(\.gz)?|(gli|pld\d)\.(sub|raw)(\.(\d+|all))?(\.gz)?)",
    re.IGNORECASE,
)


def recognises(path: Path) -> bool:
    """Return whether `path` is a plain table by its name."""
    name = path.name.lower()
    return bool(_NAME.fullmatch(name)) and name != TRUTH and not name.startswith(("readme", "license", "."))


def files(folder: Path) -> list[Path]:
    """Return the plain tables in `folder`, by name."""
    return sorted(path for path in folder.iterdir() if path.is_file() and recognises(path))


def named(mission: Mission) -> dict[Path, Table]:
    """Return the files that mission.yaml names, or matches by a pattern (``gli.*.gz``), and what it says of each.

    Raises
    ------
    InputError
        If there is no such file.
    """
    present = sorted(path for path in mission.folder.iterdir() if path.is_file())
    out: dict[Path, Table] = {}
    for pattern, table in mission.files.items():
        found = [path for path in present if path.name == pattern]
        found = found or [path for path in present if fnmatchcase(path.name, pattern)]
        if not found:
            raise InputError(
                "mission.yaml",
                f"files.{pattern}",
                found="no such file",
                expected="a file in the mission's folder",
                remedy=nearest(pattern, [path.name for path in present]),
            )
        out.update(dict.fromkeys(found, table))
    return out


def read(mission: Mission) -> Logs:
    """Return the logs of a mission kept in plain tables.

    Files with the same columns that follow each other in time are one instrument. A file that is no table, has no time
    or one that cannot be understood, or holds nothing that the records know, is left out with a finding.

    Raises
    ------
    InputError
        If mission.yaml names a file, a column or a unit that is not there, or the times of no file can be understood.
    """
    from pipeline.ingest.logs import Logs, gather
    from pipeline.ingest.seawater import pressure_and_conductivity

    findings: list[Finding] = []
    if (mission.folder / TRUTH).is_file():
        findings.append(Finding("note", TRUTH, "", "the truth of a simulation", "", "not read: it is not a log"))
    tables = dict.fromkeys(files(mission.folder), Table()) | named(mission)
    parts = [part for path, table in sorted(tables.items()) if (part := _read_file(path, table, findings))]
    streams: list[pd.DataFrame] = []
    failures: list[InputError] = []
    for likeness in dict.fromkeys(part.likeness for part in parts):
        alike = [part for part in parts if part.likeness == likeness]
        sources, notes = chosen([part.raw for part in alike], alike[0].candidates, alike[0].file)
        findings += notes
        guesses = _guesses([part.raw for part in alike], sources)
        for part in alike:
            try:
                frame, notes = converted(part.raw, part.candidates["time"], sources, part.table, part.file, guesses)
            except InputError as error:
                if part.table != Table():
                    raise
                failures.append(error)
                continue
            streams.append(frame)
            findings += notes
    if failures and not streams:
        raise failures[0]
    findings += [
        replace(error.finding, remedy=f"file left out; {error.finding.remedy}".rstrip("; ")) for error in failures
    ]
    streams, doubts = pressure_and_conductivity(mission, _join(streams))
    return Logs(streams, gather([*findings, *doubts]))


@dataclass(frozen=True)
class _Part:
    """One file as it was read: its columns as they stand there, and which of them may be which canonical one."""

    file: str
    table: Table
    candidates: Candidates
    raw: pd.DataFrame

    @property
    def likeness(self) -> tuple[tuple[str, tuple[Source, ...]], ...]:
        """What files of one instrument have in common."""
        return tuple(sorted(self.candidates.items()))


def _guesses(raws: list[pd.DataFrame], sources: dict[str, Source]) -> dict[str, str]:
    """Return the units that the ranges suggest where none is stated, from all files of an instrument together."""
    import numpy as np

    units = {
        name: by_range(np.concatenate([raw[source.column].to_numpy(dtype=np.float64) for raw in raws]), name)
        for name, source in sources.items()
        if source.unit is None and not name.endswith("_qc")
    }
    # Near the equator or Greenwich one of the two is small enough for either; a receiver writes both alike.
    position = {name for name in ("latitude", "longitude") if name in units}
    if any(units[name] == "ddmm" for name in position):
        units |= dict.fromkeys(position, "ddmm")
    return units


def _read_file(path: Path, table: Table, findings: list[Finding]) -> _Part | None:
    """Return one file as it stands, None (and a finding) if it is not a table of any use."""
    opened = _open(path)
    if opened is None:
        findings.append(Finding("error", path.name, "", "no table", "a header line and records", "file left out"))
        return None
    columns, units = opened.columns, opened.units
    candidates, notes = match(columns, units, table, path.name)
    findings.extend(notes)
    if "time" not in candidates:
        findings.append(
            Finding(
                "error",
                path.name,
                "",
                f"no time among the columns {listed(columns)}",
                "a time column",
                f"file left out; name it under files: {path.name}: time: in mission.yaml",
            )
        )
        return None
    if len(candidates) == 1:
        findings.append(
            Finding(
                "warning",
                path.name,
                "",
                f"nothing but time known among the columns {listed(columns)}",
                "a measurement",
                f"file left out; name columns under files: {path.name}: columns: in mission.yaml",
            )
        )
        return None
    raw, trouble = opened.read(candidates)
    findings.extend(
        Finding("warning", path.name, "", what, "one number or time in each field", "those were left out")
        for what in trouble
    )
    if raw.empty:
        findings.append(Finding("error", path.name, "", "a header and no records", "records", "file left out"))
        return None
    measured = [source.column for name, entry in candidates.items() for source in entry
                if name != "time" and not name.endswith("_qc")]  # fmt: skip
    raw, notes = without_fills(raw, measured, path.name)
    findings.extend(notes)
    return _Part(path.name, table, candidates, raw)


def _join(streams: list[pd.DataFrame]) -> list[pd.DataFrame]:
    """Return `streams` with those of the same columns that follow each other in time put together."""
    import pandas as pd

    def span(frame: pd.DataFrame) -> tuple[float, float]:
        time = frame["time"][frame["time"].between(6.3e8, 4.2e9)]
        return float(time.min()), float(time.max())

    groups: dict[tuple[str, ...], list[list[pd.DataFrame]]] = {}
    for frame in sorted(streams, key=lambda frame: span(frame)[0]):
        rows = groups.setdefault(tuple(sorted(frame.columns)), [])
        for row in rows:
            if span(row[-1])[1] < span(frame)[0]:
                row.append(frame)
                break
        else:
            rows.append([frame])
    out = []
    for rows in groups.values():
        for row in rows:
            joined = pd.concat(row, ignore_index=True) if len(row) > 1 else row[0]
            names = [frame.attrs["name"] for frame in row]
            label = ", ".join(names) if len(names) < 4 else f"{names[0]} … {names[-1]}"
            joined.attrs = {**row[0].attrs, "name": label}
            out.append(joined)
    return sorted(out, key=lambda frame: str(frame.attrs["name"]))


@dataclass(frozen=True)
class _Opened:
    """A table whose header is read: its columns and their units ("" unknown), and how to read the rest."""

    path: Path
    columns: list[str]
    units: list[str]
    layout: Any

    def read(self, candidates: Candidates) -> tuple[pd.DataFrame, list[str]]:
        """Return the columns of `candidates` and what could not be read of them."""
        clocks = list(dict.fromkeys(source.column for source in candidates["time"]))
        every = dict.fromkeys(source.column for entry in candidates.values() for source in entry)
        measured = [column for column in every if column not in clocks]
        if self.layout is None:
            return _read_parquet(self.path, clocks, measured)
        from pipeline.ingest import text

        first = dict(zip(self.columns, self.layout.first, strict=False))
        timed = [column for column in clocks if not text.is_number(first.get(column, ""))]
        numeric = [column for column in clocks if column not in timed]
        return text.read(self.path, self.layout, numeric + measured, timed)


def _open(path: Path) -> _Opened | None:
    if path.name.lower().endswith(".parquet"):
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            schema = pq.read_schema(path)
        except (pa.ArrowInvalid, OSError):
            return None
        metas = [field.metadata or {} for field in schema]
        units = [(meta.get(b"unit") or meta.get(b"units") or b"").decode() for meta in metas]
        return _Opened(path, list(schema.names), units, None)
    from pipeline.ingest import text

    layout = text.sniff(path)
    return None if layout is None else _Opened(path, layout.names, layout.units, layout)


def _read_parquet(path: Path, clocks: list[str], measured: list[str]) -> tuple[pd.DataFrame, list[str]]:
    import pandas as pd
    import pyarrow as pa
    import pyarrow.parquet as pq

    wanted = clocks + measured
    try:
        frame = pq.read_table(path, columns=wanted).to_pandas().reset_index()
    except (pa.ArrowInvalid, OSError) as error:
        return pd.DataFrame(columns=wanted), [f"an unreadable file ({error})"]
    trouble = []
    for name in measured:
        if frame[name].dtype.kind not in "fiub":
            numbers = pd.to_numeric(frame[name], errors="coerce")
            wrong = numbers.isna() & frame[name].notna()
            if wrong.any():
                first, count = frame[name][wrong].iloc[0], f"{int(wrong.sum())} of {len(frame)} fields"
                trouble.append(f"{count} of column '{name}' that are no number, first '{first}'")
            frame[name] = numbers
    for clock in clocks:
        if frame[clock].dtype.kind in "iu":
            frame[clock] = frame[clock].astype("float64")
    return frame[wanted], trouble

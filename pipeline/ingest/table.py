"""Plain tables: CSV, text, Parquet and netCDF; those of SeaExplorer and of ``dbd2asc`` too.

Columns, units and time zone come from ``files:`` in mission.yaml; what is left out there is guessed from the header
and the range of the values, and every guess is a finding.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.findings import Finding, InputError, nearest
from pipeline.ingest.columns import Candidates, Source, chosen, converted, listed, match
from pipeline.ingest.fills import without_fills
from pipeline.ingest.headers import of_receiver
from pipeline.ingest.sheets import Sheet, is_netcdf, sheets
from pipeline.ingest.units import by_range, spelling
from pipeline.mission import Mission, Table

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import pandas as pd

    from pipeline.ingest.logs import Logs

    Array = npt.NDArray[np.float64]

TRUTH = "truth.parquet"
#: Names of a Seaglider's per-dive files, which are read as what they are.
SEAGLIDER = r"p\d{7}(_\w+)?\.nc"
#: Names of plain tables; SeaExplorer numbers its files behind ``gli.sub`` and the like.
_NAME = re.compile(
    rf"(?!{SEAGLIDER}$).+\.(nc|parquet|(csv|txt|tsv|dat|asc|dba|[dsmnet]bdasc)(\.gz)?|(gli|pld\d)\.(sub|raw)(\.(\d+|all))?(\.gz)?)",
    re.IGNORECASE,
)


#: The glider that a SeaExplorer's file is of.
_SERIAL = re.compile(r"(sea\d{3})\.")


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

    Files with the same columns that follow each other in time, or repeat each other, are one instrument. A file that is
    no table, has no time or one that cannot be understood, or holds nothing that the records know, is left out with a
    finding.

    Raises
    ------
    InputError
        If mission.yaml names a file, a column or a unit that is not there, or the times of no file can be understood.
    """
    from pipeline.ingest import turns
    from pipeline.ingest.logs import Logs, gather, of_one
    from pipeline.ingest.seawater import pressure_and_conductivity

    findings: list[Finding] = []
    if (mission.folder / TRUTH).is_file():
        findings.append(Finding("note", TRUTH, "", "the truth of a simulation", "", "not read: it is not a log"))
    tables = dict.fromkeys(files(mission.folder), Table()) | named(mission)
    findings += of_one(
        mission.folder.name, {found[1] for path in tables if (found := _SERIAL.match(path.name.lower()))}
    )
    parts = [part for path, table in sorted(tables.items()) for part in _read_file(path, table, findings)]
    streams: list[pd.DataFrame] = []
    failures: list[InputError] = []
    for likeness in dict.fromkeys(part.likeness for part in parts):
        alike = [part for part in parts if part.likeness == likeness]
        sources, notes = chosen([part.raw for part in alike], alike[0].candidates, alike[0].file)
        findings += notes
        guesses = _guesses([part for part in parts if part.is_like(alike[0])], sources)
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
    streams, notes = turns.joined(streams)
    findings += notes
    streams, doubts = pressure_and_conductivity(mission, streams)
    streams, notes = turns.taken(streams)
    return Logs(streams, gather([*findings, *doubts, *notes]))


@dataclass(frozen=True)
class _Part:
    """One file as it was read: its columns as they stand there, and which of them may be which canonical one."""

    file: str
    table: Table
    candidates: Candidates
    raw: pd.DataFrame

    @property
    def likeness(self) -> tuple[tuple[str, tuple[Source, ...]], ...]:
        """What files with the same columns have in common."""
        return tuple(sorted(self.candidates.items()))

    def is_like(self, other: _Part) -> bool:
        """Return whether at least half of the columns of one of the two files are those of the other."""
        ours, theirs = set(self.candidates.items()), set(other.candidates.items())
        return 2 * len(ours & theirs) >= min(len(ours), len(theirs))


def _guesses(parts: list[_Part], sources: dict[str, Source]) -> dict[str, str]:
    """Return the units that the ranges suggest where none is stated, from all files of an instrument together."""
    import numpy as np

    def values(name: str, source: Source) -> Array:
        raws = [part.raw for part in parts if source in part.candidates.get(name, ())]
        return np.concatenate([raw[source.column].to_numpy(dtype=np.float64) for raw in raws])

    units = {
        name: by_range(values(name, source), name)
        for name, source in sources.items()
        if source.unit is None and not name.endswith("_qc")
    }
    # Depths below zero are heights, whatever the header says.
    depth = sources.get("depth")
    if depth is not None and depth.unit and depth.guessed and not depth.unit.startswith("-"):
        depths = values("depth", depth)
        if np.isfinite(depths).any() and by_range(depths, "depth").startswith("-"):
            units["depth"] = f"-{depth.unit}"
    # A roll of a degree is as small as one in radians; an instrument writes its angles alike.
    angles = [name for name in ("pitch", "roll", "heading", "battery_roll") if name in sources]
    if any(spelling(sources[name].unit or units[name]) == "deg" for name in angles):
        units |= dict.fromkeys((name for name in angles if name in units), "deg")
    # Near the equator or Greenwich one of the two is small enough for either; a receiver writes both alike.
    position = {name for name in ("latitude", "longitude") if name in units}
    if any(units[name] == "ddmm" for name in position):
        units |= dict.fromkeys(position, "ddmm")
    return units


def _read_file(path: Path, table: Table, findings: list[Finding]) -> list[_Part]:
    """Return the tables of one file as they stand, none (and a finding) if there is none of any use."""
    from pipeline.ingest.logs import UnreadableError

    try:
        parts = [part for sheet in sheets(path) if (part := _read_sheet(sheet, table, findings))]
    except UnreadableError as error:
        findings.append(Finding("error", path.name, "", error.found, error.expected, error.remedy))
        return []
    if is_netcdf(path):
        written = "what the program that wrote it interpolated cannot be told from what was measured"
        findings.append(Finding("note", path.name, "", "netCDF", "the logs themselves", written))
    return _fixes_first(parts, findings)


def _fixes_first(parts: list[_Part], findings: list[Finding]) -> list[_Part]:
    """Return the tables of one file, those beside the fixes of a receiver without positions: they are interpolated.

    Where mission.yaml names a position, or the receiver has none, nothing changes.
    """
    fixes = [
        part
        for part in parts
        if any(of_receiver(str(name)) == "latitude" and part.raw[name].notna().any() for name in part.raw)
    ]
    if not fixes or len(parts) == len(fixes):
        return parts
    out = []
    for part in parts:
        guessed = {
            name: entry
            for name, entry in part.candidates.items()
            if name.removesuffix("_qc") in ("latitude", "longitude") and name not in part.table.columns
        }
        if part in fixes or not guessed:
            out.append(part)
            continue
        names = ", ".join(source.column for entry in guessed.values() for source in entry)
        found = f"positions beside the fixes of the receiver: {names}"
        findings.append(Finding("note", part.file, "", found, "", "not read; the fixes are"))
        left = {name: entry for name, entry in part.candidates.items() if name not in guessed}
        if set(left) - {"time"}:
            out.append(replace(part, candidates=left))
    return out


def _read_sheet(sheet: Sheet, table: Table, findings: list[Finding]) -> _Part | None:
    """Return one table of a file as it stands, None (and a finding) if it is of no use."""
    name = sheet.path.name
    if sheet.others:
        table = _about(table, sheet)
    candidates, notes = match(sheet.columns, sheet.units, table, name, sheet.meanings)
    if not candidates:
        what = f"nothing that is known among the columns {listed(sheet.columns)}"
        remedy = f"file left out; if it is a log, name its columns under files: {name}: in mission.yaml"
        findings.append(Finding("warning", name, "", what, "a time and measurements", remedy))
        return None
    findings.extend(notes)
    if "time" not in candidates:
        findings.append(
            Finding(
                "error",
                name,
                "",
                f"no time among the columns {listed(sheet.columns)}",
                "a time column",
                f"file left out; name it under files: {name}: time: in mission.yaml",
            )
        )
        return None
    if len(candidates) == 1:
        findings.append(
            Finding(
                "warning",
                name,
                "",
                f"nothing but time known among the columns {listed(sheet.columns)}",
                "a measurement",
                f"file left out; name columns under files: {name}: columns: in mission.yaml",
            )
        )
        return None
    raw, notes = sheet.read(candidates)
    findings.extend(notes)
    if raw.empty and sheet.fixes:
        findings.append(Finding("note", name, "", f"no fix in {listed(sheet.columns)}"))
        return None
    if raw.empty:
        findings.append(Finding("error", name, "", "a header and no records", "records", "file left out"))
        return None
    measured = [source.column for key, entry in candidates.items() for source in entry
                if key != "time" and not key.endswith("_qc")]  # fmt: skip
    raw, notes = without_fills(raw, measured, name)
    findings.extend(notes)
    return _Part(name, table, candidates, raw)


def _about(table: Table, sheet: Sheet) -> Table:
    """Return what mission.yaml says of a file, without what is about columns of its other tables."""
    elsewhere = set(sheet.others) - set(sheet.columns)
    columns = {
        key: entry
        for key, entry in table.columns.items()
        if (entry if isinstance(entry, str) else entry.column) not in elsewhere
    }
    time = None if table.time is not None and table.time.column in elsewhere else table.time
    ignore = [name for name in table.ignore if name not in elsewhere]
    return table.model_copy(update={"columns": columns, "time": time, "ignore": ignore})

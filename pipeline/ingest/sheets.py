"""Sheets: the tables in a file, header first, values when they are asked for; text, Parquet and netCDF.

A text or Parquet file is one sheet. A netCDF file has one for each dimension on which a time stands: every instrument
its own clock, as in the files of pyglider, of ERDDAP, of dbd2netCDF, and of the OceanGliders format (OG1). The fixes of
a receiver that have a time beside that of the measurements (OG1, EGO: ``TIME_GPS``) are a sheet by themselves, and so
are the beams of a Doppler profiler (SeaExplorer: ``AD2CP_TIME``).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.findings import Finding
from pipeline.ingest.columns import Candidates
from pipeline.ingest.headers import BEAMS, PROFILER, PROFILER_CLOCK, is_profiler_clock, of_receiver, quantity
from pipeline.ingest.numerals import is_numeral
from pipeline.ingest.text import left_out, no_numbers

if TYPE_CHECKING:
    import pandas as pd

#: What tells a glider's series from a table of its dives.
_SERIES = ("pressure", "depth", "temperature", "salinity", "conductivity", "pitch")


@dataclass(frozen=True)
class Sheet:
    """A table whose header is read.

    Attributes
    ----------
    path
        The file.
    columns, units
        Its columns and their units, "" where none is stated.
    others
        Columns of the other sheets of the file.
    layout
        How a text table is laid out (`pipeline.ingest.text.Layout`); None for the other kinds.
    fixes
        Whether it is the fixes of a receiver, most rows of which are empty or repeat the one before.
    meanings
        CF's standard names of its columns, where they have one.
    """

    path: Path
    columns: list[str]
    units: list[str]
    others: list[str] = field(default_factory=list)
    layout: Any = None
    fixes: bool = False
    meanings: dict[str, str] = field(default_factory=dict)

    def read(self, candidates: Candidates) -> tuple[pd.DataFrame, list[Finding]]:
        """Return the columns of `candidates`, all but times as numbers, and what is no number."""
        frame, findings = self._read(candidates)
        if self.fixes:
            places = [source.column for name in ("latitude", "longitude") for source in candidates.get(name, ())]
            frame = frame.dropna(how="all", subset=places).drop_duplicates(ignore_index=True)
        return frame, findings

    def _read(self, candidates: Candidates) -> tuple[pd.DataFrame, list[Finding]]:
        clocks = list(dict.fromkeys(source.column for source in candidates["time"]))
        every = dict.fromkeys(source.column for entry in candidates.values() for source in entry)
        measured = [column for column in every if column not in clocks]
        if self.layout is None:
            read = _read_netcdf if is_netcdf(self.path) else _read_parquet
            return read(self.path, clocks, measured)
        from pipeline.ingest import text

        first = dict(zip(self.layout.names, self.layout.first, strict=False))
        timed = [column for column in clocks if not is_numeral(first.get(column, ""))]
        numeric = [column for column in clocks if column not in timed]
        return text.read(self.path, self.layout, numeric + measured, timed)


def is_netcdf(path: Path) -> bool:
    """Return whether `path` is netCDF by its name."""
    return path.suffix.lower() == ".nc"


def sheets(path: Path) -> list[Sheet]:
    """Return the tables in the file `path`, at least one.

    Raises
    ------
    UnreadableError
        If it holds none or cannot be read.
    InputError
        If it is netCDF and the packages that read it are not installed.
    """
    from pipeline.ingest.logs import UnreadableError

    if is_netcdf(path):
        found = _of_netcdf(path)
    elif path.suffix.lower() == ".parquet":
        found = _of_parquet(path)
    else:
        from pipeline.ingest import text

        layout = text.sniff(path)
        found = [Sheet(path, layout.names, layout.units, layout=layout)]
    if not found:
        raise UnreadableError("no table", "a header line and records", "file left out")
    return [part for sheet in found for own in _fixes_apart(sheet) for part in _profiler_apart(own)]


def _fixes_apart(sheet: Sheet) -> list[Sheet]:
    """Return `sheet`, its fixes as a sheet of their own where they have a time beside that of the measurements."""
    ours = {column: name for column in sheet.columns if (name := of_receiver(column)) is not None}
    clocked = any(quantity(column)[0] == "time" for column in sheet.columns if column not in ours)
    if not clocked or not {"time", "latitude", "longitude"} <= set(ours.values()):
        return [sheet]
    units = dict(zip(sheet.columns, sheet.units, strict=True))
    rest = [column for column in sheet.columns if column not in ours]
    parts = []
    for names, others in ((rest, [*ours]), ([*ours], rest)):
        below = [units[name] for name in names]
        part = replace(sheet, columns=names, units=below, others=[*sheet.others, *others], fixes=names != rest)
        parts.append(part)
    return parts


def _profiler_apart(sheet: Sheet) -> list[Sheet]:
    """Return `sheet`, the beams of a Doppler profiler as a sheet of their own where they have a clock of their own."""
    units = dict(zip(sheet.columns, sheet.units, strict=True))
    clock = next((column for column in sheet.columns if is_profiler_clock(column)), None)
    ours = [column for column in sheet.columns if quantity(column, units[column])[0] in PROFILER]
    if clock is None or len(ours) < len(BEAMS):
        return [sheet]
    rest = [column for column in sheet.columns if column not in (clock, *ours)]
    below = [PROFILER_CLOCK[1], *(units[name] for name in ours)]
    return [
        replace(sheet, columns=rest, units=[units[name] for name in rest], others=[*sheet.others, clock, *ours]),
        replace(sheet, columns=[clock, *ours], units=below, others=[*sheet.others, *rest], meanings={clock: "time"}),
    ]


def _of_netcdf(path: Path) -> list[Sheet]:
    from pipeline.ingest import netcdf
    from pipeline.ingest.logs import UnreadableError

    netcdf.require()
    series, meanings = netcdf.series(path)
    clocked = {key: units for key, units in series.items() if any(quantity(name)[0] == "time" for name in units)}
    if not any(quantity(name)[0] in _SERIES for units in clocked.values() for name in units):
        measured = [
            (name, dimensions)
            for dimensions, units in sorted(series.items(), key=lambda item: -len(item[0]))
            for name in units
            if quantity(name)[0] in _SERIES and (name,) != dimensions
        ]
        for name, dimensions in measured:
            if len(dimensions) > 1 or clocked:
                grid = f"on a grid of {' by '.join(dimensions)}"
                found = (
                    f"'{name}' {grid if len(dimensions) > 1 else f'along {dimensions[0]}, of which there is no time'}"
                )
                raise UnreadableError(found, "series along a time", "file left out; give the logs that it was made of")
    clocked = clocked or {key: units for key, units in series.items() if len(key) == 1}
    out = []
    for dimensions, units in clocked.items():
        others = [name for other, names in series.items() if other != dimensions for name in names]
        out.append(Sheet(path, list(units), list(units.values()), others, meanings=meanings))
    return out


def _read_netcdf(path: Path, clocks: list[str], measured: list[str]) -> tuple[pd.DataFrame, list[Finding]]:
    import pandas as pd

    from pipeline.ingest import netcdf
    from pipeline.ingest.logs import UnreadableError

    wanted = clocks + measured
    try:
        found = netcdf.variables(path, re.compile("|".join(map(re.escape, wanted))))
    except UnreadableError as error:
        return pd.DataFrame(columns=wanted), [left_out(path, error.found)]
    return _numeric(path, pd.DataFrame({name: _plain(found[name]) for name in wanted}), clocks, measured)


def _plain(values: Any) -> Any:
    """Return an array in the byte order of the machine, as one row of values, and bytes as text."""
    if values.dtype.kind == "S":
        return values.astype("U").ravel()
    return values.astype(values.dtype.newbyteorder("=")).ravel()


def _of_parquet(path: Path) -> list[Sheet]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        schema = pq.read_schema(path)
    except (pa.ArrowInvalid, OSError):
        return []
    metas = [column.metadata or {} for column in schema]
    units = [(meta.get(b"unit") or meta.get(b"units") or b"").decode() for meta in metas]
    return [Sheet(path, list(schema.names), units)]


def _read_parquet(path: Path, clocks: list[str], measured: list[str]) -> tuple[pd.DataFrame, list[Finding]]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    from pipeline.ingest.logs import UnreadableError

    wanted = clocks + measured
    try:
        frame = pq.read_table(path, columns=wanted).to_pandas().reset_index()
    except (pa.ArrowInvalid, OSError) as error:
        raise UnreadableError(f"a damaged file ({error})", "Parquet", "file left out; copy it again") from error
    return _numeric(path, frame[wanted], clocks, measured)


def _numeric(
    path: Path, frame: pd.DataFrame, clocks: list[str], measured: list[str]
) -> tuple[pd.DataFrame, list[Finding]]:
    """Return `frame` with its measurements, and times that are whole numbers, as float64, and what is no number."""
    import pandas as pd

    findings = []
    changed: dict[str, Any] = {}
    for name in measured:
        if frame[name].dtype.kind not in "fiub":
            changed[name] = pd.to_numeric(frame[name], errors="coerce")
            wrong = changed[name].isna() & frame[name].notna()
            if wrong.any():
                findings.append(no_numbers(path, name, frame[name], wrong))
    for clock in clocks:
        if frame[clock].dtype.kind in "iu":
            changed[clock] = frame[clock].astype("float64")
    return frame.assign(**changed), findings

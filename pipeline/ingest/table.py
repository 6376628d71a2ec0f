"""Plain tables: CSV, text and Parquet files, one instrument clock each.

Columns, units and time zone come from ``files:`` in mission.yaml; what is left out there is guessed from the header
and the range of the values, and every guess is a finding.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.findings import Finding, InputError, nearest
from pipeline.ingest.headers import quantity
from pipeline.ingest.units import QUANTITIES, by_range, convert, known
from pipeline.mission import Mission, Table, TableColumn

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import pandas as pd

    from pipeline.ingest.logs import Logs

    Array = npt.NDArray[np.float64]

SUFFIXES = (".csv", ".txt", ".tsv", ".parquet", ".csv.gz", ".txt.gz", ".tsv.gz")
TRUTH = "truth.parquet"

#: Two names of one quantity in one file: the first is read, the second only compared with it.
_TWINS = {"depth": "pressure", "salinity": "conductivity"}


@dataclass(frozen=True)
class _Source:
    """Where a canonical column comes from: its column in the file, the unit, and whether either was guessed."""

    column: str
    unit: str | None
    guessed: bool


def recognises(path: Path) -> bool:
    """Return whether `path` is a plain table by its name."""
    name = path.name.lower()
    return name.endswith(SUFFIXES) and name != TRUTH and not name.startswith(("readme", "license", "."))


def files(folder: Path) -> list[Path]:
    """Return the plain tables in `folder`, by name."""
    return sorted(path for path in folder.iterdir() if path.is_file() and recognises(path))


def read(mission: Mission) -> Logs:
    """Return the logs of a mission kept in plain tables.

    Files with the same columns that follow each other in time are one instrument. A file that is no table, or has no
    time, or holds nothing that the records know, is left out with a finding.

    Raises
    ------
    InputError
        If mission.yaml names a file, a column or a unit that is not there.
    """
    from pipeline.ingest.logs import Logs
    from pipeline.ingest.seawater import pressure_and_conductivity

    findings: list[Finding] = []
    streams: list[pd.DataFrame] = []
    if (mission.folder / TRUTH).is_file():
        findings.append(Finding("note", TRUTH, "", "the truth of a simulation", remedy="not read: it is not a log"))
    paths = {path.name: path for path in files(mission.folder)}
    for name in mission.files:
        path = mission.folder / name
        if not path.is_file():
            raise InputError(
                "mission.yaml",
                f"files.{name}",
                found="no such file",
                expected="a file in the mission's folder",
                remedy=nearest(name, sorted(entry.name for entry in mission.folder.iterdir() if entry.is_file())),
            )
        paths[name] = path
    for name, path in sorted(paths.items()):
        frame = _read_file(path, mission.files.get(name, Table()), findings)
        if frame is not None:
            streams.append(frame)
    streams, doubts = pressure_and_conductivity(mission, _join(streams))
    return Logs(streams, findings + doubts)


def _read_file(path: Path, table: Table, findings: list[Finding]) -> pd.DataFrame | None:
    """Return one file as a stream in the records' units, None (and a finding) if it is not a table of any use."""
    opened = _open(path)
    if opened is None:
        findings.append(Finding("error", path.name, "", "no table", "a header line and records", "file left out"))
        return None
    columns, units = opened.columns, opened.units
    sources, notes = _match(columns, units, table, path.name)
    findings.extend(notes)
    if "time" not in sources:
        findings.append(
            Finding(
                "error",
                path.name,
                "",
                f"no time among the columns {_some(columns)}",
                "a time column",
                f"file left out; name it under files: {path.name}: time: in mission.yaml",
            )
        )
        return None
    if len(sources) == 1:
        findings.append(
            Finding(
                "warning",
                path.name,
                "",
                f"nothing but time known among the columns {_some(columns)}",
                "a measurement",
                f"file left out; name columns under files: {path.name}: columns: in mission.yaml",
            )
        )
        return None
    raw, trouble = opened.read(sources)
    findings.extend(
        Finding("warning", path.name, "", what, "one number or time in each field", "those were left out")
        for what in trouble
    )
    if raw.empty:
        findings.append(Finding("error", path.name, "", "a header and no records", "records", "file left out"))
        return None
    return _converted(raw, sources, table, path.name, findings)


def _match(columns: list[str], units: list[str], table: Table, file: str) -> tuple[dict[str, _Source], list[Finding]]:
    """Return which column of the file is which canonical one: as mission.yaml says, else as the header suggests."""
    sources: dict[str, _Source] = {}
    notes: list[Finding] = []
    named = {name: entry if isinstance(entry, TableColumn) else TableColumn(column=entry)
             for name, entry in table.columns.items()}  # fmt: skip
    if table.time is not None:
        named["time"] = table.time
    for key, entry in named.items():
        place = f"files.{file}.time" if key == "time" else f"files.{file}.columns.{key}"
        if key != "time" and key.removesuffix("_qc") not in QUANTITIES:
            raise InputError("mission.yaml", place, found="an unknown quantity", remedy=nearest(key, list(QUANTITIES)))
        if entry.column not in columns:
            raise InputError(
                file,
                f"column '{entry.column}'",
                found=f"no such column among {_some(columns)}",
                expected=f"the column that mission.yaml names for {key}",
                remedy=nearest(entry.column, columns),
            )
        stated = units[columns.index(entry.column)] or quantity(entry.column)[1]
        sources[key] = _Source(entry.column, entry.unit or stated, entry.unit is None)
    taken = {source.column for source in sources.values()} | set(table.ignore)
    left = []
    twins = {twin for pair in _TWINS.items() for twin, other in (pair, pair[::-1]) if other in named}
    for column, below in zip(columns, units, strict=True):
        if column in taken:
            continue
        name, suggested = quantity(column)
        unit = below or suggested
        if name is None or name in sources or name in twins:
            left.append(column)
        elif unit and name in QUANTITIES and not known(name, unit):
            notes.append(
                Finding(
                    "warning",
                    file,
                    f"column '{column}'",
                    f"unit '{unit}' for {name}",
                    f"a unit of {QUANTITIES[name].name}",
                    f"column left out; {nearest(unit, list(QUANTITIES[name].units))}",
                )
            )
        else:
            sources[name] = _Source(column, unit, True)
    if left:
        notes.append(Finding("note", file, "", f"columns that are not read: {', '.join(left)}"))
    orphans = {key for key in sources if key.endswith("_qc") and key.removesuffix("_qc") not in sources}
    return {key: source for key, source in sources.items() if key not in orphans}, notes


def _converted(
    raw: pd.DataFrame, sources: dict[str, _Source], table: Table, file: str, findings: list[Finding]
) -> pd.DataFrame:
    """Return the columns of one file in the records' units under their canonical names."""
    import numpy as np
    import pandas as pd

    out: dict[str, Any] = {"time": _seconds(raw[sources["time"].column], sources["time"].unit, table, file)}
    guesses = [f"'{sources['time'].column}' is time"] if sources["time"].guessed else []
    for name, source in sources.items():
        if name == "time":
            continue
        values = raw[source.column].to_numpy(dtype=np.float64)
        if name.endswith("_qc"):
            out[name] = np.nan_to_num(values, nan=9.0).astype(np.int8)
            continue
        unit = source.unit or by_range(values, name)
        out[name] = convert(values, name, unit, file, source.column)
        if source.guessed:
            guesses.append(f"'{source.column}' is {name} in {unit}")
    if guesses:
        findings.append(Finding("note", file, "", "guessed from header and range: " + ", ".join(guesses)))
    frame = pd.DataFrame(out)
    frame.attrs = {
        "name": file,
        "columns": {name: source.column for name, source in sources.items()},
        "units": {name: source.unit or "" for name, source in sources.items()},
    }
    return frame


def _seconds(column: pd.Series[Any], unit: str | None, table: Table, file: str) -> Array:
    import numpy as np
    import pandas as pd

    from pipeline.ingest import times

    name = str(column.name)
    if isinstance(column.dtype, pd.DatetimeTZDtype) or column.dtype.kind == "M":
        moments = pd.DatetimeIndex(column)
        if moments.tz is None:
            moments = moments.tz_localize(table.timezone, ambiguous="NaT", nonexistent="NaT")
        stamps = moments.tz_convert("UTC").as_unit("ns")
        return np.where(stamps.isna(), np.nan, stamps.asi8 * 1e-9)
    numbers = column if column.dtype.kind == "f" else pd.to_numeric(column, errors="coerce")
    if column.dtype.kind == "f" or numbers.notna().sum() > 0.5 * max(1, column.notna().sum()):
        stated = unit if unit in times.UNITS or (unit and table.time and table.time.unit == unit) else None
        return times.numeric(numbers.to_numpy(dtype=np.float64), stated, file, name)
    return times.textual(column.astype("object"), unit, table.timezone, file, name)


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


def _some(columns: list[str]) -> str:
    listed = [f"'{column}'" for column in columns[:8]]
    return ", ".join(listed) + (f" and {len(columns) - 8} more" if len(columns) > 8 else "")


@dataclass(frozen=True)
class _Opened:
    """A table whose header is read: its columns and their units ("" unknown), and how to read the rest."""

    path: Path
    columns: list[str]
    units: list[str]
    layout: Any

    def read(self, sources: dict[str, _Source]) -> tuple[pd.DataFrame, list[str]]:
        """Return the columns of `sources` and what could not be read of them."""
        if self.layout is None:
            return _read_parquet(self.path, sources)
        from pipeline.ingest import text

        clock = sources["time"].column
        first = self.layout.first[self.columns.index(clock)] if len(self.layout.first) == len(self.columns) else ""
        timed = [] if _is_number(first) else [clock]
        numeric = list(dict.fromkeys(s.column for s in sources.values() if s.column not in timed))
        return text.read(self.path, self.layout, numeric, timed)


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


def _read_parquet(path: Path, sources: dict[str, _Source]) -> tuple[pd.DataFrame, list[str]]:
    import pandas as pd
    import pyarrow as pa
    import pyarrow.parquet as pq

    clock = sources["time"].column
    wanted = list(dict.fromkeys(source.column for source in sources.values()))
    try:
        frame = pq.read_table(path, columns=wanted).to_pandas().reset_index()
    except (pa.ArrowInvalid, OSError) as error:
        return pd.DataFrame(columns=wanted), [f"an unreadable file ({error})"]
    trouble = []
    for name in wanted:
        if name != clock and frame[name].dtype.kind not in "fiub":
            numbers = pd.to_numeric(frame[name], errors="coerce")
            wrong = numbers.isna() & frame[name].notna()
            if wrong.any():
                trouble.append(
                    f"{int(wrong.sum())} fields of column '{name}' that are no numbers, "
                    f"first '{frame[name][wrong].iloc[0]}'"
                )
            frame[name] = numbers
    if clock in frame and frame[clock].dtype.kind in "iu":
        frame[clock] = frame[clock].astype("float64")
    return frame[wanted], trouble


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True

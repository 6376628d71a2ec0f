"""Columns of a plain table: which is which, in what unit, and the guesses where mission.yaml does not say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pipeline.findings import Finding, InputError, nearest
from pipeline.ingest.headers import quantity
from pipeline.ingest.text import UNNAMED
from pipeline.ingest.units import QUANTITIES, convert, known
from pipeline.mission import Table, TableColumn

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import pandas as pd

    Array = npt.NDArray[np.float64]

#: Two names of one quantity: where mission.yaml names one of them in a file, the other is not guessed there.
_TWINS = {"depth": "pressure", "salinity": "conductivity"}


@dataclass(frozen=True)
class Source:
    """Where a canonical column comes from: its column in the file, its unit (None: not stated), whether guessed."""

    column: str
    unit: str | None
    guessed: bool


def match(columns: list[str], units: list[str], table: Table, file: str) -> tuple[dict[str, Source], list[Finding]]:
    """Return which column of the file is which canonical one: as mission.yaml says, else as the header suggests."""
    sources: dict[str, Source] = {}
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
                found=f"no such column among {listed(columns)}",
                expected=f"the column that mission.yaml names for {key}",
                remedy=nearest(entry.column, columns),
            )
        stated = units[columns.index(entry.column)] or quantity(entry.column)[1]
        sources[key] = Source(entry.column, entry.unit or stated, entry.unit is None)
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
            sources[name] = Source(column, unit, True)
    left = [column for column in left if not column.startswith(UNNAMED)]
    if left:
        notes.append(Finding("note", file, "", f"columns that are not read: {', '.join(left)}"))
    orphans = {key for key in sources if key.endswith("_qc") and key.removesuffix("_qc") not in sources}
    return {key: source for key, source in sources.items() if key not in orphans}, notes


def converted(
    raw: pd.DataFrame, sources: Mapping[str, Source], table: Table, file: str, guesses: Mapping[str, str]
) -> tuple[pd.DataFrame, list[Finding]]:
    """Return the columns of one file in the records' units under their canonical names, and what was guessed.

    Parameters
    ----------
    raw
        The columns as they stand in the file.
    sources
        Which of them is which canonical one.
    table
        What mission.yaml says of the file.
    file
        Its name.
    guesses
        Units of those columns for which neither header nor mission.yaml states one.
    """
    import numpy as np
    import pandas as pd

    out: dict[str, Any] = {"time": _seconds(raw[sources["time"].column], sources["time"].unit, table, file)}
    told = [f"'{sources['time'].column}' is time"] if sources["time"].guessed else []
    for name, source in sources.items():
        if name == "time":
            continue
        values = raw[source.column].to_numpy(dtype=np.float64)
        if name.endswith("_qc"):
            out[name] = np.nan_to_num(values, nan=9.0).astype(np.int8)
            continue
        unit = source.unit or guesses[name]
        out[name] = convert(values, name, unit, file, source.column)
        if source.guessed:
            told.append(f"'{source.column}' is {name} in {unit}")
    notes = [Finding("note", file, "", "guessed from header and range: " + ", ".join(told))] if told else []
    frame = pd.DataFrame(out)
    frame.attrs = {
        "name": file,
        "columns": {name: source.column for name, source in sources.items()},
    }
    return frame, notes


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
    if column.dtype.kind != "f" and not (unit and "%" in unit):
        at_once = times.zoned(column, table.timezone, file)
        if at_once is not None:
            return at_once
    numbers = column if column.dtype.kind == "f" else pd.to_numeric(column, errors="coerce")
    if column.dtype.kind == "f" or numbers.notna().sum() > 0.5 * max(1, column.notna().sum()):
        stated = unit if unit in times.UNITS or (unit and table.time and table.time.unit == unit) else None
        return times.numeric(numbers.to_numpy(dtype=np.float64), stated, file, name)
    return times.textual(column.astype("object"), unit, table.timezone, file, name)


def listed(columns: list[str]) -> str:
    """Return the first eight of `columns` for a message."""
    quoted = [f"'{column}'" for column in columns[:8]]
    return ", ".join(quoted) + (f" and {len(columns) - 8} more" if len(columns) > 8 else "")

"""Sheets: the tables in a file, header first, values when they are asked for; text, Parquet and netCDF.

A text or Parquet file is one sheet. A netCDF file has one for each dimension on which a time stands: every instrument
its own clock, as in the files of pyglider, of ERDDAP, of dbd2netCDF, and of the OceanGliders format (OG1).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.ingest.columns import Candidates
from pipeline.ingest.headers import quantity

if TYPE_CHECKING:
    import pandas as pd


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
    """

    path: Path
    columns: list[str]
    units: list[str]
    others: list[str] = field(default_factory=list)
    layout: Any = None

    def read(self, candidates: Candidates) -> tuple[pd.DataFrame, list[str]]:
        """Return the columns of `candidates`, all but times as numbers, and what is no number."""
        clocks = list(dict.fromkeys(source.column for source in candidates["time"]))
        every = dict.fromkeys(source.column for entry in candidates.values() for source in entry)
        measured = [column for column in every if column not in clocks]
        if self.layout is None:
            read = _read_netcdf if is_netcdf(self.path) else _read_parquet
            return read(self.path, clocks, measured)
        from pipeline.ingest import text

        first = dict(zip(self.columns, self.layout.first, strict=False))
        timed = [column for column in clocks if not text.is_number(first.get(column, ""))]
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
        found = [] if layout is None else [Sheet(path, layout.names, layout.units, layout=layout)]
    if not found:
        raise UnreadableError("no table", "a header line and records", "file left out")
    return found


def _of_netcdf(path: Path) -> list[Sheet]:
    from pipeline.ingest import netcdf

    netcdf.require()
    series = netcdf.series(path)
    clocked = {
        dimension: units for dimension, units in series.items() if any(quantity(name)[0] == "time" for name in units)
    }
    out = []
    for dimension, units in (clocked or series).items():
        others = [name for other, names in series.items() if other != dimension for name in names]
        out.append(Sheet(path, list(units), list(units.values()), others))
    return out


def _read_netcdf(path: Path, clocks: list[str], measured: list[str]) -> tuple[pd.DataFrame, list[str]]:
    import pandas as pd

    from pipeline.ingest import netcdf
    from pipeline.ingest.logs import UnreadableError

    wanted = clocks + measured
    try:
        found = netcdf.variables(path, re.compile("|".join(map(re.escape, wanted))))
    except UnreadableError as error:
        return pd.DataFrame(columns=wanted), [error.found]
    return _numeric(pd.DataFrame({name: _plain(found[name]) for name in wanted}), clocks, measured)


def _plain(values: Any) -> Any:
    """Return an array in the byte order of the machine, and bytes as text."""
    if values.dtype.kind == "S":
        return values.astype("U")
    return values.astype(values.dtype.newbyteorder("="))


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


def _read_parquet(path: Path, clocks: list[str], measured: list[str]) -> tuple[pd.DataFrame, list[str]]:
    import pandas as pd
    import pyarrow as pa
    import pyarrow.parquet as pq

    wanted = clocks + measured
    try:
        frame = pq.read_table(path, columns=wanted).to_pandas().reset_index()
    except (pa.ArrowInvalid, OSError) as error:
        return pd.DataFrame(columns=wanted), [f"an unreadable file ({error})"]
    return _numeric(frame[wanted], clocks, measured)


def _numeric(frame: pd.DataFrame, clocks: list[str], measured: list[str]) -> tuple[pd.DataFrame, list[str]]:
    """Return `frame` with its measurements, and times that are whole numbers, as float64, and what is no number."""
    import pandas as pd

    trouble = []
    changed: dict[str, Any] = {}
    for name in measured:
        if frame[name].dtype.kind not in "fiub":
            changed[name] = pd.to_numeric(frame[name], errors="coerce")
            wrong = changed[name].isna() & frame[name].notna()
            if wrong.any():
                first, count = frame[name][wrong].iloc[0], f"{int(wrong.sum())} of {len(frame)} fields"
                trouble.append(f"{count} of column '{name}' that are no number, first '{first}'")
    for clock in clocks:
        if frame[clock].dtype.kind in "iu":
            changed[clock] = frame[clock].astype("float64")
    return frame.assign(**changed), trouble

"""A table in a file, used like a frame: a column is read when it is asked for, and let go of when it is done with.

A long mission's tables are ten times as large as what any one figure or sentence needs of them.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, overload

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Columns of few different texts, which are read as categories.
TEXTS = ("method", "reason")


class Table:
    """A Parquet table, or the rows of it by one method, of which as much is in memory as is asked for.

    ``table[name]`` is a column, ``table[[name, …]]`` a frame of some columns and ``table[mask]`` one of some rows, as
    with a frame; rows are numbered from 0, and texts of few kinds are categories.

    Parameters
    ----------
    path
        The table.
    method
        Rows whose column ``method`` is this; all rows if left out.
    """

    def __init__(self, path: Path, method: str | None = None) -> None:
        self._path = path
        self._metadata = pq.read_metadata(path)
        self._rows: NDArray[np.bool_] = np.ones(self._metadata.num_rows, dtype=bool)
        if method is not None:
            same = pc.equal(self._read(["method"]).column(0).cast(pa.string()), method)
            self._rows = same.to_numpy().astype(bool)
        self._size = int(self._rows.sum())

    def __len__(self) -> int:
        return self._size

    @property
    def empty(self) -> bool:
        """Whether it has no rows."""
        return not self._size

    @overload
    def __getitem__(self, key: str) -> pd.Series: ...
    @overload
    def __getitem__(self, key: list[str] | NDArray[np.bool_]) -> pd.DataFrame: ...
    def __getitem__(self, key: str | list[str] | NDArray[np.bool_]) -> pd.Series | pd.DataFrame:
        if isinstance(key, str):
            return self[[key]][key]
        if isinstance(key, list):
            return _frame(self._read(key), self._rows)
        rows = self._rows.copy()
        rows[rows] = key
        ends = np.cumsum([self._metadata.row_group(k).num_rows for k in range(self._metadata.num_row_groups)])
        starts = np.concatenate([[0], ends[:-1]])
        groups = [k for k in range(ends.size) if rows[starts[k] : ends[k]].any()]
        kept = np.concatenate([rows[:0], *(rows[starts[k] : ends[k]] for k in groups)])
        return _frame(self._open().read_row_groups(groups, use_threads=False), kept)

    def _open(self) -> pq.ParquetFile:
        texts = [name for name in TEXTS if name in self._metadata.schema.names]
        return pq.ParquetFile(self._path, metadata=self._metadata, read_dictionary=texts, pre_buffer=False)

    def _read(self, names: list[str]) -> pa.Table:
        return self._open().read(columns=names, use_threads=False)


#: A table at hand, or in a file.
Columns: TypeAlias = pd.DataFrame | Table


def _frame(table: pa.Table, rows: NDArray[np.bool_]) -> pd.DataFrame:
    kept = table if rows.all() else table.filter(pa.array(rows))
    frame: pd.DataFrame = kept.unify_dictionaries().to_pandas(use_threads=False)
    return frame

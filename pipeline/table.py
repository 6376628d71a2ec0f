"""A table in a file, used like a frame: a column is read when it is asked for, and let go of when it is done with.

A long mission's tables are ten times as large as what any one figure or sentence needs of them.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, overload

import numpy as np
import pandas as pd
import pyarrow as pa
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
        self._ends = np.cumsum([self._metadata.row_group(k).num_rows for k in range(self._metadata.num_row_groups)])
        self._rows: NDArray[np.bool_] = np.ones(self._metadata.num_rows, dtype=bool)
        if method is not None:
            self._rows = (self._take(self._rows, ["method"])["method"] == method).to_numpy()
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
            return self._take(self._rows, key)
        rows = self._rows.copy()
        rows[rows] = key
        return self._take(rows)

    def _take(self, rows: NDArray[np.bool_], names: list[str] | None = None) -> pd.DataFrame:
        """Return some rows and columns, read from the parts of the file that hold any of those rows."""
        texts = [name for name in TEXTS if name in self._metadata.schema.names]
        file = pq.ParquetFile(self._path, metadata=self._metadata, read_dictionary=texts, pre_buffer=False)
        parts = [(k, rows[start:end]) for k, (start, end) in enumerate(pairwise([0, *self._ends]))]
        held = [(k, part) for k, part in parts if part.any()]
        table = file.read_row_groups([k for k, _part in held], columns=names, use_threads=False)
        kept = np.concatenate([rows[:0], *(part for _k, part in held)])
        chosen = table if kept.all() else table.filter(pa.array(kept))
        frame: pd.DataFrame = chosen.unify_dictionaries().to_pandas(use_threads=False)
        return frame


#: A table at hand, or in a file.
Columns: TypeAlias = pd.DataFrame | Table

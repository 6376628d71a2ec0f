"""A table in a file gives what the same frame in memory gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline import store
from pipeline.records import ESTIMATES, conform, of_method
from pipeline.table import Table


@pytest.fixture
def frame() -> pd.DataFrame:
    """Return estimates in parts, each with rows by both methods, as the estimator hands them on."""
    rows = np.arange(700)
    method = np.where(rows % 100 < 50, "kinematic", "force")
    reason = np.where(rows % 7 == 0, "", np.where(rows < 350, "at the surface", "manoeuvre"))
    time = pd.Timestamp("2014-03-27", tz="UTC") + pd.to_timedelta(rows, unit="s")
    speed = np.where(rows % 7 == 0, 0.01 * rows, np.nan)
    return conform(
        pd.DataFrame({"time": time, "method": method, "reason": reason, "speed": speed, "observable": rows % 7 == 0}),
        ESTIMATES,
    )


@pytest.fixture
def path(frame: pd.DataFrame, tmp_path: Path) -> Path:
    with store.table_writer(tmp_path / "estimates.parquet", ESTIMATES) as table:
        for first in range(0, len(frame), 100):
            table.write(frame.iloc[first : first + 100])
    return tmp_path / "estimates.parquet"


def assert_same(found: pd.DataFrame, expected: pd.DataFrame) -> None:
    texts = {name: str for name in ("method", "reason") if name in expected}
    pd.testing.assert_frame_equal(
        found.astype(texts), expected.astype(texts).reset_index(drop=True), check_index_type=False
    )


@pytest.mark.parametrize("method", [None, "kinematic", "force", "neither"])
def test_columns_and_rows_are_those_of_the_frame(frame: pd.DataFrame, path: Path, method: str | None) -> None:
    expected = frame if method is None else of_method(frame, method)
    table = Table(path, method)
    assert len(table) == len(expected)
    assert table.empty == (len(expected) == 0)
    for name in ("time", "reason", "speed", "observable"):
        assert_same(table[name].to_frame(), expected[[name]])
    assert_same(table[["speed", "method"]], expected[["speed", "method"]])
    for mask in (expected["observable"].to_numpy(), np.arange(len(expected)) > 310, np.zeros(len(expected), bool)):
        assert_same(table[mask], expected[mask])


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list to which the number of every part that is read is added."""
    import pyarrow.parquet as pq

    numbers: list[int] = []
    before = pq.ParquetFile.read_row_groups

    def watched(file: pq.ParquetFile, groups: list[int], **settings: bool) -> object:
        numbers.extend(groups)
        return before(file, groups, **settings)

    monkeypatch.setattr(pq.ParquetFile, "read_row_groups", watched)
    return numbers


def test_only_the_parts_that_hold_the_rows_are_read(path: Path, read: list[int]) -> None:
    table = Table(path, "kinematic")
    read.clear()
    rows = np.zeros(350, dtype=bool)
    rows[[60, 110]] = True
    assert len(table[rows]) == 2
    assert read == [1, 2]


def test_only_the_parts_that_hold_the_method_are_read(frame: pd.DataFrame, tmp_path: Path, read: list[int]) -> None:
    with store.table_writer(tmp_path / "estimates.parquet", ESTIMATES) as writer:
        for first in range(0, len(frame), 50):
            writer.write(frame.iloc[first : first + 50])
    table = Table(tmp_path / "estimates.parquet", "force")
    read.clear()
    assert len(table["speed"]) == 350
    assert read == [1, 3, 5, 7, 9, 11, 13]


def test_a_table_without_rows_is_empty(tmp_path: Path) -> None:
    store.write_table(tmp_path / "nothing.parquet", conform(pd.DataFrame(), ESTIMATES), ESTIMATES)
    for method in (None, "force"):
        table = Table(tmp_path / "nothing.parquet", method)
        assert table.empty
        assert table["speed"].to_numpy().shape == (0,)
        assert table[np.zeros(0, dtype=bool)].empty

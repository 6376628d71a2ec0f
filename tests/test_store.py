"""Files: whole or not at all, with units, the same bytes for the same content."""

from __future__ import annotations

import hashlib
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import store
from pipeline.records import STORED, timestamps


def test_a_file_appears_whole_in_a_folder_made_for_it(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "x.bin"
    store.write_bytes(path, b"one")
    store.write_bytes(path, b"two")
    assert path.read_bytes() == b"two"
    assert [entry.name for entry in path.parent.iterdir()] == ["x.bin"]
    assert path.stat().st_mode & 0o444


def test_a_write_that_fails_leaves_the_old_file_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.txt"
    store.write_text(path, "old")

    def fail(self: Path, target: Path) -> None:
        raise OSError("disk gone")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OSError, match="disk gone"):
        store.write_text(path, "new")
    monkeypatch.undo()
    store.sweep(tmp_path)
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.txt"]


def test_without_anonymous_files_the_content_is_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "O_TMPFILE", raising=False)
    store.write_text(tmp_path / "x.txt", "héllo")
    assert (tmp_path / "x.txt").read_bytes() == "héllo".encode()
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.txt"]


def test_a_writer_killed_again_and_again_leaves_the_old_file_or_the_new_one(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from pipeline import store\n"
        "path = Path(sys.argv[1])\n"
        "print('ready', flush=True)\n"
        "while True:\n"
        "    for letter in (b'a', b'b'): store.write_bytes(path, letter * 300_000)\n"
    )
    path = tmp_path / "x.bin"
    for _ in range(5):
        with subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            process.stdout.readline()
            while not path.exists() and process.poll() is None:
                pass
            process.kill()
        assert path.read_bytes() in (b"a" * 300_000, b"b" * 300_000)
    store.sweep(tmp_path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.bin"]


def test_sweep_removes_what_a_killed_run_left_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / ".x.json.0123.part").write_text("half")
    (tmp_path / "deep" / "x.part").write_text("a user's own")
    store.sweep(tmp_path)
    store.sweep(tmp_path / "not there")
    assert [entry.name for entry in (tmp_path / "deep").iterdir()] == ["x.part"]


def test_json_has_null_for_what_is_no_number_and_plain_types_for_numpy(tmp_path: Path) -> None:
    content = {
        "nan": math.nan,
        "inf": np.float64(np.inf),
        "array": np.array([1.0, np.nan]),
        "whole": np.int32(3),
        "truth": np.bool_(True),
        "when": pd.Timestamp("2016-06-22", tz="UTC"),
        "nested": [{"a": (1, 2)}],
        5: "key",
    }
    store.write_json(tmp_path / "x.json", content)
    assert store.read_json(tmp_path / "x.json") == {
        "nan": None,
        "inf": None,
        "array": [1.0, None],
        "whole": 3,
        "truth": True,
        "when": "2016-06-22T00:00:00+00:00",
        "nested": [{"a": [1, 2]}],
        "5": "key",
    }


@given(st.recursive(st.floats() | st.text() | st.none(), lambda x: st.lists(x) | st.dictionaries(st.text(), x)))
def test_whatever_is_written_is_json_by_the_standard(content: object) -> None:
    json.loads(json.dumps(store.plain(content), allow_nan=False))


def _stored() -> pd.DataFrame:
    return pd.DataFrame({"time": timestamps(np.array([1.5e9, 1.5e9 + 1.25])), "speed": [0.3, np.nan]})


def test_a_table_comes_back_with_its_values_units_and_metadata(tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    path = tmp_path / "stored.parquet"
    store.write_table(path, _stored(), STORED, {"mission": "trial"})
    found = store.read_table(path)
    assert list(found.columns) == ["time", "speed", "vertical_speed"]
    pd.testing.assert_series_equal(found["time"], pd.Series(_stored()["time"]))
    np.testing.assert_array_equal(found["speed"], [0.3, np.nan])
    assert str(found["time"].dtype) == "datetime64[ns, UTC]"
    assert pq.read_schema(path).field("speed").metadata[b"unit"] == b"m/s"
    assert store.read_metadata(path) == {"mission": "trial"}


def test_the_same_table_is_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        store.write_table(tmp_path / name, _stored(), STORED)
    assert store.digest(tmp_path / "a") == store.digest(tmp_path / "b")


@given(st.binary(max_size=2000))
def test_the_digest_is_blake2b_of_the_bytes(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.mktemp("digest") / "x"
    path.write_bytes(content)
    assert store.digest(path) == hashlib.blake2b(content, digest_size=16).hexdigest()


def test_the_digest_of_a_text_is_that_of_the_file_that_holds_it(tmp_path: Path) -> None:
    store.write_text(tmp_path / "x", "ż = −V sin γ − w")
    assert store.digest_text("ż = −V sin γ − w") == store.digest(tmp_path / "x")


def _numbered(rows: int) -> pd.DataFrame:
    """Return a table of rows a second apart, each of which holds its number."""
    return pd.DataFrame({"time": timestamps(1.5e9 + np.arange(float(rows))), "speed": np.arange(float(rows))})


@given(first=st.integers(0, 70), length=st.integers(0, 70))
def test_any_rows_of_a_table_can_be_read_alone(
    tmp_path_factory: pytest.TempPathFactory, first: int, length: int
) -> None:
    path, table = tmp_path_factory.getbasetemp() / "rows.parquet", _numbered(70)
    if not path.exists():
        with store.table_writer(path, STORED) as writer:
            for begin in range(0, 70, 30):
                writer.write(table.iloc[begin : begin + 30])
    with store.table_reader(path) as reader:
        assert reader.rows == 70
        part = reader.read(first, first + length, ["speed"])
    assert list(part.columns) == ["speed"]
    assert part["speed"].tolist() == table["speed"].tolist()[first : first + length]
    assert part.index.tolist() == list(range(len(part)))


def test_a_table_written_in_parts_is_the_table_written_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "GROUP", 20)
    table = _numbered(70)
    store.write_table(tmp_path / "whole", table, STORED, {"mission": "trial"})
    with store.table_writer(tmp_path / "parts", STORED, {"mission": "trial"}) as writer:
        for begin in range(0, 70, 20):
            writer.write(table.iloc[begin : begin + 20])
    pd.testing.assert_frame_equal(store.read_table(tmp_path / "whole"), store.read_table(tmp_path / "parts"))
    assert store.read_metadata(tmp_path / "parts") == {"mission": "trial"}
    assert store.digest(tmp_path / "whole") == store.digest(tmp_path / "parts")


@pytest.mark.parametrize("anonymous", [True, False])
def test_a_table_whose_parts_fail_leaves_the_old_one_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, anonymous: bool
) -> None:
    if not anonymous:
        monkeypatch.delattr(os, "O_TMPFILE", raising=False)
    path = tmp_path / "x.parquet"
    store.write_table(path, _numbered(3), STORED)

    def parts() -> Iterator[pd.DataFrame]:
        yield _numbered(5)
        raise RuntimeError("in the second part")

    def write() -> None:
        with store.table_writer(path, STORED) as writer:
            for part in parts():
                writer.write(part)

    with pytest.raises(RuntimeError, match="in the second part"):
        write()
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.parquet"]
    assert len(store.read_table(path)) == 3


def test_a_table_being_written_is_not_there_yet(tmp_path: Path) -> None:
    path = tmp_path / "x.parquet"
    with store.table_writer(path, STORED) as writer:
        writer.write(_numbered(5))
        assert list(tmp_path.iterdir()) == []
    assert len(store.read_table(path)) == 5


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(json_values)
def test_json_comes_back_as_it_was_written(content: object) -> None:
    with tempfile.TemporaryDirectory() as folder:
        store.write_json(Path(folder) / "x.json", content)
        assert store.read_json(Path(folder) / "x.json") == content


def test_a_list_of_numbers_has_one_line_and_every_key_its_own(tmp_path: Path) -> None:
    content = {"speed": np.array([0.5, np.nan]), "dives": [{"dive": 1}, {"dive": 2}], "none": []}
    store.write_json(tmp_path / "x.json", content)
    expected = """{
 "speed": [0.5, null],
 "dives": [
  {
   "dive": 1
  },
  {
   "dive": 2
  }
 ],
 "none": []
}
"""
    assert (tmp_path / "x.json").read_text() == expected


def test_a_file_that_has_not_changed_is_digested_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "log.csv"
    file.write_text("time,pressure\n")
    before = store.digest(file)
    with monkeypatch.context() as patch:
        patch.setattr(hashlib, "file_digest", lambda *_: pytest.fail("read again"))
        assert store.digest(file) == before
    store.write_text(file, "time,pressurf\n")
    assert store.digest(file) != before == hashlib.blake2b(b"time,pressure\n", digest_size=16).hexdigest()


def test_a_digest_from_another_process_is_trusted_until_the_file_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "estimates.parquet"
    file.write_bytes(b"one")
    elsewhere = dict.fromkeys(store.digested([file]), "told")
    monkeypatch.setattr(store, "_DIGESTS", {})
    store.trust(elsewhere)
    assert store.digest(file) == "told"
    file.write_bytes(b"another")
    assert store.digest(file) == hashlib.blake2b(b"another", digest_size=16).hexdigest()

"""Files between the stages: Parquet with units, JSON, written whole or not at all.

A file appears under its name only when its last byte is written: the data go into an anonymous file of the
same file system (Linux ``O_TMPFILE``) that is linked and renamed into place, so that a process killed at any
moment leaves neither half a file nor a leftover. Where the system has no anonymous files a hidden temporary
name is used instead and removed by the next run. Nothing heavy is imported until a table is read or written, so
that a run that finds nothing to do ends at once.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.records import Column

PART = ".part"
#: Rows that are compressed together, so that a part of a table can be read without the rest.
GROUP = 20_000

#: A file as it was when it was read: its path, and what changes with it.
FileState = tuple[Path, int, int, int, int]
_DIGESTS: dict[FileState, str] = {}


@contextmanager
def whole(path: Path) -> Iterator[IO[bytes]]:
    """Give a file to write to, and to read back, that becomes `path` when all is written, and nothing if that fails.

    Its folder is made.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.parent / f".{path.name}.{uuid.uuid4().hex}{PART}"
    try:
        descriptor = os.open(path.parent, os.O_TMPFILE | os.O_RDWR, 0o644)
    except (AttributeError, OSError):
        try:
            with temporary.open("w+b") as file:
                yield file
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    else:
        with os.fdopen(descriptor, "w+b") as file:
            yield file
            file.flush()
            # A source descriptor makes Python call linkat(AT_SYMLINK_FOLLOW), which /proc needs.
            os.link(f"/proc/self/fd/{descriptor}", temporary, src_dir_fd=descriptor)
    temporary.replace(path)


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to `path` atomically, creating its folder."""
    with whole(path) as file:
        file.write(data)


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path` as UTF-8, atomically."""
    write_bytes(path, text.encode())


def write_json(path: Path, content: Any) -> None:
    """Write `content` to `path` as JSON, atomically; NaN and infinities become null.

    Every key and every item has its line, but a list of numbers or texts has one for all.
    """
    write_text(path, _laid_out(plain(content), "\n") + "\n")


def _laid_out(value: Any, line: str) -> str:
    """Return a value of JSON's own types as text; `line` is the end of a line and what the next one begins with."""
    inner = line + " "
    if isinstance(value, dict) and value:
        items = [f"{json.dumps(key, ensure_ascii=False)}: {_laid_out(item, inner)}" for key, item in value.items()]
        return f"{{{inner}{f',{inner}'.join(items)}{line}}}"
    if isinstance(value, list) and any(isinstance(item, dict | list) for item in value):
        return f"[{inner}{f',{inner}'.join(_laid_out(item, inner) for item in value)}{line}]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def plain(value: Any) -> Any:
    """Return `value` in JSON's own types: numpy scalars and arrays unpacked, not-finite numbers as None."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        kinds = set(map(type, value))
        if kinds == {float}:
            return [item if math.isfinite(item) else None for item in value]
        return list(value) if kinds <= {str, int, bool} else [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if hasattr(value, "isoformat"):
        return value.isoformat()
    return value


def read_json(path: Path) -> Any:
    """Return the content of the JSON file `path`."""
    return json.loads(path.read_text(encoding="utf-8"))


def write_table(
    path: Path, frame: pd.DataFrame, columns: tuple[Column, ...], metadata: dict[str, str] | None = None
) -> None:
    """Write `frame` as Parquet with the unit and meaning of every column in its field metadata, atomically."""
    with table_writer(path, columns, metadata) as table:
        table.write(frame)


class TableWriter:
    """Writes a Parquet table part by part, with the unit and meaning of every column in its field metadata.

    Parameters
    ----------
    file
        Where its bytes go.
    columns
        The canonical table.
    metadata
        What else is to be kept with it.
    """

    def __init__(self, file: IO[bytes], columns: tuple[Column, ...], metadata: dict[str, str]) -> None:
        import pandas as pd
        import pyarrow as pa
        import pyarrow.parquet as pq

        from pipeline.records import conform

        self._columns = columns
        plain = pa.Schema.from_pandas(conform(pd.DataFrame(), columns), preserve_index=False)
        fields = [
            plain.field(column.name).with_metadata({"unit": column.unit, "meaning": column.meaning})
            for column in columns
        ]
        self._schema = pa.schema(fields, metadata={**(plain.metadata or {}), **metadata})
        few = [column.name for column in columns if not column.dtype.startswith(("float", "datetime"))]
        many = [column.name for column in columns if column.dtype.startswith("float")]
        self._writer = pq.ParquetWriter(
            file, self._schema, compression="zstd", use_dictionary=few, use_byte_stream_split=many
        )

    def write(self, frame: pd.DataFrame) -> None:
        """Append the rows of `frame`; those of one call are never compressed together with those of the next."""
        import pyarrow as pa

        from pipeline.records import conform

        table = pa.Table.from_pandas(conform(frame, self._columns), preserve_index=False, nthreads=1)
        self._writer.write_table(table.cast(self._schema), row_group_size=GROUP)

    def close(self) -> None:
        """Write the end of the file."""
        self._writer.close()


@contextmanager
def table_writer(
    path: Path, columns: tuple[Column, ...], metadata: dict[str, str] | None = None
) -> Iterator[TableWriter]:
    """Give a writer for the Parquet table `path`, which appears when all parts are written and not before."""
    with whole(path) as file:
        writer = TableWriter(file, columns, metadata or {})
        try:
            yield writer
        finally:
            writer.close()


def read_table(path: Path) -> pd.DataFrame:
    """Return the Parquet table `path` as a frame."""
    import pyarrow.parquet as pq

    frame: pd.DataFrame = pq.read_table(path).to_pandas()
    return frame


class TableReader:
    """Reads parts of a Parquet table, in memory that does not grow with the table.

    Parameters
    ----------
    path
        The table.

    Attributes
    ----------
    rows
        How many rows it has.
    """

    def __init__(self, path: Path) -> None:
        import pyarrow.parquet as pq

        self._file = pq.ParquetFile(path, pre_buffer=False)
        metadata = self._file.metadata
        self.rows: int = metadata.num_rows
        self._ends: list[int] = []
        for group in range(metadata.num_row_groups):
            self._ends.append((self._ends[-1] if self._ends else 0) + metadata.row_group(group).num_rows)

    def read(self, first: int = 0, last: int | None = None, columns: Sequence[str] | None = None) -> pd.DataFrame:
        """Return rows `first` up to and without `last` as a frame numbered from 0, all columns or only some.

        Parameters
        ----------
        first, last
            From 0 to the number of rows; `last` is that number if left out.
        columns
            Names, in the order wanted.
        """
        last = self.rows if last is None else last
        starts = [0, *self._ends[:-1]]
        groups = [k for k, end in enumerate(self._ends) if end > first and starts[k] < last]
        table = self._file.read_row_groups(groups, columns=columns, use_threads=False)
        begin = starts[groups[0]] if groups else 0
        frame: pd.DataFrame = table.slice(first - begin, last - first).to_pandas(use_threads=False)
        return frame

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()


@contextmanager
def table_reader(path: Path) -> Iterator[TableReader]:
    """Give a reader of the Parquet table `path`."""
    reader = TableReader(path)
    try:
        yield reader
    finally:
        reader.close()


def read_metadata(path: Path) -> dict[str, str]:
    """Return the metadata that `write_table` was given for `path`."""
    import pyarrow.parquet as pq

    raw = pq.read_schema(path).metadata or {}
    return {key.decode(): value.decode() for key, value in raw.items() if key not in (b"pandas", b"ARROW:schema")}


def digest(path: Path) -> str:
    """Return the BLAKE2b digest of the file `path`, 32 hexadecimal digits; a file that has not changed is read once."""
    state = _state(path)
    if state not in _DIGESTS:
        with path.open("rb") as file:
            _DIGESTS[state] = hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
    return _DIGESTS[state]


def digested(paths: Iterable[Path]) -> dict[FileState, str]:
    """Return the digests of `paths` with the states in which the files were read, for `trust` in another process."""
    return {_state(path): digest(path) for path in paths}


def trust(digests: Mapping[FileState, str]) -> None:
    """Take it from another process what the digests of files are that it has read: as long as they do not change."""
    _DIGESTS.update(digests)


def _state(path: Path) -> FileState:
    found = path.stat()
    return path.absolute(), found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns


def digest_text(text: str) -> str:
    """Return the BLAKE2b digest of `text`, 32 hexadecimal digits."""
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def sweep(folder: Path) -> None:
    """Remove what a killed run may have left in `folder` on systems without anonymous files."""
    if folder.is_dir():
        for leftover in folder.rglob(f".*{PART}"):
            with contextlib.suppress(OSError):
                leftover.unlink()

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
import io
import json
import math
import os
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.records import Column

PART = ".part"


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to `path` atomically, creating its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.parent / f".{path.name}.{uuid.uuid4().hex}{PART}"
    try:
        descriptor = os.open(path.parent, os.O_TMPFILE | os.O_WRONLY, 0o644)
    except (AttributeError, OSError):
        temporary.write_bytes(data)
    else:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            # A source descriptor makes Python call linkat(AT_SYMLINK_FOLLOW), which /proc needs.
            os.link(f"/proc/self/fd/{descriptor}", temporary, src_dir_fd=descriptor)
    temporary.replace(path)


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path` as UTF-8, atomically."""
    write_bytes(path, text.encode())


def write_json(path: Path, content: Any) -> None:
    """Write `content` to `path` as JSON, atomically; NaN and infinities become null."""
    write_text(path, json.dumps(plain(content), indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """Return `value` in JSON's own types: numpy scalars and arrays unpacked, not-finite numbers as None."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
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
    import pyarrow as pa
    import pyarrow.parquet as pq

    from pipeline.records import conform

    table = pa.Table.from_pandas(conform(frame, columns), preserve_index=False)
    fields = [
        table.schema.field(column.name).with_metadata({"unit": column.unit, "meaning": column.meaning})
        for column in columns
    ]
    schema = pa.schema(fields, metadata={**(table.schema.metadata or {}), **(metadata or {})})
    buffer = io.BytesIO()
    pq.write_table(table.cast(schema), buffer, compression="zstd")
    write_bytes(path, buffer.getvalue())


def read_table(path: Path) -> pd.DataFrame:
    """Return the Parquet table `path` as a frame."""
    import pyarrow.parquet as pq

    frame: pd.DataFrame = pq.read_table(path).to_pandas()
    return frame


def read_metadata(path: Path) -> dict[str, str]:
    """Return the metadata that `write_table` was given for `path`."""
    import pyarrow.parquet as pq

    raw = pq.read_schema(path).metadata or {}
    return {key.decode(): value.decode() for key, value in raw.items() if key not in (b"pandas", b"ARROW:schema")}


def digest(path: Path) -> str:
    """Return the BLAKE2b digest of the file `path`, 32 hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def digest_text(text: str) -> str:
    """Return the BLAKE2b digest of `text`, 32 hexadecimal digits."""
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def sweep(folder: Path) -> None:
    """Remove what a killed run may have left in `folder` on systems without anonymous files."""
    if folder.is_dir():
        for leftover in folder.rglob(f".*{PART}"):
            with contextlib.suppress(OSError):
                leftover.unlink()

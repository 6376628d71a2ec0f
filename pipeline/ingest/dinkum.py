"""Dinkum binary data: one file of a Slocum glider as a table of its sensors.

`dbdreader` (L. Merckelbach) decodes the values. This module adds what it leaves
to its caller, because each gap turns bad input into a hang, a crash or, worst, plausible numbers:

- a header without its tags makes it read for ever, and a header that contradicts its cache file makes its compiled
  part read outside its arrays: both are checked beforehand;
- it does not look at the tag ``d`` in front of every record, so that a file cut short or damaged yields invented
  records whose times may look right (01330005.ecd of the OSU 2025 set: 8734 records intact, 8799 returned): the
  records are walked here, and nothing behind the first broken one is handed over;
- it writes a sensor list into the cache folder and wants cache names in lower case: it is given a scratch folder.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.findings import InputError
from pipeline.ingest.clock import EARLIEST, LATEST
from pipeline.ingest.logs import UnreadableError

LABEL = b"dbd_label"
ENCODING = 5

_NUMBERS = ("encoding_ver", "total_num_sensors", "sensors_per_cycle", "state_bytes_per_cycle")
_GLIDER = re.compile(r"(.+)-\d{4}-\d{1,3}-\d+-\d+$")
_LINE = re.compile(rb"s: +[TF] +\d+ +(-1|\d+) +[1248] +[!-~]+ +[!-~]")
#: Bytes of the record with known values that follows the header, and where its float 123.456 stands.
_KNOWN, _FLOAT = 16, slice(4, 8)


class MissingCacheError(UnreadableError):
    """A file whose list of sensors is in a cache file that is not there."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"no cache file {name}",
            "it beside the data or in a folder 'cac'",
            "copy it from the folder state/cache on the glider",
        )


@dataclass(frozen=True)
class Sensors:
    """What one file holds.

    Attributes
    ----------
    frame
        ``time`` [s since 1970-01-01 UTC] and the sensors asked for that the file has, by the glider's names, in the
        glider's units; latitudes and longitudes in degrees; NaN where a sensor was not updated.
    records
        Number of intact records, the first (stale) one not counted.
    damage, where
        What ended the reading before the end of the file and where; empty if nothing did.
    impossible
        Number of records left out because their time is none.
    glider
        Name of the glider, from the name it gave the file; empty if it gave none.
    """

    frame: pd.DataFrame
    records: int
    damage: str
    where: str
    impossible: int
    glider: str = ""


def require() -> None:
    """Raise `InputError` with the remedy if dbdreader cannot be imported."""
    try:
        import dbdreader  # noqa: F401
    except ImportError as error:
        raise InputError(
            "Slocum files", found="no dbdreader to read them with", remedy="pip install 'seatrial[slocum]'"
        ) from error
    except OSError as error:
        raise InputError(
            "Slocum files",
            found="a home folder in which dbdreader cannot make its folder",
            remedy="set HOME to a folder that is writable",
        ) from error


def content(path: Path) -> tuple[bytes, bool]:
    """Return the bytes of `path`, decompressed if it is compressed, and whether they are all there.

    A compressed file is a series of LZ4 blocks, each after its length in two bytes; decoding stops at the first
    block that is cut short or damaged.

    Raises
    ------
    UnreadableError
        If the file is empty, cannot be opened, or does not begin like Slocum data.
    """
    from dbdreader.decompress import Decompressor

    try:
        raw = path.read_bytes()
    except OSError as error:
        raise UnreadableError(f"a file that cannot be opened ({error.strerror})", remedy="left out") from error
    if not raw:
        raise UnreadableError("an empty file", "Slocum data")
    if raw.startswith(LABEL):
        return raw, True
    if LABEL not in raw[:32]:
        raise UnreadableError("no Slocum header", "a file that begins with 'dbd_label'")
    blocks: list[bytes] = []
    whole = True
    try:
        with Decompressor(str(path)) as file:
            blocks.extend(file.decompressed_blocks())
    except Exception:  # lz4 raises several types that are not public
        whole = False
    if not blocks or not blocks[0].startswith(LABEL):
        raise UnreadableError("a first block that LZ4 cannot decode", "compressed Slocum data")
    return b"".join(blocks), whole


def header(data: bytes) -> dict[str, str]:
    """Return the tags of the header at the beginning of `data`.

    Raises
    ------
    UnreadableError
        If a tag that is needed is missing or no number, or the encoding is not version 5.
    """
    count = re.search(rb"^num_ascii_tags:\s*(\d{1,3})\s*$", data[:2048], re.MULTILINE)
    if not count:
        raise UnreadableError("a header without a readable num_ascii_tags", "a whole Slocum header")
    lines = data[:8192].split(b"\n")[: int(count[1]) + 1]
    if len(lines) <= int(count[1]):
        raise UnreadableError("a header cut short", f"{int(count[1])} lines")
    try:
        pairs = [line.decode("ascii").partition(":") for line in lines[:-1]]
    except UnicodeDecodeError as error:
        raise UnreadableError("a damaged header", "plain text") from error
    tags = {name: value.strip() for name, _, value in pairs}
    for name in _NUMBERS:
        if not tags.get(name, "").isdigit():
            raise UnreadableError(f"a header without a readable {name}", "a whole Slocum header")
    if int(tags["encoding_ver"]) != ENCODING:
        raise UnreadableError(f"encoding version {tags['encoding_ver']}", f"version {ENCODING}", "left out")
    if not re.fullmatch(r"[0-9A-Fa-f]{1,8}", tags.get("sensor_list_crc", "")):
        raise UnreadableError("a header without a readable sensor_list_crc", "a whole Slocum header")
    if tags.get("sensor_list_factored") not in ("0", "1"):
        raise UnreadableError("a header without a readable sensor_list_factored", "0 or 1")
    if int(tags["state_bytes_per_cycle"]) != -(-int(tags["sensors_per_cycle"]) // 4):
        raise UnreadableError(
            f"a header with {tags['state_bytes_per_cycle']} state bytes for {tags['sensors_per_cycle']} sensors",
            "four sensors a byte",
        )
    return tags


def intact(data: bytes, start: int, sizes: Sequence[int]) -> tuple[int, int, str]:
    """Walk the records of `data` and return how many are intact, where they end, and what ended them.

    The walk does not look for a good record behind a broken one: a value that is "as before" there may repeat one
    that the broken record held.

    A record is the tag ``d``, two bits a sensor (2: a new value follows; 1: as before; 0: not updated), and the new
    values. The first record is where the walk begins, `start` plus the known record.

    Parameters
    ----------
    data
        The whole file, decompressed.
    start
        Length of the header [bytes].
    sizes
        Bytes that a value of each sensor takes, in the order of the file.
    """
    count = -(-len(sizes) // 4)
    padded = np.zeros((count, 4), dtype=np.int64)
    padded.ravel()[: len(sizes)] = sizes
    states = (np.arange(256)[:, None] >> np.array([6, 4, 2, 0])) & 3
    lengths = (padded @ (states == 2).T).ravel()
    offsets = np.arange(count) * 256
    array = np.frombuffer(data, dtype=np.uint8)
    position, records = start + _KNOWN, 0
    while position < len(data):
        if data[position] == ord("X"):
            return records, position, ""
        if data[position] != ord("d"):
            return records, position, "a broken record"
        end = position + 1 + count
        if end <= len(data):
            end += int(lengths[offsets + array[position + 1 : end]].sum())
        if end > len(data):
            return records, position, "a record cut short"
        position, records = end, records + 1
    return records, position, ""


def read(path: Path, scratch: Path, wanted: Sequence[str]) -> Sensors:
    """Return the sensors `wanted` of the file `path`, one row a record.

    Parameters
    ----------
    path
        Data file, compressed or not, of any name.
    scratch
        Folder that holds the cache files under lower-case names, and may be written to.
    wanted
        Names of sensors; those that the file does not have are left out.

    Raises
    ------
    UnreadableError
        If nothing can be read from the file.
    """
    from dbdreader import DbdError

    data, whole = content(path)
    tags = header(data)
    cache = f"{tags['sensor_list_crc'].lower()}.cac"
    if tags["sensor_list_factored"] == "1" and not (scratch / cache).exists():
        raise MissingCacheError(cache)
    listed = (scratch / cache).read_bytes() if tags["sensor_list_factored"] == "1" else _behind(data, tags)
    if not _is_list(listed, int(tags["total_num_sensors"])):
        raise UnreadableError(f"a list of sensors {cache} that cannot be read", "a line a sensor", "copy it again")
    copy = scratch / "segment.dbd"
    try:
        copy.write_bytes(data)
        glider = _GLIDER.match(tags.get("full_filename", ""))
        return replace(_read(copy, data, whole, cache, wanted), glider=glider[1] if glider else "")
    except DbdError as error:
        raise UnreadableError(f"a file that dbdreader refuses ({' '.join(str(error).split())})") from error
    finally:
        copy.unlink(missing_ok=True)


def _read(copy: Path, data: bytes, whole: bool, cache: str, wanted: Sequence[str]) -> Sensors:
    import dbdreader

    file = dbdreader.DBD(str(copy), str(copy.parent))
    start, sizes = int(file.fp_binary_start), list(file.byteSizes)
    if len(sizes) != int(file.headerInfo["sensors_per_cycle"]) or not set(sizes) <= {1, 2, 4, 8}:
        raise UnreadableError(
            f"{file.headerInfo['sensors_per_cycle']} sensors, and {len(sizes)} in its list {cache}", "the same number"
        )
    if not _known(data[start : start + _KNOWN]):
        raise UnreadableError("no known values behind the header", "123.456")
    records, end, damage = intact(data, start, sizes)
    if not whole and not damage:
        damage = "a compressed block cut short or damaged"
    if damage:
        copy.write_bytes(data[:end])
    good = max(records - 1, 0)
    time = file.timeVariable
    if time not in file.parameterNames:
        raise UnreadableError(f"no {time}", "the time of every record", "left out; add it to the list of sensors")
    names = [name for name in wanted if name in file.parameterNames and name != time]
    if good == 0:
        frame = pd.DataFrame({"time": np.empty(0), **{name: np.empty(0) for name in names}})
        return Sensors(frame, 0, damage, _place(end, data, damage), 0)
    with np.errstate(all="ignore"):
        read_out = file.get(time, time, *names, return_nans=True)
    instants = read_out[0][1]
    frame = pd.DataFrame({"time": instants, **{name: read_out[2 + i][1] for i, name in enumerate(names)}})
    possible = (instants > EARLIEST) & (instants < LATEST)
    return Sensors(frame[possible], good, damage, _place(end, data, damage), int((~possible).sum()))


def _behind(data: bytes, tags: dict[str, str]) -> bytes:
    """Return what follows the header."""
    return data.split(b"\n", int(tags["num_ascii_tags"]))[-1]


def _is_list(text: bytes, count: int) -> bool:
    """Return whether `text` begins with `count` lines, each a sensor with its number, size, name and unit."""
    lines = text.split(b"\n", count)[:count]
    return len(lines) == count and all(_LINE.match(line) for line in lines)


def _known(record: bytes) -> bool:
    """Return whether `record` holds the values that every file begins with."""
    if len(record) < _KNOWN or record[:1] != b"s":
        return False
    return any(abs(struct.unpack(f"{order}f", record[_FLOAT])[0] - 123.456) < 1e-3 for order in "<>")


def _place(end: int, data: bytes, damage: str) -> str:
    return f"byte {end} of {len(data)}" if damage else ""

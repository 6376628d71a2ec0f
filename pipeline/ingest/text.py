"""Text tables: separator, header, encoding and decimal mark found out, gzip seen through, broken lines counted."""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import re
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.findings import Finding
from pipeline.ingest import headers, numerals
from pipeline.ingest.numerals import is_float, is_numeral
from pipeline.ingest.units import UNITS, spelling

if TYPE_CHECKING:
    import pandas as pd

#: How a column without a name is called.
UNNAMED = "unnamed column "
_SNIFFED = 1 << 16
#: Lines in which a header is looked for, records from which the decimal mark is told.
_LINES = 200
#: What marks a line as a comment; a header may stand in one.
_COMMENTS = "#%!"
#: How a unit line writes "no unit", and the sizes in bytes that stand below the units of a Slocum ASCII table.
_NO_UNIT = {"1", "1e-3", "1e-03", "0.001", "-", "--", "none", "None", "n/a", "N/A", "NA"}
_BYTES = {"1", "2", "4", "8"}
_MISSING = ["", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "n/a", "null", "NULL", "None", "none", "-", "--", "NaT"]


@dataclass(frozen=True)
class Layout:
    """How a text table is laid out.

    Attributes
    ----------
    names
        Header, one unique name a column ("" for a column without one becomes ``unnamed column N``).
    units
        Units in a second header line, "" where there are none.
    separator
        One character, or "" for any run of blanks.
    skipped
        Lines before the first record.
    decimal
        "." or ",", of most columns; one may have the other (`pipeline.ingest.numerals`).
    encoding
        ``utf-8``, ``utf-16``, ``gb18030`` or ``latin-1``.
    first
        Fields of the first record, empty if there is none.
    quoted
        Whether fields may stand in quotation marks.
    """

    names: list[str]
    units: list[str]
    separator: str
    skipped: int
    decimal: str
    encoding: str
    first: list[str]
    quoted: bool


def sniff(path: Path) -> Layout:
    """Return the layout of the text table `path`.

    Raises
    ------
    UnreadableError
        If it is none: empty, packed and damaged, binary, or without a header.
    """
    from pipeline.ingest.logs import UnreadableError

    table, out = "a header line and records", "file left out"
    try:
        raw = _beginning(path)
    except (OSError, EOFError, zlib.error) as error:
        raise UnreadableError(f"a file that cannot be read ({error})", table, f"{out}; copy it again") from error
    if not raw.strip():
        raise UnreadableError("an empty file", table, f"{out}; copy it again")
    text, encoding = _decoded(raw)
    if _is_binary(text):
        raise UnreadableError("no text", table, f"{out}; write it as CSV")
    lines = text.replace("\0", "").splitlines()
    if len(raw) == _SNIFFED and len(lines) > 1:
        lines.pop()
    start = _header(lines)
    if start is None:
        raise UnreadableError("nothing but comments", table, out)
    header = lines[start].lstrip(f"{_COMMENTS} ")
    separator = _separator(header)
    names = _fields(header, separator)
    body = lines[start + 1 :]
    if _are_numbered([_fields(line, separator) for line in body[:_LINES] if line.strip()], len(names)):
        names = ["", *names]
    if all(is_numeral(name) for name in names):
        raise UnreadableError("numbers without a header", table, f"{out}; add a first line that names the columns")
    if len(names) < 2 and separator == "":
        raise UnreadableError("no table", table, out)
    units = [""] * len(names)
    skipped = start + 1
    if body and _is_unit_line(_fields(body[0], separator), len(names)):
        units = [field.strip("()[] ") for field in _fields(body[0], separator)]
        skipped += 1
        body = body[1:]
        sizes = _fields(body[0], separator) if body else []
        if len(sizes) == len(names) > 1 and set(sizes) <= _BYTES:
            skipped += 1
            body = body[1:]
    records = [_fields(line, separator) for line in body[:_LINES] if line.strip()]
    decimal = "," if separator != "," and _decimal_commas(records) else "."
    first = next((record for record in records if len(record) == len(names)), records[0] if records else [])
    return Layout(_unique(names), units, separator, skipped, decimal, encoding, first, quoted='"' in text)


def _are_numbered(records: list[list[str]], count: int) -> bool:
    """Return whether `records` have the number of their row before `count` fields, as R writes tables."""
    numbers = [record[0].strip('"') for record in records]
    return (
        bool(records)
        and {len(record) for record in records} == {count + 1}
        and numbers == [str(k + 1) for k in range(len(records))]
    )


def _beginning(path: Path) -> bytes:
    """Return the first bytes of a file, what there is of them where packed data end before their time."""
    raw = b""
    with _open(path) as file:
        while len(raw) < _SNIFFED:
            try:
                part = file.read(min(1 << 10, _SNIFFED - len(raw)))
            except (OSError, EOFError, zlib.error):
                if raw:
                    break
                raise
            if not part:
                break
            raw += part
    return raw


def _decoded(raw: bytes) -> tuple[str, str]:
    """Return the text that a file begins with, and its encoding; the bytes may end within a character."""
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return raw.decode("utf-16", errors="ignore"), "utf-16"
    try:
        return raw.decode("utf-8-sig"), "utf-8"
    except UnicodeDecodeError as error:
        if error.start > len(raw) - 4:
            return raw.decode("utf-8-sig", errors="ignore"), "utf-8"
        encoding = "gb18030" if _is_chinese(raw) else "latin-1"
        return raw.decode(encoding, errors="ignore"), encoding


def _is_binary(text: str) -> bool:
    """Return whether `text` is none: begins with a NUL, or has more of them than a logger that lost power leaves."""
    return text[:64].count("\0") > 0 or text.count("\0") > 0.5 * len(text)


def _is_chinese(raw: bytes) -> bool:
    """Return whether bytes that are no UTF-8 are GB 18030: their high bytes are pairs that are common characters."""
    runs = [run for run in re.findall(rb"[\x80-\xff]+", raw[:-4]) if len(run) > 1]
    text = b"".join(runs).decode("gb18030", errors="replace")
    return len(runs) > 1 and all("\u4e00" <= character <= "\u9fff" or character in "（）℃°" for character in text)


def _header(lines: list[str]) -> int | None:
    """Return the line of the header: the first that names a time and a measurement, in a comment even.

    Without one it is the first line that is no comment, and mission.yaml must say what is what.
    """
    for number, line in enumerate(lines[:_LINES]):
        bare = line.lstrip(f"{_COMMENTS} ")
        names = {headers.quantity(field)[0] for field in _fields(bare, _separator(bare))} if bare else set()
        if "time" in names and len(names - {"time", None}) > 0:
            return number
    return next((i for i, line in enumerate(lines) if line.strip() and line.lstrip()[0] not in _COMMENTS), None)


def _separator(header: str) -> str:
    """Return the separator that stands most often in a header, "" (any run of blanks) if none does."""
    separator = max(";,\t|", key=header.count)
    return separator if separator in header else ""


def _decimal_commas(records: list[list[str]]) -> bool:
    """Return whether numbers are written with a decimal comma, and none with a point."""
    fields = [field for record in records for field in record]
    return any("," in field and is_float(field.replace(",", ".", 1)) for field in fields) and not any(
        "." in field and is_float(field) for field in fields
    )


def read(path: Path, layout: Layout, numeric: list[str], textual: list[str]) -> tuple[pd.DataFrame, list[Finding]]:
    """Return the named columns of the text table `path`, and what could not be read of them.

    Parameters
    ----------
    path, layout
        The file and its layout.
    numeric
        Columns returned as float64, NaN where a field is empty or no number.
    textual
        Columns returned as text.

    Returns
    -------
    frame, findings
        The table, and one finding for each kind of trouble: lines with a wrong number of fields, fields that are no
        numbers, numbers written otherwise than in the rest of the file.
    """
    import pyarrow as pa

    if layout.separator:
        try:
            return _read_arrow(path, layout, numeric, textual)
        except (pa.ArrowInvalid, EOFError, OSError, UnicodeError, zlib.error):
            return _read_slowly(path, layout, numeric, textual)
    return _read_slowly(path, layout, numeric, textual)


def _read_arrow(
    path: Path, layout: Layout, numeric: list[str], textual: list[str]
) -> tuple[pd.DataFrame, list[Finding]]:
    import pyarrow as pa
    from pyarrow import csv as arrow

    broken: list[int] = []

    def skip(row: Any) -> str:
        broken.append(row.number or 0)
        return "skip"

    table = arrow.read_csv(
        _Utf8(path, layout.encoding),
        read_options=arrow.ReadOptions(use_threads=False, column_names=layout.names, skip_rows=layout.skipped),
        parse_options=arrow.ParseOptions(
            delimiter=layout.separator, quote_char='"' if layout.quoted else False, invalid_row_handler=skip
        ),
        convert_options=arrow.ConvertOptions(
            column_types={**dict.fromkeys(numeric, pa.float64()), **dict.fromkeys(textual, pa.string())},
            include_columns=[*textual, *numeric],
            null_values=_MISSING,
            strings_can_be_null=True,
            decimal_point=layout.decimal,
        ),
    )
    if layout.quoted and table.num_rows + len(broken) < _count(path, layout):
        raise pa.ArrowInvalid("a stray quotation mark that swallows lines")
    return table.to_pandas(), _broken(broken, path)


def _read_slowly(
    path: Path, layout: Layout, numeric: list[str], textual: list[str]
) -> tuple[pd.DataFrame, list[Finding]]:
    """Read field by field as text: for blank-separated tables, truncated gzip and fields that are no numbers."""
    import pandas as pd

    broken: list[int] = []
    rows: list[list[str]] = []
    width = len(layout.names)
    findings: list[Finding] = []
    with io.TextIOWrapper(_open(path), encoding=layout.encoding, errors="replace") as file:
        try:
            for number, raw in enumerate(file, 1):
                line = raw.rstrip("\n").replace("\0", "")
                if number <= layout.skipped or not line.strip():
                    continue
                fields = _fields(line, layout.separator)
                if len(fields) == width:
                    rows.append(fields)
                else:
                    broken.append(number)
        except (EOFError, OSError, zlib.error) as error:
            kept = f"its first {len(rows)} records are used; copy it again"
            findings.append(Finding("warning", path.name, "", f"a file cut short ({error})", "a whole file", kept))
    frame = pd.DataFrame(rows, columns=layout.names, dtype="object")[[*textual, *numeric]]
    out: dict[str, Any] = {name: frame[name].where(~frame[name].isin(_MISSING)).astype("string") for name in textual}
    for name in numeric:
        out[name], written = numerals.values(frame[name], layout.decimal)
        if written:
            findings.append(Finding("note", path.name, f"column '{name}'", written))
        wrong = out[name].isna() & ~frame[name].str.strip().isin(_MISSING)
        if wrong.any():
            findings.append(no_numbers(path, name, frame[name], wrong))
    return pd.DataFrame(out), [*_broken(broken, path), *findings]


def _count(path: Path, layout: Layout) -> int:
    """Return how many lines there are below the header, blank ones apart."""
    with _open(path) as file:
        return sum(1 for number, line in enumerate(file, 1) if number > layout.skipped and line.strip())


def left_out(path: Path, found: str) -> Finding:
    """Return a finding about records or fields of the table `path` that are left out."""
    return Finding("warning", path.name, "", found, "one number or time in each field", "those were left out")


def no_numbers(path: Path, name: str, fields: pd.Series[Any], wrong: pd.Series[bool]) -> Finding:
    """Return a finding about those `fields` of column `name`, shape (n,), that are `wrong`."""
    count, first = f"{int(wrong.sum())} of {len(fields)} fields", fields[wrong].iloc[0]
    return left_out(path, f"{count} of column '{name}' that are no number, first '{first}'")


def _broken(numbers: list[int], path: Path) -> list[Finding]:
    if not numbers:
        return []
    count = f"{len(numbers)} line{'s' if len(numbers) > 1 else ''}"
    return [left_out(path, f"{count} with a wrong number of fields, first line {numbers[0]}")]


def _open(path: Path) -> Any:
    with path.open("rb") as file:
        packed = file.read(2) == b"\x1f\x8b"
    return gzip.open(path, "rb") if packed else path.open("rb")


class _Utf8(io.RawIOBase):
    """The bytes of a text file as UTF-8, with a replacement character for what is none in its encoding."""

    def __init__(self, path: Path, encoding: str) -> None:
        self._file = _open(path)
        self._decoder = codecs.getincrementaldecoder(encoding)(errors="replace")
        self._left = b""

    def readable(self) -> bool:
        return True

    def close(self) -> None:
        self._file.close()
        super().close()

    def readinto(self, buffer: Any) -> int:
        while not self._left:
            raw = self._file.read(len(buffer))
            self._left = self._decoder.decode(raw, final=not raw).encode()
            if not raw:
                break
        part, self._left = self._left[: len(buffer)], self._left[len(buffer) :]
        buffer[: len(part)] = part
        return len(part)


def _fields(line: str, separator: str) -> list[str]:
    if not separator:
        return line.split()
    return [field.strip() for field in next(csv.reader([line], delimiter=separator))]


def _is_unit_line(fields: list[str], width: int) -> bool:
    """Return whether the line below the header holds units: as many fields, and no digit that begins one.

    "1" or "-" for a quantity without a unit may be among them where another field is a unit that is known.
    """
    filled = [field for field in fields if field]
    if len(fields) != width or not filled:
        return False
    plain = [field for field in filled if field not in _NO_UNIT]
    if len(plain) < len(filled) and not any(_is_unit(field) for field in plain):
        return False
    return bool(plain) and not any(field[0].isdigit() or is_numeral(field) for field in plain)


def _is_unit(field: str) -> bool:
    return spelling(field.strip("()[]")) in UNITS or field.upper() in ("UTC", "GMT") or " since " in field


def _unique(names: list[str]) -> list[str]:
    out: list[str] = []
    for number, name in enumerate(names, 1):
        name = name or f"{UNNAMED}{number}"
        out.append(name if name not in out else f"{name} #{number}")
    return out

"""How values are rounded where people read them: by their uncertainty, and all of a column beneath each other."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

#: Beyond so many decimals a power of ten is written.
MOST_DECIMALS = 6
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
#: A number of a cell, and what may stand between two of them.
NUMBER, BETWEEN = r"([+−]?\d+)(\.\d+)?", r" ± | to "
#: A row; a cell with its attributes and what is in it; in that, marks and words for the eye, numbers, a second line.
ROW = re.compile(r"<tr>.*?</tr>", re.DOTALL)
CELL = re.compile(r'(<td class="number[^>]*>)(.*?)(</td>)|<t[dh]\b[^>]*>', re.DOTALL)
CONTENT = re.compile(
    rf"((?:<span[^>]*>[^<]*</span>)*)({NUMBER}(?:(?:{BETWEEN}){NUMBER})*|–)((?:<br>|<span class=\"unit\">).*)?",
    re.DOTALL,
)


def decimals(std: float) -> int:
    """Return how many decimals show two digits of a 1-sigma."""
    return max(0, 1 - math.floor(math.log10(float(f"{std:.1e}")))) if std > 0 and math.isfinite(std) else 3


def amount(value: float, std: float, *, sign: bool = True) -> str:
    """Return value ± 1-sigma with two digits of the latter and a true minus; nothing has no sign."""
    digits = decimals(std)
    if digits > MOST_DECIMALS:
        power = math.floor(math.log10(max(abs(value), std)))
        return f"({amount(value / 10.0**power, std / 10.0**power, sign=sign)})·10{str(power).translate(RAISED)}"
    value = round(value, digits) or 0.0
    return f"{value:{'+' if sign and value else ''}.{digits}f} ± {std:.{digits}f}".replace("-", "−")


def in_words(item: Mapping[str, Any]) -> str:
    """Return a correction in words: symbol, value ± 1-sigma, unit unless it is 1, and share of the vehicle's own value.

    Parameters
    ----------
    item
        ``symbol``, ``value``, ``std``, ``unit``, ``percent`` and ``percent_std`` (NaN where it is no share).

    Examples
    --------
    >>> nothing = {"percent": math.nan, "percent_std": math.nan}
    >>> in_words({"symbol": "ΔG", "value": 0.21, "std": 0.03, "unit": "N"} | nothing)
    'ΔG = +0.210 ± 0.030 N'
    >>> in_words({"symbol": "b_U", "value": 2.0, "std": 0.1, "unit": "1"} | nothing)
    'b_U = +2.00 ± 0.10'
    """
    unit = "" if item["unit"] == "1" else f" {item['unit']}"
    share = f" ({amount(item['percent'], item['percent_std'])} %)" if math.isfinite(item["percent"]) else ""
    return f"{item['symbol']} = {amount(item['value'], item['std'])}{unit}{share}"


def counted(count: int, noun: str) -> str:
    """Return how many of a noun whose plural ends in s.

    Examples
    --------
    >>> counted(1, "dive"), counted(3, "dive")
    ('1 dive', '3 dives')
    """
    return f"{count} {noun}{'' if count == 1 else 's'}"


def signed(value: float, digits: int = 1) -> str:
    """Return a number with its sign, a true minus, and so many decimals."""
    return f"{value:+.{digits}f}".replace("-", "−")


def uncertainty(std: float) -> str:
    """Return a 1-sigma with two digits."""
    digits = decimals(std)
    if digits > MOST_DECIMALS:
        power = math.floor(math.log10(std))
        return f"{std / 10.0**power:.1f}·10{str(power).translate(RAISED)}"
    return f"{std:.{digits}f}"


class _Cell(NamedTuple):
    """A cell that holds numbers: its column, where in the table its numbers stand, they, and what is between them."""

    column: int
    start: int
    end: int
    numbers: list[tuple[str, str]]
    between: list[str]


def aligned(page: str) -> str:
    """Return a page in whose tables decimal points, and uncertainties, stand beneath each other.

    Cells of class ``number`` are filled up with what is not seen, as wide as the digits that others of the column have
    there; columns whose cells are built unlike each other are left as they are.
    """
    return re.sub(r"<tbody>.*?</tbody>", lambda found: _aligned(found[0]), page, flags=re.DOTALL)


def _aligned(table: str) -> str:
    cells = _cells(table)
    pieces: list[tuple[int, int, str]] = []
    for column in {cell.column for cell in cells}:
        own = [cell for cell in cells if cell.column == column]
        longest = max(own, key=lambda cell: len(cell.between)).between
        if any(cell.between != longest[: len(cell.between)] for cell in own):
            continue
        places = range(len(longest) + 1)
        whole = [max((len(cell.numbers[k][0]) for cell in own if k < len(cell.numbers)), default=0) for k in places]
        part = [max((len(cell.numbers[k][1]) for cell in own if k < len(cell.numbers)), default=0) for k in places]
        pieces += [(cell.start, cell.end, _filled(cell, longest, whole, part)) for cell in own]
    for start, end, text in sorted(pieces, reverse=True):
        table = table[:start] + text + table[end:]
    return table


def _cells(table: str) -> list[_Cell]:
    """Return the cells of a table's body that hold numbers."""
    out = []
    for row in ROW.finditer(table):
        for column, cell in enumerate(CELL.finditer(table, row.start(), row.end())):
            found = CONTENT.fullmatch(table, cell.start(2), cell.end(2)) if cell[1] else None
            if found:
                numbers = re.findall(NUMBER, found[2]) or [(found[2], "")]
                out.append(_Cell(column, found.start(2), found.end(2), numbers, re.findall(BETWEEN, found[2])))
    return out


def _filled(cell: _Cell, between: list[str], whole: list[int], part: list[int]) -> str:
    """Return the numbers of a cell, filled up to the width that each place has in its column."""
    text, unseen = "", ""
    for k, (wide, deep) in enumerate(zip(whole, part, strict=True)):
        separator = between[k - 1] if k else ""
        if k >= len(cell.numbers):
            unseen += separator + "0" * wide + _digits(deep)
            continue
        left, right = cell.numbers[k]
        text += _unseen(unseen) + separator + (_unseen("0" * (wide - len(left))) if k else "") + left + right
        unseen = _digits(deep)[len(right) :]
    return text + _unseen(unseen)


def _digits(deep: int) -> str:
    return "." + "0" * (deep - 1) if deep else ""


def _unseen(text: str) -> str:
    return f'<i class="pad" data-pad="{text}"></i>' if text else ""

"""Numerals: how the numbers of a text column are written; decimal point or comma, thousands set apart or not."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

_EXPONENT = r"(?:[eEdD][+-]?\d+)?"


def _pattern(decimal: str, group: str) -> re.Pattern[str]:
    whole = rf"(?:[1-9]\d{{0,2}}(?:{group}\d{{3}})+|\d+)"
    return re.compile(rf"[+-]?(?:{whole}(?:{decimal}\d*)?|{decimal}\d+){_EXPONENT}")


#: Numerals by their decimal mark; the other mark may set thousands apart.
_WRITTEN = {".": _pattern(r"\.", ","), ",": _pattern(",", r"\.")}
_DIGIT = re.compile(r"\d")
#: What else sets thousands apart: blanks, those that do not break, an apostrophe.
_APART = re.compile("(?<=\\d)[ \u00a0\u202f'\u2019](?=\\d{3}(?!\\d))")


def is_numeral(text: str) -> bool:
    """Return whether `text` is a number, with decimal point or comma."""
    bare = _APART.sub("", text.strip())
    return is_float(bare) or any(pattern.fullmatch(bare) for pattern in _WRITTEN.values())


def values(texts: pd.Series[Any], usual: str) -> tuple[pd.Series[Any], str]:
    """Return the numbers that `texts`, shape (n,), are, NaN where one is none, and how they are written.

    The decimal mark is a matter of the whole column: ``1,074`` is one or a thousand, and ``0,5`` or ``1,074.7`` beside
    it say which. Where no text of the column says, it is the mark that the file has elsewhere.

    Parameters
    ----------
    texts
        The fields of a column.
    usual
        Decimal mark of the file, "." or ",".

    Returns
    -------
    numbers, written
        float64, and words for what is not plain: a decimal comma in a file of points, thousands set apart; else "".
    """
    import pandas as pd

    plain = pd.to_numeric(texts, errors="coerce").astype("float64")
    if usual == "." and not any(_DIGIT.search(str(text)) for text in texts[plain.isna()].unique()):
        return plain, ""
    bare = texts.str.strip().str.replace(_APART.pattern, "", regex=True)
    fits = {mark: bare.str.fullmatch(pattern.pattern, na=False) for mark, pattern in _WRITTEN.items()}
    votes = {mark: int((fit & ~fits["," if mark == "." else "."]).sum()) for mark, fit in fits.items()}
    decimal = usual if votes["."] == votes[","] else max(votes, key=lambda mark: votes[mark])
    group = "," if decimal == "." else "."
    grouped = bare.str.contains(group, regex=False, na=False) | bare.ne(texts.str.strip())
    changed = bare.str.replace(group, "", regex=False).str.replace(decimal, ".", regex=False)
    changed = changed.str.replace(r"[dD]", "e", regex=True)
    numbers = pd.to_numeric(changed.where(fits[decimal]), errors="coerce").astype("float64")
    numbers = numbers.where(fits[decimal], plain.where(~texts.str.contains(r"\d", regex=True, na=False)))
    words = []
    if decimal != usual:
        words.append("a decimal comma" if decimal == "," else "a decimal point")
    if (grouped & fits[decimal]).any():
        told = "" if votes[decimal] else " by the mark of other columns"
        words.append(f"thousands set apart{told}, first '{texts[grouped & fits[decimal]].iloc[0]}'")
    return numbers, " and ".join(words)


def is_float(text: str) -> bool:
    """Return whether `text` is a number as Python writes one."""
    try:
        float(text)
    except ValueError:
        return False
    return True

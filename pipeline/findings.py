"""What was skipped, clipped or doubted, and what stops a mission: always in one line a person can act on."""

from __future__ import annotations

import os
import re
import traceback
from dataclasses import asdict, dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Literal

Severity = Literal["note", "warning", "error"]
#: What must not reach a terminal or a page: control characters but white space; of many alike, one is enough.
_UNPRINTABLE = re.compile(r"([\x00-\x08\x0e-\x1f\x7f])\1*")


def _escaped(match: re.Match[str]) -> str:
    """Return the code of a control character, and how often it stands there in a row."""
    count = len(match[0])
    return f"\\x{ord(match[1]):02x}" + (f" ({count} times)" if count > 1 else "")


@dataclass(frozen=True)
class Finding:
    """One observation about the data: which file, where, what was found, what was expected, what to do.

    Attributes
    ----------
    severity
        ``note`` (for the record), ``warning`` (doubted or left out), ``error`` (a file or instrument is lost).
    file
        File name relative to the mission folder, or the instrument or stage concerned.
    where
        Where in it: a row, a time, a column; may be empty.
    found, expected, remedy
        The three parts of the sentence; ``remedy`` may be empty for a note.
    """

    severity: Severity
    file: str
    where: str
    found: str
    expected: str = ""
    remedy: str = ""

    def __post_init__(self) -> None:
        for name in ("file", "where", "found", "expected", "remedy"):
            object.__setattr__(self, name, _UNPRINTABLE.sub(_escaped, getattr(self, name)))

    def __str__(self) -> str:
        place = f"{self.file}: {self.where}" if self.where else self.file
        parts = [f"{place}: found {self.found}"]
        if self.expected:
            parts.append(f"expected {self.expected}")
        if self.remedy:
            parts.append(self.remedy)
        return " ".join("; ".join(parts).splitlines())

    def as_dict(self) -> dict[str, str]:
        """Return the finding as plain strings, for summary.json."""
        return asdict(self)


class InputError(Exception):
    """Input that a mission cannot be analysed without; its text is one line in the shape of a `Finding`."""

    def __init__(self, file: str, where: str = "", *, found: str, expected: str = "", remedy: str = "") -> None:
        self.finding = Finding("error", file, where, found, expected, remedy)
        super().__init__(str(self.finding))

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild, (self.finding,)


def _rebuild(finding: Finding) -> InputError:
    """Recreate an `InputError` in another process."""
    return InputError(
        finding.file,
        finding.where,
        found=finding.found,
        expected=finding.expected,
        remedy=finding.remedy,
    )


def in_one_line(error: Exception, stage: str, remedy: str) -> InputError:
    """Return `error`, met in `stage`, in one line; one that nobody foresaw says where in this package it arose."""
    if isinstance(error, InputError):
        return error
    if isinstance(error, OSError):
        name = Path(str(error.filename)).name if error.filename else ""
        return InputError(stage, name, found=error.strerror or str(error), expected="to read and write it")
    package = str(Path(__file__).parent)
    frames = traceback.extract_tb(error.__traceback__)
    frame = ([frame for frame in frames if frame.filename.startswith(package)] or list(frames))[-1]
    place = os.path.relpath(frame.filename, Path(package).parent) if package in frame.filename else frame.name
    return InputError(
        stage,
        f"line {frame.lineno} of {place}",
        found=f"{type(error).__name__}: {' '.join(str(error).split())[:200]}",
        expected="no such error",
        remedy=remedy,
    )


def nearest(word: str, known: list[str]) -> str:
    """Return ``did you mean 'x'?`` for the known name nearest to `word`, or the list of known names."""
    match = get_close_matches(word, known, n=1, cutoff=0.5)
    return f"did you mean '{match[0]}'?" if match else "known: " + ", ".join(sorted(known))

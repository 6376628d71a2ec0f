"""A printed number beside the computed ones, and the rule by which it is judged.

A number is reproduced if it is met within one unit of its last printed digit, or within `TOLERANCE` of its size, or,
where it was read off a flat maximum, if it lies where the curve is flat. If not, other readings of it are tried: the
first that meets it makes it a misprint, because of that reading. So does a slip of one digit, if one is named and what
is computed meets the number without it. Otherwise it is not reproducible, and what was tried is listed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Literal, NamedTuple

Kind = Literal["result", "input", "measured"]

#: Relative difference up to which a number counts as reproduced whatever its digits.
TOLERANCE = 2e-4


class Pair(NamedTuple):
    """A quantity in the signs of the paper, and in physical signs."""

    paper: float
    physical: float


@dataclass(frozen=True)
class Reading:
    """Another way to read a printed number: what it supposes, and what it then gives."""

    what: str
    value: float


@dataclass(frozen=True)
class Claim:
    """A printed number beside the computed ones.

    Attributes
    ----------
    where
        Section, table or equation in which it is printed.
    quantity, unit
        What it is.
    printed
        As printed, in plain digits.
    paper, physical
        Computed in the signs of the paper and in physical signs; NaN where there is no such number.
    readings
        What else was tried, in order.
    slip
        The number as it would be with one digit printed otherwise; "" if no such slip is suspected.
    span
        Where a maximum is flat: lowest and highest value; None for a number that is sharp.
    kind
        ``result``, ``input`` of the paper, or ``measured``: set or measured at sea.
    remark
        What else a reader should know.
    """

    where: str
    quantity: str
    unit: str
    printed: str
    paper: float
    physical: float
    readings: tuple[Reading, ...] = ()
    slip: str = ""
    span: tuple[float, float] | None = None
    kind: Kind = "result"
    remark: str = ""

    @property
    def value(self) -> float:
        """The printed number."""
        return float(self.printed)

    @property
    def relative_difference(self) -> float:
        """Computed in the signs of the paper over printed, less one; NaN where the printed number is zero."""
        return self.paper / self.value - 1.0 if self.value else math.nan

    @property
    def reading(self) -> Reading | None:
        """The first other reading that meets the printed number."""
        return next((reading for reading in self.readings if meets(self.printed, reading.value)), None)

    @property
    def verdict(self) -> str:
        """``reproduced``, ``misprint``, ``not reproducible``; inputs ``used as printed``; else ``set or measured``."""
        if self.kind == "measured":
            return "set or measured"
        if meets(self.printed, self.paper) or self._flat:
            return "used as printed" if self.kind == "input" else "reproduced"
        return "misprint" if self.reading or self._slipped else "not reproducible"

    @property
    def because(self) -> str:
        """The reason of the verdict, and the remark."""
        verdict, reading = self.verdict, self.reading
        reason = ""
        if verdict == "misprint" and reading:
            reason = f"because {reading.what} gives {reading.value:.5g}"
        elif verdict == "misprint":
            reason = f"because it looks like {self.slip} with one digit wrong"
        elif verdict == "not reproducible":
            reason = "tried " + "; ".join(f"{reading.what}: {reading.value:.4g}" for reading in self.readings)
        elif self._flat and self.span and not meets(self.printed, self.paper):
            reason = f"read off a flat maximum, which reaches from {self.span[0]:.3g} to {self.span[1]:.3g}"
        return "; ".join(part for part in (reason, self.remark) if part)

    @property
    def _flat(self) -> bool:
        return self.span is not None and self.span[0] <= self.value <= self.span[1]

    @property
    def _slipped(self) -> bool:
        digits = [a != b for a, b in zip(self.slip, self.printed, strict=False)]
        return len(self.slip) == len(self.printed) and sum(digits) == 1 and meets(self.slip, self.paper)

    def row(self) -> dict[str, Any]:
        """Return the row of paper.json."""
        return {
            "where": self.where,
            "quantity": self.quantity,
            "unit": self.unit,
            "kind": self.kind,
            "printed": self.value,
            "printed_as": self.printed,
            "computed_paper_signs": self.paper,
            "computed_physical_signs": self.physical,
            "relative_difference": self.relative_difference,
            "verdict": self.verdict,
            "because": self.because,
            "readings": [{"what": reading.what, "value": reading.value} for reading in self.readings],
        }


def meets(printed: str, computed: float) -> bool:
    """Return whether `computed` is the number `printed` within one unit of its last digit or `TOLERANCE`."""
    unit = 10.0 ** int(Decimal(printed).as_tuple().exponent)
    return abs(computed - float(printed)) <= max(unit * (1.0 + 1e-9), TOLERANCE * abs(float(printed)))

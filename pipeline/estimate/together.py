"""What the parts of a mission, each estimated by itself, say together of one quantity, and whether they agree."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.special import chdtri

#: Parts that differ by more than chance does in one mission of forty do not agree.
DOUBTED = 0.025


class Together(NamedTuple):
    """Mean of what parts say.

    Attributes
    ----------
    value, std
        Mean by inverse variance and its 1-sigma.
    known, of
        How many parts tell it, of how many.
    lowest, highest
        Of the values of the parts.
    chi_square
        Of the values about their mean.
    agree
        Whether chance may have made so large a χ².
    """

    value: float
    std: float
    known: int
    of: int
    lowest: float
    highest: float
    chi_square: float
    agree: bool

    @property
    def account(self) -> dict[str, Any]:
        """What a report says of the parts."""
        return {name: value for name, value in self._asdict().items() if name not in ("value", "std")}


def together(found: Sequence[tuple[float, float] | None]) -> Together | None:
    """Return what parts say together of a quantity; None where none tells it.

    All parts borrow the same polar and the same knowledge of before, so that their errors are taken as wholly alike:
    the 1-sigma is the mean of theirs, never less than that of the best. Where parts differ by more than chance does,
    it is widened by Birge's ratio (1932, doi:10.1103/PhysRev.40.207).

    Parameters
    ----------
    found
        Value and 1-sigma, above 0, of each part; None where a part does not tell.

    Examples
    --------
    >>> both = together([(1.0, 0.5), (2.0, 0.5), None])
    >>> both.value, both.std, both.known, both.of, both.agree
    (1.5, 0.5, 2, 3, True)
    """
    known = np.array([pair for pair in found if pair is not None], dtype=np.float64)
    if not known.size:
        return None
    value, std = known.T
    weight = std**-2 / np.sum(std**-2)
    mean, freedom = float(weight @ value), value.size - 1
    chi_square = float(np.sum(((value - mean) / std) ** 2))
    agree = freedom == 0 or chi_square <= float(chdtri(freedom, DOUBTED))
    ratio = 1.0 if agree else math.sqrt(chi_square / freedom)
    return Together(
        mean,
        float(weight @ std) * ratio,
        value.size,
        len(found),
        float(value.min()),
        float(value.max()),
        chi_square,
        agree,
    )

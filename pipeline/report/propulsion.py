"""What turns a propeller: in words, and how hard."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def setting(speed_rpm: float | None, power: float | None) -> str:
    """Return in words what turns a propeller, "" where nothing does or nobody knows.

    Parameters
    ----------
    speed_rpm
        Rev/min; 0 where it stands still, NaN or None where it is not known.
    power
        W, where thrust follows from it; 0 where it does not, NaN or None where it is not known.
    """
    if speed_rpm and speed_rpm > 0.0:
        return f"{speed_rpm:.0f} rpm"
    return f"{power:.1f} W" if power and power > 0.0 else ""


def strength(part: Mapping[str, Any]) -> float:
    """Return how hard the propeller is driven in a part of a mission, a row of `nominal.table`: to sort by, no more."""
    known = (part["propeller_speed_rpm"], part["propeller_power_W"], float(part["powered"]))
    return max(value for value in known if value is not None and value >= 0.0)

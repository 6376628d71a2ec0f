"""Times of plain tables: POSIX numbers, ISO 8601 and dated text, in any zone, to seconds since 1970 UTC."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError, available_timezones

from pipeline.findings import InputError, nearest

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import pandas as pd

    Array = npt.NDArray[np.float64]

#: Seconds per unit of a numeric time.
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
#: Units by the least number that today is in them.
_SIZES = (("ns", 1e17), ("us", 1e14), ("ms", 1e11))
_YEAR_1990 = 631152000.0
_ZONE = re.compile(r"(?:Z|UTC|GMT|[+-]\d{2}:?\d{2})\s*$", re.IGNORECASE)
_SLASHED = re.compile(r"^\s*(\d{1,2})[/.](\d{1,2})[/.](\d{4})")


def numeric(values: Array, unit: str | None, file: str, column: str) -> Array:
    """Return numeric times, shape (n,), as seconds since 1970 UTC.

    Without `unit` it follows from the size: 1.5e9 are seconds, 1.5e12 ms, 1.5e15 µs, 1.5e18 ns.

    Raises
    ------
    InputError
        If the unit is unknown, or the times count from the start of the mission instead of 1970.
    """
    import numpy as np

    finite = values[np.isfinite(values)]
    if unit is None:
        middle = float(np.median(finite)) if finite.size else 0.0
        unit = next((finer for finer, least in _SIZES if least <= middle < 1e20), "s")
    if unit not in UNITS:
        raise InputError(
            file,
            f"column '{column}'",
            found=f"unit '{unit}' for time",
            expected="s, ms, us, ns, iso or a format such as '%d/%m/%Y %H:%M:%S'",
            remedy=nearest(unit, [*UNITS, "iso"]),
        )
    seconds = values * UNITS[unit]
    if finite.size and float(finite.max()) * UNITS[unit] < _YEAR_1990:
        raise InputError(
            file,
            f"column '{column}'",
            found=f"times from {float(finite.min()):g} to {float(finite.max()):g} {unit}",
            expected="seconds since 1970-01-01 UTC or ISO 8601 text",
            remedy="add the start of the mission to the times",
        )
    return np.asarray(seconds)


def zoned(texts: pd.Series[Any], timezone: str, file: str) -> Array | None:
    """Return ISO 8601 times that all name their zone, shape (n,), as seconds since 1970 UTC, read by Arrow at once.

    None where any of them is something else: `textual` takes a hundred times as long, and more kinds of text.

    Parameters
    ----------
    texts, timezone, file
        As for `textual`; the zone is not needed, but must be one.

    Raises
    ------
    InputError
        If the zone is unknown.
    """
    import numpy as np
    import pyarrow as pa

    _zone(timezone, file)
    try:
        stamps = pa.array(texts, type=pa.string(), from_pandas=True).cast(pa.timestamp("ns", "UTC"))
    except (pa.ArrowException, TypeError):
        return None
    numbers = stamps.fill_null(0).cast(pa.int64()).to_numpy()
    return np.where(stamps.is_null().to_numpy(zero_copy_only=False), np.nan, numbers * 1e-9)


def textual(texts: pd.Series[Any], unit: str | None, timezone: str, file: str, column: str) -> Array:
    """Return times written as text, shape (n,), as seconds since 1970 UTC; NaN where a text is none of 1678 to 2262.

    Parameters
    ----------
    texts
        ISO 8601 (seconds with a decimal point or comma), or ``31/12/2016 23:59:59`` where the day can be told from the
        month.
    unit
        A `strptime` format, if the text is neither; "iso" or None otherwise.
    timezone
        IANA name of the zone that texts without one are in.
    file, column
        For messages.

    Raises
    ------
    InputError
        If the zone is unknown, or day and month cannot be told apart.
    """
    import numpy as np
    import pandas as pd

    zone = _zone(timezone, file)
    texts = texts.str.replace(r"(:\d{2}),(\d)", r"\1.\2", regex=True)
    layout = unit if unit and "%" in unit else _layout(texts, file, column)
    with_zone = texts.str.contains(_ZONE.pattern, regex=True, flags=re.IGNORECASE, na=False)
    out = np.full(len(texts), np.nan)
    for mask, has_zone in ((~with_zone, False), (with_zone, True)):
        part = texts[mask]
        if part.empty:
            continue
        if has_zone:
            part = part.str.replace(r"\s*(?:UTC|GMT|Z)\s*$", "+00:00", regex=True, flags=re.IGNORECASE)
            parsed = pd.to_datetime(part, format=layout + "%z" if "%" in layout else layout, utc=True, errors="coerce")
        else:
            parsed = _localised(pd.to_datetime(part, format=layout, errors="coerce"), zone).dt.tz_convert("UTC")
        stamps = pd.DatetimeIndex(parsed)
        within = (stamps >= pd.Timestamp.min.tz_localize("UTC")) & (stamps <= pd.Timestamp.max.tz_localize("UTC"))
        stamps = pd.DatetimeIndex(stamps.where(within)).as_unit("ns")
        out[mask.to_numpy()] = np.where(stamps.isna(), np.nan, stamps.asi8 * 1e-9)
    return out


def _localised(local: pd.Series[Any], zone: ZoneInfo) -> pd.Series[Any]:
    """Return local times in their zone; the hour that comes twice in autumn is told apart by the order of the records.

    NaT where the order does not tell, and in the hour that spring leaves out.
    """
    placed: pd.Series[Any]
    try:
        placed = local.dt.tz_localize(zone, ambiguous="infer", nonexistent="NaT")
    except ValueError:
        placed = local.dt.tz_localize(zone, ambiguous="NaT", nonexistent="NaT")
    return placed


def _zone(name: str, file: str) -> ZoneInfo:
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError) as error:
        raise InputError(
            "mission.yaml",
            f"files.{file}.timezone",
            found=f"'{name}'",
            expected="an IANA time zone",
            remedy=_suggestion(name),
        ) from error


def _suggestion(name: str) -> str:
    hint = nearest(name, sorted(available_timezones()))
    return hint if hint.startswith("did") else "such as 'UTC' or 'Europe/Berlin'"


def _layout(texts: pd.Series[Any], file: str, column: str) -> str:
    """Return the format of dated texts: ISO 8601, or day and month told apart by numbers above 12."""
    first = next((text for text in texts if isinstance(text, str) and text.strip()), "")
    slashed = _SLASHED.match(first)
    if not slashed:
        return "ISO8601"
    parts = texts.str.extract(_SLASHED.pattern).astype("float64")
    mark = first.strip()[len(slashed[1])]
    if (parts[0] > 12).any():
        date = f"%d{mark}%m{mark}%Y"
    elif (parts[1] > 12).any():
        date = f"%m{mark}%d{mark}%Y"
    else:
        raise InputError(
            file,
            f"column '{column}'",
            found=f"'{first.strip()}', where the day cannot be told from the month",
            expected="ISO 8601, or the format given as unit",
            remedy="for day/month/year: unit: '%d/%m/%Y %H:%M:%S' under files: … time: in mission.yaml",
        )
    clock = " %H:%M" + (":%S" if first.count(":") > 1 else "") + (".%f" if "." in first.split(":")[-1] else "")
    return date + (clock if ":" in first else "")

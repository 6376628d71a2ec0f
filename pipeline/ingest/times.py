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
_YEAR_1990, _YEAR_2060 = 631152000.0, 2840140800.0
#: s from 1900, which NTP and the OOI count from, to 1970: today is 3.9e9 in them, as 2093 is in s since 1970.
_NTP = 2208988800.0
_ZONE = re.compile(r"(?:Z|UTC|GMT|[+-]\d{2}:?\d{2}|(?<=:\d{2})[+-]\d{2}|(?<=\.\d)[+-]\d{2})\s*$", re.IGNORECASE)
_SLASHED = re.compile(r"^\s*(\d{1,2})[/.-](\d{1,2})[/.-](\d{4})")
_NAMED = re.compile(r"^\d{1,2}([/. -])[A-Za-z]{3}[/. -]\d{4}")
#: A date with the name of its month, in another order or written out.
_MONTH = re.compile(r"(?:^|[^A-Za-z])(?:jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec)[a-z]*", re.IGNORECASE)
_CLOCK = re.compile(r"\d{1,2}:\d{2}(?P<seconds>:\d{2}(?P<fraction>[.,]\d+)?)?(?P<half>\s*[AaPp][Mm])?")
#: Parts of a date as a header writes its layout.
_TOKEN = re.compile(r"yyyy|yy|mm|dd|hh|ss|[^a-z]+")
_LAYOUTS = {"yyyy": "%Y", "yy": "%y", "mm": "%m", "dd": "%d", "hh": "%H", "ss": "%S"}
#: Files of a SeaExplorer, whose dates have the day first.
_SEAEXPLORER = re.compile(r"\.(gli|pld\d)\.(sub|raw)\b", re.IGNORECASE)
#: CF units of time: seconds in the unit and the instant that it counts from.
_SINCE = re.compile(
    r"^\s*(?P<span>(?:nano|micro|milli)?second|sec|s|minute|min|hour|hr|h|day|d)s?\s+since\s+(?P<origin>.+)$",
    re.IGNORECASE,
)
#: Seconds per span, by as much of its name as tells it apart.
_SPANS = {"nano": 1e-9, "micro": 1e-6, "milli": 1e-3, "s": 1.0, "m": 60.0, "h": 3600.0, "d": 86400.0}
#: Days of MATLAB's datenum and of the Julian calendar at 1970-01-01, and what today is in them.
_DAYS = {"datenum": (719529.0, 7.26e5, 7.67e5), "julian": (2440587.5, 2.447e6, 2.489e6)}
#: Days of other calendars that today is the same number in: origin, and what has it.
_CALENDARS = {
    "1899-12-30": "a date of Excel",
    "1858-11-17": "a Modified Julian Day",
    "1950-01-01": "days of Argo and EGO",
}
#: Date and time run together, as 20160622173000.
_COMPACT = (1.99e13, 2.1e13)


def is_unit(unit: str | None) -> bool:
    """Return whether `unit` is one of numeric times: s, ms, us, ns, datenum, julian, or as in CF ("days since …")."""
    return unit in UNITS or unit in _DAYS or bool(unit and _SINCE.match(unit))


def numeric(values: Array, unit: str | None, file: str, column: str, timezone: str = "UTC") -> Array:
    """Return numeric times, shape (n,), as seconds since 1970 UTC.

    Without `unit` it follows from the size: 1.5e9 are seconds, 3.7e9 those since 1900 of NTP, 1.5e12 ms, 1.5e15 µs,
    1.5e18 ns, 7.36e5 days of MATLAB's datenum, 2.457e6 Julian days, 2.016e13 a date and time run together
    (20160622173000).
    Days of a calendar that names no zone (datenum, "days since …") are those of `timezone`, IANA name, as are dates run
    together; seconds since 1970 are UTC, and so are Julian days.

    Raises
    ------
    InputError
        If the unit or the zone is unknown, or the times count from the start of the mission instead of 1970.
    """
    import numpy as np

    finite = values[np.isfinite(values)]
    if unit is None:
        middle = float(np.median(finite)) if finite.size else 0.0
        unit = next((finer for finer, least in _SIZES if least <= middle < 1e20), "s")
        unit = next((days for days, (_, low, high) in _DAYS.items() if low <= middle < high), unit)
        if _COMPACT[0] <= middle < _COMPACT[1]:
            return _universal(_run_together(values), timezone, file)
    if unit in _DAYS:
        seconds = np.asarray((values - _DAYS[unit][0]) * 86400.0)
        return _universal(seconds, timezone, file) if unit == "datenum" else seconds
    if since := _SINCE.match(unit):
        span = next(seconds for name, seconds in _SPANS.items() if since["span"].lower().startswith(name))
        counted = np.asarray(values * span + _origin(since["origin"], file, column))
        return counted if _ZONE.search(since["origin"]) else _universal(counted, timezone, file)
    if unit not in UNITS:
        raise InputError(
            file,
            f"column '{column}'",
            found=f"unit '{unit}' for time",
            expected="s, ms, us, ns, datenum, julian, 'days since 2000-01-01', iso or a format such as "
            "'%d/%m/%Y %H:%M:%S'",
            remedy=nearest(unit, [*UNITS, *_DAYS, "iso"]),
        )
    seconds = values * UNITS[unit]
    if unit == "s" and finite.size and _YEAR_1990 <= float(np.median(finite)) - _NTP < _YEAR_2060:
        return np.asarray(seconds - _NTP)
    if finite.size and float(finite.max()) * UNITS[unit] < _YEAR_1990:
        raise InputError(
            file,
            f"column '{column}'",
            found=f"times from {float(finite.min()):g} to {float(finite.max()):g} {unit}",
            expected="seconds since 1970-01-01 UTC or ISO 8601 text",
            remedy=f"say what they count from: files: {{{file}: {{time: {{column: {column}, unit: "
            f"'seconds since 2000-01-01'}}}}}} in mission.yaml{_readings(float(finite[0]))}",
        )
    return np.asarray(seconds)


def _readings(number: float) -> str:
    """Return what dates `number` may be, and the units that say so; "" where it is in no calendar of days."""
    import pandas as pd

    told = []
    for origin, name in _CALENDARS.items():
        days = number + (pd.Timestamp(origin) - pd.Timestamp(0)).days
        if 1990 <= 1970 + days / 365.2425 < 2040:
            date = pd.Timestamp(0) + pd.Timedelta(days=days)
            told.append(f"'days since {origin}' if {number:.10g} is {name} ({date:%Y-%m-%d %H:%M})")
    return f"; {', '.join(told)}" if told else ""


def assembled(parts: dict[str, Array], timezone: str, file: str) -> Array:
    """Return times whose year, month, day, hour, minute and second are columns, shape (n,), as seconds since 1970 UTC.

    Parameters
    ----------
    parts
        By the names of `pipeline.ingest.headers.CALENDAR`; hour, minute and second are zero where they are not there,
        and years below 70 are those of this century. Of a year the first day is 1; it may have a fraction, which an
        hour that is there too replaces.
    timezone
        IANA name of the zone of these times.
    file
        For messages.

    Raises
    ------
    InputError
        If the zone is unknown.
    """
    import numpy as np
    import pandas as pd

    year = np.where(parts["year"] < 100, parts["year"] + np.where(parts["year"] < 70, 2000, 1900), parts["year"])
    by_month = {"month", "day"} <= set(parts)
    first = np.ones_like(year)
    month, day = (parts["month"], parts["day"]) if by_month else (first, first)
    known = np.isfinite(year) & np.isfinite(month) & np.isfinite(day) & (np.abs(year - 2000) < 200)
    date = {"year": np.where(known, year, 1970), "month": np.where(known, month, 1), "day": np.where(known, day, 1)}
    days = pd.DatetimeIndex(pd.to_datetime(pd.DataFrame(date), errors="coerce")).as_unit("s")
    seconds = np.where(known & np.asarray(days.notna()), days.asi8.astype(np.float64), np.nan)
    if not by_month:
        past = np.where(np.abs(parts["day_of_year"] - 184.0) < 184.0, parts["day_of_year"], np.nan) - 1.0
        seconds = seconds + 86400.0 * (np.floor(past) if "hour" in parts else past)
    for name, span in (("hour", 3600.0), ("minute", 60.0), ("second", 1.0)):
        seconds = seconds + span * parts.get(name, np.zeros_like(seconds))
    return _universal(seconds, timezone, file)


def _run_together(values: Array) -> Array:
    """Return times written as numbers yyyymmddhhmmss, shape (n,), as seconds since 1970 of their own zone."""
    import numpy as np
    import pandas as pd

    whole = pd.Series(np.trunc(np.nan_to_num(values)).astype(np.int64).astype(str))
    stamps = pd.DatetimeIndex(pd.to_datetime(whole, format="%Y%m%d%H%M%S", errors="coerce")).as_unit("ns")
    return np.where(stamps.isna(), np.nan, stamps.asi8 * 1e-9 + np.mod(values, 1.0))


def days_as_text(column: pd.Series[Any]) -> pd.Series[Any] | None:
    """Return a column of numbers that are days run together (20140327) as ISO texts, None where it is none."""
    parts = _split(column, 1)
    if parts is None or not (parts[0].between(1990, 2060) & parts[1].between(1, 12) & parts[2].between(1, 31)).all():
        return None
    return _joined(column, parts, "-")


def hours_as_text(column: pd.Series[Any]) -> pd.Series[Any] | None:
    """Return a column of numbers that are times of day (70003 is 07:00:03) as texts, None where it is none."""
    parts = _split(column, 0)
    if parts is None or not (parts[0].between(0, 23) & parts[1].between(0, 59) & parts[2].between(0, 59)).all():
        return None
    return _joined(column, parts, ":")


def _split(column: pd.Series[Any], wider: int) -> list[pd.Series[Any]] | None:
    """Return what the digits of whole numbers, by twos from behind, say: three columns without what is missing."""
    if column.dtype.kind not in "iuf":
        return None
    whole = column.dropna()
    if whole.empty or not ((whole >= 0) & (whole < 10.0 ** (6 + 2 * wider)) & (whole % 1 == 0)).all():
        return None
    whole = whole.astype("int64")
    return [whole // 10_000, whole // 100 % 100, whole % 100]


def _joined(column: pd.Series[Any], parts: list[pd.Series[Any]], between: str) -> pd.Series[Any]:
    texts = [part.astype("string").str.zfill(2) for part in parts]
    return (texts[0] + between + texts[1] + between + texts[2]).reindex(column.index).astype(object)


def _universal(seconds: Array, timezone: str, file: str) -> Array:
    """Return times told by the clock of a zone, shape (n,), s since 1970 there, as seconds since 1970 UTC."""
    import numpy as np
    import pandas as pd

    zone = _zone(timezone, file)
    if zone.key == "UTC":
        return seconds
    local = pd.Series(pd.to_datetime(pd.Series(np.round(seconds * 1e6)), unit="us", errors="coerce"))
    stamps = pd.DatetimeIndex(_localised(local, zone).dt.tz_convert("UTC")).as_unit("ns")
    return np.where(stamps.isna(), np.nan, stamps.asi8 * 1e-9)


def _origin(text: str, file: str, column: str) -> float:
    """Return the instant that CF times count from, s since 1970."""
    import pandas as pd

    try:
        stamp = pd.Timestamp(text.strip())
        return float((stamp.tz_localize("UTC") if stamp.tzinfo is None else stamp).timestamp())
    except ValueError as error:
        raise InputError(
            file,
            f"column '{column}'",
            found=f"times since '{text.strip()}'",
            expected="times since a date in ISO 8601",
            remedy="correct its unit under files: … time: in mission.yaml",
        ) from error


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


def as_format(unit: str) -> str:
    """Return the `strptime` format that a header like ``dd/mm/yyyy hh:mm`` says; `unit` itself where it says none.

    Dates with the year first need none.
    """
    tokens = _TOKEN.findall(unit.lower())
    if "".join(tokens) != unit.lower() or not {"dd", "mm"} <= set(tokens) or tokens[0].startswith("y"):
        return unit
    out = ""
    for token in tokens:
        out += "%M" if token == "mm" and "%H" in out else _LAYOUTS.get(token, token)
    return out if "%y" in out.lower() else unit


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
        seconds = _parsed(part, layout, zone, has_zone)
        if "%S" in layout:
            other = layout.replace(".%f", "") if ".%f" in layout else layout.replace("%S", "%S.%f")
            seconds = np.where(np.isnan(seconds), _parsed(part, other, zone, has_zone), seconds)
        out[mask.to_numpy()] = seconds
    return out


def _parsed(texts: pd.Series[Any], layout: str, zone: ZoneInfo, has_zone: bool) -> Array:
    """Return texts of one layout, shape (n,), as seconds since 1970 UTC, NaN where they are of another."""
    import numpy as np
    import pandas as pd

    if has_zone:
        parsed = pd.to_datetime(texts, format=layout + "%z" if "%" in layout else layout, utc=True, errors="coerce")
    else:
        parsed = _localised(pd.to_datetime(texts, format=layout, errors="coerce"), zone).dt.tz_convert("UTC")
    stamps = pd.DatetimeIndex(parsed)
    within = (stamps >= pd.Timestamp.min.tz_localize("UTC")) & (stamps <= pd.Timestamp.max.tz_localize("UTC"))
    stamps = pd.DatetimeIndex(stamps.where(within)).as_unit("ns")
    return np.where(stamps.isna(), np.nan, stamps.asi8 * 1e-9)


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
    """Return the format of dated texts: ISO 8601, or day and month told apart by a name, a dot or numbers above 12."""
    first = next((text for text in texts if isinstance(text, str) and text.strip()), "").strip()
    named = _NAMED.match(first)
    if named:
        return f"%d{named[1]}%b{named[1]}%Y{clock_format(first[named.end() :])}"
    slashed = _SLASHED.match(first)
    if not slashed:
        return _by_name(first) or "ISO8601"
    parts = texts.str.extract(_SLASHED.pattern).astype("float64")
    mark, clock = first[len(slashed[1])], clock_format(first[slashed.end() :])
    day_first = f"%d{mark}%m{mark}%Y{clock}"
    if mark == "." or (parts[0] > 12).any() or _SEAEXPLORER.search(file):
        return day_first
    if (parts[1] > 12).any():
        return f"%m{mark}%d{mark}%Y{clock}"
    raise InputError(
        file,
        f"column '{column}'",
        found=f"'{first}', where the day cannot be told from the month",
        expected="ISO 8601, or the format given as unit",
        remedy=f"for day{mark}month{mark}year: files: {{{file}: {{time: {{column: {column}, unit: '{day_first}'}}}}}} "
        "in mission.yaml",
    )


def _by_name(text: str) -> str | None:
    """Return the format of a date that names its month, in whatever order; None where it does not."""
    from pandas.tseries.api import guess_datetime_format

    return guess_datetime_format(text) if _MONTH.search(text) else None


def clock_format(text: str) -> str:
    """Return the `strptime` format of the time of day `text`, with what stands before it; "" where there is none."""
    clock = _CLOCK.search(text)
    if not clock:
        return ""
    hours = "%I" if clock["half"] else "%H"
    before = text[: clock.start()] or " "
    return (
        f"{before}{hours}:%M"
        + (":%S" if clock["seconds"] else "")
        + (".%f" if clock["fraction"] else "")
        + (" %p" if clock["half"] else "")
    )

"""Columns of a plain table: which is which, in what unit, and the guesses where mission.yaml does not say."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from pipeline.findings import Finding, InputError, nearest
from pipeline.ingest.headers import BEAMS, CALENDAR, PROFILER, calendar, is_magnetic, is_reckoned, meant, quantity
from pipeline.ingest.text import UNNAMED
from pipeline.ingest.times import as_format
from pipeline.ingest.units import QUANTITIES, convert, known
from pipeline.mission import Table, TableColumn

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import pandas as pd

    Array = npt.NDArray[np.float64]

#: A date alone, a time of day alone.
_DAY = re.compile(r"\d{4}[-/]\d{1,2}[-/]\d{1,2}|\d{1,2}[-/.](\d{1,2}|[A-Za-z]{3})[-/.]\d{4}|\d{8}")
_HOUR = re.compile(r"\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?\s*(Z|UTC|[AaPp][Mm])?")
#: The end of a time of day on a clock of twelve hours.
_HALVED = re.compile(r"\d\s*[AaPp][Mm]$")
#: Hours and minutes before UTC, as a header states them; letters that are no unit of time, and not UTC.
_OFFSET = re.compile(r"(?:UTC|GMT)\s*([+-])(\d{1,2})(?::?(\d{2}))?", re.IGNORECASE)
_LETTERS = re.compile(
    r"(?!(?:UTC|GMT|Z|ISO|[num]?s|secs?|mins?|h|hrs?|hours?|d|days?)$)[A-Z]{1,5}|(?:UTC|GMT)\s*[+-].*|local( time)?",
    re.IGNORECASE,
)
#: A zone by its letters, which more than one zone has.
_ABBREVIATED = re.compile(r"\d\s*([A-Z]{2,5})$")
#: Two names of one quantity: where mission.yaml names one of them in a file, the other is not guessed there.
_TWINS = {"depth": "pressure", "salinity": "conductivity"}


@dataclass(frozen=True)
class Source:
    """Where a canonical column comes from: its column in the file, its unit (None: not stated), whether guessed."""

    column: str
    unit: str | None
    guessed: bool


#: Words in the name of a column that goes before others of its quantity, the likelier first.
_LIKELIER = {
    "time": ("precise",),
    "latitude": ("gps", "precise"),
    "longitude": ("gps", "precise"),
    "pressure": ("sea", "sci"),
    "temperature": ("sci",),
    "conductivity": ("sci",),
}
_OF_CTD = ("pressure", "temperature")
#: What a row counts for in seconds where pressures that stand in the same rows are compared.
_ROW = 2.0
#: Where a quantity may come from, the likelier column first. Of times each row has the first that is there.
Candidates = dict[str, tuple[Source, ...]]


def match(
    columns: list[str], units: list[str], table: Table, file: str, meanings: Mapping[str, str] | None = None
) -> tuple[Candidates, list[Finding]]:
    """Return which columns of the file may be which canonical one: as mission.yaml says, else as the header suggests.

    Of positions those of a receiver (``gps``) come first, for many gliders log dead-reckoned ones beside them; of
    pressures that of the sea, beside which some sensors log the absolute one. `meanings`, CF's standard names of the
    columns, tell what no header names, and where a sign is the opposite.
    """
    sources: dict[str, list[Source]] = {}
    notes: list[Finding] = []
    named = {name: entry if isinstance(entry, TableColumn) else TableColumn(column=entry)
             for name, entry in table.columns.items()}  # fmt: skip
    if table.time is not None:
        named["time"] = table.time
    for key, entry in named.items():
        place = f"files.{file}.time" if key == "time" else f"files.{file}.columns.{key}"
        if key != "time" and key.removesuffix("_qc") not in QUANTITIES:
            raise InputError("mission.yaml", place, found="an unknown quantity", remedy=nearest(key, list(QUANTITIES)))
        if entry.column not in columns:
            raise InputError(
                file,
                f"column '{entry.column}'",
                found=f"no such column among {listed(columns)}",
                expected=f"the column that mission.yaml names for {key}",
                remedy=nearest(entry.column, columns),
            )
        stated = _unit(entry.column, units[columns.index(entry.column)])
        sources[key] = [Source(entry.column, entry.unit or stated, entry.unit is None)]
    for ignored in table.ignore:
        if ignored not in columns:
            place, remedy = f"files.{file}.ignore", nearest(ignored, columns)
            notes.append(Finding("warning", "mission.yaml", place, f"'{ignored}', no column of it", "a column", remedy))
    taken = {source.column for entry in sources.values() for source in entry} | set(table.ignore)
    left = []
    meanings = meanings or {}
    named_by_header = {quantity(column, below)[0] for column, below in zip(columns, units, strict=True)}
    twins = {twin for pair in _TWINS.items() for twin, other in (pair, pair[::-1]) if other in named}
    for column, below in zip(columns, units, strict=True):
        if column in taken:
            continue
        name, unit = quantity(column, below)[0], _unit(column, below)
        if name == "time" and unit:
            unit = as_format(unit)
        standard, reversed_sign = meant(meanings.get(column, ""))
        if name is None and standard not in named_by_header:
            name = standard
        if unit and name == standard and reversed_sign:
            unit = f"-{unit}"
        if name is None or name in twins or (name in named and name != "time"):
            left.append(column)
        elif unit and name in QUANTITIES and not known(name, unit):
            notes.append(
                Finding(
                    "warning",
                    file,
                    f"column '{column}'",
                    f"unit '{unit}' for {name}",
                    f"a unit of {QUANTITIES[name].name}",
                    f"column left out; {nearest(unit, list(QUANTITIES[name].units))}",
                )
            )
        else:
            sources.setdefault(name, []).append(Source(column, unit, True))
    if "time" not in sources:
        parts = calendar([column for column in columns if column not in taken])
        left = [column for column in left if column not in parts.values()]
        if parts:
            sources["time"] = [Source(column, part, True) for part, column in parts.items()]
    for name in _LIKELIER:
        if name in sources and name not in named:
            sources[name] = sorted(sources[name], key=partial(_rank, name))
    if not set(BEAMS) <= set(sources):
        left += [source.column for name in PROFILER for source in sources.pop(name, [])]
    left = [column for column in left if not column.startswith(UNNAMED)]
    if left:
        notes.append(Finding("note", file, "", f"columns that are not read: {', '.join(left)}"))
    orphans = {key for key in sources if key.endswith("_qc") and key.removesuffix("_qc") not in sources}
    return {key: tuple(entry) for key, entry in sources.items() if key not in orphans}, notes


def _unit(column: str, below: str) -> str | None:
    """Return the unit of a column, as stated `below` its header or else in it, with the sign that its name says."""
    suggested = quantity(column, below)[1]
    if below and suggested and suggested.startswith("-"):
        return f"-{below.removeprefix('-')}"
    return below or suggested


def chosen(raws: list[pd.DataFrame], candidates: Candidates, file: str) -> tuple[dict[str, Source], list[Finding]]:
    """Return which of several columns each quantity but time is taken from, and a finding about each that is not.

    It is the first that changes, of those of the CTD the one that has most values beside conductivity. A vehicle's log
    has columns for sensors that it does not carry: all NaN, or all zero. Where the pressure of a CTD leaves out much of
    another one, it serves salinity and density alone (``pressure_interpolated``).

    Parameters
    ----------
    raws
        The columns of all files of one instrument as they stand there.
    candidates
        As `match` returns them.
    file
        Name of the first file.
    """
    import numpy as np

    sources: dict[str, Source] = {}
    findings: list[Finding] = []

    def values(source: Source) -> Array:
        return np.concatenate([raw[source.column].to_numpy(dtype=np.float64) for raw in raws])

    for name, entry in sorted(candidates.items(), key=lambda item: item[0] != "conductivity"):
        if name == "time":
            continue
        beside = np.isfinite(values(sources["conductivity"])) if name in _OF_CTD and "conductivity" in sources else None
        content = []
        for source in entry if len(entry) > 1 else ():
            found = values(source)
            known = np.isfinite(found)
            changes = bool(known.any() and np.ptp(found[known]) > 0)
            content.append((changes, bool(known.any()), 0 if beside is None else int((known & beside).sum())))
        if not content:
            sources[name] = entry[0]
            continue
        best = max(range(len(entry)), key=lambda k: (*content[k], -k))
        if name == "pressure":
            of_ctd, best = best, _covering([values(source) for source in entry], best)
            if best != of_ctd:
                sources["pressure_interpolated"] = entry[of_ctd]
        sources[name] = entry[best]
        for k, source in enumerate(entry):
            if k != best:
                what = "that changes" if content[k][0] else "that never changes" if content[k][1] else "without a value"
                findings.append(
                    Finding(
                        "warning" if content[k][0] and not _likelier(name, entry[best], source) else "note",
                        file,
                        f"column '{source.column}'",
                        f"a second column for {name}, {what}",
                        "one",
                        f"'{entry[best].column}' is taken; if that is wrong, name the right one under files: in "
                        "mission.yaml",
                    )
                )
    return {name: sources[name] for name in (*candidates, "pressure_interpolated") if name in sources}, findings


def _covering(pressures: list[Array], best: int) -> int:
    """Return `best` of several records of pressure in the same rows, or the fullest where `best` leaves too much out.

    A CTD may sleep on climbs. Units may differ: under water is where a pressure exceeds a fiftieth of its largest.
    """
    import numpy as np

    from pipeline.ingest.merge import covers

    rows = _ROW * np.arange(pressures[best].size, dtype=np.float64)
    deep = [np.where(each > 0.02 * np.nanmax(each, initial=0.0), 1e3 * each, np.nan) for each in pressures]
    fullest = max(range(len(deep)), key=lambda k: (int(np.isfinite(deep[k]).sum()), k == best))
    return best if covers(rows, pressures[best], rows, deep[fullest]) else fullest


def _rank(name: str, source: Source) -> int:
    """Return how many words of `_LIKELIER` are likelier than those in the name of column `source`."""
    words = _LIKELIER.get(name, ())
    return next((k for k, word in enumerate(words) if word in source.column.lower()), len(words))


def _likelier(name: str, source: Source, other: Source) -> bool:
    """Return whether the name of column `source` says that it goes before `other`."""
    return _rank(name, source) < _rank(name, other)


def converted(
    raw: pd.DataFrame,
    clocks: tuple[Source, ...],
    sources: Mapping[str, Source],
    table: Table,
    file: str,
    guesses: Mapping[str, str],
) -> tuple[pd.DataFrame, list[Finding]]:
    """Return the columns of one file in the records' units under their canonical names, and what was guessed.

    Parameters
    ----------
    raw
        The columns as they stand in the file.
    clocks
        Columns of time.
    sources
        Which of the others is which canonical one.
    table
        What mission.yaml says of the file.
    file
        Its name.
    guesses
        Units of those columns for which neither header nor mission.yaml states one, or which the values contradict.
    """
    import numpy as np
    import pandas as pd

    from pipeline.ingest import adcp

    table, about = _zoned(clocks[0], table, file)
    seconds, told, notes = _clock(raw, clocks, table, file)
    notes += about
    out: dict[str, Any] = {"time": seconds}
    for name, source in sources.items():
        values = raw[source.column].to_numpy(dtype=np.float64)
        if name.endswith("_qc"):
            out[name] = np.nan_to_num(values, nan=9.0).astype(np.int8)
            continue
        unit = guesses[name] if name in guesses else str(source.unit)
        out[name] = convert(values, name, unit, file, source.column)
        if source.guessed:
            told.append(f"'{source.column}' is {name} in {unit}")
    out, about = _true_heading(out, sources, table, file)
    notes += about
    out, about = _without_reckoning(out, sources, file)
    notes += about
    named = {name: source.column for name, source in sources.items() if name not in PROFILER}
    if set(BEAMS) <= set(out):
        beams = [out.pop(name) for name in BEAMS]
        pressure = out.pop("profiler_pressure", np.full(len(raw), np.nan))
        measured = adcp.by_beams(np.column_stack(beams), pressure)
        out |= {str(name): measured[name].to_numpy() for name in measured}
        named["speed_through_water"] = sources[BEAMS[0]].column
    if told:
        notes.append(Finding("note", file, "", "guessed from header and range: " + ", ".join(told)))
    frame = pd.DataFrame(out)
    frame.attrs = {
        "name": file,
        "columns": {"time": clocks[0].column} | named,
    }
    return frame, notes


def _without_reckoning(
    out: dict[str, Any], sources: Mapping[str, Source], file: str
) -> tuple[dict[str, Any], list[Finding]]:
    """Return columns with those positions flagged bad that the vehicle reckoned by its own word, and how many."""
    import numpy as np

    from pipeline.records import Quality

    reckoned = np.nan_to_num(out.pop("dead_reckoning", np.zeros(out["time"].size))) > 0.0
    flags, count = {}, 0
    for name in ("latitude", "longitude"):
        if name in out:
            bad = reckoned | is_reckoned(sources[name].column)
            count = int((bad & np.isfinite(out[name])).sum())
            unflagged = np.full(bad.size, Quality.NONE, dtype=np.int8)
            flags[f"{name}_qc"] = np.where(bad, Quality.BAD, out.get(f"{name}_qc", unflagged)).astype(np.int8)
    if not count:
        return out, []
    return out | flags, [Finding("note", file, "", f"{count} positions by dead reckoning", "fixes", "flagged bad")]


def _true_heading(
    out: dict[str, Any], sources: Mapping[str, Source], table: Table, file: str
) -> tuple[dict[str, Any], list[Finding]]:
    """Return columns with a magnetic heading made true by the variation in the same file, and what was done.

    A heading is magnetic by its name, or where mission.yaml names the variation. A variation of exactly zero is what a
    glider holds before its first fix, and not used; the last one known holds until the next.
    """
    import numpy as np
    import pandas as pd

    variation = out.pop("magnetic_variation", None)
    if "heading" not in out:
        return out, []
    column = sources["heading"].column
    known = pd.Series(variation if variation is not None else [], dtype="float64")
    known = known.where((known != 0.0) & (known.abs() < np.pi)).ffill().bfill()
    place = f"column '{column}'"
    magnetic = is_magnetic(column)
    if not known.notna().any():
        found, expected = "magnetic headings and no magnetic variation", "it, to turn them true"
        return out, [Finding("warning", file, place, found, expected, "heading stays magnetic")] if magnetic else []
    typical = np.degrees(float(known.median()))
    found = f"a magnetic variation of {abs(typical):.1f}° {'E' if typical > 0 else 'W'} beside it"
    if not magnetic and "magnetic_variation" not in table.columns:
        remedy = f"taken for true; if it is magnetic, name magnetic_variation: under files: {file}: columns:"
        return out, [Finding("note", file, place, found, "true headings", f"{remedy} in mission.yaml")]
    out["heading"] = np.mod(out["heading"] + known.to_numpy(), 2 * np.pi)
    return out, [Finding("note", file, place, found, "", "magnetic headings made true")]


def _zoned(clock: Source, table: Table, file: str) -> tuple[Table, list[Finding]]:
    """Return `table` with the zone that the header of the clock names, ``Time (UTC+8)``, and what is said about it.

    A zone that mission.yaml names goes before it.
    """
    unit = clock.unit or ""
    offset = _OFFSET.fullmatch(unit.strip())
    if table.timezone != "UTC" or unit in CALENDAR or not (offset or _LETTERS.fullmatch(unit.strip())):
        return table, []
    place = f"column '{clock.column}'"
    if not offset or int(offset[3] or 0):
        remedy = f"read as UTC; name the zone: files: {{{file}: {{timezone: Asia/Kolkata}}}} in mission.yaml"
        return table, [Finding("warning", file, place, f"times in '{unit}'", "UTC, or UTC and whole hours", remedy)]
    hours = int(f"{offset[1]}{offset[2]}")
    zone = "UTC" if hours == 0 else f"Etc/GMT{-hours:+d}"
    return table.model_copy(update={"timezone": zone}), [Finding("note", file, place, f"times in {unit}")]


def _clock(
    raw: pd.DataFrame, clocks: tuple[Source, ...], table: Table, file: str
) -> tuple[Array, list[str], list[Finding]]:
    """Return the times of the rows, what was guessed about them, and what is no time.

    A date and a time of day in columns of their own are put together; else a row has the first of its times: two
    computers that share a table write into their own rows.
    """
    import numpy as np

    from pipeline.ingest import times

    if clocks[0].unit == CALENDAR[0]:
        dated = {str(clock.unit): raw[clock.column].to_numpy(dtype=np.float64) for clock in clocks}
        together = ", ".join(f"'{clock.column}'" for clock in clocks)
        return times.assembled(dated, table.timezone, file), [f"{together} are time"], []
    raw = _spelt_out(raw, [clock.column for clock in clocks])
    parts = [next((clock for clock in clocks if _reads(raw[clock.column], part)), None) for part in (_DAY, _HOUR)]
    if parts[0] is not None and parts[1] is not None:
        day, hour = parts[0].column, parts[1].column
        joined = (raw[day].str.strip() + " " + raw[hour].str.strip()).rename(day)
        unit = parts[0].unit
        unit = _with_clock(unit, raw[hour])
        seconds = _seconds(joined, unit, table, file)
        return seconds, [f"'{day}' and '{hour}' are time"], _untimed(joined, seconds, file)
    first, *others = clocks
    seconds = _seconds(raw[first.column], _with_clock(first.unit, raw[first.column]), table, file)
    told = [f"'{first.column}' is time"] if first.guessed else []
    notes = _untimed(raw[first.column], seconds, file)
    for other in others:
        absent = ~np.isfinite(seconds) & raw[other.column].notna().to_numpy()
        if absent.any() and first.guessed:
            seconds = np.where(absent, _seconds(raw[other.column], other.unit, table, file), seconds)
            told.append(f"'{other.column}' is time where '{first.column}' has none")
    return seconds, told, notes


def _spelt_out(raw: pd.DataFrame, clocks: list[str]) -> pd.DataFrame:
    """Return `raw` with a day in one number, where there is a time of day beside it, and that, as texts."""
    from pipeline.ingest import times

    days = {name: texts for name in clocks if (texts := times.days_as_text(raw[name])) is not None}
    others = [name for name in clocks if name not in days]
    hours = {name: texts for name in others if (texts := times.hours_as_text(raw[name])) is not None}
    if len(days) != 1 or not (hours or any(_reads(raw[name], _HOUR) for name in others)):
        return raw
    return raw.assign(**days, **hours)


def _with_clock(unit: str | None, column: pd.Series[Any]) -> str | None:
    """Return a format of dates with that of the time of day in the first text of `column`, where it has none."""
    from pipeline.ingest import times

    if not unit or "%" not in unit or "%H" in unit or "%I" in unit:
        return unit
    first = next((text for text in column if isinstance(text, str) and text.strip()), "").strip()
    clock = times.clock_format(first)
    return unit + (f" {clock[clock.index('%') :]}" if clock else "")


def _reads(column: pd.Series[Any], pattern: re.Pattern[str]) -> bool:
    """Return whether the first text of `column` is like `pattern`."""
    first = next((text for text in column if isinstance(text, str) and text.strip()), "")
    return bool(pattern.fullmatch(first.strip()))


def _untimed(column: pd.Series[Any], seconds: Array, file: str) -> list[Finding]:
    """Return a finding about texts that are no time."""
    import numpy as np

    wrong = ~np.isfinite(seconds) & column.notna().to_numpy()
    if not wrong.any() or column.dtype.kind == "f":
        return []
    first = str(column[wrong].iloc[0]).strip()
    if _HOUR.fullmatch(first):
        found, expected = f"times of day without a date, first '{first}'", "a date with each, or in a column beside it"
        return [Finding("warning", file, f"column '{column.name}'", found, expected, "those records are left out")]
    zone = _ABBREVIATED.search(first)
    example = f"'%Y-%m-%d %H:%M:%S {zone[1]}'}}, timezone: America/New_York" if zone else "'%d/%m/%Y %H:%M:%S'}"
    if _HALVED.search(first):
        example = "'%d/%m/%Y %I:%M:%S %p'}"
    return [
        Finding(
            "warning",
            file,
            f"column '{column.name}'",
            f"{int(wrong.sum())} of {len(column)} texts that are no time, first '{first}'",
            "ISO 8601, a date and a time of day, or the format given as unit",
            f"those records are left out; if it is another format, files: {{{file}: {{time: {{column: {column.name}, "
            f"unit: {example}}}}} in mission.yaml says which",
        )
    ]


def _seconds(column: pd.Series[Any], unit: str | None, table: Table, file: str) -> Array:
    import numpy as np
    import pandas as pd

    from pipeline.ingest import times

    name = str(column.name)
    if isinstance(column.dtype, pd.DatetimeTZDtype) or column.dtype.kind == "M":
        moments = pd.DatetimeIndex(column)
        if moments.tz is None:
            moments = moments.tz_localize(table.timezone, ambiguous="NaT", nonexistent="NaT")
        stamps = moments.tz_convert("UTC").as_unit("ns")
        return np.where(stamps.isna(), np.nan, stamps.asi8 * 1e-9)
    if column.dtype.kind != "f" and not (unit and "%" in unit):
        at_once = times.zoned(column, table.timezone, file)
        if at_once is not None:
            return at_once
    numbers = column if column.dtype.kind == "f" else pd.to_numeric(column, errors="coerce")
    if column.dtype.kind == "f" or numbers.notna().sum() > 0.5 * max(1, column.notna().sum()):
        stated = unit if times.is_unit(unit) or (unit and table.time and table.time.unit == unit) else None
        return times.numeric(numbers.to_numpy(dtype=np.float64), stated, file, name, table.timezone)
    return times.textual(column.astype("object"), unit, table.timezone, file, name)


def listed(columns: list[str]) -> str:
    """Return the first eight of `columns` for a message."""
    quoted = [f"'{column}'" for column in columns[:8]]
    return ", ".join(quoted) + (f" and {len(columns) - 8} more" if len(columns) > 8 else "")

"""Stage 1: logs to canonical records.

Which files a mission has is found out without a heavy import, so that an unchanged mission costs nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from pipeline.findings import Finding, InputError
from pipeline.mission import FILE, Mission

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.ingest.logs import Logs

#: Formats of the gliders' own computers; the other one is the plain table.
NATIVE = ("slocum", "seaglider")


@dataclass(frozen=True)
class Ingested:
    """What stage 1 hands on.

    Attributes
    ----------
    records
        The canonical table (`pipeline.records.RECORDS`).
    findings
        What was guessed, skipped, flagged or doubted.
    constants, stored
        Calibration constants of the logs, and their flight solution (`pipeline.records.STORED`) or None.
    format
        ``slocum``, ``seaglider`` or ``table``.
    """

    records: pd.DataFrame
    findings: list[Finding]
    constants: dict[str, float]
    stored: pd.DataFrame | None
    format: str


def recognise(mission: Mission) -> str:
    """Return the format of a mission's logs: as mission.yaml says, else by the files in its folder.

    Plain tables beside the files of a glider's own format are no logs unless mission.yaml names them.

    Raises
    ------
    InputError
        If there are no logs, or logs of several formats.
    """
    if mission.format != "auto":
        return mission.format
    present = _present(mission)
    tables = [path for path in present if _reader("table").recognises(path)]
    others = [path for path in present if path not in tables and path.name != FILE]
    filled = [path for path in others if path.stat().st_size or not tables]  # for an empty file no table is left out
    found = {name: [path for path in filled if _reader(name).recognises(path)] if filled else [] for name in NATIVE}
    found["table"] = tables
    native = [name for name in NATIVE if found[name]]
    formats = native + (["table"] if mission.files or (found["table"] and not native) else [])
    if len(formats) == 1:
        return formats[0]
    place = mission.folder.name or "mission"
    if not formats:
        raise _without_logs(mission, others)
    examples = ", ".join(
        f"{name} ({(found[name] or [Path(next(iter(mission.files), ''))])[0].name})" for name in formats
    )
    raise InputError(
        place,
        found=f"logs of several formats: {examples}",
        expected="one format",
        remedy=f"set format: {' or '.join(formats)} in mission.yaml",
    )


def _without_logs(mission: Mission, others: list[Path]) -> InputError:
    """Return what stops a mission of whose files, `others`, none is a log."""
    from pipeline.ingest import unread

    shown = ", ".join(path.name for path in others[:5]) + (" …" if len(others) > 5 else "")
    below = sorted(path.name for path in mission.folder.iterdir() if path.is_dir() and not path.name.startswith("."))
    found = f"no logs among {shown}" if others else "an empty folder"
    if below and not others:
        found = f"nothing but folders: {', '.join(below[:5])}" + (" …" if len(below) > 5 else "")
    remedies = dict.fromkeys(todo for path in others if (todo := unread.remedy(path)[1]))
    return InputError(
        mission.folder.name or "mission",
        found=found,
        expected="plain tables (.csv, .parquet), Slocum files (.dbd, .ebd …) or Seaglider files (p*.nc)",
        remedy="; ".join([*remedies, "put the logs beside mission.yaml"]),
    )


def _read(mission: Mission, form: str) -> Logs:
    """Return the logs; where there are none in the files of a glider's own format, tables beside them are named."""
    try:
        logs: Logs = _reader(form).read(mission)
    except InputError as error:
        tables = [] if form == "table" or mission.format != "auto" else _reader("table").files(mission.folder)
        if not tables:
            raise
        finding, names = error.finding, ", ".join(path.name for path in tables[:3])
        remedy = f"{finding.remedy}; to read the tables beside it ({names}), set format: table in mission.yaml"
        raise InputError(
            finding.file,
            finding.where,
            found=finding.found,
            expected=finding.expected,
            remedy=remedy.removeprefix("; "),
        ) from error
    return logs


def input_files(mission: Mission) -> list[Path]:
    """Return every file that the stage reads, mission.yaml first: what a change is recognised by.

    Raises
    ------
    InputError
        As `recognise`.
    """
    own = [mission.folder / FILE]
    if mission.vehicle.endswith((".yaml", ".yml")):
        own.append(mission.folder / mission.vehicle)
    logs = _logs(mission, recognise(mission))
    return [path for path in own if path.is_file()] + [path for path in logs if path not in own]


def _logs(mission: Mission, form: str) -> list[Path]:
    """Return the logs of a mission: those by their names, and of plain tables those that mission.yaml names."""
    reader = _reader(form)
    logs: list[Path] = reader.files(mission.folder)
    return sorted({*logs, *reader.named(mission)}) if form == "table" else logs


def ingest(mission: Mission) -> Ingested:
    """Return the canonical records of `mission`.

    Raises
    ------
    InputError
        If there is nothing to analyse: no logs, no pitch, no pressure, not both at a time, an impossible unit.
    """
    import numpy as np

    from pipeline.ingest import clock, fixes, merge, phases, plausibility, quality, seawater
    from pipeline.records import RECORDS, conform, timestamps

    form = recognise(mission)
    logs = _read(mission, form)
    findings = [*_left_out(mission, form), *logs.findings]
    streams = []
    for k, frame in enumerate(logs.streams):
        frame.attrs.setdefault("name", _label(frame, k))
        kept, doubts = clock.cleaned(frame, str(frame.attrs["name"]))
        streams.append(kept)
        findings += doubts
    streams, notes = clock.shifted([frame for frame in streams if len(frame)], mission.clock_offset)
    findings += notes
    streams, doubts = quality.checked(streams)
    findings += doubts
    quality.require(streams, lost=findings)
    findings += clock.overlapping(streams)
    findings += quality.surface_offset(streams)
    streams, doubts = fixes.checked(streams)
    findings += doubts
    streams, doubts = seawater.with_sea_water(mission, streams)
    findings += doubts
    place, _ = seawater.position(mission, streams)
    table, doubts = merge.merged(streams)
    findings += doubts
    table = seawater.with_depth(table, place.latitude)
    table, notes = seawater.with_borrowed_water(mission, table)
    findings += notes
    if "heading" in table:
        table = table.assign(heading=np.mod(table["heading"], 2 * np.pi))
    attitude = _source(streams, "pitch")
    plausibility.require(table, _source(streams, "pressure"), attitude)
    vouched = "buoyancy_volume" in table and _source(streams, "buoyancy_volume")["file"] == attitude["file"]
    turned = mission.pitch.scale < 0
    if not turned:
        table, notes = plausibility.with_pitch_checked(table, attitude, vouched=vouched)
        findings += notes
    table, notes = merge.with_pitch_correction(table, mission.pitch)
    findings += notes
    if turned:
        table, notes = plausibility.with_pitch_checked(table, attitude, vouched=False)
        findings += notes
    if "buoyancy_volume" in table:
        table, doubts = plausibility.with_engine_checked(table, _source(streams, "buoyancy_volume"))
        findings += doubts
    table = phases.with_phases(table, block_s=mission.block_s, minimum_block_s=mission.minimum_block_s)
    table, notes = merge.selected(table, mission.dives)
    findings += [*notes, *phases.sampled_seldom(table)]
    findings += clock.pausing(table["time"].to_numpy(dtype=np.float64))
    if not (table["block"] >= 0).any():
        findings.append(
            Finding(
                "warning",
                "mission",
                "phases",
                "no steady flight",
                f"at least {mission.minimum_block_s:g} s at one pitch, engine volume and propeller speed",
                "nothing can be compared with theory; where dives are short, set minimum_block_s: in mission.yaml",
            )
        )
    records = conform(table.assign(time=timestamps(table["time"].to_numpy())), RECORDS)
    return Ingested(records, findings, logs.constants, _solution(logs.stored), form)


def _solution(stored: pd.DataFrame | None) -> pd.DataFrame | None:
    """Return a stored flight solution as the table `records.STORED`, in time order."""
    from pipeline.ingest.clock import EARLIEST, LATEST
    from pipeline.records import STORED, conform, timestamps

    if stored is None:
        return None
    possible = stored["time"].between(EARLIEST, LATEST, inclusive="left")
    ordered = stored[possible].sort_values("time", kind="stable")
    return conform(ordered.assign(time=timestamps(ordered["time"].to_numpy())), STORED)


def _reader(form: str) -> ModuleType:
    """Return the reader of a format; imported only when asked for."""
    from importlib import import_module

    return import_module(f"pipeline.ingest.{form}")


def _present(mission: Mission) -> list[Path]:
    return sorted(path for path in mission.folder.iterdir() if path.is_file() and not path.name.startswith("."))


def _left_out(mission: Mission, form: str) -> list[Finding]:
    """Return what is said about files beside the logs: plain tables beside those of another format, and all others."""
    from pipeline.ingest import unread

    read = set(_logs(mission, form))
    tables = set() if form == "table" else set(_reader("table").files(mission.folder)) - read
    truth = mission.folder / _reader("table").TRUTH
    findings = unread.told([path for path in _present(mission) if path not in read | tables | {truth}])
    readers = [_reader(name) for name in (*NATIVE, "table")]
    findings += unread.out_of_reach(
        mission.folder, lambda path: path.is_file() and any(reader.recognises(path) for reader in readers)
    )
    if tables:
        names = unread.listed(sorted(path.name for path in tables))
        findings.append(Finding("note", names, "", f"plain tables beside {form} files", "", "not read"))
    return findings


def _label(frame: pd.DataFrame, k: int) -> str:
    """Return a name for a stream whose reader gave it none: by what it carries."""
    if "conductivity" in frame:
        return "CTD"
    if "pitch" in frame:
        return "attitude"
    return "GPS" if "latitude" in frame else f"stream {k + 1}"


def _source(streams: list[pd.DataFrame], name: str) -> dict[str, str]:
    """Return file and column that `name` comes from, for messages."""
    carriers = [frame for frame in streams if name in frame]
    carriers = [frame for frame in carriers if frame[name].notna().any()] or carriers
    best = max(
        carriers, key=lambda frame: ("conductivity" in frame) if name == "pressure" else int(frame[name].count())
    )
    return {"file": str(best.attrs["name"]), "column": str(best.attrs.get("columns", {}).get(name, name))}

"""The check before a run: what of each mission would be read, what is missing, what looks wrong; nothing is written."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pipeline import mission as missions
from pipeline.findings import Finding, in_one_line
from pipeline.records import MEASURED, Column, usable
from pipeline.roster import Job, inputs, resolve_vehicle

if TYPE_CHECKING:
    import pandas as pd

#: What the analysis loses without an instrument.
NEEDED_FOR = {
    "temperature": "in-situ density, and with it net buoyancy",
    "conductivity": "in-situ density, and with it net buoyancy",
    "buoyancy_volume": "net buoyancy, and with it every prediction of speed",
    "battery_position": "the trim in moment balance",
    "heading": "speed from GPS fixes",
    "latitude": "speed from GPS fixes, depth and salinity at the right place",
    "speed_through_water": "an independent check of the speed",
}

#: Units for people, with the factor from the unit of the records.
READABLE = {"rad": ("deg", 57.29577951308232), "m3": ("cm3", 1e6), "rev/s": ("rpm", 60.0)}


@dataclass(frozen=True)
class Checked:
    """What would be read of one mission."""

    mission: str
    error: str = ""
    format: str = ""
    start: str = ""
    end: str = ""
    dives: int = 0
    files: list[str] = field(default_factory=list)
    not_read: list[str] = field(default_factory=list)
    instruments: list[dict[str, Any]] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)
    findings: list[dict[str, str]] = field(default_factory=list)


def check(job: Job) -> Checked:
    """Return what would be read of a mission, by reading it without writing anything."""
    from pipeline.ingest import ingest

    try:
        mission = missions.load(job.folder)
        files, beside = inputs(mission)
        result = ingest(mission)
        vehicle = resolve_vehicle(mission, result.constants)
    except Exception as error:
        return Checked(job.name, error=str(in_one_line(error, "ingest", "please report it")))
    records = result.records
    instruments = [row for column in MEASURED if (row := _instrument(records, column))]
    seen = {row["name"] for row in instruments}
    needed = dict(NEEDED_FOR)
    if vehicle.propeller is not None:
        needed["propeller_speed"] = "thrust, and with it every prediction of powered flight"
    span = [str(records["time"].iloc[end].floor("s").isoformat()) for end in (0, -1)] if len(records) else ["", ""]
    return Checked(
        job.name,
        format=result.format,
        start=span[0],
        end=span[1],
        dives=int(records.loc[records["dive"] > 0, "dive"].nunique()),
        files=list(files),
        not_read=beside,
        instruments=instruments,
        missing={name: purpose for name, purpose in needed.items() if name not in seen},
        findings=[finding.as_dict() for finding in result.findings],
    )


def _instrument(records: pd.DataFrame, column: Column) -> dict[str, Any] | None:
    """Return number, interval and range of the usable values of `column`, None if there are none."""
    good = usable(records, column.name)
    if not good.any():
        return None
    unit, factor = READABLE.get(column.unit, (column.unit, 1.0))
    values = records.loc[good, column.name] * factor
    intervals = records.loc[good, "time"].diff().dt.total_seconds()
    return {
        "name": column.name,
        "unit": unit,
        "values": int(good.sum()),
        "doubted": int(records[column.name].notna().sum() - good.sum()),
        "interval_s": round(float(intervals.median()), 3) if good.sum() > 1 else None,
        "minimum": float(values.min()),
        "maximum": float(values.max()),
    }


def lines(checked: Checked) -> list[str]:
    """Return the check of one mission as text."""
    if checked.error:
        return [f"{checked.mission}: would fail: {checked.error}"]
    head = f"{checked.mission}: {checked.format}, {checked.start} to {checked.end}, {checked.dives} dives"
    text = [head, f"  read      {len(checked.files)} files: {_shortened(checked.files)}"]
    if checked.not_read:
        text.append(f"  not read  {len(checked.not_read)} files: {_shortened(checked.not_read)}")
    for row in checked.instruments:
        every = f", every {row['interval_s']:g} s" if row["interval_s"] is not None else ""
        doubted = f", {row['doubted']} doubted" if row["doubted"] else ""
        span = f"{row['minimum']:.6g} to {row['maximum']:.6g} {row['unit']}"
        text.append(f"  has       {row['name']}: {row['values']} values{every}{doubted}, {span}")
    text += [f"  lacks     {name}: needed for {purpose}" for name, purpose in checked.missing.items()]
    text += [f"  {finding['severity']:8s}  {Finding(**finding)}" for finding in checked.findings]  # type: ignore[arg-type]
    return text


def _shortened(names: list[str], most: int = 4) -> str:
    return ", ".join(names if len(names) <= most else [*names[: most - 1], "…", names[-1]])

"""The roster: which missions a folder holds, under which names, and with which vehicles."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pipeline import mission as missions
from pipeline import vehicle as vehicles
from pipeline.conventions import from_seaglider
from pipeline.findings import Finding, InputError, nearest
from pipeline.report.figures import files

if TYPE_CHECKING:
    from pipeline.mission import Mission
    from pipeline.vehicle import Vehicle

Engine = Literal["numba", "filterpy"]

#: What is filed under reports/; all else is under processed/.
REPORTED = ("summary.json", "report.html", "vehicle.yaml", "coefficients.txt", *files.NAMES)
#: The stages in their order, and what each may write.
OUTPUTS: dict[str, tuple[str, ...]] = {
    "ingest": ("records.parquet", "stored.parquet", "ingest.json"),
    "estimate": ("estimates.parquet", "blocks.parquet", "estimate.json"),
    "model": ("predictions.parquet",),
    "report": (*REPORTED, "estimates.nc"),
}
STAGES = tuple(OUTPUTS)
#: What mission.yaml is misspelt as.
_MISNAMED = ("mission.yml", "Mission.yaml", "mission.yaml.txt")


@dataclass(frozen=True)
class Job:
    """One mission to be analysed: where its logs are, where its results and its report go, and on how many threads."""

    folder: Path
    name: str
    results: Path
    reports: Path
    engine: Engine = "numba"
    threads: int = 1

    def path(self, output: str) -> Path:
        """Return where the file `output` of any stage is kept."""
        return (self.reports if output in REPORTED else self.results) / output


@dataclass(frozen=True)
class Outcome:
    """How a mission ended: the stages that were run, and the line that says why it failed, if it did."""

    name: str
    ran: tuple[str, ...] = ()
    error: str = ""

    def __str__(self) -> str:
        if self.error:
            return f"{self.name}: failed: {self.error}"
        return f"{self.name}: {', '.join(self.ran) or 'unchanged'}"


@dataclass(frozen=True)
class Plan:
    """What a folder of missions holds."""

    jobs: list[Job] = field(default_factory=list)
    failed: list[Outcome] = field(default_factory=list)
    strangers: list[Finding] = field(default_factory=list)


def plan(raw: Path, processed: Path, reports: Path, engine: Engine = "numba") -> Plan:
    """Return the missions in `raw`: the folders in it that have a mission.yaml, or `raw` itself if it has one.

    Raises
    ------
    InputError
        If `raw` is no folder, or holds no mission.
    """
    if not raw.is_dir():
        raise InputError(
            str(raw), found="a file" if raw.exists() else "no such folder", expected="a folder of missions"
        )
    found, empty, strangers = _folders(raw)
    if not found:
        raise InputError(
            str(raw),
            found="no mission" if not strangers else f"no mission.yaml in {', '.join(s.file for s in strangers)}",
            expected="folders of logs, each with a mission.yaml",
            remedy="the smallest useful mission.yaml is 'vehicle: slocum-g2'",
        )
    jobs: list[Job] = []
    failed = [Outcome(folder.name, error=str(_nothing_in(folder))) for folder in empty]
    for folder in found:
        try:
            mission = missions.load(folder)
            resolve_vehicle(mission, {})
            name = _name(mission)
        except InputError as refused:
            failed.append(Outcome(folder.name, error=str(refused)))
        else:
            jobs.append(Job(folder, name, processed / name, reports / name, engine))
    unique: list[Job] = []
    for job in jobs:
        twins = [other.folder for other in jobs if other.name.casefold() == job.name.casefold()]
        if len(twins) == 1:
            unique.append(job)
        else:
            places = " and ".join(f"{twin.parent.name}/{twin.name}" for twin in twins)
            error = InputError(
                missions.FILE,
                "name",
                found=f"'{job.name}' in {places}",
                expected="one name per mission",
                remedy="set another 'name' in one of them",
            )
            failed.append(Outcome(job.name, error=str(error)))
    return Plan(unique, failed, strangers)


def _folders(raw: Path) -> tuple[list[Path], list[Path], list[Finding]]:
    """Return the mission folders in `raw`, the empty ones, and those of files without a mission.yaml."""
    raw = raw if raw.name not in ("", "..") else raw.resolve()
    if (raw / missions.FILE).is_file():
        return [raw], [], []
    found, empty, strangers = [], [], []
    for folder in sorted(path for path in raw.iterdir() if path.is_dir() and not path.name.startswith(".")):
        if (folder / missions.FILE).is_file():
            found.append(folder)
        elif any(folder.iterdir()):
            other = next((name for name in _MISNAMED if (folder / name).is_file()), "")
            strangers.append(
                Finding(
                    "warning",
                    f"{raw.name}/{folder.name}",
                    "",
                    "no mission.yaml",
                    "one in every folder of logs",
                    f"not analysed; rename {other} to {missions.FILE}"
                    if other
                    else "not analysed; the smallest useful one is 'vehicle: slocum-g2'",
                )
            )
        else:
            empty.append(folder)
    return found, empty, strangers


def _nothing_in(folder: Path) -> InputError:
    return InputError(
        f"{folder.parent.name}/{folder.name}",
        found="an empty folder",
        expected=f"logs and a {missions.FILE}",
        remedy="put them there, or remove the folder",
    )


def _name(mission: Mission) -> str:
    """Return the name under which results are filed, if it can be one of a folder."""
    name = mission.slug
    if name.startswith(".") or "/" in name or "\\" in name or name == "provenance.json" or name.startswith("index."):
        raise InputError(
            f"{mission.folder.name}/{missions.FILE}", "name", found=f"'{name}'", expected="a folder's name"
        )
    return name


def inputs(mission: Mission) -> tuple[dict[str, Path], list[str]]:
    """Return the files that are read of a mission, by their place relative to its folder, and the names of the others.

    mission.yaml and a vehicle file beside it are in neither.
    """
    from pipeline.ingest import input_files

    folder = mission.folder
    files = {Path(os.path.relpath(path, folder)).as_posix(): path for path in input_files(mission)}
    own = {missions.FILE, mission.vehicle}
    logs = {name: path for name, path in files.items() if name not in own}
    there = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    return logs, sorted(there - set(files) - own)


def resolve_vehicle(mission: Mission, constants: Mapping[str, float]) -> Vehicle:
    """Return the vehicle of `mission`, with the mass kept in its logs and the overrides of mission.yaml.

    The polar and the compressibility kept in Seaglider logs are results of a fit, and stay out of it.

    Raises
    ------
    InputError
        If the vehicle or a coefficient is unknown.
    """
    vehicle = vehicles.load(mission.vehicle, mission.folder)
    measured = {name: constants[name] for name in ("mass", "therm_expan", "temp_ref") if name in constants}
    if measured:
        vehicle = from_seaglider(vehicle, measured, source="calibration constants kept in the logs")
    for name in mission.coefficients:
        if name not in vehicles.KNOWN:
            raise InputError(
                missions.FILE,
                f"coefficients.{name}",
                found="an unknown coefficient",
                remedy=nearest(name, list(vehicles.KNOWN)),
            )
        vehicles.check_value(name, mission.coefficients[name], missions.FILE)
    return vehicle.with_values(mission.coefficients, source=missions.FILE)

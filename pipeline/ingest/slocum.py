"""Slocum gliders: flight and science files of one mission, each on its own clock.

Names, units and signs are those of the glider's ``masterdata``: angles in rad, pressure in bar, conductivity in S/m,
engine in cc, battery in inches and V, pitch nose up, roll positive with the port wing up. ``m_heading`` is magnetic;
``m_gps_mag_var`` is positive west, magnetic = true + variation. The glider's depth rate is not read.
"""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.findings import Finding, InputError
from pipeline.geodesy import typical_latitude
from pipeline.ingest import dinkum, seawater
from pipeline.ingest.logs import Logs, UnreadableError, gather, of_one
from pipeline.mission import Mission

_NAME = re.compile(r"\.(?P<kind>[dsmnet])(?P<compressed>[bc])d$", re.IGNORECASE)
_CACHE = re.compile(r"^[0-9a-f]{1,8}\.c[ac]c$", re.IGNORECASE)
_FOLDERS = ("cac", "cache")
_ASCII = b"DBD_ASC"
#: Kinds of file, fullest first, and the kinds that the science computer writes.
_FULLNESS = "demnst"
_SCIENCE = "ent"

_ENGINES = ("m_ballast_pumped", "m_de_oil_vol")
_FLIGHT = (
    *("m_pitch", "m_roll", "m_heading", "m_gps_mag_var", "m_pressure", "m_depth", *_ENGINES, "m_battpos", "m_battroll"),
    *("m_thruster_power", "m_thruster_speed", "m_battery", "m_gps_lat", "m_gps_lon", "m_gps_status"),
)
_STAMPS = ("sci_ctd41cp_timestamp", "sci_rbrctd_timestamp")
_WATER = ("sci_water_pressure", "sci_water_temp", "sci_water_cond")
#: The same of an RBR CTD whose values are not in those, with factor and offset to their units: sea pressure [dbar],
#: else absolute pressure [dbar], [°C], [mS/cm].
_RBR = (
    ("sci_water_pressure", "sci_rbrctd_seapressure_00", 0.1, 0.0),
    ("sci_water_pressure", "sci_rbrctd_pressure_00", 0.1, -1.01325),
    ("sci_water_temp", "sci_rbrctd_temperature_00", 1.0, 0.0),
    ("sci_water_cond", "sci_rbrctd_conductivity_00", 0.1, 0.0),
)
#: A CTD's own time stamp precedes the science computer's by less than this [s].
_LAG = 5.0

BAR = 10.0
INCH = 0.0254
CUBIC_CENTIMETRE = 1e-6


def recognises(path: Path) -> bool:
    """Return whether `path` is a Slocum data file by its extension, or by its first bytes if it has another."""
    if not path.is_file():
        return False
    return bool(_NAME.search(path.name)) or _begins_like_slocum(path)


def files(folder: Path) -> list[Path]:
    """Return the data files in `folder` and the cache files in it and in its folders ``cac`` and ``cache``, sorted."""
    here = sorted(folder.iterdir())
    caches = [path for path in here if _CACHE.match(path.name)]
    for below in here:
        if below.is_dir() and below.name.lower() in _FOLDERS:
            caches += [path for path in sorted(below.iterdir()) if _CACHE.match(path.name)]
    return sorted([path for path in here if recognises(path)] + caches)


def read(mission: Mission) -> Logs:
    """Return the logs of a Slocum mission: a stream of the flight computer and one of the CTD.

    The first record of a file repeats old values and is left out. Where a segment is there in several versions
    (.dbd, .mbd, .sbd) the fullest one that can be read is used. Positions are fixes only. Depth is turned into
    pressure where no pressure was logged.

    Raises
    ------
    InputError
        If dbdreader is not installed, no file can be read, or none has pitch.
    """
    dinkum.require()
    segments = _Segments(mission.folder)
    if not segments.flight and not segments.science:
        if not segments.findings:
            raise InputError(mission.folder.name, found="no Slocum file", expected=".dbd, .ebd, .sbd, .tbd …")
        raise _unreadable(mission, segments.findings)
    findings = list(segments.findings)
    findings += of_one(mission.folder.name, segments.gliders)
    frames = _ordered(segments.flight)
    flight = pd.concat(frames, ignore_index=True) if frames else pd.DataFrame({"time": []})
    if "m_pitch" not in flight or not flight["m_pitch"].notna().any():
        raise _without_pitch(mission, segments.findings)
    ctd, about_ctd = _ctd(segments.science)
    stream, about_flight = _flight(flight, alone="pressure" not in ctd)
    findings += about_ctd + about_flight
    if len(ctd) and "pressure" not in ctd and "pressure" in stream:
        ctd, lent = _with_pressure_lent(ctd, stream)
        findings.append(lent)
    stream.attrs, ctd.attrs = {"name": "flight"}, {"name": "CTD"}
    return Logs(streams=[frame for frame in (stream, ctd) if len(frame)], findings=gather(findings))


def _unreadable(mission: Mission, findings: list[Finding]) -> InputError:
    """Return what stops a mission of which no file can be read, with the reason of the first."""
    lost = [finding for finding in findings if finding.severity == "error"]
    found = f"{len(lost)} Slocum file{'s' if len(lost) > 1 else ''}, none of them readable"
    return InputError(mission.folder.name, found=found, remedy=str(lost[0]))


def _without_pitch(mission: Mission, findings: list[Finding]) -> InputError:
    """Return what stops a mission without pitch, with the reason why the first file was lost, if one was."""
    lost = [str(finding) for finding in findings if finding.severity == "error"]
    return InputError(
        mission.folder.name,
        found="no pitch",
        expected="m_pitch in a flight file (.dbd, .mbd, .sbd)",
        remedy="; ".join(lost[:1]) or "add the flight files, or m_pitch to the glider's sbdlist.dat",
    )


@dataclass
class _Segments:
    """The readable segments of a folder: one frame of sensors each."""

    folder: Path
    flight: list[pd.DataFrame] = field(default_factory=list)
    science: list[pd.DataFrame] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    gliders: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        found = files(self.folder)
        caches = [path for path in found if _CACHE.match(path.name)]
        versions: dict[tuple[str, bool], list[Path]] = {}
        for path in found:
            if path not in caches:
                versions.setdefault((path.stem, _kind(path) in _SCIENCE), []).append(path)
        with tempfile.TemporaryDirectory(prefix="seatrial-") as name:
            scratch = Path(name)
            self._lay_out(caches, scratch)
            for (_, science), paths in versions.items():
                frame = self._fullest(sorted(paths, key=_fullness), scratch, science)
                if frame is not None:
                    (self.science if science else self.flight).append(frame)

    def _lay_out(self, caches: list[Path], scratch: Path) -> None:
        """Put the cache files into `scratch` under lower-case names, decompressed; nothing is written elsewhere."""
        from dbdreader.decompress import Decompressor

        for path in sorted(caches, key=lambda path: path.suffix.lower() != ".cac"):
            target = scratch / f"{path.stem.lower()}.cac"
            if target.exists():
                continue
            if path.suffix.lower() == ".cac":
                target.symlink_to(path.resolve())
                continue
            try:
                with Decompressor(str(path)) as file:
                    target.write_bytes(file.decompress())
            except Exception:  # lz4 raises several types that are not public
                self._say("warning", path, "", "a cache file that cannot be decompressed", "LZ4", "copy it again")

    def _fullest(self, paths: list[Path], scratch: Path, science: bool) -> pd.DataFrame | None:
        """Return the sensors of the first of `paths`, versions of one segment, that can be read."""
        wanted = (*_WATER, *(sensor for _, sensor, *_ in _RBR), *_STAMPS) if science else _FLIGHT
        for index, path in enumerate(paths):
            try:
                sensors = dinkum.read(path, scratch, wanted)
            except UnreadableError as error:
                self._say("error", path, "", error.found, error.expected, error.remedy)
                continue
            for other in paths[index + 1 :]:
                self._say("note", other, "", "another version of a segment", "", "the fullest one is used")
            self._doubt(path, sensors, science)
            self.gliders |= {sensors.glider} - {""}
            return sensors.frame
        return None

    def _doubt(self, path: Path, sensors: dinkum.Sensors, science: bool) -> None:
        if sensors.damage:
            found = f"{sensors.damage} after {sensors.records} intact ones"
            self._say("warning", path, sensors.where, found, "", "the rest of the file is left out")
        if sensors.impossible:
            found = f"{sensors.impossible} record{'s' if sensors.impossible > 1 else ''} with an impossible time"
            self._say("warning", path, "", found, "1990 to 2100", "left out")
        if not science and "m_pitch" not in sensors.frame:
            self._say("warning", path, "", "no m_pitch", "m_pitch in a flight file", "its other sensors are used")

    def _say(self, severity: str, path: Path, where: str, found: str, expected: str, remedy: str) -> None:
        file = path.relative_to(self.folder).as_posix()
        self.findings.append(Finding(severity, file, where, found, expected, remedy))  # type: ignore[arg-type]


def _begins_like_slocum(path: Path) -> bool:
    """Return whether the label stands in the first bytes, as it does in clear in the first literals of an LZ4 block.

    A file made text by ``dbd2asc`` has a label of its own, and is a plain table.
    """
    try:
        with path.open("rb") as file:
            begin = file.read(32)
            return dinkum.LABEL in begin and _ASCII not in begin
    except OSError:
        return False


def _kind(path: Path) -> str:
    """Return the letter of the kind of file: from the extension, or from the header of a file that was renamed."""
    match = _NAME.search(path.name)
    if match:
        return match["kind"].lower()
    with path.open("rb") as file:
        inside = re.search(rb"filename_extension:\s*([dsmnet])[bc]d", file.read(512), re.IGNORECASE)
    return inside[1].decode().lower() if inside else "d"


def _fullness(path: Path) -> tuple[int, bool, str]:
    return _FULLNESS.index(_kind(path)), path.suffix[2:3].lower() == "c", path.name


def _ordered(frames: list[pd.DataFrame]) -> list[pd.DataFrame]:
    """Return the frames that have rows, by their first time; inside a frame the order stays as written."""
    return sorted((frame for frame in frames if len(frame)), key=lambda frame: float(frame["time"].iloc[0]))


def _flight(flight: pd.DataFrame, *, alone: bool) -> tuple[pd.DataFrame, list[Finding]]:
    """Return the stream of the flight computer in SI units, and what is doubtful about it; `alone`: without a CTD's."""
    findings: list[Finding] = []
    out = pd.DataFrame({"time": flight["time"], "pitch": flight["m_pitch"]})
    for name, sensor, factor in (
        ("roll", "m_roll", 1.0),
        ("battery_position", "m_battpos", INCH),
        ("battery_roll", "m_battroll", 1.0),
        ("propeller_power", "m_thruster_power", 1.0),
        ("battery_voltage", "m_battery", 1.0),
    ):
        if sensor in flight:
            out[name] = flight[sensor] * factor
    if "m_heading" in flight:
        out["heading"], doubt = _true_heading(flight)
        findings += doubt
    engine = _active_engine(flight)
    if engine:
        out["buoyancy_volume"] = flight[engine] * CUBIC_CENTIMETRE
        findings.append(Finding("note", "buoyancy engine", "", f"{engine} [cc] in use"))
    if "m_thruster_speed" in flight and (flight["m_thruster_speed"] > 0).any():
        out["propeller_speed"] = flight["m_thruster_speed"] / 60.0
    if {"m_gps_lat", "m_gps_lon"} <= set(flight):
        fix = _fixes(flight)
        out["latitude"] = flight["m_gps_lat"].where(fix)
        out["longitude"] = flight["m_gps_lon"].where(fix)
    pressure, used = _pressure(flight)
    if used:
        out["pressure"] = pressure
    if alone:
        found, expected = "no pressure of a CTD", "sci_water_pressure"
        without = Finding("error", "pressure", "", "neither sci_water_pressure nor m_pressure", "one of them")
        findings.append(Finding("note", "pressure", "", found, expected, f"{used} is used") if used else without)
    measured = out.columns.drop("time")
    return out.loc[out[measured].notna().any(axis=1)].reset_index(drop=True), findings


def _pressure(flight: pd.DataFrame) -> tuple[pd.Series, str]:
    """Return the flight computer's pressure [dbar], and what it is of: of depth where no pressure was logged."""
    for sensor in ("m_pressure", "m_depth"):
        if sensor in flight and flight[sensor].notna().any():
            if sensor == "m_pressure":
                return flight[sensor] * BAR, sensor
            latitude = typical_latitude(flight.get("m_gps_lat"))
            return pd.Series(seawater.pressure(flight[sensor].to_numpy(), latitude), index=flight.index), sensor
    return pd.Series(dtype="float64"), ""


def _true_heading(flight: pd.DataFrame) -> tuple[pd.Series, list[Finding]]:
    """Return true heading [rad], 0 to 2 pi: magnetic heading minus the variation the GPS last gave (west positive).

    A variation of exactly zero is what the glider holds before its first fix, and not used.
    """
    variation = pd.Series(np.nan, index=flight.index)
    if "m_gps_mag_var" in flight:
        size = flight["m_gps_mag_var"].abs()
        variation = flight["m_gps_mag_var"].where((size > 0.0) & (size < np.pi))
    if not variation.notna().any():
        found, expected = "no magnetic variation (m_gps_mag_var)", "it, to turn m_heading true"
        finding = Finding("warning", "heading", "", found, expected, "heading stays magnetic")
        return flight["m_heading"] % (2 * np.pi), [finding]
    typical = np.degrees(float(variation.median()))
    found = f"magnetic headings, variation {abs(typical):.1f}° {'W' if typical > 0 else 'E'}"
    return (
        (flight["m_heading"] - variation.ffill().bfill()) % (2 * np.pi),
        [Finding("note", "heading", "", found, "", "made true")],
    )


def _active_engine(flight: pd.DataFrame) -> str:
    """Return the sensor of the buoyancy engine that moved most, shallow or deep; empty where neither reported."""
    spans = {
        name: float(flight[name].max() - flight[name].min())
        for name in _ENGINES
        if name in flight and flight[name].notna().any()
    }
    return max(spans, key=lambda name: spans[name], default="")


def _fixes(flight: pd.DataFrame) -> pd.Series:
    """Return where a new fix came: a position on Earth, not marked invalid, other than the last one kept."""
    latitude, longitude = flight["m_gps_lat"], flight["m_gps_lon"]
    fix = (latitude.abs() <= 90.0) & (longitude.abs() <= 180.0)
    if "m_gps_status" in flight:
        fix &= flight["m_gps_status"].isna() | (flight["m_gps_status"] == 0)
    positions = pd.DataFrame({"latitude": latitude[fix], "longitude": longitude[fix]})
    fresh = positions.diff().ne(0.0).any(axis=1)
    fix[fix] = fresh.to_numpy()
    return fix


def _ctd(science: list[pd.DataFrame]) -> tuple[pd.DataFrame, list[Finding]]:
    """Return the stream of the CTD in SI units, and what is doubtful about it."""
    samples, stale, own, rbr = [], 0, 0, set[str]()
    for frame in _ordered(science):
        filled, taken = _with_rbr(frame)
        kept, lost, stamped = _samples(filled)
        rbr |= taken
        samples.append(kept)
        stale += lost
        own += stamped
    if not samples:
        return pd.DataFrame({"time": []}), []
    water = pd.concat(samples, ignore_index=True)
    out = pd.DataFrame({"time": water["time"]})
    for name, sensor, factor in zip(("pressure", "temperature", "conductivity"), _WATER, (BAR, 1.0, 1.0), strict=True):
        if sensor in water and water[sensor].notna().any():
            out[name] = water[sensor] * factor
    findings = []
    if rbr:
        findings.append(Finding("note", "CTD", "", f"an RBR CTD: {', '.join(sorted(rbr))}", "", "in use"))
    if own < len(samples):
        found = f"no time stamps of the CTD in {len(samples) - own} of {len(samples)} files"
        findings.append(Finding("note", "CTD", "", found, "", "the science computer's times are used"))
    if stale:
        found = f"{stale} sample{'s' if stale > 1 else ''} repeated or without a measurement"
        findings.append(Finding("note", "CTD", "", found, "", "left out"))
    return out, findings


def _with_pressure_lent(ctd: pd.DataFrame, flight: pd.DataFrame) -> tuple[pd.DataFrame, Finding]:
    """Return a CTD without pressure with that of the flight computer at its instants, and a finding that says so."""
    known = flight[["time", "pressure"]].dropna().sort_values("time")
    lent = np.interp(ctd["time"], known["time"], known["pressure"], left=np.nan, right=np.nan)
    used = "pressure interpolated to its instants serves salinity and density, never depth"
    return ctd.assign(pressure_interpolated=lent), Finding("note", "CTD", "", "a CTD without pressure", "", used)


def _with_rbr(frame: pd.DataFrame) -> tuple[pd.DataFrame, set[str]]:
    """Return `frame` with what an RBR CTD measured in the place and units of what is missing or zero, and its names."""
    changed, taken = {}, set()
    for name, sensor, factor, offset in _RBR:
        silent = name not in changed and (name not in frame or not (frame[name].fillna(0.0) != 0.0).any())
        if silent and sensor in frame and (frame[sensor].fillna(0.0) != 0.0).any():
            changed[name] = frame[sensor] * factor + offset
            taken.add(sensor)
    return frame.assign(**changed), taken


def _samples(frame: pd.DataFrame) -> tuple[pd.DataFrame, int, bool]:
    """Return the rows in which the CTD reported, how many were stale, and whether they are on the CTD's own clock.

    The CTD's time stamp is taken where it runs with the science computer's; a row whose stamp does not is old
    memory, and so is a row that repeats a stamp or in which all is zero.
    """
    water = [name for name in _WATER if name in frame]
    rows = frame.loc[frame[water].notna().any(axis=1)]
    fresh = ~(rows[water].fillna(0.0) == 0.0).all(axis=1)
    stamped = False
    for name in _STAMPS:
        if name not in rows or not rows[name].notna().any():
            continue
        near = (rows["time"] - rows[name]).abs() < _LAG
        if near.sum() > 0.5 * len(rows):
            fresh &= near & rows[name].diff().ne(0.0)
            rows = rows.assign(time=rows[name])
            stamped = True
            break
    return rows.loc[fresh, ["time", *water]], int((~fresh).sum()), stamped

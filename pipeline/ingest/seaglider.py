"""Seagliders: the per-dive files pSSSDDDD.nc of the basestation, or its text files, each instrument on its own clock.

Four things in these files look like measurements and are none, and are not read as such:

- ``density_insitu``: in files of basestation 3 it is referenced to the surface (1027.45 where 1031.96 kg/m³ is right
  at 1000 m), and ``buoyancy`` and ``speed`` inherit the error; density is computed from S, T and p later;
- ``ctd_pressure`` of a CTD without a pressure sensor: it is the vehicle's pressure, interpolated to the CTD's
  instants and shifted by the lever arm between the sensors at the pitch of the moment. The vehicle's own ``pressure``
  is the measurement; the other serves salinity and density alone;
- ``ad2cp_inv_*``: an inverse solution that leans on the flight model;
- ``gc_pitch_volts``, ``gc_roll_volts``, ``gc_vbd_volts``: the supply under the current of a motor that moves, 2 V apart
  from motor to motor, and 30 where it did not; one number a dive (``log_MINV_24V``) is no series. No battery voltage.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gsw
import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.findings import Finding, InputError, Severity
from pipeline.geodesy import typical_latitude
from pipeline.ingest import adcp, basestation, netcdf, seawater
from pipeline.ingest.logs import Logs, UnreadableError, gather, of_one
from pipeline.ingest.merge import covers
from pipeline.ingest.table import SEAGLIDER
from pipeline.mission import Mission
from pipeline.records import Quality

Array = npt.NDArray[np.float64]

_NAME = re.compile(SEAGLIDER, re.IGNORECASE)
_CONSTANTS = (
    "hd_a",
    "hd_b",
    "hd_c",
    "hd_s",
    "glider_length",
    "mass",
    "abs_compress",
    "therm_expan",
    "temp_ref",
    "rho0",
)
_OWN_PRESSURE = r"(?:legato|gpctd|rbr\w*)_pressure"
_WANTED = re.compile(
    r"time|pressure|depth|ctd_time|ctd_pressure(_qc)?|ctd_depth|magnetic_variation|log_MAGVAR|log_gps_magvar"
    r"|(temperature|conductivity|salinity)(_qc)?|speed|vert_speed|eng_(pitchAng|rollAng|head|vbdCC|pitchCtl)"
    r"|gc_(st|end)_secs|gc_(pitch|vbd)_ad(_start)?|log_(C_PITCH|PITCH_CNV|C_VBD|VBD_MIN|VBD_CNV|MASS)"
    r"|log_gps_(time|lat|lon|qc)|ad2cp_(time|pressure|vel[XYZ])"
    rf"|sg_cal_({'|'.join(_CONSTANTS)}|volmax|vbdbias)|{_OWN_PRESSURE}",
    re.IGNORECASE,
)

#: Basestation flag -> OG1; its 5 is "changed", 6 "not sampled", 8 "interpolated", which is no measurement.
_FLAGS = {
    0: Quality.NONE,
    1: Quality.GOOD,
    2: Quality.PROBABLY_GOOD,
    3: Quality.PROBABLY_BAD,
    4: Quality.BAD,
    5: Quality.PROBABLY_GOOD,
    6: Quality.MISSING,
    8: Quality.PROBABLY_BAD,
}
CENTIMETRE = 0.01
CUBIC_CENTIMETRE = 1e-6


def recognises(path: Path) -> bool:
    """Return whether `path` is named like a per-dive file of the basestation."""
    return path.is_file() and bool(_NAME.fullmatch(path.name) or basestation.NAME.fullmatch(path.name))


def files(folder: Path) -> list[Path]:
    """Return the per-dive files in `folder`, sorted: netCDF, and text of the dives that have none."""
    return sorted({part for path in _dives(folder) for part in (_parts(path))})


def _dives(folder: Path) -> list[Path]:
    """Return the files that are a dive each."""
    paths = sorted(path for path in folder.iterdir() if recognises(path))
    dives = {path.name[:8].lower() for path in paths if _NAME.fullmatch(path.name)}
    return [path for path in paths if _NAME.fullmatch(path.name) or path.name[:8].lower() not in dives]


def _parts(path: Path) -> list[Path]:
    return [path] if _NAME.fullmatch(path.name) else basestation.files(path)


def read(mission: Mission) -> Logs:
    """Return the logs of a Seaglider mission: engineering, CTD, GPS, battery moves and AD2CP, each on its clock.

    Where the CTD has no clock of its own its samples stand in the engineering rows.

    Raises
    ------
    InputError
        If the netCDF packages are not installed, no file can be read, or none has pitch.
    """
    dives: list[_Dive] = []
    paths = _dives(mission.folder)
    findings = of_one(mission.folder.name, {f"SG{path.name[1:4]}" for path in paths})
    if any(_NAME.fullmatch(path.name) for path in paths):
        netcdf.require()
    for path in paths:
        try:
            if _NAME.fullmatch(path.name):
                dives.append(_Dive(path.name, netcdf.variables(path, _WANTED)))
            else:
                text = basestation.read(path)
                dives.append(_Dive(path.name, text.variables, text.findings))
        except UnreadableError as error:
            findings.append(Finding("error", path.name, "", error.found, error.expected, error.remedy))
    if not dives:
        if not paths:
            raise InputError(mission.folder.name, found="no Seaglider file", expected="pSSSDDDD.nc")
        count = f"{len(paths)} Seaglider file{'s' if len(paths) > 1 else ''}"
        raise InputError(mission.folder.name, found=f"{count}, none of them readable", remedy=str(findings[0]))
    own_pressure = _covered(dives)
    parts = [dive.streams(own_pressure) for dive in dives]
    for dive in dives:
        findings += dive.findings
    streams = [
        _joined(name, (part.get(name) for part in parts))
        for name in ("engineering", "CTD", "GPS", "battery", "engine", "AD2CP")
    ]
    if "pitch" not in streams[0] or not streams[0]["pitch"].notna().any():
        raise InputError(
            mission.folder.name,
            found="no pitch",
            expected="eng_pitchAng in a per-dive file of the basestation",
            remedy=next((str(finding) for finding in findings if finding.severity == "error"), "")
            or "process the dives again with the basestation",
        )
    constants, about = _constants(dives)
    stored = _joined("stored", (dive.stored() for dive in dives))
    return Logs(
        streams=[frame for frame in streams if len(frame)],
        findings=gather([*findings, *about]),
        constants=constants,
        stored=stored if len(stored) else None,
    )


def _covered(dives: list[_Dive]) -> bool:
    """Return whether the pressure of the CTD covers that of the vehicle over all dives, or is the only one."""
    own: list[Array] = []
    vehicle: list[Array] = []
    for dive in dives:
        for series, clock, pressure in (
            (own, dive.get("ctd_time"), dive.own_pressure),
            (vehicle, dive.get("time"), dive.depth),
        ):
            if clock is not None and pressure is not None:
                series.append(np.column_stack([clock, pressure]))
    if not own or not vehicle:
        return bool(own)
    ordered = [table[np.argsort(table[:, 0], kind="stable")].T for table in map(np.concatenate, (own, vehicle))]
    return covers(*ordered[0], *ordered[1])


@dataclass
class _Dive:
    """One file: its name, its variables, and what is doubtful about it."""

    name: str
    variables: netcdf.Variables
    findings: list[Finding] = field(default_factory=list)

    def get(self, name: str) -> Array | None:
        """Return variable `name` as numbers, one-dimensional if it has a dimension; None where it is not there."""
        if name not in self.variables:
            return None
        try:
            return np.asarray(self.variables[name], dtype=np.float64)
        except (TypeError, ValueError):
            return None

    def number(self, name: str) -> float:
        """Return the scalar variable `name`, NaN where it is not there or no number."""
        value = self.get(name)
        return float(value) if value is not None and value.size == 1 else np.nan

    def say(self, severity: Severity, found: str, expected: str = "", remedy: str = "", where: str = "") -> None:
        """Note a finding about this file."""
        self.findings.append(Finding(severity, self.name, where, found, expected, remedy))

    @property
    def own_pressure(self) -> Array | None:
        """The pressure that the CTD itself measured, on its clock; None where it has no sensor."""
        time = self.get("ctd_time")
        for name in self.variables:
            values = self.get(name)
            if re.fullmatch(_OWN_PRESSURE, name, re.IGNORECASE) and values is not None and time is not None:
                return values if values.shape == time.shape and np.isfinite(values).any() else None
        return None

    @property
    def depth(self) -> Array | None:
        """The vehicle's pressure [dbar], or the depth [m] that it stands for, on the engineering clock."""
        time = self.get("time")
        for values in (self.get("pressure"), self.get("depth")):
            if values is not None and time is not None and values.shape == time.shape:
                return values
        return None

    def streams(self, own_pressure: bool) -> dict[str, pd.DataFrame]:
        """Return the streams of this dive by name.

        Parameters
        ----------
        own_pressure
            Whether the pressure that the CTD measures is used; the vehicle's is then not read, for two sensors of
            different calibration must not take turns.
        """
        engineering = self._engineering(own_pressure)
        ctd = self._ctd(engineering, own_pressure)
        if len(engineering) == len(ctd) and len(ctd) and np.abs(engineering["time"] - ctd["time"]).max() < 1e-3:
            shared = ctd.drop(columns=["time", "pressure_interpolated"], errors="ignore")
            engineering, ctd = engineering.assign(**shared), pd.DataFrame()
        elif "pressure_interpolated" in ctd:
            used = "pressure interpolated to its instants serves salinity and density, never depth"
            self.say("note", "a CTD without pressure, on its own clock", "", used)
        parts = {"engineering": engineering, "CTD": ctd, "GPS": self._gps(), "AD2CP": self._adcp()}
        if "battery_position" not in engineering:
            parts["battery"] = self._moves("battery_position", "PITCH", -CENTIMETRE)
        if "buoyancy_volume" not in engineering:
            parts["engine"] = self._moves("buoyancy_volume", "VBD", CUBIC_CENTIMETRE)
            if parts["engine"].empty:
                self.say("warning", "no variable eng_vbdCC", "it, or the motor's moves", "the dive goes without")
        return {name: frame for name, frame in parts.items() if len(frame)}

    def _engineering(self, own_pressure: bool) -> pd.DataFrame:
        time = self.get("time")
        if time is None or time.ndim != 1:
            self.say("error", "no variable time", "the engineering clock", "engineering data left out")
            return pd.DataFrame()
        columns: dict[str, Array] = {"time": time}
        for name, variable, factor in (
            ("pitch", "eng_pitchAng", np.pi / 180.0),
            ("roll", "eng_rollAng", np.pi / 180.0),
            ("buoyancy_volume", "eng_vbdCC", CUBIC_CENTIMETRE),
            # Nose up when positive, so the mass goes aft.
            ("battery_position", "eng_pitchCtl", -CENTIMETRE),
        ):
            values = self._on(time, variable, required=name == "pitch")
            if values is not None:
                columns[name] = values * factor
        heading = self._on(time, "eng_head")
        if heading is not None:
            columns["heading"] = np.radians(heading + self._variation()) % (2 * np.pi)
        if not own_pressure:
            pressure = self._pressure(time)
            if pressure is not None:
                columns["pressure"] = pressure
        return pd.DataFrame(columns)

    def _on(self, time: Array, variable: str, *, required: bool = False) -> Array | None:
        """Return `variable` if it has one value for each of `time`."""
        values = self.get(variable)
        if values is not None and values.shape == time.shape:
            return values
        if required:
            found = f"no variable {variable}" if values is None else f"{variable} of another length than its clock"
            self.say("warning", found, "it in a per-dive file of the basestation", "the dive goes without")
        return None

    def _variation(self) -> float:
        """Return the magnetic variation [deg], east positive; 0 with a finding where the file has none."""
        for name in ("magnetic_variation", "log_MAGVAR", "log_gps_magvar"):
            values = self.get(name)
            if values is not None and np.isfinite(values).any():
                return float(np.nanmedian(values))
        self.say("warning", "no magnetic_variation", "it, to turn eng_head true", "heading stays magnetic")
        return 0.0

    def _pressure(self, time: Array) -> Array | None:
        """Return the vehicle's pressure [dbar], from depth where only depth is there."""
        pressure = self._on(time, "pressure")
        if pressure is not None:
            return pressure
        depth = self._on(time, "depth")
        if depth is None:
            self.say("error", "neither pressure nor depth", "one of them on the clock 'time'", "the dive goes without")
            return None
        self.say("note", "no variable pressure", "", "depth is turned into pressure")
        return seawater.pressure(depth, typical_latitude(self.get("log_gps_lat")))

    def _ctd(self, engineering: pd.DataFrame, own_pressure: bool) -> pd.DataFrame:
        time = self.get("ctd_time")
        time = self.get("time") if time is None else time
        if time is None or time.ndim != 1:
            return pd.DataFrame()
        columns: dict[str, npt.NDArray[Any]] = {"time": time}
        for name in ("temperature", "conductivity"):
            values = self._on(time, name, required=True)
            if values is None:
                continue
            if name == "conductivity" and np.nanmax(values, initial=0.0) > 10.0:
                self.say("warning", "conductivity in mS/cm by its values", "S/m", "divided by 10")
                values = values / 10.0
            columns[name] = values
            columns[f"{name}_qc"] = self._flags(name, values)
        own = self.own_pressure
        if own is not None and not own_pressure:
            self.say("note", "a CTD that measures pressure", "", "it sleeps too often: the vehicle's own is used")
            own = None
        if own is not None:
            self.say("note", "a CTD that measures pressure", "", "the vehicle's own pressure is not used")
            columns["pressure"] = own
            if "ctd_pressure_qc" in self.variables:
                columns["pressure_qc"] = self._flags("ctd_pressure", own)
        else:
            columns["pressure_interpolated"] = self._interpolated(time, engineering)
        frame = pd.DataFrame(columns)
        return self._with_salinity(frame) if {"temperature", "conductivity"} <= set(frame) else frame

    def _interpolated(self, time: Array, engineering: pd.DataFrame) -> Array:
        """Return the vehicle's pressure at the CTD's instants: the basestation's, else linear in time."""
        pressure = self._on(time, "ctd_pressure")
        if pressure is not None:
            return pressure
        if "pressure" not in engineering:
            return np.full(time.shape, np.nan)
        good = engineering[["time", "pressure"]].dropna().sort_values("time")
        if good.empty:
            return np.full(time.shape, np.nan)
        at = np.interp(time, good["time"].to_numpy(), good["pressure"].to_numpy(), left=np.nan, right=np.nan)
        return np.asarray(at, dtype=np.float64)

    def _with_salinity(self, frame: pd.DataFrame) -> pd.DataFrame:
        """Return `frame` with the conductivity that belongs to the corrected salinity.

        The basestation corrects salinity for the heat that the conductivity cell holds, at the temperature in the
        cell; the conductivity it stores does not give that salinity at the temperature of the water (±0.1 in a
        thermocline). Conductivity is turned back from the salinity, so that the two agree in the records.
        """
        salinity = self._on(frame["time"].to_numpy(), "salinity")
        pressure = frame["pressure"] if "pressure" in frame else frame["pressure_interpolated"]
        if salinity is None or not (np.isfinite(salinity) & pressure.notna()).any():
            return frame
        conductivity = gsw.C_from_SP(salinity, frame["temperature"].to_numpy(), pressure.to_numpy()) / 10.0
        worst = np.fmax(self._flags("salinity", salinity), frame["conductivity_qc"].to_numpy())
        self.say("note", "salinity corrected by the basestation", "", "conductivity is turned back from it")
        return frame.assign(
            conductivity=conductivity, conductivity_qc=np.where(np.isnan(salinity), Quality.MISSING, worst)
        )

    def _flags(self, name: str, values: Array) -> npt.NDArray[np.int8]:
        """Return the OG1 flags of `values` from the basestation's ``<name>_qc``; not measured where NaN."""
        flags = np.full(values.shape, Quality.NONE, dtype=np.int8)
        raw = self.variables.get(f"{name}_qc")
        if raw is not None and raw.shape == values.shape:
            for flag, quality in _FLAGS.items():
                flags[(raw == str(flag).encode()) | (raw == str(flag)) | _equals(raw, flag)] = quality
        return np.where(np.isnan(values), Quality.MISSING, flags).astype(np.int8)

    def _gps(self) -> pd.DataFrame:
        time, latitude, longitude = (self.get(f"log_gps_{name}") for name in ("time", "lat", "lon"))
        if time is None or latitude is None or longitude is None or not time.shape == latitude.shape == longitude.shape:
            self.say("warning", "no GPS fixes", "log_gps_time, log_gps_lat, log_gps_lon", "the dive goes without")
            return pd.DataFrame()
        good = (np.abs(latitude) <= 90.0) & (np.abs(longitude) <= 360.0) & ((latitude != 0.0) | (longitude != 0.0))
        good &= ~np.isin(self._flags("log_gps", time), (Quality.BAD, Quality.PROBABLY_BAD, Quality.MISSING))
        return pd.DataFrame({"time": time[good], "latitude": latitude[good], "longitude": longitude[good]})

    def _moves(self, name: str, motor: str, factor: float) -> pd.DataFrame:
        """Return `name` where the `motor`, PITCH or VBD, started and stopped, from its potentiometer."""
        centre, scale = self.number(f"log_C_{motor}"), self.number(f"log_{motor}_CNV")
        parts = []
        for clock, end in (("gc_st_secs", "_start"), ("gc_end_secs", "")):
            time, values = self.get(clock), self.get(f"gc_{motor.lower()}_ad{end}")
            if time is not None and values is not None and time.shape == values.shape and np.isfinite(centre * scale):
                parts.append(pd.DataFrame({"time": time, name: factor * (values - centre) * scale}))
        return pd.concat(parts, ignore_index=True).sort_values("time", kind="stable") if parts else pd.DataFrame()

    def _adcp(self) -> pd.DataFrame:
        time, pressure = self.get("ad2cp_time"), self.get("ad2cp_pressure")
        velocity = [self.get(f"ad2cp_vel{axis}") for axis in "XYZ"]
        known = [component for component in velocity if component is not None and component.ndim == 2]
        if time is None or len(known) < 3 or any(len(component) != len(time) for component in known):
            return pd.DataFrame()
        if pressure is None or pressure.shape != time.shape:
            pressure = np.full(time.shape, np.nan)
        return adcp.through_water(time, np.stack(known, axis=-1), pressure)

    def stored(self) -> pd.DataFrame:
        """Return the flight solution of the basestation: speed and vertical speed, up positive [m/s]."""
        for clock in ("ctd_time", "time"):
            time, speed, vertical = self.get(clock), self.get("speed"), self.get("vert_speed")
            if time is None or speed is None or vertical is None or not time.shape == speed.shape == vertical.shape:
                continue
            frame = pd.DataFrame({"time": time, "speed": speed * CENTIMETRE, "vertical_speed": vertical * CENTIMETRE})
            return frame.dropna()
        return pd.DataFrame()

    def constants(self) -> dict[str, float]:
        """Return the calibration constants of this file, mass in kg and the volume of the hull in m³."""
        out = {name: self.number(f"sg_cal_{name}") for name in _CONSTANTS}
        if not np.isfinite(out["mass"]):
            out["mass"] = self.number("log_MASS") * 1e-3
        bias = self.number("sg_cal_vbdbias")
        engine = (self.number("log_C_VBD") - self.number("log_VBD_MIN")) * self.number("log_VBD_CNV")
        volume = self.number("sg_cal_volmax") - (bias if np.isfinite(bias) else 0.0) + engine
        out["hull_volume"] = volume * CUBIC_CENTIMETRE
        return {name: value for name, value in out.items() if np.isfinite(value)}


def _equals(raw: npt.NDArray[Any], flag: int) -> npt.NDArray[np.bool_] | bool:
    return raw == flag if np.issubdtype(raw.dtype, np.number) else False


def _joined(name: str, frames: Iterable[pd.DataFrame | None]) -> pd.DataFrame:
    """Return `frames` in the order of their times, without rows that have no time and what two dives both hold."""
    present = [frame for frame in frames if frame is not None and len(frame)]
    if not present:
        return pd.DataFrame({"time": []})
    present.sort(key=lambda frame: float(np.nan_to_num(frame["time"].min())))
    joined = pd.concat(present, ignore_index=True)
    for column in joined.columns:
        if column.endswith("_qc"):
            joined[column] = joined[column].fillna(Quality.MISSING).astype(np.int8)
    joined = joined.dropna(subset=["time"]).drop_duplicates(ignore_index=True)
    joined.attrs = {"name": name}
    return joined


def _constants(dives: list[_Dive]) -> tuple[dict[str, float], list[Finding]]:
    """Return the median of every constant over the dives, and which of them differ from dive to dive."""
    table = pd.DataFrame([dive.constants() for dive in dives], index=[dive.name for dive in dives])
    findings = []
    for name in table:
        values = table[name].dropna()
        if len(values) and values.max() - values.min() > 1e-6 * values.abs().max():
            found = f"{name} from {values.min():.6g} to {values.max():.6g} over the dives"
            findings.append(
                Finding("note", "sg_cal", "", found, "one value", f"the median {values.median():.6g} is used")
            )
    return {str(name): float(table[name].median()) for name in table if table[name].notna().any()}, findings

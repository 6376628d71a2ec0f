"""Text files of a Seaglider's basestation: ``pSSSDDDD.eng`` and ``.log``, as the variables of its per-dive netCDF.

The ``.eng`` file is the engineering record: a header of ``%key: value`` lines, then numbers: depth in cm, pitch and
roll in degrees, the volume of the engine in cm³, frequencies of the CTD in Hz or values of one that computes them. The
``.log`` file holds the parameters, the fixes before and after the dive (``$GPS1``, ``$GPS2``, ``$GPS``: ddmmyy, hhmmss,
degrees and minutes run together) and the moves of the motors (``$GC``, named by ``$GCHEAD``). Since version 67 the
volume of the engine stands there alone. A scientific controller's CTD (``scDDDDa/psc*.eng``) has a clock of its own.

What the basestation makes of them, corrections of salinity and flags, is in its netCDF alone.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.findings import Finding
from pipeline.ingest.logs import UnreadableError

Array = npt.NDArray[np.float64]
Variables = dict[str, npt.NDArray[Any]]

NAME = re.compile(r"p\d{7}\.eng", re.IGNORECASE)
CALIBRATION = "sg_calib_constants.m"

#: The glider's depth is its pressure in psi times 0.685 m; dbar for a metre of it.
_PRESSURE = 1.0 / 0.685 / 1.4503774
#: Columns of a CTD: Sea-Bird's frequencies, and the values of one that computes them (RBR legato, Sea-Bird GPCTD).
_FREQUENCY = re.compile(r"(?:(?:sbect\d*|scct|ct)\.)?(?P<kind>temp|cond)freq", re.IGNORECASE)
_COMPUTED = re.compile(
    r"(?P<maker>legato\w*|rbr|gpctd\w*?)[._](?P<kind>time|conduc|cond|conductivity|temp|temperature|press|pressure)",
    re.IGNORECASE,
)
_KINDS = {"time": "time", "cond": "conductivity", "temp": "temperature", "pres": "pressure"}
#: Sea-Bird's corrections of conductivity for pressure [1/dbar] and temperature [1/°C], where no calibration says them.
_CPCOR, _CTCOR = -9.57e-8, 3.25e-6
#: Coefficients of conductivity that a glider without a calibration of its CTD has.
_NOMINAL = (-10.0, 1.0)
_CONSTANT = re.compile(r"^\s*(\w+)\s*=\s*([-+\d.eE]+)\s*;?", re.MULTILINE)
#: s, that a fix may be away from the start of its dive.
_NEAR = 10 * 86400.0


@dataclass(frozen=True)
class Dive:
    """The text files of one dive: variables named as in the netCDF of the basestation, and what is doubtful."""

    variables: Variables
    findings: list[Finding] = field(default_factory=list)


def files(eng: Path) -> list[Path]:
    """Return the files that `eng` is read with: its log, what the scientific controller wrote, and the calibration."""
    number = eng.stem[4:]
    beside = [eng, eng.with_suffix(".log"), eng.with_name(CALIBRATION)]
    science = [*eng.parent.glob(f"sc{number}[ab]/psc*.eng"), *eng.parent.glob(f"psc???{number}[ab]_*.eng")]
    return [path for path in beside if path.is_file()] + sorted(science)


def read(eng: Path) -> Dive:
    """Return the dive whose engineering record is `eng`.

    Raises
    ------
    UnreadableError
        If the file has no start, no columns or no records.
    """
    start, columns = _table(eng)
    findings: list[Finding] = []
    if start is None or "elaps_t" not in columns:
        what = "no date in '%start:'" if start is None else "no column elaps_t"
        raise UnreadableError(what, "an engineering record of the basestation", "left out")
    time = start + columns["elaps_t"]
    variables: Variables = {f"eng_{name.replace('.', '_')}": values for name, values in columns.items()}
    variables["time"] = time
    if "depth" in columns:
        variables["pressure"] = columns["depth"] * 0.01 * _PRESSURE
    log = eng.with_suffix(".log")
    if log.is_file():
        variables |= _log(log, start, findings)
    else:
        findings.append(Finding("warning", eng.name, "", f"no {log.name} beside it", "it", "the dive has no fixes"))
    constants = _calibration(eng.with_name(CALIBRATION))
    variables |= {f"sg_cal_{name}": np.asarray(value) for name, value in constants.items()}
    variables |= _ctd(eng, columns, variables, findings)
    return Dive(variables, findings)


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise UnreadableError(f"a file that cannot be opened ({error.strerror})", remedy="left out") from error


def _table(path: Path) -> tuple[float | None, dict[str, Array]]:
    """Return when the record in `path` starts [s since 1970], and its columns; rows of another length are left out."""
    start: float | None = None
    names: list[str] = []
    rows: list[list[float]] = []
    lines = _lines(path)
    for line in lines:
        if line.startswith("%"):
            key, _, value = line[1:].partition(":")
            if key.strip() == "start":
                start = _start(value)
            elif key.strip() == "columns" and not names:
                names = re.split(r"[,\s]+", value.strip().strip(","))
        elif names and line.strip():
            fields = line.split()
            if len(fields) == len(names):
                rows.append([_number(text) for text in fields])
    if not lines:
        raise UnreadableError("an empty file", "an engineering record of the basestation")
    if not names or not rows:
        what = "no records" if names else "no line '%columns:'"
        raise UnreadableError(what, "an engineering record of the basestation", "left out; copy the file again")
    values = np.array(rows, dtype=np.float64)
    return start, {name: values[:, k] for k, name in enumerate(names)}


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return np.nan
    return value if np.isfinite(value) else np.nan


def _start(text: str) -> float | None:
    """Return the instant ``mm dd yyy HH MM SS``, years since 1900, as s since 1970; None where it is none."""
    try:
        month, day, year, hour, minute, second = (int(part) for part in text.split()[:6])
        return pd.Timestamp(1900 + year, month, day, hour, minute, second, tz="UTC").timestamp()
    except ValueError:
        return None


def _log(path: Path, start: float, findings: list[Finding]) -> Variables:
    """Return parameters, fixes and motor moves of a log, moves in s since 1970."""
    out: Variables = {}
    fixes: list[tuple[float, float, float, float]] = []
    heads: list[str] = []
    moves: list[list[float]] = []
    for line in _lines(path):
        name, _, rest = line.removeprefix("$").partition(",")
        fields = rest.split(",")
        if not line.startswith("$"):
            continue
        if name in ("GPS1", "GPS2", "GPS"):
            fix = _fix(fields, start)
            if fix is None:
                findings.append(
                    Finding("warning", path.name, name, f"'{rest}'", "a date, a time and a position", "fix left out")
                )
            else:
                fixes.append(fix)
        elif name == "GCHEAD" and not heads:
            heads = fields
        elif name == "GC" and len(fields) == len(heads):
            moves.append([_number(text) for text in fields])
        elif len(fields) == 1 and np.isfinite(value := _number(rest)):
            out[f"log_{name}"] = np.asarray(value)
    for k, key in enumerate(("time", "lat", "lon", "magvar")):
        out[f"log_gps_{key}"] = np.array([fix[k] for fix in fixes], dtype=np.float64)
    if moves:
        table = np.array(moves, dtype=np.float64)
        out |= {f"gc_{name}": table[:, k] for k, name in enumerate(heads)}
        for clock in ("gc_st_secs", "gc_end_secs"):
            if clock in out:
                out[clock] = start + out[clock]
        pots = [out[f"gc_vbd_pot{k}_ad_start"] for k in (1, 2) if f"gc_vbd_pot{k}_ad_start" in out]
        if "gc_vbd_ad_start" not in out and len(pots) == 2:
            out["gc_vbd_ad_start"] = (pots[0] + pots[1]) / 2
    return out


def _fix(fields: list[str], start: float) -> tuple[float, float, float, float] | None:
    """Return time [s since 1970], latitude, longitude and magnetic variation [deg] of a fix; None where it is none."""
    try:
        moment = pd.to_datetime(f"{fields[0]}{fields[1]}", format="%d%m%y%H%M%S", utc=True).timestamp()
        latitude, longitude = (_degrees(_number(text)) for text in fields[2:4])
    except (ValueError, IndexError):
        return None
    variation = _number(fields[7]) if len(fields) > 7 else np.nan
    within = abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and abs(moment - start) < _NEAR
    return (moment, latitude, longitude, variation) if within else None


def _degrees(value: float) -> float:
    """Return degrees of degrees and minutes run together, -12218.5 for 122° 18.5' W."""
    whole = np.trunc(abs(value) / 100.0)
    return float(np.copysign(whole + (abs(value) - 100.0 * whole) / 60.0, value))


def _calibration(path: Path) -> dict[str, float]:
    """Return the numbers in the basestation's calibration file, none where there is no such file."""
    if not path.is_file():
        return {}
    text = "\n".join(line.partition("%")[0] for line in _lines(path)).replace(";", ";\n")
    return {name: value for name, words in _CONSTANT.findall(text) if np.isfinite(value := _number(words))}


def _ctd(eng: Path, columns: dict[str, Array], variables: Variables, findings: list[Finding]) -> Variables:
    """Return the CTD's samples: of the scientific controller, else in the engineering record."""
    parts = []
    for path in files(eng):
        if path.name.lower().startswith("psc"):
            try:
                found = _computed(_table(path)[1])
            except UnreadableError as error:
                findings.append(Finding("error", path.name, "", error.found, error.expected, error.remedy))
                continue
            if {"time", "temperature"} <= set(found):
                parts.append(pd.DataFrame(found))
    found = {}
    if parts:
        table = pd.concat(parts, ignore_index=True).sort_values("time", kind="stable")
        found = {str(name): table[name].to_numpy(dtype=np.float64) for name in table}
        found["ctd_time"] = found.pop("time")
    else:
        found = _computed(columns) or _by_frequency(eng, columns, variables, findings)
        found.pop("time", None)
        if found:
            found["ctd_time"] = variables["time"]
    if "conductivity" in found and "pressure" in found:
        found["legato_pressure"] = found.pop("pressure")
    return dict(found)


def _computed(columns: dict[str, Array]) -> dict[str, Array]:
    """Return time, temperature [°C], conductivity [S/m] and pressure [dbar] of a CTD that computes them."""
    out: dict[str, Array] = {}
    for name, values in columns.items():
        if (match := _COMPUTED.fullmatch(name)) and np.isfinite(values).any():
            kind = _KINDS[match["kind"].lower()[:4]]
            out.setdefault(kind, values * 0.1 if kind == "conductivity" else values)
    return out


def _by_frequency(
    eng: Path, columns: dict[str, Array], variables: Variables, findings: list[Finding]
) -> dict[str, Array]:
    """Return temperature [°C] and conductivity [S/m] of a Sea-Bird CT by its frequencies (Sea-Bird's equations)."""
    kinds = {match["kind"].lower(): values for name, values in columns.items() if (match := _FREQUENCY.fullmatch(name))}
    t, c = ([_coefficient(variables, f"{letter}_{k}") for k in "ghij"] for letter in "tc")
    if set(kinds) != {"temp", "cond"}:
        return {}
    if not np.isfinite([*t, *c]).all() or (c[0], c[1]) == _NOMINAL:
        found, expected = "frequencies of a CTD and no calibration", f"t_g to c_j in {CALIBRATION}"
        findings.append(Finding("warning", eng.name, "", found, expected, "the dive goes without a CTD"))
        return {}
    with np.errstate(divide="ignore", invalid="ignore"):
        x = np.log(1000.0 / kinds["temp"])
        temperature = 1.0 / (t[0] + x * (t[1] + x * (t[2] + x * t[3]))) - 273.15
        f = kinds["cond"] / 1000.0
        pressure = variables.get("pressure", np.zeros_like(f))
        corrected = 1.0 + _number_of(variables, "ctcor", _CTCOR) * temperature
        corrected = corrected + _number_of(variables, "cpcor", _CPCOR) * pressure
        conductivity = (c[0] + f * f * (c[1] + f * (c[2] + f * c[3]))) / (10.0 * corrected)
    temperature = temperature - _number_of(variables, "temp_bias", 0.0)
    conductivity = conductivity - _number_of(variables, "cond_bias", 0.0)
    found = "temperature and conductivity by Sea-Bird's equations"
    findings.append(Finding("note", eng.name, "", found, "", "without the basestation's corrections"))
    return {"temperature": temperature, "conductivity": conductivity}


def _coefficient(variables: Variables, name: str) -> float:
    """Return a coefficient of the CT, of the calibration file or else of the log."""
    return _number_of(variables, name, float(variables.get(f"log_SEABIRD_{name.upper()}", np.asarray(np.nan))))


def _number_of(variables: Variables, name: str, otherwise: float) -> float:
    return float(variables.get(f"sg_cal_{name}", np.asarray(otherwise)))

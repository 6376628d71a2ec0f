"""Sea water by TEOS-10: salinity, conservative temperature and in-situ density **at the pressure**, depth.

All by gsw (McDougall & Barker 2011, ISBN 978-0-646-55621-5). Everything is computed on the CTD's own instants from
temperature, conductivity and pressure of the same record. Outside the funnel of oceanographic validity density is NaN.
"""

from __future__ import annotations

from typing import NamedTuple

import gsw
import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.findings import Finding, InputError
from pipeline.geodesy import typical_latitude
from pipeline.mission import Mission
from pipeline.records import Quality

Array = npt.NDArray[np.float64]

#: A latitude of mission.yaml farther than this from the fixes is told, degrees.
_APART = 5.0
#: Water at its freezing point may be measured this much too cold, K.
_FREEZING_MARGIN = 0.1

#: Beyond the deepest trench, m or dbar.
_DEEPEST = 12000.0
#: Absolute salinity of the standard ocean, g/kg, whose weight `gsw.z_from_p` takes unless told otherwise.
_STANDARD_SALINITY = 35.16504
#: Layers of the mean profile of density, dbar.
_LAYER = 1.0
PASCAL_PER_DBAR = 1e4
#: Heights above the surface at which a depth is one written with positive up, m.
_SURFACE_M = 2.0

_SEA_WATER = ("salinity", "absolute_salinity", "conservative_temperature", "density")


class Position(NamedTuple):
    """Where the water is, degrees; longitude NaN where it is not known."""

    latitude: float
    longitude: float


def position(mission: Mission, streams: list[pd.DataFrame]) -> tuple[Position, list[Finding]]:
    """Return the position of a mission: as mission.yaml says, else the median fix, else 45° N; and what is odd."""
    fixes = next((found for found in map(_fixes, streams) if len(found)), np.empty((0, 2)))
    latitude = typical_latitude(fixes[:, 0], mission.latitude)
    longitude = mission.longitude
    if longitude is None:
        longitude = float(np.median(fixes[:, 1])) if len(fixes) else np.nan
    findings = []
    if mission.latitude is None and not len(fixes):
        taken = f"{latitude:g}° taken: depth is wrong by up to 0.3 %"
        told = ("no latitude and no GPS fix", "one of them", taken)
        findings.append(Finding("warning", "mission.yaml", "latitude", *told))
    elif len(fixes) and abs(typical_latitude(fixes[:, 0]) - latitude) > _APART:
        found = f"{latitude:g}° N and fixes around {typical_latitude(fixes[:, 0]):.1f}° N"
        told = (found, "the latitude of the fixes", "that of mission.yaml is used for gravity, depth and salinity")
        findings.append(Finding("warning", "mission.yaml", "latitude", *told))
    return Position(latitude, longitude), findings


def _fixes(frame: pd.DataFrame) -> Array:
    """Return latitude and longitude of the fixes of a stream, degrees, shape (n, 2); those at 0° N 0° E are none."""
    if not {"latitude", "longitude"} <= set(frame.columns):
        return np.empty((0, 2))
    both: Array = frame[["latitude", "longitude"]].to_numpy(np.float64)
    there: Array = both[(np.abs(both) <= (90.0, 360.0)).all(axis=1) & (both != 0.0).any(axis=1)]
    return there


def depth(pressure: Array, latitude: float, profile: tuple[Array, Array] | None = None) -> Array:
    """Return depth in m, positive down, shape (n,), by the weight of the water that was measured above.

    Without density the water is that of the standard ocean (35.165 g/kg, 0 °C): its depths are 2.8 % too small in
    fresh, 2 % in brackish and 0.5 % in warm water, and speed from depth rate with them.

    Parameters
    ----------
    pressure
        Sea pressure, dbar, shape (n,).
    latitude
        Degrees north.
    profile
        Pressure [dbar] and in-situ density [kg/m³] of the CTD's samples, shape (k,) each; their mean profile is used.
    """
    inside = np.abs(pressure) <= _DEEPEST
    found = np.full(pressure.shape, np.nan)
    anomaly = _dynamic_height(pressure[inside], *profile) if profile else 0.0
    found[inside] = -gsw.z_from_p(pressure[inside], latitude, anomaly)
    return found


def _dynamic_height(pressure: Array, sampled: Array, density: Array) -> Array:
    """Return the dynamic height anomaly, m²/s², shape (n,): minus the integral of specific volume anomaly from p = 0.

    McDougall & Barker (2011); the anomaly is that of the mission's mean profile in layers of `_LAYER` dbar.
    """
    known = (sampled <= _DEEPEST) & np.isfinite(density)
    if not known.any():
        return np.zeros_like(pressure)
    found = np.maximum(sampled[known], 0.0)
    excess = 1.0 / density[known] - 1.0 / gsw.rho(_STANDARD_SALINITY, 0.0, found)
    layer = (found / _LAYER).astype(np.int64)
    count = np.bincount(layer)
    met = count > 0
    middle = (np.flatnonzero(met) + 0.5) * _LAYER
    mean = np.bincount(layer, weights=excess)[met] / count[met]
    edges = np.arange(count.size + 1) * _LAYER
    steps = np.interp(0.5 * (edges[:-1] + edges[1:]), middle, mean) * _LAYER * PASCAL_PER_DBAR
    height = -np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(np.interp(pressure, edges, height), dtype=np.float64)


def with_depth(table: pd.DataFrame, latitude: float) -> pd.DataFrame:
    """Return the merged records with `depth` [m]; a CTD without pressure takes that between its neighbours'."""
    time, found = table["time"].to_numpy(np.float64), table["pressure"].to_numpy(np.float64)
    known = np.isfinite(found)
    if "density" not in table or not known.any():
        return table.assign(depth=depth(found, latitude))
    sampled = np.interp(time, time[known], found[known])
    return table.assign(depth=depth(found, latitude, (sampled, table["density"].to_numpy(np.float64))))


def pressure(depth_m: Array, latitude: float) -> Array:
    """Return pressure in dbar, shape (n,), of depth in m, positive down, at `latitude` in degrees.

    A depth that no ocean has, or high in the air, is taken for as many dbar: it is found out of range later.
    """
    inside = (depth_m >= -5.0) & (depth_m <= _DEEPEST)
    found = np.array(depth_m, dtype=np.float64)
    found[inside] = gsw.p_from_z(-found[inside], latitude)
    return found


def sea_water(
    conductivity: Array | None, temperature: Array, pressure_dbar: Array, place: Position, salinity: str
) -> dict[str, Array]:
    """Return salinity, absolute salinity, conservative temperature and in-situ density of CTD samples.

    Parameters
    ----------
    conductivity
        S/m, shape (n,); None for fresh water.
    temperature
        In-situ temperature, °C ITS-90, shape (n,).
    pressure_dbar
        Sea pressure, dbar, shape (n,).
    place
        Where; without a longitude the composition anomaly is taken as zero (reference salinity, error < 0.03 g/kg).
    salinity
        ``measured``, ``baltic`` (Feistel et al. 2010, doi:10.5194/os-6-3-2010) or ``fresh`` (0 g/kg).

    Returns
    -------
    dict
        ``salinity`` [PSS-78], ``absolute_salinity`` [g/kg], ``conservative_temperature`` [°C], ``density`` [kg/m³],
        shape (n,); NaN where an input is, and density NaN outside the oceanographic funnel.
    """
    if conductivity is None or salinity == "fresh":
        practical = np.where(np.isfinite(temperature), 0.0, np.nan)
        absolute = practical.copy()
    else:
        practical = gsw.SP_from_C(conductivity * 10.0, temperature, pressure_dbar)
        if salinity == "baltic":
            absolute = gsw.SA_from_SP_Baltic(practical, place.longitude, place.latitude)
        elif np.isfinite(place.longitude):
            absolute = gsw.SA_from_SP(practical, pressure_dbar, place.longitude, place.latitude)
        else:
            absolute = gsw.SR_from_SP(practical)
    conservative = gsw.CT_from_t(absolute, temperature, pressure_dbar)
    inside = _in_funnel(absolute, conservative, pressure_dbar)
    density = np.where(inside, gsw.rho(absolute, conservative, pressure_dbar), np.nan)
    values = (practical, absolute, conservative, density)
    return {name: np.asarray(value, dtype=np.float64) for name, value in zip(_SEA_WATER, values, strict=True)}


def _in_funnel(absolute: Array, conservative: Array, pressure_dbar: Array) -> npt.NDArray[np.bool_]:
    """Return where density is valid: the funnel of TEOS-10, and fresh water to 2 km as in deep lakes."""
    with np.errstate(invalid="ignore"):
        warmer = conservative + _FREEZING_MARGIN
        funnel = np.nan_to_num(gsw.infunnel(absolute, warmer, np.maximum(pressure_dbar, 0.0))) > 0
        lake = (absolute >= 0) & (absolute < 7.5) & (conservative > -1) & (conservative < 40) & (pressure_dbar < 2000)
    return np.asarray(funnel | lake)


def with_sea_water(mission: Mission, streams: list[pd.DataFrame]) -> tuple[list[pd.DataFrame], list[Finding]]:
    """Return `streams` with the sea-water columns added to each that has a CTD, and the findings.

    Values flagged bad or probably bad do not enter.

    Raises
    ------
    InputError
        If mission.yaml says ``salinity: baltic`` and the position is unknown or not in the Baltic.
    """
    place, findings = position(mission, streams)
    out = []
    for frame in streams:
        fresh = mission.salinity == "fresh"
        own = "pressure_interpolated" if "pressure_interpolated" in frame else "pressure"
        needed = ["temperature", own] if fresh else ["temperature", "conductivity", own]
        if not set(needed) <= set(frame.columns):
            out.append(frame.drop(columns="pressure_interpolated", errors="ignore"))
            continue
        values = {name: good(frame, name) for name in needed}
        if mission.salinity == "baltic":
            _in_baltic(place)
        water = sea_water(values.get("conductivity"), values["temperature"], values[own], place, mission.salinity)
        complete = np.logical_and.reduce([np.isfinite(values[name]) for name in needed])
        lost = complete & ~np.isfinite(water["density"])
        if lost.any():
            row = int(np.argmax(lost))
            sample = ", ".join(f"{name} {values[name][row]:.4g}" for name in needed)
            findings.append(
                Finding(
                    "warning",
                    str(frame.attrs.get("name", "ctd")),
                    f"record {row + 1}",
                    f"{int(lost.sum())} of {int(complete.sum())} samples that are no sea water, first {sample}",
                    "values inside the oceanographic funnel of TEOS-10",
                    "their density is left out",
                )
            )
        joined = frame.assign(**water).drop(columns="pressure_interpolated", errors="ignore")
        joined.attrs = frame.attrs
        out.append(joined)
    known = any("density" in frame and frame["density"].notna().any() for frame in out)
    if not known and mission.water is None:
        findings.append(
            Finding(
                "warning",
                "mission",
                "density",
                "no record with temperature, "
                + ("" if mission.salinity == "fresh" else "conductivity ")
                + "and pressure",
                "a CTD",
                "there is no density",
            )
        )
    return out, findings


def with_borrowed_water(mission: Mission, table: pd.DataFrame) -> tuple[pd.DataFrame, list[Finding]]:
    """Return `table` with the water of mission.yaml where none was measured, and a finding that says so.

    Density, and temperature if it is given, become straight lines in pressure at the records that have one. Salinity
    stays unknown: by that `borrowed` knows such records again.
    """
    water = mission.water
    if water is None:
        return table, []
    if "density" in table and table["density"].notna().any():
        note = Finding("note", "mission.yaml", "water", "a density, though a CTD measured one", "", "not used")
        return table, [note]
    pressure = table["pressure"].to_numpy(np.float64)
    columns = {"density": water.density + water.density_per_dbar * pressure}
    said = f"{water.density:g} kg/m3 + {water.density_per_dbar:g} kg/m3/dbar, 1-sigma {water.std:g}"
    if water.temperature is not None and not ("temperature" in table and table["temperature"].notna().any()):
        columns["temperature"] = water.temperature + water.temperature_per_dbar * pressure
        said += f"; {water.temperature:g} degC + {water.temperature_per_dbar:g} K/dbar"
    note = Finding(
        "warning",
        "mission.yaml",
        "water",
        "no CTD",
        "a measured density",
        f"water is borrowed, not measured: {said}" + (f" ({water.source})" if water.source else ""),
    )
    return table.assign(**columns), [note]


def pressure_and_conductivity(
    mission: Mission, streams: list[pd.DataFrame]
) -> tuple[list[pd.DataFrame], list[Finding]]:
    """Return `streams` with depth turned into pressure and practical salinity into conductivity.

    Where a stream carries pressure as well, its depth only serves as a check of the unit of pressure.

    Raises
    ------
    InputError
        If depth and pressure of one stream disagree by more than 10 %, or depth is positive up.
    """
    place, _ = position(mission, streams)
    out, findings = [], []
    for frame in streams:
        changed = frame
        name = str(frame.attrs.get("name", "table"))
        if "depth" in frame and _measured(frame, "pressure"):
            _compare(frame, place.latitude, name)
        elif "depth" in frame:
            _require_downwards(frame, name)
            changed = changed.assign(pressure=pressure(frame["depth"].to_numpy(np.float64), place.latitude))
            changed = _with_flag_of(changed, "pressure", "depth")
            findings.append(Finding("note", name, "depth", f"depth; turned into pressure at {place.latitude:.1f}°"))
        if (
            "salinity" in frame
            and not _measured(frame, "conductivity")
            and {"temperature", "pressure"} <= set(changed.columns)
        ):
            arguments = [changed[key].to_numpy(np.float64) for key in ("salinity", "temperature", "pressure")]
            changed = changed.assign(conductivity=gsw.C_from_SP(*arguments) / 10.0)
            changed = _with_flag_of(changed, "conductivity", "salinity")
            findings.append(Finding("note", name, "salinity", "practical salinity; turned into conductivity"))
        changed = changed.drop(columns=["depth", "salinity", "depth_qc", "salinity_qc"], errors="ignore")
        changed.attrs = frame.attrs
        out.append(changed)
    return out, findings


def good(frame: pd.DataFrame, name: str) -> Array:
    """Return column `name`, shape (n,), NaN where it is flagged bad or probably bad."""
    values = frame[name].to_numpy(dtype=np.float64, copy=True)
    if f"{name}_qc" in frame:
        flag = frame[f"{name}_qc"].to_numpy()
        values[(flag == Quality.BAD) | (flag == Quality.PROBABLY_BAD)] = np.nan
    return values


def _with_flag_of(frame: pd.DataFrame, name: str, origin: str) -> pd.DataFrame:
    """Return `frame` with the flag of `origin`, if it has one, for `name`, which was computed from it."""
    return frame.assign(**{f"{name}_qc": frame[f"{origin}_qc"]}) if f"{origin}_qc" in frame else frame


def _measured(frame: pd.DataFrame, name: str) -> bool:
    """Return whether `frame` has a value of `name`."""
    return name in frame and bool(frame[name].notna().any())


def _require_downwards(frame: pd.DataFrame, name: str) -> None:
    """Raise `InputError` if depth is a height: the greater part of the record far above the surface."""
    found = frame["depth"].to_numpy(np.float64)
    found = found[np.isfinite(found)]
    if found.size and float(np.median(found)) < -_SURFACE_M:
        raise InputError(
            name,
            f"column '{frame.attrs.get('columns', {}).get('depth', 'depth')}'",
            found=f"depth from {found.min():.4g} to {found.max():.4g} m",
            expected="depth positive down",
            remedy="give its unit with a minus sign (-m) under files: in mission.yaml",
        )


def _compare(frame: pd.DataFrame, latitude: float, name: str) -> None:
    expected = pressure(frame["depth"].to_numpy(np.float64), latitude)
    found = frame["pressure"].to_numpy(np.float64)
    deep = (expected > 2.0) & np.isfinite(found)
    if deep.sum() < 5:
        return
    ratio = float(np.median(found[deep] / expected[deep]))
    if abs(ratio - 1.0) > 0.1:
        column = frame.attrs.get("columns", {}).get("pressure", "pressure")
        raise InputError(
            name,
            f"column '{column}'",
            found=f"a pressure {ratio:.3g} times what the depth in the same file means",
            expected="1",
            remedy="correct the unit of pressure or depth under files: in mission.yaml",
        )


def _in_baltic(place: Position) -> None:
    if not np.isfinite(gsw.SA_from_SP_Baltic(7.0, place.longitude, place.latitude)):
        where = f"{place.latitude:.2f}° N {place.longitude:.2f}° E" if np.isfinite(place.longitude) else "no position"
        raise InputError(
            "mission.yaml",
            "salinity",
            found=f"'baltic' and {where}",
            expected="a position in the Baltic Sea",
            remedy="give latitude and longitude, or salinity: measured",
        )

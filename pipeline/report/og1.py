"""The estimates as netCDF, by the names of the OceanGliders format 1.0 and the CF conventions 1.10 that it rests on.

One trajectory with a measurement for each record. Positions are fixes and nothing between them. Names that neither
vocabulary has, that of the angle of attack for one, are given in words alone, without a standard name.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Mapping
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pipeline import __version__
from pipeline.findings import Finding
from pipeline.records import Phase, Quality, seconds, timestamps

if TYPE_CHECKING:
    from pipeline.mission import Mission
    from pipeline.table import Columns
    from pipeline.vehicle import Vehicle

FILE = "estimates.nc"
DIMENSION = "N_MEASUREMENTS"
#: Values that are compressed together.
CHUNK = 65_536
DEGREES = 180.0 / math.pi


class Variable(NamedTuple):
    """An estimate: its column, name here, factor and unit, CF standard name (empty: there is none), and meaning."""

    column: str
    name: str
    factor: float
    unit: str
    standard: str
    meaning: str
    flagged: bool  # NaN where the data do not determine it


VARIABLES = (
    Variable("speed", "SPEED", 1.0, "m s-1", "platform_speed_wrt_sea_water", "speed through water", True),
    Variable("path_angle", "PATH_ANGLE", DEGREES, "degree", "", "flight-path angle through water, climbing +", True),
    Variable("angle_of_attack", "ANGLE_OF_ATTACK", DEGREES, "degree", "", "angle of attack, flow from below +", True),
    Variable("pitch", "PITCH", DEGREES, "degree", "platform_pitch_fore_up", "pitch, nose up +", False),
    Variable("depth", "DEPTH", 1.0, "m", "depth", "depth below the surface", False),
    Variable(
        "vertical_water_velocity",
        "VERTICAL_WATER_VELOCITY",
        1.0,
        "m s-1",
        "upward_sea_water_velocity",
        "vertical velocity of the water, up +",
        True,
    ),
)
METHODS = {
    "kinematic": "from depth rate, pitch and the ratio of lift to drag",
    "force": "from net buoyancy, thrust, lift and drag, adjusted to the depth rate",
}


def missing() -> Finding | None:
    """Return what is to be said where the package that writes netCDF is not installed, else None."""
    if importlib.util.find_spec("h5netcdf") and importlib.util.find_spec("h5py"):
        return None
    return Finding(
        "note", FILE, "", "no h5netcdf to write it with", "the extra 'netcdf'", "pip install 'seatrial[netcdf]'"
    )


def write(
    file: IO[bytes],
    mission: Mission,
    vehicle: Vehicle,
    records: Columns,
    estimates: Mapping[str, Columns],
) -> None:
    """Write the estimates of a mission as netCDF-4; the same input gives the same bytes.

    Variables are written one by one, so that no more than one is held beside the tables.

    Parameters
    ----------
    file
        Opened to read and write.
    mission, vehicle
        What the file is named after.
    records
        Canonical records, at least one row.
    estimates
        Canonical estimates at every record by method; those of the kinematic must be there, others may be empty.

    Raises
    ------
    ValueError
        If a table has not a row for every record.
    """
    import h5netcdf

    present = {method: table for method, table in estimates.items() if len(table)}
    for method, table in present.items():
        if len(table) != len(records):
            raise ValueError(f"{method}: found {len(table)} estimates; expected {len(records)}, one a record")
    with h5netcdf.File(file, "w") as out:
        out.attrs.update(_attributes(mission, vehicle, records, present["kinematic"]))
        out.dimensions = {DIMENSION: len(records)}
        _coordinates(out, mission, vehicle, records)
        for method, table in present.items():
            seen = table["observable"].to_numpy(dtype=bool)
            for variable in VARIABLES:
                _estimate(out, table, method, variable, seen)
            _status(out, table, method)


def _attributes(mission: Mission, vehicle: Vehicle, records: Columns, kinematic: Columns) -> dict[str, str | float]:
    """Return the global attributes; none depends on when or where the file is written."""
    time = seconds(records["time"])
    start, end = (f"{timestamps(np.array([instant]))[0]:%Y%m%dT%H%M%S}" for instant in (time[0], time[-1]))
    found: dict[str, str | float] = {
        "title": f"Flight of the underwater glider of mission {mission.slug} through the water",
        "summary": "Speed through water, angle of attack, path angle and vertical velocity of the water with 1-sigma, "
        "estimated from the records of pressure, attitude, buoyancy engine and propeller.",
        "Conventions": "CF-1.10",
        "featureType": "trajectory",
        "platform": "sub-surface gliders",
        "platform_vocabulary": "https://vocab.nerc.ac.uk/collection/L06/current/27/",
        "id": mission.slug,
        "internal_mission_identifier": mission.slug,
        "start_date": start,
        "time_coverage_start": start,
        "time_coverage_end": end,
        "source": f"seatrial {__version__}, vehicle {vehicle.name}",
        "history": f"seatrial {__version__}: records to estimates, estimates to netCDF",
        "references": "doi:10.1007/s13344-017-0061-y",
        "comment": "Names are those of the OceanGliders format 1.0. Contributors, institutions and the WMO identifier, "
        "which it wants, are not in the logs: add them before the file is passed on as OG-1.0.",
    }
    if mission.description:
        found["description"] = mission.description
    for name, column, table in (
        ("lat", "latitude", records),
        ("lon", "longitude", records),
        ("vertical", "depth", kinematic),
    ):
        values = table[column].to_numpy()
        if np.isfinite(values).any():
            found[f"geospatial_{name}_min"] = float(np.nanmin(values))
            found[f"geospatial_{name}_max"] = float(np.nanmax(values))
    return found


def _put(out: Any, name: str, data: np.ndarray, fill: float | None, attributes: Mapping[str, Any]) -> None:
    """Write one variable along the trajectory."""
    packed = {"chunks": (min(CHUNK, data.size),), "compression": "gzip", "compression_opts": 1}
    variable = out.create_variable(
        name,
        (DIMENSION,),
        dtype=data.dtype,
        data=data,
        fillvalue=None if fill is None else data.dtype.type(fill),
        **(packed if data.dtype == np.int8 else {}),
    )
    variable.attrs.update(attributes)


def _coordinates(out: Any, mission: Mission, vehicle: Vehicle, records: Columns) -> None:
    """Write time, fixes if there are any, phase, and whose trajectory it is."""
    import h5py

    for name, value, attributes in (
        ("TRAJECTORY", mission.slug, {"cf_role": "trajectory_id", "long_name": "trajectory name"}),
        ("PLATFORM_MODEL", vehicle.name, {"long_name": "model of the glider"}),
    ):
        out.create_variable(name, (), dtype=h5py.string_dtype(), data=np.array(value, dtype=object)).attrs.update(
            attributes
        )
    time = {
        "long_name": "time of each record",
        "standard_name": "time",
        "units": "seconds since 1970-01-01T00:00:00Z",
        "calendar": "gregorian",
        "axis": "T",
    }
    _put(out, "TIME", seconds(records["time"]), None, time)
    for name, column, unit in (("LATITUDE", "latitude", "degrees_north"), ("LONGITUDE", "longitude", "degrees_east")):
        if records[column].notna().any():
            fixes = {
                "long_name": f"{column} of each fix, missing between them",
                "standard_name": column,
                "units": unit,
                "interpolation_methodology": "none",
            }
            _put(out, name, records[column].to_numpy(dtype=np.float64), math.nan, fixes)
    phase = {"long_name": "behaviour of the glider at sea", **_flags(Phase)}
    _put(out, "PHASE", records["phase"].to_numpy(dtype=np.int8), None, phase)
    _put(out, "DIVE", records["dive"].to_numpy(dtype=np.int32), None, {"long_name": "dive number, 0 before the first"})


def _flags(kind: type[Phase] | type[Quality]) -> dict[str, Any]:
    """Return what CF says of flags: their values and meanings."""
    return {
        "flag_values": np.array([int(flag) for flag in kind], dtype=np.int8),
        "flag_meanings": " ".join(flag.name.lower() for flag in kind),
    }


def name_of(variable: Variable, method: str) -> str:
    """Return the name of an estimate by `method`; depth by the kinematic one is the trajectory's coordinate."""
    coordinate = variable.column == "depth" and method == "kinematic"
    return variable.name if coordinate else f"{variable.name}_{method.upper()}"


def _estimate(out: Any, table: Columns, method: str, variable: Variable, seen: np.ndarray) -> None:
    """Write one estimate with its 1-sigma, and a quality flag where the data may not determine it."""
    name = name_of(variable, method)
    beside = [f"{name}_STD", *([f"{name}_QC", f"STATUS_{method.upper()}"] if variable.flagged else [])]
    place = " ".join(
        key for key in ("TIME", "DEPTH", "LATITUDE", "LONGITUDE") if key in out.variables or key == "DEPTH"
    )
    attributes = {
        "long_name": f"{variable.meaning}, {method} estimate",
        **({"standard_name": variable.standard} if variable.standard else {}),
        "units": variable.unit,
        "ancillary_variables": " ".join(beside),
        "comment": METHODS[method],
    }
    if name == "DEPTH":
        attributes |= {"positive": "down", "axis": "Z"}
    else:
        attributes["coordinates"] = place
    _put(out, name, _column(table, variable.column, variable.factor), math.nan, attributes)
    std = {
        "long_name": f"1-sigma of {variable.meaning}, {method} estimate",
        **({"standard_name": f"{variable.standard} standard_error"} if variable.standard else {}),
        "units": variable.unit,
        "coordinates": place,
    }
    _put(out, f"{name}_STD", _column(table, f"{variable.column}_std", variable.factor), math.nan, std)
    if variable.flagged:
        flag = np.where(seen, int(Quality.GOOD), int(Quality.MISSING))
        quality = {"long_name": f"quality flag of {name}", "standard_name": "quality_flag", **_flags(Quality)}
        _put(out, f"{name}_QC", flag.astype(np.int8), None, quality)


def _column(table: Columns, name: str, factor: float) -> np.ndarray:
    return np.asarray(table[name].to_numpy(dtype=np.float64) * factor, dtype=np.float32)


def _status(out: Any, table: Columns, method: str) -> None:
    """Write why the data do not determine the speed, 0 where they do."""
    reason = table["reason"].astype("category").cat.remove_unused_categories()
    texts = sorted(str(text) for text in reason.cat.categories if text)
    number = np.array([texts.index(str(text)) + 1 if text else 0 for text in reason.cat.categories], dtype=np.int8)
    meanings = ["determined", *(_word(text) for text in texts)]
    attributes = {
        "long_name": f"whether the data determine the speed of the {method} estimate, and why not",
        "standard_name": "status_flag",
        "flag_values": np.arange(len(meanings), dtype=np.int8),
        "flag_meanings": " ".join(meanings),
    }
    _put(out, f"STATUS_{method.upper()}", number[reason.cat.codes.to_numpy()], None, attributes)


def _word(text: str) -> str:
    """Return a sentence as one word of the characters that CF allows in the meaning of a flag."""
    plain = text.replace("%", "percent")
    return "_".join("".join(letter if letter.isalnum() or letter in "-.+" else " " for letter in plain).split())

"""The canonical tables: the names, units and meanings every stage shares.

SI and radians inside; degrees and cm/s only where people read. NaN means "not measured here", never zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from pipeline.table import Columns


@dataclass(frozen=True)
class Column:
    """One column of a canonical table."""

    name: str
    unit: str
    meaning: str
    dtype: str = "float64"


class Phase(IntEnum):
    """OG1 vehicle phase (OceanGliders OG1.0 vocabulary ``PHASE``)."""

    UNKNOWN = 0
    ASCENT = 1
    DESCENT = 2
    SURFACING = 3
    PARKING = 4
    INFLEXION = 5
    PROPELLED = 6
    TRANSITION = 7


class Quality(IntEnum):
    """OG1 quality flag of one measurement."""

    NONE = 0
    GOOD = 1
    PROBABLY_GOOD = 2
    PROBABLY_BAD = 3
    BAD = 4
    MISSING = 9


TIME = Column("time", "", "time of the row, UTC, strictly increasing", "datetime64[ns, UTC]")

#: What an instrument measured; each has a companion ``<name>_qc`` column (OG1 flags).
MEASURED = (
    Column("pressure", "dbar", "sea pressure, zero at the surface"),
    Column("temperature", "degC", "in-situ temperature, ITS-90"),
    Column("conductivity", "S/m", "conductivity"),
    Column("pitch", "rad", "pitch, nose up positive"),
    Column("pitch_rate", "rad/s", "rate of pitch by a gyro, nose up positive"),
    Column("roll", "rad", "roll, right wing down positive"),
    Column("heading", "rad", "heading, true north, 0 to 2 pi"),
    Column("buoyancy_volume", "m3", "buoyancy engine, positive = light"),
    Column("battery_position", "m", "battery position, positive forward"),
    Column("battery_roll", "rad", "battery roll"),
    Column("propeller_speed", "rev/s", "propeller speed"),
    Column("propeller_power", "W", "propeller power"),
    Column("battery_voltage", "V", "battery voltage"),
    Column("speed_through_water", "m/s", "speed through water by a sensor (DVL, ADCP, flowmeter)"),
    Column("latitude", "degrees_north", "latitude, fixes only"),
    Column("longitude", "degrees_east", "longitude, fixes only"),
)

#: What follows from the measurements row by row.
DERIVED = (
    Column("depth", "m", "depth, positive down"),
    Column("salinity", "1", "practical salinity, PSS-78"),
    Column("absolute_salinity", "g/kg", "absolute salinity, TEOS-10"),
    Column("conservative_temperature", "degC", "conservative temperature, TEOS-10"),
    Column("density", "kg/m3", "in-situ density at the pressure, TEOS-10"),
    Column("speed_through_water_std", "m/s", "1-sigma of speed_through_water"),
)

RECORDS = (
    TIME,
    *MEASURED,
    *DERIVED,
    *(Column(f"{c.name}_qc", "", f"OG1 quality flag of {c.name}", "int8") for c in MEASURED),
    Column("phase", "", "OG1 PHASE", "int8"),
    Column("dive", "", "dive number, 0 before the first dive", "int32"),
    Column("block", "", "number of the steady-flight block, -1 outside", "int32"),
)

ESTIMATES = (
    TIME,
    Column("dive", "", "dive number", "int32"),
    Column("method", "", "kinematic or force", "string"),
    Column("speed", "m/s", "speed through water V"),
    Column("speed_std", "m/s", "1-sigma of speed"),
    Column("path_angle", "rad", "flight-path angle through water, climbing positive"),
    Column("path_angle_std", "rad", "1-sigma of path_angle"),
    Column("angle_of_attack", "rad", "angle of attack, flow from below positive"),
    Column("angle_of_attack_std", "rad", "1-sigma of angle_of_attack"),
    Column("pitch", "rad", "pitch, nose up positive"),
    Column("pitch_std", "rad", "1-sigma of pitch"),
    Column("depth", "m", "depth, positive down"),
    Column("depth_std", "m", "1-sigma of depth"),
    Column("vertical_water_velocity", "m/s", "vertical velocity of the water, up positive"),
    Column("vertical_water_velocity_std", "m/s", "1-sigma of vertical_water_velocity"),
    Column("observable", "", "whether the data determine the speed here", "bool"),
    Column("reason", "", "why not, where observable is false", "string"),
)

BLOCKS = (
    Column("block", "", "number of the block", "int32"),
    Column("start", "", "first instant", "datetime64[ns, UTC]"),
    Column("end", "", "last instant", "datetime64[ns, UTC]"),
    Column("dive", "", "dive number", "int32"),
    Column("direction", "", "-1 down, +1 up, 0 level", "int8"),
    Column("powered", "", "propeller turning", "bool"),
    Column("used", "", "whether the block enters comparison and fit", "bool"),
    Column("reason", "", "why not, where used is false", "string"),
    Column("speed", "m/s", "mean speed through water, kinematic estimate"),
    Column("speed_std", "m/s", "1-sigma of speed"),
    Column("angle_of_attack", "rad", "mean angle of attack"),
    Column("angle_of_attack_std", "rad", "1-sigma of angle_of_attack"),
    Column("pitch", "rad", "mean pitch"),
    Column("pitch_std", "rad", "1-sigma of pitch, bias included"),
    Column("path_angle", "rad", "mean flight-path angle"),
    Column("path_angle_std", "rad", "1-sigma of path_angle"),
    Column("depth_rate", "m/s", "mean rate of depth, positive sinking, from pressure alone"),
    Column("depth_rate_std", "m/s", "1-sigma of depth_rate, measurement only"),
    Column("net_buoyancy", "N", "mean net buoyancy force, up positive"),
    Column("net_buoyancy_std", "N", "1-sigma of net_buoyancy"),
    Column("buoyancy_by_compression", "N Pa", "change of net_buoyancy per compressibility of the hull"),
    Column("buoyancy_by_expansion", "N K", "change of net_buoyancy per thermal expansion of the hull"),
    Column("buoyancy_by_lag", "N/s", "change of net_buoyancy per time constant of the hull's temperature"),
    Column("buoyancy_by_carried", "N", "change of net_buoyancy per share of the hull's volume that a fairing carries"),
    Column("buoyancy_by_flushing", "N/s", "change of net_buoyancy per time in which that water is renewed"),
    Column("propeller_speed", "rev/s", "mean propeller speed"),
    Column("propeller_speed_std", "rev/s", "1-sigma of propeller_speed"),
    Column("propeller_power", "W", "propeller power, constant, of the same mean thrust"),
    Column("propeller_power_std", "W", "1-sigma of propeller_power"),
    Column("battery_voltage", "V", "mean battery voltage"),
    Column("battery_position", "m", "mean battery position, forward positive"),
    Column("battery_position_std", "m", "1-sigma of battery_position"),
    Column("density", "kg/m3", "mean in-situ density"),
    Column("density_std", "kg/m3", "1-sigma of density"),
    Column("depth", "m", "mean depth"),
    Column("heading", "rad", "mean heading, true north, 0 to 2 pi"),
    Column("roll", "rad", "mean roll, right wing down positive"),
    Column("sensor_speed", "m/s", "mean speed by a sensor, where one is carried"),
    Column("sensor_speed_std", "m/s", "1-sigma of sensor_speed"),
)

#: What the vehicle's own flight model had put into its files; never used as a measurement.
STORED = (
    TIME,
    Column("speed", "m/s", "speed through water of the stored flight model"),
    Column("vertical_speed", "m/s", "vertical speed through water of the stored flight model, up positive"),
)

#: Speed [rev/s] or power [W] above which a propeller turns.
TURNING = {"propeller_speed": 0.5, "propeller_power": 1.0}

#: How a trim fixes the vehicle's attitude in the theory.
TRIMS = ("pitch", "battery", "fixed_alpha")

PREDICTIONS = (
    Column("block", "", "number of the block", "int32"),
    Column("trim", "", "pitch: measured pitch held; battery: moment balance; fixed_alpha: -K_M0/K_M", "string"),
    Column("speed", "m/s", "predicted steady speed V_e"),
    Column("speed_std", "m/s", "1-sigma of speed from coefficients and inputs"),
    Column("path_angle", "rad", "predicted flight-path angle"),
    Column("path_angle_std", "rad", "1-sigma of path_angle"),
    Column("angle_of_attack", "rad", "predicted angle of attack"),
    Column("angle_of_attack_std", "rad", "1-sigma of angle_of_attack"),
    Column("pitch", "rad", "predicted pitch theta_e"),
    Column("pitch_std", "rad", "1-sigma of pitch"),
    Column("thrust", "N", "predicted thrust"),
    Column("stable", "", "whether all of the paper's inequalities hold", "bool"),
    Column("speed_lower", "m/s", "lower bound of the stable range, Eq. (27)"),
    Column("speed_upper", "m/s", "upper bound of the stable range, from Eq. (28)"),
    Column("reason", "", "why there is no prediction, where speed is NaN", "string"),
)


def units(columns: tuple[Column, ...]) -> dict[str, str]:
    """Return the unit of each column by name."""
    return {column.name: column.unit for column in columns}


def conform(frame: pd.DataFrame, columns: tuple[Column, ...]) -> pd.DataFrame:
    """Return `frame` with exactly `columns`, in order and with their types.

    Missing float columns become NaN, missing flags ``Quality.MISSING`` (``*_qc``) or 0, missing text "".

    Raises
    ------
    KeyError
        If `frame` has a column that the table does not know.
    """
    unknown = set(frame.columns) - {column.name for column in columns}
    if unknown:
        raise KeyError(f"not in the canonical table: {', '.join(sorted(unknown))}")
    out: dict[str, pd.Series[Any]] = {}
    for column in columns:
        dtype: Any = column.dtype
        if column.name in frame:
            out[column.name] = frame[column.name].astype(dtype)
        else:
            out[column.name] = pd.Series(_missing(column), index=frame.index, dtype=dtype)
    made = pd.DataFrame(out, index=frame.index, copy=False)  # each is a copy already, or becomes one when written to
    made.index = pd.RangeIndex(len(made))
    return made


def _missing(column: Column) -> Any:
    if column.dtype == "float64":
        return np.nan
    if column.name.endswith("_qc"):
        return int(Quality.MISSING)
    if column.dtype == "string":
        return ""
    if column.dtype.startswith("datetime64"):
        return pd.NaT
    if column.name == "block":
        return -1
    return 0


def of_method(estimates: pd.DataFrame, method: str) -> pd.DataFrame:
    """Return the rows of the canonical estimates by one method, numbered from 0."""
    return estimates[estimates["method"] == method].reset_index(drop=True)


def seconds(time: pd.Series) -> np.ndarray:
    """Return the column `time`, of microsecond resolution, as float seconds since 1970-01-01 UTC, shape (n,)."""
    return np.asarray(pd.DatetimeIndex(time).as_unit("us").asi8 / 1e6)


def microseconds(posix: np.ndarray) -> np.ndarray:
    """Return POSIX seconds, shape (n,), as whole microseconds; seconds and fraction apart, to lose no digit."""
    time = np.asarray(posix, dtype=np.float64)
    whole = np.floor(time)
    return whole.astype(np.int64) * 10**6 + np.round((time - whole) * 1e6).astype(np.int64)


def timestamps(posix: np.ndarray) -> pd.DatetimeIndex:
    """Return POSIX seconds, shape (n,), as UTC time stamps of nanosecond type (microsecond resolution)."""
    return pd.DatetimeIndex((microseconds(posix) * 1000).view("M8[ns]"), tz="UTC")


def usable(frame: Columns, name: str) -> np.ndarray:
    """Return where column `name` was measured and is not flagged bad or probably bad, boolean of shape (n,)."""
    flag = frame[f"{name}_qc"].to_numpy()
    good = (flag != Quality.BAD) & (flag != Quality.PROBABLY_BAD)
    return np.asarray(good & np.isfinite(frame[name].to_numpy(dtype=np.float64)))


def undoubted(frame: pd.DataFrame) -> pd.DataFrame:
    """Return `frame` with NaN for each measurement that is flagged bad or probably bad, and for depth with pressure.

    Parameters
    ----------
    frame
        Columns of the canonical records, measurements with their flags.
    """
    changed: dict[str, np.ndarray] = {}
    for column in MEASURED:
        if f"{column.name}_qc" not in frame:
            continue
        flag = frame[f"{column.name}_qc"].to_numpy()
        doubted = (flag == Quality.BAD) | (flag == Quality.PROBABLY_BAD)
        if doubted.any():
            for name in (column.name, "depth") if column.name == "pressure" else (column.name,):
                if name in frame:
                    changed[name] = np.where(doubted, np.nan, frame[name].to_numpy())
    return frame.assign(**changed) if changed else frame

"""Headers of plain tables: which column is which, guessed from the names people give them."""

from __future__ import annotations

import re

from pipeline.ingest.units import QUANTITIES, known

#: Names by which a quantity goes, in lower case with underscores; CF's standard names and Chinese ones among them.
_SYNONYMS: dict[str, str] = {
    "time": "time timestamp datetime date_time unix_time unixtime posix posix_time epoch epoch_time utc utc_time "
    "time_utc time_unix date present_time realtimeclock sampletime sample_time obstime "
    "datenum matlab_datenum matlab_time juld julian_date "
    "posixtime posix_seconds 时间 采样时间 日期时间 日期 北京时间",
    "pressure": "pressure pres press sea_pressure water_pressure p_dbar ctd_p prdm pr sea_water_pressure "
    "seapressure_00 压力 压强",
    "depth": "depth dep ctd_depth 深度",
    "temperature": "temperature temp t90 t_90 water_temperature water_temp sea_temperature tv290c insitu_temperature "
    "sea_water_temperature temperature_00 温度 水温",
    "conductivity": "conductivity cond water_cond cndc c0s sea_water_electrical_conductivity conductivity_00 电导率",
    "salinity": "salinity psal practical_salinity sal sea_water_practical_salinity sea_water_salinity salinity_00 盐度",
    "pitch": "pitch pitch_angle pitchang pitch_ang "
    "platform_pitch platform_pitch_angle platform_pitch_fore_up 俯仰 俯仰角",
    "pitch_rate": "pitch_rate pitchrate pitch_angular_rate pitch_gyro gyro_pitch",
    "roll": "roll roll_angle rollang roll_ang bank "
    "platform_roll platform_roll_angle platform_roll_starboard_down 横滚 横滚角 横滚角度",
    "heading": "heading head yaw hdg heading_angle true_heading compass course_angle "
    "heading_true platform_orientation 航向 航向角 艏向 艏向角",
    "buoyancy_volume": "buoyancy_volume ballast ballast_volume ballast_pumped ballastpos pump_vol pump_volume "
    "pumped_volume oil_volume oil_vol de_oil_vol vbd vbdcc vbd_cc engine_volume buoyancy_engine bladder "
    "bladder_volume 油量 排油量 浮力体积",
    "battery_position": "battery_position batt_pos battpos battery_pos linpos battery_linear pitch_battery "
    "battery_shift movable_mass_position 重心位置 电池位置",
    "battery_roll": "battery_roll batt_roll angpos battery_rotation roll_battery",
    "propeller_speed": "propeller_speed propeller prop_speed rpm propeller_rpm prop_rpm motor_rpm thruster_rpm "
    "thruster_speed motor_speed prop rps propeller_rate 螺旋桨转速 推进器转速",
    "propeller_power": "propeller_power prop_power thruster_power motor_power mot_pwr thruster_pwr propulsion_power",
    "battery_voltage": "battery_voltage batt_voltage bat_voltage battery_volts batt_volts battery_v batt_v vbat vbatt "
    "voltage m_battery 电池电压",
    "speed_through_water": "speed_through_water stw water_speed dvl_speed flow_speed adcp_speed "
    "through_water_speed u_dvl",
    "speed_through_water_std": "speed_through_water_std stw_std water_speed_std dvl_speed_std",
    "latitude": "latitude lat gps_lat gps_latitude 纬度",
    "longitude": "longitude lon long lng gps_lon gps_longitude 经度",
    "magnetic_variation": "magnetic_variation mag_var magvar magnetic_declination declination gps_mag_var gps_magvar",
    "dead_reckoning": "dead_reckoning deadreckoning",
    "profiler_pressure": "ad2cp_pressure",
    "beam_fore": "ad2cp_v1_cn1",
    "beam_port": "ad2cp_v2_cn1",
    "beam_aft": "ad2cp_v3_cn1",
    "beam_starboard": "ad2cp_v4_cn1",
}
_BY_NAME = {word: name for name, words in _SYNONYMS.items() for word in words.split()}

#: Names that other quantities go by as well (potential temperature, net buoyancy): believed with a unit that fits.
_WITH_UNIT = {"theta": "pitch", "phi": "roll", "psi": "heading", "buoyancy": "buoyancy_volume"}

#: Names that say their unit: a propeller's rpm, and the units that Slocum gliders log in.
_IMPLIED = {
    "rpm": "rpm",
    "propeller_rpm": "rpm",
    "prop_rpm": "rpm",
    "motor_rpm": "rpm",
    "thruster_rpm": "rpm",
    "rps": "rev/s",
    "vbdcc": "cm3",
    "vbd_cc": "cm3",
    "p_dbar": "dbar",
    "legato_conductivity": "mS/cm",
    "sci_water_pressure": "bar",
    "m_pressure": "bar",
    "m_battpos": "in",
    "m_gps_mag_var": "-rad",
    "ad2cp_pressure": "dbar",
    "ad2cp_v1_cn1": "m/s",
    "ad2cp_v2_cn1": "m/s",
    "ad2cp_v3_cn1": "m/s",
    "ad2cp_v4_cn1": "m/s",
    "北京时间": "UTC+8",
}
#: Brackets as wide as the Chinese characters beside them.
_BRACKETS = str.maketrans("（）［］", "()[]")
#: Standard names of CF whose sign is the opposite of the records'.
_REVERSED = {"platform_pitch_fore_down": "pitch", "platform_roll_starboard_up": "roll"}
#: Headings that are magnetic by their name.
_MAGNETIC = {"m_heading", "eng_head", "magnetic_heading", "mag_heading", "heading_mag", "heading_magnetic"}
#: Positions of a SeaExplorer's payload: where its other computer takes itself to be.
_RECKONED = {"nav_latitude", "nav_longitude"}
#: Of a receiver, in the OceanGliders and EGO formats: positions that are fixes, and a clock of their own.
_FIXES = {"time_gps": "time", "latitude_gps": "latitude", "longitude_gps": "longitude"}
#: Beams of a Doppler profiler by the positions of the heads, and what is read with them.
BEAMS = ("beam_fore", "beam_port", "beam_aft", "beam_starboard")
PROFILER = (*BEAMS, "profiler_pressure")
#: A SeaExplorer's clock of its profiler, and how it is written.
PROFILER_CLOCK = ("ad2cp_time", "%m%d%y %H:%M:%S")
#: Flags of the same scale by another name: of IMOS, SOCIB and QARTOD.
_FLAGGED = re.compile(r"^(?:(?P<name>.+)_(?:qc|quality_control|qartod_primary_flag)|qc_(?P<behind>.+))$", re.IGNORECASE)

#: Single letters, only as written here: a lower-case p or t is as often a roll rate or a time.
_LETTERS = {"P": "pressure", "T": "temperature", "C": "conductivity", "S": "salinity", "t": "time", "z": "depth"}

#: Instruments and vehicles whose name may stand before that of the quantity.
_PREFIXES = {
    "ctd",
    "gpctd",
    "legato",
    "sbe41",
    "sbe",
    "rbr",
    "sci",
    "m",
    "nav",
    "pld",
    "eng",
    "glider",
    "vehicle",
    "gps",
    "precise",
    "rbrctd",
    "imu",
    "ahrs",
    "attitude",
}

#: What a name without its prefix would be taken for and is not: the course over ground, the air inside the hull.
_OTHERS = {"gps_heading", "gps_course", "vehicle_temp", "vehicle_temperature"}

#: Parts of a date that stand in columns of their own, and those that make a time.
CALENDAR = ("year", "month", "day", "day_of_year", "hour", "minute", "second")
_SUFFICIENT = ({"year", "month", "day", "hour"}, {"year", "day_of_year"})
_PARTS = {
    "year": "year yyyy yr",
    "month": "month mon",
    "day": "day dd mday day_of_month",
    "day_of_year": "day_of_year doy yday yearday year_day",
    "hour": "hour hours hh hr",
    "minute": "minute minutes min mn",
    "second": "second seconds sec ss",
}
_PART_BY_NAME = {word: part for part, words in _PARTS.items() for word in words.split()}

#: What `pipeline.ingest.text` adds to a name that comes again.
_REPEATED = re.compile(r" #\d+$")
_TIME_UNITS = {"s", "ms", "us", "ns", "timestamp"}


def quantity(header: str, below: str = "") -> tuple[str | None, str | None]:
    """Return the canonical name and the unit that a column's `header` suggests, None where it suggests none.

    Understood are names with a unit in brackets or as a suffix, with or without the instrument in front:
    ``Pressure (dbar)``, ``pitch_deg``, ``Temp [°C]``, ``GPCTD_PRESSURE``, ``WaterTemperature``; single letters only
    as they are usually written (``P``, ``T``, ``z``); and ``<name>_qc`` for a flag. A unit with a minus sign says that
    the sign is reversed: Slocum's magnetic variation is positive west.

    Parameters
    ----------
    header
        The column's name.
    below
        Its unit where it is stated elsewhere, "" where it is not.
    """
    text = _REPEATED.sub("", header).translate(_BRACKETS).strip()
    bracket = re.match(r"^(.*?)\s*[(\[]([^)\]]*)[)\]]\s*$", text)
    if bracket and bracket[1].strip():
        bare, unit = bracket[1].strip(), bracket[2].strip() or None
        name = _bare(bare)
        if name is None and unit:
            name = _fitting(_LETTERS.get(bare.upper()) or _WITH_UNIT.get(_plain(bare)), unit)
        return name, (unit or _implied(bare)) if name else None
    name = _bare(text)
    if name is not None:
        return name, _implied(text)
    if flags := _FLAGGED.match(text):
        flagged = _bare(flags["name"] or flags["behind"])
        return (f"{flagged}_qc" if flagged in QUANTITIES else None), None
    for words in (_plain(text).split("_"), _camel(text).split("_")):
        for count in (2, 1):
            stem, suffix = "_".join(words[:-count]), "_".join(words[-count:])
            name = _LETTERS.get(text[0].upper()) if len(stem) == 1 else _lookup(stem) or _WITH_UNIT.get(stem)
            if _fitting(name, suffix):
                return name, suffix
    return (_fitting(_WITH_UNIT.get(_plain(text)), below) if below else None), None


def meant(standard_name: str) -> tuple[str | None, bool]:
    """Return the canonical name that a CF `standard_name` says, and whether its sign is the opposite."""
    return _REVERSED.get(standard_name) or _BY_NAME.get(standard_name), standard_name in _REVERSED


def is_magnetic(header: str) -> bool:
    """Return whether a column of heading counts from magnetic north by its `header`."""
    return _plain(re.sub(r"[(\[].*", "", header)) in _MAGNETIC


def is_reckoned(header: str) -> bool:
    """Return whether a column of positions holds the vehicle's own reckoning by its `header`, no fixes."""
    return _plain(header) in _RECKONED


def of_receiver(header: str) -> str | None:
    """Return what column `header` is of a receiver's own record (``TIME_GPS``, ``LATITUDE_GPS_QC``), None if none."""
    plain = _plain(re.sub(r"[(\[].*", "", header))
    name = _FIXES.get(plain.removesuffix("_qc"))
    return f"{name}_qc" if name and plain.endswith("_qc") else name


def is_profiler_clock(header: str) -> bool:
    """Return whether column `header` is the clock of a Doppler profiler beside that of the payload."""
    return _plain(header) == PROFILER_CLOCK[0]


def calendar(columns: list[str]) -> dict[str, str]:
    """Return which of `columns` is which part of a date (`CALENDAR`); none unless they make a time."""
    found: dict[str, str] = {}
    for column in columns:
        words = _plain(re.sub(r"[(\[].*", "", column))
        part = _PART_BY_NAME.get(words) or _PART_BY_NAME.get(words.rpartition("_")[2])
        if part is not None:
            found.setdefault(part, column)
    sufficient = any(parts <= set(found) for parts in _SUFFICIENT)
    return {part: found[part] for part in CALENDAR if part in found} if sufficient else {}


def _fitting(name: str | None, unit: str) -> str | None:
    """Return `name` if `unit` is one of its units."""
    if name is None:
        return None
    fits = unit in _TIME_UNITS if name == "time" else known(name, unit)
    return name if fits else None


def _bare(text: str) -> str | None:
    if len(text) == 1:
        return _LETTERS.get(text)
    return _lookup(_plain(text)) or _lookup(_camel(text))


def _implied(text: str) -> str | None:
    return _IMPLIED.get(_plain(text))


def _lookup(words: str) -> str | None:
    if words in _BY_NAME or words in _FIXES:
        return _BY_NAME.get(words) or _FIXES[words]
    first, _, rest = words.partition("_")
    return _lookup(rest) if first in _PREFIXES and rest and words not in _OTHERS else None


def _plain(text: str) -> str:
    return re.sub(r"[^0-9a-z\u4e00-\u9fff]+", "_", text.lower()).strip("_")


def _camel(text: str) -> str:
    return _plain(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", text))

"""Headers of plain tables: which column is which, guessed from the names people give them."""

from __future__ import annotations

import re

from pipeline.ingest.units import QUANTITIES, known

#: Names by which a quantity goes, in lower case with underscores.
_SYNONYMS: dict[str, str] = {
    "time": "time timestamp datetime date_time unix_time unixtime posix posix_time epoch epoch_time utc utc_time "
    "time_utc time_unix date present_time realtimeclock sampletime sample_time obstime",
    "pressure": "pressure pres press sea_pressure water_pressure p_dbar ctd_p prdm pr",
    "depth": "depth dep ctd_depth water_depth",
    "temperature": "temperature temp t90 t_90 water_temperature water_temp sea_temperature tv290c insitu_temperature",
    "conductivity": "conductivity cond water_cond cndc c0s",
    "salinity": "salinity psal practical_salinity sal",
    "pitch": "pitch pitch_angle pitchang pitch_ang",
    "pitch_rate": "pitch_rate pitchrate pitch_angular_rate pitch_gyro gyro_pitch",
    "roll": "roll roll_angle rollang roll_ang bank",
    "heading": "heading head yaw hdg heading_angle true_heading compass course_angle",
    "buoyancy_volume": "buoyancy_volume ballast ballast_volume ballast_pumped ballastpos pump_vol pump_volume "
    "pumped_volume oil_volume oil_vol de_oil_vol vbd vbdcc vbd_cc engine_volume buoyancy_engine bladder "
    "bladder_volume",
    "battery_position": "battery_position batt_pos battpos battery_pos linpos battery_linear pitch_battery "
    "battery_shift movable_mass_position",
    "battery_roll": "battery_roll batt_roll angpos battery_rotation roll_battery",
    "propeller_speed": "propeller_speed propeller prop_speed rpm propeller_rpm prop_rpm motor_rpm thruster_rpm "
    "thruster_speed motor_speed prop rps propeller_rate",
    "propeller_power": "propeller_power prop_power thruster_power motor_power mot_pwr thruster_pwr propulsion_power",
    "battery_voltage": "battery_voltage batt_voltage bat_voltage battery_volts batt_volts battery_v batt_v vbat vbatt "
    "voltage m_battery",
    "speed_through_water": "speed_through_water stw water_speed dvl_speed flow_speed adcp_speed "
    "through_water_speed u_dvl",
    "speed_through_water_std": "speed_through_water_std stw_std water_speed_std dvl_speed_std",
    "latitude": "latitude lat gps_lat gps_latitude",
    "longitude": "longitude lon long lng gps_lon gps_longitude",
}
_BY_NAME = {word: name for name, words in _SYNONYMS.items() for word in words.split()}

#: Names that other quantities go by as well (potential temperature, net buoyancy): believed with a unit that fits.
_WITH_UNIT = {"theta": "pitch", "buoyancy": "buoyancy_volume"}

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
    "sci_water_pressure": "bar",
    "m_pressure": "bar",
    "m_battpos": "in",
}

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
}

#: What `pipeline.ingest.text` adds to a name that comes again.
_REPEATED = re.compile(r" #\d+$")
_TIME_UNITS = {"s", "ms", "us", "ns"}


def quantity(header: str) -> tuple[str | None, str | None]:
    """Return the canonical name and the unit that a column's `header` suggests, None where it suggests none.

    Understood are names with a unit in brackets or as a suffix, with or without the instrument in front:
    ``Pressure (dbar)``, ``pitch_deg``, ``Temp [°C]``, ``GPCTD_PRESSURE``, ``WaterTemperature``; single letters only
    as they are usually written (``P``, ``T``, ``z``); and ``<name>_qc`` for a flag.
    """
    text = _REPEATED.sub("", header).strip()
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
    if text.lower().endswith("_qc"):
        flagged = _bare(text[: -len("_qc")])
        return (f"{flagged}_qc" if flagged in QUANTITIES else None), None
    for words in (_plain(text).split("_"), _camel(text).split("_")):
        for count in (2, 1):
            stem, suffix = "_".join(words[:-count]), "_".join(words[-count:])
            name = _LETTERS.get(text[0].upper()) if len(stem) == 1 else _lookup(stem) or _WITH_UNIT.get(stem)
            if _fitting(name, suffix):
                return name, suffix
    return None, None


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
    if words in _BY_NAME:
        return _BY_NAME[words]
    first, _, rest = words.partition("_")
    return _lookup(rest) if first in _PREFIXES and rest else None


def _plain(text: str) -> str:
    return re.sub(r"[^0-9a-z]+", "_", text.lower()).strip("_")


def _camel(text: str) -> str:
    return _plain(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", text))

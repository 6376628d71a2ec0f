"""Units of plain tables: from what people write in headers to SI, radians, dbar and °C."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pipeline.findings import InputError, nearest

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Dimension:
    """A kind of quantity: its name and, per unit, factor and offset to the canonical one (the first listed)."""

    name: str
    units: dict[str, tuple[float, float]]

    @property
    def canonical(self) -> str:
        """The unit with factor 1 and offset 0 that the records use."""
        return next(iter(self.units))


_ANGLE = Dimension("angle", {"rad": (1.0, 0.0), "deg": (math.pi / 180.0, 0.0)})
_TURNING = Dimension("angular rate", {"rad/s": (1.0, 0.0), "deg/s": (math.pi / 180.0, 0.0)})
_LENGTH = Dimension(
    "length", {"m": (1.0, 0.0), "cm": (0.01, 0.0), "mm": (0.001, 0.0), "in": (0.0254, 0.0), "ft": (0.3048, 0.0)}
)
#: Standard atmosphere, dbar.
_ATMOSPHERE = 10.1325
_PRESSURE = Dimension(
    "pressure",
    {
        "dbar": (1.0, 0.0),
        "bar": (10.0, 0.0),
        "mbar": (0.01, 0.0),
        "pa": (1e-4, 0.0),
        "hpa": (0.01, 0.0),
        "kpa": (0.1, 0.0),
        "mpa": (100.0, 0.0),
        "psi": (0.6894757293168361, 0.0),
        # Absolute pressure: what the sensor feels, the atmosphere's included.
        "dbara": (1.0, -_ATMOSPHERE),
        "bara": (10.0, -_ATMOSPHERE),
        "psia": (0.6894757293168361, -_ATMOSPHERE),
    },
)
_TEMPERATURE = Dimension("temperature", {"degc": (1.0, 0.0), "k": (1.0, -273.15), "degf": (5.0 / 9.0, -160.0 / 9.0)})
_CONDUCTIVITY = Dimension(
    "conductivity", {"s/m": (1.0, 0.0), "ms/cm": (0.1, 0.0), "us/cm": (1e-4, 0.0), "ms/m": (1e-3, 0.0)}
)
_VOLUME = Dimension("volume", {"m3": (1.0, 0.0), "l": (1e-3, 0.0), "cm3": (1e-6, 0.0)})
_ROTATION = Dimension("rotation", {"rev/s": (1.0, 0.0), "rpm": (1.0 / 60.0, 0.0), "rad/s": (0.5 / math.pi, 0.0)})
_POWER = Dimension("power", {"w": (1.0, 0.0), "kw": (1000.0, 0.0)})
_VOLTAGE = Dimension("voltage", {"v": (1.0, 0.0), "mv": (1e-3, 0.0)})
_SPEED = Dimension(
    "speed",
    {"m/s": (1.0, 0.0), "cm/s": (0.01, 0.0), "mm/s": (1e-3, 0.0), "km/h": (1 / 3.6, 0.0), "kn": (1852 / 3600, 0.0)},
)
#: ``ddmm``: degrees and decimal minutes run together, 5442.5 = 54° 42.5', as NMEA receivers write.
_POSITION = Dimension("position", {"deg": (1.0, 0.0), "rad": (180.0 / math.pi, 0.0), "ddmm": (1.0, 0.0)})
_SALINITY = Dimension("practical salinity", {"1": (1.0, 0.0)})
_FLAG = Dimension("flag", {"1": (1.0, 0.0)})

#: What a plain table may hold besides time, and its kind. `depth` and `salinity` become pressure and conductivity,
#: `pressure_interpolated` is one that serves salinity and density alone, `magnetic_variation` turns a magnetic heading
#: true, `dead_reckoning` is 1 where positions are no fixes, the beams of a Doppler profiler become a speed through
#: water.
QUANTITIES: dict[str, Dimension] = {
    "pressure": _PRESSURE,
    "pressure_interpolated": _PRESSURE,
    "depth": _LENGTH,
    "temperature": _TEMPERATURE,
    "conductivity": _CONDUCTIVITY,
    "salinity": _SALINITY,
    "pitch": _ANGLE,
    "pitch_rate": _TURNING,
    "roll": _ANGLE,
    "heading": _ANGLE,
    "buoyancy_volume": _VOLUME,
    "battery_position": _LENGTH,
    "battery_roll": _ANGLE,
    "propeller_speed": _ROTATION,
    "propeller_power": _POWER,
    "battery_voltage": _VOLTAGE,
    "speed_through_water": _SPEED,
    "speed_through_water_std": _SPEED,
    "latitude": _POSITION,
    "longitude": _POSITION,
    "magnetic_variation": _ANGLE,
    "dead_reckoning": _FLAG,
    "profiler_pressure": _PRESSURE,
    "beam_fore": _SPEED,
    "beam_port": _SPEED,
    "beam_aft": _SPEED,
    "beam_starboard": _SPEED,
}

_SPELLINGS = {
    "decibar": "dbar",
    "decibars": "dbar",
    "db": "dbar",
    "dbars": "dbar",
    "bars": "bar",
    "millibar": "mbar",
    "pascal": "pa",
    "metre": "m",
    "meter": "m",
    "metres": "m",
    "meters": "m",
    "inch": "in",
    "inches": "in",
    "feet": "ft",
    "foot": "ft",
    "c": "degc",
    "°c": "degc",
    "celsius": "degc",
    "degreec": "degc",
    "degreesc": "degc",
    "degree_c": "degc",
    "degrees_c": "degc",
    "deg_c": "degc",
    "degreescelsius": "degc",
    "degree_celsius": "degc",
    "degrees_celsius": "degc",
    "kelvin": "k",
    "f": "degf",
    "℃": "degc",
    "deg.c": "degc",
    "its-90": "degc",
    "its-90,degc": "degc",
    "degcits-90": "degc",
    "摄氏度": "degc",
    "度": "deg",
    "米": "m",
    "毫米": "mm",
    "分巴": "dbar",
    "毫升": "cm3",
    "立方厘米": "cm3",
    "转/分": "rpm",
    "伏": "v",
    "°f": "degf",
    "fahrenheit": "degf",
    "degree": "deg",
    "degrees": "deg",
    "°": "deg",
    "decimal_degrees": "deg",
    "degrees_north": "deg",
    "degrees_east": "deg",
    "degree_north": "deg",
    "degree_east": "deg",
    "radian": "rad",
    "radians": "rad",
    "s_m": "s/m",
    "siemens/m": "s/m",
    "siemens_per_meter": "s/m",
    "siemens_per_metre": "s/m",
    "siemens/meter": "s/m",
    "siemens/metre": "s/m",
    "millisiemens/cm": "ms/cm",
    "millisiemens_per_centimeter": "ms/cm",
    "millisiemens/centimeter": "ms/cm",
    "mmho/cm": "ms/cm",
    "mmhos/cm": "ms/cm",
    "mho/m": "s/m",
    "mhos/m": "s/m",
    "sm-1": "s/m",
    "ms_cm": "ms/cm",
    "mscm-1": "ms/cm",
    "us_cm": "us/cm",
    "uscm-1": "us/cm",
    "litre": "l",
    "liter": "l",
    "litres": "l",
    "liters": "l",
    "cc": "cm3",
    "ml": "cm3",
    "rps": "rev/s",
    "hz": "rev/s",
    "1/s": "rev/s",
    "rev_s": "rev/s",
    "rev/min": "rpm",
    "r/min": "rpm",
    "1/min": "rpm",
    "min-1": "rpm",
    "degrees/s": "deg/s",
    "rad_s": "rad/s",
    "rads-1": "rad/s",
    "deg_s": "deg/s",
    "degs-1": "deg/s",
    "°/s": "deg/s",
    "dps": "deg/s",
    "watt": "w",
    "watts": "w",
    "volt": "v",
    "volts": "v",
    "millivolt": "mv",
    "millivolts": "mv",
    "m_s": "m/s",
    "ms-1": "m/s",
    "mm_s": "mm/s",
    "mms-1": "mm/s",
    "cm_s": "cm/s",
    "cms-1": "cm/s",
    "knot": "kn",
    "knots": "kn",
    "kt": "kn",
    "kts": "kn",
    "nmea": "ddmm",
    "lat": "ddmm",
    "lon": "ddmm",
    "ddmm.mm": "ddmm",
    "ddmm.mmm": "ddmm",
    "ddmm.mmmm": "ddmm",
    "degn": "deg",
    "dege": "deg",
    "degree_n": "deg",
    "degree_e": "deg",
    "degreesn": "deg",
    "degreese": "deg",
    "degt": "deg",
    "degreestrue": "deg",
    "degrees_true": "deg",
    "degree_true": "deg",
    "arc_degree": "deg",
    "arc_degrees": "deg",
    "angular_degree": "deg",
    "angular_degrees": "deg",
    "psu": "1",
    "ppt": "1",
    "‰": "1",
    "pss": "1",
    "pss-78": "1",
    "pss78": "1",
    "1e-3": "1",
    "1e-03": "1",
    "0.001": "1",
}
#: Every unit that some quantity has, as `spelling` returns it.
UNITS = {unit for dimension in QUANTITIES.values() for unit in dimension.units} - {"1"}


_PLAIN = str.maketrans("³µμ⁻¹º", "3uu-1°")


def spelling(unit: str) -> str:
    """Return `unit` as the tables of this module spell it: lower case, no blanks, no superscripts."""
    plain = re.sub(r"[\s^*{}]", "", unit.strip().lower()).translate(_PLAIN)
    plain = re.sub(r"(?<=[a-z])\.(?=[a-z]+-1)", "", plain)
    return _SPELLINGS.get(plain, plain)


def known(name: str, unit: str) -> bool:
    """Return whether `unit` is a unit of the quantity `name`; a leading minus sign, for reversed signs, is allowed."""
    return spelling(unit.removeprefix("-")) in QUANTITIES[name].units


def convert(values: Array, name: str, unit: str, file: str, column: str) -> Array:
    """Return `values`, shape (n,), of quantity `name` in the unit of the records.

    A unit with a leading minus sign (``-deg``, ``-cm3``) reverses the sign: pitch nose down, ballast heavy. Pitch and
    roll that run from 0 to 360° come out within ±180°.

    Raises
    ------
    InputError
        If `unit` is not a unit of that quantity; the nearest is named.
    """
    import numpy as np

    dimension = QUANTITIES[name]
    sign = -1.0 if unit.startswith("-") else 1.0
    key = spelling(unit.removeprefix("-"))
    if key not in dimension.units:
        raise InputError(
            file,
            f"column '{column}'",
            found=f"unit '{unit}' for {name}",
            expected=f"a unit of {dimension.name}",
            remedy=nearest(key, list(dimension.units)),
        )
    if key == "ddmm":
        degrees = np.trunc(values / 100.0)
        return np.asarray(sign * (degrees + (values - 100.0 * degrees) / 60.0))
    factor, offset = dimension.units[key]
    found = np.asarray(sign * (values * factor + offset))
    if name in ("pitch", "roll"):
        turned = (np.abs(found) > math.pi) & (np.abs(found) <= 2 * math.pi)
        found = np.where(turned, found - np.copysign(2 * math.pi, found), found)
    return found


def by_range(values: Array, name: str) -> str:
    """Return the unit that the range of `values`, shape (n,), suggests for quantity `name`.

    The rules: angles beyond ±1.6 (heading beyond 6.4) are degrees, rates of pitch beyond 0.35 degrees per second;
    variation of the compass is in degrees; temperatures around 300 are kelvin and beyond 45 degrees Fahrenheit;
    conductivity above 8 is mS/cm and above 200 µS/cm (sea water has 2 to 7 S/m); engine volumes beyond 5 are cm³ and
    beyond 0.05 litres; battery positions beyond 2 are mm; propeller speeds beyond 60 are rpm; battery voltages beyond
    1000 are mV; speeds beyond 5 are cm/s; positions beyond ±90 (latitude) or ±360 (longitude) run degrees and minutes
    together; depths below zero are heights. Else the unit of the records.
    """
    import numpy as np

    size = np.abs(values[np.isfinite(values)])
    if size.size == 0:
        return QUANTITIES[name].canonical
    top, middle = float(np.percentile(size, 99)), float(np.median(size))
    match name:
        case "pitch" | "roll" | "battery_roll":
            return "deg" if top > 1.6 else "rad"
        case "magnetic_variation":
            return "deg"
        case "pitch_rate":
            return "deg/s" if top > 0.35 else "rad/s"
        case "heading":
            return "deg" if top > 6.4 else "rad"
        case "temperature":
            return "k" if middle > 200 else "degf" if middle > 45 else "degc"
        case "conductivity":
            return "us/cm" if middle > 200 else "ms/cm" if middle > 8 else "s/m"
        case "buoyancy_volume":
            return "cm3" if top > 5 else "l" if top > 0.05 else "m3"
        case "battery_position":
            return "mm" if top > 2 else "m"
        case "propeller_speed":
            return "rpm" if top > 60 else "rev/s"
        case "battery_voltage":
            return "mv" if top > 1000 else "v"
        case _ if QUANTITIES[name] is _SPEED:
            return "cm/s" if top > 5 else "m/s"
        case "depth":
            return "-m" if float(np.median(values[np.isfinite(values)])) < -2 else "m"
        case "latitude":
            return "ddmm" if middle > 90 else "deg"
        case "longitude":
            return "ddmm" if middle > 360 else "deg"
        case _:
            return QUANTITIES[name].canonical

"""Vehicles: coefficients with a value, a 1-sigma, a unit and a source each.

Forces are written as in Niu et al. (2017, doi:10.1007/s13344-017-0061-y), lift = (K_L0 + K_L α) V² and so on, at
the vehicle's reference density; in water of another density they scale with it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pipeline import yamlfile
from pipeline.findings import InputError, nearest

if TYPE_CHECKING:
    import numpy as np

FOLDER = Path(__file__).parent / "vehicles"
#: Keys of a vehicle file; `correlations` may be left out.
KEYS = ("name", "description", "coefficients", "correlations")
#: By how much an eigenvalue of a correlation matrix whose numbers were rounded may fall below zero.
ROUNDED = 1e-3


class Quantity(NamedTuple):
    """A coefficient that a vehicle file may give: symbol in the paper, unit, meaning, default (None: unknown)."""

    symbol: str
    unit: str
    meaning: str
    default: float | None


KNOWN: dict[str, Quantity] = {
    "lift_at_zero": Quantity("K_L0", "kg/m", "lift at zero angle of attack", 0.0),
    "lift_slope": Quantity("K_L", "kg/m/rad", "lift per angle of attack", None),
    "parasite_drag": Quantity("K_D0", "kg/m", "drag at zero angle of attack, at 1 m/s", None),
    "induced_drag": Quantity("K_D", "kg/m/rad2", "drag per squared angle of attack", None),
    "drag_exponent": Quantity("2s", "1", "parasite drag is K_D0 V^(2 + drag_exponent)", 0.0),
    "moment_at_zero": Quantity("K_M0", "kg", "pitching moment at zero angle of attack", None),
    "moment_slope": Quantity("K_M", "kg/rad", "pitching moment per angle of attack", None),
    "pitch_damping": Quantity("K_q", "kg s/rad", "pitching moment per pitch rate", None),
    "pitch_inertia": Quantity("J_2", "kg m2", "moment of inertia in pitch, added inertia included", None),
    "mass_forward": Quantity("m_1", "kg", "mass along the nose, added mass included", None),
    "mass_normal": Quantity("m_3", "kg", "mass normal to the wings, added mass included", None),
    "thrust_static": Quantity("K_1", "1", "thrust coefficient at advance ratio 0", None),
    "thrust_slope": Quantity("K_2", "1", "thrust coefficient per advance ratio", None),
    "propeller_diameter": Quantity("D_0", "m", "propeller diameter", None),
    "propulsive_efficiency": Quantity("eta", "1", "share of the propeller's power that goes into T (V + v)", None),
    "reference_density": Quantity("rho", "kg/m3", "density at which the force coefficients hold", None),
    "mass": Quantity("m", "kg", "mass of the vehicle", None),
    "compressibility": Quantity("eps", "1/Pa", "relative loss of hull volume per pressure", None),
    "thermal_expansion": Quantity("alpha_T", "1/K", "relative gain of hull volume per temperature", None),
    "reference_temperature": Quantity("T_0", "degC", "temperature at which the hull volume holds", 15.0),
    "carried_water": Quantity("phi_c", "1", "water a fairing carries along, share of the hull's volume", 0.0),
    "flushing_time": Quantity("tau_c", "s", "time in which the water carried along is renewed", None),
    "battery_mass": Quantity("m_bar", "kg", "mass of the movable battery", None),
    "battery_neutral_position": Quantity("r_P0", "m", "battery position without pitching moment", 0.0),
    "righting_moment": Quantity("M_s", "N m/rad", "moment M_s sin(pitch), negative = bottom-heavy", 0.0),
}

#: Coefficients that are positive or unknown.
POSITIVE = frozenset(
    {
        "lift_slope",
        "parasite_drag",
        "induced_drag",
        "pitch_inertia",
        "mass_forward",
        "mass_normal",
        "propeller_diameter",
        "propulsive_efficiency",
        "reference_density",
        "mass",
        "flushing_time",
        "battery_mass",
    }
)
#: What no underwater glider has: most of these are a number in another unit (grams, per dbar, g/cm3).
BOUNDS = {
    "mass": (1.0, 5000.0),
    "battery_mass": (0.0, 5000.0),
    "mass_forward": (1.0, 1e4),
    "mass_normal": (1.0, 1e5),
    "reference_density": (900.0, 1100.0),
    "compressibility": (-1e-8, 1e-8),
    "thermal_expansion": (-1e-3, 1e-3),
    "reference_temperature": (-10.0, 50.0),
    "drag_exponent": (-1.0, 1.0),
    "propulsive_efficiency": (0.0, 1.0),
    "propeller_diameter": (0.0, 5.0),
    "carried_water": (0.0, 2.0),
}
#: Coefficients that are zero, positive or unknown.
NOT_NEGATIVE = frozenset({"carried_water"})


@dataclass(frozen=True)
class Coefficient:
    """A value with its 1-sigma (NaN: unknown), unit and source, and whether it is assumed: of other vehicles."""

    value: float
    std: float
    unit: str
    source: str
    assumed: bool = False


class Polar(NamedTuple):
    """Lift and drag as plain numbers: K_L0, K_L, K_D0, K_D and the speed exponent of K_D0."""

    lift_at_zero: float
    lift_slope: float
    parasite_drag: float
    induced_drag: float
    drag_exponent: float


class Propeller(NamedTuple):
    """Thrust law as plain numbers: K_1, K_2 and D_0 of Eqs. (8) and (15)."""

    thrust_static: float
    thrust_slope: float
    diameter: float


class PropellerError(NamedTuple):
    """1-sigma of K_1 and of K_2, and the correlation of the two."""

    static: float
    slope: float
    correlation: float


class Disk(NamedTuple):
    """Thrust by power as plain numbers: diameter [m] and efficiency of a propeller taken as an actuator disk."""

    diameter: float
    efficiency: float


@dataclass(frozen=True)
class Vehicle:
    """A vehicle: its name, what it is, and its coefficients by name (see `KNOWN`).

    `correlations` holds the correlation of the errors of two coefficients that were found together, by their names;
    those of all other pairs are taken as none.
    """

    name: str
    description: str
    coefficients: Mapping[str, Coefficient]
    correlations: Mapping[tuple[str, str], float] = field(default_factory=dict)

    def __getitem__(self, name: str) -> float:
        """Return the value of coefficient `name`; NaN where the vehicle file leaves it unknown."""
        if name in self.coefficients:
            return self.coefficients[name].value
        default = KNOWN[name].default
        return math.nan if default is None else default

    def std(self, name: str) -> float:
        """Return the 1-sigma of coefficient `name`; 0 where it is a default, NaN where it is unknown."""
        if name in self.coefficients:
            return self.coefficients[name].std
        return math.nan if KNOWN[name].default is None else 0.0

    def correlation(self, first: str, second: str) -> float:
        """Return the correlation of the errors of two coefficients; 0 where none is stated."""
        return self.correlations.get((first, second), self.correlations.get((second, first), 0.0))

    def assumed(self, names: Iterable[str]) -> list[str]:
        """Return those of the coefficients `names` that are assumed: no one has measured them on such a vehicle."""
        return [name for name in names if name in self.coefficients and self.coefficients[name].assumed]

    @property
    def polar(self) -> Polar:
        """Lift and drag coefficients at the reference density."""
        return Polar(*(self[name] for name in Polar._fields))

    @property
    def propeller(self) -> Propeller | None:
        """Thrust law, or None for a vehicle without one."""
        law = Propeller(self["thrust_static"], self["thrust_slope"], self["propeller_diameter"])
        return None if any(math.isnan(value) for value in law) else law

    @property
    def propeller_error(self) -> PropellerError:
        """How well the thrust law is known; the 1-sigma are NaN where that is not known."""
        first, second = "thrust_static", "thrust_slope"
        return PropellerError(self.std(first), self.std(second), self.correlation(first, second))

    @property
    def disk(self) -> Disk | None:
        """Thrust by power, or None for a vehicle whose propeller's efficiency or diameter is not known."""
        law = Disk(self["propeller_diameter"], self["propulsive_efficiency"])
        return None if any(math.isnan(value) for value in law) else law

    def with_values(self, changes: Mapping[str, float], source: str) -> Vehicle:
        """Return the vehicle with some coefficients replaced, their relative 1-sigma kept.

        The 1-sigma stays as it is where the old value is zero, and unknown where it is unknown. A coefficient that is
        replaced is correlated with no other any more.

        Raises
        ------
        KeyError
            If a name is not in `KNOWN`.
        """
        changed = dict(self.coefficients)
        for name, value in changes.items():
            std = self.std(name)
            if self[name] and math.isfinite(self[name]):
                std *= abs(value / self[name])
            changed[name] = Coefficient(float(value), std, KNOWN[name].unit, source)
        kept = {pair: value for pair, value in self.correlations.items() if not set(pair) & set(changes)}
        return replace(self, coefficients=changed, correlations=kept)


def names() -> list[str]:
    """Return the names of the vehicles that come with the package."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))


def load(name: str, folder: Path | None = None, *, asked: tuple[str, str] = ("mission.yaml", "vehicle")) -> Vehicle:
    """Return the vehicle `name`: one of the package, or a YAML file (``*.yaml``) relative to `folder`.

    `asked` is the file and the place in it, or the option, that gave the name, for messages.

    Raises
    ------
    InputError
        If there is no such vehicle (the nearest is named), or its file is not as it must be.
    """
    if name.endswith((".yaml", ".yml")):
        path = (folder or Path()) / name
        if not path.is_file():
            raise InputError(name, found="no such vehicle file", remedy="put it beside mission.yaml")
    else:
        path = FOLDER / f"{name}.yaml"
        if name not in names():
            raise InputError(
                *asked,
                found=f"'{name}'",
                expected="a known vehicle",
                remedy=nearest(name, names()),
            )
    return parse(yamlfile.content(path, path.name, "a vehicle file"), path.name)


def parse(content: Any, file: str) -> Vehicle:
    """Return the vehicle described by the parsed YAML `content` of `file`.

    Raises
    ------
    InputError
        If a coefficient is unknown, lacks a value, 1-sigma, unit or source, or has an impossible value; or if the
        correlations are not those of any errors.
    """
    if not isinstance(content, dict) or not isinstance(content.get("coefficients"), dict):
        raise InputError(file, found="no 'coefficients'", expected="keys name, description, coefficients")
    unknown = set(content) - set(KEYS)
    if unknown:
        key = sorted(str(name) for name in unknown)[0]
        raise InputError(file, key, found="an unknown key", remedy=nearest(key, list(KEYS)))
    coefficients = {str(name): _coefficient(str(name), entry, file) for name, entry in content["coefficients"].items()}
    return Vehicle(
        str(content.get("name", Path(file).stem)),
        str(content.get("description", "")),
        coefficients,
        _correlations(content.get("correlations", {}), coefficients, file),
    )


def _correlations(content: Any, coefficients: Mapping[str, Coefficient], file: str) -> dict[tuple[str, str], float]:
    """Return the correlations of a vehicle file by pairs of names: a pair once, and no matrix that cannot be."""
    if not isinstance(content, dict) or not all(isinstance(row, dict) for row in content.values()):
        raise InputError(file, "correlations", found=f"{content!r}", expected="coefficient: {another: number}")
    found: dict[tuple[str, str], float] = {}
    for first, row in content.items():
        for second, value in row.items():
            where = f"correlations.{first}.{second}"
            for name in (first, second):
                if name not in coefficients:
                    remedy = nearest(str(name), list(coefficients))
                    raise InputError(file, where, found=f"'{name}', which has no value", remedy=remedy)
                if not coefficients[name].std > 0.0:
                    raise InputError(file, where, found=f"'{name}' without a 1-sigma", expected="one above zero")
            if first == second or (second, first) in found:
                raise InputError(file, where, found="a pair that needs none", expected="each pair of two once")
            if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 1.0:
                raise InputError(file, where, found=f"{value!r}", expected="a number from -1 to 1")
            found[first, second] = float(value)
    if not found:
        return found
    import numpy as np

    least = float(np.linalg.eigvalsh(correlation_matrix(found)[1])[0])
    if least < -ROUNDED:
        raise InputError(
            file,
            "correlations",
            found=f"an eigenvalue of {least:.3g}",
            expected="a matrix with none below zero",
            remedy="no errors are correlated like this",
        )
    return found


def correlation_matrix(correlations: Mapping[tuple[str, str], float]) -> tuple[list[str], np.ndarray]:
    """Return the names that any correlation is given of, in order of appearance, and their matrix, shape (n, n)."""
    import numpy as np

    names = list(dict.fromkeys(name for pair in correlations for name in pair))
    matrix = np.eye(len(names))
    for (first, second), value in correlations.items():
        i, j = names.index(first), names.index(second)
        matrix[i, j] = matrix[j, i] = value
    return names, matrix


def _coefficient(name: str, entry: Any, file: str) -> Coefficient:
    if name not in KNOWN:
        raise InputError(file, name, found="an unknown coefficient", remedy=nearest(name, list(KNOWN)))
    if not isinstance(entry, dict) or set(entry) - {"assumed"} != {"value", "std", "unit", "source"}:
        raise InputError(file, name, found=f"{entry!r}", expected="the keys value, std, unit and source")
    quantity = KNOWN[name]
    if entry["unit"] != quantity.unit:
        raise InputError(file, name, found=f"unit '{entry['unit']}'", expected=f"'{quantity.unit}'")
    try:
        value = math.nan if entry["value"] == "unknown" else float(entry["value"])
        std = math.nan if entry["std"] == "unknown" else float(entry["std"])
    except (TypeError, ValueError) as error:
        raise InputError(
            file, name, found=f"{entry['value']!r} ± {entry['std']!r}", expected="numbers or 'unknown'"
        ) from error
    check_value(name, value, file)
    if std < 0 or math.isinf(std):
        raise InputError(file, name, found=f"std {std:g}", expected="a 1-sigma of zero or more")
    assumed = entry.get("assumed", False)
    if not isinstance(assumed, bool):
        raise InputError(file, name, found=f"assumed {assumed!r}", expected="true or false")
    return Coefficient(value, std, quantity.unit, str(entry["source"]), assumed)


def check_value(name: str, value: float, file: str) -> None:
    """Refuse a `value` that the coefficient `name` given in `file` cannot have; NaN stands for unknown.

    Raises
    ------
    InputError
        If there is no such coefficient (the nearest is named), or the value is infinite, zero or negative where it
        cannot be, or beyond `BOUNDS`.
    """
    if name not in KNOWN:
        raise InputError(file, name, found="an unknown coefficient", remedy=nearest(name, list(KNOWN)))
    if math.isinf(value):
        raise InputError(file, name, found=f"{value:g} {KNOWN[name].unit}", expected="a finite number")
    if name in POSITIVE and value <= 0:
        raise InputError(file, name, found=f"{value:g} {KNOWN[name].unit}", expected="a positive number")
    if name in NOT_NEGATIVE and value < 0:
        raise InputError(file, name, found=f"{value:g} {KNOWN[name].unit}", expected="zero or a positive number")
    low, high = BOUNDS.get(name, (-math.inf, math.inf))
    if not math.isnan(value) and not low <= value <= high:
        unit = "" if KNOWN[name].unit == "1" else f" {KNOWN[name].unit}"
        raise InputError(
            file, name, found=f"{value:g}{unit}", expected=f"{low:g} to {high:g}{unit}", remedy="its unit?"
        )

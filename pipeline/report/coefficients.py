"""The coefficients of a vehicle in the forms that Slocum's and Seaglider's own software take, as plain text."""

from __future__ import annotations

import math
from collections.abc import Mapping

from pipeline.conventions import to_seaglider, to_slocum
from pipeline.vehicle import Vehicle

FILE = "coefficients.txt"
#: Constants of both forms: the coefficient whose relative 1-sigma they have (None: chosen, exact), unit.
SLOCUM: dict[str, tuple[str | None, str]] = {
    "C_D0": ("parasite_drag", "1"),
    "C_D1": ("induced_drag", "1/rad2"),
    "a_h": (None, "1/rad"),
    "a_w": (None, "1/rad"),
    "S": (None, "m2"),
}
SEAGLIDER: dict[str, tuple[str | None, str]] = {
    "hd_a": ("lift_slope", "1/deg"),
    "hd_b": ("parasite_drag", "(N/m2)^-s"),
    "hd_c": ("induced_drag", "1/deg2"),
    "hd_s": (None, "1"),
    "glider_length": (None, "m"),
}
#: What the hull adds to either: name, coefficient, factor from the vehicle file's unit, unit.
HULL = {
    "Slocum": (("mass", "mass", 1.0, "kg"), ("epsilon", "compressibility", 1.0, "1/Pa"),
               ("alpha_T", "thermal_expansion", 1.0, "1/K")),
    "Seaglider": (("mass", "mass", 1.0, "kg"), ("abs_compress", "compressibility", 1e4, "1/dbar"),
                  ("therm_expan", "thermal_expansion", 1.0, "1/K"), ("temp_ref", "reference_temperature", 1.0, "degC")),
}  # fmt: skip


def text(vehicle: Vehicle, mission: str) -> str:
    """Return the block of coefficients of `vehicle` as found by `mission`, each ± 1-sigma.

    A vehicle that a form cannot hold is told so in its place.
    """
    density = vehicle["reference_density"]
    return "\n".join(
        [
            f"Coefficients of {vehicle.name}, mission {mission}; each ± 1 sigma, exact where none is given.",
            f"At {density:g} kg/m3. What each rests on is in vehicle.yaml beside this file.",
            "",
            "Slocum: L = 1/2 rho S U^2 (a_h + a_w) alpha, D = 1/2 rho S U^2 (C_D0 + C_D1 alpha^2), alpha in rad",
            "(Merckelbach et al. 2010, doi:10.1175/2009JTECHO710.1); a_w is that of swept wings, a_h the rest",
            *_slocum(vehicle),
            "",
            "Seaglider: L = q l^2 a alpha, D = q l^2 (b q^s + c alpha^2), q = 1/2 rho V^2, alpha in degrees",
            "(Eriksen et al. 2001, doi:10.1109/48.972073); l = glider_length",
            *_seaglider(vehicle),
            "",
        ]
    )


def _slocum(vehicle: Vehicle) -> list[str]:
    try:
        values = to_slocum(vehicle)
    except ValueError as error:
        return [f"  not to be had: {error}"]
    stds = _stds(vehicle, values, SLOCUM)
    stds["a_h"] = (values["a_h"] + values["a_w"]) * _relative(vehicle, "lift_slope")
    return _rows(values, stds, SLOCUM) + _hull(vehicle, "Slocum")


def _seaglider(vehicle: Vehicle) -> list[str]:
    try:
        values = to_seaglider(vehicle)
    except ValueError as error:
        return [f"  not to be had: {error}"]
    stds = _stds(vehicle, values, SEAGLIDER)
    stds["hd_s"] = 0.5 * vehicle.std("drag_exponent")
    return _rows(values, stds, SEAGLIDER) + _hull(vehicle, "Seaglider")


def _relative(vehicle: Vehicle, name: str) -> float:
    return vehicle.std(name) / abs(vehicle[name]) if vehicle[name] else 0.0


def _stds(
    vehicle: Vehicle, values: Mapping[str, float], form: Mapping[str, tuple[str | None, str]]
) -> dict[str, float]:
    return {name: abs(values[name]) * (_relative(vehicle, base) if base else 0.0) for name, (base, _) in form.items()}


def _rows(
    values: Mapping[str, float], stds: Mapping[str, float], form: Mapping[str, tuple[str | None, str]]
) -> list[str]:
    return [_row(name, values[name], stds[name], unit) for name, (_, unit) in form.items()]


def _hull(vehicle: Vehicle, form: str) -> list[str]:
    return [
        _row(name, factor * vehicle[base], factor * vehicle.std(base), unit) for name, base, factor, unit in HULL[form]
    ]


def _row(name: str, value: float, std: float, unit: str) -> str:
    if math.isnan(value):
        return f"  {name:<14} unknown"
    spread = f" ± {std:.3g}" if std > 0.0 else ""
    shown = "" if unit == "1" else f" {unit}"
    return f"  {name:<14} {value:.7g}{spread}{shown}"

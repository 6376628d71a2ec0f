"""Conventions: the coefficients of Seaglider and of Slocum made those of a vehicle file, and the other way round."""

from __future__ import annotations

import math
from collections.abc import Mapping

from pipeline.vehicle import Vehicle


def from_seaglider(
    base: Vehicle, constants: Mapping[str, float], *, reference_density: float = 1027.5, source: str
) -> Vehicle:
    """Return `base` with the hull and drag law of a Seaglider's own calibration constants.

    L = q l² a α, D = q l² (b q^s + c α²) with q = ½ρV² and α in degrees (Eriksen et al. 2001,
    doi:10.1109/48.972073) become K_L, K_D0, K_D and a speed exponent at `reference_density`.

    Parameters
    ----------
    base
        Vehicle whose 1-sigma (relative) and other coefficients are kept.
    constants
        ``hd_a``, ``hd_b``, ``hd_c``, ``hd_s`` [-], ``glider_length`` [m] (1.8), ``mass`` [kg], ``abs_compress``
        [1/dbar], ``therm_expan`` [1/K], ``temp_ref`` [°C]; those that are missing are left as in `base`.
    reference_density
        Density at which the coefficients are expressed, kg/m³.
    source
        Where the constants come from.
    """
    length = constants.get("glider_length", 1.8)
    exponent = constants.get("hd_s", -0.25)
    pressure_at_1m_s = 0.5 * reference_density  # dynamic pressure at 1 m/s
    scale = pressure_at_1m_s * length**2
    degrees = 180.0 / math.pi
    changes: dict[str, float] = {}
    if "hd_a" in constants:
        changes["lift_slope"] = scale * constants["hd_a"] * degrees
    if "hd_b" in constants:
        changes["parasite_drag"] = scale * constants["hd_b"] * pressure_at_1m_s**exponent
        changes["drag_exponent"] = 2.0 * exponent
    if "hd_c" in constants:
        changes["induced_drag"] = scale * constants["hd_c"] * degrees**2
    if changes:
        changes["reference_density"] = reference_density
    for name, key, factor in (
        ("mass", "mass", 1.0),
        ("compressibility", "abs_compress", 1e-4),  # 1/dbar -> 1/Pa
        ("thermal_expansion", "therm_expan", 1.0),
        ("reference_temperature", "temp_ref", 1.0),
    ):
        if key in constants:
            changes[name] = constants[key] * factor
    return base.with_values(changes, source)


def to_seaglider(vehicle: Vehicle, *, glider_length: float = 1.8) -> dict[str, float]:
    """Return hd_a, hd_b, hd_c, hd_s and glider_length of a vehicle: the inverse of `from_seaglider`.

    Parameters
    ----------
    vehicle
        Vehicle without lift at zero angle of attack; what it leaves unknown is NaN here too.
    glider_length
        Length l that the constants refer to, m.

    Raises
    ------
    ValueError
        If the vehicle has lift at zero angle of attack, for which the law of Seaglider has no constant.
    """
    _refuse_lift_at_zero(vehicle, "Seaglider")
    pressure_at_1m_s = 0.5 * vehicle["reference_density"]
    scale = pressure_at_1m_s * glider_length**2
    radians = math.pi / 180.0
    exponent = 0.5 * vehicle["drag_exponent"]
    return {
        "hd_a": vehicle["lift_slope"] / scale * radians,
        "hd_b": vehicle["parasite_drag"] / scale / pressure_at_1m_s**exponent,
        "hd_c": vehicle["induced_drag"] / scale * radians**2,
        "hd_s": exponent,
        "glider_length": glider_length,
    }


def wing_lift_slope(aspect_ratio: float = 7.0, sweep: float = math.radians(43.0)) -> float:
    """Return the lift slope a_w of swept wings, 1/rad: 2π AR/(2 + √(AR² (1 + tan² Ω) + 4)); Slocum's by default.

    Merckelbach et al. (2010), doi:10.1175/2009JTECHO710.1; aspect ratio AR, sweep Ω in rad.
    """
    span = math.sqrt(aspect_ratio**2 * (1.0 + math.tan(sweep) ** 2) + 4.0)
    return 2.0 * math.pi * aspect_ratio / (2.0 + span)


def from_slocum(
    base: Vehicle, constants: Mapping[str, float], *, reference_density: float = 1025.0, source: str
) -> Vehicle:
    """Return `base` with the polar of Slocum's coefficients: L = ½ρSU² (a_h + a_w) α, D = ½ρSU² (C_D0 + C_D1 α²).

    Merckelbach et al. (2010), doi:10.1175/2009JTECHO710.1; they become K_L, K_D0, K_D at `reference_density`.

    Parameters
    ----------
    base
        Vehicle whose 1-sigma (relative) and other coefficients are kept.
    constants
        ``C_D0`` [-], ``C_D1`` [1/rad²], ``a_h``, ``a_w`` [1/rad] of hull and wings, ``S`` [m²].
    reference_density
        Density at which the coefficients are expressed, kg/m³.
    source
        Where the constants come from.

    Raises
    ------
    KeyError
        If one of the five is missing: they are one law.
    """
    scale = 0.5 * reference_density * constants["S"]
    changes = {
        "lift_at_zero": 0.0,
        "lift_slope": scale * (constants["a_h"] + constants["a_w"]),
        "parasite_drag": scale * constants["C_D0"],
        "induced_drag": scale * constants["C_D1"],
        "drag_exponent": 0.0,
        "reference_density": reference_density,
    }
    return base.with_values(changes, source)


def to_slocum(vehicle: Vehicle, *, area: float = 0.1, wings: float | None = None) -> dict[str, float]:
    """Return C_D0, C_D1, a_h, a_w and S of a vehicle: the inverse of `from_slocum`.

    Parameters
    ----------
    vehicle
        Vehicle without lift at zero angle of attack and without a speed exponent; what it leaves unknown is NaN.
    area
        Area S that the coefficients refer to, m².
    wings
        Lift slope a_w of the wings, 1/rad, `wing_lift_slope` if left out; the rest is the hull's.

    Raises
    ------
    ValueError
        If the vehicle has lift at zero angle of attack or a speed exponent, which the law of Slocum has not.
    """
    _refuse_lift_at_zero(vehicle, "Slocum")
    if vehicle["drag_exponent"] != 0.0:
        raise ValueError(f"{vehicle.name}: found drag_exponent {vehicle['drag_exponent']:g}; Slocum's law has none")
    scale = 0.5 * vehicle["reference_density"] * area
    of_wings = wing_lift_slope() if wings is None else wings
    return {
        "C_D0": vehicle["parasite_drag"] / scale,
        "C_D1": vehicle["induced_drag"] / scale,
        "a_h": vehicle["lift_slope"] / scale - of_wings,
        "a_w": of_wings,
        "S": area,
    }


def _refuse_lift_at_zero(vehicle: Vehicle, law: str) -> None:
    if vehicle["lift_at_zero"] != 0.0:
        raise ValueError(f"{vehicle.name}: found lift_at_zero {vehicle['lift_at_zero']:g}; {law}'s law has none")

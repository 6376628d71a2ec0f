"""Measured against theory: the error E = S − D of every steady block, with its validation uncertainty.

ASME V&V 20-2009: u_val² = u_num² + u_input² + u_D² − 2 cov. The covariance is there because the kinematic speed and
the theory borrow the same lift and drag coefficients and the same pitch; how much of the error they share follows
from the derivatives of both sides. Every comparison carries a label that says how independent its two sides are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.model.case import driven
from pipeline.model.forces import relative_thrust_std
from pipeline.model.steady import trim_sensitivities
from pipeline.records import TRIMS, seconds
from pipeline.report.covariance import water, water_of
from pipeline.vehicle import Polar, Vehicle

if TYPE_CHECKING:
    from pipeline.table import Columns

Array = NDArray[np.float64]
Label = Callable[..., tuple[str, str]]

#: What the kinematic speed and the theory have in common.
SHARED = ("lift_at_zero", "lift_slope", "parasite_drag", "induced_drag", "pitch")
#: What the theory with the pitch held depends on besides.
ALONE = ("thrust_scale", "net_buoyancy")
EFFECTS = (*SHARED, *ALONE)
#: Numerical uncertainty of the steady-state solver, relative: its stopping tolerance.
SOLVER = 1e-9

#: |E|/u_val beyond which a difference is called significant.
SIGNIFICANT = 2.0

QUANTITIES = {
    "speed": "speed, kinematic",
    "sensor_speed": "speed, by the sensor",
    "gps_speed": "speed, by GPS legs",
    "depth_rate": "depth rate, + sinking",
    "pitch": "pitch",
    "path_angle": "path angle, kinematic",
}

DIRECTIONS = {-1: "dives", 0: "level flight", 1: "climbs"}

COLUMNS = (
    *("block", "start_s", "end_s", "dive", "direction", "powered", "trim", "quantity"),
    *("predicted", "measured", "error", "u_num", "u_input", "u_measured", "covariance", "u_val", "significance"),
    *("label", "why", "own_input", "own_measured", "water_sign", "common"),
    *(f"predicted_{name}" for name in EFFECTS),
    *(f"measured_{name}" for name in SHARED),
)


def independence(quantity: str, *, trim: str, powered: bool, sensor_used: bool) -> tuple[str, str]:
    """Return the label of a comparison and the sentence that says why.

    Returns
    -------
    tuple of str
        ``independent``, ``shares polar`` or ``circular``, and one sentence.
    """
    if quantity == "sensor_speed":
        return "independent", "a sensor measured the speed; the theory knows nothing of it"
    if quantity == "gps_speed":
        return "independent", "the speed follows from GPS fixes and the time between them, without any coefficient"
    if quantity == "depth_rate":
        return "independent", "the pressure sensor alone gives the depth rate; the theory has only the inputs"
    if quantity == "pitch":
        return "independent", "the attitude sensor gives the pitch, which this trim does not use"
    if quantity == "path_angle" and not powered:
        return "circular", "in unpowered flight both sides solve the same closure at the same pitch: E says nothing"
    if powered:
        return (
            "shares polar",
            "under propeller the angle of attack is only bracketed by the polar; no covariance is subtracted",
        )
    if sensor_used:
        return "shares polar", "the estimate leans on the speed sensor and the polar; no covariance is subtracted"
    if trim == "pitch":
        return (
            "shares polar",
            "the angle of attack behind the measured speed comes from the theory's lift/drag ratio and the same pitch",
        )
    return "shares polar", "both sides use the same lift and drag coefficients; no covariance is subtracted"


def kinematic_sensitivities(
    polar: Polar, speed: Array, path_angle: Array, alpha: Array
) -> dict[str, tuple[Array, Array]]:
    """Return the derivatives of the kinematic speed and path angle in what they borrow.

    The kinematic estimate solves sin γ (K_L0 + K_L α) + cos γ (K_D0 V^2s + K_D α²) = 0 with γ = θ − α, and
    V sin γ = −ż at a given pitch θ and depth rate ż; the implicit function theorem gives its derivatives.

    Parameters
    ----------
    polar
        Lift and drag coefficients.
    speed, path_angle, alpha
        V [m/s], γ and α [rad] of unpowered blocks, shape (n,).

    Returns
    -------
    dict
        For every name in `SHARED`: ∂V [m/s per unit] and ∂γ [rad per unit], each of shape (n,).
    """
    sin, cos = np.sin(path_angle), np.cos(path_angle)
    growth = speed**polar.drag_exponent
    lift = polar.lift_at_zero + polar.lift_slope * alpha
    drag = polar.parasite_drag * growth + polar.induced_drag * alpha**2
    a11 = cos * polar.parasite_drag * polar.drag_exponent * growth / speed
    a12 = -cos * lift + sin * drag + sin * polar.lift_slope + 2.0 * cos * polar.induced_drag * alpha
    a21, a22 = sin, -speed * cos
    by_pitch = cos * lift - sin * drag
    none = np.zeros_like(speed)
    right = {
        "lift_at_zero": (sin, none),
        "lift_slope": (sin * alpha, none),
        "parasite_drag": (cos * growth, none),
        "induced_drag": (cos * alpha**2, none),
        "pitch": (by_pitch, speed * cos),
    }
    determinant = a11 * a22 - a12 * a21
    out: dict[str, tuple[Array, Array]] = {}
    with np.errstate(divide="ignore", invalid="ignore"):
        for name, (b1, b2) in right.items():
            d_speed = -(b1 * a22 - a12 * b2) / determinant
            d_alpha = -(a11 * b2 - b1 * a21) / determinant
            out[name] = (d_speed, (1.0 if name == "pitch" else 0.0) - d_alpha)
    return out


def compare(
    blocks: pd.DataFrame,
    predictions: pd.DataFrame,
    vehicle: Vehicle,
    *,
    sensor_used: bool = False,
    settings: Mapping[str, Any] | None = None,
    gps: tuple[float, float] | None = None,
) -> pd.DataFrame:
    """Return every comparison of every used block, one row per block, trim and quantity.

    Parameters
    ----------
    blocks, predictions
        The canonical tables `records.BLOCKS` and `records.PREDICTIONS`.
    vehicle
        The vehicle whose coefficients the predictions were made with.
    sensor_used
        Whether the estimator used the speed sensor instead of holding it out.
    settings
        The estimator's ``sigma_w`` [m/s] and ``tau_w`` [s].
    gps
        Speed of level powered flight and its 1-sigma, m/s, if GPS legs give one; compared with the mean prediction
        of the level powered blocks, as a row of block −1.

    Returns
    -------
    DataFrame
        Columns `COLUMNS`; speeds m/s, angles rad. ``predicted_<name>`` and ``measured_<name>`` are the 1-sigma
        effects of a named input on either side, with sign; ``own_…`` the rest of the 1-sigma, which on the measured
        side is the same in all blocks where ``common``.
    """
    used = blocks[blocks["used"].to_numpy(dtype=bool)]
    parts: list[pd.DataFrame] = []
    for trim in TRIMS:
        theory = predictions[predictions["trim"] == trim].drop(columns=["trim"])
        both = used.merge(theory, on="block", how="inner", suffixes=("", "_theory"))
        both = both[np.isfinite(both["speed_theory"].to_numpy(dtype=np.float64))]
        if not both.empty:
            parts += _compare_trim(both.reset_index(drop=True), trim, vehicle, sensor_used, settings, gps)
    if not parts:
        return pd.DataFrame(columns=list(COLUMNS))
    table = pd.concat(parts, ignore_index=True)
    return table[list(COLUMNS)]


def _compare_trim(
    both: pd.DataFrame,
    trim: str,
    vehicle: Vehicle,
    sensor_used: bool,
    settings: Mapping[str, Any] | None,
    gps: tuple[float, float] | None,
) -> list[pd.DataFrame]:
    """Return the comparisons of the blocks `both` (merged with the predictions of one trim)."""
    theory = _theory(both, trim, vehicle)
    sigma, tau = water_of(settings)
    drift = np.sqrt(water(seconds(both["start"]), seconds(both["end"]), sigma, tau).band[0])
    rate_std = np.hypot(floats(both, "depth_rate_std"), drift)
    closure = trim == "pitch" and not sensor_used
    speed_effects = _kinematic_effects(both, vehicle, 0) if closure else None
    rated = both.assign(_rate_std=rate_std)
    label = partial(independence, trim=trim, sensor_used=sensor_used)
    out = [
        _rows(both, trim, "speed", theory["speed"], ("speed", "speed_std"), label, speed_effects),
        _rows(both, trim, "sensor_speed", theory["speed"], ("sensor_speed", "sensor_speed_std"), label),
        _rows(rated, trim, "depth_rate", theory["depth_rate"], ("depth_rate", "_rate_std"), label),
    ]
    if trim == "pitch":
        effects = _kinematic_effects(both, vehicle, 1) if closure else None
        out.append(
            _rows(both, trim, "path_angle", theory["path_angle"], ("path_angle", "path_angle_std"), label, effects)
        )
    else:
        out.append(_rows(both, trim, "pitch", theory["pitch"], ("pitch", "pitch_std"), label))
    if gps is not None:
        out.append(_gps_row(both, trim, theory["speed"], gps, label))
    return [part for part in out if not part.empty]


class _Side:
    """One side of a comparison: value, total 1-sigma, and its signed 1-sigma effects by shared input."""

    def __init__(self, value: Array, std: Array, effects: dict[str, Array] | None = None) -> None:
        self.value, self.std, self.effects = value, std, effects or {}

    def effect(self, name: str) -> Array:
        return self.effects.get(name, np.zeros_like(self.value))

    def own(self) -> Array:
        """Return the 1-sigma that is left when the named effects are taken out."""
        named = sum((self.effect(name) ** 2 for name in EFFECTS), np.zeros_like(self.value))
        return np.asarray(np.sqrt(np.maximum(self.std**2 - named, 0.0)))


def _theory(both: pd.DataFrame, trim: str, vehicle: Vehicle) -> dict[str, _Side]:
    """Return the predictions of one trim as sides of comparisons."""
    speed, path = floats(both, "speed_theory"), floats(both, "path_angle_theory")
    speed_std, path_std = floats(both, "speed_std_theory"), floats(both, "path_angle_std_theory")
    sin, cos = np.sin(path), np.cos(path)
    rate = -speed * sin
    rate_std = np.hypot(sin * speed_std, speed * cos * path_std)
    effects: dict[str, dict[str, Array]] = {"speed": {}, "path_angle": {}, "depth_rate": {}}
    if trim == "pitch":
        stds, variance = _input_stds(both, vehicle), np.zeros_like(speed)
        for name, (d_speed, d_path) in _sensitivities(both, vehicle).items():
            d_rate = -(d_speed * sin + speed * cos * d_path)
            variance += np.nan_to_num(d_rate * stds[name]) ** 2
            if name in EFFECTS:
                effects["speed"][name] = np.nan_to_num(d_speed * stds[name])
                effects["path_angle"][name] = np.nan_to_num(d_path * stds[name])
                effects["depth_rate"][name] = np.nan_to_num(d_rate * stds[name])
        rate_std = np.sqrt(variance)
    return {
        "speed": _Side(speed, speed_std, effects["speed"]),
        "path_angle": _Side(path, path_std, effects["path_angle"]),
        "depth_rate": _Side(rate, rate_std, effects["depth_rate"]),
        "pitch": _Side(floats(both, "pitch_theory"), floats(both, "pitch_std_theory")),
    }


def _sensitivities(both: pd.DataFrame, vehicle: Vehicle) -> dict[str, tuple[Array, Array]]:
    """Return the theory's derivatives with the pitch held, for the parameters that the vehicle has."""
    turning, power = _driven(both, vehicle)
    result: dict[str, tuple[Array, Array]] = trim_sensitivities(
        vehicle,
        floats(both, "net_buoyancy"),
        floats(both, "pitch"),
        propeller_speed=turning,
        propeller_power=power,
        density=density_of(both, vehicle),
    )
    return result


def _kinematic_effects(both: pd.DataFrame, vehicle: Vehicle, which: int) -> dict[str, Array]:
    """Return the signed 1-sigma effects of the shared inputs on the kinematic speed (0) or path angle (1)."""
    gliding = ~both["powered"].to_numpy(dtype=bool)
    derivatives = kinematic_sensitivities(
        vehicle.polar, floats(both, "speed"), floats(both, "path_angle"), floats(both, "angle_of_attack")
    )
    stds = _input_stds(both, vehicle)
    return {name: np.where(gliding, np.nan_to_num(pair[which] * stds[name]), 0.0) for name, pair in derivatives.items()}


def _input_stds(both: pd.DataFrame, vehicle: Vehicle) -> dict[str, Array]:
    """Return the 1-sigma of every input of the theory, per block: 0 where the vehicle file leaves it unknown."""
    turning, power = _driven(both, vehicle)
    stds = {name: np.full(len(both), vehicle.std(name)) for name in SHARED if name != "pitch"}
    speed = floats(both, "speed_theory")
    stds["thrust_scale"] = relative_thrust_std(vehicle, density_of(both, vehicle), turning, power, speed)
    for name in ("pitch", "net_buoyancy", "propeller_speed", "propeller_power"):
        stds[name] = floats(both, f"{name}_std")
    return {name: np.nan_to_num(std) for name, std in stds.items()}


def _driven(both: pd.DataFrame, vehicle: Vehicle) -> tuple[Array, Array]:
    """Return speed and power of the propeller that thrust follows from, in blocks that theory can predict."""
    powered = both["powered"].to_numpy(dtype=bool)
    return driven(vehicle, powered, floats(both, "propeller_speed"), floats(both, "propeller_power"))


def _rows(
    both: pd.DataFrame,
    trim: str,
    quantity: str,
    theory: _Side,
    measured_in: tuple[str, str],
    label: Label,
    effects: dict[str, Array] | None = None,
) -> pd.DataFrame:
    """Return one comparison per block that has both sides."""
    measured = _Side(floats(both, measured_in[0]), floats(both, measured_in[1]), effects)
    size = len(both)
    frame = pd.DataFrame(
        {
            "block": both["block"].to_numpy(),
            "start_s": seconds(both["start"]),
            "end_s": seconds(both["end"]),
            "dive": both["dive"].to_numpy(),
            "direction": both["direction"].to_numpy(),
            "powered": both["powered"].to_numpy(dtype=bool),
            "trim": [trim] * size,
            "quantity": [quantity] * size,
            **_uncertainties(theory, measured),
        }
    )
    # Rising water slows the sinking of a dive and quickens a climb: the sign with which w_w enters D.
    frame["water_sign"] = {
        "depth_rate": -np.ones(size),
        "speed": np.where(floats(both, "path_angle") > 0, 1.0, -1.0),
    }.get(quantity, np.zeros(size))
    # A sensor's or the fixes' error is the same in every block; under propeller so is what the polar leaves open.
    frame["common"] = quantity == "sensor_speed" if quantity != "speed" else both["powered"].to_numpy(dtype=bool)
    labels = {powered: label(quantity, powered=powered) for powered in (False, True)}
    frame["label"] = [labels[flag][0] for flag in frame["powered"]]
    frame["why"] = [labels[flag][1] for flag in frame["powered"]]
    frame.loc[frame["label"] == "circular", "significance"] = np.nan
    return frame.loc[np.isfinite(floats(frame, "error")) & np.isfinite(floats(frame, "u_val"))]


def _gps_row(both: pd.DataFrame, trim: str, theory: _Side, gps: tuple[float, float], label: Label) -> pd.DataFrame:
    """Return the comparison of level powered flight with the GPS legs, as one row of block −1."""
    level = (both["direction"].to_numpy() == 0) & both["powered"].to_numpy(dtype=bool)
    if not level.any() or not all(math.isfinite(number) for number in gps):
        return pd.DataFrame()
    mean = _Side(
        np.array([theory.value[level].mean()]),
        np.array([theory.std[level].mean()]),
        {name: np.array([theory.effect(name)[level].mean()]) for name in EFFECTS},
    )
    word, why = label("gps_speed", powered=True)
    return pd.DataFrame(
        {
            "block": [-1],
            "start_s": [float(seconds(both["start"])[level].min())],
            "end_s": [float(seconds(both["end"])[level].max())],
            "dive": [-1],
            "direction": [0],
            "powered": [True],
            "trim": [trim],
            "quantity": ["gps_speed"],
            **_uncertainties(mean, _Side(np.array([gps[0]]), np.array([gps[1]]))),
            "water_sign": [0.0],
            "common": [True],
            "label": [word],
            "why": [why],
        }
    )


def _uncertainties(theory: _Side, measured: _Side) -> dict[str, Array]:
    """Return error and validation uncertainty of V&V 20, and what they consist of."""
    numerical = SOLVER * np.abs(theory.value)
    covariance = sum((theory.effect(n) * measured.effect(n) for n in SHARED), np.zeros_like(theory.value))
    named = sum(((theory.effect(n) - measured.effect(n)) ** 2 for n in EFFECTS), np.zeros_like(theory.value))
    own_input, own_measured = theory.own(), measured.own()
    # The same as u_num² + u_input² + u_D² − 2 cov, summed so that it cannot become negative.
    total = np.sqrt(numerical**2 + own_input**2 + own_measured**2 + named)
    error = theory.value - measured.value
    with np.errstate(divide="ignore", invalid="ignore"):
        significance = np.abs(error) / total
    return {
        "predicted": theory.value,
        "measured": measured.value,
        "error": error,
        "u_num": numerical,
        "u_input": theory.std,
        "u_measured": measured.std,
        "covariance": covariance,
        "u_val": total,
        "significance": significance,
        "own_input": own_input,
        "own_measured": own_measured,
        **{f"predicted_{name}": theory.effect(name) for name in EFFECTS},
        **{f"measured_{name}": measured.effect(name) for name in SHARED},
    }


def density_of(blocks: pd.DataFrame, vehicle: Vehicle) -> Array:
    """Return the density of each block, kg/m³: the vehicle's reference where none was measured."""
    density = floats(blocks, "density")
    return np.where(np.isfinite(density), density, vehicle["reference_density"])


def floats(frame: Columns, name: str) -> Array:
    """Return a column as floats, shape (n,)."""
    return frame[name].to_numpy(dtype=np.float64)

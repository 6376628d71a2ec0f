"""What the theory predicts for each steady block, and for the settings of a published trial, with 1-sigma."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.model.case import MAX_PROPELLER_SPEED, NO_THRUST_LAW, driven
from pipeline.model.forces import relative_thrust_std
from pipeline.model.sensitivity import Slope, Trim, sensitivities
from pipeline.model.stability import stable_range
from pipeline.model.steady import (
    MAX_ANGLE_OF_ATTACK,
    Signs,
    Steady,
    steady_state,
    trim_at_moment,
    trim_at_pitch,
)
from pipeline.records import PREDICTIONS, TRIMS, conform
from pipeline.vehicle import Vehicle

Array = NDArray[np.float64]

#: Coefficients whose errors may be correlated.
_THRUST = ("thrust_static", "thrust_slope")
_STEP = 0.05  # of a 1-sigma, for the central differences of `nominal`


def predict(vehicle: Vehicle, blocks: pd.DataFrame) -> pd.DataFrame:
    """Return the predicted steady flight of each block for each trim of `records.TRIMS`.

    The 1-sigma come from those of the coefficients (thrust as one factor at the block's advance ratio, see
    `forces.relative_thrust_std`) and of the block's pitch, net buoyancy, propeller speed or power and battery
    position, taken as independent, to first order. Thrust follows from the propeller's power where it does not from
    its speed, see `case.driven`.
    The stable range and its verdict are in physical signs, at the predicted angle of attack and thrust.

    Parameters
    ----------
    vehicle
        Vehicle whose theory is asked.
    blocks
        Steady blocks, table `records.BLOCKS`.

    Returns
    -------
    DataFrame
        Table `records.PREDICTIONS`, one row per block and trim, in the order of `blocks`; NaN with a reason where
        the trim cannot be had.
    """
    inputs = _Inputs.of(vehicle, blocks)
    frames = [_predict_trim(trim, vehicle, inputs) for trim in ("pitch", "battery", "fixed_alpha")]
    order = np.arange(len(blocks) * len(TRIMS)).reshape(len(TRIMS), -1).T.ravel()
    return pd.concat(frames, ignore_index=True).iloc[order].reset_index(drop=True)


def nominal(
    vehicle: Vehicle,
    *,
    net_buoyancy: float,
    propeller_speed: float,
    pitch: float | None,
    density: float | None = None,
    propeller_power: float = 0.0,
    net_buoyancy_std: float = 0.0,
    propeller_speed_std: float = 0.0,
    pitch_std: float = 0.0,
) -> dict[str, Any]:
    """Return what the theory says of one published setting: a row of Section 5 of Niu et al. (2017).

    Parameters
    ----------
    vehicle
        Vehicle whose theory is asked.
    net_buoyancy, propeller_speed, pitch
        G [N, up positive], n [rev/s], measured mean pitch θ [rad] or None; with their 1-sigma.
    density
        In-situ density, kg/m³; the vehicle's reference density if left out.
    propeller_power
        W, where thrust follows from it and not from the propeller's speed.

    Returns
    -------
    dict
        ``free_pitch`` and ``free_pitch_paper`` (α_e = -K_M0/K_M; physical signs and as printed): ``speed``,
        ``path_angle``, ``angle_of_attack``, ``pitch``, ``thrust``. ``held_pitch``: the same and
        ``required_moment``. ``range`` and ``range_paper``, Eqs. (27) and (28) at free pitch: ``speed_lower``,
        ``speed_upper``, ``thrust_bound``. Each number with ``<name>_std`` from the coefficients; NaN, and
        ``reason``, where it cannot be had.
    """
    values = {
        "net_buoyancy": net_buoyancy,
        "propeller_speed": propeller_speed,
        "propeller_power": propeller_power,
    }
    inputs_std = {"net_buoyancy": net_buoyancy_std, "propeller_speed": propeller_speed_std}
    if pitch is not None:
        values["pitch"] = pitch
        inputs_std["pitch"] = pitch_std

    def at(changed: Vehicle, changed_values: dict[str, float]) -> Array:
        return _nominal_row(changed, changed_values, density)[0]

    centre, reasons = _nominal_row(vehicle, values, density)
    slopes = [
        (at(_shifted(vehicle, sizes, _STEP), values) - at(_shifted(vehicle, sizes, -_STEP), values), std)
        for sizes, std in _errors(vehicle)
    ]
    for name, std in inputs_std.items():
        ahead, behind = (values | {name: values[name] + step * std} for step in (_STEP, -_STEP))
        slopes.append((at(vehicle, ahead) - at(vehicle, behind), std))
    variance = np.zeros_like(centre)
    for change, std in slopes:
        variance += np.where(change == 0.0, 0.0, (change / (2.0 * _STEP)) ** 2 if math.isfinite(std) else np.nan)
    deviation = np.where(np.isnan(centre), np.nan, np.sqrt(variance))

    result: dict[str, Any] = {}
    keys = iter(range(centre.size))
    for (name, quantities), reason in zip(_NOMINAL.items(), reasons, strict=True):
        part: dict[str, Any] = {}
        for quantity in quantities:
            k = next(keys)
            part[quantity], part[f"{quantity}_std"] = float(centre[k]), float(deviation[k])
        result[name] = part | {"reason": reason}
    return result


_FLIGHT = ("speed", "path_angle", "angle_of_attack", "pitch", "thrust")
_RANGE = ("speed_lower", "speed_upper", "thrust_bound")
_NOMINAL: dict[str, tuple[str, ...]] = {
    "free_pitch": _FLIGHT,
    "free_pitch_paper": _FLIGHT,
    "held_pitch": (*_FLIGHT, "required_moment"),
    "range": _RANGE,
    "range_paper": _RANGE,
}


def _nominal_row(vehicle: Vehicle, values: dict[str, float], density: float | None) -> tuple[Array, list[str]]:
    """Return the numbers of `nominal` in the order of `_NOMINAL`, and the reason of each part."""
    g, n, power = (values[name] for name in ("net_buoyancy", "propeller_speed", "propeller_power"))
    alpha, alpha_reason = free_angle_of_attack(vehicle)
    both: tuple[Signs, Signs] = ("physical", "paper")
    free = [
        steady_state(vehicle, g, alpha, propeller_speed=n, propeller_power=power, density=density, signs=signs)
        for signs in both
    ]
    pitch = values.get("pitch", math.nan)
    held = trim_at_pitch(vehicle, g, pitch, propeller_speed=n, propeller_power=power, density=density)
    limits = [
        stable_range(vehicle, g, alpha, state.thrust, density=density, signs=signs)
        for state, signs in zip(free, both, strict=True)
    ]
    parts: list[Any] = [*free, held, *limits]
    numbers = [
        float(getattr(part, quantity))
        for part, quantities in zip(parts, _NOMINAL.values(), strict=True)
        for quantity in quantities
    ]
    free_reasons = [alpha_reason or str(state.reason) for state in free]
    return np.array(numbers), [*free_reasons, str(held.reason), *free_reasons]


def _errors(vehicle: Vehicle) -> list[tuple[dict[str, float], float]]:
    """Return each independent error of the coefficients: by how much it moves which, and its 1-sigma (may be NaN)."""
    single = [name for name in vehicle.coefficients if name not in _THRUST and not math.isnan(vehicle[name])]
    errors = [({name: vehicle.std(name)}, vehicle.std(name)) for name in single]
    if vehicle.propeller is not None:
        std = vehicle.propeller_error
        both = {"thrust_static": std.static, "thrust_slope": std.correlation * std.slope}
        alone = {"thrust_slope": std.slope * math.sqrt(1.0 - std.correlation**2)}
        errors += [(both, std.static), (alone, std.slope)]
    return errors


def _shifted(vehicle: Vehicle, sizes: dict[str, float], step: float) -> Vehicle:
    """Return `vehicle` with coefficients moved by `step` times their sizes, or by a trifle where a size is unknown."""
    changes = {
        name: vehicle[name] + step * (size if math.isfinite(size) else 1e-3 * abs(vehicle[name]))
        for name, size in sizes.items()
    }
    return vehicle.with_values(changes, "moved by its 1-sigma")


def free_angle_of_attack(vehicle: Vehicle) -> tuple[float, str]:
    """Return the paper's α_e = -K_M0/K_M, rad, at which the free vehicle has no moment; NaN with a reason."""
    unknown = [name for name in ("moment_at_zero", "moment_slope") if math.isnan(vehicle[name])]
    if unknown:
        return math.nan, f"the vehicle file leaves {', '.join(unknown)} unknown"
    if vehicle["moment_slope"] == 0.0:
        return math.nan, "no equilibrium: the pitching moment does not depend on the angle of attack"
    alpha = -vehicle["moment_at_zero"] / vehicle["moment_slope"]
    if abs(alpha) > MAX_ANGLE_OF_ATTACK:
        return math.nan, f"no equilibrium: -K_M0/K_M is {alpha:.2f} rad, beyond {MAX_ANGLE_OF_ATTACK} rad"
    return alpha, ""


@dataclass(frozen=True)
class _Inputs:
    """Columns of the blocks as the theory takes them, and why a block cannot be computed at all."""

    block: NDArray[Any]
    net_buoyancy: Array
    pitch: Array
    propeller_speed: Array
    propeller_power: Array
    battery_position: Array
    density: Array
    std: dict[str, Array]
    reason: NDArray[Any]

    @classmethod
    def of(cls, vehicle: Vehicle, blocks: pd.DataFrame) -> _Inputs:
        """Return the inputs of `blocks`; speed and power of a propeller that stands still are 0, absurd values NaN."""

        def column(name: str) -> Array:
            return blocks[name].to_numpy(dtype=np.float64, na_value=np.nan)

        density, pitch = column("density"), column("pitch")
        powered, logged = blocks["powered"].to_numpy(dtype=bool), column("propeller_speed")
        turning, power = driven(vehicle, powered, logged, column("propeller_power"))
        fast = np.abs(turning) > MAX_PROPELLER_SPEED
        steep = np.abs(pitch) > 0.5 * math.pi
        reason: NDArray[Any] = np.full(len(blocks), "", dtype=object)
        reason[steep] = "pitch beyond 90 degrees: degrees for radians?"
        reason[fast] = f"propeller speed above {MAX_PROPELLER_SPEED:g} rev/s: rpm for rev/s?"
        nothing = np.isnan(logged) & np.isnan(column("propeller_power"))
        reason[np.isnan(turning)] = NO_THRUST_LAW
        reason[np.isnan(turning) & nothing] = "powered, but neither speed nor power of the propeller is known"
        reason[~(density > 0.0)] = "density is missing or not positive"
        return cls(
            block=blocks["block"].to_numpy(),
            net_buoyancy=column("net_buoyancy"),
            pitch=np.where(steep, np.nan, pitch),
            propeller_speed=np.where(fast, np.nan, turning),
            propeller_power=power,
            battery_position=column("battery_position"),
            density=np.where(density > 0.0, density, np.nan),
            std={
                name: column(f"{name}_std")
                for name in ("net_buoyancy", "pitch", "propeller_speed", "propeller_power", "battery_position")
            },
            reason=reason,
        )


def _predict_trim(trim: Trim, vehicle: Vehicle, inputs: _Inputs) -> pd.DataFrame:
    state, reason = _state(trim, vehicle, inputs)
    slopes = sensitivities(
        trim,
        vehicle,
        inputs.net_buoyancy,
        state.speed,
        state.path_angle,
        state.angle_of_attack,
        propeller_speed=inputs.propeller_speed,
        propeller_power=inputs.propeller_power,
        density=inputs.density,
        battery_position=inputs.battery_position,
    )
    thrust_std = relative_thrust_std(
        vehicle, inputs.density, inputs.propeller_speed, inputs.propeller_power, state.speed
    )
    deviation = _deviations(slopes, vehicle, inputs, thrust_std)
    limits = stable_range(vehicle, inputs.net_buoyancy, state.angle_of_attack, state.thrust, density=inputs.density)
    known = np.isfinite(state.speed)
    frame = pd.DataFrame(
        {
            "block": inputs.block,
            "trim": trim,
            "speed": state.speed,
            "path_angle": state.path_angle,
            "angle_of_attack": state.angle_of_attack,
            "pitch": state.pitch,
            "thrust": state.thrust,
            **{f"{name}_std": np.where(known, deviation[name], np.nan) for name in Slope._fields},
            "pitch_std": np.where(known, deviation["pitch"], np.nan),
            "stable": limits.stable & known,
            "speed_lower": limits.speed_lower,
            "speed_upper": limits.speed_upper,
            "reason": reason,
        }
    )
    return conform(frame, PREDICTIONS)


def _state(trim: Trim, vehicle: Vehicle, inputs: _Inputs) -> tuple[Steady, NDArray[Any]]:
    """Return the steady flight of each block and the reasons, the block's own before the trim's."""
    g, n, power, rho = inputs.net_buoyancy, inputs.propeller_speed, inputs.propeller_power, inputs.density
    first: str | NDArray[Any] = ""
    if trim == "pitch":
        state = trim_at_pitch(vehicle, g, inputs.pitch, propeller_speed=n, propeller_power=power, density=rho)
    elif trim == "fixed_alpha":
        alpha, first = free_angle_of_attack(vehicle)
        held = np.full_like(g, alpha)
        state = steady_state(vehicle, g, held, propeller_speed=n, propeller_power=power, density=rho)
    else:
        if math.isnan(vehicle["battery_mass"]):
            first = "the vehicle file gives no battery mass"
        else:
            first = np.where(np.isnan(inputs.battery_position), "no battery position is logged", "")
        state = trim_at_moment(
            vehicle, g, battery_position=inputs.battery_position, propeller_speed=n, propeller_power=power, density=rho
        )
    reason = np.where(inputs.reason != "", inputs.reason, np.where(np.asarray(first) != "", first, state.reason))
    return state, np.where(np.isnan(state.speed), reason, "")


def _deviations(slopes: dict[str, Slope], vehicle: Vehicle, inputs: _Inputs, thrust_std: Array) -> dict[str, Array]:
    """Return the 1-sigma of speed, path angle, angle of attack and pitch, m/s and rad, shape (n,) each."""
    variance: dict[str, Array] = {}
    for name in (*Slope._fields, "pitch"):
        total = np.zeros_like(inputs.net_buoyancy)
        for parameter, slope in slopes.items():
            if parameter in inputs.std:
                std: Array | float = inputs.std[parameter]
            elif parameter == "thrust_scale":
                std = thrust_std
            else:
                std = vehicle.std(parameter)
            gradient = getattr(slope, name)
            total = total + np.where(gradient == 0.0, 0.0, (gradient * std) ** 2)
        variance[name] = total
    return {name: np.sqrt(total) for name, total in variance.items()}

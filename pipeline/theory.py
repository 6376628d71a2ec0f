"""Theory by hand: steady flight for inputs from the command line, in the units that people type and read."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from pipeline.model.stability import stable_range
from pipeline.model.steady import Signs, Steady, steady_state, trim_at_moment, trim_at_pitch

if TYPE_CHECKING:
    from pipeline.vehicle import Vehicle

Row = dict[str, float | bool | str | None]
#: What may be asked for: least, most, and the unit in which it is typed.
RANGES = {
    "net buoyancy": (-1e4, 1e4, "N"),
    "alpha": (-28.6, 28.6, "degrees"),
    "pitch": (-90.0, 90.0, "degrees"),
    "battery position": (-1.0, 1.0, "m"),
    "rpm": (0.0, 1e4, "rev/min"),
    "thrust": (0.0, 1e4, "N"),
    "density": (950.0, 1150.0, "kg/m3, in situ"),
}


def steady_rows(
    vehicle: Vehicle,
    net_buoyancy: Sequence[float],
    alpha_deg: Sequence[float],
    *,
    rpm: float | None = None,
    thrust: float | None = None,
    density: float | None = None,
    signs: Signs = "physical",
) -> list[Row]:
    """Return steady flight and its stable range at held angles of attack, one row for each pair of inputs.

    Parameters
    ----------
    vehicle
        Vehicle with a known polar.
    net_buoyancy
        N, up positive.
    alpha_deg
        Angles of attack, degrees; if empty the paper's own, α_e = -K_M0/K_M.
    rpm, thrust
        Propeller speed, rev/min, or thrust, N; neither for gliding.
    density
        kg/m³; the vehicle's reference density if left out.
    signs
        ``physical`` or ``paper``, see `steady_state`.

    Raises
    ------
    ValueError
        As for `steady_state`; if there is neither an angle of attack nor the moments that give the paper's own; if an
        input is none that a glider can have (`RANGES`).
    """
    _refuse({"net buoyancy": net_buoyancy, "alpha": alpha_deg}, rpm, thrust, density)
    held = np.deg2rad(alpha_deg) if alpha_deg else np.array([-vehicle["moment_at_zero"] / vehicle["moment_slope"]])
    if np.isnan(held).any():
        raise ValueError(f"'{vehicle.name}' has no pitching moments, so no α_e = -K_M0/K_M; give --alpha")
    force, alpha = _pairs(net_buoyancy, held)
    flight = steady_state(
        vehicle, force, alpha, thrust=thrust, propeller_speed=_per_second(rpm), density=density, signs=signs
    )
    span = stable_range(vehicle, force, alpha, np.nan_to_num(flight.thrust), density=density, signs=signs)
    rows = _rows(force, flight)
    for row, lower, upper, stable in zip(rows, span.speed_lower, span.speed_upper, span.stable, strict=True):
        row |= {"stable from m/s": _number(lower), "to m/s": _number(upper), "stable": bool(stable)}
    return rows


def trim_rows(
    vehicle: Vehicle,
    net_buoyancy: Sequence[float],
    *,
    pitch_deg: Sequence[float] = (),
    battery: Sequence[float] = (),
    rpm: float | None = None,
    thrust: float | None = None,
    density: float | None = None,
) -> list[Row]:
    """Return steady flight at held pitches (degrees), or at battery positions (m), one row for each pair of inputs.

    The other parameters are those of `steady_rows`; at a battery position thrust follows from the propeller alone.

    Raises
    ------
    ValueError
        If not exactly one of pitch and battery position is given, or thrust with a battery position; if an input is
        none that a glider can have (`RANGES`).
    """
    _refuse({"net buoyancy": net_buoyancy, "pitch": pitch_deg, "battery position": battery}, rpm, thrust, density)
    if bool(pitch_deg) == bool(battery):
        raise ValueError("give a pitch or a battery position")
    if pitch_deg:
        force, pitch = _pairs(net_buoyancy, np.deg2rad(pitch_deg))
        flight = trim_at_pitch(vehicle, force, pitch, thrust=thrust, propeller_speed=_per_second(rpm), density=density)
        return _rows(force, flight)
    if thrust is not None:
        raise ValueError("with a battery position give the propeller speed, not the thrust")
    force, position = _pairs(net_buoyancy, np.asarray(battery))
    flight = trim_at_moment(
        vehicle, force, battery_position=position, propeller_speed=_per_second(rpm), density=density
    )
    return _rows(force, flight)


def _refuse(lists: dict[str, Sequence[float]], rpm: float | None, thrust: float | None, density: float | None) -> None:
    """Refuse, in the unit in which it was typed, an input outside its range."""
    single = {"rpm": rpm, "thrust": thrust, "density": density}
    given = lists | {name: [value] for name, value in single.items() if value is not None}
    for name, values in given.items():
        low, high, unit = RANGES[name]
        for value in values:
            if not low <= value <= high:
                raise ValueError(f"{name}: found {value:g}; expected {low:g} to {high:g} {unit}")


def _pairs(first: Sequence[float], second: Sequence[float] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    pairs = np.array(list(product(first, second)), dtype=np.float64)
    return pairs[:, 0], pairs[:, 1]


def _per_second(rpm: float | None) -> float | None:
    return None if rpm is None else rpm / 60.0


def _rows(force: np.ndarray, flight: Steady) -> list[Row]:
    columns = {
        "G N": force,
        "V m/s": flight.speed,
        "pitch deg": np.rad2deg(flight.pitch),
        "path deg": np.rad2deg(flight.path_angle),
        "alpha deg": np.rad2deg(flight.angle_of_attack),
        "T N": flight.thrust,
        "J": flight.advance_ratio,
        "moment N m": flight.required_moment,
    }
    rows: list[Row] = [{name: _number(values[row]) for name, values in columns.items()} for row in range(len(force))]
    for row, reason in zip(rows, flight.reason, strict=True):
        row["reason"] = str(reason)
    return rows


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None

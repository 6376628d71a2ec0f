"""Means over blocks of steady flight: what comparison and fit work on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import gsw
import numpy as np
import pandas as pd

from pipeline.estimate.ballast import Hull, borrowed_std
from pipeline.estimate.forcing import weight_around
from pipeline.estimate.series import LEVEL, powered
from pipeline.findings import Finding
from pipeline.geodesy import typical_latitude
from pipeline.mission import Mission
from pipeline.model.exchange import HULL_TIME_BEFORE, carried, fairing_of, lagged
from pipeline.model.forces import PASCAL_PER_DBAR, net_buoyancy, power_for, thrust_by_power
from pipeline.records import BLOCKS, conform, seconds, usable
from pipeline.vehicle import Vehicle

#: A block is used when the speed is observable in at least this share of it.
SHARE = 0.5
#: 1-sigma (m/s) of what a speed sensor's mean is off by, whatever the number of samples.
SENSOR_FLOOR = 0.005

_STATES = ("speed", "angle_of_attack", "path_angle")
#: Columns that block means are made of: of the estimates, of the records, and of the records where they are usable.
_ESTIMATED = ("observable", "pitch", *_STATES, *(f"{name}_std" for name in _STATES))
_READ = ("depth", "density", "temperature", "pressure", "battery_position")
_JUDGED = ("pitch", "roll", "heading", "speed_through_water", "battery_voltage")

#: Values in a block by name, shape (k,) each.
_Values = Mapping[str, np.ndarray]


class _Late(NamedTuple):
    """What lags behind the water around, along the records or in the mean of a block; shape (m,) each."""

    warmth: Any  # K per s of the hull's time constant
    by_carried: Any  # N per share of the hull's volume that the fairing carries
    by_fold: Any  # N per that share and e-fold of the time in which it is renewed

    def mean(self, inside: Any) -> _Late:
        return _Late(*(float(value[inside].mean()) for value in self))


NO_ENGINE = Finding("warning", "records", "buoyancy_volume", "no engine volume", "one", "no net buoyancy, no theory")


def means(
    records: pd.DataFrame, estimates: pd.DataFrame, vehicle: Vehicle, mission: Mission, body: Hull | None
) -> pd.DataFrame:
    """Return the table `pipeline.records.BLOCKS` of a part of a mission that holds its blocks whole.

    Parameters
    ----------
    records, estimates
        Canonical tables, row by row of the same instants.
    vehicle, mission
        Vehicle and mission.
    body
        Mass and volume of the vehicle in the whole mission; None: there is no net buoyancy.
    """
    driven = powered(records)
    time = seconds(records["time"])
    number, place = records["block"].to_numpy(), np.arange(len(records))
    stamps, dives, reasons = records["time"].array, records["dive"].to_numpy(), estimates["reason"]
    engine = records["buoyancy_volume"].ffill().bfill().to_numpy()
    gravity = float(gsw.grav(typical_latitude(records["latitude"], mission.latitude), 0.0))
    rotation, power = (records[name].ffill().to_numpy() for name in ("propeller_speed", "propeller_power"))
    nothing = np.zeros(time.size)
    water = (nothing, nothing)
    if body is not None:
        water = carried(time, weight_around(records, time, body, gravity), fairing_of(vehicle).time)
    late = _Late(_warmth(time, records["temperature"].to_numpy()), *water)
    rows: list[dict[str, Any]] = []
    lent = borrowed_std(mission, records)
    estimated = {name: estimates[name].to_numpy() for name in _ESTIMATED}
    read = {name: records[name].to_numpy() for name in _READ}
    read |= {name: np.where(usable(records, name), records[name].to_numpy(), np.nan) for name in _JUDGED}
    read["depth_measured"] = np.where(usable(records, "pressure"), read["depth"], np.nan)
    for block, first, count in zip(*np.unique(number, return_index=True, return_counts=True), strict=True):
        if block < 0:
            continue
        inside: Any = slice(first, first + count)
        if (number[inside] != block).any():
            inside = np.flatnonzero(number == block)
        part, flown = ({name: value[inside] for name, value in table.items()} for table in (read, estimated))
        row: dict[str, Any] = {
            "block": block,
            "start": stamps[first],
            "end": stamps[place[inside][-1]],
            "dive": int(dives[first]),
            "powered": bool(driven[inside].mean() > 0.5),
        }
        row |= _flight(flown, reasons, inside)
        row |= _pitch(part, flown, mission)
        row |= _attitude(part)
        row |= _depth_rate(part, time[inside])
        row |= _water(part, lent)
        row |= _sensor(part)
        row |= _battery(part)
        row |= _propeller(rotation[inside], power[inside], row, vehicle)
        row |= _buoyancy(part, engine[inside], late.mean(inside), body, vehicle, gravity)
        level = row["powered"] and abs(row["pitch"]) < LEVEL
        row["direction"] = 0 if level or np.isnan(row["depth_rate"]) else int(-np.sign(row["depth_rate"]))
        rows.append(row)
    return conform(pd.DataFrame(rows), BLOCKS)


def _known(value: np.ndarray) -> np.ndarray:
    return np.asarray(value[np.isfinite(value)])


def _mean(value: np.ndarray) -> float:
    """Return the mean of what is known, NaN if nothing is."""
    known = _known(value)
    return float(known.mean()) if known.size else math.nan


def _flight(flown: _Values, reasons: pd.Series, inside: slice | np.ndarray) -> dict[str, Any]:
    """Return means of the estimates; within a block their errors are one and the same, so the 1-sigma stays."""
    seen = flown["observable"].astype(bool)
    if seen.mean() < SHARE:
        return {"used": False, "reason": f"speed unobservable: {reasons.iloc[inside][~seen].mode().iloc[0]}"}
    row: dict[str, Any] = {"used": True, "reason": ""}
    for name in _STATES:
        row[name] = float(flown[name][seen].mean())
        row[f"{name}_std"] = float(np.sqrt(np.mean(flown[f"{name}_std"][seen] ** 2)))
    return row


def _pitch(part: _Values, flown: _Values, mission: Mission) -> dict[str, float]:
    value = _known(part["pitch"])
    mean = float(value.mean()) if value.size else _mean(flown["pitch"])
    scatter = float(value.std() / np.sqrt(value.size)) if value.size > 1 else 0.0
    return {"pitch": mean, "pitch_std": float(np.hypot(scatter, np.radians(mission.pitch.std_deg)))}


def _attitude(part: _Values) -> dict[str, float]:
    """Return mean roll, and the direction of the mean of the headings' unit vectors."""
    heading = _known(part["heading"])
    turned = float(np.angle(np.mean(np.exp(1j * heading)))) % (2.0 * math.pi) if heading.size else math.nan
    return {"roll": _mean(part["roll"]), "heading": turned}


def _depth_rate(part: _Values, time: np.ndarray) -> dict[str, float]:
    """Return the slope of a straight line through the measured depths, positive sinking."""
    known = np.isfinite(part["depth_measured"])
    t, z = time[known], part["depth_measured"][known]
    if t.size < 3 or t[-1] <= t[0]:
        return {"depth_rate": np.nan, "depth_rate_std": np.nan, "depth": _mean(part["depth"])}
    t = t - t.mean()
    slope = float(t @ (z - z.mean()) / (t @ t))
    residual = z - z.mean() - slope * t
    std = float(np.sqrt(residual @ residual / (t.size - 2) / (t @ t)))
    return {"depth_rate": slope, "depth_rate_std": std, "depth": float(z.mean())}


def _water(part: _Values, lent: float) -> dict[str, float]:
    """Return mean density; its 1-sigma is no less than that of a density that mission.yaml lends."""
    density = _known(part["density"])
    if not density.size:
        return {"density": np.nan, "density_std": np.nan}
    return {"density": float(density.mean()), "density_std": math.hypot(density.std() / np.sqrt(density.size), lent)}


def _sensor(part: _Values) -> dict[str, float]:
    value = _known(part["speed_through_water"])
    if not value.size:
        return {}
    return {
        "sensor_speed": float(value.mean()),
        "sensor_speed_std": float(np.hypot(value.std() / np.sqrt(value.size), SENSOR_FLOOR)),
    }


def _battery(part: _Values) -> dict[str, float]:
    voltage = {"battery_voltage": _mean(part["battery_voltage"])}
    position = _known(part["battery_position"])
    if not position.size:
        return voltage
    return voltage | {
        "battery_position": float(position.mean()),
        "battery_position_std": float(position.std() / np.sqrt(position.size)),
    }


def _propeller(rotation: np.ndarray, power: np.ndarray, row: Mapping[str, Any], vehicle: Vehicle) -> dict[str, float]:
    """Return mean speed of the propeller, and the constant power that gives the mean thrust, at the block's speed.

    Thrust is less than proportional to power: a propeller at half power is more than half as strong. Where the vehicle
    has no law of thrust by power the power is the mean.
    """
    names = ("propeller_speed", "propeller_power")
    if not row["powered"]:
        return {f"{name}{kind}": 0.0 for name in names for kind in ("", "_std")}
    mean, disk = float(np.mean(power)), vehicle.disk
    speed, density = float(np.nan_to_num(row.get("speed", 0.0))), row["density"]
    if disk is not None and density > 0.0:
        thrust, _, _ = thrust_by_power(disk, density, np.maximum(power, 0.0), speed)
        mean = float(power_for(disk, density, thrust.mean(), speed))
    return {
        "propeller_speed": float(np.mean(rotation)),
        "propeller_speed_std": float(np.std(rotation)),
        "propeller_power": mean,
        "propeller_power_std": float(np.std(power) / np.sqrt(power.size)),
    }


def _buoyancy(
    part: _Values,
    engine: np.ndarray,
    late: _Late,
    body: Hull | None,
    vehicle: Vehicle,
    gravity: float,
) -> dict[str, float]:
    """Return net buoyancy at the block's mean density, pressure and temperature, the hull as warm as the water.

    The fairing carries the water that the vehicle file says. What more of it, or a lag of the hull's temperature, would
    change is said beside it.
    """
    nothing = {"net_buoyancy": np.nan, "net_buoyancy_std": np.nan}
    if body is None:
        return nothing
    density, pressure, temperature = (_mean(part[name]) for name in ("density", "pressure", "temperature"))
    temperature = vehicle["reference_temperature"] if math.isnan(temperature) else temperature
    value = float(
        net_buoyancy(
            mass=body.mass,
            volume=body.volume,
            buoyancy_volume=float(np.mean(engine)),
            density=density,
            pressure=pressure,
            temperature=temperature,
            compressibility=vehicle["compressibility"],
            thermal_expansion=vehicle["thermal_expansion"],
            reference_temperature=vehicle["reference_temperature"],
            gravity=gravity,
        )
    )
    fairing = fairing_of(vehicle)
    value += fairing.share * late.by_carried
    if not np.isfinite(value):
        return nothing
    by_flushing = fairing.share * late.by_fold / fairing.time
    displaced = gravity * density * body.volume
    by_squeeze = -displaced * PASCAL_PER_DBAR * pressure
    by_expand = displaced * (temperature - vehicle["reference_temperature"])
    std = math.hypot(
        body.std,
        by_squeeze * np.nan_to_num(vehicle.std("compressibility")),
        by_expand * np.nan_to_num(vehicle.std("thermal_expansion")),
        late.by_carried * fairing.share_std,
        by_flushing * fairing.time_std,
    )
    return {
        "net_buoyancy": value,
        "net_buoyancy_std": std,
        "buoyancy_by_compression": by_squeeze,
        "buoyancy_by_expansion": by_expand,
        "buoyancy_by_lag": displaced * vehicle["thermal_expansion"] * late.warmth,
        "buoyancy_by_carried": late.by_carried,
        "buoyancy_by_flushing": by_flushing,
    }


def _warmth(time: np.ndarray, temperature: np.ndarray) -> np.ndarray:
    """Return by how much a hull that lags by `HULL_TIME_BEFORE` is warmer than the water, per s of that, shape (m,)."""
    known = np.isfinite(temperature)
    if not known.any():
        return np.zeros(time.size)
    whole = np.interp(time, time[known], temperature[known])
    return np.asarray((lagged(time, whole, HULL_TIME_BEFORE) - whole) / HULL_TIME_BEFORE)

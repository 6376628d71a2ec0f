"""Means over blocks of steady flight: what comparison and fit work on."""

from __future__ import annotations

import math
from typing import Any

import gsw
import numpy as np
import pandas as pd

from pipeline.estimate.ballast import Hull, borrowed_std, latitude
from pipeline.estimate.forcing import lagged
from pipeline.estimate.series import LEVEL, powered
from pipeline.findings import Finding
from pipeline.mission import Mission
from pipeline.model.forces import HULL_TIME_BEFORE, PASCAL_PER_DBAR, net_buoyancy
from pipeline.records import BLOCKS, conform, seconds, usable
from pipeline.vehicle import Vehicle

#: A block is used when the speed is observable in at least this share of it.
SHARE = 0.5
#: 1-sigma (m/s) of what a speed sensor's mean is off by, whatever the number of samples.
SENSOR_FLOOR = 0.005

_STATES = ("speed", "angle_of_attack", "path_angle")
#: Columns that block means are made of.
_ESTIMATED = ["observable", "reason", "pitch", *_STATES, *(f"{name}_std" for name in _STATES)]
_JUDGED = ("pitch", "roll", "heading", "pressure", "speed_through_water")
_READ = ["time", "dive", "depth", "density", "temperature", "battery_position", *_JUDGED, *(f"{x}_qc" for x in _JUDGED)]

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
    number = records["block"].to_numpy()
    engine = records["buoyancy_volume"].ffill().bfill().to_numpy()
    gravity = float(gsw.grav(latitude(records, mission), 0.0))
    rotation = records["propeller_speed"].ffill().to_numpy()
    lag = _lag(time, records["temperature"].to_numpy())
    rows: list[dict[str, Any]] = []
    lent = borrowed_std(mission, records)
    records, estimates = records[_READ], estimates[_ESTIMATED]
    for block, first, count in zip(*np.unique(number, return_index=True, return_counts=True), strict=True):
        if block < 0:
            continue
        inside: Any = slice(first, first + count)
        if (number[inside] != block).any():
            inside = np.flatnonzero(number == block)
        part = records.iloc[inside]
        row: dict[str, Any] = {
            "block": block,
            "start": part["time"].iloc[0],
            "end": part["time"].iloc[-1],
            "dive": int(part["dive"].iloc[0]),
            "powered": bool(driven[inside].mean() > 0.5),
        }
        row |= _flight(estimates.iloc[inside])
        row |= _pitch(part, estimates.iloc[inside], mission)
        row |= _attitude(part)
        row |= _depth_rate(part, time[inside])
        row |= _water(part, lent)
        row |= _sensor(part)
        row |= _settings(part, rotation[inside], row["powered"])
        row |= _buoyancy(part, engine[inside], float(lag[inside].mean()), body, vehicle, gravity)
        level = row["powered"] and abs(row["pitch"]) < LEVEL
        row["direction"] = 0 if level or np.isnan(row["depth_rate"]) else int(-np.sign(row["depth_rate"]))
        rows.append(row)
    return conform(pd.DataFrame(rows), BLOCKS)


def _flight(part: pd.DataFrame) -> dict[str, Any]:
    """Return means of the estimates; within a block their errors are one and the same, so the 1-sigma stays."""
    seen = part["observable"].to_numpy(dtype=bool)
    if seen.mean() < SHARE:
        reasons = part.loc[~seen, "reason"]
        return {"used": False, "reason": f"speed unobservable: {reasons.mode().iloc[0]}"}
    row: dict[str, Any] = {"used": True, "reason": ""}
    for name in _STATES:
        row[name] = float(part[name].to_numpy()[seen].mean())
        row[f"{name}_std"] = float(np.sqrt(np.mean(part[f"{name}_std"].to_numpy()[seen] ** 2)))
    return row


def _pitch(part: pd.DataFrame, estimates: pd.DataFrame, mission: Mission) -> dict[str, float]:
    value = part["pitch"].to_numpy()[usable(part, "pitch")]
    mean = float(value.mean()) if value.size else float(estimates["pitch"].mean())
    scatter = float(value.std() / np.sqrt(value.size)) if value.size > 1 else 0.0
    return {"pitch": mean, "pitch_std": float(np.hypot(scatter, np.radians(mission.pitch.std_deg)))}


def _attitude(part: pd.DataFrame) -> dict[str, float]:
    """Return mean roll, and the direction of the mean of the headings' unit vectors."""
    roll, heading = (part[name].to_numpy()[usable(part, name)] for name in ("roll", "heading"))
    turned = float(np.angle(np.mean(np.exp(1j * heading)))) % (2.0 * math.pi) if heading.size else math.nan
    return {"roll": float(roll.mean()) if roll.size else math.nan, "heading": turned}


def _depth_rate(part: pd.DataFrame, time: np.ndarray) -> dict[str, float]:
    """Return the slope of a straight line through the measured depths, positive sinking."""
    known = usable(part, "pressure")
    t, z = time[known], part["depth"].to_numpy()[known]
    if t.size < 3 or t[-1] <= t[0]:
        return {"depth_rate": np.nan, "depth_rate_std": np.nan, "depth": float(part["depth"].mean())}
    t = t - t.mean()
    slope = float(t @ (z - z.mean()) / (t @ t))
    residual = z - z.mean() - slope * t
    std = float(np.sqrt(residual @ residual / (t.size - 2) / (t @ t)))
    return {"depth_rate": slope, "depth_rate_std": std, "depth": float(z.mean())}


def _water(part: pd.DataFrame, lent: float) -> dict[str, float]:
    """Return mean density; its 1-sigma is no less than that of a density that mission.yaml lends."""
    density = part["density"].to_numpy()
    density = density[np.isfinite(density)]
    if not density.size:
        return {"density": np.nan, "density_std": np.nan}
    return {"density": float(density.mean()), "density_std": math.hypot(density.std() / np.sqrt(density.size), lent)}


def _sensor(part: pd.DataFrame) -> dict[str, float]:
    good = usable(part, "speed_through_water")
    if not good.any():
        return {}
    value = part["speed_through_water"].to_numpy()[good]
    return {
        "sensor_speed": float(value.mean()),
        "sensor_speed_std": float(np.hypot(value.std() / np.sqrt(value.size), SENSOR_FLOOR)),
    }


def _settings(part: pd.DataFrame, rotation: np.ndarray, driven: bool) -> dict[str, float]:
    row = {"propeller_speed": 0.0, "propeller_speed_std": 0.0}
    if driven:
        row = {"propeller_speed": float(np.mean(rotation)), "propeller_speed_std": float(np.std(rotation))}
    position = part["battery_position"].dropna().to_numpy()
    if position.size:
        row["battery_position"] = float(position.mean())
        row["battery_position_std"] = float(position.std() / np.sqrt(position.size))
    return row


def _buoyancy(
    part: pd.DataFrame,
    engine: np.ndarray,
    lag: float,
    body: Hull | None,
    vehicle: Vehicle,
    gravity: float,
) -> dict[str, float]:
    """Return net buoyancy at the block's mean density, pressure and temperature, the hull as warm as the water.

    What a `lag` of the hull's temperature, K per s of its time constant, would change is said beside it.
    """
    nothing = {"net_buoyancy": np.nan, "net_buoyancy_std": np.nan}
    if body is None:
        return nothing
    density, pressure, temperature = (float(part[name].mean()) for name in ("density", "pressure", "temperature"))
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
    if not np.isfinite(value):
        return nothing
    displaced = gravity * density * body.volume
    by_squeeze = -displaced * PASCAL_PER_DBAR * pressure
    by_expand = displaced * (temperature - vehicle["reference_temperature"])
    std = math.hypot(
        body.std,
        by_squeeze * np.nan_to_num(vehicle.std("compressibility")),
        by_expand * np.nan_to_num(vehicle.std("thermal_expansion")),
    )
    return {
        "net_buoyancy": value,
        "net_buoyancy_std": std,
        "buoyancy_by_compression": by_squeeze,
        "buoyancy_by_expansion": by_expand,
        "buoyancy_by_lag": displaced * vehicle["thermal_expansion"] * lag,
    }


def _lag(time: np.ndarray, temperature: np.ndarray) -> np.ndarray:
    """Return by how much a hull that lags by `HULL_TIME_BEFORE` is warmer than the water, per s of that, shape (m,)."""
    known = np.isfinite(temperature)
    if not known.any():
        return np.zeros(time.size)
    whole = np.interp(time, time[known], temperature[known])
    return np.asarray((lagged(time, whole, HULL_TIME_BEFORE) - whole) / HULL_TIME_BEFORE)

"""What drives the vehicle: net buoyancy, density and propeller along the records, for the force model alone."""

from __future__ import annotations

from typing import NamedTuple

import gsw
import numpy as np
import pandas as pd

from pipeline.estimate.ballast import Hull
from pipeline.estimate.series import changed_within, held, increasing, potential_density
from pipeline.geodesy import typical_latitude
from pipeline.mission import Mission
from pipeline.model.exchange import carried, lagged
from pipeline.model.forces import PASCAL_PER_DBAR, net_buoyancy
from pipeline.records import seconds, usable
from pipeline.vehicle import Vehicle

#: A gap (s) in the engine's record across which it moves by more than this share of its range hides when it moved.
GAP, MOVED = 30.0, 0.02


class Forcing(NamedTuple):
    """Inputs of the force model, one value per record; held or interpolated between reports: no measurements."""

    net_buoyancy: np.ndarray  # (m,) N, up positive
    by_compression: np.ndarray  # (m,) N per 1/Pa of compressibility
    by_expansion: np.ndarray  # (m,) N per 1/K of thermal expansion
    by_time: np.ndarray  # (m,) N per s of the hull's thermal time constant
    by_carried: np.ndarray  # (m,) N per hull volume of water that the fairing carries
    by_flushing: np.ndarray  # (m,) N per e-fold of the time in which that water is renewed
    density: np.ndarray  # (m,) kg/m3
    propeller_speed: np.ndarray  # (m,) rev/s
    propeller_power: np.ndarray  # (m,) W, where thrust is known by it; 0 elsewhere
    switching: np.ndarray  # (m,) s, within which the propeller's setting changed, just before it has; 0 elsewhere
    doubt: np.ndarray  # (m,) N, change of net buoyancy across a gap in the engine's record, within it; 0 elsewhere

    @property
    def driven(self) -> bool:
        """Whether the propeller turns at all."""
        return bool(self.propeller_speed.any() or self.propeller_power.any())


def forcing(records: pd.DataFrame, vehicle: Vehicle, mission: Mission, body: Hull) -> tuple[Forcing | None, str]:
    """Return the inputs of the force model along the records, the hull as warm as the water; or None and why.

    Parameters
    ----------
    records
        Canonical records, m rows.
    vehicle, mission
        Compressibility and thermal expansion; the latitude.
    body
        Mass and volume.
    """
    time = increasing(seconds(records["time"]))
    pressure = _between(time, np.where(usable(records, "pressure"), records["pressure"].to_numpy(), np.nan))
    temperature, density, engine = (
        _between(time, records[name].to_numpy()) for name in ("temperature", "density", "buoyancy_volume")
    )
    for name, value in (("pressure", pressure), ("density", density), ("buoyancy engine volume", engine)):
        if np.isnan(value).any():
            return None, f"no {name}: no net buoyancy"
    if np.isnan(temperature).any():
        temperature = np.full(time.size, vehicle["reference_temperature"])
    gravity = float(gsw.grav(typical_latitude(records["latitude"], mission.latitude), 0.0))
    squeeze, expand = (np.nan_to_num(vehicle[name]) for name in ("compressibility", "thermal_expansion"))
    force = net_buoyancy(
        mass=body.mass,
        volume=body.volume,
        buoyancy_volume=engine,
        density=density,
        pressure=pressure,
        temperature=temperature,
        compressibility=squeeze,
        thermal_expansion=expand,
        reference_temperature=vehicle["reference_temperature"],
        gravity=gravity,
    )
    displaced = gravity * density * body.volume
    power = _power(records, time, vehicle)
    return (
        Forcing(
            force,
            -displaced * PASCAL_PER_DBAR * pressure,
            displaced * (temperature - vehicle["reference_temperature"]),
            np.zeros(time.size),
            -weight_around(records, time, body, gravity),
            np.zeros(time.size),
            density,
            np.nan_to_num(held(time, records["propeller_speed"].to_numpy())),
            power,
            changed_within(
                time, (records["propeller_power"] if power.any() else records["propeller_speed"]).to_numpy()
            ),
            gravity * density * _unrecorded(time, records["buoyancy_volume"].to_numpy()),
        ),
        "",
    )


def with_thermal_lag(
    force: Forcing, time: np.ndarray, expansion: float, constant: float, change: float = 0.0
) -> Forcing:
    """Return `force` for a hull that takes on the water's temperature with a time constant.

    Parameters
    ----------
    force
        As from `forcing`, m instants.
    time
        s, shape (m,).
    expansion
        Thermal expansion of the hull that `force` was made with, 1/K.
    constant
        Time constant, s.
    change
        What the thermal expansion is more than that by now, 1/K; it enters `by_time` alone.
    """
    late = lagged(time, force.by_expansion, constant)
    later = lagged(time, force.by_expansion, constant + 1.0)
    return force._replace(
        net_buoyancy=force.net_buoyancy + expansion * (late - force.by_expansion),
        by_expansion=late,
        by_time=(expansion + change) * (later - late),
    )


def with_carried_water(force: Forcing, time: np.ndarray, share: float, constant: float) -> Forcing:
    """Return `force` for a fairing that carries water along and renews it with a time constant.

    Parameters
    ----------
    force
        As from `forcing`, m instants: `by_carried` is less than zero by the weight of the water around.
    time
        s, shape (m,).
    share
        Of the hull's volume, that is carried by now; it enters `by_flushing` alone.
    constant
        Time constant, s.
    """
    by_carried, by_fold = carried(time, -force.by_carried, constant)
    return force._replace(by_carried=by_carried, by_flushing=share * by_fold)


def weight_around(records: pd.DataFrame, time: np.ndarray, body: Hull, gravity: float) -> np.ndarray:
    """Return what a hull's volume of the water around weighs by its potential density less 1000 kg/m3, N, shape (m,).

    It is zero throughout where no potential density was measured.

    Parameters
    ----------
    records
        Canonical records, m rows.
    time
        s, shape (m,).
    body, gravity
        Volume of the hull, and acceleration of gravity, m/s2.
    """
    return np.asarray(gravity * body.volume * np.nan_to_num(_between(time, potential_density(records))))


def _power(records: pd.DataFrame, time: np.ndarray, vehicle: Vehicle) -> np.ndarray:
    """Return the propeller's power, W, where thrust follows from it: without a law or a record of its speed."""
    if vehicle.disk is None or (vehicle.propeller is not None and records["propeller_speed"].notna().any()):
        return np.zeros(len(records))
    return np.asarray(np.maximum(np.nan_to_num(held(time, records["propeller_power"].to_numpy())), 0.0))


def _unrecorded(time: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """Return by how much the engine's volume changed across a gap in its record, within the gap; 0 elsewhere."""
    change = np.zeros(time.size)
    known = np.flatnonzero(np.isfinite(volume))
    if known.size < 2:
        return change
    step, moved = np.diff(time[known]), np.abs(np.diff(volume[known]))
    gap = (step > max(GAP, 5.0 * float(np.median(step)))) & (moved > MOVED * np.ptp(volume[known]))
    for i in np.flatnonzero(gap):
        change[known[i] : known[i + 1]] = moved[i]
    return change


def _between(time: np.ndarray, value: np.ndarray) -> np.ndarray:
    known = np.isfinite(value)
    if not known.any():
        return np.full(time.size, np.nan)
    return np.asarray(np.interp(time, time[known], value[known]))

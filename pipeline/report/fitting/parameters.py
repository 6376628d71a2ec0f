"""The corrections that can be fitted: what each changes in the theory, and how well it was known before.

A correction changes one of `model.tangent.BASICS` – or the vertical velocity of the water, or a pitching moment – by
its value times a weight of each block: one for a coefficient, days for a drift, the force per compressibility for
compressibility. A new one is a line of `CORRECTIONS`; its slopes follow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import numpy as np

from pipeline.model.exchange import HULL_TIME_BEFORE, HULL_TIME_STD, fairing_of
from pipeline.model.forces import GRAVITY, relative_thrust_std
from pipeline.model.steady import trim_at_pitch
from pipeline.report.fitting.points import Array, Points
from pipeline.vehicle import Vehicle

#: What a correction may change beside `tangent.BASICS`.
WATER, MOMENT = "water", "moment"
#: 1-sigma of the relative change of thrust per relative change of voltage. It lies between 0, a propeller whose speed
#: or power is rightly logged, and about 2, one at a fixed share of the voltage of which the nominal speed is logged: a
#: motor turns about as fast as its voltage, and thrust goes with the square (Healey et al. 1995,
#: doi:10.1109/48.468252).
VOLTAGE_STD = 1.0
#: Least difference of voltage between powered blocks, as a share: below it thrust changes by 2 % at most.
VOLTAGE_SWING = 0.01
#: Between the name of a correction and the configuration it holds in.
AT = "@"


class Correction(NamedTuple):
    """A correction: symbol, unit, what it means to a reader, what it changes, and by how much at each block."""

    symbol: str
    unit: str
    meaning: str
    changes: str
    weight: Callable[[Points], Array]
    size: float  # a change of ordinary size, for scaling where no prior gives one


def _one(points: Points) -> Array:
    return np.ones(points.size)


CORRECTIONS: dict[str, Correction] = {
    "parasite_drag": Correction(
        "ΔK_D0", "kg/m", "drag at zero angle of attack, as of sensors on the hull", "parasite_drag", _one, 1.0
    ),
    "net_buoyancy": Correction("ΔG", "N", "constant part of net buoyancy, ballast", "net_buoyancy", _one, 1.0),
    "lift_at_zero": Correction("ΔK_L0", "kg/m", "lift at zero angle of attack", "lift_at_zero", _one, 1.0),
    "lift_slope": Correction("ΔK_L", "kg/m/rad", "lift per angle of attack", "lift_slope", _one, 100.0),
    "induced_drag": Correction("ΔK_D", "kg/m/rad2", "drag per squared angle of attack", "induced_drag", _one, 100.0),
    "thrust_scale": Correction("Δscale_T", "1", "thrust, relative", "thrust", _one, 0.1),
    "thrust_by_voltage": Correction(
        "b_U",
        "1",
        "thrust per battery voltage, each relative to its mean under propeller",
        "thrust",
        lambda p: p.relative_voltage,
        1.0,
    ),
    "pitch": Correction("Δθ", "rad", "pitch bias", "pitch", _one, 0.01),
    "compressibility": Correction(
        "Δε", "1/Pa", "compressibility of the hull", "net_buoyancy", lambda p: p.by_compression, 1e-10
    ),
    "thermal_expansion": Correction(
        "Δα_T", "1/K", "thermal expansion of the hull", "net_buoyancy", lambda p: p.by_expansion, 1e-5
    ),
    "hull_time": Correction(
        "τ_h",
        "s",
        "time in which the hull takes on the water's temperature",
        "net_buoyancy",
        lambda p: p.by_lag,
        100.0,
    ),
    "carried_water": Correction(
        "Δφ_c",
        "1",
        "water that the fairing carries along, of the hull's volume",
        "net_buoyancy",
        lambda p: p.by_carried,
        0.1,
    ),
    "flushing_time": Correction(
        "Δτ_c", "s", "time in which that water is renewed", "net_buoyancy", lambda p: p.by_flushing, 100.0
    ),
    "drag_drift": Correction(
        "dK_D0/dt", "kg/m/day", "drag that grows in time, biofouling", "parasite_drag", lambda p: p.days, 0.1
    ),
    "water": Correction("w_w", "m/s", "mean vertical velocity of the water, up", WATER, _one, 0.01),
    "mass": Correction("Δm", "kg", "mass of the vehicle", "net_buoyancy", lambda p: np.full(p.size, -GRAVITY), 0.1),
    "volume": Correction(
        "Δv", "m3", "volume of the hull at the surface", "net_buoyancy", lambda p: GRAVITY * p.density, 1e-4
    ),
    "moment_at_zero": Correction("ΔK_M0", "kg", "pitching moment at zero angle of attack", MOMENT, _one, 0.1),
    "moment_slope": Correction("ΔK_M", "kg/rad", "pitching moment per angle of attack", MOMENT, _one, 50.0),
    "righting_moment": Correction("ΔM_s", "N m/rad", "righting moment of the vehicle", MOMENT, _one, 1.0),
    "battery_neutral_position": Correction("Δr_P0", "m", "battery position without moment", MOMENT, _one, 1e-3),
}
#: Corrections that are a change of a coefficient of the vehicle file, whose 1-sigma is their prior.
COEFFICIENTS = (
    "parasite_drag",
    "lift_at_zero",
    "lift_slope",
    "induced_drag",
    "compressibility",
    "thermal_expansion",
    "carried_water",
    "flushing_time",
    "moment_at_zero",
    "moment_slope",
    "righting_moment",
    "battery_neutral_position",
)
#: Corrections of what is never negative, and what each is added to where that is no coefficient of the vehicle file.
NEVER_NEGATIVE = {
    "parasite_drag": math.nan,
    "lift_slope": math.nan,
    "induced_drag": math.nan,
    "carried_water": math.nan,
    "flushing_time": math.nan,
    "hull_time": 0.0,
    "thrust_scale": 1.0,
}
#: Corrections of lift: depth rate alone does not tell them from drag (see `selection`).
LIFT = ("lift_slope", "lift_at_zero", "induced_drag")
#: Corrections that the moment balance alone feels.
MOMENTS = tuple(name for name, item in CORRECTIONS.items() if item.changes == MOMENT)
#: Corrections with a prior that are not borrowed where they are not fitted: the log of a propeller is taken at its word
#: until the data gainsay it. About the mean voltage their effect averages out of all that is constant.
UNSTATED = ("thrust_by_voltage",)
#: Names of one and the same: constant net buoyancy.
BALLAST = ("net_buoyancy", "mass", "volume")


def correction(name: str) -> Correction:
    """Return the correction `name`; ``parasite_drag@NAME`` is the drag of configuration NAME beside the first.

    Raises
    ------
    KeyError
        If there is no such correction.
    """
    kind, at, configuration = name.partition(AT)
    if not at:
        return CORRECTIONS[name]
    base = CORRECTIONS[kind]

    def carried(points: Points) -> Array:
        if configuration not in points.configurations:
            return np.zeros(points.size)
        inside = points.configuration == points.configurations.index(configuration)
        return np.where(inside, base.weight(points), 0.0)

    return base._replace(
        symbol=f"{base.symbol}({configuration})",
        meaning=f"{base.meaning}: '{configuration}' beside the first configuration",
        weight=carried,
    )


def of_configurations(points: Points) -> tuple[str, ...]:
    """Return the drag corrections of every configuration but the first that has blocks."""
    flown = [number for number in range(1, len(points.configurations)) if (points.configuration == number).any()]
    return tuple(f"parasite_drag{AT}{points.configurations[number]}" for number in flown)


def prior_stds(vehicle: Vehicle, points: Points, ballast_std: float, pitch_std: float) -> dict[str, float]:
    """Return the prior 1-sigma of every correction of the forces that these blocks feel; NaN where none is known.

    Parameters
    ----------
    vehicle
        Gives those of its coefficients.
    points
        Blocks; what leaves all of them alone is not in the result.
    ballast_std, pitch_std
        1-sigma of the constant part of net buoyancy, N, and of the pitch bias, rad.
    """
    out = {name: vehicle.std(name) for name in COEFFICIENTS if name not in MOMENTS}
    fairing = fairing_of(vehicle)
    out |= {"carried_water": fairing.share_std, "flushing_time": fairing.time_std}
    for name, felt in (
        ("compressibility", points.by_compression),
        ("thermal_expansion", points.by_expansion),
        ("carried_water", fairing.share_std * points.by_carried),
        ("flushing_time", points.by_flushing),
    ):
        if not np.any(felt):
            del out[name]
    if np.any(points.by_lag):
        out["hull_time"] = math.hypot(HULL_TIME_BEFORE, HULL_TIME_STD)  # blocks have a hull as warm as the water
    driven = points.only((points.propeller_speed != 0.0) | (points.propeller_power != 0.0))
    if driven.size:
        trim = trim_at_pitch(
            vehicle, driven.net_buoyancy, driven.pitch,
            propeller_speed=driven.propeller_speed, propeller_power=driven.propeller_power, density=driven.density,
        )  # fmt: skip
        std = relative_thrust_std(vehicle, driven.density, driven.propeller_speed, driven.propeller_power, trim.speed)
        known = std[np.isfinite(std)]
        if known.size:
            out["thrust_scale"] = float(np.median(known))
            if np.ptp(driven.relative_voltage) >= VOLTAGE_SWING:
                out["thrust_by_voltage"] = VOLTAGE_STD
    return out | {"net_buoyancy": ballast_std, "pitch": pitch_std}


def borrowed(priors: Mapping[str, float], free: Iterable[str]) -> tuple[str, ...]:
    """Return what is not fitted and not exactly known either: those of `priors` held by their 1-sigma."""
    chosen = {*free, *UNSTATED}
    same = set(BALLAST) if chosen & set(BALLAST) else set()
    return tuple(name for name, std in priors.items() if std > 0.0 and name not in chosen | same)

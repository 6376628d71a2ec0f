"""Steady flight at a held pitch where every point has its own coefficients, with its slopes in each of them.

With γ = θ − α the balances along and across the path (see `balance`) leave two unknowns, V and α; their slopes follow
from the implicit function theorem in closed form.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.model.balance import ALPHA_LIMIT, HELD_PITCH, largest_speed_driven
from pipeline.model.forces import disk_thrust
from pipeline.vehicle import Disk, Polar, Propeller

#: What each point has of its own, in the order of the columns of `basics`.
BASICS = (
    "parasite_drag",  # K_D0, kg/m
    "lift_at_zero",  # K_L0, kg/m
    "lift_slope",  # K_L, kg/m/rad
    "induced_drag",  # K_D, kg/m/rad2
    "thrust",  # factor on thrust
    "net_buoyancy",  # G, N, up positive
    "pitch",  # θ, rad
)


@njit(cache=True, error_model="numpy", nogil=True)
def fly(
    basics: NDArray[np.float64],
    exponent: float,
    propeller: Propeller,
    disk: Disk,
    ratio: NDArray[np.float64],
    density: NDArray[np.float64],
    propeller_speed: NDArray[np.float64],
    propeller_power: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return V [m/s] and α [rad] of shape (n,), and their slopes in `BASICS`, shape (n, 7); NaN where none balances.

    Parameters
    ----------
    basics
        Values of `BASICS` at each point, shape (n, 7).
    exponent
        Exponent of the speed in the parasite drag, beside 2.
    propeller, disk
        Thrust laws at a factor of one; `forces.NO_PROPELLER` and `forces.NO_DISK` for a vehicle without one.
    ratio
        In-situ density over the reference density, shape (n,).
    density
        In-situ density, kg/m³, shape (n,).
    propeller_speed
        Propeller speed, rev/s, 0 where thrust does not follow from it, shape (n,).
    propeller_power
        Propeller power, W, 0 where thrust does not follow from it, shape (n,).
    """
    count = basics.shape[0]
    speed, attack = np.full(count, np.nan), np.full(count, np.nan)
    speed_by, attack_by = np.full((count, 7), np.nan), np.full((count, 7), np.nan)
    for i in range(count):
        parasite, lift_0, lift_1, induced, factor, force, pitch = basics[i]
        n, r, power = propeller_speed[i], ratio[i], propeller_power[i]
        flow = density[i] * propeller.diameter**3 * n
        at_rest, pull = 0.0, 0.0
        if n != 0.0:
            at_rest, pull = flow * propeller.thrust_static * propeller.diameter * n, flow * propeller.thrust_slope
        moved = abs(force) + abs(factor * at_rest) + factor * power
        if not (parasite > 0.0 and lift_1 > 0.0 and moved > 0.0 and r > 0.0):
            continue
        if math.isnan(pitch) or math.isnan(pull) or math.isnan(at_rest):
            continue
        polar = Polar(lift_0, lift_1, parasite, induced, exponent)
        v, a, _, slope = largest_speed_driven(
            HELD_PITCH, pitch, polar, r, factor * at_rest, factor * pull, disk, density[i], power, factor, force, 1.0
        )
        if not (v > 0.0 and abs(a) <= ALPHA_LIMIT):
            continue
        by_power, _ = disk_thrust(disk, density[i], power, v)
        turned = at_rest + pull * v + by_power
        push = factor * turned
        sin_a, cos_a = math.sin(a), math.cos(a)
        sin_g, cos_g = math.sin(pitch - a), math.cos(pitch - a)
        braked = v ** (2.0 + exponent) if exponent != 0.0 else v * v
        along_v = r * ((2.0 + exponent) * parasite * braked / v + 2.0 * induced * a * a * v) - slope * cos_a
        along_a = 2.0 * r * induced * a * v * v + push * sin_a + force * cos_g
        across_v = 2.0 * r * (lift_0 + lift_1 * a) * v + slope * sin_a
        across_a = r * lift_1 * v * v + push * cos_a + force * sin_g
        determinant = along_v * across_a - along_a * across_v
        if determinant == 0.0:
            continue
        speed[i], attack[i] = v, a
        along = (r * braked, 0.0, 0.0, r * a * a * v * v, -turned * cos_a, -sin_g, -force * cos_g)
        across = (0.0, r * v * v, r * a * v * v, 0.0, turned * sin_a, cos_g, -force * sin_g)
        for k in range(7):
            speed_by[i, k] = (along_a * across[k] - across_a * along[k]) / determinant
            attack_by[i, k] = (across_v * along[k] - along_v * across[k]) / determinant
    return speed, attack, speed_by, attack_by

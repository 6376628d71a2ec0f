"""Compiled search for the pitch at which forces and pitching moments balance; `steady` is its public face.

Eqs. (4) and (7) of Niu et al. (2017), doi:10.1007/s13344-017-0061-y, in physical signs.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.model.balance import ALPHA_LIMIT, HELD_PITCH, largest_speed_driven
from pipeline.vehicle import Disk, Polar


@njit(cache=True, error_model="numpy")
def moment_left(
    pitch: float,
    polar: Polar,
    ratio: float,
    push: float,
    pull: float,
    disk: Disk,
    density: float,
    power: float,
    net_buoyancy: float,
    moment_at_zero: float,
    moment_slope: float,
    munk_mass: float,
    moment_cos: float,
    moment_sin: float,
) -> float:
    """Return the pitching moment left at a held pitch, N m, nose up positive; NaN where the forces do not balance.

    r (K_M0 + K_M α) V² + (m_3 - m_1) V² sin α cos α + M_c cos θ + M_s sin θ, Eqs. (4) and (7).
    """
    speed, alpha, _, _ = largest_speed_driven(
        HELD_PITCH, pitch, polar, ratio, push, pull, disk, density, power, 1.0, net_buoyancy, 1.0
    )
    if not abs(alpha) <= ALPHA_LIMIT:
        return math.nan
    flow = ratio * (moment_at_zero + moment_slope * alpha) + munk_mass * math.sin(alpha) * math.cos(alpha)
    return flow * speed * speed + moment_cos * math.cos(pitch) + moment_sin * math.sin(pitch)


@njit(cache=True, error_model="numpy")
def pitches_at_moment(
    limit: float,
    most: int,
    polar: Polar,
    ratio: float,
    push: float,
    pull: float,
    disk: Disk,
    density: float,
    power: float,
    net_buoyancy: float,
    moment_at_zero: float,
    moment_slope: float,
    munk_mass: float,
    moment_cos: float,
    moment_sin: float,
) -> NDArray[np.float64]:
    """Return the pitch angles within ±`limit` at which forces and moments balance, rad, shape (most,), NaN-padded.

    Other parameters as for `moment_left`.
    """
    found = np.full(most, np.nan)
    count = 0
    steps = 2 * math.ceil(limit / math.radians(1.0))
    low, low_value = math.nan, math.nan
    scale = 0.0
    for step in range(steps + 1):
        high = -limit + 2.0 * limit * step / steps
        high_value = moment_left(
            high, polar, ratio, push, pull, disk, density, power, net_buoyancy,
            moment_at_zero, moment_slope, munk_mass, moment_cos, moment_sin,
        )  # fmt: skip
        a, at_a, b, at_b = low, low_value, high, high_value
        if step > 0 and math.isnan(at_a) != math.isnan(at_b):
            inside, outside = (b, a) if math.isnan(at_a) else (a, b)
            edge_value = math.nan
            for _ in range(45):
                middle = 0.5 * (inside + outside)
                value = moment_left(
                    middle, polar, ratio, push, pull, disk, density, power, net_buoyancy,
                    moment_at_zero, moment_slope, munk_mass, moment_cos, moment_sin,
                )  # fmt: skip
                if math.isnan(value):
                    outside = middle
                else:
                    inside, edge_value = middle, value
            if math.isnan(at_a):
                a, at_a = inside, edge_value
            else:
                b, at_b = inside, edge_value
        scale = max(scale, 0.0 if math.isnan(at_a) else abs(at_a), 0.0 if math.isnan(at_b) else abs(at_b))
        if (at_a <= 0.0 < at_b or at_b <= 0.0 < at_a) and count < most:
            middle, value = a, at_a
            for _ in range(60):
                middle = 0.5 * (a + b)
                value = moment_left(
                    middle, polar, ratio, push, pull, disk, density, power, net_buoyancy,
                    moment_at_zero, moment_slope, munk_mass, moment_cos, moment_sin,
                )  # fmt: skip
                if math.isnan(value) or middle in (a, b):
                    break
                if (value <= 0.0) == (at_a <= 0.0):
                    a, at_a = middle, value
                else:
                    b = middle
            if abs(value) <= 1e-6 * scale:
                found[count] = middle
                count += 1
        low, low_value = high, high_value
    return found

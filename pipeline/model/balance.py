"""Compiled solvers of the steady force balance; `steady` is their public face.

Without pitch rate and acceleration, with the density ratio r and thrust T = a + b V (by power, T's tangent):

    G sin γ = r D(V, α) - T cos α,    G cos γ = -(r L(V, α) + s T sin α)

s = +1 in physical signs, -1 as printed in Eqs. (21) and (22) of Niu et al. (2017), doi:10.1007/s13344-017-0061-y.
Every solver looks for the largest speed that balances. All roots lie below the speed at which parasite drag alone
takes up buoyancy and thrust together, so it comes down from there to the first change of sign, and into every dip
on the way. At a held pitch the largest speed is the root nearest the angle of attack without normal force; Newton's
method finds it in a few steps, and the search from above is left for where that cannot be trusted.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.model.descent import ALPHA_LIMIT as ALPHA_LIMIT
from pipeline.model.descent import SEARCH_LIMIT, descend, out_of_reach
from pipeline.model.forces import disk_thrust, drag, lift
from pipeline.vehicle import Disk, Polar

FIXED_ALPHA = 0
HELD_PITCH = 1

_STEPS = 48
_TANGENTS = 30
_GOLDEN = 0.3819660112501051


@njit(cache=True, error_model="numpy")
def attack_for_normal_force(polar: Polar, speed: float, normal: float) -> float:
    """Return α at which the normal-force coefficient K_De sin α + K_Le cos α is `normal`, kg/m, by Newton.

    The coefficient grows with α for |α| < 0.6 rad; NaN where α would be larger than 0.5 rad, where Newton's method
    may wander without end.
    """
    parasite = polar.parasite_drag
    if polar.drag_exponent != 0.0:
        parasite = parasite * speed**polar.drag_exponent
    alpha = (normal - polar.lift_at_zero) / (polar.lift_slope + parasite)
    if math.isnan(alpha):
        return math.nan
    alpha = min(max(alpha, -0.6), 0.6)
    change = math.inf
    for _ in range(30):
        cosine = math.cos(alpha)
        sine = math.sin(alpha)
        braking = parasite + polar.induced_drag * alpha * alpha
        lifting = polar.lift_at_zero + polar.lift_slope * alpha
        slope = (braking + polar.lift_slope) * cosine + (2.0 * polar.induced_drag * alpha - lifting) * sine
        change = (braking * sine + lifting * cosine - normal) / slope
        alpha -= change
        if abs(change) <= 1e-16 + 1e-15 * abs(alpha):
            break
    return alpha if abs(alpha) <= SEARCH_LIMIT and abs(change) <= 1e-12 else math.nan


@njit(cache=True, error_model="numpy")
def residual(
    mode: int,
    speed: float,
    held: float,
    polar: Polar,
    ratio: float,
    push: float,
    pull: float,
    net_buoyancy: float,
    sign: float,
) -> tuple[float, float]:
    """Return what is left of the force balance at `speed`, positive at high speed, and the angle of attack.

    Held angle of attack: |aerodynamic force + thrust|² - G², N². Held pitch (physical signs): α from the balance
    normal to the body, then the balance along it, N; NaN where α leaves the range of search.

    Parameters
    ----------
    mode
        `FIXED_ALPHA` or `HELD_PITCH`.
    speed
        Trial speed V, m/s.
    held
        The angle held: α or θ, rad.
    polar
        Lift and drag.
    ratio
        In-situ density over reference density.
    push, pull
        Thrust at rest a, N, and its slope b, N s/m.
    net_buoyancy
        G, N, up positive.
    sign
        s: +1 physical, -1 as printed.
    """
    thrust = push + pull * speed
    if mode == FIXED_ALPHA:
        along = ratio * drag(polar, speed, held) - thrust * math.cos(held)
        across = ratio * lift(polar, speed, held) + sign * thrust * math.sin(held)
        return along * along + across * across - net_buoyancy * net_buoyancy, held
    normal = -net_buoyancy * math.cos(held) / (ratio * speed * speed)
    alpha = attack_for_normal_force(polar, speed, normal)
    axial = drag(polar, speed, alpha) * math.cos(alpha) - lift(polar, speed, alpha) * math.sin(alpha)
    return ratio * axial - thrust - net_buoyancy * math.sin(held), alpha


@njit(cache=True, error_model="numpy")
def ceiling(polar: Polar, ratio: float, force: float, pull: float) -> float:
    """Return the speed, m/s, above which parasite drag exceeds `force` + |pull| V, N."""
    steep = abs(pull)
    coefficient = ratio * polar.parasite_drag
    if polar.drag_exponent == 0.0:
        return (steep + math.sqrt(steep * steep + 4.0 * coefficient * force)) / (2.0 * coefficient)
    power = 2.0 + polar.drag_exponent
    speed = 1.0
    while coefficient * speed**power < force + steep * speed:
        speed *= 2.0
    for _ in range(60):
        excess = coefficient * speed**power - steep * speed - force
        change = excess / (power * coefficient * speed ** (power - 1.0) - steep)
        speed -= change
        if abs(change) <= 1e-9 * speed:
            break
    return speed


@njit(cache=True, error_model="numpy")
def largest_speed(
    mode: int,
    held: float,
    polar: Polar,
    ratio: float,
    push: float,
    pull: float,
    net_buoyancy: float,
    sign: float,
) -> tuple[float, float]:
    """Return the largest speed in balance, m/s, and its angle of attack, rad; NaN where there is none.

    Parameters as for `residual`.
    """
    top = ceiling(polar, ratio, abs(net_buoyancy) + abs(push), pull) * (1.0 + 1e-6)
    if mode == HELD_PITCH:
        axial, normal = net_buoyancy * math.sin(held), net_buoyancy * math.cos(held)
        if out_of_reach(polar, push, pull, axial, normal, top):
            return math.nan, math.nan
        speed, alpha = descend(polar, ratio, push, pull, axial, normal, top)
        if speed > 0.0:
            return speed, alpha
    before, upper = math.nan, top
    upper_value, _ = residual(mode, top, held, polar, ratio, push, pull, net_buoyancy, sign)
    before_value = math.nan
    for step in range(1, _STEPS + 1):
        speed = top * (1.0 - step / _STEPS) if step < _STEPS else 1e-4 * top
        value, _ = residual(mode, speed, held, polar, ratio, push, pull, net_buoyancy, sign)
        last = math.isnan(value)
        if last:
            inside, outside = upper, speed
            for _ in range(50):
                middle = 0.5 * (inside + outside)
                middle_value, _ = residual(mode, middle, held, polar, ratio, push, pull, net_buoyancy, sign)
                if math.isnan(middle_value):
                    outside = middle
                else:
                    inside, value = middle, middle_value
            speed = inside
            if math.isnan(value):
                break
        lower, lower_value = speed, value
        if value > 0.0 and upper_value < before_value and upper_value < value:
            lower, lower_value = _dip(mode, speed, before, held, polar, ratio, push, pull, net_buoyancy, sign)
            if lower_value <= 0.0:
                upper, upper_value = before, before_value
        if lower_value <= 0.0:
            return _between(
                mode, lower, lower_value, upper, upper_value, held, polar, ratio, push, pull, net_buoyancy, sign
            )
        if last:
            break
        before, before_value, upper, upper_value = upper, upper_value, speed, value
    return math.nan, math.nan


@njit(cache=True, error_model="numpy")
def largest_speed_driven(
    mode: int,
    held: float,
    polar: Polar,
    ratio: float,
    push: float,
    pull: float,
    disk: Disk,
    density: float,
    power: float,
    factor: float,
    net_buoyancy: float,
    sign: float,
) -> tuple[float, float, float, float]:
    """Return the largest speed in balance and α, and thrust at rest and its slope by the straight line that touches it.

    Thrust by power bends, T''(V) > 0: it lies above every line that touches it, so that with the line at one speed
    the next is found from below, as by Newton's method. The first line is that at a speed above all roots.

    Parameters
    ----------
    disk, density, power, factor
        Thrust by power, and the factor on it; added to `push` + `pull` V, which hold the factor already.
    mode, held, polar, ratio, push, pull, net_buoyancy, sign
        As for `residual`.
    """
    if not power > 0.0:
        speed, alpha = largest_speed(mode, held, polar, ratio, push, pull, net_buoyancy, sign)
        return speed, alpha, push, pull
    at_rest, _ = disk_thrust(disk, density, power, 0.0)
    most = push + factor * at_rest
    top = ceiling(polar, ratio, abs(net_buoyancy) + abs(most), pull)
    here, slope = disk_thrust(disk, density, power, top)
    line_push, line_pull = push + factor * (here - slope * top), pull + factor * slope
    speed, alpha = largest_speed(mode, held, polar, ratio, line_push, line_pull, net_buoyancy, sign)
    if math.isnan(speed):  # the least thrust may be too little, and the most too much
        speed, alpha = largest_speed(mode, held, polar, ratio, most, pull, net_buoyancy, sign)
    for _ in range(_TANGENTS):
        if math.isnan(speed):
            break
        before = speed
        here, slope = disk_thrust(disk, density, power, speed)
        line_push, line_pull = push + factor * (here - slope * speed), pull + factor * slope
        speed, alpha = largest_speed(mode, held, polar, ratio, line_push, line_pull, net_buoyancy, sign)
        if abs(speed - before) <= 1e-9 * speed:
            break
    return speed, alpha, line_push, line_pull


@njit(cache=True, error_model="numpy")
def _dip(
    mode: int,
    low: float,
    high: float,
    held: float,
    polar: Polar,
    ratio: float,
    push: float,
    pull: float,
    net_buoyancy: float,
    sign: float,
) -> tuple[float, float]:
    """Return where the residual is least between two speeds, and its value, by golden section."""
    a, b = low, high
    c, d = a + _GOLDEN * (b - a), b - _GOLDEN * (b - a)
    at_c, _ = residual(mode, c, held, polar, ratio, push, pull, net_buoyancy, sign)
    at_d, _ = residual(mode, d, held, polar, ratio, push, pull, net_buoyancy, sign)
    for _ in range(45):
        if at_c < at_d:
            b, d, at_d = d, c, at_c
            c = a + _GOLDEN * (b - a)
            at_c, _ = residual(mode, c, held, polar, ratio, push, pull, net_buoyancy, sign)
        else:
            a, c, at_c = c, d, at_d
            d = b - _GOLDEN * (b - a)
            at_d, _ = residual(mode, d, held, polar, ratio, push, pull, net_buoyancy, sign)
        if min(at_c, at_d) < 0.0:
            break
    return (c, at_c) if at_c < at_d else (d, at_d)


@njit(cache=True, error_model="numpy")
def _between(
    mode: int,
    low: float,
    low_value: float,
    high: float,
    high_value: float,
    held: float,
    polar: Polar,
    ratio: float,
    push: float,
    pull: float,
    net_buoyancy: float,
    sign: float,
) -> tuple[float, float]:
    """Return the speed between `low` (residual <= 0) and `high` (> 0) in balance, and α; Illinois' regula falsi."""
    speed, side = low, 0
    value, alpha = residual(mode, low, held, polar, ratio, push, pull, net_buoyancy, sign)
    for _ in range(100):
        if value == 0.0:
            break
        previous = speed
        speed = (low * high_value - high * low_value) / (high_value - low_value)
        if not low <= speed <= high:
            speed = 0.5 * (low + high)
        value, alpha = residual(mode, speed, held, polar, ratio, push, pull, net_buoyancy, sign)
        if value > 0.0:
            high, high_value = speed, value
            if side > 0:
                low_value *= 0.5
            side = 1
        else:
            low, low_value = speed, value
            if side < 0:
                high_value *= 0.5
            side = -1
        if abs(speed - previous) <= 2e-16 * speed or high - low <= 2e-16 * high:
            break
    return speed, alpha


@njit(cache=True, error_model="numpy")
def solve(
    mode: int,
    held: NDArray[np.float64],
    polar: Polar,
    ratio: NDArray[np.float64],
    push: NDArray[np.float64],
    pull: NDArray[np.float64],
    disk: Disk,
    density: NDArray[np.float64],
    power: NDArray[np.float64],
    net_buoyancy: NDArray[np.float64],
    sign: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return speed [m/s], path angle, angle of attack [rad] and thrust [N], shape (n,); NaN where nothing balances.

    Array arguments have shape (n,) and are finite or NaN; meanings as for `residual` and `largest_speed_driven`.
    """
    count = held.size
    speed = np.full(count, np.nan)
    thrust = np.full(count, np.nan)
    path_angle = np.full(count, np.nan)
    alpha = np.full(count, np.nan)
    for i in range(count):
        size = abs(net_buoyancy[i]) + abs(push[i]) + power[i]
        if not (size > 0.0 and ratio[i] > 0.0) or math.isnan(held[i]) or math.isnan(pull[i]):
            continue
        if mode == FIXED_ALPHA and net_buoyancy[i] == 0.0:
            continue
        v, a, at_rest, slope = largest_speed_driven(
            mode, held[i], polar, ratio[i], push[i], pull[i], disk, density[i], power[i], 1.0, net_buoyancy[i], sign
        )
        if not (v > 0.0 and (mode == FIXED_ALPHA or abs(a) <= ALPHA_LIMIT)):
            continue
        speed[i], alpha[i], thrust[i] = v, a, at_rest + slope * v
        if mode == HELD_PITCH:
            path_angle[i] = held[i] - a
        else:
            up = math.copysign(1.0, net_buoyancy[i])
            along = ratio[i] * drag(polar, v, a) - thrust[i] * math.cos(a)
            across = ratio[i] * lift(polar, v, a) + sign * thrust[i] * math.sin(a)
            path_angle[i] = math.atan2(up * along, -up * across)
    return speed, path_angle, alpha, thrust

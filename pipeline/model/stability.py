"""The stable range of steady flight by the inequalities (23)-(28) of Niu et al. (2017).

With d = K_D0 + K_D α², l = K_L0 + K_L α and u = T/V²: (23) and (26) K_D' = d - u cos α > 0; (24) B² - 4AC ≥ 0;
(25) -B + √(B² - 4AC) > 0; (27) V > √(T/K_D0); (28) T ≤ inf |G| √(d² + l²)/|d sin α + s l cos α| over
0 < |α| ≤ 0.2 rad, with s = +1 in physical signs and -1 as printed (the printed squares of d and l are misprints).
Source: doi:10.1007/s13344-017-0061-y. (27) is sufficient for (26), not necessary, and (26) excludes level flight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from pipeline.model.steady import Signs, steady_state
from pipeline.vehicle import Vehicle

Array = NDArray[np.float64]

#: Largest angle of attack in the infimum of (28), rad.
LARGEST_ALPHA = 0.2
_POINTS = 400
_GOLDEN = 0.3819660112501051


@dataclass(frozen=True)
class StableRange:
    """Stable range and verdicts; arrays of one shape. A positive margin is a verdict of true, NaN one of false.

    Attributes
    ----------
    speed
        V_e at the given thrust, m/s.
    speed_lower, speed_upper
        Bounds of V, m/s: (27), and the speed at the largest thrust that (28) allows.
    thrust_bound, bound_angle
        Right-hand side of (28), N, and the angle of attack of the infimum, rad.
    drag_margin
        K_D' of (23) and (26), kg/m.
    discriminant
        B² - 4AC of (24).
    root_margin
        -B + √(B² - 4AC) of (25).
    speed_margin
        V_e less its lower bound (27), m/s.
    thrust_margin
        Thrust bound (28) less the thrust, N.
    drag_holds, discriminant_holds, root_holds, speed_holds, thrust_holds
        Verdicts on (23) and (26), (24), (25), (27), (28).
    stable
        Whether all of them hold.
    reason
        Why there is no speed, "" where there is.
    """

    speed: Array
    speed_lower: Array
    speed_upper: Array
    thrust_bound: Array
    bound_angle: Array
    drag_margin: Array
    discriminant: Array
    root_margin: Array
    speed_margin: Array
    thrust_margin: Array
    drag_holds: NDArray[np.bool_]
    discriminant_holds: NDArray[np.bool_]
    root_holds: NDArray[np.bool_]
    speed_holds: NDArray[np.bool_]
    thrust_holds: NDArray[np.bool_]
    stable: NDArray[np.bool_]
    reason: NDArray[Any]


def stable_range(
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    angle_of_attack: ArrayLike,
    thrust: ArrayLike,
    *,
    density: ArrayLike | None = None,
    signs: Signs = "physical",
) -> StableRange:
    """Return the stable range of steady flight at a held angle of attack and constant thrust, Eqs. (23)-(28).

    Where parasite drag has a speed exponent, d is taken at the steady speed.

    Parameters
    ----------
    vehicle
        Vehicle with a known polar.
    net_buoyancy
        G, N, up positive.
    angle_of_attack
        α, rad.
    thrust
        T, N.
    density
        In-situ density, kg/m³; the vehicle's reference density if left out.
    signs
        ``physical`` or ``paper``; the paper's numbers need the latter.

    Raises
    ------
    ValueError
        As for `steady.steady_state`.
    """
    state = steady_state(vehicle, net_buoyancy, angle_of_attack, thrust=thrust, density=density, signs=signs)
    reference = vehicle["reference_density"]
    g, alpha, t, rho = np.broadcast_arrays(
        np.asarray(net_buoyancy, dtype=np.float64),
        np.asarray(angle_of_attack, dtype=np.float64),
        np.asarray(thrust, dtype=np.float64),
        np.asarray(reference if density is None else density, dtype=np.float64),
    )
    sign = 1.0 if signs == "physical" else -1.0
    polar = vehicle.polar
    ratio = rho / reference
    v = state.speed
    parasite = np.full(v.shape, polar.parasite_drag) * (v**polar.drag_exponent if polar.drag_exponent else 1.0)
    d = ratio * (parasite + polar.induced_drag * alpha**2)
    l = ratio * (polar.lift_at_zero + polar.lift_slope * alpha)  # noqa: E741 - the paper's letter
    a = d**2 + l**2
    b = -2.0 * t * (d * np.cos(alpha) - sign * l * np.sin(alpha))
    discriminant = b**2 - 4.0 * a * (t**2 - g**2)
    with np.errstate(invalid="ignore"):
        root_margin = -b + np.sqrt(discriminant)
    drag_margin = d - t / v**2 * np.cos(alpha)
    power = 1.0 / (2.0 + polar.drag_exponent)
    speed_lower = (np.maximum(t, 0.0) / (ratio * polar.parasite_drag)) ** power

    distinct, where = np.unique(parasite, return_inverse=True)
    found = [thrust_bound(float(k), polar.induced_drag, polar.lift_at_zero, polar.lift_slope, sign) for k in distinct]
    bounds = np.array(found, dtype=np.float64).reshape(-1, 2)
    per_newton, angle = (bounds[where.reshape(v.shape), k] for k in (0, 1))
    bound = np.abs(g) * per_newton
    fastest = steady_state(vehicle, g, alpha, thrust=bound, density=density, signs=signs)

    holds = {
        "drag_holds": drag_margin > 0.0,
        "discriminant_holds": discriminant >= 0.0,
        "root_holds": root_margin > 0.0,
        "speed_holds": v > speed_lower,
        "thrust_holds": t <= bound,
    }
    return StableRange(
        speed=v,
        speed_lower=speed_lower,
        speed_upper=fastest.speed,
        thrust_bound=bound,
        bound_angle=angle,
        drag_margin=drag_margin,
        discriminant=discriminant,
        root_margin=root_margin,
        speed_margin=v - speed_lower,
        thrust_margin=bound - t,
        **holds,
        stable=np.asarray(np.logical_and.reduce(list(holds.values()))),
        reason=state.reason,
    )


@njit(cache=True, error_model="numpy")
def _bound_at(alpha: float, parasite: float, induced: float, lift_at_zero: float, slope: float, sign: float) -> float:
    d = parasite + induced * alpha * alpha
    l = lift_at_zero + slope * alpha  # noqa: E741 - the paper's letter
    return math.sqrt(d * d + l * l) / abs(d * math.sin(alpha) + sign * l * math.cos(alpha))


@njit(cache=True, error_model="numpy")
def thrust_bound(
    parasite: float, induced: float, lift_at_zero: float, slope: float, sign: float
) -> tuple[float, float]:
    """Return the infimum of (28) per newton of net buoyancy and its angle of attack, rad.

    Parameters
    ----------
    parasite, induced, lift_at_zero, slope
        K_D0 [kg/m], K_D [kg/m/rad²], K_L0 [kg/m], K_L [kg/m/rad].
    sign
        s: +1 physical, -1 as printed.
    """
    if math.isnan(parasite + induced + lift_at_zero + slope):
        return math.nan, math.nan
    least, at = math.inf, math.nan
    for side in (-1.0, 1.0):
        for step in range(1, _POINTS + 1):
            alpha = side * LARGEST_ALPHA * step / _POINTS
            value = _bound_at(alpha, parasite, induced, lift_at_zero, slope, sign)
            if value < least:
                least, at = value, alpha
    width = LARGEST_ALPHA / _POINTS
    a, b = max(-LARGEST_ALPHA, at - width), min(LARGEST_ALPHA, at + width)
    for _ in range(60):
        c, e = a + _GOLDEN * (b - a), b - _GOLDEN * (b - a)
        at_c = _bound_at(c, parasite, induced, lift_at_zero, slope, sign)
        at_e = _bound_at(e, parasite, induced, lift_at_zero, slope, sign)
        if at_c < least:
            least, at = at_c, c
        if at_e < least:
            least, at = at_e, e
        if at_c < at_e:
            b = e
        else:
            a = c
    return least, at

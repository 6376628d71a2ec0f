"""Compiled Newton's method for the largest speed at a held pitch, and a bound that tells where there is none.

The quick way of `balance`, which searches where this leaves the answer open. Steady flight of Niu et al. (2017),
doi:10.1007/s13344-017-0061-y, in physical signs, for thrust a + b V.
"""

from __future__ import annotations

import math

from numba import njit

from pipeline.vehicle import Polar

#: Angle of attack beyond which a trim is not sought, rad; the search itself goes a little further.
ALPHA_LIMIT = 0.35
SEARCH_LIMIT = 0.5
_NEWTON_STEPS = 15
#: Speeds between Newton's answer and the ceiling at which the forces are looked at again.
_CHECKS = 3


@njit(cache=True, error_model="numpy")
def out_of_reach(polar: Polar, push: float, pull: float, axial: float, normal: float, top: float) -> bool:
    """Return whether no speed can balance a held pitch with |α| <= 0.35 rad, by bounds; False if they leave it open.

    In the notation of `descend`, for b <= 0 a balance needs r C_X V² <= a + G sin θ. Within the limit ℓ of α
    C_X >= K_De cos ℓ + min(0, K_D cos ℓ - K_L) ℓ² - |K_L0| ℓ with the least K_De, and r V² = |G cos θ|/|C_N| is the
    smaller the larger |C_N| <= (K_D0 + K_D ℓ²) sin ℓ + K_L ℓ + |K_L0|. Parameters as for `descend`.
    """
    pushed = push + axial
    if not pull <= 0.0 or polar.drag_exponent > 0.0 or (polar.drag_exponent != 0.0 and pushed > 0.0):
        return False
    parasite = polar.parasite_drag
    if polar.drag_exponent != 0.0:
        parasite *= top**polar.drag_exponent
    cosine, square = math.cos(ALPHA_LIMIT), ALPHA_LIMIT * ALPHA_LIMIT
    camber = abs(polar.lift_at_zero)
    bent = min(0.0, polar.induced_drag * cosine - polar.lift_slope) * square
    c_axial = parasite * cosine + bent - camber * ALPHA_LIMIT
    c_normal = (
        (parasite + polar.induced_drag * square) * math.sin(ALPHA_LIMIT) + polar.lift_slope * ALPHA_LIMIT + camber
    )
    return c_axial > 0.0 and c_axial * abs(normal) >= pushed * c_normal


@njit(cache=True, error_model="numpy")
def descend(
    polar: Polar, ratio: float, push: float, pull: float, axial: float, normal: float, top: float
) -> tuple[float, float]:
    """Return speed [m/s] and angle of attack [rad] at a held pitch by Newton's method from above; NaN if in doubt.

    With C_N = K_De sin α + K_Le cos α and C_X = K_De cos α - K_Le sin α the balances across and along the body are

        r C_N V² + G cos θ = 0,    r C_X V² - (a + b V) - G sin θ = 0

    Along the first, the second as a polynomial in 1/V has at most two positive roots for b <= 0 and small α, by the
    rule of signs; it rises with V at the faster one. Any other answer, and one above which the second is negative at
    any of a few speeds, is left to the search.

    Parameters
    ----------
    polar
        Lift and drag.
    ratio
        In-situ density over reference density r.
    push, pull
        Thrust at rest a, N, and its slope b, N s/m.
    axial, normal
        G sin θ and G cos θ, N.
    top
        Speed above which there is no root, m/s.
    """
    if not pull <= 0.0:
        return math.nan, math.nan
    speed, alpha = top, 0.0
    settled = False
    for _ in range(_NEWTON_STEPS):
        across, along, slope, lean, alpha_slope = _balance(polar, ratio, push, pull, axial, normal, speed, alpha)
        rise = slope[1] - lean * slope[0]
        if not rise > 0.0:
            return math.nan, math.nan
        faster = -(along - lean * across) / rise
        turned = -(across + slope[0] * faster) / alpha_slope
        speed += faster
        alpha += turned
        if not (speed > 0.0 and abs(alpha) <= SEARCH_LIMIT):
            return math.nan, math.nan
        if abs(faster) <= 1e-9 * speed and abs(turned) <= 1e-9:
            settled = True
            break
    if not settled:
        return math.nan, math.nan
    for k in range(1, _CHECKS + 1):
        faster = speed + (top - speed) * k / _CHECKS
        turned = alpha * (speed / faster) ** 2
        across, along, slope, lean, alpha_slope = _balance(polar, ratio, push, pull, axial, normal, faster, turned)
        if not along - lean * across > 0.0:
            return math.nan, math.nan
    return speed, alpha


@njit(cache=True, error_model="numpy")
def _balance(
    polar: Polar, ratio: float, push: float, pull: float, axial: float, normal: float, speed: float, alpha: float
) -> tuple[float, float, tuple[float, float], float, float]:
    """Return the balances of `descend` across and along the body, N, their slopes with speed, and two more.

    The fourth is the slope of the second with α over that of the first, the fifth that of the first with α, N/rad.
    """
    cosine, sine = math.cos(alpha), math.sin(alpha)
    parasite = polar.parasite_drag
    if polar.drag_exponent != 0.0:
        parasite *= speed**polar.drag_exponent
    braking = parasite + polar.induced_drag * alpha * alpha
    lifting = polar.lift_at_zero + polar.lift_slope * alpha
    c_normal = braking * sine + lifting * cosine
    c_axial = braking * cosine - lifting * sine
    growth = 2.0 * polar.induced_drag * alpha
    normal_slope = growth * sine + polar.lift_slope * cosine + c_axial
    axial_slope = growth * cosine - polar.lift_slope * sine - c_normal
    bent = polar.drag_exponent * parasite
    flow = ratio * speed
    slopes = (flow * (2.0 * c_normal + bent * sine), flow * (2.0 * c_axial + bent * cosine) - pull)
    return (
        flow * speed * c_normal + normal,
        flow * speed * c_axial - push - pull * speed - axial,
        slopes,
        axial_slope / normal_slope,
        flow * speed * normal_slope,
    )

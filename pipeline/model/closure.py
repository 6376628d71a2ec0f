"""The polar closure: the angle of attack of an unpowered steady glide at a given pitch.

In unpowered steady flight tan γ = −(K_D0 + K_D α²)/(K_L0 + K_L α) and γ = θ − α (Niu et al. 2017, Eq. 22,
doi:10.1007/s13344-017-0061-y; Merckelbach et al. 2010, doi:10.1175/2009JTECHO710.1), so that α follows from the
pitch and the *ratio* of drag to lift alone: a common factor on all coefficients, net buoyancy and thrust do not
enter.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.vehicle import Polar

#: The closure is used for glides steeper than this pitch (rad) only, whatever the polar.
LEAST_PITCH = 0.03
#: Within this of the pitch asked for (rad, times the square of the slope) a step of Newton's leaves 1e-14 rad to go.
CLOSE = 1e-7


@njit(cache=True, nogil=True)
def _slope_at(polar: Polar, drag_0: float, side: float, b: float) -> float:
    """Return the slope of the pitch in b of the glide whose α lies b from zero lift, on the `side` of a climb (1)."""
    alpha = -polar.lift_at_zero / polar.lift_slope - side * b
    drag = drag_0 + polar.induced_drag * alpha**2
    lift = polar.lift_slope * b
    bend = (-2.0 * polar.induced_drag * alpha * side * lift - drag * polar.lift_slope) / (drag**2 + lift**2)
    return side * (bend - 1.0)


@njit(cache=True, nogil=True)
def _pitch_at(polar: Polar, drag_0: float, side: float, b: float) -> float:
    """Return the pitch, rad, of that glide."""
    alpha = -polar.lift_at_zero / polar.lift_slope - side * b
    return side * math.atan2(drag_0 + polar.induced_drag * alpha**2, polar.lift_slope * b) + alpha


@njit(cache=True, nogil=True)
def _flattest(polar: Polar, drag_0: float, side: float) -> float:
    """Return b = |α − α_0| of the flattest glide that is described: the best glide, nose above (below) the horizon."""
    alpha_0 = -polar.lift_at_zero / polar.lift_slope
    b = math.sqrt((drag_0 + polar.induced_drag * alpha_0**2) / polar.induced_drag)
    while side * _pitch_at(polar, drag_0, side, b) < LEAST_PITCH:
        b *= 0.9
    return b


@njit(cache=True, nogil=True)
def _glide_lift(polar: Polar, drag_0: float, side: float, pitch: float, flattest: float, guess: float) -> float:
    """Return b = |α − α_0| of the glide at `pitch`, steeper than the flattest: there |θ| falls monotonically in b."""
    low, high = 0.0, flattest
    b = guess
    if not 0.0 < b < flattest:
        b = min(flattest, drag_0 / polar.lift_slope / max(math.tan(min(abs(pitch), 1.5)), 0.1))
    for _ in range(60):
        gap, slope = side * (_pitch_at(polar, drag_0, side, b) - pitch), _slope_at(polar, drag_0, side, b)
        if gap > 0.0:
            low = b
        else:
            high = b
        step = b - gap / (side * slope)
        if not low < step < high:
            step = 0.5 * (low + high)
        elif abs(gap) < CLOSE * min(1.0, slope * slope):
            return step
        if abs(step - b) < 1e-14:
            return step
        b = step
    return b


class Best(NamedTuple):
    """The flattest glides described: b = |α − α_0| and pitch [rad] of climb and dive, at one parasite drag."""

    up: float
    down: float
    up_pitch: float
    down_pitch: float


@njit(cache=True, nogil=True)
def best_glides(polar: Polar, drag_0: float) -> Best:
    """Return the flattest glides of a polar whose parasite drag is `drag_0` V², kg/m."""
    up, down = _flattest(polar, drag_0, 1.0), _flattest(polar, drag_0, -1.0)
    return Best(up, down, _pitch_at(polar, drag_0, 1.0, up), _pitch_at(polar, drag_0, -1.0, down))


@njit(cache=True, nogil=True)
def parasite(polar: Polar, speed: float) -> float:
    """Return the parasite drag over V², kg/m, at `speed`, m/s."""
    if polar.drag_exponent == 0.0:
        return polar.parasite_drag
    drag: float = polar.parasite_drag * max(speed, 0.05) ** polar.drag_exponent
    return drag


@njit(cache=True, nogil=True)
def glide_near(
    polar: Polar, drag_0: float, best: Best, speed: float, pitch: float, guess: float
) -> tuple[float, float, float, bool]:
    """Return what `glide_angle` returns, knowing the flattest glides and an angle of attack nearby.

    Parameters
    ----------
    polar, speed, pitch
        As in `glide_angle`.
    drag_0, best
        Parasite drag at this speed and the flattest glides that go with it.
    guess
        Angle of attack near the one looked for, rad; NaN: none.
    """
    alpha_0 = -polar.lift_at_zero / polar.lift_slope
    if best.down_pitch < pitch < best.up_pitch:
        slope = -(best.up + best.down) / (best.up_pitch - best.down_pitch)
        return alpha_0 + best.down + slope * (pitch - best.down_pitch), slope, 0.0, False
    side = 1.0 if pitch >= best.up_pitch else -1.0
    flattest = best.up if side > 0.0 else best.down
    b = _glide_lift(polar, drag_0, side, pitch, flattest, side * (alpha_0 - guess))
    slope = _slope_at(polar, drag_0, side, b)
    alpha = alpha_0 - side * b
    drag, lift = drag_0 + polar.induced_drag * alpha**2, polar.lift_slope * b
    by_drag = side * lift * drag_0 / (drag**2 + lift**2)  # of pitch, per relative change of drag_0
    by_speed = side * by_drag / slope * polar.drag_exponent / max(speed, 0.05)
    return alpha, -side / slope, by_speed, True


@njit(cache=True, nogil=True)
def glide_angle(polar: Polar, speed: float, pitch: float) -> tuple[float, float, float, bool]:
    """Return the angle of attack of an unpowered steady glide at `pitch`, its slopes, and whether there is one.

    Flatter than the best glide there is no steady glide on the front side of the polar; the angle of attack then
    runs linearly between the best glides of dive and climb, so that it is continuous through level flight.

    Parameters
    ----------
    polar
        Lift and drag coefficients; only their ratios matter.
    speed
        Speed through water, m/s; matters only if the polar has a drag exponent.
    pitch
        Pitch, rad, nose up positive.

    Returns
    -------
    tuple of float, float, float, bool
        α [rad], ∂α/∂θ [1], ∂α/∂V [rad s/m], and False where the pitch is flatter than the best glide.
    """
    drag_0 = parasite(polar, speed)
    return glide_near(polar, drag_0, best_glides(polar, drag_0), speed, pitch, math.nan)


@njit(cache=True, nogil=True)
def glide_angles(
    polar: Polar, speed: np.ndarray, pitch: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Apply `glide_angle` to arrays `speed` and `pitch` of shape (n,); return four arrays of shape (n,)."""
    n = pitch.size
    alpha, by_pitch, by_speed = np.empty(n), np.empty(n), np.empty(n)
    exists = np.empty(n, dtype=np.bool_)
    drag_0 = parasite(polar, 1.0)
    best = best_glides(polar, drag_0)
    guess, slope, before = math.nan, 0.0, 0.0
    for i in range(n):
        if polar.drag_exponent != 0.0:
            drag_0 = parasite(polar, speed[i])
            best = best_glides(polar, drag_0)
        guess += slope * (pitch[i] - before)
        guess, slope, by_speed[i], exists[i] = glide_near(polar, drag_0, best, speed[i], pitch[i], guess)
        alpha[i], by_pitch[i], before = guess, slope, pitch[i]
    return alpha, by_pitch, by_speed, exists

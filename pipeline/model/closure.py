"""The polar closure: the angle of attack of an unpowered steady glide at a given pitch.

In unpowered steady flight tan γ = −(K_D0 + K_D α²)/(K_L0 + K_L α) and γ = θ − α (Niu et al. 2017, Eq. 22,
doi:10.1007/s13344-017-0061-y; Merckelbach et al. 2010, doi:10.1175/2009JTECHO710.1), so that α follows from the
pitch and the *ratio* of drag to lift alone: a common factor on all coefficients, net buoyancy and thrust do not
enter.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pipeline.vehicle import Polar


@njit(cache=True)
def _glide_lift(polar: Polar, drag_0: float, side: float, pitch: float) -> tuple[float, float, float]:
    """Return how far α lies from zero lift for a glide on `side`, its slopes in pitch and in ln(drag_0).

    With b = |α − α_0| > 0 the closure reads γ(b) = atan(D/(K_L b)), |θ| = γ(b) + side·α_0 − b, which falls
    monotonically in b: a safeguarded Newton iteration between 0 and the best glide.
    """
    alpha_0 = -polar.lift_at_zero / polar.lift_slope
    best = math.sqrt((drag_0 + polar.induced_drag * alpha_0**2) / polar.induced_drag)
    low, high = 0.0, best
    b = min(best, drag_0 / polar.lift_slope / max(math.tan(min(abs(pitch), 1.5)), 0.1))
    slope = -1.0
    for _ in range(60):
        alpha = alpha_0 - side * b
        drag = drag_0 + polar.induced_drag * alpha**2
        lift = polar.lift_slope * b
        norm = drag**2 + lift**2
        gap = math.atan2(drag, lift) + side * alpha_0 - b - side * pitch
        slope = (-2.0 * polar.induced_drag * alpha * side * lift - drag * polar.lift_slope) / norm - 1.0
        if gap > 0.0:
            low = b
        else:
            high = b
        step = b - gap / slope
        if not low < step < high:
            step = 0.5 * (low + high)
        if abs(step - b) < 1e-14:
            b = step
            break
        b = step
    alpha = alpha_0 - side * b
    drag = drag_0 + polar.induced_drag * alpha**2
    lift = polar.lift_slope * b
    norm = drag**2 + lift**2
    slope = (-2.0 * polar.induced_drag * alpha * side * lift - drag * polar.lift_slope) / norm - 1.0
    return b, side / slope, -(lift * drag_0 / norm) / slope


@njit(cache=True)
def _shallowest(polar: Polar, drag_0: float, side: float) -> tuple[float, float]:
    """Return pitch and angle of attack of the best glide on `side`: the flattest that the closure describes."""
    alpha_0 = -polar.lift_at_zero / polar.lift_slope
    b = math.sqrt((drag_0 + polar.induced_drag * alpha_0**2) / polar.induced_drag)
    alpha = alpha_0 - side * b
    drag = drag_0 + polar.induced_drag * alpha**2
    return side * math.atan2(drag, polar.lift_slope * b) + alpha, alpha


@njit(cache=True)
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
    drag_0 = polar.parasite_drag * max(speed, 0.05) ** polar.drag_exponent
    up_pitch, up_alpha = _shallowest(polar, drag_0, 1.0)
    down_pitch, down_alpha = _shallowest(polar, drag_0, -1.0)
    if down_pitch < pitch < up_pitch:
        slope = (up_alpha - down_alpha) / (up_pitch - down_pitch)
        return down_alpha + slope * (pitch - down_pitch), slope, 0.0, False
    side = 1.0 if pitch >= up_pitch else -1.0
    b, by_pitch, by_log_drag = _glide_lift(polar, drag_0, side, pitch)
    alpha = -polar.lift_at_zero / polar.lift_slope - side * b
    by_speed = -side * by_log_drag * polar.drag_exponent / max(speed, 0.05)
    return alpha, -side * by_pitch, by_speed, True


@njit(cache=True)
def glide_angles(
    polar: Polar, speed: np.ndarray, pitch: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Apply `glide_angle` to arrays `speed` and `pitch` of shape (n,); return four arrays of shape (n,)."""
    n = pitch.size
    alpha, by_pitch, by_speed = np.empty(n), np.empty(n), np.empty(n)
    exists = np.empty(n, dtype=np.bool_)
    for i in range(n):
        alpha[i], by_pitch[i], by_speed[i], exists[i] = glide_angle(polar, speed[i], pitch[i])
    return alpha, by_pitch, by_speed, exists

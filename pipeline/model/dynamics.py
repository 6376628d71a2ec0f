"""Longitudinal dynamics of a glider, Eqs. (1)-(4) of Niu et al. (2017) in physical signs.

Kirchhoff form with the centre of gravity at the centre of buoyancy, u = V cos α, w = V sin α, θ = γ + α:

    m_1 u' = -m_3 w q + F_1,    m_3 w' = m_1 u q + F_3,    J_2 q' = (m_3 - m_1) u w + M,    θ' = q

Source: doi:10.1007/s13344-017-0061-y; the printed (1) and (2) disagree with (9) and (10), see docs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from pipeline.model.case import ATTACK_EXPECTED, MAX_ANGLE_OF_ATTACK, MAX_PROPELLER_SPEED, SPEED_EXPECTED, refuse
from pipeline.model.forces import drag, lift, pitching_moment, propeller_of, thrust
from pipeline.vehicle import Polar, Propeller, Vehicle


class Body(NamedTuple):
    """Inertia and pitching moment as plain numbers: m_1, m_3, J_2, K_M0, K_M, K_q."""

    mass_forward: float
    mass_normal: float
    pitch_inertia: float
    moment_at_zero: float
    moment_slope: float
    pitch_damping: float


def body_of(vehicle: Vehicle) -> Body:
    """Return inertia and pitching moment of `vehicle`; NaN where its file says unknown."""
    return Body(*(vehicle[name] for name in Body._fields))


@njit(cache=True, error_model="numpy")
def derivatives(
    speed: float,
    path_angle: float,
    alpha: float,
    pitch_rate: float,
    body: Body,
    polar: Polar,
    propeller: Propeller,
    density_ratio: float,
    density: float,
    net_buoyancy: float,
    propeller_speed: float,
    moment_cos: float,
    moment_sin: float,
) -> tuple[float, float, float, float]:
    """Return (V', γ', α', q') in m/s², rad/s, rad/s, rad/s²; Eqs. (1)-(4) with the errata applied.

    Parameters
    ----------
    speed, path_angle, alpha, pitch_rate
        State: V in m/s (not zero), γ and α in rad, q in rad/s, nose up positive.
    body, polar, propeller
        Coefficients; a propeller of diameter 0 gives no thrust.
    density_ratio
        In-situ density over the reference density; scales lift, drag and hydrodynamic moment.
    density
        In-situ density, kg/m³, for the thrust law.
    net_buoyancy
        Net buoyancy force G, N, up positive.
    propeller_speed
        Propeller speed n, rev/s.
    moment_cos, moment_sin
        Static moment M_c cos θ + M_s sin θ, N m, nose up positive (M_c = -m̄ g r_p1 of a battery r_p1 forward).
    """
    cos_alpha = math.cos(alpha)
    sin_alpha = math.sin(alpha)
    pitch = path_angle + alpha
    cos_pitch = math.cos(pitch)
    sin_pitch = math.sin(pitch)
    lifting = density_ratio * lift(polar, speed, alpha)
    braking = density_ratio * drag(polar, speed, alpha)
    pushing = thrust(propeller, density, propeller_speed, speed)
    u = speed * cos_alpha
    w = speed * sin_alpha

    forward = pushing - braking * cos_alpha + lifting * sin_alpha + net_buoyancy * sin_pitch
    downward = -braking * sin_alpha - lifting * cos_alpha - net_buoyancy * cos_pitch
    u_rate = (forward - body.mass_normal * w * pitch_rate) / body.mass_forward
    w_rate = (downward + body.mass_forward * u * pitch_rate) / body.mass_normal

    hydrodynamic = pitching_moment(body.moment_at_zero, body.moment_slope, body.pitch_damping, speed, alpha, pitch_rate)
    moment = density_ratio * hydrodynamic + moment_cos * cos_pitch + moment_sin * sin_pitch
    munk = (body.mass_normal - body.mass_forward) * u * w

    alpha_rate = (w_rate * cos_alpha - u_rate * sin_alpha) / speed
    return (
        u_rate * cos_alpha + w_rate * sin_alpha,
        pitch_rate - alpha_rate,
        alpha_rate,
        (munk + moment) / body.pitch_inertia,
    )


@njit(cache=True, error_model="numpy")
def jacobian(
    speed: float,
    path_angle: float,
    alpha: float,
    pitch_rate: float,
    body: Body,
    polar: Polar,
    propeller: Propeller,
    density_ratio: float,
    density: float,
    net_buoyancy: float,
    propeller_speed: float,
    moment_cos: float,
    moment_sin: float,
) -> NDArray[np.float64]:
    """Return ∂(V', γ', α', q')/∂(V, γ, α, q), shape (4, 4), by central differences; arguments as `derivatives`."""
    state = np.array([speed, path_angle, alpha, pitch_rate])
    matrix = np.empty((4, 4))
    for column in range(4):
        step = 1e-5 * max(0.1, abs(state[column]))
        ahead, behind = state.copy(), state.copy()
        ahead[column] += step
        behind[column] -= step
        after = derivatives(
            ahead[0], ahead[1], ahead[2], ahead[3], body, polar, propeller,
            density_ratio, density, net_buoyancy, propeller_speed, moment_cos, moment_sin,
        )  # fmt: skip
        before = derivatives(
            behind[0], behind[1], behind[2], behind[3], body, polar, propeller,
            density_ratio, density, net_buoyancy, propeller_speed, moment_cos, moment_sin,
        )  # fmt: skip
        for row in range(4):
            matrix[row, column] = (after[row] - before[row]) / (2.0 * step)
    return matrix


def trajectory(
    vehicle: Vehicle,
    state: ArrayLike,
    times: ArrayLike,
    *,
    net_buoyancy: float,
    propeller_speed: float = 0.0,
    moment_cos: float = 0.0,
    moment_sin: float = 0.0,
    density: float | None = None,
) -> NDArray[np.float64]:
    """Return the motion at `times` under constant inputs, shape (n, 4): the reference that others are held to.

    Integrated by DOP853 (scipy) at a relative tolerance of 1e-12; for a few minutes of flight, not for missions.

    Parameters
    ----------
    vehicle
        Vehicle with all coefficients of the dynamics known.
    state
        V [m/s], γ [rad], α [rad], q [rad/s] at the first of `times`, shape (4,).
    times
        Increasing times, s, shape (n,).
    net_buoyancy, propeller_speed, moment_cos, moment_sin
        As in `derivatives`.
    density
        In-situ density, kg/m³; the vehicle's reference density if left out.

    Raises
    ------
    ValueError
        If a coefficient of the dynamics is unknown, an angle of attack looks like degrees or a propeller speed like
        rpm, or the integration fails.
    """
    from scipy.integrate import solve_ivp

    body, polar, propeller = body_of(vehicle), vehicle.polar, propeller_of(vehicle)
    unknown = [name for name in (*Body._fields, *Polar._fields) if math.isnan(vehicle[name])]
    if unknown:
        raise ValueError(f"{vehicle.name}: found unknown {', '.join(unknown)}; the dynamics need them")
    start = np.asarray(state, dtype=np.float64)
    refuse("angle_of_attack", start[2:3], np.abs(start[2:3]) > MAX_ANGLE_OF_ATTACK, ATTACK_EXPECTED)
    turning = np.array([propeller_speed], dtype=np.float64)
    refuse("propeller_speed", turning, np.abs(turning) > MAX_PROPELLER_SPEED, SPEED_EXPECTED)
    reference = vehicle["reference_density"]
    actual = reference if density is None else density

    def rate(_time: float, x: NDArray[np.float64]) -> tuple[float, float, float, float]:
        result: tuple[float, float, float, float] = derivatives(
            x[0],
            x[1],
            x[2],
            x[3],
            body,
            polar,
            propeller,
            actual / reference,
            actual,
            net_buoyancy,
            propeller_speed,
            moment_cos,
            moment_sin,
        )
        return result

    when = np.asarray(times, dtype=np.float64)
    solution = solve_ivp(
        rate,
        (when[0], when[-1]),
        start,
        method="DOP853",
        t_eval=when,
        rtol=1e-12,
        atol=1e-13,
    )
    if not solution.success:
        raise ValueError(f"{vehicle.name}: integration stopped at {solution.t[-1]:g} s: {solution.message}")
    return np.asarray(solution.y.T, dtype=np.float64)

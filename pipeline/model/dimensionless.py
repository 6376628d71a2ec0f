"""The dimensionless equations of motion, Eqs. (9)-(14) and (17)-(20) of Niu et al. (2017), in physical signs.

With V̄ = (V - V_e)/V_e, γ̄ = γ - γ_e, ᾱ = α - α_e, q̄ = q K_q/K_M and t_n = t/τ_s:

    dV̄/dt_n = (G sin γ - D + T cos α) / (K'_De V_e²)                    (9)
    dγ̄/dt_n = (G cos γ + L + T sin α) / (K'_De V_e² (1 + V̄))            (10)
    ε_1 dᾱ/dt_n = q̄ - ε_1 dγ̄/dt_n                                      (11)
    ε_2 dq̄/dt_n = -(ᾱ + q̄) (1 + V̄)²                                    (12)

where τ_s = m_3/(K'_De V_e), ε_1 = K_q/(K_M τ_s), ε_2 = -J_2/(K_q V_e² τ_s). They hold for m_1 = m_3, without static
moment, about α_e = -K_M0/K_M, at the reference density. As printed, doi:10.1007/s13344-017-0061-y, L and T sin α
differ in sign, and τ_s has K_De in place of K'_De.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.model.steady import steady_state
from pipeline.vehicle import Polar, Vehicle

Array = NDArray[np.float64]
Hold = Literal["thrust", "propeller_speed"]

NAMES = ("moment_at_zero", "moment_slope", "pitch_damping", "pitch_inertia", "mass_normal")


@dataclass(frozen=True)
class Scales:
    """The steady flight about which the equations are written, and their scales; NaN where there is none.

    Attributes
    ----------
    speed, path_angle, angle_of_attack
        V_e [m/s], γ_e, α_e [rad].
    net_buoyancy, thrust
        G and T_e, N.
    thrust_slope
        dT/dV of the propeller at constant n, N s/m; 0 where the thrust was given.
    polar
        Lift and drag coefficients.
    effective_drag, effective_lift
        K'_De = K_De - u cos α_e and K'_Le = K_Le + u sin α_e with u = T_e/V_e², kg/m.
    time_scale
        τ_s, s.
    epsilon_alpha, epsilon_pitch
        ε_1 and ε_2.
    pitch_rate_scale
        K_M/K_q, 1/s: q = q̄ K_M/K_q.
    reason
        Why there is no steady flight, "" where there is.
    """

    speed: float
    path_angle: float
    angle_of_attack: float
    net_buoyancy: float
    thrust: float
    thrust_slope: float
    polar: Polar
    effective_drag: float
    effective_lift: float
    time_scale: float
    epsilon_alpha: float
    epsilon_pitch: float
    pitch_rate_scale: float
    reason: str

    def state(self, deviations: ArrayLike) -> Array:
        """Return (V, γ, α, q) in m/s, rad and rad/s of (V̄, γ̄, ᾱ, q̄), shape (..., 4)."""
        scale = np.array([self.speed, 1.0, 1.0, self.pitch_rate_scale])
        offset = np.array([self.speed, self.path_angle, self.angle_of_attack, 0.0])
        return np.asarray(offset + scale * np.asarray(deviations, dtype=np.float64))

    def deviations(self, state: ArrayLike) -> Array:
        """Return (V̄, γ̄, ᾱ, q̄) of (V, γ, α, q), shape (..., 4): the inverse of `state`."""
        scale = np.array([self.speed, 1.0, 1.0, self.pitch_rate_scale])
        offset = np.array([self.speed, self.path_angle, self.angle_of_attack, 0.0])
        return np.asarray((np.asarray(state, dtype=np.float64) - offset) / scale)


def scales(
    vehicle: Vehicle,
    net_buoyancy: float,
    *,
    thrust: float | None = None,
    propeller_speed: float | None = None,
) -> Scales:
    """Return steady flight at α_e = -K_M0/K_M and the scales of the dimensionless equations.

    Parameters
    ----------
    vehicle
        Vehicle with known polar, moments and inertia.
    net_buoyancy
        G, N, up positive.
    thrust, propeller_speed
        T [N] or n [rev/s]; neither for gliding.

    Raises
    ------
    ValueError
        As for `steady.steady_state`.

    Examples
    --------
    >>> from pipeline.vehicle import load
    >>> round(scales(load("petrel-ii"), 7.0, thrust=7.0).epsilon_alpha, 6)
    0.001307
    """
    k_m0, k_m, k_q, inertia, mass = (vehicle[name] for name in NAMES)
    alpha = -k_m0 / k_m
    flight = steady_state(vehicle, net_buoyancy, alpha, thrust=thrust, propeller_speed=propeller_speed)
    speed, push = float(flight.speed), float(flight.thrust)
    polar = vehicle.polar
    u = push / speed**2
    braking = polar.parasite_drag * speed**polar.drag_exponent + polar.induced_drag * alpha**2
    drag = braking - u * np.cos(alpha)
    time = mass / (drag * speed) if drag else np.nan
    slope = 0.0
    if propeller_speed and vehicle.propeller is not None:
        law = vehicle.propeller
        slope = vehicle["reference_density"] * law.diameter**3 * propeller_speed * law.thrust_slope
    unknown = [name for name in NAMES if np.isnan(vehicle[name])]
    reason = f"the vehicle file leaves {', '.join(unknown)} unknown" if unknown else str(flight.reason)
    if not reason and not drag:
        reason = "K'_De is zero: level flight has no such scales"
    return Scales(
        speed=speed,
        path_angle=float(flight.path_angle),
        angle_of_attack=float(flight.angle_of_attack),
        net_buoyancy=net_buoyancy,
        thrust=push,
        thrust_slope=slope,
        polar=polar,
        effective_drag=float(drag),
        effective_lift=float(polar.lift_at_zero + polar.lift_slope * alpha + u * np.sin(alpha)),
        time_scale=float(time),
        epsilon_alpha=float(k_q / (k_m * time)),
        epsilon_pitch=float(-inertia / (k_q * speed**2 * time)),
        pitch_rate_scale=k_m / k_q,
        reason=reason,
    )


def full_rates(deviations: ArrayLike, about: Scales, *, hold: Hold = "thrust") -> Array:
    """Return d(V̄, γ̄, ᾱ, q̄)/dt_n by Eqs. (9)-(14), shape (..., 4).

    Parameters
    ----------
    deviations
        (V̄, γ̄, ᾱ, q̄), shape (..., 4).
    about
        Steady flight and scales.
    hold
        Whether the thrust is constant, as in the paper's Eqs. (9)-(12), or the propeller speed, as at sea.
    """
    v, gamma, alpha, q = np.moveaxis(np.asarray(deviations, dtype=np.float64), -1, 0)
    thrust = about.thrust + (about.thrust_slope * about.speed * v if hold == "propeller_speed" else 0.0)
    return _rates(v, gamma, alpha, q, about, thrust)


def split_rates(deviations: ArrayLike, about: Scales) -> Array:
    """Return d(V̄, γ̄, ᾱ, q̄)/dt_n by Eqs. (17)-(20), shape (..., 4): slow part on the manifold ᾱ = 0, T ~ V².

    (19), (20): f_1 = (G sin γ - K'_De V²)/(K'_De V_e²), f_2 = (G cos γ + K'_Le V²)/(K'_De V_e² (1 + V̄)); (18):
    ε_1 dᾱ/dt_n = q̄ - ε_1 f_2 and ε_2 dq̄/dt_n as in (12). With the advance ratio held thrust goes with V², and the
    steady K'_De and K'_Le stay; only there, and only at ᾱ = 0, is this the motion of Eqs. (9)-(12).

    Parameters
    ----------
    deviations, about
        As for `full_rates`.
    """
    v, gamma, alpha, q = np.moveaxis(np.asarray(deviations, dtype=np.float64), -1, 0)
    size = about.effective_drag * about.speed**2
    path = about.path_angle + gamma
    square = (about.speed * (1.0 + v)) ** 2
    f_1 = (about.net_buoyancy * np.sin(path) - about.effective_drag * square) / size
    f_2 = (about.net_buoyancy * np.cos(path) + about.effective_lift * square) / (size * (1.0 + v))
    return np.stack([f_1, f_2, *_fast(v, alpha, q, f_2, about)], axis=-1)


def _rates(v: Array, gamma: Array, alpha: Array, q: Array, about: Scales, thrust: Array | float) -> Array:
    polar = about.polar
    speed, path, attack = about.speed * (1.0 + v), about.path_angle + gamma, about.angle_of_attack + alpha
    lift = (polar.lift_at_zero + polar.lift_slope * attack) * speed**2
    drag = (polar.parasite_drag * speed**polar.drag_exponent + polar.induced_drag * attack**2) * speed**2
    size = about.effective_drag * about.speed**2
    along = (about.net_buoyancy * np.sin(path) - drag + thrust * np.cos(attack)) / size
    across = (about.net_buoyancy * np.cos(path) + lift + thrust * np.sin(attack)) / (size * (1.0 + v))
    return np.stack([along, across, *_fast(v, alpha, q, across, about)], axis=-1)


def _fast(v: Array, alpha: Array, q: Array, path_rate: Array, about: Scales) -> tuple[Array, Array]:
    """Return dᾱ/dt_n and dq̄/dt_n, Eqs. (11) and (12)."""
    return q / about.epsilon_alpha - path_rate, -(alpha + q) * (1.0 + v) ** 2 / about.epsilon_pitch

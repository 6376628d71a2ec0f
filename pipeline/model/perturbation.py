"""Time scales and interconnection constants of the two-time-scale stability proof, Section 3 and Appendix A.

Speed and path angle are slow, angle of attack and pitch rate fast, by ε_1 and ε_2. With d the weight between the
Lyapunov functions of the two parts, Khalil's theorem proves stability if μ = max(ε_1, ε_2) is less than

    μ_d = a_1 a_2 / (a_1 γ_2 + ((1 - d) β_1 + d β_2)² / (4 d (1 - d))),  largest at d* = β_1/(β_1 + β_2).

Niu et al. (2017), doi:10.1007/s13344-017-0061-y. Thrust goes with V², as in Eqs. (17)-(20), and m_1 = m_3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

from pipeline.model.steady import Signs, steady_state
from pipeline.vehicle import Vehicle

Formulas = Literal["printed", "corrected"]

_GROWTH = math.sqrt(2.0) + 1.0


class Bounds(NamedTuple):
    """Half-widths of a neighbourhood of steady flight, for |V̄| [1], |γ̄| [rad], |ᾱ| [rad], |q̄| [rad]: the paper's."""

    speed: float = 0.2
    path_angle: float = 0.1
    angle_of_attack: float = 0.01
    pitch_rate: float = math.pi / 4.0


@dataclass(frozen=True)
class Interconnection:
    """Time scales and constants of the proof; NaN with a reason where it does not apply.

    Attributes
    ----------
    time_scale
        τ_s = m_3/(K'_De V_e), s.
    epsilon_alpha, epsilon_pitch
        ε_1 = K_q/(K_M τ_s) and ε_2 = -J_2/(K_q V_e² τ_s).
    mu
        μ = max(ε_1, ε_2).
    ratio_alpha, ratio_pitch
        r_1 = μ/ε_1 and r_2 = μ/ε_2.
    slow_decay, fast_decay
        a_1 = 1 and a_2 = r_2.
    beta_slow, beta_fast
        β_1 and β_2.
    gamma_alpha, gamma_change
        γ_2' and γ_2''; their sum is γ_2.
    weight
        d* = β_1/(β_1 + β_2).
    mu_limit
        μ_d at d*.
    holds
        Whether μ < μ_d: whether stability is proven.
    reason
        Why it is not, "" where it is.
    """

    time_scale: float
    epsilon_alpha: float
    epsilon_pitch: float
    mu: float
    ratio_alpha: float
    ratio_pitch: float
    slow_decay: float
    fast_decay: float
    beta_slow: float
    beta_fast: float
    gamma_alpha: float
    gamma_change: float
    weight: float
    mu_limit: float
    holds: bool
    reason: str

    def limit_at(self, weight: float) -> float:
        """Return μ_d at another weight d, 0 < d < 1."""
        crossed = (1.0 - weight) * self.beta_slow + weight * self.beta_fast
        interplay = crossed**2 / (4.0 * weight * (1.0 - weight))
        gamma = self.gamma_alpha + self.gamma_change
        return self.slow_decay * self.fast_decay / (self.slow_decay * gamma + interplay)


def interconnection(
    vehicle: Vehicle,
    net_buoyancy: float,
    angle_of_attack: float,
    thrust: float,
    *,
    bounds: Bounds = Bounds(),  # noqa: B008 - immutable
    density: float | None = None,
    signs: Signs = "physical",
    formulas: Formulas = "printed",
) -> Interconnection:
    """Return time scales and interconnection constants of steady flight with the pitch left free.

    ``printed`` follows Appendix A, with K_D in β_1 and c_1 at 1 + V̄_max. ``corrected`` bounds the same quantities
    truly for physical signs: cosine differences by sin(ᾱ/2 + |α_e|) |ᾱ|, sine differences by |ᾱ|, the change of W
    along the whole of V̄', to both sides of V̄ = 0. It is proven by the Cauchy-Schwarz inequality from
    Φ' = -ψ², ψ² = ((1 + V̄)² - cos γ̄)² + sin² γ̄ = (V̄ + 2)² V̄² + 4 (1 + V̄)² sin²(γ̄/2).

    Parameters
    ----------
    vehicle
        Vehicle with known polar, moments and inertia, without a speed exponent of its drag.
    net_buoyancy, angle_of_attack, thrust
        G [N], α_e [rad] and T_e [N] of the steady flight.
    bounds
        Neighbourhood over which the constants are taken.
    density
        In-situ density, kg/m³; the vehicle's reference density if left out.
    signs, formulas
        ``physical`` or ``paper``, ``printed`` or ``corrected``; corrected formulas have physical signs.

    Raises
    ------
    ValueError
        If corrected formulas are asked for in the paper's signs, or as for `steady.steady_state`.

    Examples
    --------
    >>> from pipeline.vehicle import load
    >>> found = interconnection(load("petrel-ii"), 7.0, -0.0025358, 7.0, signs="paper")
    >>> round(found.epsilon_alpha, 7), found.holds
    (0.0013079, False)
    """
    if formulas not in ("printed", "corrected"):
        raise ValueError(f"formulas: found {formulas!r}; expected 'printed' or 'corrected'")
    if formulas == "corrected" and signs != "physical":
        raise ValueError("found corrected formulas with the paper's signs; corrected formulas are physical")
    state = steady_state(vehicle, net_buoyancy, angle_of_attack, thrust=thrust, density=density, signs=signs)
    ratio = 1.0 if density is None else density / vehicle["reference_density"]
    polar, speed, alpha = vehicle.polar, float(state.speed), float(angle_of_attack)
    needed = ("mass_normal", "pitch_inertia", "moment_slope", "pitch_damping")
    unknown = [name for name in needed if math.isnan(vehicle[name])]
    if unknown:
        return _none(f"the vehicle file leaves {', '.join(unknown)} unknown")
    if str(state.reason):
        return _none(str(state.reason))
    if polar.drag_exponent != 0.0:
        return _none("the proof does not know a speed exponent of the drag")

    u = thrust / speed**2
    lift_slope, induced = ratio * polar.lift_slope, ratio * polar.induced_drag
    drag_e = ratio * polar.parasite_drag + induced * alpha**2
    lift_e = ratio * polar.lift_at_zero + lift_slope * alpha
    drag_k = drag_e - u * math.cos(alpha)
    lift_k = lift_e + (1.0 if signs == "physical" else -1.0) * u * math.sin(alpha)
    if drag_k <= 0.0:
        return _none("K'_De is not positive: the thrust alone carries the vehicle along its path")

    tau = vehicle["mass_normal"] / (drag_k * speed)
    epsilon_1 = vehicle["pitch_damping"] / (vehicle["moment_slope"] * tau)
    epsilon_2 = -vehicle["pitch_inertia"] / (ratio * vehicle["pitch_damping"] * speed**2 * tau)
    mu = max(epsilon_1, epsilon_2)
    r1, r2 = mu / epsilon_1, mu / epsilon_2
    fast, slow = 1.0 + bounds.speed, 1.0 - bounds.speed
    widest = bounds.angle_of_attack
    bending = induced * (widest + 2.0 * abs(alpha))
    if formulas == "printed":
        c1 = 1.0 + 2.0 * r2 * fast**2 / r1
        near = math.sin(0.5 * widest) ** 2
        h = near + math.sin(0.5 * widest + abs(alpha)) ** 2
        h_prime = near + math.cos(0.5 * widest + abs(alpha)) ** 2
        swell = _GROWTH * bounds.speed + math.sqrt(2.0)
        beta_1 = ((bending + u * h) * swell + lift_slope + u * h_prime) / drag_k
        whole = abs(lift_e) * swell + abs(u) * (_GROWTH * fast + 1.0) + abs(drag_e)
        beta_2 = (c1 + 1.0) / (drag_k * slow**3) * whole
        gamma_a = lift_slope * (2.0 * c1 + 1.0) / (2.0 * drag_k * slow)
        change = abs((abs(lift_k) * math.sin(bounds.path_angle) + drag_k * (1.0 - slow**2)) / drag_k)
        gamma_b = 2.0 * change * r2 / (r1 * slow) + r1 * change / (r2 * slow**5)
    else:
        bend = bending + abs(u) * math.sin(min(0.5 * widest + abs(alpha), 0.5 * math.pi))
        beta_1 = (fast * bend + lift_slope + abs(u)) / drag_k
        least, most = (1.0 + 2.0 * r2 * edge**2 / r1 for edge in (slow, fast))
        slope = lift_k / drag_k
        beta_2 = math.hypot(most, 1.0) * math.hypot(1.0, slope) / slow**2
        gamma_a = (lift_slope + abs(u)) / drag_k * 0.5 * (math.hypot(least, 1.0) - least) / slow
        cosine = math.cos(min(bounds.path_angle, math.pi))
        sine = math.sin(min(bounds.path_angle, 0.5 * math.pi))
        change = abs(slope) * sine + max(fast**2 - cosine, 1.0 - slow**2) + fast**2 * bend * widest / drag_k
        gamma_b = change * max(2.0 * r2 / (r1 * slow), r1 / (r2 * slow**5))
    limit = r2 / (gamma_a + gamma_b + beta_1 * beta_2)
    reason = "" if mu < limit else f"mu = {mu:.3g} is not less than mu_d = {limit:.3g}"
    return Interconnection(
        tau, epsilon_1, epsilon_2, mu, r1, r2, 1.0, r2, beta_1, beta_2, gamma_a, gamma_b,
        beta_1 / (beta_1 + beta_2), limit, not reason, reason,
    )  # fmt: skip


def _none(reason: str) -> Interconnection:
    return Interconnection(*(math.nan,) * 14, False, reason)

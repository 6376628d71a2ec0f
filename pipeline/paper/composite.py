"""The numbers of the composite Lyapunov function in Section 4 of Niu et al. (2017), and whether the proof holds.

Source: doi:10.1007/s13344-017-0061-y; the constants are those of its Appendix A, see `pipeline.model.perturbation`.
"""

from __future__ import annotations

from typing import Any

from pipeline.model.perturbation import Bounds, Interconnection, interconnection
from pipeline.model.predict import free_angle_of_attack
from pipeline.paper.claim import Claim, Pair, Reading
from pipeline.vehicle import Vehicle

#: Pitch inertia that the printed ε_2 needs, kg m².
FITTED_INERTIA = 0.300
#: Net buoyancy and thrust of the example, N.
FORCE = 7.0
#: d as printed.
PRINTED_WEIGHT = 0.9428


def composite(vehicle: Vehicle) -> list[Claim]:
    """Return ε_1, ε_2, μ, d and μ_d as printed and computed; the bounds of the neighbourhood are inputs."""
    where = "Section 4"
    bounds = Bounds()
    both = [_constants(vehicle, "paper"), _constants(vehicle, "physical")]
    light = _constants(_with_inertia(vehicle), "paper")
    small = f"J_2 = {FITTED_INERTIA:.3f} kg m² instead of 12.3"
    cases = {
        f"the constants of Appendix A with {small}": light,
        "gliding": _constants(vehicle, "paper", thrust=0.0),
        f"gliding with {small}": _constants(_with_inertia(vehicle), "paper", thrust=0.0),
    }
    swapped = _edges_swapped(both[0], bounds)
    other = "V̄_min and V̄_max interchanged in c_1 and in the denominators"
    weights = [Reading(what, found.weight) for what, found in cases.items()] + [Reading(other, swapped[0])]
    limits = [Reading(what, found.mu_limit) for what, found in cases.items()] + [
        Reading(f"d = {PRINTED_WEIGHT} as printed", both[0].limit_at(PRINTED_WEIGHT)),
        Reading(other, swapped[1]),
    ]
    fails = f"μ = {both[0].mu:.3g} exceeds it, so the certificate does not hold"
    return [
        Claim(where, "bound of |V̄|", "1", "0.2", bounds.speed, bounds.speed, kind="input"),
        Claim(where, "bound of |ᾱ|", "rad", "0.01", bounds.angle_of_attack, bounds.angle_of_attack, kind="input"),
        Claim(where, "bound of |γ̄|", "rad", "0.1", bounds.path_angle, bounds.path_angle, kind="input"),
        Claim(
            where, "bound of |q̄|, printed |β̄|, π/4", "rad", "0.7854", bounds.pitch_rate, bounds.pitch_rate,
            kind="input", remark="a pitch rate of 35 rad/s",
        ),
        Claim(where, "ε_1", "1", "0.001308", *_pair(both, "epsilon_alpha"), remark="K'_De in τ_s"),
        Claim(
            where, "ε_2", "1", "0.001340", *_pair(both, "epsilon_pitch"),
            readings=(Reading(small, light.epsilon_pitch),),
        ),
        Claim(
            where, "μ = max(ε_1, ε_2)", "1", "0.001340", *_pair(both, "mu"),
            readings=(Reading(small, light.mu),),
        ),
        Claim(where, "d", "1", "0.9428", *_pair(both, "weight"), readings=tuple(weights)),
        Claim(
            where, "μ_d", "1", "0.001352", *_pair(both, "mu_limit"), readings=tuple(limits), remark=fails
        ),
    ]  # fmt: skip


def certificate(vehicle: Vehicle) -> list[dict[str, Any]]:
    """Return whether the composite Lyapunov function proves stability: μ against μ_d, by mode and by signs."""
    rows = []
    for mode, thrust in (("gliding", 0.0), ("hybrid", FORCE)):
        for inertia, body in ((vehicle["pitch_inertia"], vehicle), (FITTED_INERTIA, _with_inertia(vehicle))):
            for formulas in ("printed", "corrected"):
                found = _constants(body, "physical", thrust=thrust, formulas=formulas)
                rows.append(
                    {
                        "mode": mode,
                        "pitch_inertia_kg_m2": inertia,
                        "formulas": formulas,
                        "mu": found.mu,
                        "mu_d": found.mu_limit,
                        "d": found.weight,
                        "holds": found.holds,
                        "reason": found.reason,
                    }
                )
    return rows


def _constants(vehicle: Vehicle, signs: Any, *, thrust: float = FORCE, formulas: Any = "printed") -> Interconnection:
    alpha, _ = free_angle_of_attack(vehicle)
    return interconnection(vehicle, FORCE, alpha, thrust, signs=signs, formulas=formulas)


def _pair(both: list[Interconnection], name: str) -> Pair:
    paper, physical = (float(getattr(found, name)) for found in both)
    return Pair(paper, physical)


def _with_inertia(vehicle: Vehicle) -> Vehicle:
    return vehicle.with_values({"pitch_inertia": FITTED_INERTIA}, "what the printed ε_2 needs")


def _edges_swapped(found: Interconnection, bounds: Bounds) -> tuple[float, float]:
    """Return d* and μ_d with the two edges of the speed interval interchanged in c_1 and in the denominators."""
    fast, slow = 1.0 + bounds.speed, 1.0 - bounds.speed
    r1, r2 = found.ratio_alpha, found.ratio_pitch
    before, after = (1.0 + 2.0 * r2 * edge**2 / r1 for edge in (fast, slow))
    beta = found.beta_fast * (after + 1.0) / (before + 1.0) * (slow / fast) ** 3
    gamma_alpha = found.gamma_alpha * (2.0 * after + 1.0) / (2.0 * before + 1.0) * slow / fast

    def spread(edge: float) -> float:
        return 2.0 * r2 / (r1 * edge) + r1 / (r2 * edge**5)

    gamma_change = found.gamma_change * spread(fast) / spread(slow)
    limit = found.fast_decay / (gamma_alpha + gamma_change + found.beta_slow * beta)
    return found.beta_slow / (found.beta_slow + beta), limit

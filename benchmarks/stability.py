"""What is proven of the stability of Petrel-II in the paper's example, each number beside the one known before.

Usage: ``python benchmarks/stability.py``. G = 7 N, α_e = -K_M0/K_M, gliding or driven by 7 N; Niu et al. (2017),
doi:10.1007/s13344-017-0061-y.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from pipeline.model.lyapunov import certificate, composite, inertia_limit, quadratic
from pipeline.model.modes import Hold, equilibrium, modes
from pipeline.model.perturbation import Bounds, interconnection
from pipeline.vehicle import load

FORCE = 7.0
#: Pitch inertia of the vehicle and the one behind the printed ε_2, kg m².
INERTIAS = (12.3, 0.300)
#: What may be held of a propeller whose thrust is given.
HELD: tuple[Hold, ...] = ("propeller_speed", "thrust", "advance_ratio")
#: Semi-axes (V̄, γ̄, ᾱ) of a quadratic function known before, gliding and driven.
KNOWN = {0.0: (0.242, 0.165, 0.269), FORCE: (0.320, 0.153, 0.156)}


def name(thrust: float) -> str:
    return "driven " if thrust else "gliding"


def eigenvalues() -> None:
    """Print the eigenvalues by what is held."""
    for hold in HELD:
        found = modes(equilibrium(load("petrel-ii"), FORCE, thrust=FORCE, hold=hold))
        print(f"driven, {hold.replace('_', ' ')} held: eigenvalues {np.round(found.eigenvalues, 4).tolist()} 1/s")


def proof() -> None:
    """Print μ and μ_d of the two-time-scale proof, as printed and corrected."""
    for inertia in INERTIAS:
        vehicle = load("petrel-ii").with_values({"pitch_inertia": inertia}, "benchmark")
        alpha = equilibrium(vehicle, FORCE).flight.angle_of_attack
        for thrust in KNOWN:
            for formulas in ("printed", "corrected"):
                found = interconnection(vehicle, FORCE, alpha, thrust, formulas=formulas)
                print(
                    f"J_2 = {inertia:4.1f} kg m2, {name(thrust)}, {formulas:9}: mu {found.mu:.3e}, mu_d "
                    f"{found.mu_limit:.3e} at d = {found.weight:.4f}: {'proven' if found.holds else 'not proven'}"
                )


def functions() -> None:
    """Print where Eq. (32) and its correction are Lyapunov functions, and the sets of a quadratic one."""
    vehicle = load("petrel-ii")
    light = vehicle.with_values({"pitch_inertia": INERTIAS[1]}, "benchmark")
    for thrust, known in KNOWN.items():
        state = equilibrium(vehicle, FORCE, thrust=thrust)
        for formulas in ("printed", "corrected"):
            found = composite(state, formulas=formulas)
            print(f"{name(thrust)}, Eq. (32) {formulas}: {'holds' if found.holds else found.reason}")
        print(
            f"{name(thrust)}, Eq. (32) corrected holds up to J_2 = {inertia_limit(vehicle, FORCE, thrust=thrust):.2f}"
        )
        within = certificate(composite(equilibrium(light, FORCE, thrust=thrust)), Bounds())
        print(
            f"{name(thrust)}, Eq. (32) corrected, J_2 = {INERTIAS[1]} kg m2, d = {within.function.weight:.4f}, within "
            f"the paper's bounds: semi-axes V, gamma, alpha {np.round(within.semi_axes[:3], 4).tolist()}"
        )
        plain = (1.0, 1.0, 100.0 if thrust else 10.0, 1000.0)
        for what, damping in (("modes", None), ("Q = 1", np.eye(4)), (f"Q = diag{plain}", np.diag(plain))):
            sets = certificate(quadratic(state, damping=damping))
            print(
                f"{name(thrust)}, quadratic by {what}: semi-axes V, gamma, alpha "
                f"{np.round(sets.semi_axes[:3], 3).tolist()} (known before: {list(known)})"
            )


def main() -> None:
    eigenvalues()
    proof()
    functions()


if __name__ == "__main__":
    main()

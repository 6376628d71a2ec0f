"""Numbers that follow from Niu et al. (2017) without being printed there: they show where the print goes wrong.

Source: doi:10.1007/s13344-017-0061-y. The derivations are in docs/errata.md.
"""

from __future__ import annotations

import math
from typing import Any

from scipy.optimize import brentq

from pipeline.model.modes import equilibrium, modes
from pipeline.model.predict import free_angle_of_attack
from pipeline.model.steady import steady_state
from pipeline.paper.numbers import EXAMPLE, FITTED_THRUST
from pipeline.paper.trials import DANJIANGKOU
from pipeline.vehicle import Vehicle


def derived(vehicle: Vehicle) -> list[dict[str, Any]]:
    """Return rows of what follows, its value and unit, and what it shows."""
    alpha, _ = free_angle_of_attack(vehicle)
    state = steady_state(vehicle, EXAMPLE, alpha, thrust=EXAMPLE, signs="paper")
    speed, gamma = float(state.speed), float(state.path_angle)
    lift = (vehicle["lift_at_zero"] + vehicle["lift_slope"] * alpha) * speed**2
    rows: list[dict[str, Any]] = [
        _row(
            "left of (10) at the paper's own steady flight",
            abs(EXAMPLE * (math.cos(gamma) + math.sin(alpha)) - lift), "N", "(10) has lift with the wrong sign",
        ),
        _row("V_e of (21) with B as printed, T = G = 7 N", as_printed(vehicle, EXAMPLE, EXAMPLE, alpha), "m/s",
             "B needs a minus sign"),
    ]  # fmt: skip
    for rpm, printed, thrust in (
        (1391.0, 1.3694, EXAMPLE),
        (1400.0, 1.3743, 7.1025),
        (800.0, 0.7979, FITTED_THRUST[DANJIANGKOU]),
    ):
        what = f"D_0 from {rpm:.0f} rpm, {printed} m/s, {thrust:g} N"
        rows.append(_row(what, diameter(vehicle, rpm, printed, thrust), "m", "(8) holds with n in rev/s and D_0 in m"))
    found = modes(equilibrium(vehicle, EXAMPLE, thrust=EXAMPLE))
    for value in found.eigenvalues[found.eigenvalues.imag >= 0.0]:
        what = "eigenvalue" if value.imag == 0.0 else "pair of eigenvalues"
        rows.append(_row(f"{what} at T = G = 7 N, thrust held", float(value.real), "1/s", "linear stability holds"))
        if value.imag:
            rows.append(_row("imaginary part of the pair", float(value.imag), "1/s", "swing of the angle of attack"))
    for hold, why in (
        ("advance_ratio", "as (17)–(20) have it, T = u V²"),
        ("thrust", "constant thrust"),
        ("propeller_speed", "as the vehicle does it, T = a + b V"),
    ):
        held = modes(equilibrium(vehicle, EXAMPLE, thrust=EXAMPLE, hold=hold))  # type: ignore[arg-type]
        real = sorted(float(value.real) for value in held.eigenvalues if abs(value.imag) < 1e-9)
        rows.append(_row(f"slow eigenvalue of speed, {hold.replace('_', ' ')} held", real[0], "1/s", why))
    return rows


def as_printed(vehicle: Vehicle, net_buoyancy: float, thrust: float, alpha: float) -> float:
    """Return V_e of (21), m/s, with the sign of B that is printed: +2T[K_De cos α + K_Le sin α]."""
    drag = vehicle["parasite_drag"] + vehicle["induced_drag"] * alpha**2
    lift = vehicle["lift_at_zero"] + vehicle["lift_slope"] * alpha
    a = drag**2 + lift**2
    b = 2.0 * thrust * (drag * math.cos(alpha) + lift * math.sin(alpha))
    c = thrust**2 - net_buoyancy**2
    return math.sqrt(max(0.0, (-b + math.sqrt(b**2 - 4.0 * a * c)) / (2.0 * a)))


def diameter(vehicle: Vehicle, rpm: float, speed: float, thrust: float) -> float:
    """Return the propeller diameter, m, that (8) with (15) needs for a thrust [N] at rpm and speed [m/s]."""
    n, density = rpm / 60.0, vehicle["reference_density"]
    k1, k2 = vehicle["thrust_static"], vehicle["thrust_slope"]
    return float(brentq(lambda d: density * n * d**3 * (k1 * d * n + k2 * speed) - thrust, 0.05, 0.2, xtol=1e-12))


def _row(what: str, value: float, unit: str, shows: str) -> dict[str, Any]:
    return {"quantity": what, "value": value, "unit": unit, "shows": shows}

"""The printed numbers of Sections 2 to 5 of Niu et al. (2017), each computed again in both conventions of sign.

Source: doi:10.1007/s13344-017-0061-y. ``paper`` signs are those of the print with two corrections that its numbers
need: the sign of B in (21), and d and l without their squares in (28).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pipeline.model.predict import free_angle_of_attack
from pipeline.model.stability import stable_range
from pipeline.model.steady import Signs, Steady, steady_state
from pipeline.paper.claim import Claim, Pair, Reading
from pipeline.paper.trials import DANJIANGKOU, SOUTH_CHINA_SEA, Trial, held_speed
from pipeline.vehicle import Vehicle

SIGNS: tuple[Signs, Signs] = ("paper", "physical")

#: Table 2: advance ratio J_0 and thrust coefficient K_T.
TABLE_2 = ((0.40, "0.45"), (0.60, "0.36"), (1.20, "0.13"), (1.40, "0.04"))
#: g of the paper, m/s².
PAPER_GRAVITY = 10.0
#: Net buoyancy and thrust of the numerical example of Section 4, N.
EXAMPLE = 7.0
#: Angle of attack at which both printed pitch angles of the powered trials come out, rad.
FITTED_ALPHA = -0.002528
#: Thrust at which both the printed V_e and the printed bound (27) of a powered trial come out, N.
FITTED_THRUST = {DANJIANGKOU: 2.2501, SOUTH_CHINA_SEA: 7.1025}
#: Share of the greatest horizontal speed within which its maximum counts as flat.
FLAT = 1e-2


#: What else Section 5 says of the powered trials: quantity, unit, printed.
DANJIANGKOU_SETTINGS = (
    ("target depth", "m", "10"),
    ("target pitch", "°", "0"),
    ("least pitch", "°", "2"),
    ("greatest pitch", "°", "5"),
    ("greatest depth", "m", "13.1"),
    ("mean depth", "m", "11.3"),
    ("propeller speed of the theory", "rpm", "800"),
)
SOUTH_CHINA_SEA_SETTINGS = (("target depth", "m", "500"), ("target pitch", "°", "45"))


#: Of a number that theory has nothing for.
NOTHING = Pair(math.nan, math.nan)


def propeller(vehicle: Vehicle) -> list[Claim]:
    """Return the numbers of Section 2: Table 2 against (15), and the line itself."""
    ratio = np.array([row[0] for row in TABLE_2])
    slope, static = np.polyfit(ratio, [float(row[1]) for row in TABLE_2], 1)
    line = -0.45 / (1.5 - 0.4)
    through = "the line through (0.4, 0.45) and (1.5, 0), not a fit of Table 2,"
    k1, k2 = vehicle["thrust_static"], vehicle["thrust_slope"]
    rows = [
        _given("Section 2", "acceleration of gravity g, in G = m_0 g", "m/s²", "10", PAPER_GRAVITY),
        _given("Section 2", "density ρ", "kg/m³", "1020", vehicle["reference_density"]),
        _measured("Section 2", "pitch ratio P/D_0", "1", "1.4"),
    ]
    for j, printed in TABLE_2:
        value = k1 + k2 * j
        rows.append(Claim("Table 2", f"K_T at J_0 = {j:.2f}", "1", printed, value, value, remark="by (15)"))
    rows += [
        Claim(
            "(15)", "K_1, fit of Table 2", "1", "0.6136", float(static), float(static),
            (Reading(through, 0.45 - 0.4 * line),),
        ),
        Claim(
            "(15)", "K_2, fit of Table 2", "1", "-0.4091", float(slope), float(slope), (Reading(through, line),)
        ),
    ]  # fmt: skip
    return rows


def coefficients(vehicle: Vehicle) -> list[Claim]:
    """Return the coefficients of Section 4, as printed and as they must be."""
    section = "Section 4"
    sign = "a lost minus sign (ε_1 > 0, a stable pitch and γ_e > 0 all need K_M < 0 and K_M0 < 0)"
    m0, m = vehicle["moment_at_zero"], vehicle["moment_slope"]
    return [
        _given(section, "K_L0", "kg/m", "0", vehicle["lift_at_zero"]),
        _given(section, "K_L", "kg/m/rad", "351.3570", vehicle["lift_slope"]),
        _given(section, "K_D0", "kg/m", "7.3579", vehicle["parasite_drag"]),
        _given(section, "K_D", "kg/m/rad²", "318.0849", vehicle["induced_drag"]),
        Claim(section, "K_M0", "kg", "0.7959", m0, m0, (Reading(sign, -m0),), kind="input"),
        Claim(section, "K_M", "kg/rad", "313.8643", m, m, (Reading(sign, -m),), kind="input"),
        _given(section, "K_q", "kg s/rad", "-7", vehicle["pitch_damping"]),
        _given(section, "J_2", "kg m²", "12.3", vehicle["pitch_inertia"]),
        _given(section, "m_1", "kg", "84.7", vehicle["mass_forward"]),
        _given(section, "m_3", "kg", "84.7", vehicle["mass_normal"]),
        _given(section, "net mass m_0 (G = 7 N with g = 10 m/s²)", "kg", "0.7", EXAMPLE / PAPER_GRAVITY),
        _given(section, "thrust T_e", "N", "7", EXAMPLE),
    ]


def curves(vehicle: Vehicle) -> list[Claim]:
    """Return what Section 4 reads off Figs. 4 to 7: the fastest flights, gliding and with 7 N of thrust."""
    rows = []
    for mode, thrust, speed_figure, angle_figure, alpha, gamma in (
        ("gliding", 0.0, "Fig. 4", "Fig. 5", "-1.8", "35"),
        ("hybrid", EXAMPLE, "Fig. 6", "Fig. 7", "-0.9", "20"),
    ):
        tops = [Fastest.of(vehicle, thrust, signs) for signs in SIGNS]
        what = f"at the greatest horizontal speed, {mode}"
        first, second = (top.best for top in tops)
        rows += [
            Claim(
                speed_figure, f"angle of attack {what}", "°", alpha, first[0], second[0], span=tops[0].span(0)
            ),
            Claim(angle_figure, f"path angle {what}", "°", gamma, first[1], second[1], span=tops[0].span(1)),
        ]  # fmt: skip
        if thrust:
            pitch = (first[0] + first[1], second[0] + second[1])
            rows.append(
                Claim(
                    "Section 4", f"target pitch {what}", "°", "20", *pitch, (Reading("the path angle", first[1]),),
                    span=tops[0].span(2),
                )
            )  # fmt: skip
            rows.append(
                Claim("Fig. 6", "angle of attack at the greatest speed, hybrid", "°", "0", tops[0].top, tops[1].top)
            )
    return rows


def example(vehicle: Vehicle) -> list[Claim]:
    """Return the numbers of the example of Section 4, T = G = 7 N: steady flight, its range, the propeller speed."""
    where = "Section 4"
    alpha, _ = free_angle_of_attack(vehicle)
    states = [steady_state(vehicle, EXAMPLE, alpha, thrust=EXAMPLE, signs=signs) for signs in SIGNS]
    spans = [stable_range(vehicle, EXAMPLE, alpha, EXAMPLE, signs=signs) for signs in SIGNS]
    speed = _pair(*(state.speed for state in states))
    lower = _pair(*(span.speed_lower for span in spans))
    upper = _pair(*(span.speed_upper for span in spans))
    bound = _pair(*(span.thrust_bound for span in spans))
    turns = Pair(*(propeller_rpm(vehicle, EXAMPLE, v) for v in speed))
    interior = "with physical signs the infimum has no interior minimum within |α| ≤ 0.2 rad"
    return [
        Claim(where, "propeller speed for T_e = 7 N", "rpm", "1391", *turns, remark="D_0 = 0.080 m, n in rev/s in (8)"),
        Claim(where, "V_e, (21)", "m/s", "1.3694", *speed, remark="with the sign of B in (21) as derived"),
        Claim(where, "γ_e, (22)", "rad", "1.339", *_pair(*(state.path_angle for state in states)), slip="1.333"),
        Claim(where, "K'_De, (26)", "kg/m", "3.6272", *_pair(*(span.drag_margin for span in spans))),
        Claim(where, "lower bound of V, (27)", "m/s", "0.9754", *lower),
        Claim(where, "bound of T_e, (28)", "N", "7.5732", *bound, remark=f"d and l not squared; {interior}"),
        Claim(where, "V_max, at that bound", "m/s", "1.3968", *upper),
        Claim(where, "lower bound of V, |V̄| ≤ 0.2", "m/s", "1.0955", *_times(speed, 0.8)),
        Claim(where, "upper bound of V, |V̄| ≤ 0.2", "m/s", "1.6433", *_times(speed, 1.2)),
    ]


def trials(vehicle: Vehicle) -> list[Claim]:
    """Return the numbers of Section 5: what was measured, and the theory beside it."""
    where = "Section 5"
    rows = [
        _measured(where, "duration of the gliding trial", "d", "21"),
        _measured(where, "profiles of the gliding trial", "1", "219"),
        _measured(where, "depth of the gliding trial", "m", "975"),
        _measured(where, "voyage of the gliding trial", "km", "626"),
        *(_measured(f"{where}, Danjiangkou", *row) for row in DANJIANGKOU_SETTINGS),
        *(_measured(f"{where}, South China Sea", *row) for row in SOUTH_CHINA_SEA_SETTINGS),
        *_powered(vehicle, DANJIANGKOU, ("0.7979", "76.91", "0.5530", "0.8347", "0.7939", "0.8019", "0", "90")),
        *_powered(vehicle, SOUTH_CHINA_SEA, ("1.3743", "76.14", "0.9825", "1.3968", "1.0994", "1.6492", "31.28", "90")),
    ]
    return rows


def _powered(vehicle: Vehicle, trial: Trial, printed: tuple[str, ...]) -> list[Claim]:
    """Return the numbers of one powered trial, those of the theory printed as `printed`."""
    where = f"Section 5, {trial.name.split(',')[0]}"
    force, thrust = trial.net_buoyancy, FITTED_THRUST[trial]
    alpha, _ = free_angle_of_attack(vehicle)
    states = [steady_state(vehicle, force, alpha, thrust=thrust, signs=signs) for signs in SIGNS]
    fitted = [steady_state(vehicle, force, FITTED_ALPHA, thrust=thrust, signs=signs) for signs in SIGNS]
    ranges = [stable_range(vehicle, force, alpha, thrust, signs=signs) for signs in SIGNS]
    turning = steady_state(vehicle, force, alpha, propeller_speed=trial.theory_rpm / 60.0, signs="paper")
    speed = _pair(*(state.speed for state in states))
    pitch = _degrees(*(state.pitch for state in states))
    path = _degrees(*(state.path_angle for state in fitted))
    low, high = (Pair(*(min(90.0, value + math.degrees(side)) for value in pitch)) for side in (-0.1, 0.1))
    narrow = "V_e (1 ± 0.005), not |V̄| ≤ 0.2,"
    wide = f"|γ̄| ≤ π/4 about γ_e = {path.paper:.2f}° (α_e = {FITTED_ALPHA}), not |γ̄| ≤ 0.1"
    both = f"α_e = {FITTED_ALPHA} rad, which fits both powered trials (-K_M0/K_M is {alpha:.7f}),"
    rpm = (
        f"T = {thrust} N, not printed, gives this and (27); {trial.theory_rpm:.0f} rpm at D_0 = 0.080 m gives "
        f"{float(turning.thrust):.4f} N and {float(turning.speed):.4f} m/s"
    )
    reach = [speed.paper * factor for factor in (0.995, 1.005)]
    held = held_speed(vehicle, trial)
    return [
        _measured(where, "net buoyancy", "N", f"{force:g}"),
        _measured(where, "propeller speed", "rpm", f"{trial.rpm:.0f}"),
        _measured(where, "mean pitch", "°", f"{trial.pitch_deg:g}", pitch),
        _measured(
            where, "mean speed", "m/s", f"{trial.speed:g}", Pair(speed.paper, held),
            "paper signs: the paper's theory, pitch free; physical signs: pitch held at the measured value",
        ),
        Claim(where, "V_e", "m/s", printed[0], *speed, remark=rpm),
        Claim(
            where, "θ_e", "°", printed[1], *pitch,
            (Reading(both, _degrees(*(state.pitch for state in fitted)).paper),),
        ),
        Claim(where, "lower bound of V, (27)", "m/s", printed[2], *_pair(*(span.speed_lower for span in ranges))),
        Claim(where, "upper bound of V, (28)", "m/s", printed[3], *_pair(*(span.speed_upper for span in ranges))),
        Claim(
            where, "lower bound of V, |V̄| ≤ 0.2", "m/s", printed[4], *_times(speed, 0.8), (Reading(narrow, reach[0]),)
        ),
        Claim(
            where, "upper bound of V, |V̄| ≤ 0.2", "m/s", printed[5], *_times(speed, 1.2), (Reading(narrow, reach[1]),)
        ),
        Claim(
            where, "lower bound of the pitch, |γ̄| ≤ 0.1", "°", printed[6], *low,
            (Reading(wide, path.paper - 45.0),),
        ),
        Claim(
            where, "upper bound of the pitch, |γ̄| ≤ 0.1", "°", printed[7], *high,
            (Reading(f"{wide} cut at 90°", min(90.0, path.paper + 45.0)),),
        ),
    ]  # fmt: skip


class Fastest(NamedTuple):
    """The flights of one thrust that climb, by angle of attack: α, γ, θ in degrees, horizontal and total speed."""

    angles: np.ndarray
    horizontal: np.ndarray
    speed: np.ndarray

    @classmethod
    def of(cls, vehicle: Vehicle, thrust: float, signs: Signs) -> Fastest:
        """Return the climbing flights with G = 7 N between α = -4° and 0°, on a grid of 1/2000 of a degree."""
        alpha = np.radians(np.linspace(-4.0, 0.0, 8001))
        state: Steady = steady_state(vehicle, EXAMPLE, alpha, thrust=thrust, signs=signs)
        angles = np.degrees(np.column_stack([alpha, state.path_angle, state.pitch]))
        return cls(angles, np.nan_to_num(state.speed * np.cos(state.path_angle)), np.nan_to_num(state.speed))

    @property
    def best(self) -> tuple[float, float]:
        """Angle of attack and path angle of the greatest horizontal speed, degrees."""
        alpha, gamma, _ = self.angles[np.argmax(self.horizontal)]
        return float(alpha), float(gamma)

    @property
    def top(self) -> float:
        """Angle of attack of the greatest speed, degrees."""
        return float(self.angles[np.argmax(self.speed), 0])

    def span(self, column: int) -> tuple[float, float]:
        """Return where the horizontal speed is within `FLAT` of its greatest: 0 by α, 1 by γ, 2 by θ, degrees."""
        flat = self.angles[self.horizontal >= (1.0 - FLAT) * self.horizontal.max(), column]
        return float(flat.min()), float(flat.max())


def propeller_rpm(vehicle: Vehicle, thrust: float, speed: float) -> float:
    """Return the propeller speed, rev/min, that gives a thrust [N] at a speed [m/s]: the root of (8) with (15)."""
    diameter, density = vehicle["propeller_diameter"], vehicle["reference_density"]
    a = vehicle["thrust_static"] * density * diameter**4
    b = vehicle["thrust_slope"] * density * diameter**3 * speed
    return 60.0 * (-b + math.sqrt(b**2 + 4.0 * a * thrust)) / (2.0 * a)


def _given(where: str, quantity: str, unit: str, printed: str, used: float) -> Claim:
    """Return the row of a number that the paper starts from, beside the one used here."""
    return Claim(where, quantity, unit, printed, used, used, kind="input")


def _measured(where: str, quantity: str, unit: str, printed: str, theory: Pair = NOTHING, remark: str = "") -> Claim:
    """Return the row of a number that was set or measured at sea, beside what theory has for it, if anything."""
    return Claim(where, quantity, unit, printed, *theory, kind="measured", remark=remark)


def _pair(*values: np.ndarray) -> Pair:
    return Pair(*(float(value) for value in values))


def _degrees(*values: np.ndarray) -> Pair:
    return Pair(*(math.degrees(float(value)) for value in values))


def _times(pair: Pair, factor: float) -> Pair:
    return Pair(pair.paper * factor, pair.physical * factor)

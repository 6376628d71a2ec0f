"""The region of attraction, Fig. 10 of Niu et al. (2017), and which Lyapunov functions certify a part of it.

Source: doi:10.1007/s13344-017-0061-y. Physical signs, thrust held, G = 7 N, gliding or with T = 7 N.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D

from pipeline.model.attraction import CONVERGED, attraction
from pipeline.model.lyapunov import Certificate, certificate, composite, inertia_limit, quadratic
from pipeline.model.modes import Equilibrium, equilibrium
from pipeline.paper.numbers import EXAMPLE
from pipeline.report.figures.drawing import (
    FAINT,
    HELD,
    INK,
    MEASURED,
    PAPER,
    WIDTH,
    Array,
    Picture,
    canvas,
    render,
    style,
)
from pipeline.vehicle import Vehicle

MODES: dict[str, float | None] = {"gliding": None, "hybrid": EXAMPLE}
#: Diagonal Q, in V̄, γ̄, ᾱ, q̄, found by trial: its sets come within 2 % of semi-axes known from an independent
#: computation, (.242, .165, .269) gliding and (.320, .153, .156) hybrid, whose own Q is not known.
DAMPING = {"gliding": (1.0, 1.0, 10.0, 1000.0), "hybrid": (1.0, 1.0, 100.0, 1000.0)}
#: Deviations V̄ and ᾱ [rad] of the map, and points along each side.
WIDE_SPEED, WIDE_ANGLE, POINTS = (-0.95, 1.5), 0.5, 80


def regions(vehicle: Vehicle) -> list[dict[str, Any]]:
    """Return, by mode, whether (32) and a quadratic function certify a region of attraction, and its size."""
    rows = []
    for mode, thrust in MODES.items():
        state = equilibrium(vehicle, EXAMPLE, thrust=thrust)
        found = certificate(quadratic(state))
        plain = certificate(quadratic(state, damping=np.diag(DAMPING[mode])))
        printed, corrected = composite(state, formulas="printed"), composite(state, formulas="corrected")
        rows.append(
            {
                "mode": mode,
                "printed_32_holds": printed.holds,
                "printed_32_reason": printed.reason,
                "corrected_32_holds": corrected.holds,
                "corrected_32_reason": corrected.reason,
                "corrected_32_holds_below_inertia_kg_m2": inertia_limit(vehicle, EXAMPLE, thrust=thrust),
                "quadratic_holds": found.holds,
                "quadratic_semi_axes": [float(axis) for axis in found.semi_axes[:3]],
                "diagonal_damping": list(DAMPING[mode]),
                "diagonal_semi_axes": [float(axis) for axis in plain.semi_axes[:3]],
            }
        )
    return rows


def ordering(rows: list[dict[str, Any]]) -> str:
    """Return whether the claim of the paper's conclusion (4) holds for the certified regions."""
    gliding, hybrid = (row["quadratic_semi_axes"] for row in rows)
    speed, angle = gliding[0] > hybrid[0], gliding[2] < hybrid[2]
    said = "Conclusion (4) has the region wider in V̄ when gliding and wider in ᾱ when driven"
    if speed and angle:
        return f"{said}; so it is here."
    wrong = " and ".join(name for name, holds in (("V̄", speed), ("ᾱ", angle)) if not holds)
    return f"{said}; the certified regions do not reproduce it in {wrong}."


def figure(vehicle: Vehicle) -> Picture:
    """Return Fig. 10: which starts return to steady flight, and the part that a quadratic function certifies."""
    with style():
        drawing = canvas(WIDTH, 4.2)
        for axes, (mode, thrust) in zip(drawing.subplots(1, 2, sharey=True), MODES.items(), strict=True):
            state = equilibrium(vehicle, EXAMPLE, thrust=thrust)
            found = certificate(quadratic(state))
            _region(axes, state, found)
            axes.set(title=mode, xlabel="V̄ = V/V_e − 1")
            if thrust is None:
                axes.set_ylabel("ᾱ = α − α_e, rad")
        keys = [
            Line2D([], [], marker="s", linestyle="", color=MEASURED, alpha=0.4, label="returns (simulated, 300 s)"),
            Line2D([], [], marker="s", linestyle="", color=FAINT, label="does not, or leaves |α| ≤ 0.5 rad"),
            Line2D([], [], color=HELD, label="certified by a quadratic function"),
            Line2D([], [], color=INK, linestyle=":", label="|V̄| ≤ 0.2, |ᾱ| ≤ 0.01 of the paper"),
        ]
        drawing.legend(handles=keys, loc="outside lower center", ncols=2)
        svg = render(drawing, "fig10")
    return Picture(
        "fig10",
        svg,
        "Region of attraction against deviations of speed and angle of attack, gliding and hybrid: nearly all of it.",
        "Fig. 10: region of attraction for starts with γ̄ = 0.1 rad and q̄ = 0, gliding (a) and hybrid (b). The paper "
        "shows what its certificate would give, had it held; here motions are simulated, and the certified set is cut "
        "at γ̄ = q̄ = 0.",
    )


def _region(axes: Axes, state: Equilibrium, found: Certificate) -> None:
    """Draw the simulated region as an image and the certified set as an ellipse."""
    speed = np.linspace(*WIDE_SPEED, POINTS)
    angle = np.linspace(-WIDE_ANGLE, WIDE_ANGLE, POINTS)
    ends = attraction(state, speed=speed[None, :], path_angle=0.1, angle_of_attack=angle[:, None])
    axes.pcolormesh(
        speed, angle, ends.verdict == CONVERGED, cmap=ListedColormap([FAINT, MEASURED]), vmin=0, vmax=1, alpha=0.4,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    if found.holds:
        ellipse = _ellipse(found)
        axes.plot(ellipse[0], ellipse[1], color=HELD)
    axes.plot([-0.2, 0.2, 0.2, -0.2, -0.2], [-0.01, -0.01, 0.01, 0.01, -0.01], color=INK, linestyle=":")
    axes.plot(0.0, 0.0, "+", color=PAPER)
    axes.grid(visible=False)


def _ellipse(found: Certificate) -> Array:
    """Return V̄ and ᾱ of the section of the certified set with γ̄ = q̄ = 0, shape (2, n)."""
    form = found.function.matrix[np.ix_([0, 2], [0, 2])]
    turn = np.linspace(0.0, 2.0 * math.pi, 181)
    circle = np.vstack([np.cos(turn), np.sin(turn)])
    return math.sqrt(found.level) * np.linalg.solve(np.linalg.cholesky(form).T, circle)

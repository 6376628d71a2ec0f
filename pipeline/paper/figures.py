"""Figures 4 to 9 of Niu et al. (2017) drawn again, in the signs of the paper and in physical signs.

Source: doi:10.1007/s13344-017-0061-y. Climbing flight has α < 0 and G > 0; diving flight is its mirror image and is
drawn at α > 0 with G < 0, as (22) has it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from pipeline.model.steady import Signs, Steady, steady_state
from pipeline.paper.numbers import EXAMPLE, Fastest
from pipeline.report.figures.drawing import FREE, INK, MEASURED, VOID, WIDTH, Array, Picture, canvas, render, style
from pipeline.vehicle import Vehicle

#: Colour and stroke of each convention: where they agree, both are seen.
LOOKS: dict[Signs, dict[str, Any]] = {
    "physical": {"color": MEASURED, "linestyle": "-", "linewidth": 1.6},
    "paper": {"color": FREE, "linestyle": "--", "linewidth": 1.4},
}
NAMES: dict[Signs, str] = {"physical": "physical signs", "paper": "signs of the paper"}
STROKES = ("-", "--", "-.", ":")
WIDEST = 12.0
HEIGHT = 3.4


def figures(vehicle: Vehicle) -> dict[str, Picture]:
    """Return Figs. 4 to 9 by name."""
    return {
        "fig4": speed_of(vehicle, 0.0, "fig4"),
        "fig5": angles_of(vehicle, 0.0, "fig5"),
        "fig6": speed_of(vehicle, EXAMPLE, "fig6"),
        "fig7": angles_of(vehicle, EXAMPLE, "fig7"),
        "fig8": fastest_angle(vehicle),
        "fig9": family(vehicle),
    }


def speed_of(vehicle: Vehicle, thrust: float, name: str) -> Picture:
    """Return Fig. 4 (gliding) or Fig. 6 (with thrust): steady speed against the steady angle of attack."""
    mode = _mode(thrust)

    def draw(axes: Axes) -> None:
        for signs, look in LOOKS.items():
            angle, state = flights(vehicle, EXAMPLE, thrust, signs)
            axes.plot(angle, state.speed, label=f"V, {NAMES[signs]}", **look)
            axes.plot(angle, state.speed * np.cos(state.path_angle), alpha=0.55, label="its horizontal part", **look)
        if thrust:
            least = math.sqrt(thrust / vehicle["parasite_drag"])
            axes.axhline(least, color=INK, linestyle=":", label=f"(27): {least:.4f} m/s")
        axes.set(xlabel="steady angle of attack α_e, °", ylabel="speed, m/s", xlim=(-WIDEST, WIDEST), ylim=(0.0, None))
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))

    return _picture(
        name, draw, f"Steady speed against angle of attack, {mode}, symmetric about a peak at zero.",
        f"Fig. {name[3:]}: steady speed, {mode}, G = 7 N. "
        + ("Above the dotted line (27) holds; the signs differ by less than the width of a line at small angles."
           if thrust else "Without thrust both conventions are the same."),
    )  # fmt: skip


def angles_of(vehicle: Vehicle, thrust: float, name: str) -> Picture:
    """Return Fig. 5 (gliding) or Fig. 7 (with thrust): path angle and pitch against the steady angle of attack."""
    mode = _mode(thrust)

    def draw(axes: Axes) -> None:
        for signs, look in LOOKS.items():
            angle, state = flights(vehicle, EXAMPLE, thrust, signs)
            axes.plot(angle, np.degrees(state.path_angle), label=f"γ, {NAMES[signs]}", **look)
            axes.plot(angle, np.degrees(state.pitch), alpha=0.55, label=f"θ, {NAMES[signs]}", **look)
        axes.set(xlabel="steady angle of attack α_e, °", ylabel="angle, °", xlim=(-WIDEST, WIDEST), ylim=(-90, 90))
        axes.set_yticks(range(-90, 91, 30))
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))

    return _picture(
        name, draw, f"Path angle and pitch against angle of attack, {mode}: climbing left, diving right of zero.",
        f"Fig. {name[3:]}: path angle γ and pitch θ = γ + α, {mode}, G = 7 N up (α < 0) or down (α > 0). "
        + ("Beyond about 1.2° K'_De is negative and (27) does not hold: the light vehicle is driven down; the paper "
           "calls that impossible." if thrust else "Without thrust both conventions are the same."),
    )  # fmt: skip


def fastest_angle(vehicle: Vehicle) -> Picture:
    """Return Fig. 8: angle of attack of the greatest horizontal speed against thrust."""
    thrusts = np.linspace(0.0, EXAMPLE, 29)

    def draw(axes: Axes) -> None:
        for signs, look in LOOKS.items():
            best = np.array([Fastest.of(vehicle, float(thrust), signs).best for thrust in thrusts])
            axes.plot(thrusts, best[:, 0], label=NAMES[signs], **look)
        axes.plot([0.0, EXAMPLE], [-1.8, -0.9], "o", color=INK, markersize=5.0, label="as printed")
        axes.set(xlabel="propeller thrust T_e, N", ylabel="steady angle of attack, °")
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))

    return _picture(
        "fig8", draw, "Angle of attack of the fastest flight against thrust: it falls in size as thrust grows.",
        "Fig. 8: steady angle of attack against thrust, G = 7 N. The paper does not say which of the many steady "
        "flights at a thrust is meant; here it is the one of greatest horizontal speed, of which it gives numbers.",
    )  # fmt: skip


def family(vehicle: Vehicle) -> Picture:
    """Return Fig. 9: steady speed against angle of attack, for several net buoyancies and thrusts."""
    with style():
        figure = canvas(WIDTH, 4.4)
        left, right = figure.subplots(1, 2, sharey=True)
        for stroke, force in zip(STROKES, (7.0, 5.0, 3.0, 1.0), strict=True):
            for thrust, colour in ((0.0, MEASURED), (force, FREE)):
                angle, state = flights(vehicle, force, thrust, "physical")
                label = f"G = {force:g} N" + (", T = G" if thrust else "")
                left.plot(angle, state.speed, color=colour, linestyle=stroke, label=label)
        for stroke, thrust in zip(STROKES, (7.0, 5.0, 3.0, 0.0), strict=True):
            for signs in LOOKS:
                angle, state = flights(vehicle, EXAMPLE, thrust, signs)
                colour = LOOKS[signs]["color"]
                right.plot(
                    angle, state.speed, color=colour, linestyle=stroke, label=f"T = {thrust:g} N, {NAMES[signs]}"
                )
        left.set(title="physical signs", xlabel="α_e, °", ylabel="steady speed V_e, m/s")
        right.set(title="G = 7 N", xlabel="α_e, °")
        for axes in (left, right):
            axes.set(xlim=(-WIDEST, WIDEST), ylim=(0.0, None))
            axes.axvline(0.0, color=VOID, linewidth=0.6)
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2, fontsize=8.0)
        svg = render(figure, "fig9")
    return Picture(
        "fig9", svg, "Steady speed against angle of attack for several net buoyancies and thrusts.",
        "Fig. 9: steady speed against angle of attack, for net buoyancy (left, gliding and with a thrust of its "
        "size) and for thrust (right). The paper draws it as surfaces.",
    )  # fmt: skip


def flights(vehicle: Vehicle, force: float, thrust: float, signs: Signs) -> tuple[Array, Steady]:
    """Return angles of attack, degrees, and steady flight at them: climbing where α < 0, diving where α > 0."""
    angle = np.concatenate([np.linspace(-WIDEST, -0.01, 600), [np.nan], np.linspace(0.01, WIDEST, 600)])
    state = steady_state(vehicle, np.where(angle < 0.0, force, -force), np.radians(angle), thrust=thrust, signs=signs)
    return angle, state


def _mode(thrust: float) -> str:
    return f"hybrid, T = {thrust:g} N" if thrust else "gliding, T = 0"


def _picture(name: str, draw: Callable[[Axes], None], alt: str, caption: str) -> Picture:
    with style():
        figure = canvas(WIDTH, HEIGHT)
        draw(figure.subplots())
        return Picture(name, render(figure, name), alt, caption)

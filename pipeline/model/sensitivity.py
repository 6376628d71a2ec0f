"""How steady flight answers to each coefficient and input: the implicit function theorem, once for every trim.

Unknowns (V, γ, α) obey the balances along and across the path (see `balance`) and one equation that says what is
held: the pitch, the angle of attack -K_M0/K_M, or the pitching moment.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.model.forces import GRAVITY, disk_of, propeller_of, thrust_by_power
from pipeline.vehicle import Vehicle

Array = NDArray[np.float64]
Trim = Literal["pitch", "battery", "fixed_alpha", "alpha"]


class Slope(NamedTuple):
    """Derivatives of V, γ and α with respect to one parameter."""

    speed: Array
    path_angle: Array
    angle_of_attack: Array

    @property
    def pitch(self) -> Array:
        """Derivative of θ = γ + α."""
        return self.path_angle + self.angle_of_attack


def sensitivities(
    trim: Trim,
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    speed: ArrayLike,
    path_angle: ArrayLike,
    angle_of_attack: ArrayLike,
    *,
    propeller_speed: ArrayLike | None = None,
    propeller_power: ArrayLike | None = None,
    density: ArrayLike | None = None,
    battery_position: ArrayLike | None = None,
    moment_cos: ArrayLike | None = None,
    thrust: ArrayLike | None = None,
    sign: float = 1.0,
    every: bool = False,
) -> dict[str, Slope]:
    """Return ∂(V, γ, α)/∂p at a known equilibrium for every parameter p that the trim depends on.

    Always: ``parasite_drag``, ``lift_slope``, ``lift_at_zero``, ``induced_drag``, ``thrust_scale`` (a factor on
    thrust, at 1), ``net_buoyancy``, ``propeller_speed``; ``propeller_power`` if it is given. Held pitch: ``pitch``.
    Held α_e = -K_M0/K_M: ``moment_at_zero``, ``moment_slope``; any other: ``angle_of_attack``. Moment balance: the
    first two, ``mass_forward``, ``mass_normal``, ``righting_moment``, ``battery_mass``, ``battery_neutral_position``,
    ``battery_position``, or ``moment_cos`` in place of the last three. With `every` also ``drag_exponent``,
    ``thrust_static``, ``thrust_slope``, ``propeller_diameter``, ``reference_density`` and, where they are given,
    ``density`` and ``thrust``: all coefficients singly, where ``thrust_scale`` lumps; not for thrust by power.

    Parameters
    ----------
    trim
        What is held: the pitch, the pitching moment, α_e = -K_M0/K_M, or any α.
    vehicle
        Vehicle of the equilibrium.
    net_buoyancy, speed, path_angle, angle_of_attack
        The equilibrium: G [N], V [m/s], γ, α [rad]; arrays that broadcast, NaN where there is none.
    propeller_speed, propeller_power, density, battery_position
        Inputs in rev/s, W, kg/m³ and m, as for `steady.trim_at_moment`.
    moment_cos, thrust
        M_c [N m] in place of the battery's; constant thrust [N] in place of the propeller's.
    sign
        +1 physical signs, -1 as printed.
    every
        Whether to tell of every coefficient and input.
    """
    reference = vehicle["reference_density"]
    given: tuple[ArrayLike, ...] = (
        net_buoyancy,
        speed,
        path_angle,
        angle_of_attack,
        0.0 if propeller_speed is None else propeller_speed,
        0.0 if propeller_power is None else propeller_power,
        reference if density is None else density,
        0.0 if battery_position is None else battery_position,
        0.0 if moment_cos is None else moment_cos,
        0.0 if thrust is None else thrust,
    )
    g, v, gamma, alpha, n, watt, rho, position, lean, constant = np.broadcast_arrays(
        *(np.asarray(x, dtype=np.float64) for x in given)
    )
    polar, law, disk = vehicle.polar, propeller_of(vehicle), disk_of(vehicle)
    ratio = rho / reference
    power = 2.0 + polar.drag_exponent
    pulled, pulled_v, exponent = thrust_by_power(disk, rho, watt, v)
    sin_a, cos_a, sin_g, cos_g = np.sin(alpha), np.cos(alpha), np.sin(gamma), np.cos(gamma)
    flow = rho * law.diameter**3
    turned = flow * n * (law.thrust_static * law.diameter * n + law.thrust_slope * v) + pulled
    push = turned + constant
    thrust_v = flow * n * law.thrust_slope + pulled_v
    thrust_n = flow * (2.0 * law.thrust_static * law.diameter * n + law.thrust_slope * v) * (n != 0.0)
    zero, one = np.zeros_like(v), np.ones_like(v)

    along = [
        ratio * (power * polar.parasite_drag * v ** (power - 1.0) + 2.0 * polar.induced_drag * alpha**2 * v)
        - thrust_v * cos_a,
        -g * cos_g,
        2.0 * ratio * polar.induced_drag * alpha * v**2 + push * sin_a,
    ]
    across = [
        2.0 * ratio * (polar.lift_at_zero + polar.lift_slope * alpha) * v + sign * thrust_v * sin_a,
        -g * sin_g,
        ratio * polar.lift_slope * v**2 + sign * push * cos_a,
    ]
    causes: dict[str, tuple[Array, Array, Array]] = {
        "parasite_drag": (ratio * v**power, zero, zero),
        "induced_drag": (ratio * alpha**2 * v**2, zero, zero),
        "lift_at_zero": (zero, ratio * v**2, zero),
        "lift_slope": (zero, ratio * alpha * v**2, zero),
        "thrust_scale": (-turned * cos_a, sign * turned * sin_a, zero),
        "net_buoyancy": (-sin_g, cos_g, zero),
        "propeller_speed": (-thrust_n * cos_a, sign * thrust_n * sin_a, zero),
    }
    if propeller_power is not None:
        by_power = np.divide(exponent * pulled, watt, out=np.zeros_like(pulled), where=watt > 0.0)
        causes["propeller_power"] = (-by_power * cos_a, sign * by_power * sin_a, zero)
    flow_moment = ratio * (vehicle["moment_at_zero"] + vehicle["moment_slope"] * alpha)
    if trim == "pitch":
        held = [zero, one, one]
        causes["pitch"] = (zero, zero, -one)
    elif trim == "alpha":
        held = [zero, zero, one]
        causes["angle_of_attack"] = (zero, zero, -one)
    elif trim == "fixed_alpha":
        held = [zero, zero, one]
        slope = vehicle["moment_slope"]
        causes["moment_at_zero"] = (zero, zero, one / slope)
        causes["moment_slope"] = (zero, zero, -one * vehicle["moment_at_zero"] / slope**2)
    else:
        theta = gamma + alpha
        munk_mass = vehicle["mass_normal"] - vehicle["mass_forward"]
        weight = vehicle["battery_mass"] * GRAVITY
        offset = position - vehicle["battery_neutral_position"]
        lean = -weight * offset if moment_cos is None else lean
        turn = -lean * np.sin(theta) + vehicle["righting_moment"] * np.cos(theta)
        roll = (ratio * vehicle["moment_slope"] + munk_mass * np.cos(2.0 * alpha)) * v**2
        held = [2.0 * (flow_moment + munk_mass * sin_a * cos_a) * v, turn, roll + turn]
        causes["moment_at_zero"] = (zero, zero, ratio * v**2)
        causes["moment_slope"] = (zero, zero, ratio * alpha * v**2)
        causes["mass_normal"] = (zero, zero, sin_a * cos_a * v**2)
        causes["mass_forward"] = (zero, zero, -sin_a * cos_a * v**2)
        causes["righting_moment"] = (zero, zero, np.sin(theta))
        if moment_cos is None:
            causes["battery_mass"] = (zero, zero, -GRAVITY * offset * np.cos(theta))
            causes["battery_neutral_position"] = (zero, zero, weight * np.cos(theta))
            causes["battery_position"] = (zero, zero, -weight * np.cos(theta))
        else:
            causes["moment_cos"] = (zero, zero, np.cos(theta))
    if every:
        pushes = {
            "thrust_static": flow * law.diameter * n**2,
            "thrust_slope": flow * n * v,
            "propeller_diameter": rho
            * n
            * law.diameter**2
            * (4.0 * law.thrust_static * law.diameter * n + 3.0 * law.thrust_slope * v),
        }
        if thrust is not None:
            pushes["thrust"] = one
        causes |= {name: (-push_p * cos_a, sign * push_p * sin_a, zero) for name, push_p in pushes.items()}
        causes["drag_exponent"] = (ratio * polar.parasite_drag * v**power * np.log(v), zero, zero)
        braking = ratio * (polar.parasite_drag * v**power + polar.induced_drag * alpha**2 * v**2)
        lifting = ratio * (polar.lift_at_zero + polar.lift_slope * alpha) * v**2
        turning = flow_moment * v**2 if trim == "battery" else zero
        water = (-turned * cos_a / rho, sign * turned * sin_a / rho, zero)
        if density is None:
            causes["reference_density"] = water
        else:
            causes["reference_density"] = (-braking / reference, -lifting / reference, -turning / reference)
            causes["density"] = (water[0] + braking / rho, water[1] + lifting / rho, turning / rho)

    matrix = np.stack([np.stack(np.broadcast_arrays(*row), axis=-1) for row in (along, across, held)], axis=-2)
    right = np.stack([np.stack(np.broadcast_arrays(*cause), axis=-1) for cause in causes.values()], axis=-1)
    answer = np.full(right.shape, np.nan)
    regular = np.isfinite(matrix).all(axis=(-2, -1))
    regular &= np.linalg.det(np.where(regular[..., None, None], matrix, 0.0)) != 0.0
    answer[regular] = -np.linalg.solve(matrix[regular], right[regular])
    return {name: Slope(*np.moveaxis(answer[..., k], -1, 0)) for k, name in enumerate(causes)}

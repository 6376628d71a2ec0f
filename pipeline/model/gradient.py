"""Derivatives of everything that `Steady` holds with respect to every coefficient and input, for the three trims.

By the implicit function theorem for V, γ and α (`sensitivity`), and by the chain rule for thrust, advance ratio and
required moment. Equations of Niu et al. (2017), doi:10.1007/s13344-017-0061-y: (4), (7), (8), (15), (21), (22).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.model.forces import propeller_of
from pipeline.model.sensitivity import Trim, sensitivities
from pipeline.model.steady import Signs, Steady, steady_state, trim_at_moment, trim_at_pitch
from pipeline.vehicle import Vehicle

Array = NDArray[np.float64]


class Gradient(NamedTuple):
    """Derivatives of the quantities of `Steady` with respect to one parameter, per its unit; arrays of one shape."""

    speed: Array
    path_angle: Array
    angle_of_attack: Array
    pitch: Array
    thrust: Array
    advance_ratio: Array
    required_moment: Array


def gradients_of_steady_state(
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    angle_of_attack: ArrayLike,
    *,
    thrust: ArrayLike | None = None,
    propeller_speed: ArrayLike | None = None,
    density: ArrayLike | None = None,
    signs: Signs = "physical",
) -> dict[str, Gradient]:
    """Return the derivatives of `steady_state`, by the name of the coefficient or input; arguments as there.

    A coefficient that is not named has no effect. ``thrust_scale`` is a factor on the propeller's thrust, at 1.
    NaN where there is no steady flight, and of required moment where its coefficients are unknown.

    Raises
    ------
    ValueError
        As for `steady_state`.

    Examples
    --------
    >>> from pipeline.vehicle import load
    >>> float(gradients_of_steady_state(load("petrel-ii"), 7.0, -0.02)["net_buoyancy"].speed.round(4))
    0.059
    """
    state = steady_state(
        vehicle,
        net_buoyancy,
        angle_of_attack,
        thrust=thrust,
        propeller_speed=propeller_speed,
        density=density,
        signs=signs,
    )
    sign = 1.0 if signs == "physical" else -1.0
    return _gradients("alpha", vehicle, state, net_buoyancy, thrust, propeller_speed, density, sign=sign)


def gradients_of_trim_at_pitch(
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    pitch: ArrayLike,
    *,
    thrust: ArrayLike | None = None,
    propeller_speed: ArrayLike | None = None,
    density: ArrayLike | None = None,
) -> dict[str, Gradient]:
    """Return the derivatives of `trim_at_pitch`; arguments and errors as there, the rest as above."""
    state = trim_at_pitch(vehicle, net_buoyancy, pitch, thrust=thrust, propeller_speed=propeller_speed, density=density)
    return _gradients("pitch", vehicle, state, net_buoyancy, thrust, propeller_speed, density)


def gradients_of_trim_at_moment(
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    *,
    battery_position: ArrayLike | None = None,
    moment_cos: ArrayLike | None = None,
    propeller_speed: ArrayLike | None = None,
    density: ArrayLike | None = None,
) -> dict[str, Gradient]:
    """Return the derivatives of `trim_at_moment`; arguments and errors as there, the rest as above."""
    state = trim_at_moment(
        vehicle,
        net_buoyancy,
        battery_position=battery_position,
        moment_cos=moment_cos,
        propeller_speed=propeller_speed,
        density=density,
    )
    return _gradients(
        "battery", vehicle, state, net_buoyancy, None, propeller_speed, density, battery_position, moment_cos
    )


def _gradients(
    trim: Trim,
    vehicle: Vehicle,
    state: Steady,
    net_buoyancy: ArrayLike,
    thrust: ArrayLike | None,
    propeller_speed: ArrayLike | None,
    density: ArrayLike | None,
    battery_position: ArrayLike | None = None,
    moment_cos: ArrayLike | None = None,
    sign: float = 1.0,
) -> dict[str, Gradient]:
    slopes = sensitivities(
        trim,
        vehicle,
        net_buoyancy,
        state.speed,
        state.path_angle,
        state.angle_of_attack,
        propeller_speed=propeller_speed,
        density=density,
        battery_position=battery_position,
        moment_cos=moment_cos,
        thrust=thrust,
        sign=sign,
        every=True,
    )
    v, alpha = state.speed, state.angle_of_attack
    reference = vehicle["reference_density"]
    rho = np.asarray(reference if density is None else density, dtype=np.float64)
    n = np.asarray(0.0 if propeller_speed is None else propeller_speed, dtype=np.float64)
    law, ratio = propeller_of(vehicle), rho / reference
    flow = rho * law.diameter**3
    static, falling = law.thrust_static * law.diameter * n, law.thrust_slope * v
    pushed = flow * n * (static + falling)
    thrust_by = {
        "thrust_scale": pushed,
        "thrust_static": flow * law.diameter * n**2,
        "thrust_slope": flow * n * v,
        "propeller_diameter": rho * law.diameter**2 * n * (4.0 * static + 3.0 * falling),
        "propeller_speed": flow * (2.0 * static + falling) * (n != 0.0),
        "reference_density" if density is None else "density": pushed / rho,
        "thrust": 1.0,
    }
    turning = np.where(n != 0.0, n, np.nan)
    ratio_by = {
        "propeller_speed": -state.advance_ratio / turning,
        "propeller_diameter": -state.advance_ratio / (law.diameter or np.nan),
    }
    munk_mass = vehicle["mass_normal"] - vehicle["mass_forward"]
    lean = np.sin(alpha) * np.cos(alpha)
    flow_moment = ratio * (vehicle["moment_at_zero"] + vehicle["moment_slope"] * alpha)
    moment_by = {
        "moment_at_zero": -ratio * v**2,
        "moment_slope": -ratio * alpha * v**2,
        "mass_normal": -lean * v**2,
        "mass_forward": lean * v**2,
    }
    if density is not None:
        moment_by["reference_density"] = flow_moment * v**2 / reference
        moment_by["density"] = -flow_moment * v**2 / rho
    moment_by_speed = -2.0 * (flow_moment + munk_mass * lean) * v
    moment_by_alpha = -(ratio * vehicle["moment_slope"] + munk_mass * np.cos(2.0 * alpha)) * v**2

    zero = np.where(np.isnan(v), np.nan, 0.0)
    result: dict[str, Gradient] = {}
    for name in dict.fromkeys((*slopes, *moment_by)):
        dv, dgamma, dalpha = slopes.get(name, (zero, zero, zero))
        result[name] = Gradient(
            dv,
            dgamma,
            dalpha,
            dgamma + dalpha,
            flow * n * law.thrust_slope * dv + thrust_by.get(name, 0.0),
            dv / (turning * (law.diameter or np.nan)) + ratio_by.get(name, 0.0),
            moment_by_speed * dv + moment_by_alpha * dalpha + moment_by.get(name, 0.0),
        )
    return result

"""The fastest and the flattest steady flight as functions of net buoyancy and thrust; Section 4 of Niu et al. (2017).

Eqs. (21) and (22), doi:10.1007/s13344-017-0061-y, searched over the angle of attack. Both optima are flat: speed and
path are known far better than the angle of attack that belongs to them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.model.steady import QUANTITIES, Signs, Steady, steady_state
from pipeline.vehicle import Vehicle

Array = NDArray[np.float64]

#: Angle of attack within which the optimum is sought, rad.
LARGEST_ALPHA = 0.2
_POINTS = 401
_ZOOMS = 4


def fastest_flight(
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    *,
    thrust: ArrayLike | None = None,
    propeller_speed: ArrayLike | None = None,
    density: ArrayLike | None = None,
    signs: Signs = "physical",
) -> Steady:
    """Return the steady flight of the largest horizontal speed V cos γ, |α| <= 0.2 rad.

    Parameters
    ----------
    vehicle, net_buoyancy, thrust, propeller_speed, density, signs
        As for `steady_state`; arrays broadcast.

    Raises
    ------
    ValueError
        As for `steady_state`.

    Examples
    --------
    >>> import math
    >>> from pipeline.vehicle import load
    >>> best = fastest_flight(load("petrel-ii"), 7.0)
    >>> round(math.degrees(best.angle_of_attack), 1), round(math.degrees(best.path_angle), 1)
    (-1.7, 36.8)
    """
    return _best(_horizontal_speed, vehicle, net_buoyancy, thrust, propeller_speed, density, signs)


def flattest_flight(
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    *,
    thrust: ArrayLike | None = None,
    propeller_speed: ArrayLike | None = None,
    density: ArrayLike | None = None,
    signs: Signs = "physical",
) -> Steady:
    """Return the steady flight of the flattest path, |α| <= 0.2 rad: best range of a glide, level where thrust allows.

    Without thrust, lift at zero angle of attack and speed exponent it is that of α² = K_D0/K_D. Arguments and errors
    as for `fastest_flight`.
    """
    return _best(_flatness, vehicle, net_buoyancy, thrust, propeller_speed, density, signs)


def _horizontal_speed(flight: Steady) -> Array:
    return flight.speed * np.cos(flight.path_angle)


def _flatness(flight: Steady) -> Array:
    return -np.abs(flight.path_angle)


def _best(
    merit: Callable[[Steady], Array],
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    thrust: ArrayLike | None,
    propeller_speed: ArrayLike | None,
    density: ArrayLike | None,
    signs: Signs,
) -> Steady:
    """Return the flight of the largest merit over α: the best of a grid, then of finer ones about it."""
    g = np.asarray(net_buoyancy, dtype=np.float64)
    others = [
        None if value is None else np.asarray(value, dtype=np.float64) for value in (thrust, propeller_speed, density)
    ]
    shape = np.broadcast_shapes(g.shape, *(value.shape for value in others if value is not None))

    def fly(alpha: Array) -> Steady:
        push, turning, rho = (None if value is None else np.broadcast_to(value, shape)[..., None] for value in others)
        return steady_state(
            vehicle,
            np.broadcast_to(g, shape)[..., None],
            alpha,
            thrust=push,
            propeller_speed=turning,
            density=rho,
            signs=signs,
        )

    centre, width = np.zeros((*shape, 1)), LARGEST_ALPHA
    for _ in range(_ZOOMS):
        offsets = width * np.linspace(-1.0, 1.0, _POINTS)
        alpha = np.clip(centre + offsets, -LARGEST_ALPHA, LARGEST_ALPHA)
        value = merit(fly(alpha))
        index = np.argmax(np.where(np.isnan(value), -np.inf, value), axis=-1)[..., None]
        centre = np.take_along_axis(alpha, index, axis=-1)
        width *= 4.0 / (_POINTS - 1)
    found = fly(centre)
    flight = Steady(**{name: np.asarray(getattr(found, name)[..., 0]) for name in (*QUANTITIES, "reason")})
    beyond = np.isfinite(flight.speed) & (np.abs(centre[..., 0]) >= LARGEST_ALPHA * (1.0 - 1e-9))
    if not beyond.any():
        return flight
    reason = np.where(beyond, f"the optimum lies beyond an angle of attack of {LARGEST_ALPHA:g} rad", flight.reason)
    without = {name: np.where(beyond, np.nan, getattr(flight, name)) for name in QUANTITIES}
    return replace(flight, **without, reason=reason)

"""Flight under schedules of pump, battery and propeller: the motion of Eqs. (1)-(4) over minutes or missions.

Source: Niu et al. (2017), doi:10.1007/s13344-017-0061-y, in physical signs; the water is of one density and at rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from pipeline.model.case import (
    MAX_ANGLE_OF_ATTACK,
    MAX_PROPELLER_SPEED,
    NO_THRUST_LAW,
    SPEED_EXPECTED,
    refuse,
    unusable,
)
from pipeline.model.dynamics import Body, body_of
from pipeline.model.exchange import FLUSHING_BEFORE
from pipeline.model.forces import GRAVITY, propeller_of
from pipeline.model.motion import INPUTS, STATES, Ballast, advance, rates
from pipeline.vehicle import Polar, Propeller, Vehicle

Array = NDArray[np.float64]
Method = Literal["fixed", "implicit"]

#: Longest step of the fixed-step integrator, s, unless told otherwise.
STEP = 0.25
_Craft = tuple[Body, Polar, Propeller, Ballast]
_FLYING, _LOST, _STALLED, _TUMBLED = 0, 1, 2, 3
_ENDS = {
    _LOST: "the motion is no longer a number; a shorter step?",
    _STALLED: "the speed fell to zero, where the angles have no meaning",
    _TUMBLED: "the vehicle tumbled: its pitch left ±180 degrees",
}


@dataclass(frozen=True)
class Inputs:
    """Schedules of the motors: linear between `times`, constant before the first and after the last.

    Attributes
    ----------
    times
        Increasing times of the schedules, s, shape (k,).
    net_buoyancy
        What the pump makes of the net buoyancy force G, N, up positive, shape (k,) or a number.
    battery_position
        r_P1, m, forward positive, shape (k,) or a number; the neutral position if left out.
    propeller_speed
        n, rev/s, shape (k,) or a number.
    density
        In-situ density, kg/m³; the vehicle's reference density if left out.

    Raises
    ------
    ValueError
        If times do not increase, a value is not finite, lengths differ, a density is not positive, or a propeller
        speed looks like rpm.
    """

    times: ArrayLike
    net_buoyancy: ArrayLike
    battery_position: ArrayLike | None = None
    propeller_speed: ArrayLike = 0.0
    density: float | None = None

    def __post_init__(self) -> None:
        """Turn the schedules into arrays of one shape, and refuse what cannot be."""
        times = np.atleast_1d(np.asarray(self.times, dtype=np.float64))
        _increasing("inputs: times", times)
        object.__setattr__(self, "times", times)
        for name in ("net_buoyancy", "battery_position", "propeller_speed"):
            value = getattr(self, name)
            if value is None:
                continue
            array = np.asarray(value, dtype=np.float64)
            if array.shape not in ((), times.shape):
                raise ValueError(f"inputs: {name}: found shape {array.shape}; expected {times.shape} or a number")
            if not np.isfinite(array).all():
                raise ValueError(f"inputs: {name}: found {array[~np.isfinite(array)][0]:g}; expected finite numbers")
            object.__setattr__(self, name, np.broadcast_to(array, times.shape))
        speeds = np.asarray(self.propeller_speed)
        refuse("inputs: propeller_speed", speeds, np.abs(speeds) > MAX_PROPELLER_SPEED, SPEED_EXPECTED)
        if self.density is not None and not 0.0 < self.density < math.inf:
            raise ValueError(f"inputs: density: found {self.density:g}; expected a positive number of kg/m3")


@dataclass(frozen=True)
class Flight:
    """A flight; arrays of shape (n,), NaN from where it cannot be flown on, and the reason ("" if flown to the end).

    Attributes
    ----------
    times
        s.
    speed, path_angle, angle_of_attack, pitch_rate
        V [m/s], γ, α [rad], q [rad/s].
    depth
        Depth below the start, m, down positive.
    distance
        Horizontal distance from the start, m, forward positive.
    reason
        Why and when the flight ended early.
    """

    times: Array
    speed: Array
    path_angle: Array
    angle_of_attack: Array
    pitch_rate: Array
    depth: Array
    distance: Array
    reason: str

    @property
    def pitch(self) -> Array:
        """θ = γ + α, rad."""
        return self.path_angle + self.angle_of_attack


def simulate(
    vehicle: Vehicle,
    state: ArrayLike,
    inputs: Inputs,
    times: ArrayLike,
    *,
    step: float = STEP,
    method: Method = "fixed",
) -> Flight:
    """Return the flight of `vehicle` from `state` under `inputs`, at `times`.

    ``fixed``: classical Runge-Kutta steps of fourth order, compiled, for missions; no step crosses a corner of the
    schedules. At 0.25 s the fast modes of Petrel-II (0.9 to 4.5 s) are stable and the trims exact; transients are
    off by some 1e-5. ``implicit``: Radau's method of fifth order (scipy) at a relative tolerance of 1e-10, as
    reference, for minutes.

    Parameters
    ----------
    vehicle
        Vehicle with all coefficients of the dynamics known.
    state
        V [m/s], γ [rad], α [rad], q [rad/s] at the first of `times`, shape (4,).
    inputs
        Schedules of pump, battery and propeller.
    times
        Increasing times, s, shape (n,).
    step
        Longest step of ``fixed``, s.
    method
        ``fixed`` or ``implicit``.

    Raises
    ------
    ValueError
        If times do not increase, the step is not positive, the state is not four finite numbers with V > 0, or its
        angles look like degrees.

    Examples
    --------
    >>> from pipeline.vehicle import load
    >>> flight = simulate(load("petrel-ii"), [0.6, 0.5, 0.0, 0.0], Inputs(0.0, 5.0), [0.0, 600.0])
    >>> bool(flight.depth[-1] < -100.0)
    True
    """
    when = np.atleast_1d(np.asarray(times, dtype=np.float64))
    _increasing("times", when)
    start = _start(state)
    if not 0.0 < step < math.inf:
        raise ValueError(f"step: found {step:g}; expected a positive number of seconds")
    if method not in ("fixed", "implicit"):
        raise ValueError(f"method: found {method!r}; expected 'fixed' or 'implicit'")
    flown = np.full((when.size, STATES), np.nan)
    reason = _reason(vehicle, inputs)
    if not reason:
        knots, schedule, density = _schedule(inputs, when, vehicle)
        column = np.array([[0.0, density, 0.0], [0.0, density, 0.0]])
        craft = (body_of(vehicle), Polar(*map(float, vehicle.polar)), propeller_of(vehicle), _ballast(vehicle, inputs))
        if method == "fixed":
            values, end, at = _fly(start, knots, schedule, step, *craft, column)
            flown = values[np.searchsorted(knots, when)]
            reason = f"{_ENDS[end]} ({at:.6g} s)" if end else ""
        else:
            flown, reason = _fly_implicitly(start, knots, schedule, when, craft, column)
    speed, path_angle, alpha, pitch_rate, depth, _, distance, _ = flown.T.copy()
    return Flight(when, speed, path_angle, alpha, pitch_rate, depth, distance, reason)


@njit(cache=True)
def _fly(
    start: Array,
    knots: Array,
    schedule: Array,
    longest: float,
    body: Body,
    polar: Polar,
    propeller: Propeller,
    ballast: Ballast,
    column: Array,
) -> tuple[Array, int, float]:
    """Return the states at `knots`, shape (k, 8), how the flight ended and when, s; inputs are linear between knots."""
    out = np.full((knots.size, STATES), np.nan)
    work = np.empty((7, STATES))
    y = start.copy()
    rate = np.empty(INPUTS)
    out[0] = y
    for k in range(knots.size - 1):
        span = knots[k + 1] - knots[k]
        steps = max(1, math.ceil(span / longest - 1e-9))
        now = schedule[k].copy()
        for i in range(INPUTS):
            rate[i] = (schedule[k + 1, i] - schedule[k, i]) / span
        for part in range(steps):
            advance(y, now, rate, span / steps, body, polar, propeller, ballast, column, work)
            end = _verdict(y)
            if end != _FLYING:
                return out, end, knots[k] + (part + 1) * span / steps
        out[k + 1] = y
    return out, _FLYING, knots[-1]


@njit(cache=True)
def _verdict(y: Array) -> int:
    """Return whether the state `y` can be flown on from."""
    if not math.isfinite(y[0] + y[1] + y[2] + y[3]):
        return _LOST
    if y[0] <= 0.0:
        return _STALLED
    return _FLYING if abs(y[1] + y[2]) < math.pi else _TUMBLED


def _fly_implicitly(
    start: Array, knots: Array, schedule: Array, when: Array, craft: _Craft, column: Array
) -> tuple[Array, str]:
    """Return the states at `when`, shape (n, 8), by Radau's method from corner to corner, and the reason."""
    from scipy.integrate import solve_ivp

    flown = np.full((when.size, STATES), np.nan)
    flown[0] = start
    slopes = np.diff(schedule, axis=0) / np.diff(knots)[:, None]
    bends = np.any(np.abs(np.diff(slopes, axis=0)) > 1e-12 * (1.0 + np.abs(slopes[1:])), axis=1)
    corners = np.concatenate([[0], np.flatnonzero(bends) + 1, [knots.size - 1]])
    y, out = start, np.empty(STATES)

    def rate(time: float, state: Array, first: int) -> Array:
        rates(state, schedule[first] + (time - knots[first]) * slopes[first], *craft, column, out)
        return out.copy()

    for first, last in pairwise(corners):
        inside = (when > knots[first]) & (when <= knots[last])
        solution = solve_ivp(
            rate,
            (knots[first], knots[last]),
            y,
            method="Radau",
            t_eval=np.union1d(when[inside], knots[last]),
            args=(first,),
            rtol=1e-10,
            atol=1e-12,
        )
        path = solution.y.T
        ends = [int(_verdict(state)) for state in path]
        good = next((i for i, end in enumerate(ends) if end), len(ends))
        flown[np.flatnonzero(inside)[:good]] = path[: min(good, int(inside.sum()))]
        if good < len(ends):
            return flown, f"{_ENDS[ends[good]]} ({solution.t[good]:.6g} s)"
        if not solution.success:
            return flown, f"the integration stopped: {solution.message} ({knots[first]:.6g} s or later)"
        y = path[-1]
    return flown, ""


def _schedule(inputs: Inputs, when: Array, vehicle: Vehicle) -> tuple[Array, Array, float]:
    """Return all corners and instants [s, shape (k,)], the inputs of `motion` there, shape (k, 7), and the density."""
    density = vehicle["reference_density"] if inputs.density is None else inputs.density
    corners = np.asarray(inputs.times)
    knots = np.union1d(when, corners[(corners > when[0]) & (corners < when[-1])])
    schedule = np.zeros((knots.size, INPUTS))
    schedule[:, 0] = np.interp(knots, corners, np.asarray(inputs.net_buoyancy) / (GRAVITY * density))
    if inputs.battery_position is not None:
        schedule[:, 1] = np.interp(knots, corners, np.asarray(inputs.battery_position))
    schedule[:, 2] = np.interp(knots, corners, np.asarray(inputs.propeller_speed))
    return knots, schedule, density


def _ballast(vehicle: Vehicle, inputs: Inputs) -> Ballast:
    weight = 0.0 if inputs.battery_position is None else vehicle["battery_mass"] * GRAVITY
    neutral = vehicle["battery_neutral_position"]
    return Ballast(vehicle["reference_density"], weight, neutral, 0.0, vehicle["righting_moment"], FLUSHING_BEFORE)


def _reason(vehicle: Vehicle, inputs: Inputs) -> str:
    """Return why `vehicle` cannot be flown under `inputs` at all, "" if it can."""
    needed = [*Body._fields, *Polar._fields, "reference_density", "righting_moment"]
    if inputs.battery_position is not None:
        needed += ["battery_mass", "battery_neutral_position"]
    reason = unusable(vehicle, tuple(needed))
    if reason:
        return reason
    return NO_THRUST_LAW if np.any(inputs.propeller_speed) and vehicle.propeller is None else ""


def _start(state: ArrayLike) -> Array:
    """Return the first state of `motion`, shape (8,)."""
    given = np.asarray(state, dtype=np.float64)
    if given.shape != (4,) or not np.isfinite(given).all() or given[0] <= 0.0:
        raise ValueError(f"state: found {given.tolist()}; expected V > 0, γ, α and q, four finite numbers")
    for name, value, limit in (("γ", given[1], math.pi), ("α", given[2], MAX_ANGLE_OF_ATTACK)):
        if abs(value) > limit:
            raise ValueError(f"state: {name}: found {value:g}; expected at most {limit:.4g} rad; degrees?")
    return np.concatenate([given, np.zeros(STATES - 4)])


def _increasing(name: str, times: Array) -> None:
    """Refuse `times` that are not finite and increasing."""
    if times.ndim != 1 or not np.isfinite(times).all() or np.any(np.diff(times) <= 0.0):
        raise ValueError(f"{name}: found times that are not finite and increasing; expected seconds in order")

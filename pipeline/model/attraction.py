"""The simulated region of attraction of a steady flight: where each of many starts ends, and when.

The dynamics of Eqs. (1)-(4) of Niu et al. (2017), doi:10.1007/s13344-017-0061-y, in physical signs, by the classical
Runge-Kutta method with a step that follows the fastest rate at the momentary speed. A motion counts as converged when
it enters the sublevel set certified by a quadratic Lyapunov function, which it cannot leave again.
"""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from pipeline.model.lyapunov import certificate, quadratic
from pipeline.model.modes import Equilibrium, SteadyFlight, deviation_rates
from pipeline.model.steady import MAX_ANGLE_OF_ATTACK

Array = NDArray[np.float64]

UNDECIDED, CONVERGED, DIVERGED, OTHER = 0, 1, 2, 3

#: What the verdicts mean.
VERDICTS = {
    UNDECIDED: "still under way at the end",
    CONVERGED: "returns to the steady flight",
    DIVERGED: "leaves the range of the model",
    OTHER: "comes to rest in another steady flight",
}

#: Product of time step and fastest rate.
STEP = 1.2
#: Part of the steady speed below which the motion is given up: its direction is then lost.
_LEAST_SPEED = 0.01
_LONGEST_STEP = 0.5
_AT_REST = 1e-5
_ELSEWHERE = 0.01


@dataclass(frozen=True)
class Attraction:
    """Where motions from many starts end; arrays of the shape of the starts.

    Attributes
    ----------
    verdict
        One of `VERDICTS`.
    time
        When the verdict fell, s; NaN where it is undecided.
    share
        Share of the starts that converge.
    level
        Level of the quadratic function at which a motion counts as converged; NaN if none is certified.
    reason
        Why nothing can converge, or there is no steady flight at all (all undecided); "" otherwise.
    """

    verdict: NDArray[np.int8]
    time: Array
    share: float
    level: float
    reason: str


def attraction(
    state: Equilibrium,
    *,
    speed: ArrayLike = 0.0,
    path_angle: ArrayLike = 0.0,
    angle_of_attack: ArrayLike = 0.0,
    pitch_rate: ArrayLike = 0.0,
    duration: float = 300.0,
    depth: float = 1.0,
    largest_angle: float = MAX_ANGLE_OF_ATTACK,
    step: float = STEP,
    workers: int | None = None,
) -> Attraction:
    """Return where motions end that start at the given deviations from a steady flight.

    Parameters
    ----------
    state
        The steady flight.
    speed, path_angle, angle_of_attack, pitch_rate
        Deviations V̄ = V/V_e - 1 [1], γ̄, ᾱ, q̄ = q K_q/K_M [rad] of the starts; they broadcast. A plane of 300 × 300:
        ``speed=v[None, :], path_angle=g[:, None]``.
    duration
        Time after which a motion is given up, s.
    depth
        Part of the certified level at which a motion counts as converged; below 1 motions are followed further in.
    largest_angle
        |α|, rad, beyond which the polar says nothing and the motion counts as diverged.
    step
        Product of time step and fastest rate.
    workers
        Threads; as many as there are processors if left out. The result does not depend on it.

    Raises
    ------
    ValueError
        If duration, depth, angle or step is not positive, or depth exceeds 1.

    Examples
    --------
    >>> from pipeline.model.modes import equilibrium
    >>> from pipeline.vehicle import load
    >>> found = attraction(equilibrium(load("petrel-ii"), 7.0, thrust=7.0), path_angle=[0.0, 0.5])
    >>> found.verdict.tolist()
    [1, 1]
    """
    for name, value in (("duration", duration), ("depth", depth), ("largest_angle", largest_angle), ("step", step)):
        if not value > 0.0 or (name == "depth" and value > 1.0):
            raise ValueError(f"{name}: found {value:g}; expected a positive number{' up to 1' * (name == 'depth')}")
    parts = np.broadcast_arrays(
        *(np.asarray(p, dtype=np.float64) for p in (speed, path_angle, angle_of_attack, pitch_rate))
    )
    shape = parts[0].shape
    starts = np.stack([part.ravel() for part in parts], axis=1)
    verdict = np.zeros(len(starts), dtype=np.int8)
    time = np.full(len(starts), np.nan)
    if state.reason:
        return Attraction(verdict.reshape(shape), time.reshape(shape), 0.0, math.nan, state.reason)
    found = certificate(quadratic(state))
    level = depth * found.level if found.holds else -1.0
    form = found.function.matrix
    count = max(1, min(workers or os.cpu_count() or 1, len(starts)))

    def fly(first: int) -> None:
        rows = slice(first, None, count)  # interleaved, so that all threads have as much to do
        _fly(starts[rows], state.flight, form, level, duration, largest_angle, step, verdict[rows], time[rows])

    with ThreadPoolExecutor(count) as pool:
        list(pool.map(fly, range(count)))
    share = float(np.mean(verdict == CONVERGED)) if len(verdict) else math.nan
    certified = depth * found.level if found.holds else math.nan
    return Attraction(verdict.reshape(shape), time.reshape(shape), share, certified, found.reason)


@njit(cache=True, nogil=True, error_model="numpy")
def _fly(
    starts: Array,
    flight: SteadyFlight,
    form: Array,
    level: float,
    duration: float,
    largest_angle: float,
    fineness: float,
    verdict: NDArray[np.int8],
    time: Array,
) -> None:
    """Fill `verdict` and `time`, shape (n,), for `starts`, shape (n, 4); arguments as for `attraction`."""
    body, polar = flight.body, flight.polar
    thrust = flight.push + flight.speed * (flight.pull + flight.speed * flight.square)
    mass = min(body.mass_forward, body.mass_normal)
    # Rates of the fast motion per speed and per squared speed, and of the path per inverse speed.
    turning = flight.density_ratio * abs(body.pitch_damping) / body.pitch_inertia * flight.speed**2
    swinging = math.sqrt(flight.density_ratio * abs(body.moment_slope) / body.pitch_inertia)
    swinging = (swinging + flight.density_ratio * polar.lift_slope / mass) * flight.speed
    bending = (abs(flight.net_buoyancy) + abs(thrust)) / (mass * flight.speed)
    swaying = math.sqrt((abs(flight.moment_cos) + abs(flight.moment_sin)) / body.pitch_inertia)
    for i in range(starts.shape[0]):
        v, g, a, q = starts[i, 0], starts[i, 1], starts[i, 2], starts[i, 3]
        now = 0.0
        while True:
            g -= 2.0 * math.pi * math.floor(g / (2.0 * math.pi) + 0.5)
            if not (1.0 + v >= _LEAST_SPEED and abs(flight.angle_of_attack + a) <= largest_angle):
                verdict[i], time[i] = DIVERGED, now
                break
            p0 = form[0, 0] * v + 2.0 * (form[0, 1] * g + form[0, 2] * a + form[0, 3] * q)
            p1 = form[1, 1] * g + 2.0 * (form[1, 2] * a + form[1, 3] * q)
            p2 = form[2, 2] * a + 2.0 * form[2, 3] * q
            if v * p0 + g * p1 + a * p2 + form[3, 3] * q * q <= level:
                verdict[i], time[i] = CONVERGED, now
                break
            k1 = deviation_rates(v, g, a, q, flight)
            idle = max(max(abs(k1[0]), abs(k1[1])), max(abs(k1[2]), abs(k1[3])))
            if idle < _AT_REST and max(max(abs(v), abs(g)), abs(a)) > _ELSEWHERE:
                verdict[i], time[i] = OTHER, now
                break
            if now >= duration:
                break
            x = 1.0 + v
            fastest = turning * x * x + swinging * x + bending / x + swaying
            h = min(min(fineness / fastest, _LONGEST_STEP), duration - now)
            k2 = deviation_rates(
                v + 0.5 * h * k1[0], g + 0.5 * h * k1[1], a + 0.5 * h * k1[2], q + 0.5 * h * k1[3], flight
            )
            k3 = deviation_rates(
                v + 0.5 * h * k2[0], g + 0.5 * h * k2[1], a + 0.5 * h * k2[2], q + 0.5 * h * k2[3], flight
            )
            k4 = deviation_rates(v + h * k3[0], g + h * k3[1], a + h * k3[2], q + h * k3[3], flight)
            v += h / 6.0 * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0])
            g += h / 6.0 * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1])
            a += h / 6.0 * (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2])
            q += h / 6.0 * (k1[3] + 2.0 * (k2[3] + k3[3]) + k4[3])
            now = duration if duration - now <= h else now + h

"""Modes of small motions about a steady flight: eigenvalues, time constants, periods.

The four-state dynamics of Eqs. (1)-(4) of Niu et al. (2017), doi:10.1007/s13344-017-0061-y, in physical signs, written
for deviations from steady flight as in the paper's Section 2: V̄ = (V - V_e)/V_e, γ̄ = γ - γ_e, ᾱ = α - α_e and
q̄ = q K_q/K_M. What is held matters: with the propeller speed held the thrust falls as the vehicle gains speed, with
the advance ratio held, as Eqs. (17)-(20) assume, it grows with the square of the speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.model.dynamics import Body, body_of, derivatives
from pipeline.model.forces import disk_thrust, propeller_of
from pipeline.model.predict import free_angle_of_attack
from pipeline.model.steady import NO_THRUST_LAW, steady_state, trim_at_pitch
from pipeline.vehicle import Polar, Propeller, Vehicle

Array = NDArray[np.float64]
Hold = Literal["propeller_speed", "propeller_power", "thrust", "advance_ratio"]

_STEP = 1e-3


class SteadyFlight(NamedTuple):
    """A steady flight as plain numbers; thrust is push + pull V + square V², N."""

    speed: float
    path_angle: float
    angle_of_attack: float
    push: float
    pull: float
    square: float
    body: Body
    polar: Polar
    density_ratio: float
    net_buoyancy: float
    moment_cos: float
    moment_sin: float

    @property
    def thrust(self) -> float:
        """Thrust in steady flight T_e, N."""
        return self.push + self.speed * (self.pull + self.speed * self.square)

    @property
    def rate_scale(self) -> float:
        """q̄/q = K_q/K_M, s."""
        return self.body.pitch_damping / self.body.moment_slope


@dataclass(frozen=True)
class Equilibrium:
    """A steady flight and what is held near it; `flight` is NaN where there is none, and `reason` says why.

    Attributes
    ----------
    flight
        Speed, angles and all coefficients.
    hold
        What of the propulsion is held.
    reason
        Why there is no such flight, "" where there is.
    """

    flight: SteadyFlight
    hold: Hold
    reason: str


@dataclass(frozen=True)
class Modes:
    """Modes of small motions, the slowest to decay first; NaN with a reason where there is no steady flight.

    Attributes
    ----------
    matrix
        ∂(V̄', γ̄', ᾱ', q̄')/∂(V̄, γ̄, ᾱ, q̄), 1/s, shape (4, 4).
    eigenvalues
        1/s, shape (4,), by falling real part.
    time_constants
        -1/Re λ, s, shape (4,); negative for a mode that grows.
    periods
        2π/|Im λ|, s, shape (4,); infinite for a mode that does not swing.
    stable
        Whether all modes decay.
    reason
        Why there are no modes, "" where there are.
    """

    matrix: Array
    eigenvalues: NDArray[np.complex128]
    time_constants: Array
    periods: Array
    stable: bool
    reason: str


@njit(cache=True, error_model="numpy")
def deviation_rates(v: float, g: float, a: float, q: float, flight: SteadyFlight) -> tuple[float, float, float, float]:
    """Return (V̄', γ̄', ᾱ', q̄') at the deviations (V̄, γ̄, ᾱ, q̄) from steady flight, 1/s (γ̄, ᾱ: rad/s).

    Times τ_s = m_3/(K'_De V_e) they are the right-hand sides of Eqs. (9)-(12), if m_1 = m_3, without static moments,
    and with the thrust T constant. NaN at V̄ = -1.
    """
    speed = flight.speed * (1.0 + v)
    scale = flight.body.pitch_damping / flight.body.moment_slope
    thrust = flight.push + speed * (flight.pull + speed * flight.square)
    speed_rate, path_rate, alpha_rate, pitch_acceleration = derivatives(
        speed, flight.path_angle + g, flight.angle_of_attack + a, q / scale,
        flight.body, flight.polar, Propeller(thrust, 0.0, 1.0),
        flight.density_ratio, 1.0, flight.net_buoyancy, 1.0, flight.moment_cos, flight.moment_sin,
    )  # fmt: skip
    return speed_rate / flight.speed, path_rate, alpha_rate, pitch_acceleration * scale


@njit(cache=True, error_model="numpy")
def matrix(flight: SteadyFlight) -> Array:
    """Return ∂(V̄', γ̄', ᾱ', q̄')/∂(V̄, γ̄, ᾱ, q̄) in steady flight, 1/s, shape (4, 4); differences of fourth order."""
    slopes = np.zeros((4, 4))
    for column in range(4):
        for times, weight in ((1.0, 8.0), (2.0, -1.0)):
            for side in (1.0, -1.0):
                y = np.zeros(4)
                y[column] = side * times * _STEP
                rate = deviation_rates(y[0], y[1], y[2], y[3], flight)
                for row in range(4):
                    slopes[row, column] += side * weight * rate[row] / (12.0 * _STEP)
    return slopes


def equilibrium(
    vehicle: Vehicle,
    net_buoyancy: float,
    *,
    angle_of_attack: float | None = None,
    pitch: float | None = None,
    thrust: float | None = None,
    propeller_speed: float | None = None,
    propeller_power: float | None = None,
    density: float | None = None,
    moment_sin: float = 0.0,
    hold: Hold | None = None,
) -> Equilibrium:
    """Return a steady flight with the static moment that trims it, ready for the study of its stability.

    Parameters
    ----------
    vehicle
        Vehicle with known polar, moments and inertia.
    net_buoyancy
        G, N, up positive.
    angle_of_attack, pitch
        α or θ, rad. Without either α_e = -K_M0/K_M, the angle of attack of the paper's free pitch.
    thrust, propeller_speed, propeller_power
        T, N, or n, rev/s, or P, W. Without any the vehicle glides.
    density
        In-situ density, kg/m³; the vehicle's reference density if left out.
    moment_sin
        Righting moment M_s in M_c cos θ + M_s sin θ, N m, negative = bottom-heavy; M_c follows from the trim.
    hold
        What is held: ``propeller_speed``, ``propeller_power``, ``thrust`` or ``advance_ratio``. If left out, that which
        is given. At a held power thrust follows its tangent in speed.

    Raises
    ------
    ValueError
        If both angle of attack and pitch are given, `hold` is none of the four, or is ``propeller_power`` and none is
        given, or as for `steady.steady_state`.

    Examples
    --------
    >>> from pipeline.vehicle import load
    >>> round(equilibrium(load("petrel-ii"), 7.0, thrust=7.0).flight.speed, 4)
    1.369
    """
    if angle_of_attack is not None and pitch is not None:
        raise ValueError("found both angle_of_attack and pitch; give one of them")
    driving: Hold = "thrust"
    if propeller_speed is not None:
        driving = "propeller_speed"
    elif propeller_power is not None:
        driving = "propeller_power"
    held = hold or driving
    if held not in get_args(Hold):
        raise ValueError(f"hold: found {held!r}; expected {', '.join(get_args(Hold)[:-1])} or {get_args(Hold)[-1]}")
    if held == "propeller_power" and propeller_power is None:
        raise ValueError("hold: found 'propeller_power' and no propeller_power; give it, W")
    unfree = ""
    if pitch is not None:
        state = trim_at_pitch(
            vehicle, net_buoyancy, pitch, thrust=thrust, propeller_speed=propeller_speed,
            propeller_power=propeller_power, density=density,
        )  # fmt: skip
    else:
        alpha, unfree = free_angle_of_attack(vehicle) if angle_of_attack is None else (angle_of_attack, "")
        state = steady_state(
            vehicle, net_buoyancy, alpha, thrust=thrust, propeller_speed=propeller_speed,
            propeller_power=propeller_power, density=density,
        )  # fmt: skip
    body, polar = body_of(vehicle), Polar(*(float(value) for value in vehicle.polar))
    unknown = [name for name in Body._fields if math.isnan(vehicle[name])]
    reason = f"the vehicle file leaves {', '.join(unknown)} unknown" if unknown else unfree or str(state.reason)
    actual = vehicle["reference_density"] if density is None else float(density)
    speed, theta = float(state.speed), float(state.pitch)
    push, pull, square = _law(vehicle, held, float(state.thrust), propeller_speed, propeller_power, speed, actual)
    if not reason and math.isnan(push):
        reason = NO_THRUST_LAW
    moment = float(state.required_moment) - moment_sin * math.sin(theta)
    flight = SteadyFlight(
        speed, float(state.path_angle), float(state.angle_of_attack), push, pull, square, body, polar,
        actual / vehicle["reference_density"], float(net_buoyancy), moment / math.cos(theta), float(moment_sin),
    )  # fmt: skip
    if reason:
        flight = flight._replace(speed=math.nan, path_angle=math.nan, angle_of_attack=math.nan)
    return Equilibrium(flight, held, reason)


def _law(
    vehicle: Vehicle,
    hold: Hold,
    thrust: float,
    propeller_speed: float | None,
    propeller_power: float | None,
    speed: float,
    density: float,
) -> tuple[float, float, float]:
    """Return push [N], pull [N s/m] and square [N s²/m²] of the thrust near steady flight; NaN without a thrust law."""
    if thrust == 0.0 and not propeller_speed:
        return 0.0, 0.0, 0.0
    if hold == "thrust":
        return thrust, 0.0, 0.0
    if hold == "advance_ratio":
        return 0.0, 0.0, thrust / speed**2
    if hold == "propeller_power" and propeller_power and vehicle.disk is not None:
        _, pull = disk_thrust(vehicle.disk, density, propeller_power, speed)
        return thrust - pull * speed, pull, 0.0
    if vehicle.propeller is None:
        return math.nan, math.nan, math.nan
    law = propeller_of(vehicle)
    flow = density * law.diameter**3
    static = flow * law.diameter * law.thrust_static
    drop = flow * law.thrust_slope * speed
    turning = propeller_speed or (-drop + math.sqrt(drop * drop + 4.0 * static * thrust)) / (2.0 * static)
    return static * turning**2, flow * law.thrust_slope * turning, 0.0


def modes(state: Equilibrium) -> Modes:
    """Return the modes of small motions about a steady flight: the linearised Eqs. (1)-(4).

    Examples
    --------
    >>> from pipeline.vehicle import load
    >>> found = modes(equilibrium(load("petrel-ii"), 7.0, thrust=7.0))
    >>> found.eigenvalues.real.round(3).tolist()
    [-0.054, -0.236, -3.406, -3.406]
    """
    if state.reason:
        nothing = np.full(4, np.nan)
        return Modes(np.full((4, 4), np.nan), nothing.astype(complex), nothing, nothing, False, state.reason)
    slopes = matrix(state.flight)
    eigenvalues = np.linalg.eigvals(slopes).astype(np.complex128)
    eigenvalues = eigenvalues[np.lexsort((-eigenvalues.imag, -eigenvalues.real))]
    with np.errstate(divide="ignore"):
        time_constants, periods = -1.0 / eigenvalues.real, 2.0 * math.pi / np.abs(eigenvalues.imag)
    return Modes(slopes, eigenvalues, time_constants, periods, bool(eigenvalues.real.max() < 0.0), "")

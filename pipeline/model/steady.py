"""Steady flight: speed and angles at a held angle of attack, at a held pitch, or in moment balance.

Eqs. (21) and (22) of Niu et al. (2017), doi:10.1007/s13344-017-0061-y, solved for any thrust law T(n, V) and for
parasite drag with a speed exponent. Inputs broadcast; where no steady flight exists the result is NaN with a reason.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.model.balance import FIXED_ALPHA, HELD_PITCH, solve
from pipeline.model.case import MAX_ANGLE_OF_ATTACK as MAX_ANGLE_OF_ATTACK
from pipeline.model.case import NO_THRUST_LAW as NO_THRUST_LAW
from pipeline.model.case import Case, plain, refuse, unusable
from pipeline.model.dynamics import body_of, jacobian
from pipeline.model.forces import GRAVITY, disk_of, disk_thrust, propeller_of
from pipeline.model.moment import pitches_at_moment
from pipeline.model.sensitivity import sensitivities
from pipeline.vehicle import Polar, Propeller, Vehicle

Signs = Literal["physical", "paper"]
Array = NDArray[np.float64]

#: Pitch within which moment balance is sought, rad.
MAX_TRIM_PITCH = math.radians(80.0)
#: Trims of one case that are looked for.
MOST_TRIMS = 6

#: The numbers of `Steady`.
QUANTITIES = ("speed", "path_angle", "angle_of_attack", "pitch", "thrust", "advance_ratio", "required_moment")


@dataclass(frozen=True)
class Steady:
    """Steady flight; arrays of one shape, NaN where there is none, with the reason as text ("" elsewhere).

    Attributes
    ----------
    speed
        V_e, m/s.
    path_angle, angle_of_attack, pitch
        γ_e, α_e, θ_e = γ_e + α_e, rad.
    thrust
        T_e, N.
    advance_ratio
        J_0 = V/(n D_0); NaN where the propeller stands still or thrust was given.
    required_moment
        Static nose-up moment that battery and ballast must supply, N m, Munk moment allowed for; NaN where the
        moment coefficients are unknown.
    reason
        Why there is no steady flight.
    """

    speed: Array
    path_angle: Array
    angle_of_attack: Array
    pitch: Array
    thrust: Array
    advance_ratio: Array
    required_moment: Array
    reason: NDArray[Any]


@dataclass(frozen=True)
class Trims:
    """All steady flights of each case in moment balance, by rising pitch along a last axis of `MOST_TRIMS`.

    Attributes
    ----------
    steady
        The flights, shape (..., 6); NaN beyond the last.
    eigenvalues
        Eigenvalues of the dynamics (V, γ, α, q) at each, with the propeller's speed or power held, 1/s, shape
        (..., 6, 4).
    stable
        Whether all four decay, shape (..., 6).
    reason
        Why a case has no trim at all, "" where it has one, shape (...).
    """

    steady: Steady
    eigenvalues: NDArray[np.complex128]
    stable: NDArray[np.bool_]
    reason: NDArray[Any]


def steady_state(
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    angle_of_attack: ArrayLike,
    *,
    thrust: ArrayLike | None = None,
    propeller_speed: ArrayLike | None = None,
    propeller_power: ArrayLike | None = None,
    density: ArrayLike | None = None,
    signs: Signs = "physical",
) -> Steady:
    """Return steady flight at a held angle of attack, Eqs. (21) and (22): the largest speed that balances.

    Parameters
    ----------
    vehicle
        Vehicle with a known polar.
    net_buoyancy
        Net buoyancy force G, N, up positive.
    angle_of_attack
        α, rad, flow from below positive.
    thrust
        Constant thrust T, N; or else
    propeller_speed
        propeller speed n, rev/s; or else
    propeller_power
        its power, W; the thrust following the vehicle's speed. Without any of them the vehicle glides.
    density
        In-situ density, kg/m³; the vehicle's reference density if left out.
    signs
        ``physical``, or ``paper`` for the equations as printed (with the sign of B in Eq. (21) corrected).

    Raises
    ------
    ValueError
        If an angle looks like degrees, a propeller speed like rpm, a density is not positive, a power is negative, or
        both thrust and propeller speed or power are given.

    Examples
    --------
    >>> from pipeline.vehicle import load
    >>> float(steady_state(load("petrel-ii"), 7.0, -0.0025358, thrust=7.0, signs="paper").speed.round(4))
    1.3694
    """
    if signs not in ("physical", "paper"):
        raise ValueError(f"signs: found {signs!r}; expected 'physical' or 'paper'")
    case = Case.of(vehicle, net_buoyancy, angle_of_attack, thrust, propeller_speed, propeller_power, density)
    return _balanced(FIXED_ALPHA, vehicle, case, signs)


def trim_at_pitch(
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    pitch: ArrayLike,
    *,
    thrust: ArrayLike | None = None,
    propeller_speed: ArrayLike | None = None,
    propeller_power: ArrayLike | None = None,
    density: ArrayLike | None = None,
) -> Steady:
    """Return steady flight at a held pitch, with |α| ≤ 0.35 rad: the angle of attack nearest zero normal force.

    The moment that holds the pitch is `Steady.required_moment`. Physical signs. Without net buoyancy the powered
    vehicle flies along its pitch less the angle of attack of zero normal force.

    Parameters
    ----------
    pitch
        θ, rad, nose up positive, within ±π/2.
    vehicle, net_buoyancy, thrust, propeller_speed, propeller_power, density
        As for `steady_state`.

    Raises
    ------
    ValueError
        As for `steady_state`.

    Examples
    --------
    >>> from pipeline.vehicle import load
    >>> float(trim_at_pitch(load("petrel-ii"), 2.5, 0.0611, propeller_speed=13.0).speed.round(3))
    0.615
    """
    case = Case.of(vehicle, net_buoyancy, pitch, thrust, propeller_speed, propeller_power, density)
    return _balanced(HELD_PITCH, vehicle, case, "physical")


def trim_at_moment(
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    *,
    battery_position: ArrayLike | None = None,
    moment_cos: ArrayLike | None = None,
    propeller_speed: ArrayLike | None = None,
    propeller_power: ArrayLike | None = None,
    density: ArrayLike | None = None,
) -> Steady:
    """Return the stable steady flight nearest to level in which forces and pitching moments balance.

    The static moment is M_c cos θ + M_s sin θ with M_c = -m̄ g (r_P1 - r_P0) of the battery and the vehicle's
    righting moment M_s. Stable means that all four eigenvalues of the dynamics decay: with the propeller's speed held,
    or its power, where thrust follows its tangent in V. Physical signs.

    Parameters
    ----------
    vehicle
        Vehicle with known polar, moments and inertia.
    net_buoyancy, propeller_speed, propeller_power, density
        As for `steady_state`.
    battery_position
        r_P1, m, forward positive; or else
    moment_cos
        M_c, N m, nose up positive.

    Raises
    ------
    ValueError
        As for `steady_state`, or if not exactly one of battery position and moment is given.
    """
    trims = trims_at_moment(
        vehicle,
        net_buoyancy,
        battery_position=battery_position,
        moment_cos=moment_cos,
        propeller_speed=propeller_speed,
        propeller_power=propeller_power,
        density=density,
    )
    steepness = np.where(trims.stable, np.abs(trims.steady.pitch), np.inf)
    choice = np.argmin(steepness, axis=-1)[..., None]
    found = trims.stable.any(axis=-1)
    arrays = {
        name: np.where(found, np.take_along_axis(getattr(trims.steady, name), choice, axis=-1)[..., 0], np.nan)
        for name in QUANTITIES
    }
    unstable = "no equilibrium: no trim within 80 degrees of level is stable"
    reason = np.where(found, "", np.where(trims.reason == "", unstable, trims.reason))
    return Steady(**arrays, reason=np.asarray(reason, dtype=object))


def trims_at_moment(
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    *,
    battery_position: ArrayLike | None = None,
    moment_cos: ArrayLike | None = None,
    propeller_speed: ArrayLike | None = None,
    propeller_power: ArrayLike | None = None,
    density: ArrayLike | None = None,
) -> Trims:
    """Return all steady flights within 80° of level in which forces and moments balance, with their eigenvalues.

    Pitch is searched degree by degree: two trims nearer to each other than that may be missed. Of several speeds
    that balance at one pitch the largest is meant. Arguments and errors as for `trim_at_moment`.

    Examples
    --------
    >>> from pipeline.vehicle import load
    >>> trims = trims_at_moment(load("petrel-ii"), -5.0, battery_position=0.02)
    >>> int(trims.stable.sum())
    1
    """
    if (battery_position is None) == (moment_cos is None):
        raise ValueError("found both or neither of battery_position and moment_cos; give one of them")
    if battery_position is not None:
        offset = np.asarray(battery_position, dtype=np.float64) - vehicle["battery_neutral_position"]
        moment_cos = -vehicle["battery_mass"] * GRAVITY * offset
    lean = np.asarray(moment_cos, dtype=np.float64)
    case = Case.of(vehicle, net_buoyancy, lean, None, propeller_speed, propeller_power, density)
    body, polar, disk = body_of(vehicle), plain(vehicle), disk_of(vehicle)
    moment_sin = vehicle["righting_moment"]
    needed: tuple[str, ...] = (*Polar._fields, *body._fields, "reference_density", "righting_moment")
    if battery_position is not None:
        needed += ("battery_mass", "battery_neutral_position")
    reason = case.reason(unusable(vehicle, needed), "moment_cos" if battery_position is None else "battery_position")

    pitch = np.full((case.size, MOST_TRIMS), np.nan)
    for i in np.flatnonzero(reason == ""):
        pitch[i] = pitches_at_moment(
            MAX_TRIM_PITCH, MOST_TRIMS, polar, case.ratio[i], case.push[i], case.pull[i], disk, case.density[i],
            case.propeller_power[i], case.net_buoyancy[i], body.moment_at_zero, body.moment_slope,
            body.mass_normal - body.mass_forward, case.held[i], moment_sin,
        )  # fmt: skip
    none = np.isnan(pitch).all(axis=1)
    reason[(reason == "") & none] = "no equilibrium: forces and moments balance nowhere within 80 degrees of level"
    each = case.repeated(MOST_TRIMS)
    blank = np.where(np.isnan(pitch), np.where(none, reason, "no further trim")[:, None], "").ravel()
    steady = _finish(HELD_PITCH, vehicle, each, pitch.ravel(), blank, 1.0)

    flat = [getattr(steady, name).ravel() for name in ("speed", "path_angle", "angle_of_attack")]
    eigenvalues = np.full((each.size, 4), np.nan, dtype=np.complex128)
    for k in np.flatnonzero(np.isfinite(flat[0])):
        v, gamma, alpha = (values[k] for values in flat)
        propeller, density_for_thrust, turning = propeller_of(vehicle), each.density[k], each.propeller_speed[k]
        if each.propeller_power[k] > 0.0:
            thrust, slope = disk_thrust(disk, each.density[k], each.propeller_power[k], v)
            propeller = Propeller(each.push[k] + thrust - slope * v, each.pull[k] + slope, 1.0)
            density_for_thrust, turning = 1.0, 1.0
        eigenvalues[k] = np.linalg.eigvals(
            jacobian(
                v, gamma, alpha, 0.0, body, polar, propeller, each.ratio[k], density_for_thrust,
                each.net_buoyancy[k], turning, each.held[k], moment_sin,
            )
        )  # fmt: skip
    stable = np.isfinite(flat[0]) & (eigenvalues.real.max(axis=1) < 0.0)
    return Trims(steady, eigenvalues.reshape(*each.shape, 4), stable.reshape(each.shape), reason.reshape(case.shape))


def trim_sensitivities(
    vehicle: Vehicle,
    net_buoyancy: ArrayLike,
    pitch: ArrayLike,
    *,
    propeller_speed: ArrayLike | None = None,
    propeller_power: ArrayLike | None = None,
    density: ArrayLike | None = None,
) -> dict[str, tuple[Array, Array]]:
    """Return ∂V/∂p [m/s per unit of p] and ∂γ/∂p [rad per unit of p] of flight at a held pitch, by parameter.

    By the implicit function theorem. Parameters p: ``parasite_drag``, ``lift_slope``, ``lift_at_zero``,
    ``induced_drag``, ``thrust_scale`` (a factor on thrust, at 1), ``net_buoyancy``, ``pitch``, ``propeller_speed``,
    ``propeller_power``.
    NaN where there is no trim. Arguments and errors as for `trim_at_pitch`.
    """
    trim = trim_at_pitch(
        vehicle, net_buoyancy, pitch,
        propeller_speed=propeller_speed, propeller_power=propeller_power, density=density,
    )  # fmt: skip
    found = sensitivities(
        "pitch",
        vehicle,
        net_buoyancy,
        trim.speed,
        trim.path_angle,
        trim.angle_of_attack,
        propeller_speed=propeller_speed,
        propeller_power=propeller_power,
        density=density,
    )
    return {name: (slope.speed, slope.path_angle) for name, slope in found.items()}


def _balanced(mode: int, vehicle: Vehicle, case: Case, signs: Signs) -> Steady:
    name, limit = ("angle_of_attack", MAX_ANGLE_OF_ATTACK) if mode == FIXED_ALPHA else ("pitch", 0.5 * math.pi)
    refuse(name, case.held, np.abs(case.held) > limit * (1.0 + 1e-12), f"at most {limit:.4g} rad; degrees?")
    reason = case.reason(unusable(vehicle, (*Polar._fields, "reference_density")), name)
    if mode == FIXED_ALPHA:
        undetermined = (reason == "") & (case.net_buoyancy == 0.0)
        reason[undetermined] = "no equilibrium: without net buoyancy the path is undetermined at a held angle of attack"
    held_angle = np.where(reason == "", case.held, np.nan)
    return _finish(mode, vehicle, case, held_angle, reason, 1.0 if signs == "physical" else -1.0)


def _finish(mode: int, vehicle: Vehicle, case: Case, held: Array, reason: NDArray[Any], sign: float) -> Steady:
    """Return steady flight at the angles `held` (NaN where `reason` says why not), in the shape of the inputs."""
    speed, path_angle, alpha, thrust = solve(
        mode, held, plain(vehicle), case.ratio, case.push, case.pull, disk_of(vehicle), case.density,
        case.propeller_power, case.net_buoyancy, sign,
    )  # fmt: skip
    what = "angle of attack" if mode == FIXED_ALPHA else "pitch (too shallow, or against the net buoyancy)"
    reason[(reason == "") & np.isnan(speed)] = f"no equilibrium: the forces do not balance at this {what}"
    turning = np.where((case.propeller_speed != 0.0) & ~case.no_thrust_law, case.propeller_speed, np.nan)
    body = body_of(vehicle)
    munk_mass = body.mass_normal - body.mass_forward
    flow = case.ratio * (body.moment_at_zero + body.moment_slope * alpha) + munk_mass * np.sin(alpha) * np.cos(alpha)
    arrays = (
        speed,
        path_angle,
        alpha,
        path_angle + alpha if mode == FIXED_ALPHA else np.where(np.isnan(speed), np.nan, held),
        thrust,
        speed / (turning * propeller_of(vehicle).diameter),
        -flow * speed**2,
        reason,
    )
    return Steady(*(array.reshape(case.shape) for array in arrays))

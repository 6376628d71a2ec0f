"""Forces on a glider: lift, drag, moment, thrust, net buoyancy; Eqs. (5)-(8), (15), (16) of Niu et al. (2017).

Physical signs: lift acts 90 degrees above the velocity, drag against it, thrust along the nose, net buoyancy up.
Source: Niu et al. (2017), China Ocean Eng. 31(5), 528-538, doi:10.1007/s13344-017-0061-y.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from pipeline.vehicle import Disk, Polar, Propeller, PropellerError, Vehicle

#: The thrust law of a vehicle that has none.
NO_PROPELLER = Propeller(0.0, 0.0, 0.0)
#: The same for thrust by power.
NO_DISK = Disk(0.0, 0.0)

#: Least thrust, as a share of that at rest, of which an error is a share.
LEAST_THRUST = 1e-3

GRAVITY = 9.81
PASCAL_PER_DBAR = 1e4


def propeller_of(vehicle: Vehicle) -> Propeller:
    """Return the thrust law of `vehicle` for the compiled kernels; `NO_PROPELLER` where it has none."""
    return vehicle.propeller or NO_PROPELLER


def disk_of(vehicle: Vehicle) -> Disk:
    """Return the law of thrust by power of `vehicle` for the compiled kernels; `NO_DISK` where it has none."""
    return vehicle.disk or NO_DISK


@njit(cache=True, error_model="numpy")
def lift(polar: Polar, speed: float, alpha: float) -> float:
    """Return the lift, N at the reference density: L = (K_L0 + K_L α) V², Eq. (5).

    Parameters
    ----------
    polar
        Lift and drag coefficients.
    speed
        Speed through water V, m/s.
    alpha
        Angle of attack α, rad, flow from below positive.
    """
    return (polar.lift_at_zero + polar.lift_slope * alpha) * speed * speed


@njit(cache=True, error_model="numpy")
def drag(polar: Polar, speed: float, alpha: float) -> float:
    """Return the drag, N at the reference density: D = K_D0 V^(2+2s) + K_D α² V², Eq. (6).

    The exponent 2s is zero in Niu et al.; Seaglider's parasite drag goes with q^s (Eriksen et al. 2001,
    doi:10.1109/48.972073). Parameters as for `lift`.
    """
    square = speed * speed
    parasite = square if polar.drag_exponent == 0.0 else speed ** (2.0 + polar.drag_exponent)
    return polar.parasite_drag * parasite + polar.induced_drag * alpha * alpha * square


@njit(cache=True, error_model="numpy")
def thrust(propeller: Propeller, density: float, propeller_speed: float, speed: float) -> float:
    """Return the thrust, N: T = K_1 ρ D_0⁴ n² + K_2 ρ D_0³ n V, Eqs. (8) and (15); 0 at n = 0.

    The law is not clamped: beyond its zero at J_0 = -K_1/K_2 the turning propeller brakes.

    Parameters
    ----------
    propeller
        Thrust law.
    density
        In-situ density ρ, kg/m³.
    propeller_speed
        Propeller speed n, rev/s.
    speed
        Speed through water V, m/s.
    """
    if propeller_speed == 0.0:
        return 0.0
    flow = density * propeller.diameter**3 * propeller_speed
    return flow * (propeller.thrust_static * propeller.diameter * propeller_speed + propeller.thrust_slope * speed)


@njit(cache=True, error_model="numpy")
def disk_thrust(disk: Disk, density: float, power: float, speed: float) -> tuple[float, float]:
    """Return thrust, N, and its slope in speed, N s/m, of a propeller known by its power: an actuator disk.

    Momentum theory (Rankine 1865, Froude 1889): T = 2 ρ A (V + v) v and η P = T (V + v), with the area A of the disk
    and the speed v that it adds to the flow. At rest T = (2 ρ A η² P²)^(1/3); at high speed T = η P / V. Both are 0
    without power.

    Parameters
    ----------
    disk
        Diameter and efficiency η: the part of P that is left after motor, gear, and the drag and swirl of the blades.
    density
        In-situ density ρ, kg/m³.
    power
        Power P that the propeller's motor draws, W.
    speed
        Speed through water V, m/s; taken as 0 where negative.
    """
    useful = disk.efficiency * power
    if not useful > 0.0:
        return 0.0, 0.0
    inflow = max(speed, 0.0)
    loading = 2.0 * useful / (math.pi * density * disk.diameter**2)
    through = inflow + loading ** (1.0 / 3.0)  # V + v, from above: each step of Newton's falls towards the root
    for _ in range(60):
        step = (through * through * (through - inflow) - loading) / (through * (3.0 * through - 2.0 * inflow))
        through -= step
        if abs(step) < 1e-14 * through:
            break
    return useful / through, -useful / (through * (3.0 * through - 2.0 * inflow))


def thrust_by_power(
    disk: Disk, density: ArrayLike, power: ArrayLike, speed: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return `disk_thrust` of arrays, and the exponent e with which it goes with power and efficiency: T ~ (η P)^e.

    With the disk's area times the density it goes as 1 - e, with its diameter as 2 (1 - e); e is 2/3 at rest, 1 fast.

    Parameters
    ----------
    disk, density, power, speed
        As for `disk_thrust`; arrays that broadcast, to the shape of the results.
    """
    shape = np.broadcast_shapes(*(np.shape(values) for values in (density, power, speed)))
    rho, watt, v = (np.broadcast_to(np.asarray(x, dtype=np.float64), shape).ravel() for x in (density, power, speed))
    newton, slope = _disk_thrusts(disk, rho, watt, v)
    with np.errstate(divide="ignore", invalid="ignore"):
        through = disk.efficiency * watt / newton  # V + v
        exponent = np.where(newton > 0.0, (2.0 * through - v) / (3.0 * through - 2.0 * v), 1.0)
    return newton.reshape(shape), slope.reshape(shape), exponent.reshape(shape)


@njit(cache=True, error_model="numpy")
def _disk_thrusts(
    disk: Disk, density: NDArray[np.float64], power: NDArray[np.float64], speed: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return `disk_thrust` of arrays of shape (n,); NaN where power or speed is."""
    newton, slope = np.empty(power.size), np.empty(power.size)
    for i in range(power.size):
        newton[i], slope[i] = disk_thrust(disk, density[i], power[i], speed[i])
        if math.isnan(power[i]) or math.isnan(speed[i]):
            newton[i], slope[i] = math.nan, math.nan
    return newton, slope


def power_for(disk: Disk, density: ArrayLike, newton: ArrayLike, speed: ArrayLike) -> NDArray[np.float64]:
    """Return the power, W, that gives a thrust: the inverse of `disk_thrust`, arguments as there, thrust in N."""
    force, v = np.asarray(newton, dtype=np.float64), np.maximum(np.asarray(speed, dtype=np.float64), 0.0)
    area = 0.25 * math.pi * disk.diameter**2
    through = 0.5 * v + np.sqrt(0.25 * v**2 + force / (2.0 * np.asarray(density, dtype=np.float64) * area))
    return np.asarray(force * through / disk.efficiency)


def relative_thrust_std(
    vehicle: Vehicle, density: ArrayLike, propeller_speed: ArrayLike, power: ArrayLike, speed: ArrayLike
) -> NDArray[np.float64]:
    """Return the relative 1-sigma of thrust: that of K_1 and K_2, or, by power, that of η and D; NaN if unknown.

    Parameters
    ----------
    vehicle
        Gives the laws and the 1-sigma of their coefficients.
    density, propeller_speed, power, speed
        kg/m³, rev/s, W (0 where thrust does not follow from it) and m/s; arrays that broadcast, to the shape of the
        result.
    """
    power, rotation = np.asarray(power, dtype=np.float64), np.asarray(propeller_speed, dtype=np.float64)
    shape = np.broadcast_shapes(*(np.shape(values) for values in (density, rotation, power, speed)))
    by_speed = np.full(shape, np.nan)
    if vehicle.propeller is not None:
        by_speed = np.broadcast_to(
            law_thrust_std(vehicle.propeller, vehicle.propeller_error, rotation, speed), shape
        ).copy()
    if vehicle.disk is None:
        return by_speed
    std = Disk(vehicle.std("propeller_diameter"), vehicle.std("propulsive_efficiency"))
    return np.where(power > 0.0, disk_thrust_std(vehicle.disk, std, density, power, speed), by_speed)


def law_thrust_std(
    law: Propeller, std: PropellerError, propeller_speed: ArrayLike, speed: ArrayLike
) -> NDArray[np.float64]:
    """Return the relative 1-sigma of thrust by propeller speed: T ~ K_1 + K_2 J at the advance ratio J = V / (n D_0).

    Near J_0 = -K_1/K_2 a little of K_1 and K_2 is much of T. There T is taken as no less than the 1-sigma of K_1, as a
    share of nothing says nothing. A propeller that stands still is taken at J = 0.

    Parameters
    ----------
    law, std
        Thrust law, and how well it is known.
    propeller_speed, speed
        rev/s and m/s; arrays that broadcast, to the shape of the result.
    """
    rotation, through = np.broadcast_arrays(
        np.abs(np.asarray(propeller_speed, dtype=np.float64)), np.asarray(speed, dtype=np.float64)
    )
    turning = rotation > 0.0
    ratio = np.divide(through, rotation * law.diameter, out=np.zeros(rotation.shape), where=turning)
    slope = std.slope * ratio
    error = np.sqrt(np.maximum(std.static**2 + slope**2 + 2.0 * std.correlation * std.static * slope, 0.0))
    least = np.maximum(std.static, LEAST_THRUST * law.thrust_static)
    return np.asarray(error / np.maximum(law.thrust_static + law.thrust_slope * ratio, least))


def disk_thrust_std(
    disk: Disk, std: Disk, density: ArrayLike, power: ArrayLike, speed: ArrayLike
) -> NDArray[np.float64]:
    """Return the relative 1-sigma of thrust by power: T ~ η^e D^(2 - 2e), see `thrust_by_power`.

    Parameters
    ----------
    disk, std
        Diameter and efficiency, and their 1-sigma.
    density, power, speed
        As for `disk_thrust`; arrays that broadcast, to the shape of the result.
    """
    _, _, exponent = thrust_by_power(disk, density, power, speed)
    efficiency, diameter = std.efficiency / disk.efficiency, std.diameter / disk.diameter
    return np.asarray(np.hypot(exponent * efficiency, 2.0 * (1.0 - exponent) * diameter))


@njit(cache=True, error_model="numpy")
def pitching_moment(
    moment_at_zero: float, moment_slope: float, pitch_damping: float, speed: float, alpha: float, pitch_rate: float
) -> float:
    """Return the hydrodynamic pitching moment, N m at the reference density: (K_M0 + K_M α + K_q q) V², Eq. (7).

    Parameters
    ----------
    moment_at_zero, moment_slope, pitch_damping
        K_M0 [kg], K_M [kg/rad] and K_q [kg s/rad]; the last two are negative for a stable vehicle.
    speed, alpha, pitch_rate
        V [m/s], α [rad] and q [rad/s], nose up positive.
    """
    return (moment_at_zero + moment_slope * alpha + pitch_damping * pitch_rate) * speed * speed


def net_buoyancy(
    *,
    mass: ArrayLike,
    volume: ArrayLike,
    buoyancy_volume: ArrayLike,
    density: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike,
    compressibility: float,
    thermal_expansion: float,
    reference_temperature: float,
    gravity: float = GRAVITY,
) -> NDArray[np.float64]:
    """Return the net buoyancy force, N, up positive: G = g (ρ (v (1 - ε p + α_T (T - T_0)) + v_b) - m).

    All array arguments broadcast; NaN in, NaN out. After Merckelbach et al. (2010),
    doi:10.1175/2009JTECHO710.1.

    Parameters
    ----------
    mass
        Mass of the vehicle m, kg.
    volume
        Hull volume v at the surface and at the reference temperature, m³.
    buoyancy_volume
        Volume of the buoyancy engine v_b, m³, positive = light.
    density
        In-situ density ρ at the pressure, kg/m³.
    pressure
        Sea pressure p, dbar.
    temperature
        In-situ temperature T, °C.
    compressibility
        Hull compressibility ε, 1/Pa.
    thermal_expansion
        Hull thermal expansion α_T, 1/K.
    reference_temperature
        Temperature T_0 at which `volume` holds, °C.
    gravity
        Acceleration of gravity g, m/s².

    Raises
    ------
    ValueError
        If a mass or a volume of the hull is negative, or a density not positive.
    """
    for name, values, least in (("mass", mass, 0.0), ("volume", volume, 0.0), ("density", density, math.ulp(0.0))):
        given = np.asarray(values, dtype=np.float64)
        if np.any(given < least):
            wanted = "a positive number of kg/m3" if name == "density" else "a number that is not negative"
            raise ValueError(f"{name}: found {given[given < least].flat[0]:g}; expected {wanted}")
    squeezed = compressibility * PASCAL_PER_DBAR * np.asarray(pressure, dtype=np.float64)
    swollen = thermal_expansion * (np.asarray(temperature, dtype=np.float64) - reference_temperature)
    hull = np.asarray(volume, dtype=np.float64) * (1.0 - squeezed + swollen)
    displaced = np.asarray(density, dtype=np.float64) * (hull + np.asarray(buoyancy_volume, dtype=np.float64))
    return np.asarray(gravity * (displaced - np.asarray(mass, dtype=np.float64)), dtype=np.float64)

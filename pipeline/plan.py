"""Plans: what a simulated mission is told to do, with which vehicle, in which water.

A plan is a sequence of orders (hold this pitch, give this net buoyancy, until there), the water column, the motors
and instruments that carry the orders out and watch, and the disturbances.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import gsw
import numpy as np
from numpy.typing import NDArray

from pipeline.mission import Nominal
from pipeline.model.exchange import fairing_of
from pipeline.model.forces import GRAVITY, PASCAL_PER_DBAR, net_buoyancy
from pipeline.vehicle import Vehicle

#: Layers, m, over which the weight of the water is summed.
_STEP = 0.5

End = Literal["duration", "deeper", "shallower", "surface"]


@dataclass(frozen=True)
class Water:
    """A water column: temperature and salinity at some depths, joined smoothly (monotone cubic).

    Attributes
    ----------
    depth
        Depths of the nodes, m, increasing from 0, shape (n,).
    temperature
        In-situ temperature at the nodes, °C (ITS-90), shape (n,).
    salinity
        Practical salinity at the nodes, shape (n,).
    fresh
        Whether what is dissolved is not sea salt: density is then that of pure water.
    """

    depth: tuple[float, ...]
    temperature: tuple[float, ...]
    salinity: tuple[float, ...]
    fresh: bool = False

    def at(self, depth: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return in-situ temperature [°C] and practical salinity at `depth` [m], both of its shape."""
        from scipy.interpolate import PchipInterpolator

        nodes = np.column_stack([self.temperature, self.salinity])
        temperature, salinity = PchipInterpolator(self.depth, nodes)(np.clip(depth, self.depth[0], self.depth[-1])).T
        return temperature, salinity


@dataclass(frozen=True)
class Stage:
    """One order of a mission: what to hold, and until when.

    Attributes
    ----------
    pitch_deg
        Pitch to be held, degrees, nose up positive.
    net_buoyancy
        Net buoyancy, N, that the engine is to give at the plan's nominal depth.
    rpm
        Propeller speed, 1/min.
    heading_deg
        Heading, degrees from true north.
    end
        ``duration``: after `value` seconds; ``deeper``, ``shallower``: at depth `value` m; ``surface``: at the surface.
    value
        See `end`.
    afloat
        Drift at the surface with the antenna out; else fly, once heavy enough to leave the surface.
    """

    pitch_deg: float
    net_buoyancy: float
    heading_deg: float
    end: End
    value: float = 0.0
    rpm: float = 0.0
    afloat: bool = False


@dataclass(frozen=True)
class Plan:
    """A mission to be simulated: vehicle, water, orders, motors, disturbances and instruments.

    Attributes
    ----------
    name, description
        Name of the mission and what it stands for.
    vehicle
        Vehicle; all coefficients of the dynamics must be known.
    latitude, longitude
        Where it starts, degrees.
    start
        When it starts, s since 1970-01-01 UTC.
    water, nominal_depth
        Water column, and the depth [m] at which the orders' net buoyancies hold and the ballast is neutral.
    stages
        Orders, in sequence.
    nominal
        Published settings and results, for mission.yaml.
    vertical_water_std, vertical_water_time
        Gauss-Markov vertical velocity of the water: 1-sigma m/s, correlation time s.
    current_east, current_north, current_std, current_time
        Mean current m/s, and the Gauss-Markov part of each component.
    pump_rate, battery_rate, battery_range, propeller_ramp, turn_rate_deg
        Motors: m³/s, m/s, m (either side), rev/s², °/s.
    pitch_slew_deg, pitch_deadband_deg, gain_proportional, gain_integral
        Pitch autopilot: slew of the commanded pitch °/s, error left alone °, m/rad, m/(rad s).
    heading_wander_deg
        1-sigma of the heading's Gauss-Markov wander (60 s), degrees.
    ctd_s, attitude_s, engine_s, gyro_s, gps_s, gps_delay_s
        Sampling intervals (without a gyro, 0), and the time from surfacing to the first fix, s.
    minimum_block_s
        Shortest steady flight worth comparing, s, for mission.yaml.
    battery_full, battery_fall
        Battery voltage at the start, V (0: not logged), and how much it falls, V per hour.
    noise
        Factor on all instrument noise, offsets and gaps; 0 for perfect instruments.
    sample_noise
        1-sigma of single samples by quantity, in the unit of its log, in place of those in `instruments.LOGS`.
    lost
        Share of samples lost one by one.
    between_gaps, gap
        Mean time between gaps in an instrument's record, s, and the least and greatest length of one, s.
    step
        Longest Runge-Kutta step, s.
    longest
        Time after which a mission that does not end is given up, s.
    """

    name: str
    description: str
    vehicle: Vehicle
    latitude: float
    longitude: float
    start: float
    water: Water
    nominal_depth: float
    stages: tuple[Stage, ...]
    nominal: tuple[Nominal, ...] = ()
    vertical_water_std: float = 0.01
    vertical_water_time: float = 300.0
    current_east: float = 0.0
    current_north: float = 0.0
    current_std: float = 0.02
    current_time: float = 7200.0
    pump_rate: float = 5e-6
    battery_rate: float = 2e-3
    battery_range: float = 0.06
    propeller_ramp: float = 2.0
    turn_rate_deg: float = 3.0
    pitch_slew_deg: float = 0.4
    pitch_deadband_deg: float = 0.2
    gain_proportional: float = 0.06
    gain_integral: float = 0.006
    heading_wander_deg: float = 1.5
    ctd_s: float = 2.0
    attitude_s: float = 4.0
    engine_s: float = 8.0
    gyro_s: float = 0.0
    gps_s: float = 10.0
    gps_delay_s: float = 30.0
    minimum_block_s: float = 60.0
    battery_full: float = 0.0
    battery_fall: float = 0.0
    noise: float = 1.0
    sample_noise: Mapping[str, float] = field(default_factory=dict)
    lost: float = 0.005
    between_gaps: float = 5400.0
    gap: tuple[float, float] = (10.0, 40.0)
    step: float = 0.1
    longest: float = 90_000.0

    @property
    def neutral_density(self) -> float:
        """Density, kg/m³, in which the vehicle hangs with the engine at zero: neutral at the nominal depth."""
        sea = Sea.of(self, np.array([self.nominal_depth]))
        return round(float(sea.lift(self.vehicle, mass=0.0, volume=1.0)[0]) / GRAVITY, 2)

    def voltage(self, elapsed: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the battery voltage, V, of the shape of `elapsed`, s since the start."""
        return self.battery_full - self.battery_fall * elapsed / 3600.0

    @property
    def volume(self) -> float:
        """Hull volume, m³, at the surface and the reference temperature with the engine at zero."""
        return self.vehicle["mass"] / self.neutral_density


@dataclass(frozen=True)
class Sea:
    """What surrounds the vehicle at some depths, arrays of one shape: dbar, °C, practical salinity, kg/m³, kg/m³.

    Potential density is that at the surface less 1000 kg/m³.
    """

    pressure: NDArray[np.float64]
    temperature: NDArray[np.float64]
    salinity: NDArray[np.float64]
    density: NDArray[np.float64]
    potential_density: NDArray[np.float64]

    @classmethod
    def of(cls, plan: Plan, depth: NDArray[np.float64]) -> Sea:
        """Return the sea of `plan` at `depth` [m]; in-situ density by TEOS-10 at the pressure."""
        temperature, salinity = plan.water.at(depth)
        pressure = np.interp(depth, *_weight(plan, float(np.max(depth, initial=0.0))))
        pressure = np.where(depth < 0.0, gsw.p_from_z(-depth, plan.latitude), pressure)
        absolute, conservative = _conservative(plan, pressure, temperature, salinity)
        density = np.asarray(gsw.rho(absolute, conservative, pressure), dtype=np.float64)
        return cls(pressure, temperature, salinity, density, np.asarray(gsw.sigma0(absolute, conservative)))

    def lift(self, vehicle: Vehicle, *, mass: float, volume: float) -> NDArray[np.float64]:
        """Return the net buoyancy [N] of the hull of `vehicle` with `mass` [kg] and `volume` [m³], engine at zero."""
        return net_buoyancy(
            mass=mass,
            volume=volume,
            buoyancy_volume=0.0,
            density=self.density,
            pressure=self.pressure,
            temperature=self.temperature,
            compressibility=vehicle["compressibility"],
            thermal_expansion=vehicle["thermal_expansion"],
            reference_temperature=vehicle["reference_temperature"],
        )

    def net_buoyancy(self, plan: Plan) -> NDArray[np.float64]:
        """Return the net buoyancy of `plan`'s vehicle here, N, with the engine at zero."""
        return self.lift(plan.vehicle, mass=plan.vehicle["mass"], volume=plan.volume)

    def carried_weight(self, plan: Plan) -> NDArray[np.float64]:
        """Return what the water in the fairing of `plan`'s vehicle weighs once it is the water here, N.

        Its potential density less 1000 kg/m³ is weighed: a constant changes nothing.
        """
        return fairing_of(plan.vehicle).share * GRAVITY * plan.volume * self.potential_density


def _conservative(
    plan: Plan, pressure: NDArray[np.float64], temperature: NDArray[np.float64], salinity: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return absolute salinity, g/kg, and conservative temperature, °C."""
    absolute = (
        np.zeros_like(salinity)
        if plan.water.fresh
        else gsw.SA_from_SP(salinity, pressure, plan.longitude, plan.latitude)
    )
    return absolute, gsw.CT_from_t(absolute, temperature, pressure)


def _weight(plan: Plan, deepest: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return depths [m] from the surface to `deepest` and the pressure [dbar] of the water above each."""
    depth = np.linspace(0.0, deepest, max(int(deepest / _STEP), 1) + 1)
    temperature, salinity = plan.water.at(depth)
    pressure = gsw.p_from_z(-depth, plan.latitude)
    for _ in range(3):  # density hardly depends on pressure: converges by a factor 200 a time
        density = gsw.rho(*_conservative(plan, pressure, temperature, salinity), pressure)
        weight = density * gsw.grav(plan.latitude, pressure)
        layers = 0.5 * (weight[1:] + weight[:-1]) * np.diff(depth)
        pressure = np.concatenate([[0.0], np.cumsum(layers)]) / PASCAL_PER_DBAR
    return depth, pressure


def engine_volume(plan: Plan, force: float) -> float:
    """Return the engine's volume, m³, that makes the net buoyancy of `plan` equal `force` N at its nominal depth."""
    sea = Sea.of(plan, np.array([plan.nominal_depth]))
    return float((force - sea.net_buoyancy(plan)[0]) / (GRAVITY * sea.density[0]))

"""A fleet of simulated missions drawn at random, each with its truth: what the estimator's intervals are held to.

A seed gives a vehicle, a mission, a sea and a set of instruments. The vehicle that flies has coefficients of its own,
drawn around those of its file with their stated 1-sigma; the estimator gets the file. The pitch bias and the constant
part of net buoyancy are drawn with the 1-sigma that the mission states; the water that its fairing carries along, of
which no file says anything, as widely as the estimator takes it to be open.

Vehicles are all those of the package whose own lift, drag, mass and hull are known. What the simulated dynamics need
beyond that and a file leaves unknown is made up: pitching moments as Petrel-II's in proportion to the lift slope, pitch
inertia and battery in proportion to mass, and added mass as Slocum's (0.2 of the mass along the nose, 0.92 normal to
the wings; Merckelbach et al. 2019, doi:10.1175/JTECH-D-18-0168.1). Batteries move far enough to hold any pitch ordered.

Three things are not left to chance, as no pilot would: no glide is ordered flatter than the true vehicle's flattest
one; where a draw of sea, depth and hull would turn net buoyancy about on the way, thermocline and depth are reduced
until it does not; and a mission that its vehicle does not carry out, because it tumbles, is drawn again.

What has a stated 1-sigma is drawn from Latin hypercubes, one for every `CUBE` seeds (McKay, Beckman & Conover 1979,
doi:10.2307/1268522): the lift of a vehicle decides whether the intervals of a whole mission hold, and how many of a
few hundred vehicles have one far from their file's would otherwise be chance.
"""

from __future__ import annotations

import functools
import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import norm, qmc

from pipeline import instruments, mission, vehicle
from pipeline.findings import InputError
from pipeline.ingest import ingest
from pipeline.mission import Mission, PitchCorrection
from pipeline.model.closure import glide_angle
from pipeline.model.exchange import CARRIED_STD, FLUSHING_BEFORE
from pipeline.model.forces import GRAVITY
from pipeline.model.steady import trim_at_pitch
from pipeline.plan import Plan, Sea, Stage, Water, engine_volume
from pipeline.simulate import Injection, Simulated, run
from pipeline.vehicle import Vehicle

#: Ranges that the missions are drawn from, least and greatest.
PITCH_DEG = (15.0, 50.0)
NET_BUOYANCY = (2.0, 12.0)
WATER_STD, WATER_TIME = (0.0, 0.03), (100.0, 1000.0)
PITCH_NOISE_DEG, DEPTH_NOISE = (0.05, 0.5), (0.01, 0.10)
SAMPLING_S = (1.0, 8.0)
#: Sampling as in logs sent home during a mission.
SPARSE_S = (20.0, 60.0)
LOST = (0.0, 0.2)
PAUSE_S = (60.0, 300.0)
DIVES, DEPTH = (2, 6), (50.0, 1000.0)
PROPELLER_RPM = (600.0, 1400.0)
STATED_PITCH_STD_DEG, STATED_BALLAST_STD = (0.1, 0.5), (0.1, 0.5)
#: Propeller in level flight: slower, it does not drive a light vehicle down again.
LEVEL_RPM = (750.0, 1000.0)
#: Most records of a mission.
RECORDS = 15_000
#: Share of missions flown by the one vehicle with a thrust law, and of those under power.
WITH_PROPELLER, POWERED = 0.4, 0.65
#: Net buoyancy left everywhere on the way, N; margin over the flattest glide, degrees; s afloat between dives.
LEAST_FORCE, MARGIN_DEG, AFLOAT_S = 0.8, 2.0, 300.0
#: Climbs unlike dives differ by up to this factor in pitch, and in net buoyancy.
UNEQUAL = 1.5
#: Rate at which the ordered pitch turns from dive to climb, °/s; pumps take as long to turn net buoyancy about.
TURNING_DEG_S = 1.5
#: Righting moment of what is made up over Petrel-II's: a vehicle must not tumble when it slows down at the turn.
BOTTOM_HEAVY = 2.5
#: A thermocline of this, K, is as weak as it is made.
WEAK = 0.5
#: What nobody states, and the estimator takes from a prior of its own: the water a fairing carries along.
FAIRING = ("carried_water", "flushing_time")
#: Seeds of one Latin hypercube.
CUBE = 200
#: So many missions with one seed are drawn before it is given up.
DRAWS = 5
#: Beyond this α (rad) the flow is separated; a vehicle for which it is so longer than this share of its time under way
#: does not fly: turning points take less.
STALLED, TUMBLING = 0.3, 0.02
#: Path angles of powered level flight and of the nose-down corrections between, degrees.
RISING_DEG, CORRECTING_DEG = 5.0, -10.0


@dataclass(frozen=True)
class Flight:
    """One mission of the fleet.

    Attributes
    ----------
    seed, again
        What everything follows from: how often missions with this seed were drawn before that cannot be flown.
    plan
        What is flown; its vehicle has the true coefficients.
    injection
        True pitch bias and offset of net buoyancy.
    pitch_std_deg, ballast_std
        1-sigma of the two that the mission states, degrees and N.
    located
        Whether the logs carry fixes.
    power
        ``none``, ``climbs``, ``dives and climbs`` or ``level``: where the propeller turns.
    draws
        Standard normal numbers behind everything that has a stated 1-sigma, by coefficient, and ``pitch_bias`` and
        ``buoyancy_offset``.
    """

    seed: int
    again: int
    plan: Plan
    injection: Injection
    pitch_std_deg: float
    ballast_std: float
    located: bool
    power: str
    draws: Mapping[str, float]


class Flown(NamedTuple):
    """A mission as the estimator gets it, and its truth."""

    mission: Mission
    vehicle: Vehicle
    records: pd.DataFrame
    truth: pd.DataFrame


@functools.cache
def _load(name: str) -> Vehicle:
    return vehicle.load(name)


@functools.cache
def vehicles() -> list[str]:
    """Return the names of the vehicles whose polar, mass and hull are known, none of them assumed."""
    needed = ("lift_slope", "parasite_drag", "induced_drag", "mass", "compressibility", "thermal_expansion")
    found = {name: _load(name) for name in vehicle.names()}
    known = {name: one for name, one in found.items() if all(math.isfinite(one[key]) for key in needed)}
    return [name for name, one in known.items() if not one.assumed(needed)]


def complete(craft: Vehicle) -> Vehicle:
    """Return `craft` with what the simulated dynamics need and its file leaves unknown, see the module's text."""
    petrel = _load("petrel-ii")
    by_lift, by_mass = (craft[name] / petrel[name] for name in ("lift_slope", "mass"))
    made_up = {name: petrel[name] * by_lift for name in ("moment_at_zero", "moment_slope", "pitch_damping")}
    made_up |= {name: petrel[name] * by_mass for name in ("pitch_inertia", "battery_mass", "righting_moment")}
    made_up["righting_moment"] *= BOTTOM_HEAVY
    made_up |= {"mass_forward": 1.2 * craft["mass"], "mass_normal": 1.92 * craft["mass"]}
    missing = {
        name: value
        for name, value in made_up.items()
        if name not in craft.coefficients or math.isnan(craft.coefficients[name].value)
    }
    return craft.with_values(missing, "made up for the simulated dynamics")


def standard_normal(seed: int, again: int = 0) -> dict[str, float]:
    """Return a standard normal number for everything that has a stated 1-sigma.

    Over the `CUBE` seeds from one multiple of it to the next, the numbers of each name are spread evenly over their
    distribution, each name's on its own. They have coefficients' names, and ``pitch_bias`` and ``buoyancy_offset``.
    """
    block, place = divmod(seed, CUBE)
    return dict(zip(_names(), _cube(block, again)[place].tolist(), strict=True))


@functools.cache
def _names() -> list[str]:
    """Return the names of what has a stated 1-sigma."""
    stated = {"pitch_bias", "buoyancy_offset", *FAIRING}
    return sorted(stated.union(*(_load(name).coefficients for name in vehicle.names())))


@functools.cache
def _cube(block: int, again: int) -> np.ndarray:
    """Return standard normal numbers, shape (`CUBE`, names)."""
    rng = np.random.default_rng([block, 0xCBE, again])
    return np.asarray(norm.ppf(qmc.LatinHypercube(len(_names()), rng=rng).random(CUBE)))


def perturbed(craft: Vehicle, draws: Mapping[str, float]) -> Vehicle:
    """Return `craft` with every coefficient off its value by as many 1-sigma as `draws` has under its name.

    See `spread` for how they are distributed.
    """
    changes = {name: spread(value, std, draws[name]) for name, (value, std) in _open(craft).items()}
    if "carried_water" not in craft.coefficients:
        changes["carried_water"] = CARRIED_STD * abs(draws["carried_water"])
        changes["flushing_time"] = FLUSHING_BEFORE * math.exp(draws["flushing_time"])
    return craft.with_values(changes, "drawn around the vehicle file")


def spread(value: float, std: float, draw: float) -> float:
    """Return a coefficient that is `draw` 1-sigma off its value.

    One that is not zero keeps its sign: it is log-normal with the value as mean and `std` as standard deviation. One
    that is zero is normal.
    """
    if not value:
        return draw * std
    width = math.log1p((std / value) ** 2)
    return value * math.exp(draw * math.sqrt(width) - 0.5 * width)


def used(craft: Vehicle, draws: Mapping[str, float]) -> dict[str, float]:
    """Return those of `draws` that a mission of `craft` depends on."""
    return {name: draws[name] for name in sorted({*_open(craft), *FAIRING, "pitch_bias", "buoyancy_offset"})}


def _open(craft: Vehicle) -> dict[str, tuple[float, float]]:
    """Return value and 1-sigma of the coefficients of `craft` that have both."""
    known = {name: (one.value, one.std) for name, one in sorted(craft.coefficients.items())}
    return {name: (value, std) for name, (value, std) in known.items() if math.isfinite(value) and std > 0.0}


def plan_of(seed: int, again: int = 0, sampling: tuple[float, float] = SAMPLING_S) -> Flight:
    """Return the mission with this `seed`, drawn `again` so often: the same every time, whatever was drawn before.

    Its CTD and attitude sensor are sampled every so many seconds, between the two of `sampling`.
    """
    rng = np.random.default_rng([seed, 0xF1EE7, again])
    named = vehicles()
    propelled = [name for name in named if _load(name).propeller is not None]
    gliding = [name for name in named if name not in propelled]
    name = str(rng.choice(propelled if rng.uniform() < WITH_PROPELLER else gliding))
    draws = used(_load(name), standard_normal(seed, again))
    craft = complete(perturbed(_load(name), draws))
    pitch_std, ballast_std = rng.uniform(*STATED_PITCH_STD_DEG), rng.uniform(*STATED_BALLAST_STD)
    injection = Injection(
        pitch_bias_deg=draws["pitch_bias"] * pitch_std, buoyancy_offset=draws["buoyancy_offset"] * ballast_std
    )
    power = "none"
    if name in propelled and rng.uniform() < POWERED:
        power = str(rng.choice(["climbs", "dives and climbs", "level"]))
    plan = replace(_instruments(rng, sampling), name=f"fleet-{seed}", vehicle=craft)
    plan = _mission(plan, _Orders.drawn(craft, power, rng), injection.buoyancy_offset, rng)
    return Flight(seed, again, plan, injection, pitch_std, ballast_std, bool(rng.uniform() < 0.7), power, draws)


def fly(flight: Flight) -> Flown:
    """Return the mission as the estimator gets it: flown, logged, and its logs read by the pipeline's own ingest."""
    return _logged(flight, run(flight.plan, flight.seed, flight.injection))


def first_flown(seed: int, sampling: tuple[float, float] = SAMPLING_S) -> tuple[Flight, Flown]:
    """Return the first mission with this `seed` that its vehicle carries out, sampled as in `plan_of`.

    Raises
    ------
    InputError
        If it carries out none of `DRAWS`.
    """
    for again in range(DRAWS):
        flight = plan_of(seed, again, sampling)
        try:
            simulated = run(flight.plan, flight.seed, flight.injection)
        except InputError as error:
            why = error
            continue
        if stalled(simulated.truth) < TUMBLING:
            return flight, _logged(flight, simulated)
        why = InputError(flight.plan.name, found="a vehicle that tumbles", expected="flight")
    raise why


def stalled(truth: pd.DataFrame) -> float:
    """Return the share of the time under way in which the flow is separated: the vehicle tumbles."""
    under_way = ~truth["afloat"].to_numpy()
    return float(np.mean(np.abs(truth["angle_of_attack"].to_numpy()[under_way]) > STALLED))


def _logged(flight: Flight, simulated: Simulated) -> Flown:
    streams = {name: frame for name, frame in simulated.streams.items() if flight.located or name != "gps"}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / flight.plan.name
        instruments.write(flight.plan, streams, folder, flight.seed)
        settings = mission.load(folder)
        settings = settings.model_copy(
            update={
                "pitch": PitchCorrection(std_deg=flight.pitch_std_deg),
                "ballast": settings.ballast.model_copy(update={"std": flight.ballast_std}),
            }
        )
        records = ingest(settings).records
    return Flown(settings, _load(settings.vehicle), records, simulated.truth)


def _between(rng: np.random.Generator, least: float, most: float) -> float:
    """Return a number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(math.log(least), math.log(most))))


def _instruments(rng: np.random.Generator, sampling: tuple[float, float]) -> Plan:
    """Return a plan with instruments, disturbances and place drawn; what is flown is put in later."""
    pauses = rng.uniform() < 0.5
    return Plan(
        name="",
        description="A mission drawn at random.",
        vehicle=_load("petrel-ii"),
        latitude=float(rng.uniform(-60.0, 60.0)),
        longitude=float(rng.uniform(-40.0, -20.0)),
        start=1.6e9,
        water=Water((0.0,), (10.0,), (35.0,)),
        nominal_depth=0.0,
        stages=(),
        vertical_water_std=float(rng.uniform(*WATER_STD)),
        vertical_water_time=_between(rng, *WATER_TIME),
        current_east=float(rng.uniform(-0.2, 0.2)),
        current_north=float(rng.uniform(-0.2, 0.2)),
        current_std=float(rng.uniform(0.0, 0.05)),
        current_time=_between(rng, 3600.0, 36000.0),
        battery_rate=8e-3,
        battery_range=0.3,
        pitch_slew_deg=TURNING_DEG_S,
        pitch_deadband_deg=0.1,
        ctd_s=_between(rng, *sampling),
        attitude_s=_between(rng, *sampling),
        engine_s=8.0,
        sample_noise={
            "pitch": _between(rng, *PITCH_NOISE_DEG),
            "pressure": _between(rng, *DEPTH_NOISE),  # 1 m of sea water is 1 dbar within 2 %
        },
        lost=float(rng.uniform(*LOST)),
        between_gaps=float(rng.uniform(1800.0, 7200.0)) if pauses else 5400.0,
        gap=PAUSE_S if pauses else (10.0, 40.0),
    )


@dataclass(frozen=True)
class _Orders:
    """Pitch [deg] and net buoyancy [N] of dives and climbs, propeller [rpm], and where the propeller turns."""

    dive_pitch: float
    climb_pitch: float
    sink: float
    rise: float
    rpm: float
    power: str
    level_rise: float
    band: float
    levels: int

    @classmethod
    def drawn(cls, craft: Vehicle, power: str, rng: np.random.Generator) -> _Orders:
        """Return orders for the true vehicle `craft`."""
        flattest = PITCH_DEG[0]
        while not glide_angle(craft.polar, 0.25, math.radians(flattest - MARGIN_DEG))[3]:
            flattest += 0.5
        dive, sink = float(rng.uniform(flattest, PITCH_DEG[1])), float(rng.uniform(*NET_BUOYANCY))
        steeper, stronger = rng.uniform(1.0 / UNEQUAL, UNEQUAL, 2)
        return cls(
            dive_pitch=-dive,
            climb_pitch=dive if rng.uniform() < 0.6 else float(np.clip(steeper * dive, flattest, PITCH_DEG[1])),
            sink=-sink,
            rise=sink if rng.uniform() < 0.5 else float(np.clip(stronger * sink, *NET_BUOYANCY)),
            rpm=float(rng.uniform(*PROPELLER_RPM)),
            power=power,
            level_rise=float(rng.uniform(2.0, 4.0)),
            band=float(rng.uniform(4.0, 10.0)),
            levels=int(rng.integers(2, 6)),
        )

    def stages(self, craft: Vehicle, depth: float, headings: np.ndarray) -> tuple[Stage, ...]:
        """Return the orders of one dive per heading [deg] to `depth` m, and of the surface before, between, after."""
        stages: list[Stage] = []
        diving = self.rpm if self.power == "dives and climbs" else 0.0
        climbing = self.rpm if self.power in ("climbs", "dives and climbs") else 0.0
        afloat = {"end": "duration", "value": AFLOAT_S, "afloat": True}
        for heading in headings.tolist():
            stages.append(Stage(self.dive_pitch, self.rise, heading, **afloat))  # type: ignore[arg-type]
            stages.append(Stage(self.dive_pitch, self.sink, heading, "deeper", depth, rpm=diving))
            if self.power == "level":
                rpm = min(max(self.rpm, LEVEL_RPM[0]), LEVEL_RPM[1])
                up, down = (_pitch_for(craft, angle, self.level_rise, rpm) for angle in (RISING_DEG, CORRECTING_DEG))
                for _ in range(self.levels):
                    stages.append(Stage(up, self.level_rise, heading, "shallower", depth - self.band, rpm=rpm))
                    stages.append(Stage(down, self.level_rise, heading, "deeper", depth, rpm=rpm))
            elif climbing:
                stages.append(Stage(self.climb_pitch, self.rise, heading, "duration", 90.0))
            stages.append(Stage(self.climb_pitch, self.rise, heading, "surface", rpm=climbing))
        stages.append(Stage(self.dive_pitch, self.rise, headings.tolist()[-1], **afloat))  # type: ignore[arg-type]
        return tuple(stages)

    @property
    def pump_rate(self) -> float:
        """Rate of the engine, m³/s, that turns net buoyancy about while the pitch turns."""
        turning = (self.climb_pitch - self.dive_pitch) / TURNING_DEG_S
        return (self.rise - self.sink) / (GRAVITY * 1025.0) / turning

    def duration(self, craft: Vehicle, depth: float, dives: int) -> float:
        """Return about how long a mission of `dives` dives to `depth` m takes, s."""
        steady = trim_at_pitch(craft, [self.sink, self.rise], np.radians([self.dive_pitch, self.climb_pitch]))
        rate = np.abs(steady.speed * np.sin(steady.path_angle))
        level = self.levels * 50.0 * self.band if self.power == "level" else 0.0
        return float(dives * (np.sum(depth / rate) + level + 2.0 * AFLOAT_S))


def _pitch_for(craft: Vehicle, path_deg: float, force: float, rpm: float) -> float:
    """Return the pitch [deg] at which `craft` under power with net buoyancy `force` [N] flies at a path angle [deg]."""
    pitch = np.arange(-40.0, 40.0, 0.25)
    path = trim_at_pitch(craft, force, np.radians(pitch), propeller_speed=rpm / 60.0).path_angle
    return float(pitch[np.nanargmin(np.abs(path - math.radians(path_deg)))])


def _mission(plan: Plan, orders: _Orders, offset: float, rng: np.random.Generator) -> Plan:
    """Return `plan` with orders and a sea in which they can be carried out, within `RECORDS` records."""
    craft = plan.vehicle
    depth, dives = _between(rng, *DEPTH), int(rng.integers(DIVES[0], DIVES[1] + 1))
    warm, salty = float(rng.uniform(0.0, 15.0)), float(rng.uniform(0.0, 1.0))
    deep, mixed = float(rng.uniform(3.0, 9.0)), float(rng.uniform(20.0, 150.0))
    east = float(rng.uniform(0.0, 360.0))
    headings = (east + np.resize(rng.permutation([0.0, 180.0, 90.0, 270.0]), DIVES[1])) % 360.0
    per_second = 1.0 / plan.ctd_s + 1.0 / plan.attitude_s + 1.0 / plan.engine_s
    while orders.duration(craft, depth, dives) * per_second > RECORDS:
        if depth > 1.2 * DEPTH[0]:
            depth *= 0.9
        elif dives > DIVES[0]:
            dives -= 1
        else:
            break
    while True:
        plan = replace(
            plan,
            pump_rate=orders.pump_rate,
            water=_water(warm, salty, deep, mixed),
            nominal_depth=round(0.5 * depth, 1),
            stages=orders.stages(craft, round(depth, 1), headings[:dives]),
            longest=3.0 * orders.duration(craft, depth, dives) + 7200.0,
        )
        if _carried_out(plan, orders, offset, depth):
            return plan
        if warm > WEAK:
            warm, salty = 0.8 * warm, 0.8 * salty
        elif depth > DEPTH[0]:
            depth = max(0.9 * depth, DEPTH[0])
        else:  # it is the offset that turns the sign
            orders = replace(orders, sink=1.1 * orders.sink, rise=1.1 * orders.rise)


def _water(warm: float, salty: float, deep: float, mixed: float) -> Water:
    """Return a sea `deep` °C at depth, `warm` K warmer and `salty` fresher above a thermocline at `mixed` m."""
    depth = np.array([0.0, 25.0, 50.0, 75.0, 100.0, 150.0, 200.0, 300.0, 400.0, 600.0, 800.0, 1150.0])
    above = 1.0 / (1.0 + np.exp((depth - mixed) / (0.4 * mixed)))
    return Water(tuple(depth.tolist()), tuple((deep + warm * above).tolist()), tuple((35.0 - salty * above).tolist()))


def _carried_out(plan: Plan, orders: _Orders, offset: float, depth: float) -> bool:
    """Return whether net buoyancy keeps its sign, by `LEAST_FORCE`, at every depth of dives and climbs.

    Whatever water the fairing carries along is of one of these depths.
    """
    sea = Sea.of(plan, np.linspace(0.0, depth + 20.0, 60))
    hull = sea.net_buoyancy(plan) + offset
    sinking, rising = (
        hull + GRAVITY * sea.density * engine_volume(plan, force) for force in (orders.sink, orders.rise)
    )
    least = LEAST_FORCE + float(np.ptp(sea.carried_weight(plan)))
    return bool(sinking.max() < -least and rising.min() > least)

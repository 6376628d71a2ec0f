"""Missions whose truth is known: a plan flown with the full longitudinal dynamics and seen through instruments.

Vertical water velocity, current and heading wander are Gauss-Markov sequences; all random numbers are drawn
beforehand, each sequence with a generator of its own, so that a seed gives the same mission to the last bit.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline import instruments, trials
from pipeline.findings import InputError
from pipeline.model.dynamics import Body, body_of
from pipeline.model.exchange import fairing_of
from pipeline.model.forces import GRAVITY, propeller_of
from pipeline.model.motion import SPACING
from pipeline.plan import Plan, Sea, engine_volume
from pipeline.records import TIME, Column, timestamps
from pipeline.store import write_table
from pipeline.vehicle import Polar, Vehicle
from pipeline.voyage import AFTER, DEEPER, SHALLOWER, TICK, Rig, fly, gauss_markov

TRUTH = (
    TIME,
    Column("speed", "m/s", "speed through water V; 0 while afloat"),
    Column("path_angle", "rad", "flight-path angle through water, climbing positive"),
    Column("angle_of_attack", "rad", "angle of attack, flow from below positive"),
    Column("pitch", "rad", "pitch, nose up positive"),
    Column("pitch_rate", "rad/s", "rate of pitch"),
    Column("depth", "m", "depth, positive down"),
    Column("vertical_water_velocity", "m/s", "vertical velocity of the water, up positive; 0 while afloat"),
    Column("net_buoyancy", "N", "net buoyancy force, up positive, as if submerged"),
    Column("thrust", "N", "propeller thrust"),
    Column("propeller_speed", "rev/s", "propeller speed"),
    Column("current_east", "m/s", "eastward velocity of the water"),
    Column("current_north", "m/s", "northward velocity of the water"),
    Column("east", "m", "distance east of the start"),
    Column("north", "m", "distance north of the start"),
    Column("heading", "rad", "heading, true north, 0 to 2 pi"),
    Column("buoyancy_volume", "m3", "buoyancy engine, positive = light"),
    Column("battery_position", "m", "battery position as logged, positive forward"),
    Column("afloat", "", "at the surface, antenna out", "bool"),
    Column("stage", "", "number of the order in the plan", "int32"),
)

#: Depth, m, at which a climb has reached the surface.
SURFACE = 0.5
#: Depth, m, from which an order to float takes a vehicle to the surface in no time.
AT_SURFACE = 5.0
#: How far the table of the water column reaches below the deepest order, m.
MARGIN = 120.0
HEADING_WANDER_TIME = 60.0

_ENDS = {"duration": AFTER, "deeper": DEEPER, "shallower": SHALLOWER, "surface": SHALLOWER}


@dataclass(frozen=True)
class Injection:
    """What is wrong with the vehicle and not in its file nor its logs: for the later stages to find.

    Attributes
    ----------
    extra_parasite_drag
        Added to K_D0, kg/m.
    thrust_scale
        Factor on the thrust.
    thrust_by_voltage
        Relative change of thrust per relative change of the battery's voltage since the start.
    buoyancy_offset
        Added to the net buoyancy, N, up positive.
    pitch_bias_deg
        Logged less true pitch, degrees; the autopilot is misled by it too.
    battery_offset
        True less logged battery position, m, forward positive.
    """

    extra_parasite_drag: float = 0.0
    thrust_scale: float = 1.0
    thrust_by_voltage: float = 0.0
    buoyancy_offset: float = 0.0
    pitch_bias_deg: float = 0.0
    battery_offset: float = 0.0

    def into(self, vehicle: Vehicle) -> Vehicle:
        """Return `vehicle` as it truly flies."""
        changes = {"parasite_drag": vehicle["parasite_drag"] + self.extra_parasite_drag}
        if vehicle.propeller is not None:
            changes |= {name: vehicle[name] * self.thrust_scale for name in ("thrust_static", "thrust_slope")}
        return vehicle.with_values(changes, "injected")


@dataclass(frozen=True)
class Simulated:
    """A simulated mission.

    Attributes
    ----------
    truth
        What happened, every second; columns of `TRUTH`.
    streams
        What each instrument saw, on its own clock: ``time`` [s since 1970-01-01 UTC] and columns named as in
        `pipeline.records.MEASURED`, in SI and radians; keys ``ctd``, ``attitude``, ``engine``, ``gps``; where the plan
        has them, ``gyro``, ``battery``.
    """

    truth: pd.DataFrame
    streams: dict[str, pd.DataFrame] = field(default_factory=dict)


def run(plan: Plan, seed: int = 0, injection: Injection | None = None) -> Simulated:
    """Return the simulated mission `plan`: what happened, and what the instruments saw.

    The same plan, seed and injection give the same numbers to the last bit.

    Parameters
    ----------
    plan
        What is flown, where, in which water.
    seed
        Seed of all random numbers (PCG64); every disturbance and instrument has a sequence of its own.
    injection
        What is wrong with the vehicle; nothing if left out.

    Raises
    ------
    InputError
        If the vehicle file leaves a coefficient of the dynamics unknown, or the orders cannot be carried out.
    """
    injection = injection or Injection()
    vehicle = injection.into(plan.vehicle)
    needed = (*Body._fields, *Polar._fields, "reference_density", "mass", "battery_mass", "compressibility")
    unknown = [name for name in (*needed, "thermal_expansion") if math.isnan(vehicle[name])]
    if unknown:
        raise InputError(
            f"{plan.vehicle.name}.yaml",
            unknown[0],
            found="no value",
            expected="a number, to simulate the dynamics",
            remedy="choose a vehicle with a full set, such as petrel-ii",
        )
    values, finished = fly(
        _orders(plan),
        _disturbances(plan, seed, injection),
        body_of(vehicle),
        vehicle.polar,
        propeller_of(vehicle),
        _rig(plan, vehicle, injection),
        _column(plan, injection),
    )
    if not finished:
        stage = plan.stages[int(values[-1, 17])]
        raise InputError(
            plan.name,
            f"order {int(values[-1, 17]) + 1} of {len(plan.stages)}",
            found=f"not done after {len(values) * TICK:.0f} s, at {values[-1, 4]:.0f} m",
            expected=f"{stage.end} {stage.value:g}",
            remedy="change the order's net buoyancy or pitch, or let the mission last longer",
        )
    surfaced = np.flatnonzero((values[1:, 16] > 0.5) & (values[:-1, 16] < 0.5) & (values[:-1, 4] > AT_SURFACE)) + 1
    if surfaced.size:
        first = values[surfaced[0]]
        raise InputError(
            plan.name,
            f"order {int(first[17]) + 1} of {len(plan.stages)}",
            found=f"afloat at {values[surfaced[0] - 1, 4]:.0f} m",
            expected="an order to float at the surface",
            remedy="end the order before it at the surface",
        )
    truth = _truth(plan, values)
    return Simulated(truth, instruments.observe(plan, truth, seed, math.radians(injection.pitch_bias_deg)))


def simulate(trial: str, out: Path, *, seed: int = 0, injection: Injection | None = None) -> None:
    """Write a trial to folder `out`: ctd.csv, attitude.csv, engine.csv, gps.csv, mission.yaml and truth.parquet.

    Parameters
    ----------
    trial
        Name of the trial, see `pipeline.trials.TRIALS`.
    out
        Folder of the mission; created if need be.
    seed, injection
        As for `run`.

    Raises
    ------
    InputError
        If there is no such trial; the nearest is named. If `out` holds files and is no mission that was simulated.
    """
    plan = trials.trial(trial)
    injection = injection or Injection()
    if out.is_dir() and any(out.iterdir()) and not (out / "truth.parquet").is_file():
        raise InputError(
            out.name or str(out),
            found="a folder with files that no simulation wrote",
            expected="a new or empty folder, or that of a simulated mission",
            remedy="nothing was written; name another",
        )
    simulated = run(plan, seed, injection)
    instruments.write(plan, simulated.streams, out, seed)
    true = injection.into(plan.vehicle)
    metadata = {
        "trial": plan.name,
        "seed": str(seed),
        "coefficients": json.dumps({key: true[key] for key in true.coefficients}),
        "injection": json.dumps(asdict(injection)),
    }
    write_table(out / "truth.parquet", simulated.truth, TRUTH, metadata)


def _orders(plan: Plan) -> NDArray[np.float64]:
    """Return the orders of `plan` as numbers for `fly`, shape (m, 7)."""
    rows = [
        (
            math.radians(stage.pitch_deg),
            engine_volume(plan, stage.net_buoyancy),
            stage.rpm / 60.0,
            math.radians(stage.heading_deg),
            _ENDS[stage.end],
            SURFACE if stage.end == "surface" else stage.value,
            float(stage.afloat),
        )
        for stage in plan.stages
    ]
    return np.array(rows)


def _disturbances(plan: Plan, seed: int, injection: Injection) -> NDArray[np.float64]:
    """Return w_w, current east and north [m/s], heading wander [rad], factor on thrust, each second, shape (k, 5)."""
    count = int(plan.longest / TICK) + 2
    white = [
        instruments.generator(seed, plan, name).standard_normal(count) for name in ("w", "east", "north", "wander")
    ]
    factor = np.ones(count)
    if plan.battery_full:
        voltage = plan.voltage(TICK * np.arange(count, dtype=np.float64))
        factor += injection.thrust_by_voltage * (voltage / plan.battery_full - 1.0)
    return np.column_stack(
        [
            gauss_markov(white[0], plan.vertical_water_std, plan.vertical_water_time),
            plan.current_east + gauss_markov(white[1], plan.current_std, plan.current_time),
            plan.current_north + gauss_markov(white[2], plan.current_std, plan.current_time),
            gauss_markov(white[3], math.radians(plan.heading_wander_deg), HEADING_WANDER_TIME),
            factor,
        ]
    )


def _rig(plan: Plan, vehicle: Vehicle, injection: Injection) -> Rig:
    return Rig(
        reference_density=vehicle["reference_density"],
        battery_weight=vehicle["battery_mass"] * GRAVITY,
        battery_neutral=vehicle["battery_neutral_position"],
        battery_offset=injection.battery_offset,
        righting_moment=vehicle["righting_moment"],
        flushing_time=fairing_of(vehicle).time,
        pitch_bias=math.radians(injection.pitch_bias_deg),
        pump_rate=plan.pump_rate,
        battery_rate=plan.battery_rate,
        battery_range=plan.battery_range,
        propeller_ramp=plan.propeller_ramp,
        turn_rate=math.radians(plan.turn_rate_deg),
        pitch_slew=math.radians(plan.pitch_slew_deg),
        deadband=math.radians(plan.pitch_deadband_deg),
        gain_proportional=plan.gain_proportional,
        gain_integral=plan.gain_integral,
        substeps=math.ceil(TICK / plan.step),
    )


def _column(plan: Plan, injection: Injection) -> NDArray[np.float64]:
    """Return the water column as `voyage.fly` takes it, every `SPACING` metres down, shape (n, 3)."""
    deepest = max((stage.value for stage in plan.stages if stage.end in ("deeper", "shallower")), default=0.0)
    sea = Sea.of(plan, np.arange(0.0, deepest + MARGIN, SPACING))
    hull = sea.net_buoyancy(plan) + injection.buoyancy_offset
    return np.column_stack([hull, sea.density, sea.carried_weight(plan)])


def _truth(plan: Plan, values: NDArray[np.float64]) -> pd.DataFrame:
    """Return what `fly` recorded as the table `TRUTH`."""
    return pd.DataFrame(
        {
            "time": timestamps(plan.start + TICK * np.arange(len(values))),
            "speed": values[:, 0],
            "path_angle": values[:, 1],
            "angle_of_attack": values[:, 2],
            "pitch": values[:, 1] + values[:, 2],
            "pitch_rate": values[:, 3],
            "depth": values[:, 4],
            "vertical_water_velocity": values[:, 11],
            "net_buoyancy": values[:, 14],
            "thrust": values[:, 15],
            "propeller_speed": values[:, 9],
            "current_east": values[:, 12],
            "current_north": values[:, 13],
            "east": values[:, 5],
            "north": values[:, 6],
            "heading": values[:, 10] % (2.0 * math.pi),
            "buoyancy_volume": values[:, 7],
            "battery_position": values[:, 8],
            "afloat": values[:, 16] > 0.5,
            "stage": values[:, 17].astype(np.int32),
        }
    )

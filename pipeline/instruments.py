"""Instruments of a simulated vehicle: each on its own clock, with noise, quantisation, offsets and gaps.

The pitch alone has no offset of its own: its bias is injected, or is none.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import gsw
import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray

from pipeline.geodesy import radii
from pipeline.mission import FILE, Mission
from pipeline.plan import Plan, Sea
from pipeline.records import seconds
from pipeline.store import write_text

Clock = NDArray[np.float64]


class Channel(NamedTuple):
    """What an instrument does to a quantity and how it writes it down, in the units of the log.

    `scale` turns SI into the log's unit; `offset` is the 1-sigma of a constant drawn once, `noise` that of every
    sample unless the plan has another; the log keeps `decimals`.
    """

    column: str
    unit: str
    scale: float
    offset: float
    noise: float
    decimals: int


DEGREES = 180.0 / math.pi
LOGS: dict[str, dict[str, Channel]] = {
    "ctd": {
        "pressure": Channel("pressure", "dbar", 1.0, 0.03, 0.02, 2),
        "temperature": Channel("temperature", "degC", 1.0, 0.002, 0.002, 3),
        "conductivity": Channel("conductivity", "S/m", 1.0, 0.0003, 0.0002, 4),
    },
    "attitude": {
        "pitch": Channel("pitch", "deg", DEGREES, 0.0, 0.2, 1),
        "roll": Channel("roll", "deg", DEGREES, 0.3, 0.2, 1),
        "heading": Channel("heading", "deg", DEGREES, 0.5, 0.5, 1),
    },
    "gyro": {
        "pitch_rate": Channel("pitch_rate", "deg/s", DEGREES, 0.2, 0.05, 3),
    },
    "engine": {
        "buoyancy_volume": Channel("oil", "cc", 1e6, 0.0, 0.5, 0),
        "battery_position": Channel("battery", "mm", 1e3, 0.0, 0.05, 1),
        "propeller_speed": Channel("propeller", "rpm", 60.0, 0.0, 1.0, 0),
    },
    "battery": {
        "battery_voltage": Channel("battery_voltage", "V", 1.0, 0.05, 0.02, 2),
    },
    "gps": {
        "latitude": Channel("latitude", "deg", 1.0, 0.0, 0.0, 6),
        "longitude": Channel("longitude", "deg", 1.0, 0.0, 0.0, 6),
    },
}

#: Bank angle per rate of turn, s.
BANKING = 2.0
#: 1-sigma of a fix in each direction, m.
GPS_NOISE = 3.0
#: Jitter of a clock as a share of its interval.
JITTER = 0.02


def generator(seed: int, plan: Plan, name: str) -> np.random.Generator:
    """Return the random numbers of what is called `name` in `plan`: a PCG64 sequence of its own for every `seed`."""
    return np.random.Generator(np.random.PCG64([seed, zlib.crc32(f"{plan.name}/{name}".encode())]))


def observe(plan: Plan, truth: pd.DataFrame, seed: int, pitch_bias: float) -> dict[str, pd.DataFrame]:
    """Return what the instruments of `plan` saw of `truth`, in SI and radians, each stream on its own clock.

    Parameters
    ----------
    plan
        Sampling intervals, water and place.
    truth
        Columns of `pipeline.simulate.TRUTH`.
    seed
        Seed of noise, clocks and gaps.
    pitch_bias
        Logged less true pitch, rad.

    Returns
    -------
    dict of str to DataFrame
        Per key of `LOGS`: ``time`` [s since 1970-01-01 UTC] and the quantities, noisy and quantised.
    """
    time = seconds(truth["time"])
    heading = np.unwrap(truth["heading"].to_numpy())
    motion = {
        "depth": truth["depth"].to_numpy(),
        "pitch": truth["pitch"].to_numpy() + pitch_bias,
        "pitch_rate": truth["pitch_rate"].to_numpy(),
        "roll": BANKING * np.gradient(heading, time),
        "heading": heading,
        "battery_voltage": plan.voltage(time - plan.start),
        **{name: truth[name].to_numpy() for name in LOGS["engine"]},
    }
    streams = {}
    carried = {"ctd": plan.ctd_s, "attitude": plan.attitude_s, "engine": plan.engine_s, "gyro": plan.gyro_s}
    carried["battery"] = plan.engine_s if plan.battery_full else 0.0
    for name, interval in carried.items():
        if not interval:
            continue
        rng = generator(seed, plan, name)
        clock = _clock(rng, time[0], time[-1], interval, plan)
        seen = {key: np.interp(clock, time, value) for key, value in motion.items()}
        if name == "ctd":
            seen |= _water(plan, seen["depth"])
        streams[name] = _sampled(name, clock, seen, rng, plan.noise, plan.sample_noise)
    streams["gps"] = _fixes(plan, truth, time, generator(seed, plan, "gps"))
    return streams


def _clock(rng: np.random.Generator, start: float, end: float, interval: float, plan: Plan) -> Clock:
    """Return the instants of one instrument, s, increasing: its own start, jitter, losses and gaps."""
    noise = plan.noise
    clock = np.arange(start + interval * rng.uniform(), end, interval)
    clock = clock + noise * JITTER * interval * np.clip(rng.standard_normal(clock.size), -3.0, 3.0)
    kept = rng.uniform(size=clock.size) >= noise * plan.lost
    gaps = rng.poisson(noise * (end - start) / plan.between_gaps)
    begins, lengths = rng.uniform(start, end, gaps), rng.uniform(*plan.gap, gaps)
    for begin, length in zip(begins, lengths, strict=True):
        kept &= (clock < begin) | (clock > begin + length)
    return np.asarray(np.round(np.clip(clock, start, end)[kept], 3))


def _water(plan: Plan, depth: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return what a perfect CTD sees at `depth` [m]: dbar, °C, S/m."""
    sea = Sea.of(plan, depth)
    conductivity = gsw.C_from_SP(sea.salinity, sea.temperature, sea.pressure) / 10.0
    return {"pressure": sea.pressure, "temperature": sea.temperature, "conductivity": conductivity}


def _sampled(
    name: str,
    clock: Clock,
    seen: dict[str, NDArray[np.float64]],
    rng: np.random.Generator,
    noise: float,
    sample_noise: Mapping[str, float],
) -> pd.DataFrame:
    """Return the quantities of log `name` with offset, noise and the log's resolution, in SI."""
    frame = {"time": clock}
    for quantity, channel in LOGS[name].items():
        offset = channel.offset * rng.standard_normal()
        scatter = sample_noise.get(quantity, channel.noise) * rng.standard_normal(clock.size)
        logged = seen[quantity] * channel.scale + noise * (offset + scatter)
        if quantity == "propeller_speed":
            logged = np.where(seen[quantity] > 0.0, np.maximum(logged, 0.0), 0.0)
        logged = np.round(logged, channel.decimals)
        if quantity == "heading":
            logged = logged % 360.0
        frame[quantity] = logged / channel.scale
    return pd.DataFrame(frame)


def _fixes(plan: Plan, truth: pd.DataFrame, time: Clock, rng: np.random.Generator) -> pd.DataFrame:
    """Return the GPS fixes: at the surface only, after a while, every `Plan.gps_s`, with `GPS_NOISE`."""
    afloat = truth["afloat"].to_numpy()
    surfacing = afloat & ~np.concatenate([[False], afloat[:-1]])
    since = np.round(time - np.maximum.accumulate(np.where(surfacing, time, time[0])) - plan.gps_delay_s, 3)
    clock = time[afloat & (since >= 0.0) & (since % plan.gps_s < 1.0)] + plan.noise * rng.uniform(0.0, 0.5)
    east, north = (
        np.interp(clock, time, truth[name]) + plan.noise * GPS_NOISE * rng.standard_normal(clock.size)
        for name in ("east", "north")
    )
    meridian, prime = radii(plan.latitude)
    seen = {
        "latitude": plan.latitude + np.degrees(north / meridian),
        "longitude": plan.longitude + np.degrees(east / (prime * math.cos(math.radians(plan.latitude)))),
    }
    return _sampled("gps", np.round(clock, 3), seen, rng, 0.0, {})


def write(plan: Plan, streams: dict[str, pd.DataFrame], out: Path, seed: int) -> None:
    """Write the logs (CSV, times ISO 8601 in UTC) and mission.yaml of `plan` to folder `out`."""
    for name, frame in streams.items():
        write_text(out / f"{name}.csv", _csv(name, frame))
    write_text(out / FILE, _mission(plan, seed))


def _csv(name: str, frame: pd.DataFrame) -> str:
    """Return the log `name` as text: units in the header, as many digits as the instrument gives."""
    channels = LOGS[name]
    milliseconds = np.round(frame["time"].to_numpy() * 1e3).astype(np.int64).view("M8[ms]")
    columns = [[f"{stamp}Z" for stamp in np.datetime_as_string(milliseconds)]]
    for quantity, channel in channels.items():
        digits = f"%.{channel.decimals}f"
        # Adding zero turns -0.0 into 0.0.
        logged = np.round(frame[quantity].to_numpy() * channel.scale, channel.decimals) + 0.0
        columns.append([digits % value for value in logged])
    header = ",".join(["time", *(f"{channel.column} [{channel.unit}]" for channel in channels.values())])
    return "\n".join([header, *map(",".join, zip(*columns, strict=True))]) + "\n"


def _mission(plan: Plan, seed: int) -> str:
    """Return mission.yaml of `plan`; the engine's columns are mapped one by one, the others left to be recognised."""
    content: dict[str, Any] = {
        "vehicle": plan.vehicle.name,
        "description": f"Simulated (seatrial simulate {plan.name} OUT --seed {seed}). {plan.description}",
        "latitude": plan.latitude,
        "longitude": plan.longitude,
        "ballast": {"neutral_density": plan.neutral_density, "std": 0.3},
    }
    if plan.water.fresh:
        content["salinity"] = "fresh"
    if plan.minimum_block_s != Mission.model_fields["minimum_block_s"].default:
        content["minimum_block_s"] = plan.minimum_block_s
    content["files"] = {
        "engine.csv": {
            "columns": {
                quantity: {"column": f"{channel.column} [{channel.unit}]", "unit": channel.unit}
                for quantity, channel in LOGS["engine"].items()
            }
        }
    }
    content["nominal"] = [row.model_dump(exclude_defaults=True) for row in plan.nominal]
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=110)

"""A glider whose depth and pitch are known, as a frame and as plain tables in a mission's folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import gsw
import numpy as np
import pandas as pd
import pytest

from pipeline.mission import Mission, load

START = 1466553600.0  # 2016-06-22 00:00 UTC


@dataclass(frozen=True)
class Yo:
    """Legs flown at a constant speed along the nose: knots of depth over time, turns of 20 s, engine with them."""

    time: np.ndarray
    depth: np.ndarray
    pitch: np.ndarray
    volume: np.ndarray


def legs(depths: list[float], *, speed: float = 0.35, pitch_deg: float = 25.0, step: float = 1.0) -> Yo:
    """Return flight from depth to depth (m) at `speed` (m/s) and ±`pitch_deg`, sampled every `step` seconds."""
    rate = speed * np.sin(np.radians(pitch_deg))
    knots = np.r_[0.0, np.cumsum(np.abs(np.diff(depths)) / rate)]
    time = np.arange(0.0, knots[-1], step)
    depth = np.interp(time, knots, depths)
    sense = np.sign(np.diff(depths))
    leg = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(sense) - 1)
    target = -sense[leg] * np.radians(pitch_deg)
    width = max(1, round(20.0 / step))
    padded = np.pad(target, (width // 2, width - width // 2 - 1), mode="edge")
    pitch = np.convolve(padded, np.ones(width) / width, mode="valid")
    return Yo(START + time, depth, pitch, np.sign(pitch) * 230e-6 * np.minimum(1.0, np.abs(pitch) / np.radians(5.0)))


@pytest.fixture
def fly() -> Callable[..., Yo]:
    """How to fly: `legs`."""
    return legs


def frame_of(yo: Yo) -> pd.DataFrame:
    """Return the flight as one table, every instrument reporting on every row."""
    return pd.DataFrame(
        {
            "time": yo.time,
            "pressure": yo.depth,
            "depth": yo.depth,
            "pitch": yo.pitch,
            "buoyancy_volume": yo.volume,
        }
    )


@pytest.fixture
def table_of() -> Callable[[Yo], pd.DataFrame]:
    """How to make one table of a flight: `frame_of`."""
    return frame_of


def write(folder: Path, yo: Yo, yaml: str = "vehicle: petrel-ii\nlatitude: 54.75\nlongitude: 15.1\n") -> Mission:
    """Write ctd.csv, attitude.csv and mission.yaml into `folder`: salinity 35, temperature falling with depth."""
    folder.mkdir(parents=True, exist_ok=True)
    pressure = gsw.p_from_z(-yo.depth, 54.75)
    temperature = 15.0 - 0.01 * yo.depth
    pd.DataFrame(
        {
            "time": yo.time,
            "pressure (dbar)": pressure,
            "temperature (degC)": temperature,
            "conductivity (S/m)": gsw.C_from_SP(np.full(pressure.size, 35.0), temperature, pressure) / 10.0,
        }
    ).to_csv(folder / "ctd.csv", index=False)
    pd.DataFrame(
        {
            "time": yo.time[::4] + 0.3,
            "pitch (deg)": np.degrees(yo.pitch[::4]),
            "oil volume (cm3)": yo.volume[::4] * 1e6,
        }
    ).rename(columns={"oil volume (cm3)": "oil_volume (cm3)"}).to_csv(folder / "attitude.csv", index=False)
    (folder / "mission.yaml").write_text(yaml, encoding="utf-8")
    return load(folder)


@pytest.fixture
def mission(tmp_path: Path) -> Mission:
    """Return a mission of four yos to 80 m in plain tables."""
    return write(tmp_path / "trial", legs([0.0, *[80.0, 5.0] * 4, 0.0]))


@pytest.fixture
def write_mission() -> Callable[..., Mission]:
    """How to write a flight as a mission's folder: `write`."""
    return write

"""Synthetic missions for the tests of the report: steady flight solved here with scipy, apart from the package."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import brentq, root

from pipeline.mission import Mission
from pipeline.model.predict import predict
from pipeline.records import BLOCKS, ESTIMATES, RECORDS, STORED, conform, timestamps
from pipeline.report import Inputs
from pipeline.vehicle import Vehicle

START = 1.4e9
#: Petrel-II as printed by Niu et al. (2017), Section 4.
PETREL = {"lift_slope": 351.357, "parasite_drag": 7.3579, "induced_drag": 318.0849}
SETTINGS = {"sigma_w": 0.01, "tau_w": 300.0}


@cache
def steady(force: float, pitch: float, revolutions: float = 0.0, **changes: float) -> tuple[float, float]:
    """Return speed and path angle of Petrel-II at a held pitch from the force balance, by scipy's root."""
    c = PETREL | {"thrust": 1.0} | changes

    def balance(x: np.ndarray) -> list[float]:
        speed, alpha = x
        path = pitch - alpha
        push = 1020.0 * 0.08**3 * revolutions * (0.6136 * 0.08 * revolutions - 0.4091 * speed) * c["thrust"]
        lift = c["lift_slope"] * alpha * speed**2
        drag = (c["parasite_drag"] + c["induced_drag"] * alpha**2) * speed**2
        return [
            force * math.sin(path) - drag + push * math.cos(alpha),
            force * math.cos(path) + lift + push * math.sin(alpha),
        ]

    guess = [0.6 if not revolutions else 1.0, -0.02 * math.copysign(1.0, force)]
    found = root(balance, guess, tol=1e-14)
    assert np.max(np.abs(found.fun)) < 1e-9
    return float(found.x[0]), float(pitch - found.x[1])


@cache
def closure_angle(pitch: float, **changes: float) -> float:
    """Return the angle of attack of an unpowered glide at a pitch, by scipy's brentq; NaN where there is none."""
    c = PETREL | changes

    def balance(alpha: float) -> float:
        path = pitch - alpha
        return math.sin(path) * c["lift_slope"] * alpha + math.cos(path) * (
            c["parasite_drag"] + c["induced_drag"] * alpha**2
        )

    steepest = -math.copysign(math.sqrt(c["parasite_drag"] / c["induced_drag"]), pitch)
    if balance(steepest) > 0.0:
        return math.nan
    return float(brentq(balance, 0.0, steepest, xtol=1e-15))


def blocks(
    *,
    dives: int = 6,
    each: int = 4,
    pitches_deg: tuple[float, ...] = (25.0, 35.0),
    force: float = 5.0,
    spread: float = 0.3,
    sides: tuple[int, ...] = (-1, 1),
    powered_climbs: bool = False,
    extra_drag: float = 0.0,
    extra_force: float = 0.0,
    sigma_w: float = SETTINGS["sigma_w"],
    noise: float = 0.001,
    seed: int = 0,
    sensor: bool = False,
) -> pd.DataFrame:
    """Return steady blocks of a mission with a known truth, table `records.BLOCKS`.

    The logged net buoyancy lacks `extra_force`, the vehicle file `extra_drag`; `spread` is what the net buoyancy
    changes over one leg.
    """
    rng = np.random.default_rng(seed)
    length, pause = 300.0, 600.0
    rows: list[dict[str, Any]] = []
    clock = START
    for dive in range(1, dives + 1):
        pitch = math.radians(pitches_deg[(dive - 1) % len(pitches_deg)])
        for side in sides:
            powered = powered_climbs and side > 0
            for k in range(each):
                logged = side * force + spread * (k / max(each - 1, 1) - 0.5)
                turning = 1400.0 / 60.0 if powered else 0.0
                speed, path = steady(
                    logged + extra_force, side * pitch, turning, parasite_drag=PETREL["parasite_drag"] + extra_drag
                )
                rows.append(
                    {
                        "start_s": clock, "end_s": clock + length, "dive": dive, "direction": side, "powered": powered,
                        "true_speed": speed, "true_path": path, "pitch": side * pitch, "net_buoyancy": logged,
                        "propeller_speed": turning,
                    }
                )  # fmt: skip
                clock += length
            clock += pause
    frame = pd.DataFrame(rows)
    frame["water"] = _water(rng, frame, sigma_w)
    frame["depth_rate"] = -frame.pop("true_speed") * np.sin(frame["true_path"]) - frame.pop("water")
    frame["depth_rate"] += noise * rng.standard_normal(len(frame))
    truth = -(frame["depth_rate"]) / np.sin(frame["true_path"])
    alpha = np.array([closure_angle(pitch) for pitch in frame["pitch"]])
    path = frame["pitch"] - alpha
    gliding = ~frame["powered"]
    frame["angle_of_attack"] = np.where(gliding, alpha, frame["pitch"] - frame["true_path"])
    frame["path_angle"] = frame["pitch"] - frame["angle_of_attack"]
    frame["speed"] = np.where(gliding, np.abs(frame["depth_rate"] / np.sin(path)), np.abs(truth))
    frame["speed_std"] = 0.02
    frame["angle_of_attack_std"] = frame["path_angle_std"] = math.radians(0.4)
    frame["depth_rate_std"] = noise
    frame["pitch_std"] = math.radians(0.3)
    frame["net_buoyancy_std"] = 0.3
    frame["propeller_speed_std"] = 0.0
    frame["density"], frame["density_std"], frame["depth"] = 1020.0, 0.1, 200.0
    if sensor:
        exact = [
            steady(row.net_buoyancy + extra_force, row.pitch, row.propeller_speed,
                   parasite_drag=PETREL["parasite_drag"] + extra_drag)[0]
            for row in frame.itertuples()
        ]  # fmt: skip
        frame["sensor_speed"] = np.array(exact) + 0.003 * rng.standard_normal(len(frame))
        frame["sensor_speed_std"] = 0.003
    frame["block"] = np.arange(len(frame))
    frame["start"] = timestamps(frame.pop("start_s").to_numpy())
    frame["end"] = timestamps(frame.pop("end_s").to_numpy())
    frame["used"], frame["reason"] = True, ""
    return conform(frame.drop(columns=["true_path"]), BLOCKS)


def _water(rng: np.random.Generator, frame: pd.DataFrame, sigma: float, tau: float = 300.0) -> np.ndarray:
    """Return the block means of a Gauss–Markov process simulated in steps of 5 s."""
    step = 5.0
    start, end = frame["start_s"].to_numpy(), frame["end_s"].to_numpy()
    count = int((end[-1] - start[0]) / step) + 2
    keep = math.exp(-step / tau)
    w = np.empty(count)
    w[0] = rng.standard_normal()
    kicks = math.sqrt(1.0 - keep**2) * rng.standard_normal(count)
    for i in range(1, count):
        w[i] = keep * w[i - 1] + kicks[i]
    index = ((np.column_stack([start, end]) - start[0]) / step).astype(int)
    return sigma * np.array([w[a:b].mean() for a, b in index])


def level_blocks(count: int = 8) -> pd.DataFrame:
    """Return blocks of level flight under propeller at the settings of the paper's Danjiangkou trial."""
    frame = blocks(dives=count, each=1, sides=(1,), pitches_deg=(3.5,), force=2.5, spread=0.0)
    frame["powered"], frame["direction"] = True, 0
    frame["propeller_speed"] = 13.0
    speed, path = steady(2.5, math.radians(3.5), 13.0)
    frame["depth_rate"] = -speed * math.sin(path)
    for name in ("speed", "angle_of_attack", "path_angle"):
        frame[name] = frame[f"{name}_std"] = np.nan
    return conform(frame, BLOCKS)


def inputs(
    mission: Mission,
    vehicle: Vehicle,
    table: pd.DataFrame,
    *,
    observable: bool = True,
    stored: pd.DataFrame | None = None,
    estimate: dict[str, Any] | None = None,
    force: bool = False,
    findings: tuple[dict[str, str], ...] = (),
) -> Inputs:
    """Return what the earlier stages would hand over for the steady blocks `table`."""
    records = _records(table)
    rows = len(records)
    estimates = pd.DataFrame(
        {
            "time": records["time"],
            "dive": records["dive"],
            "method": "kinematic",
            "speed": 0.6 if observable else np.nan,
            "speed_std": 0.02 if observable else np.nan,
            "pitch": records["pitch"],
            "depth": records["depth"],
            "observable": np.full(rows, observable),
            "reason": "" if observable else "near level: depth carries no speed",
        }
    )
    return Inputs(
        mission=mission,
        vehicle=vehicle,
        records=records,
        estimates=conform(estimates, ESTIMATES),
        force=_by_force(records) if force else conform(estimates.iloc[:0], ESTIMATES),
        blocks=table,
        predictions=predict(vehicle, table),
        stored=stored,
        ingest={"format": "table", "constants": {}, "findings": list(findings)},
        estimate={"settings": SETTINGS, "findings": [], **(estimate or {})},
        provenance={
            "stages": {
                "ingest": {
                    "inputs": {"ctd.csv": "0" * 32},
                    "software": {"seatrial": "0.1.0", "numpy": "2.4", "code": "abc"},
                }
            }
        },
    )


def _by_force(records: pd.DataFrame) -> pd.DataFrame:
    """Return estimates by the force method, known everywhere."""
    values = {"speed": 0.58, "speed_std": 0.01, "angle_of_attack": 0.02, "angle_of_attack_std": 0.005,
              "vertical_water_velocity": 0.01, "vertical_water_velocity_std": 0.004}  # fmt: skip
    frame = records[["time", "dive", "pitch", "depth"]].assign(method="force", observable=True, reason="", **values)
    return conform(frame, ESTIMATES)


def _records(table: pd.DataFrame) -> pd.DataFrame:
    """Return records of a triangle in depth at 10 s, two legs a dive."""
    count = max(200 * int(table["dive"].max() if len(table) else 1), 200)
    time = START + 10.0 * np.arange(count)
    leg = np.arange(count) % 200
    depth = np.where(leg < 100, leg, 200 - leg) * 5.0
    pitch = np.radians(np.where(leg < 100, -30.0, 30.0))
    frame = pd.DataFrame(
        {
            "time": timestamps(time),
            "pressure": depth,
            "depth": depth,
            "temperature": 25.0 - depth / 40.0,
            "pitch": pitch,
            "buoyancy_volume": np.where(leg < 100, -5e-4, 5e-4),
            "dive": 1 + np.arange(count) // 200,
            "phase": np.where(leg < 100, 2, 1),
        }
    )
    for name in ("pressure", "temperature", "pitch", "buoyancy_volume"):
        frame[f"{name}_qc"] = 1
    return conform(frame, RECORDS)


def stored_model(table: pd.DataFrame, factor: float) -> pd.DataFrame:
    """Return a stored solution that is `factor` times what the blocks measured, sampled every 30 s."""
    rows = []
    for row in table.itertuples():
        for second in np.arange(0.0, 300.0, 30.0):
            rows.append(
                {
                    "time": row.start + pd.Timedelta(seconds=float(second)),
                    "speed": factor * row.speed,
                    "vertical_speed": -factor * row.depth_rate,
                }
            )
    return conform(pd.DataFrame(rows), STORED)

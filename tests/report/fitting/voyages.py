"""Passages whose truth is known: made of whole tables of records, or of numbers alone."""

import math

import numpy as np
import pandas as pd

from pipeline.geodesy import radii
from pipeline.records import RECORDS, conform, timestamps
from pipeline.report.fitting.passages import Passages, ThroughWater

START, LATITUDE, LONGITUDE = 1.4e9, 30.0, -40.0
AFLOAT_S, DIVE_S, STEP_S = 600.0, 4800.0, 10.0


def records(
    headings: list[tuple[float, ...]],
    *,
    speed: float = 0.3,
    current: complex = 0.1 - 0.05j,
    surface: complex = 0.3 + 0.2j,
    fixes_s: tuple[float, ...] = (60.0, 300.0, 540.0),
    compass: float = 0.0,
) -> pd.DataFrame:
    """Return records of dives, each on its headings [rad] one after the other, through a current and a surface drift.

    Fixes are taken `fixes_s` after coming up; the log's headings read `compass` [rad] too little.
    """
    clock, place = 0.0, 0.0 + 0.0j
    rows: list[dict[str, float]] = []

    def afloat() -> None:
        nonlocal clock, place
        rows.extend(fix(clock + when, place + when * surface) for when in fixes_s)
        clock, place = clock + AFLOAT_S, place + AFLOAT_S * surface

    for number, given in enumerate(headings):
        afloat()
        steps = int(DIVE_S / STEP_S)
        for k in range(steps + 1):
            share = k / steps
            heading = given[min(int(share * len(given)), len(given) - 1)]
            rows.append(
                {
                    "time": clock,
                    "depth": 1.0 + 400.0 * (1.0 - abs(2.0 * share - 1.0)),
                    "heading": (heading - compass) % (2.0 * math.pi),
                    "dive": number + 1,
                }
            )
            if k < steps:
                later = given[min(int((k + 1) / steps * len(given)), len(given) - 1)]
                flown = np.exp(1j * (0.5 * np.pi - heading - 0.5 * (later - heading)))
                place += STEP_S * (speed * flown + current)
                clock += STEP_S
    afloat()
    table = pd.DataFrame(rows).sort_values("time", kind="stable", ignore_index=True)
    table["time"] = timestamps(START + table["time"].to_numpy())
    table["pressure"] = table["depth"]
    table["dive"] = table["dive"].ffill().fillna(0).astype(np.int32)
    flags = {f"{name}_qc": np.int8(1) for name in ("pressure", "heading", "latitude", "longitude")}
    return conform(table.assign(**flags), RECORDS)


def fix(time: float, place: complex) -> dict[str, float]:
    """Return a fix at a place, m east and north of where the voyage began."""
    meridian, _ = radii(LATITUDE)
    latitude = LATITUDE + math.degrees(place.imag / float(meridian))
    _, prime = radii(0.5 * (LATITUDE + latitude))
    across = float(prime) * math.cos(math.radians(0.5 * (LATITUDE + latitude)))
    return {"time": time, "latitude": latitude, "longitude": LONGITUDE + math.degrees(place.real / across)}


def passages(
    through: np.ndarray, over: np.ndarray, *, std: float = 0.003, each: float = 5400.0, pause: float = 600.0
) -> tuple[Passages, ThroughWater]:
    """Return passages of given velocities through water and over ground, complex, shape (k,)."""
    k = through.size
    start = START + np.arange(k) * (each + pause)
    none, one = np.zeros(k), np.ones(k)
    found = Passages(
        start, start + each, np.arange(1, k + 1), over, np.full(k, std), one,
        np.arange(k), start + 0.5 * each, each * through / np.maximum(np.abs(through), 1e-9), (), "",
    )  # fmt: skip
    return found, ThroughWater(through, none, one)


def drift(
    rng: np.random.Generator, k: int, strength: float, lasting: float, *, each: float = 5400.0, pause: float = 600.0
) -> np.ndarray:
    """Return means over passages of a Gauss-Markov current plus a constant one, complex, shape (k,)."""
    step = 300.0
    n = int(k * (each + pause) / step) + 2
    white = rng.standard_normal(n) + 1j * rng.standard_normal(n)
    memory = math.exp(-step / lasting)
    path = np.empty(n, dtype=np.complex128)
    path[0] = strength * white[0]
    for i in range(1, n):
        path[i] = memory * path[i - 1] + strength * math.sqrt(1.0 - memory**2) * white[i]
    starts = (np.arange(k) * (each + pause) / step).astype(int)
    means = np.array([path[first : first + int(each / step)].mean() for first in starts])
    return means + 0.2 * complex(*rng.standard_normal(2))

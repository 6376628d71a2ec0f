"""Speed of the flight model on one core, beside a plain root-finding loop in scipy, all measured in this run.

Usage: ``python benchmarks/model.py``. Each figure is the best of several repeats, compilation apart.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from pipeline.model.forces import drag, lift, propeller_of, thrust
from pipeline.model.steady import trim_at_pitch
from pipeline.model.trajectory import Inputs, simulate
from pipeline.vehicle import Polar, Propeller, load

SOLVES = 200_000
PLAIN = 1_000
REPEATS = 5
DAY_S = 86_400.0

Array = NDArray[np.float64]


def best(call: Callable[[], object], repeats: int = REPEATS) -> float:
    """Return the shortest wall time of `call`, s."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return min(times)


def settings(count: int) -> tuple[Array, Array, Array]:
    """Return net buoyancy [N], pitch [rad] and propeller speed [rev/s] of climbs, half of them powered."""
    rng = np.random.default_rng(1)
    powered = rng.random(count) < 0.5
    return rng.uniform(2.0, 8.0, count), rng.uniform(0.3, 1.2, count), powered * rng.uniform(8.0, 23.0, count)


def plain_trim(
    polar: Polar, propeller: Propeller, net_buoyancy: float, pitch: float, propeller_speed: float
) -> tuple[float, float]:
    """Return speed and angle of attack as anyone would get them: scipy's root of the two balances."""

    def left(x: Array) -> list[float]:
        v, alpha = float(x[0]), float(x[1])
        gamma = pitch - alpha
        pushing = thrust(propeller, 1020.0, propeller_speed, v)
        return [
            net_buoyancy * math.sin(gamma) - drag(polar, v, alpha) + pushing * math.cos(alpha),
            net_buoyancy * math.cos(gamma) + lift(polar, v, alpha) + pushing * math.sin(alpha),
        ]

    found = root(left, [math.sqrt(net_buoyancy / polar.parasite_drag) + 0.05 * propeller_speed, -0.02], tol=1e-12)
    return (float(found.x[0]), float(found.x[1])) if found.success else (math.nan, math.nan)


def trims() -> None:
    """Print solves per second of `trim_at_pitch`, their ratio to the plain loop, and how far the two differ."""
    vehicle = load("petrel-ii")
    g, pitch, turning = settings(SOLVES)
    taken = best(lambda: trim_at_pitch(vehicle, g, pitch, propeller_speed=turning))
    rate = SOLVES / taken
    few = list(zip(g[:PLAIN].tolist(), pitch[:PLAIN].tolist(), turning[:PLAIN].tolist(), strict=True))
    laws = vehicle.polar, propeller_of(vehicle)
    plain_rate = PLAIN / best(lambda: [plain_trim(*laws, *case) for case in few], 3)
    plain = np.array([plain_trim(*laws, *case) for case in few])
    ours = trim_at_pitch(vehicle, g[:PLAIN], pitch[:PLAIN], propeller_speed=turning[:PLAIN])
    gap = np.nanmax(np.abs(plain[:, 0] / ours.speed - 1.0))
    print(
        f"trim_at_pitch, {SOLVES:,} solves at once: {rate / 1e6:.2f} million/s; plain scipy root loop "
        f"{plain_rate:,.0f}/s; ratio {rate / plain_rate:,.0f}; largest difference in speed {gap:.1e}"
    )


def mission() -> None:
    """Print the time of a simulated mission of 24 h at steps of 0.25 s, and how fine steps differ from it."""
    vehicle = load("petrel-ii")
    times: list[float] = []
    pump: list[float] = []
    battery: list[float] = []
    propeller: list[float] = []
    for leg in range(24):  # dives and climbs of an hour; every third climb with the propeller on and off
        way = 1.0 if leg % 2 else -1.0
        times += [leg * 3600.0 + s for s in (0.0, 60.0, 1800.0, 1820.0, 3540.0)]
        pump += [-5.0 * way, 5.0 * way, 5.0 * way, 5.0 * way, 5.0 * way]
        battery += [0.01 * way] + [-0.01 * way] * 4
        propeller += [0.0, 0.0, 0.0, 15.0 if leg % 3 == 1 else 0.0, 0.0]
    inputs = Inputs(times, pump, battery, propeller)
    start, when = [0.6, -0.5, 0.0, 0.0], np.arange(0.0, DAY_S + 1.0, 60.0)
    simulate(vehicle, start, inputs, when[:2])
    taken = best(lambda: simulate(vehicle, start, inputs, when))
    flight, finer = (simulate(vehicle, start, inputs, when, step=step) for step in (0.25, 0.05))
    gap = np.abs(flight.speed - finer.speed).max()
    print(
        f"simulate, 24 h at 0.25 s ({DAY_S / 0.25:,.0f} steps): {taken:.2f} s; speeds within {gap:.0e} m/s of steps "
        f"of 0.05 s{'; ' + flight.reason if flight.reason else ''}"
    )


PARTS: tuple[Callable[[], None], ...] = (trims, mission)


def main() -> None:
    trim_at_pitch(load("petrel-ii"), 5.0, 0.6)
    for part in PARTS:
        part()


if __name__ == "__main__":
    main()

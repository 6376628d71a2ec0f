"""Speed of the flight model beside plain loops in scipy, all measured in this run; on one core but for the map.

Usage: ``python benchmarks/model.py``. Each figure is the best of several repeats, compilation apart.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root

from pipeline.model.attraction import STEP, attraction
from pipeline.model.forces import drag, lift, propeller_of, thrust
from pipeline.model.modes import SteadyFlight, deviation_rates, equilibrium
from pipeline.model.steady import trim_at_pitch
from pipeline.model.trajectory import Inputs, simulate
from pipeline.vehicle import Polar, Propeller, load

SOLVES = 200_000
PLAIN = 1_000
REPEATS = 5
DAY_S = 86_400.0
MAP = 300

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


def region_of_attraction() -> None:
    """Print the time of a map of 300 x 300 starts, 300 s each, what a plain scipy loop would take, and its verdicts."""
    state = equilibrium(load("petrel-ii"), 7.0, thrust=7.0, hold="propeller_speed")
    speeds, angles = np.linspace(-0.9, 0.9, MAP), np.linspace(-3.1, 3.1, MAP)
    plane: dict[str, Any] = {"speed": speeds[None, :], "path_angle": angles[:, None]}
    attraction(state)
    taken = best(lambda: attraction(state, **plane), 2)
    deep = best(lambda: attraction(state, depth=1e-4, **plane), 1)
    few = [(v, g) for v in speeds[:: MAP // 3] for g in angles[:: MAP // 3]]
    plain = best(lambda: [plain_motion(state.flight, v, g) for v, g in few], 1) * MAP**2 / len(few)
    found, finer = (attraction(state, step=step, **plane) for step in (STEP, 0.5 * STEP))
    print(
        f"attraction, {MAP} x {MAP} starts of up to 300 s, {os.cpu_count()} threads: {taken:.1f} s to the certified "
        f"set, {deep:.1f} s to 1e-4 of its level; plain scipy loop {plain:,.0f} s; converged {found.share:.1%}; half "
        f"the step changes {np.count_nonzero(found.verdict != finer.verdict)} verdicts"
    )


def plain_motion(flight: SteadyFlight, v: float, g: float) -> float:
    """Return where the speed ends after 300 s, as anyone would get it: scipy's `solve_ivp` with its usual method."""

    def rate(_time: float, y: Array) -> tuple[float, float, float, float]:
        result: tuple[float, float, float, float] = deviation_rates(y[0], y[1], y[2], y[3], flight)
        return result

    return float(solve_ivp(rate, (0.0, 300.0), [v, g, 0.0, 0.0], rtol=1e-6, atol=1e-8).y[0, -1])


PARTS: tuple[Callable[[], None], ...] = (trims, mission, region_of_attraction)


def main() -> None:
    trim_at_pitch(load("petrel-ii"), 5.0, 0.6)
    for part in PARTS:
        part()


if __name__ == "__main__":
    main()

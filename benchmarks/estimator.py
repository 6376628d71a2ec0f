"""Speed and memory of the estimator beside its peers, all measured in this run and on the same samples.

Usage: ``python benchmarks/estimator.py [--days DAYS] [--data DATA]``. Both sides of a ratio are run in turn, and the
best of several repeats of each is taken, compilation apart. DATA is the folder of real missions (environment variable
SEATRIAL_DATA if left out); without it, or without gliderflight, that comparison is skipped. ``--days 0`` skips the
long mission. Time on one core is that of the thread, so that other programs do not count; on two it is that of the
wall, and needs a machine with two cores to spare.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import numpy as np
import pandas as pd
from numba.extending import is_jitted

from benchmarks import peer
from benchmarks.truth import MISSIONS, lay_out, score_comet
from pipeline import instruments, mission, simulate, store, trials, vehicle
from pipeline.estimate import force, linearise, smoother, stage
from pipeline.estimate.ballast import hull
from pipeline.estimate.compatibility import reconcile
from pipeline.estimate.craft import PARAMETERS, Craft, from_vehicle
from pipeline.estimate.forcing import Forcing, forcing
from pipeline.estimate.linearise import Sources, Trajectory
from pipeline.estimate.problem import Problem, design, process, transition
from pipeline.estimate.series import Series, from_records
from pipeline.estimate.settings import Settings
from pipeline.estimate.trajectory import first_guess, iterate
from pipeline.ingest import ingest
from pipeline.mission import Mission
from pipeline.model import closure
from pipeline.records import ESTIMATES, RECORDS, of_method, seconds, timestamps
from pipeline.vehicle import Vehicle

REPEATS = 9
#: Samples that filterpy is given: it takes its time.
FEW = 4_000
#: What two threads or processes are given.
HALVES: list[Glide] = []
DEPTH_ALONE = Sources(speed=False, fixes=False)
#: What must be true.
MOST_US, LEAST_PEER, LEAST_THREADS, MOST_GB, LEAST_GLIDERFLIGHT = 0.5, 300.0, 1.8, 2.0, 100.0


class Glide(NamedTuple):
    """A mission as both models take it."""

    mission: Mission
    vehicle: Vehicle
    records: pd.DataFrame
    series: Series
    at: Trajectory
    inputs: Forcing
    craft: Craft

    def part(self, first: int, last: int) -> Glide:
        """Return records `first` up to and without `last`."""
        rows = slice(first, last)
        return self._replace(
            records=self.records.iloc[rows],
            series=self.series[rows],
            at=self.at._replace(**{name: value[rows] for name, value in self.at._asdict().items() if name != "scale"}),
            inputs=Forcing(*(value[rows] for value in self.inputs)),
        )

    def by_polar(self) -> Problem:
        """Return the kinematic problem, linear along the trajectory."""
        along = linearise.follow(self.series, self.vehicle.polar, self.at)
        return linearise.linearise(self.series, along, Settings(), DEPTH_ALONE)

    def by_force(self) -> Problem:
        """Return the problem of the force model, linear along the trajectory."""
        path = force.path(self.series, self.at.speed, self.at.pitch)
        nothing = np.empty((len(PARAMETERS), 0))
        along = force.follow(self.series, self.inputs, self.craft, path, nothing)
        return force.linearise(self.series, along, Settings(), speed=False)


def glide_of(settings: Mission, records: pd.DataFrame) -> Glide:
    """Return a mission as both models take it, linearised along the kinematic estimate."""
    craft = vehicle.load(settings.vehicle, settings.folder)
    series = reconcile(records, from_records(records), craft, settings).series
    at = iterate(series, craft.polar, Settings(), first_guess(series, craft.polar), DEPTH_ALONE, smoother.solve, 4)
    body, _ = hull(settings, craft, {}, records)
    if body is None:
        raise ValueError("no mass")
    inputs, reason = forcing(records, craft, settings, body)
    if inputs is None:
        raise ValueError(reason)
    return Glide(settings, craft, records, series, at, inputs, from_vehicle(craft, settings, body))


def simulated(folder: Path) -> tuple[Mission, pd.DataFrame]:
    """Return half a day of gliding to 975 m, every instrument read once a second."""
    plan = replace(trials.TRIALS["petrel2-scs-2014"](), ctd_s=1.0, attitude_s=1.0)
    streams = {
        name: frame.assign(time=np.floor(frame["time"])).drop_duplicates("time")
        for name, frame in simulate.run(plan).streams.items()
    }
    instruments.write(plan, streams, folder, 0)
    settings = mission.load(folder)
    return settings, ingest(settings).records


def in_turn(calls: Sequence[Callable[[], object]], clock: Callable[[], float], repeats: int = REPEATS) -> list[float]:
    """Return the shortest time of each call, s, all called once in each round; a round before the first compiles."""
    best = [np.inf] * len(calls)
    for k in range(repeats + 1):
        for i, call in enumerate(calls):
            begin = clock()
            call()
            if k:
                best[i] = min(best[i], clock() - begin)
    return best


def said(name: str, found: str, holds: bool) -> bool:
    """Print a verdict, and return it."""
    print(f"  {'PASS' if holds else 'FAIL'}  {name}: {found}", flush=True)
    return holds


def one_core(glide: Glide) -> bool:
    """Print microseconds a sample of both models."""
    m = len(glide.records)
    polar, by_force = glide.by_polar(), glide.by_force()
    calls = [
        lambda: smoother.solve(polar),
        lambda: smoother.solve(by_force),
        lambda: smoother.solve(glide.by_polar()),
        lambda: smoother.solve(glide.by_force()),
    ]
    taken = [1e6 * each / m for each in in_turn(calls, time.thread_time)]
    print(f"One core, {m} samples at 1 Hz, µs a sample:")
    print(f"  kinematic, {polar.mean_0.size} states: filter and smoother {taken[0]:.2f}, linearised too {taken[2]:.2f}")
    print(f"  force, {by_force.mean_0.size} states: filter and smoother {taken[1]:.2f}, linearised too {taken[3]:.2f}")
    worst = max(taken[:2])
    return said(f"filter and smoother in at most {MOST_US} µs a sample", f"{worst:.2f}", worst <= MOST_US)


@contextmanager
def uncompiled(*modules: ModuleType) -> Iterator[None]:
    """Run the kernels of some modules as the plain Python that they are written in."""
    kernels = [(module, name, item) for module in modules for name, item in vars(module).items() if is_jitted(item)]
    for module, name, kernel in kernels:
        setattr(module, name, kernel.py_func)
    try:
        yield
    finally:
        for module, name, kernel in kernels:
            setattr(module, name, kernel)


def by_filterpy(glide: Glide) -> np.ndarray:
    """Return the smoothed states by filterpy's EKF, the same model in Python, and a Rauch–Tung–Striebel smoother."""
    from filterpy.kalman import ExtendedKalmanFilter

    with uncompiled(linearise, closure):
        problem = glide.by_polar()
    m, p = problem.observed.shape
    n = problem.mean_0.size
    F, Q, H = transition(problem), process(problem), design(problem)
    shift = np.zeros((m, n))
    shift[:, problem.coupled] = problem.shift[:, :, 0]
    ekf = ExtendedKalmanFilter(dim_x=n, dim_z=1, dim_u=n)
    ekf.x, ekf.P, ekf.B = problem.mean_0[:, None].copy(), problem.covariance_0.copy(), np.eye(n)
    x, P, x_ahead, P_ahead = np.empty((m, n)), np.empty((m, n, n)), np.empty((m, n)), np.empty((m, n, n))
    for k in range(m):
        for j in range(p):
            y = problem.observed[k, j]
            if not np.isnan(y):
                row = H[j : j + 1]
                ekf.update(
                    np.array([[y]]),
                    lambda state, row=row: row,
                    lambda state, row=row: row @ state,
                    R=np.array([[problem.variance[k, j]]]),
                )
        x[k], P[k] = ekf.x[:, 0], ekf.P
        ekf.F, ekf.Q = F[k], Q[k]
        ekf.predict(shift[k][:, None])
        x_ahead[k], P_ahead[k] = ekf.x[:, 0], ekf.P
    for k in range(m - 2, -1, -1):
        gain = np.linalg.solve(P_ahead[k], F[k] @ P[k]).T
        x[k] += gain @ (x[k + 1] - x_ahead[k])
        P[k] += gain @ (P[k + 1] - P_ahead[k]) @ gain.T
    return x


def beside_filterpy(glide: Glide) -> bool:
    """Print how much faster one pass of model, filter and smoother is than by filterpy's EKF with a Python model."""
    few = glide.part(0, FEW)
    start = float(few.at.speed[0])

    def one_pass() -> tuple[np.ndarray, np.ndarray]:
        with uncompiled(closure):
            return peer.smoothed(few.series, few.vehicle.polar, Settings(), start)

    calls = [lambda: smoother.solve(few.by_polar()), one_pass, lambda: by_filterpy(few)]
    ours, theirs, linear = (1e6 * taken / FEW for taken in in_turn(calls, time.thread_time, 3))
    found = smoother.solve(few.by_polar())
    std = np.sqrt(np.einsum("kii->ki", found.covariance))
    far = np.median(np.abs(one_pass()[0] - found.mean[:, :, 0]) / std, axis=0)
    expected = by_filterpy(few)
    gap = float(np.max(np.abs(found.mean[:, :, 0] - expected) / (np.ptp(expected, axis=0) + 1e-3)))
    print(f"filterpy's EKF, model in Python, smoother in numpy, {FEW} samples, one pass each:")
    print(f"  linearised where the filter is: {theirs:.0f} µs a sample, ours {ours:.2f}")
    print(f"  median difference of states at most {np.max(far):.2f} sigma")
    print(f"  along our trajectory, so that states agree to {gap:.1e} of their range: {linear:.0f} µs a sample")
    print(f"  ratio of the latter {linear / ours:.0f}")
    return said(f"at least {LEAST_PEER:.0f} times faster", f"{theirs / ours:.0f} times", theirs > LEAST_PEER * ours)


def solve_half(k: int) -> float:
    """Linearise and solve the half `k` of a mission; return the logarithm of likelihood."""
    return smoother.solve(HALVES[k].by_polar()).log_likelihood


def two_threads(glide: Glide) -> bool:
    """Print how much faster two threads are than one: the model linearised and solved, half a mission each.

    Two processes share neither interpreter nor memory: what they gain is what the machine has to give at the moment.
    """
    half = len(glide.records) // 2
    HALVES[:] = [glide.part(0, half), glide.part(half, 2 * half)]
    solve_half(0)
    with multiprocessing.get_context("fork").Pool(2) as processes, ThreadPoolExecutor(2) as threads:
        calls: list[Callable[[], object]] = [
            lambda: [solve_half(k) for k in range(2)],
            lambda: list(threads.map(solve_half, range(2))),
            lambda: processes.map(solve_half, range(2), chunksize=1),
        ]
        one, two, apart = in_turn(calls, time.perf_counter, 150)
    print("Two threads, linearised, filtered and smoothed:")
    print(f"  two processes are {one / apart:.2f} times faster than one")
    return said(f"at least {LEAST_THREADS} times faster than one", f"{one / two:.2f} times", one >= LEAST_THREADS * two)


def write_long(records: pd.DataFrame, days: float, path: Path) -> int:
    """Write a mission of so many days at 1 Hz: `records` again and again, going on from where it was; return rows."""
    rows, done, k = round(days * 86_400), 0, 0
    span = records["time"].iloc[-1] - records["time"].iloc[0] + pd.Timedelta(seconds=1)
    fixes = records[["latitude", "longitude"]].dropna()
    made = fixes.iloc[-1] - fixes.iloc[0]
    with store.table_writer(path, RECORDS) as table:
        while done < rows:
            part = records.iloc[: rows - done]
            block = part["block"]
            table.write(
                part.assign(
                    time=part["time"] + k * span,
                    dive=part["dive"] + k * int(records["dive"].max()),
                    block=block.where(block < 0, block + k * (int(records["block"].max()) + 1)),
                    latitude=part["latitude"] + k * made["latitude"],
                    longitude=part["longitude"] + k * made["longitude"],
                )
            )
            done, k = done + len(part), k + 1
    return rows


def estimate_file(folder: Path, threads: int) -> None:
    """Estimate the records in `folder`, file to file, and print time and peak memory as JSON."""
    settings = mission.load(folder)
    craft = vehicle.load(settings.vehicle, folder)
    begin = time.perf_counter()
    with (
        store.table_reader(folder / "records.parquet") as records,
        store.table_writer(folder / "estimates.parquet", ESTIMATES) as table,
    ):
        summary = stage.stream(records, craft, settings, table.write, constants={}, threads=threads)
    taken = time.perf_counter() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(json.dumps({"s": taken, "peak_gb": peak, "blocks": len(summary.blocks)}))


def long_mission(glide: Glide, days: float, folder: Path) -> bool:
    """Print rows a second and peak memory of a long mission, read, estimated by both methods and written."""
    rows = write_long(glide.records, days, folder / "records.parquet")
    threads = min(2, os.cpu_count() or 1)
    command = [sys.executable, __file__, "--file", str(folder), "--threads", str(threads)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    print(f"{days:g} days at 1 Hz, {rows} rows, read, estimated by both methods and written on {threads} threads:")
    print(f"  {rows / found['s']:.0f} rows/s, {1e6 * found['s'] / rows:.0f} µs a row, {found['blocks']} blocks")
    name = f"at most {MOST_GB:g} GB of memory" + ("" if days >= 60.0 else " (fewer than 60 days)")
    return said(name, f"{found['peak_gb']:.2f} GB", found["peak_gb"] <= MOST_GB)


def beside_gliderflight(data: Path, scratch: Path) -> bool | None:
    """Print how much faster the force model is than gliderflight's dynamic one on comet, and how right both are."""
    try:
        from gliderflight import DynamicGliderModel  # type: ignore[import-not-found]
    except ImportError:
        print("gliderflight: not installed; 'pip install gliderflight' would be needed: skipped")
        return None
    lay_out(data, scratch, ("comet",))
    settings = mission.load(scratch / "comet")
    glide = glide_of(settings, ingest(settings).records)
    records, m = glide.records, len(glide.records)
    clock = seconds(records["time"])

    def whole(name: str) -> np.ndarray:
        value = records[name].to_numpy()
        known = np.isfinite(value)
        return np.asarray(np.interp(clock, clock[known], value[known]))

    volume, density = 1e6 * whole("buoyancy_volume"), whole("density")
    given = {
        "time": clock,
        "pressure": 0.1 * whole("pressure"),
        "pitch": whole("pitch"),
        "buoyancy_change": volume,
        "density": density,
    }

    def theirs() -> Any:
        model = DynamicGliderModel(rho0=1004.0, k1=0.2, k2=0.98, max_CPUs=1)
        model.define(mg=70.0, Vg=70.0 / 1004.0, Cd0=0.15, ah=3.8, Cd1=10.5)
        return model.solve(dict(given))

    ours_s, theirs_s = in_turn([lambda: smoother.solve(glide.by_force()), theirs], time.perf_counter, 3)
    print(f"gliderflight's dynamic model, comet, {m} records:")
    print(f"  {1e6 * theirs_s / m:.0f} µs a record, ours {1e6 * ours_s / m:.2f}")
    plain = smoother.solve(glide.by_force())
    adjusted = stage.estimate(records, glide.vehicle, settings).estimates
    speeds = {"time": timestamps(clock), "speed_std": np.nan, "observable": True}
    for name, frame in (
        ("gliderflight, published coefficients", pd.DataFrame({**speeds, "speed": theirs().U})),
        ("force, the vehicle file's", pd.DataFrame({**speeds, "speed": plain.mean[:, force.SPEED, 0]})),
        ("force, adjusted to the depth rate", of_method(adjusted, "force")),
    ):
        scores = [score_comet(data, frame, *span) for span in ((12.0, 35.0), (12.0, 100.0))]
        rmse, bias = ([f"{100 * score[key]:+.2f}" for score in scores] for key in ("rmse", "bias"))
        print(f"  {name}: rmse {rmse[0][1:]} (all below 12 dbar {rmse[1][1:]}), bias {bias[0]} ({bias[1]}) cm/s")
    ratio = theirs_s / ours_s
    return said(f"at least {LEAST_GLIDERFLIGHT:.0f} times faster", f"{ratio:.0f} times", ratio >= LEAST_GLIDERFLIGHT)


def main() -> None:
    """Print all figures; exit code 1 if a sentence does not hold."""
    arguments = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    arguments.add_argument("--days", type=float, default=60.0, help="length of the long mission")
    arguments.add_argument("--data", type=Path, default=os.environ.get("SEATRIAL_DATA"), help="real missions")
    arguments.add_argument("--file", type=Path, help=argparse.SUPPRESS)
    arguments.add_argument("--threads", type=int, default=1, help=argparse.SUPPRESS)
    given = arguments.parse_args()
    if given.file:
        estimate_file(given.file, given.threads)
        return
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "glide"
        glide = glide_of(*simulated(folder))
        verdicts = [one_core(glide), beside_filterpy(glide), two_threads(glide)]
        if given.data is None or not (Path(given.data) / MISSIONS["comet"][0]).is_dir():
            print("comet: no folder of real missions; give one with --data: skipped")
        else:
            verdicts.append(bool(beside_gliderflight(Path(given.data), Path(scratch) / "raw") in (True, None)))
        if given.days:
            verdicts.append(long_mission(glide, given.days, folder))
    sys.exit(0 if all(verdicts) else 1)


if __name__ == "__main__":
    main()

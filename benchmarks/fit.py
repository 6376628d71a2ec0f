"""Print how long calibrations take: a block fit of 20 dives, and comet's beside those of gliderflight.

Usage: ``python benchmarks/fit.py [DATA]``, DATA a folder of real logs (default: $SEATRIAL_DATA). gliderflight, which
calibrates the model of Merckelbach et al. (2010, 2019), is found on the path or in the folder of $GLIDERFLIGHT
(``pip install --no-deps --target FOLDER gliderflight==1.2.1``); without either of them that comparison is skipped.

- block fit: drag and ballast of 20 dives by generalised least squares, from the table of blocks to the covariance;
- steady: the same two from comet, from raw samples of steady flight by gliderflight, from blocks here;
- dynamic: the same two by gliderflight's unsteady model, and here by the filter-error method, which adjusts the hull
  beside them; the noise levels, which gliderflight has not, are those of a first run, whose time is printed, too.

Both sides start from the same records, read already; everything is compiled and run once before. Each is the best of
several runs, but for gliderflight's dynamic calibration, which is run once.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.estimator import said
from benchmarks.truth import MISSIONS, Real, read
from pipeline import vehicle as vehicles
from pipeline.estimate import adjust, force, preparation, stage
from pipeline.estimate.ballast import hull
from pipeline.estimate.compatibility import reconcile
from pipeline.estimate.craft import from_vehicle
from pipeline.estimate.forcing import forcing
from pipeline.estimate.series import from_records
from pipeline.estimate.trajectory import first_guess
from pipeline.model.forces import GRAVITY
from pipeline.model.steady import trim_at_pitch
from pipeline.records import BLOCKS, conform, seconds, timestamps
from pipeline.report.fitting.fit import FREE, solvable
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.regression import Problem, Solution, solve

MOST_BLOCK_MS, LEAST_STEADY, LEAST_DYNAMIC = 10.0, 20.0, 500.0
#: dbar between which comet flies steadily; used by gliderflight's own calibrations of it.
STEADY_DBAR = (10.0, 35.0)


def best(call: Callable[[], Any], runs: int) -> tuple[float, Any]:
    """Return the shortest time of some runs, s, and what the call returns."""
    times, out = [], None
    for _ in range(runs):
        start = time.perf_counter()
        out = call()
        times.append(time.perf_counter() - start)
    return min(times), out


def twenty_dives() -> tuple[Problem, Callable[[], Solution | None]]:
    """Return the block fit of 20 simulated dives with their climbs, and the call that solves it from its table."""
    vehicle = vehicles.load("petrel-ii")
    rng = np.random.default_rng(5)
    count = 20 * 8
    side = np.where(np.arange(count) % 8 < 4, -1.0, 1.0)
    force, pitch = side * rng.uniform(4.0, 6.0, count), side * np.radians(rng.uniform(22.0, 36.0, count))
    trim = trim_at_pitch(vehicle.with_values({"parasite_drag": 8.9}, "this benchmark"), force, pitch)
    start = 1.4e9 + 300.0 * np.arange(count) + 900.0 * (np.arange(count) // 4)
    table = pd.DataFrame(
        {
            "block": np.arange(count),
            "start": timestamps(start),
            "end": timestamps(start + 300.0),
            "dive": 1 + np.arange(count) // 8,
            "direction": side.astype(int),
            "used": True,
            "pitch": pitch,
            "net_buoyancy": force,
            "density": vehicle["reference_density"],
            "depth_rate": -trim.speed * np.sin(trim.path_angle) + 0.006 * rng.standard_normal(count),
            "depth_rate_std": 0.001,
            "buoyancy_by_compression": -7e8 * rng.uniform(0.1, 1.0, count),
            "buoyancy_by_expansion": 3e3 * rng.standard_normal(count),
        }
    )
    blocks = conform(table, BLOCKS)

    def problem() -> Problem:
        made, reason = solvable(blocks, vehicle)
        if reason:
            raise ValueError(reason)
        return made.freeing(FREE)

    return problem(), lambda: solve(problem())


def block_fit() -> bool:
    """Print how long the block fit of 20 dives takes."""
    problem, call = twenty_dives()
    call()
    whole, solution = best(call, 20)
    alone, _ = best(lambda: solve(problem), 20)
    if solution is None:
        return said("the block fit of 20 dives", "does not converge", False)
    std = np.sqrt(np.diag(solution.covariance))
    print(
        f"20 dives with their climbs, {problem.size} blocks, {len(problem.model.names)} unknowns of which 2 are free:"
    )
    print(f"  ΔK_D0 {solution.x[0]:+.3f} ± {std[0]:.3f} kg/m, ΔG {solution.x[1]:+.3f} ± {std[1]:.3f} N")
    print(f"  {1e3 * whole:.1f} ms from the table of blocks, {1e3 * alone:.1f} ms of it the search")
    return said(f"at most {MOST_BLOCK_MS:g} ms", f"{1e3 * whole:.1f} ms", 1e3 * whole <= MOST_BLOCK_MS)


def beside_gliderflight(data: Path, raw: Path) -> list[bool]:
    """Print how long both take to calibrate drag and ballast on comet, steady and dynamic, and what they find."""
    try:
        from gliderflight import DynamicCalibrate, SteadyStateCalibrate  # type: ignore[import-not-found]
    except ImportError:
        print("gliderflight: not installed, and no folder of it in $GLIDERFLIGHT: skipped")
        return []
    real = read("comet", data, raw)
    ballast = hull(real.mission, real.vehicle, real.constants, real.records)
    body = ballast[0]
    if body is None:
        raise ValueError("comet: no mass")
    prepared = preparation.prepare([real.records], real.vehicle, real.mission, ballast)
    blocks = pd.concat([found.blocks for found in stage.solved([real.records], prepared)], ignore_index=True)
    made, reason = solvable(blocks, real.vehicle, Given(ballast_std=body.std))
    if reason:
        raise ValueError(reason)
    problem = made.freeing(FREE)
    series = reconcile(real.records, from_records(real.records), real.vehicle, real.mission).series
    inputs, reason = forcing(real.records, real.vehicle, real.mission, body)
    if inputs is None:
        raise ValueError(reason)
    craft, guess = from_vehicle(real.vehicle, real.mission, body), first_guess(series, real.vehicle.polar)
    stretch, path = adjust.Stretch(series, inputs), force.path(series, guess.speed, guess.pitch)

    given = _theirs(real)
    depth = 10.0 * given["pressure"]
    outside = (depth < STEADY_DBAR[0]) | (depth > STEADY_DBAR[1])

    def calibration(model: Any) -> Callable[[], dict[str, float]]:
        model.define(mg=70.0, Vg=70.0 / 1004.0, Cd0=0.15, ah=3.8, Cd1=10.5)
        model.set_input_data(**{name: value.copy() for name, value in given.items()})
        model.set_mask(outside.copy())

        def run() -> dict[str, float]:
            model.define(mg=70.0, Cd0=0.15)
            return dict(model.calibrate("Cd0", "mg"))

        return run

    steady = calibration(SteadyStateCalibrate(rho0=1004.0))
    dynamic = calibration(DynamicCalibrate(rho0=1004.0, k1=0.2, k2=0.98, max_CPUs=1))
    ours_steady, solution = best(lambda: solve(problem), 10)
    theirs_steady, by_steady = best(steady, 3)
    searching, adjusted = best(lambda: adjust.adjust([stretch], craft, [path], speed=False), 1)
    noise = adjusted.noise
    ours_dynamic, adjusted = best(lambda: adjust.adjust([stretch], craft, [path], speed=False, noise=noise), 5)
    theirs_dynamic, by_dynamic = best(dynamic, 1)
    print(f"comet, {len(real.records)} records, {problem.size} blocks; change of drag, and of net buoyancy in N:")
    if solution is not None:
        print(f"  block fit                  {solution.x[0] / real.vehicle['parasite_drag']:+.3f} {solution.x[1]:+.2f}")
    values = adjusted.report["parameters"]
    print(
        f"  filter error               {values['parasite_drag']['value']:+.3f} {values['net_buoyancy']['value']:+.2f}"
    )
    for name, theirs in (("steady ", by_steady), ("dynamic", by_dynamic)):
        print(f"  gliderflight, {name}      {theirs['Cd0'] / 0.15 - 1.0:+.3f} {-GRAVITY * (theirs['mg'] - 70.0):+.2f}")
    print(f"  the filter-error method with its search for noise levels takes {searching:.2g} s")
    verdicts = []
    for name, theirs_s, ours_s, least in (
        ("steady", theirs_steady, ours_steady, LEAST_STEADY),
        ("dynamic", theirs_dynamic, ours_dynamic, LEAST_DYNAMIC),
    ):
        print(f"  {name}: gliderflight {theirs_s:.3g} s, ours {ours_s:.3g} s")
        ratio = theirs_s / ours_s
        verdicts.append(said(f"{name}: at least {least:g} times faster", f"{ratio:.0f} times", ratio >= least))
    return verdicts


def _theirs(real: Real) -> dict[str, np.ndarray]:
    """Return comet as gliderflight wants it: every series at every instant, pressure in bar, volume in cm3."""
    clock = seconds(real.records["time"])

    def whole(name: str) -> np.ndarray:
        value = real.records[name].to_numpy()
        known = np.isfinite(value)
        return np.asarray(np.interp(clock, clock[known], value[known]))

    return {
        "time": clock,
        "pressure": 0.1 * whole("pressure"),
        "pitch": whole("pitch"),
        "buoyancy_change": 1e6 * whole("buoyancy_volume"),
        "density": whole("density"),
    }


def main() -> None:
    """Print all figures; exit code 1 if a sentence does not hold."""
    if "GLIDERFLIGHT" in os.environ:
        sys.path.append(os.environ["GLIDERFLIGHT"])
    given = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("SEATRIAL_DATA")
    verdicts = [block_fit()]
    if given is None or not (Path(given) / MISSIONS["comet"][0]).is_dir():
        print("comet: no folder of real missions; give one: skipped")
    else:
        with tempfile.TemporaryDirectory() as scratch:
            verdicts += beside_gliderflight(Path(given), Path(scratch))
    sys.exit(0 if all(verdicts) else 1)


if __name__ == "__main__":
    main()

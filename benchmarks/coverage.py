"""Simulated missions with known truth through the estimator: how often its 95 % intervals hold the truth.

Usage: ``python benchmarks/coverage.py [MISSIONS [FIRST]] [--json] [--table FILE.parquet] [--no-trials] [--sparse]``: a
fleet of missions drawn at random (default 200, seeds from 1000; see `benchmarks/fleet.py`), on all cores, then the
three trials with seeds 0 to 2; with ``--sparse`` CTD and attitude are sampled every 20 to 60 s in place of 1 to 8.
Seeds 1000 to 1219, of sparse missions 41000 to 41079, and trial seeds 0 to 3 were looked at while the estimator was
being written; others are fresh.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import fleet, scores
from pipeline import mission, simulate, store, trials, vehicle, workers
from pipeline.estimate.stage import estimate
from pipeline.ingest import ingest
from pipeline.records import seconds

TRIAL_SEEDS = range(3)


def main() -> int:
    """Print coverage, NEES and NIS of the fleet, class by class, and the trials; return 1 if any fails."""
    arguments = _arguments()
    began = time.perf_counter()
    sampling = fleet.SPARSE_S if arguments.sparse else fleet.SAMPLING_S
    rows, failures = _fleet(range(arguments.first, arguments.first + arguments.missions), sampling)
    table = pd.DataFrame(rows)
    if arguments.table:
        table.to_parquet(arguments.table, index=False)
    results: dict[str, Any] = {
        "missions": arguments.missions,
        "first": arguments.first,
        "failures": failures,
        "drawn again": sorted(set(table["seed"][table["again"] > 0].tolist())) if rows else [],
        "seconds": round(time.perf_counter() - began, 1),
        "methods": {str(name): _summary(part) for name, part in table.groupby("method")} if rows else {},
        "trials": [] if arguments.no_trials else [_trial(name, seed) for name in trials.TRIALS for seed in TRIAL_SEEDS],
    }
    if arguments.json:
        print(json.dumps(results, indent=1))
    else:
        _show(results)
    said = [verdict["pass"] for summary in results["methods"].values() for verdict in summary["verdicts"]]
    return 1 if failures or not all(said) else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="How often intervals hold the truth of simulated missions.")
    parser.add_argument("missions", nargs="?", type=int, default=200, metavar="MISSIONS", help="how many (200)")
    parser.add_argument("first", nargs="?", type=int, default=1000, metavar="FIRST", help="seed of the first (1000)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--table", type=Path, metavar="FILE.parquet", help="write the figures of each mission")
    parser.add_argument("--sparse", action="store_true", help="sample every 20 to 60 s")
    parser.add_argument("--no-trials", action="store_true", help="leave out the three trials")
    return parser.parse_args()


def one(seed: int, sampling: tuple[float, float]) -> tuple[list[dict[str, Any]], str]:
    """Return the scores of the mission with this `seed` and `sampling`, and what went wrong if anything did."""
    try:
        flight, flown = fleet.first_flown(seed, sampling)
        return scores.score(flight, flown, estimate(flown.records, flown.vehicle, flown.mission)), ""
    except Exception as error:
        return [], f"seed {seed}: {type(error).__name__}: {error}"


def _fleet(seeds: range, sampling: tuple[float, float]) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the scores of all missions in the order of their seeds, and what went wrong; on all cores."""
    os.environ["NUMBA_NUM_THREADS"] = "1"
    done: dict[int, tuple[list[dict[str, Any]], str]] = {}
    with workers.local(os.cpu_count() or 1) as pool:
        futures = {pool.submit(one, seed, sampling): seed for seed in seeds}
        for number, future in enumerate(as_completed(futures), 1):
            done[futures[future]] = future.result()
            if sys.stderr.isatty():
                print(f"\r{number} of {len(seeds)} missions", end="", file=sys.stderr, flush=True)
    if sys.stderr.isatty():
        print(file=sys.stderr)
    found = [done[seed] for seed in seeds]
    return [row for rows, _ in found for row in rows], [text for _, text in found if text]


def _summary(table: pd.DataFrame) -> dict[str, Any]:
    """Return the figures of one method: per class of missions and samples, and the verdicts."""
    classes = {}
    for label, rows in scores.splits(table):
        if len(rows) == 0:
            continue
        entry: dict[str, Any] = {"missions": len(rows), "observable": float(rows["observable"].mean())}
        for name in scores.QUANTITIES:
            cover, error = scores.mean_over_missions(rows[f"cover_{name}"])
            low, high = scores.band(rows[f"nees_{name}"])
            entry[name] = {
                "coverage": cover,
                "coverage_std": error,
                "nees": float(rows[f"nees_{name}"].mean()),
                "nees_median": float(rows[f"nees_{name}"].median()),
                "nees_low": low,
                "nees_high": high,
                "bias": float(rows[f"bias_{name}"].mean()),
                "rms_error": float(np.sqrt((rows[f"rms_{name}"] ** 2).mean())),
                "rms_std": float(np.sqrt((rows[f"std_{name}"] ** 2).mean())),
            }
        classes[label] = entry
    return {"classes": classes, "verdicts": [{"pass": ok, "claim": text} for ok, text in scores.verdicts(table)]}


def _trial(name: str, seed: int) -> dict[str, Any]:
    """Return the coverage of the 95 % interval of V, RMSE and bias of V, and the share observable, of one trial."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / name
        simulate.simulate(name, folder, seed=seed)
        settings = mission.load(folder)
        truth = store.read_table(folder / "truth.parquet")
        found = estimate(ingest(settings).records, vehicle.load(settings.vehicle), settings).estimates
    found = found[found["method"] == "kinematic"]
    seen = found["observable"].to_numpy()
    speed = np.interp(seconds(found["time"]), seconds(truth["time"]), truth["speed"])
    gap = (found["speed"].to_numpy() - speed)[seen]
    return {
        "trial": name,
        "seed": seed,
        "coverage": float(np.mean(np.abs(gap) < 1.96 * found["speed_std"].to_numpy()[seen])),
        "observable": float(seen.mean()),
        "rmse": float(np.sqrt(np.mean(gap**2))),
        "bias": float(gap.mean()),
    }


#: Headings and factors to the unit that people read, per quantity.
_SHOWN = {
    "speed": ("V cm/s", 100.0),
    "angle_of_attack": ("α °", 180.0 / np.pi),
    "path_angle": ("γ °", 180.0 / np.pi),
    "vertical_water_velocity": ("w_w cm/s", 100.0),
}


def _show(results: dict[str, Any]) -> None:
    """Print everything for people."""
    print(f"{results['missions']} missions, seeds from {results['first']}, in {results['seconds']:.0f} s")
    if results["drawn again"]:
        print(f"drawn again, since their vehicle does not carry them out: seeds {results['drawn again']}")
    for text in results["failures"]:
        print(f"failed: {text}")
    for method, summary in results["methods"].items():
        print(
            f"\n{method}: coverage of the 95 % interval in % (± its 1-sigma over missions) | mean z² (its median over "
            "missions) | bias; RMS error; RMS 1-sigma"
        )
        print(f"{'':20}{'n':>4} {'seen':>5}" + "".join(f"{heading:>44}" for heading, _ in _SHOWN.values()))
        for label, entry in summary["classes"].items():
            line = f"{label:20}{entry['missions']:4d} {100 * entry['observable']:4.0f}%"
            for name, (_, factor) in _SHOWN.items():
                figure = entry[name]
                sizes = [factor * figure[key] for key in ("bias", "rms_error", "rms_std")]
                line += (
                    f"  {100 * figure['coverage']:5.1f} ±{100 * figure['coverage_std']:4.1f} |"
                    f"{figure['nees']:5.2f} ({figure['nees_median']:4.2f}) |"
                    f"{sizes[0]:+5.2f};{sizes[1]:5.2f};{sizes[2]:5.2f}"
                )
            print(line)
    if results["trials"]:
        print("\nthe three trials, kinematic V:")
    for entry in results["trials"]:
        print(
            f"{entry['trial']}, seed {entry['seed']}: true V in the 95 % interval for {100 * entry['coverage']:.1f} % "
            f"of the observable samples ({100 * entry['observable']:.0f} % of all); RMSE {100 * entry['rmse']:.2f} "
            f"cm/s, bias {100 * entry['bias']:+.2f} cm/s"
        )
    print()
    for method, summary in results["methods"].items():
        for verdict in summary["verdicts"]:
            print(f"{'PASS' if verdict['pass'] else 'FAIL'} {method}: {verdict['claim']}")
    failed = len(results["failures"])
    print(f"{'FAIL' if failed else 'PASS'} {results['missions']} missions estimated: {failed} failed")


if __name__ == "__main__":
    raise SystemExit(main())

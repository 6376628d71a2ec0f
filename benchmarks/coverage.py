"""Simulate the three trials with several seeds and print how often the true speed lies in the stated interval.

Usage: ``python benchmarks/coverage.py [SEEDS [FIRST]]`` (default 3 seeds from 0). Seeds 0 to 3 were looked at while the
estimator's general settings were settled; others are fresh.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from pipeline import mission, simulate, store, trials, vehicle
from pipeline.estimate.kinematic import estimate
from pipeline.ingest import ingest
from pipeline.records import seconds


def main() -> int:
    """Print one line a mission: coverage of the 95 % interval of V, RMSE and bias of V, share observable."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    for trial in trials.TRIALS:
        for seed in range(first, first + seeds):
            with tempfile.TemporaryDirectory() as scratch:
                folder = Path(scratch) / trial
                simulate.simulate(trial, folder, seed=seed)
                settings = mission.load(folder)
                truth = store.read_table(folder / "truth.parquet")
                found = estimate(ingest(settings).records, vehicle.load(settings.vehicle), settings).estimates
            seen = found["observable"].to_numpy()
            speed = np.interp(seconds(found["time"]), seconds(truth["time"]), truth["speed"])
            gap = (found["speed"].to_numpy() - speed)[seen]
            inside = np.mean(np.abs(gap) < 1.96 * found["speed_std"].to_numpy()[seen])
            print(
                f"{trial}, seed {seed}: true V in the 95 % interval for {100 * inside:.1f} % of the observable samples "
                f"({100 * seen.mean():.0f} % of all); RMSE {100 * np.sqrt(np.mean(gap**2)):.2f} cm/s, "
                f"bias {100 * gap.mean():+.2f} cm/s",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

"""Run real missions through the whole pipeline and print speeds by both methods against measured truth.

Then `heldout` fits the force model on some dives of each and measures it on the others, beside the stored solutions,
and gives a verdict on each goal.

Usage: ``python benchmarks/real.py DATA``, DATA a folder of real logs (default: $SEATRIAL_DATA).
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.heldout import verdict
from benchmarks.truth import (
    DEPTHS,
    MISSIONS,
    Real,
    asked,
    by_unadjusted_force,
    estimated,
    in_words,
    lay_out,
    read,
    score_comet,
    score_sg171,
    water_rms,
    with_dvl,
    with_stored_polar,
)
from pipeline.records import of_method
from pipeline.store import read_json, read_table

METHODS = ("kinematic", "force")


def main() -> int:
    """Print one line a figure and a verdict on each goal; return 1 if a mission failed or a goal is missed."""
    meant = asked(tuple(MISSIONS))
    if meant is None:
        return 2
    data, _ = meant
    with tempfile.TemporaryDirectory() as scratch:
        raw, processed, reports = (Path(scratch) / name for name in ("raw", "processed", "reports"))
        lay_out(data, raw)
        seatrial = Path(sys.executable).with_name("seatrial")
        command = [seatrial, "run", raw, "--processed", processed, "--reports", reports]
        code = subprocess.run([str(part) for part in command], check=False).returncode
        print()
        comet, sg171 = (read(name, data, Path(scratch) / "again") for name in ("comet", "sg171"))
        about_comet(data, comet, read_table(processed / "comet/estimates.parquet"))
        about_sg171(data, sg171, read_table(processed / "sg171/estimates.parquet"))
        for name in MISSIONS:
            answer = read_json(reports / name / "summary.json")["answer"]
            print(f"{name}: {answer['sentence']}")
            for line in answer["more"]:
                if "stored" in line or "speed sensor, which" in line:
                    print(f"    {line}")
    return max(code, verdict(data))


def about_comet(data: Path, comet: Real, estimates: pd.DataFrame) -> None:
    """Print V against the DVL held out, and what is flagged where it is used."""
    tables = {method: of_method(estimates, method) for method in METHODS}
    tables["force, nothing adjusted"] = by_unadjusted_force(comet, comet.vehicle)
    for name, table in tables.items():
        for shallow, deep, label in DEPTHS:
            print(f"comet, V against the DVL, {name}, {label}: {in_words(score_comet(data, table, shallow, deep))}")
    used = estimated(with_dvl(comet, data))
    flagged = used.report["compatibility"]["outliers"]["instruments"]["speed"]
    samples = ", ".join(f"{100 * one['value']:.0f} cm/s at {one['time_s']:.0f} s" for one in flagged["first"])
    print(f"comet, the DVL used: {flagged['count']} samples flagged as outliers: {samples}")
    for method in METHODS:
        score = score_comet(data, of_method(used.estimates, method), 12.0, 35.0)
        print(f"    {method}, of the DVL that it has seen, 12-35 dbar: {in_words(score)}")


def about_sg171(data: Path, sg171: Real, estimates: pd.DataFrame) -> None:
    """Print V against the AD2CP held out, and w_w, for both methods and for the force model with nothing adjusted."""
    tables = {method: of_method(estimates, method) for method in METHODS}
    tables["force, nothing adjusted"] = by_unadjusted_force(sg171, sg171.vehicle)
    tables["force, nothing adjusted, polar of the logs"] = by_unadjusted_force(sg171, with_stored_polar(sg171))
    for name, table in tables.items():
        score, water = score_sg171(data, table), water_rms(table, sg171.records)
        print(
            f"sg171, V against the AD2CP, {name}: {in_words(score)}; "
            f"w_w in steady flight {100 * water['rms']:.2f} cm/s RMS"
            f" ({100 * water['with_std']:.2f} with its own uncertainty)"
        )
    print(
        f"sg171, V against the AD2CP, stored solution: RMSE {100 * score['stored_rmse']:.2f} cm/s, "
        f"bias {100 * score['stored_bias']:+.2f} cm/s"
    )


if __name__ == "__main__":
    raise SystemExit(main())

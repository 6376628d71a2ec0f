"""Run real missions through the whole pipeline and print the kinematic speed against measured truth.

Usage: ``python benchmarks/real.py DATA``, DATA a folder of real logs (default: $SEATRIAL_DATA).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.truth import MISSIONS, lay_out, score_comet, score_sg171
from pipeline.store import read_json, read_table


def main() -> int:
    """Print one line a figure; return 1 if a mission failed."""
    where = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("SEATRIAL_DATA")
    if not where or not Path(where).is_dir():
        print("real logs: found no folder; expected one as argument or in SEATRIAL_DATA", file=sys.stderr)
        return 2
    data = Path(where)
    with tempfile.TemporaryDirectory() as scratch:
        raw, processed, reports = (Path(scratch) / name for name in ("raw", "processed", "reports"))
        lay_out(data, raw)
        command = [
            Path(sys.executable).with_name("seatrial"),
            "run",
            raw,
            "--processed",
            processed,
            "--reports",
            reports,
        ]
        code = subprocess.run([str(part) for part in command], check=False).returncode
        print()
        for shallow, deep, label in ((12.0, 35.0, "12-35 dbar"), (12.0, 1e4, ">= 12 dbar")):
            score = score_comet(data, read_table(processed / "comet/estimates.parquet"), shallow, deep)
            print(
                f"comet, kinematic V against the DVL, {label}: RMSE {100 * score['rmse']:.2f} cm/s, bias "
                f"{100 * score['bias']:+.2f} cm/s, 95 % interval covers {100 * score['coverage']:.0f} % "
                f"({score['n']:.0f} of {score['samples']:.0f} samples observable)"
            )
        score = score_sg171(data, read_table(processed / "sg171/estimates.parquet"))
        print(
            f"sg171, kinematic V against the AD2CP: RMSE {100 * score['rmse']:.1f} cm/s, bias "
            f"{100 * score['bias']:+.1f} cm/s, 95 % interval covers {100 * score['coverage']:.0f} % "
            f"({score['n']:.0f} of {score['ensembles']:.0f} ensembles observable); "
            f"stored solution: RMSE {100 * score['stored_rmse']:.1f} cm/s, bias {100 * score['stored_bias']:+.1f} cm/s"
        )
        for name in MISSIONS:
            answer = read_json(reports / name / "summary.json")["answer"]
            print(f"{name}: {answer['sentence']}")
            for line in answer["more"]:
                if "stored" in line:
                    print(f"    {line}")
    return code


if __name__ == "__main__":
    raise SystemExit(main())

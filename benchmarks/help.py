"""Time of ``seatrial --help`` beside that of an empty Python, both measured in this run: the median of many."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from pathlib import Path

REPEATS = 15
LIMIT_S = 0.3


def median_time(command: list[str]) -> float:
    """Return the median wall time of `command`, s."""
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def main() -> None:
    seatrial = str(Path(sys.executable).with_name("seatrial"))
    empty = median_time([sys.executable, "-c", "pass"])
    print(f"{'python -c pass':24s} {empty:.3f} s")
    for command in ([], ["run"], ["check"], ["steady"], ["fetch"]):
        taken = median_time([seatrial, *command, "--help"])
        verdict = "below" if taken < LIMIT_S else "NOT below"
        line = " ".join(["seatrial", *command, "--help"])
        print(f"{line:24s} {taken:.3f} s, {taken / empty:.1f} times an empty Python, {verdict} {LIMIT_S} s")


if __name__ == "__main__":
    main()

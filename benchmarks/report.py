"""Seconds and memory from raw logs to the page of a mission as long as the longest of the paper, all in this run.

Usage: ``python benchmarks/report.py [--profiles N] [--keep FOLDER]``. Simulates N profiles to 975 m (219 unless told;
one more, up again, after the last dive) into a temporary folder, or into FOLDER, where it is found again the next time:
CTD and attitude once a second on clocks of their own and the engine every 2.8 s, which makes 1.8 million records. Then
takes them through ``seatrial run --force`` as a user would. Kernels are compiled before, on a
mission of minutes, and so are all modules, as an installer leaves them: the run keeps bytecode of its own, whatever the
environment says. What a stage took is told by the times of its files. Needs a machine with two cores to spare.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from pipeline import instruments, simulate, trials
from pipeline.plan import Plan
from pipeline.roster import OUTPUTS, STAGES, Job

ROOT = Path(__file__).resolve().parents[1]
TRIAL = "petrel2-scs-2014"
PROFILES = 219
#: What must be true: seconds from raw logs to page.
MOST_S = 30.0


class Taken(NamedTuple):
    """What a run took: seconds of wall and processors, seconds by stage, greatest memory of one process, GB."""

    wall: float
    processors: float
    stages: dict[str, float]
    memory: float


def plan_of(profiles: int) -> Plan:
    """Return the gliding trial with whole dives of at least so many profiles, CTD and attitude read once a second."""
    plan = trials.trial(TRIAL)
    *dives, last = plan.stages
    turns = [dives[k : k + 3] for k in range(0, len(dives), 3)]
    orders = [order for turn in islice(cycle(turns), (profiles + 1) // 2) for order in turn]
    longest = 4500.0 * profiles + 3600.0
    return replace(plan, stages=(*orders, last), ctd_s=1.0, attitude_s=1.0, engine_s=2.8, longest=longest)


def write(plan: Plan, folder: Path) -> None:
    """Write the logs of `plan`, unless they are there."""
    if not (folder / "mission.yaml").is_file():
        instruments.write(plan, simulate.run(plan).streams, folder, 0)


class Watched(NamedTuple):
    """What a process has taken so far: seconds of processors, and the greatest memory that it has held, GB."""

    processors: float
    memory: float


def watched(process: int) -> dict[int, Watched]:
    """Return what a process, those that it has started and those that these have, have taken so far."""
    place = Path(f"/proc/{process}")
    ticks = (place / "stat").read_text().rpartition(")")[2].split()[11:13]
    held = [line.split()[1] for line in (place / "status").read_text().splitlines() if line.startswith("VmHWM")]
    found = {process: Watched(sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK"), int(held[0]) / 1e6 if held else 0.0)}
    for listed in place.glob("task/*/children"):
        for child in map(int, listed.read_text().split()):
            with suppress(OSError):  # it has just ended
                found |= watched(child)
    return found


def run(raw: Path, out: Path, bytecode: Path) -> Taken:
    """Take the one mission in `raw` from logs to page below `out` as a user would, and return what it took.

    Modules compiled are kept in `bytecode`, and found there by the next run.

    Raises
    ------
    subprocess.CalledProcessError
        If it failed.
    """
    command = [sys.executable, "-c", "from pipeline.cli import main; main()", "run", str(raw), "--force"]
    command += ["--processed", str(out / "processed"), "--reports", str(out / "reports")]
    began, begin = time.time(), time.perf_counter()
    environment = {**os.environ, "PYTHONPYCACHEPREFIX": str(bytecode), "PYTHONDONTWRITEBYTECODE": ""}
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, env=environment)
    seen: dict[int, Watched] = {}
    while process.poll() is None:
        with suppress(OSError):
            for each, now in watched(process.pid).items():  # one that is ending holds no memory any more
                before = seen.get(each, now)
                seen[each] = Watched(now.processors, max(now.memory, before.memory))
        time.sleep(0.02)
    wall = time.perf_counter() - begin
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    name = next(raw.iterdir()).name
    job = Job(raw / name, name, out / "processed" / name, out / "reports" / name)
    stages, last = {}, began
    for stage in STAGES:
        ended = max(job.path(output).stat().st_mtime for output in OUTPUTS[stage] if job.path(output).is_file())
        stages[stage], last = ended - last, ended
    stages["index, end"] = began + wall - last
    return Taken(
        wall,
        sum(each.processors for each in seen.values()),
        stages,
        max(each.memory for each in seen.values()),
    )


def main() -> None:
    """Print all figures; exit code 1 if a sentence does not hold."""
    arguments = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    arguments.add_argument("--profiles", type=int, default=PROFILES, help="how many dives and climbs")
    arguments.add_argument("--keep", type=Path, help="where the simulated logs are kept")
    given = arguments.parse_args()
    import pyarrow.parquet as pq

    with tempfile.TemporaryDirectory() as scratch:
        place = given.keep or Path(scratch)
        warm, raw, out = place / "warm", place / f"raw-{given.profiles}", place / "out"
        write(plan_of(2), warm / "first")
        begin = time.perf_counter()
        write(plan_of(given.profiles), raw / "long")
        print(f"{given.profiles} profiles simulated and written: {time.perf_counter() - begin:.0f} s", flush=True)
        bytecode = Path(scratch) / "bytecode"
        run(warm, Path(scratch) / "warm-out", bytecode)
        shutil.rmtree(out, ignore_errors=True)
        taken = run(raw, out, bytecode)
        rows = pq.read_metadata(out / "processed" / "long" / "records.parquet").num_rows
        page = (out / "reports" / "long" / "report.html").stat().st_size
        print(f"From logs to page, {rows} records, {os.cpu_count()} cores:")
        for stage, seconds in taken.stages.items():
            print(f"  {stage:14} {seconds:6.1f} s")
        print(f"  {'all':14} {taken.wall:6.1f} s, {taken.processors:.1f} s of processors")
        print(f"  memory of the greatest process {taken.memory:.2f} GB; report.html {page / 1e6:.2f} MB")
        holds = taken.wall <= MOST_S
        print(f"  {'PASS' if holds else 'FAIL'}  from raw logs to page in at most {MOST_S:.0f} s: {taken.wall:.1f} s")
    sys.exit(0 if holds else 1)


if __name__ == "__main__":
    main()

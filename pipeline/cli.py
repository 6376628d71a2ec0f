"""The command line: parse, call, print. Everything but the parser is imported inside the commands."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn

import typer

if TYPE_CHECKING:
    from pipeline.roster import Job
    from pipeline.workers import Workers

DONE, SOME_FAILED, WRONG = 0, 1, 2
INTERRUPTED = 130
#: Who asks for the vehicle of the commands on theory.
OPTION = ("--vehicle", "")

app = typer.Typer(
    name="seatrial",
    help="From the raw logs of an underwater-glider field trial to a validated flight model.",
    epilog="Exit codes: 0 done, 1 some missions failed (the rest are done), 2 wrong usage or bad configuration.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Raw = Annotated[Path, typer.Argument(metavar="RAW", help="Folder of missions, or one mission.")]
Folder = Annotated[Path, typer.Argument(metavar="MISSION", help="Folder of one mission.")]
Processed = Annotated[Path, typer.Option(metavar="DIR", help="Where results go.")]
Reports = Annotated[Path, typer.Option(metavar="DIR", help="Where reports go.")]
Engine = Annotated[Literal["numba", "filterpy"], typer.Option(help="Filter: compiled, or the independent check.")]
Force = Annotated[bool, typer.Option("--force", help="Also redo what has not changed.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
VehicleName = Annotated[str, typer.Option("--vehicle", metavar="NAME", help="Vehicle, or a file NAME.yaml.")]
Forces = Annotated[list[float], typer.Option("--net-buoyancy", metavar="N", help="Net buoyancy, N, up +; repeatable.")]
Rpm = Annotated[float | None, typer.Option("--rpm", metavar="RPM", help="Propeller speed, rev/min.")]
Thrust = Annotated[float | None, typer.Option("--thrust", metavar="N", help="Thrust, N, instead of a propeller speed.")]
Density = Annotated[float | None, typer.Option("--density", metavar="KG/M3", help="In-situ density.")]


def _version(asked: bool) -> None:
    if asked:
        from pipeline import __version__

        print(f"seatrial {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


@app.command()
def run(
    raw: Raw = Path("raw"),
    processed: Processed = Path("processed"),
    reports: Reports = Path("reports"),
    jobs: Annotated[int | None, typer.Option(min=1, metavar="N", help="Missions at a time [default: cores].")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="dask scheduler to run on, as in tcp://host:8786.")
    ] = None,
    force: Force = False,
    engine: Engine = "numba",
) -> None:
    """From logs to reports, for every mission that has changed."""
    from pipeline import campaign, index, store
    from pipeline.roster import plan

    if scheduler is not None:
        raw, processed, reports = (folder.absolute() for folder in (raw, processed, reports))
    planned = plan(raw, processed, reports, engine)
    _writable(processed, reports)
    for folder in (processed, reports):
        store.sweep(folder)
    for stranger in planned.strangers:
        print(stranger, file=sys.stderr)
    for outcome in planned.failed:
        _tell(outcome)
        if outcome.name not in {job.name for job in planned.jobs}:
            campaign.mark(reports / outcome.name, outcome.name, outcome.error)
    with _workers(planned.jobs, jobs, scheduler) as workers:
        outcomes = campaign.run(planned.jobs, workers, force=force, tell=_tell)
        page = index.write(processed, reports, workers.start)
    failed = [*planned.failed, *(outcome for outcome in outcomes if outcome.error)]
    done = len(outcomes) + len(planned.failed) - len(failed)
    print(f"{done} done, {len(failed)} failed: {page}")
    if failed:
        raise typer.Exit(SOME_FAILED)


@app.command()
def ingest(
    mission: Folder, processed: Processed = Path("processed"), reports: Reports = Path("reports"), force: Force = False
) -> None:
    """Stage 1: logs to records."""
    _stage("ingest", mission, processed, reports, force)


@app.command()
def estimate(
    mission: Folder,
    processed: Processed = Path("processed"),
    reports: Reports = Path("reports"),
    force: Force = False,
    engine: Engine = "numba",
) -> None:
    """Stage 2: records to speed and angle of attack, with 1-sigma."""
    _stage("estimate", mission, processed, reports, force, engine)


@app.command()
def model(
    mission: Folder, processed: Processed = Path("processed"), reports: Reports = Path("reports"), force: Force = False
) -> None:
    """Stage 3: what theory predicts for each steady block."""
    _stage("model", mission, processed, reports, force)


@app.command()
def report(
    mission: Folder, processed: Processed = Path("processed"), reports: Reports = Path("reports"), force: Force = False
) -> None:
    """Stage 4: measured against theory, as a page and as JSON."""
    _stage("report", mission, processed, reports, force)


@app.command()
def check(raw: Raw = Path("raw"), json: Json = False) -> None:
    """Say what would be read, and what is missing; write nothing."""
    from dataclasses import asdict

    from pipeline import check as checks
    from pipeline.progress import Bar
    from pipeline.roster import plan

    planned = plan(raw, Path("processed"), Path("reports"))
    found = [checks.Checked(outcome.name, error=outcome.error) for outcome in planned.failed]
    with Bar(len(planned.jobs)) as bar:
        for done, job in enumerate(planned.jobs):
            bar.update(done, [job.name])
            found.append(checks.check(job))
    if json:
        _print_json([asdict(item) for item in found])
    else:
        for item in found:
            print("\n".join(checks.lines(item)))
    for stranger in planned.strangers:
        print(stranger, file=sys.stderr)
    if any(item.error for item in found):
        raise typer.Exit(SOME_FAILED)


@app.command()
def steady(
    net_buoyancy: Forces,
    vehicle: VehicleName = "petrel-ii",
    alpha: Annotated[
        list[float] | None,
        typer.Option(metavar="DEG", help="Angle of attack held; repeatable [default: -K_M0/K_M, as in the paper]."),
    ] = None,
    rpm: Rpm = None,
    thrust: Thrust = None,
    density: Density = None,
    signs: Annotated[
        Literal["physical", "paper"], typer.Option(help="Sign convention: right, or as printed by Niu et al. 2017.")
    ] = "physical",
    json: Json = False,
) -> None:
    """Theory: steady flight at an angle of attack, and its range."""
    from pipeline import theory
    from pipeline.vehicle import load

    with _usage():
        rows = theory.steady_rows(
            load(vehicle, asked=OPTION), net_buoyancy, alpha or [], rpm=rpm, thrust=thrust, density=density, signs=signs
        )
    _print_json(rows) if json else _print_table(rows)


@app.command()
def trim(
    net_buoyancy: Forces,
    vehicle: VehicleName = "petrel-ii",
    pitch: Annotated[list[float] | None, typer.Option(metavar="DEG", help="Pitch held, nose up +; repeatable.")] = None,
    battery: Annotated[
        list[float] | None, typer.Option(metavar="M", help="Or battery position held, forward +; repeatable.")
    ] = None,
    rpm: Rpm = None,
    thrust: Thrust = None,
    density: Density = None,
    json: Json = False,
) -> None:
    """Theory: steady flight at a pitch, or at a battery position."""
    from pipeline import theory
    from pipeline.vehicle import load

    with _usage():
        rows = theory.trim_rows(
            load(vehicle, asked=OPTION),
            net_buoyancy,
            pitch_deg=pitch or [],
            battery=battery or [],
            rpm=rpm,
            thrust=thrust,
            density=density,
        )
    _print_json(rows) if json else _print_table(rows)


@app.command()
def simulate(
    trial: Annotated[str, typer.Argument(metavar="TRIAL", help="Name of the trial.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder of the mission.")],
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Seed of all noise.")] = 0,
    extra_drag: Annotated[float, typer.Option(metavar="KG/M", help="Added to K_D0.")] = 0.0,
    thrust_scale: Annotated[float, typer.Option(metavar="X", help="Factor on the thrust.")] = 1.0,
    buoyancy_offset: Annotated[float, typer.Option(metavar="N", help="Added to the net buoyancy.")] = 0.0,
    pitch_bias_deg: Annotated[float, typer.Option(metavar="DEG", help="Logged less true pitch.")] = 0.0,
    battery_offset: Annotated[float, typer.Option(metavar="M", help="True less logged battery position.")] = 0.0,
) -> None:
    """Write the logs of a trial whose truth is known."""
    from pipeline.simulate import Injection
    from pipeline.simulate import simulate as write

    with _usage():
        injection = Injection(
            extra_parasite_drag=extra_drag,
            thrust_scale=thrust_scale,
            buoyancy_offset=buoyancy_offset,
            pitch_bias_deg=pitch_bias_deg,
            battery_offset=battery_offset,
        )
        write(trial, out, seed=seed, injection=injection)
    print(f"{out}: {trial}, seed {seed}")


@app.command()
def fetch(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Name of the data set; none lists them.")] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Where to [default: raw/NAME].")] = None,
    json: Json = False,
) -> None:
    """Fetch a public data set of a real glider, by hash."""
    from pipeline import datasets
    from pipeline.findings import InputError

    known = datasets.load()
    if name is None:
        rows = [
            {"name": item.name, "files": len(item.files), "licence": item.licence, "description": item.description}
            for item in known.values()
        ]
        _print_json(rows) if json else _print_table(rows)
        return
    target = out or Path("raw") / name
    try:
        found = datasets.fetch(name, target)
    except InputError as error:
        print(error, file=sys.stderr)
        raise typer.Exit(SOME_FAILED if name in known else WRONG) from error
    print(f"{target}: {len(found.files)} files of {found.repository}, licence {found.licence}")


@app.command()
def paper(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder of paper.html and paper.json.")] = Path("paper"),
    json: Json = False,
) -> None:
    """Every number and figure of the paper of the theory (Niu 2017), computed again."""
    from pipeline.paper import PAGE, write

    _writable(out)
    found = write(out)
    if json:
        _print_json(found)
    else:
        print(f"{out / PAGE}: " + ", ".join(f"{count} {verdict}" for verdict, count in found["verdicts"].items()))


@app.command()
def vehicles(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="One vehicle only.")] = None, json: Json = False
) -> None:
    """Print the coefficient sets, with source and uncertainty."""
    from pipeline.vehicle import KNOWN, load, names

    found = [load(item, asked=("seatrial vehicles", "")) for item in ([name] if name else names())]
    if json:
        _print_json(
            [
                {
                    "name": item.name,
                    "description": item.description,
                    "coefficients": {key: vars(value) for key, value in item.coefficients.items()},
                }
                for item in found
            ]
        )
        return
    for item in found:
        print(f"{item.name}: {item.description}")
        _print_table(
            [
                {
                    "coefficient": key,
                    "symbol": KNOWN[key].symbol,
                    "value": value.value,
                    "1-sigma": value.std,
                    "unit": value.unit,
                    "source": f"{'assumed: ' if value.assumed else ''}{value.source}",
                }
                for key, value in item.coefficients.items()
            ]
        )
        print()


class Interrupted(BaseException):
    """The user pressed Ctrl-C; not an Exception, so that nothing but `main` takes notice."""


def main() -> NoReturn:
    """Run the command line; whatever goes wrong is one line on standard error."""
    signal.signal(signal.SIGINT, _interrupt)
    try:
        app()
    except Exception as error:
        from pipeline.findings import in_one_line

        _end(WRONG, str(in_one_line(error, "seatrial", "please report it")))
    except Interrupted:
        _end(INTERRUPTED, "interrupted; what is finished is kept, and the next run goes on from there")
    raise SystemExit(DONE)


def _interrupt(number: int, frame: object) -> NoReturn:
    raise Interrupted


def _end(code: int, line: str) -> NoReturn:
    """End at once, without waiting for workers: they end by themselves when this process does."""
    print(line, file=sys.stderr, flush=True)
    sys.stdout.flush()
    os._exit(code)


def _stage(
    stage: str,
    folder: Path,
    processed: Path,
    reports: Path,
    force: bool,
    engine: Literal["numba", "filterpy"] = "numba",
) -> None:
    """Run one stage of one mission here, and print how it ended."""
    from pipeline import campaign, index
    from pipeline.findings import InputError
    from pipeline.mission import FILE
    from pipeline.roster import plan
    from pipeline.workers import ONE_THREAD

    os.environ.update(ONE_THREAD)
    if not (folder / FILE).is_file():
        several = any(folder.glob(f"*/{FILE}"))
        remedy = f"'seatrial run {folder}' does every stage of all missions in it" if several else ""
        raise InputError(str(folder), found="no mission.yaml", expected="the folder of one mission", remedy=remedy)
    planned = plan(folder, processed, reports, engine)
    _writable(processed, reports)
    outcomes = planned.failed or [campaign.run_stage(planned.jobs[0], stage, force=force)]
    if stage == "report" and planned.jobs:
        index.write(processed, reports)
    _tell(outcomes[0])
    if outcomes[0].error:
        raise typer.Exit(WRONG if planned.failed else SOME_FAILED)


def _workers(jobs: Sequence[Job], count: int | None, scheduler: str | None) -> Workers:
    from pipeline.workers import cluster, cores, local

    if scheduler is not None:
        return cluster(scheduler)
    return local(max(1, min(count or cores(), len(jobs))))


def _writable(*folders: Path) -> None:
    """Raise `InputError` if files cannot be written into one of `folders`, which are created."""
    import tempfile

    from pipeline.findings import InputError

    for folder in folders:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise InputError(
                str(folder),
                found=f"a folder that cannot be written ({error.strerror})",
                expected="one that can",
                remedy="choose another with --processed and --reports",
            ) from error


@contextmanager
def _usage() -> Iterator[None]:
    """Turn a ValueError of the theory into an error of usage."""
    try:
        yield
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


def _tell(outcome: object) -> None:
    failed = bool(getattr(outcome, "error", ""))
    print(outcome, file=sys.stderr if failed else sys.stdout, flush=True)


def _print_json(content: Any) -> None:
    import json

    from pipeline.store import plain

    print(json.dumps(plain(content), indent=1, ensure_ascii=False, allow_nan=False))


def _print_table(rows: Iterable[Mapping[str, Any]]) -> None:
    """Print `rows` in columns as wide as they must be; a missing number is a dash, a column of nothing is left out."""
    texts = [{name: _text(value) for name, value in row.items()} for row in rows]
    names = [name for name in (texts[0] if texts else {}) if any(row[name] for row in texts)]
    widths = {name: max(len(name), *(len(row[name]) for row in texts)) for name in names}
    for row in ({name: name for name in names}, *texts):
        print("  ".join(row[name].ljust(widths[name]) for name in names).rstrip())


def _text(value: object) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value + 0.0:.6g}" if isinstance(value, float) else str(value)

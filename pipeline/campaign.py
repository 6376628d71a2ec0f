"""The campaign: missions through the four stages, on many cores; resumable, and never stopped by one mission.

Heavy libraries are imported by the stages alone, so that a run that finds nothing to do ends at once.
"""

from __future__ import annotations

import os
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from importlib import import_module
from multiprocessing import parent_process
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

from pipeline import mission as missions
from pipeline import provenance, store
from pipeline.findings import InputError, in_one_line
from pipeline.progress import Bar
from pipeline.roster import OUTPUTS, REPORTED, STAGES, Job, Outcome, inputs, resolve_vehicle

if TYPE_CHECKING:
    from pipeline.mission import Mission
    from pipeline.report import Inputs
    from pipeline.workers import Workers

#: Keys of mission.yaml that a stage's result does not depend on.
UNREAD: dict[str, set[str]] = {
    "ingest": {
        *("vehicle", "description", "ballast", "coefficients", "speed_sensor", "speed_sensor_scale_std", "gps"),
        *("nominal", "configurations"),
    },
    "estimate": {"description", "nominal", "configurations", "format", "files", "vehicle", "coefficients"},
    "model": set(missions.Mission.model_fields),
    "report": {"vehicle", "coefficients", "files"},
}

ERROR_LOG = "error.log"
#: What takes longest to be loaded, in the order in which it is needed: loaded while compiled code reads the logs.
SLOWLY_LOADED = ("scipy.signal", "pipeline.estimate.stage", "pipeline.report.summary", "pipeline.report.page")


def stage_key(job: Job, stage: str) -> dict[str, Any]:
    """Return all that the result of `stage` depends on, see `provenance.key`.

    Raises
    ------
    InputError
        If the mission cannot be read, or a stage before this one has not been run.
    """
    with _in_one_line(job, stage):
        return _describe(job, stage, missions.load(job.folder))


def _describe(job: Job, stage: str, mission: Mission) -> dict[str, Any]:
    configuration: dict[str, Any] = {
        "mission": mission.model_dump(mode="json", exclude=UNREAD[stage]),
        "name": mission.slug,
    }
    if stage == "ingest":
        files, configuration["beside"] = inputs(mission)
        return provenance.key(stage, provenance.digests(files), configuration)
    earlier = [name for before in STAGES[: STAGES.index(stage)] for name in OUTPUTS[before]]
    files = {name: job.path(name) for name in earlier if job.path(name).is_file()}
    for name in earlier:
        if name not in files and name != "stored.parquet":
            before = next(before for before in STAGES if name in OUTPUTS[before])
            raise InputError(
                f"{job.results.parent.name}/{job.name}/{name}",
                found="no such file",
                expected=f"the result of stage '{before}'",
                remedy=f"run 'seatrial {before} {job.folder}' first",
            )
    vehicle = resolve_vehicle(mission, store.read_json(job.path("ingest.json"))["constants"])
    described = {name: list(vars(item).values()) for name, item in sorted(vehicle.coefficients.items())}
    configuration["vehicle"] = {"name": vehicle.name, "coefficients": store.digest_text(repr(described))}
    if vehicle.correlations:
        configuration["vehicle"]["correlations"] = store.digest_text(repr(sorted(vehicle.correlations.items())))
    if stage == "estimate":
        configuration["engine"] = job.engine
    if stage == "report":
        configuration["provenance"] = store.digest_text(repr(_before_report(job)))
    return provenance.key(stage, provenance.digests(files), configuration)


def _before_report(job: Job) -> dict[str, Any]:
    """Return the provenance that the page tells of: that of the stages before the last."""
    return {stage: entry for stage, entry in provenance.read(job.results).items() if stage != "report"}


def perform(job: Job, stage: str, described: Mapping[str, Any]) -> dict[store.FileState, str]:
    """Run one stage of one mission and record where its results came from; return their digests, see `store.trust`.

    Raises
    ------
    InputError
        If the stage cannot be done, whatever the reason.
    """
    with _in_one_line(job, stage):
        _RUN[stage](job, missions.load(job.folder), described)
        written = {name: job.path(name) for name in OUTPUTS[stage] if job.path(name).is_file()}
        provenance.record(job.results, stage, described, provenance.digests(written))
        (job.results / ERROR_LOG).unlink(missing_ok=True)
        return store.digested(written.values())


@contextmanager
def _in_one_line(job: Job, stage: str) -> Iterator[None]:
    """Turn any error into an `InputError`; the account of one that nobody foresaw goes to error.log."""
    try:
        yield
    except (InputError, OSError) as error:
        raise in_one_line(error, stage, "") from error
    except Exception as error:
        place = str(provenance.PACKAGE.parent) + os.sep
        account = "".join(traceback.format_exception(error)).replace(place, "")
        store.write_text(job.results / ERROR_LOG, account)
        remedy = f"please report it with {job.results.parent.name}/{job.name}/{ERROR_LOG}"
        raise in_one_line(error, stage, remedy) from error


def _ingest(job: Job, mission: Mission, described: Mapping[str, Any]) -> None:
    from pipeline.ingest import ingest
    from pipeline.records import RECORDS, STORED

    if parent_process() is not None:  # a worker, which later stages are for
        Thread(target=lambda: [import_module(name) for name in SLOWLY_LOADED]).start()
    result = ingest(mission)
    store.write_table(job.path("records.parquet"), result.records, RECORDS, {"mission": job.name})
    if result.stored is None:
        job.path("stored.parquet").unlink(missing_ok=True)
    else:
        store.write_table(job.path("stored.parquet"), result.stored, STORED, {"mission": job.name})
    content = {
        "format": result.format,
        "constants": result.constants,
        "findings": [finding.as_dict() for finding in result.findings],
    }
    store.write_json(job.path("ingest.json"), content)


def _estimate(job: Job, mission: Mission, described: Mapping[str, Any]) -> None:
    from pipeline.estimate.stage import stream
    from pipeline.records import BLOCKS, ESTIMATES

    constants = store.read_json(job.path("ingest.json"))["constants"]
    vehicle = resolve_vehicle(mission, constants)
    with (
        store.table_reader(job.path("records.parquet")) as records,
        store.table_writer(job.path("estimates.parquet"), ESTIMATES, {"mission": job.name}) as table,
    ):
        summary = stream(
            records, vehicle, mission, table.write, constants=constants, engine=job.engine, threads=job.threads
        )
    store.write_table(job.path("blocks.parquet"), summary.blocks, BLOCKS, {"mission": job.name})
    listed = [finding.as_dict() for finding in summary.findings]
    store.write_json(job.path("estimate.json"), {**summary.report, "findings": listed})


def _model(job: Job, mission: Mission, described: Mapping[str, Any]) -> None:
    from pipeline.model.predict import predict
    from pipeline.records import PREDICTIONS

    vehicle = resolve_vehicle(mission, store.read_json(job.path("ingest.json"))["constants"])
    predictions = predict(vehicle, store.read_table(job.path("blocks.parquet")))
    store.write_table(job.path("predictions.parquet"), predictions, PREDICTIONS, {"mission": job.name})


def _report(job: Job, mission: Mission, described: Mapping[str, Any]) -> None:
    from pipeline.report import Inputs, build, coefficients, corrected
    from pipeline.report.figures import files
    from pipeline.table import Table
    from pipeline.workers import beside

    ingested = store.read_json(job.path("ingest.json"))
    inputs = Inputs(
        mission=mission,
        vehicle=resolve_vehicle(mission, ingested["constants"]),
        records=Table(job.path("records.parquet")),
        estimates=Table(job.path("estimates.parquet"), "kinematic"),
        force=Table(job.path("estimates.parquet"), "force"),
        blocks=store.read_table(job.path("blocks.parquet")),
        predictions=store.read_table(job.path("predictions.parquet")),
        stored=store.read_table(job.path("stored.parquet")) if job.path("stored.parquet").is_file() else None,
        ingest=ingested,
        estimate=store.read_json(job.path("estimate.json")),
        provenance={"stages": {**_before_report(job), "report": dict(described)}},
    )
    with beside(job.threads) as start:
        exported = start(_export, job, inputs)
        summary, page, pictures = build(inputs, start)
        exported()
    store.write_json(job.path("summary.json"), summary)
    store.write_text(job.path("report.html"), page)
    files.write(job.path, pictures, {"mission": mission.slug})
    vehicle = corrected.of_mission(inputs)
    store.write_text(job.path(corrected.FILE), corrected.text(vehicle, mission.slug))
    store.write_text(job.path(coefficients.FILE), coefficients.text(vehicle.vehicle, mission.slug))


def _export(job: Job, inputs: Inputs) -> None:
    """Write the estimates as netCDF, where there are any and a package that does it."""
    from pipeline.report import og1

    if og1.missing() is None and len(inputs.records):
        with store.whole(job.path(og1.FILE)) as file:
            methods = {"kinematic": inputs.estimates, "force": inputs.force}
            og1.write(file, inputs.mission, inputs.vehicle, inputs.records, methods)
    else:
        job.path(og1.FILE).unlink(missing_ok=True)


_RUN: dict[str, Callable[[Job, Mission, Mapping[str, Any]], None]] = {
    "ingest": _ingest,
    "estimate": _estimate,
    "model": _model,
    "report": _report,
}


def fail(job: Job, stage: str, error: str) -> None:
    """Remove what is no longer true of a mission that failed in `stage`, and leave the reason for the index."""
    if job.results.is_dir():
        provenance.forget(job.results, stage)
    for later in STAGES[STAGES.index(stage) :]:
        for name in OUTPUTS[later]:
            job.path(name).unlink(missing_ok=True)
    mark(job.reports, job.name, error)


def mark(reports: Path, name: str, error: str) -> None:
    """Put the reason why there is no report in the place of the report."""
    for output in REPORTED:
        (reports / output).unlink(missing_ok=True)
    with suppress(OSError):
        (reports / "figures").rmdir()
    store.write_json(reports / "summary.json", {"mission": name, "error": error})


def run_stage(job: Job, stage: str, *, force: bool = False) -> Outcome:
    """Run one stage of one mission in this process, on all its cores, unless nothing has changed since the last run."""
    from pipeline.workers import cores

    try:
        described = stage_key(job, stage)
        if not force and provenance.is_current(provenance.read(job.results).get(stage), described, job.path):
            return Outcome(job.name)
        perform(replace(job, threads=cores()), stage, described)
    except InputError as error:
        return Outcome(job.name, error=str(error))
    return Outcome(job.name, (stage,))


@dataclass
class _Course:
    """How far a mission has come in this run: the stages ahead of it, and those that were run."""

    job: Job
    ahead: deque[str] = field(default_factory=lambda: deque(STAGES))
    ran: list[str] = field(default_factory=list)
    alone: bool = False


def run(
    jobs: list[Job], workers: Workers, *, force: bool = False, tell: Callable[[Outcome], None] = lambda outcome: None
) -> list[Outcome]:
    """Take every mission through every stage that is not current, and return how each ended, in the order of `jobs`.

    A mission whose process is killed is tried once more with nothing beside it; only if it dies again has it failed.

    Parameters
    ----------
    jobs
        The missions.
    workers
        Where stages run.
    force
        Run stages that are current, too.
    tell
        Called with each outcome as soon as it is known.
    """
    outcomes: dict[str, Outcome] = {}
    waiting = deque(_Course(job) for job in jobs)
    orphans: deque[_Course] = deque()
    running: dict[Future[dict[store.FileState, str]], _Course] = {}

    def end(course: _Course, error: str = "") -> None:
        if error:
            fail(course.job, course.ahead[0], error)
        outcome = Outcome(course.job.name, tuple(course.ran), error)
        outcomes[course.job.name] = outcome
        tell(outcome)

    def start(course: _Course) -> None:
        """Submit the first stage ahead of a mission that is not current, if there is one."""
        while course.ahead:
            stage = course.ahead[0]
            try:
                described = stage_key(course.job, stage)
            except InputError as error:
                return end(course, str(error))
            recorded = provenance.read(course.job.results).get(stage)
            if force or not provenance.is_current(recorded, described, course.job.path):
                job = replace(course.job, threads=workers.threads)
                running[workers.submit(perform, job, stage, described)] = course
                return None
            course.ahead.popleft()
        return end(course)

    def finish(future: Future[dict[store.FileState, str]], course: _Course) -> None:
        try:
            store.trust(future.result())
        except InputError as error:
            end(course, str(error))
        except BrokenExecutor:
            if course.alone:
                end(course, str(_killed(course)))
            else:
                course.alone = True
                orphans.append(course)
        except Exception as error:
            end(
                course,
                f"{course.ahead[0]}: found {type(error).__name__} from the scheduler: {error}",
            )
        else:
            course.ran.append(course.ahead.popleft())
            course.alone = False
            waiting.appendleft(course)

    with Bar(len(jobs) * len(STAGES)) as bar:
        while waiting or orphans or running:
            if orphans:
                if not running:
                    start(orphans.popleft())
            else:
                while waiting and len(running) < workers.width:
                    start(waiting.popleft())
            for future in wait(running, timeout=0.25, return_when=FIRST_COMPLETED).done:
                finish(future, running.pop(future))
            ahead = sum(len(course.ahead) for course in (*running.values(), *waiting, *orphans))
            bar.update(len(jobs) * len(STAGES) - ahead, (f"{c.job.name} {c.ahead[0]}" for c in running.values()))
    return [outcomes[job.name] for job in jobs]


def _killed(course: _Course) -> InputError:
    return InputError(
        course.ahead[0],
        found="that its process was killed, twice",
        expected="it to end by itself",
        remedy="perhaps memory ran out: set 'dives' in mission.yaml, or use a larger machine",
    )

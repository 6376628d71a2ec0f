"""The campaign: what is run again and what is not, what a failure costs, and that a killed run leaves no trace."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import pytest

from pipeline import campaign, index, provenance, store
from pipeline.campaign import UNREAD
from pipeline.findings import InputError
from pipeline.mission import Mission, load
from pipeline.report import Index
from pipeline.report.figures import files
from pipeline.roster import OUTPUTS, REPORTED, STAGES, Job, Outcome, plan, resolve_vehicle
from pipeline.workers import Workers, local

SEATRIAL = str(Path(sys.executable).with_name("seatrial"))
RAW = Path(__file__).parents[1] / "raw"

Stage = Callable[[Job, Mission, Mapping[str, Any]], None]


def small_mission(folder: Path, rows: int = 1200) -> Path:
    """Copy the beginning of a trial in raw/ to `folder`."""
    folder.mkdir(parents=True)
    shutil.copy(RAW / "petrel2-scs-2015" / "mission.yaml", folder)
    for log in sorted((RAW / "petrel2-scs-2015").glob("*.csv")):
        lines = log.read_text().splitlines(keepends=True)
        (folder / log.name).write_text("".join(lines[:rows]))
    return folder


def bare_mission(folder: Path, extra: str = "") -> Path:
    """Make a mission that only a fake stage can read."""
    folder.mkdir(parents=True)
    (folder / "mission.yaml").write_text(f"vehicle: petrel-ii\n{extra}")
    (folder / "log.csv").write_text("time,pitch\n0,1\n")
    return folder


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str]]:
    """Replace every stage by one that writes a line into each of its files; return the calls (mission, stage)."""
    calls: list[tuple[str, str]] = []

    def fake(stage: str) -> Stage:
        def run(job: Job, mission: Mission, described: Mapping[str, Any]) -> None:
            calls.append((job.name, stage))
            text = json.dumps({"mission": job.name, "constants": {}, "stage": stage, "block_s": mission.block_s})
            for name in OUTPUTS[stage]:
                if name != "stored.parquet":
                    store.write_text(job.path(name), text)

        return run

    monkeypatch.setattr(campaign, "_RUN", {stage: fake(stage) for stage in STAGES})
    monkeypatch.setattr("pipeline.report.index", lambda summaries: Index({"missions": []}, json.dumps(summaries), {}))
    return calls


def run(root: Path, *, force: bool = False, workers: Workers | None = None) -> dict[str, Outcome]:
    planned = plan(root / "raw", root / "processed", root / "reports")
    with workers or Workers(lambda: ThreadPoolExecutor(1), 1) as pool:
        outcomes = campaign.run(planned.jobs, pool, force=force)
    index.write(root / "processed", root / "reports")
    return {outcome.name: outcome for outcome in outcomes}


def contents(root: Path) -> dict[str, bytes]:
    """Return every file of a run's output by its place."""
    return {
        path.relative_to(root).as_posix(): path.read_bytes()
        for folder in ("processed", "reports")
        for path in sorted((root / folder).rglob("*"))
        if path.is_file()
    }


class TestWhatIsRunAgain:
    def test_an_unchanged_mission_is_not(self, tmp_path: Path, called: list[tuple[str, str]]) -> None:
        bare_mission(tmp_path / "raw" / "a")
        assert run(tmp_path)["a"].ran == STAGES
        before = contents(tmp_path)
        assert run(tmp_path)["a"].ran == ()
        assert len(called) == len(STAGES)
        assert contents(tmp_path) == before

    def test_a_changed_log_runs_every_stage(self, tmp_path: Path, called: list[tuple[str, str]]) -> None:
        folder = bare_mission(tmp_path / "raw" / "a")
        run(tmp_path)
        (folder / "log.csv").write_text("time,pitch\n0,2\n")
        assert run(tmp_path)["a"].ran[0] == "ingest"

    def test_a_touched_but_equal_log_runs_nothing(self, tmp_path: Path, called: list[tuple[str, str]]) -> None:
        folder = bare_mission(tmp_path / "raw" / "a")
        run(tmp_path)
        os.utime(folder / "log.csv", (1, 1))
        assert run(tmp_path)["a"].ran == ()

    def test_stages_whose_input_came_out_the_same_are_not(self, tmp_path: Path, called: list[tuple[str, str]]) -> None:
        folder = bare_mission(tmp_path / "raw" / "a")
        run(tmp_path)
        (folder / "log.csv").write_text("time,pitch\n0,2\n")
        assert run(tmp_path)["a"].ran == ("ingest", "report")

    @pytest.mark.parametrize(
        ("line", "stages"),
        [
            ("description: for the page\n", ("report",)),
            ("ballast: {std: 0.5}\n", ("estimate", "report")),
            ("coefficients: {parasite_drag: 8.0}\n", ("estimate", "model", "report")),
            ("# a comment\n", ()),
        ],
    )
    def test_only_stages_that_depend_on_a_changed_key_are(
        self, tmp_path: Path, called: list[tuple[str, str]], line: str, stages: tuple[str, ...]
    ) -> None:
        folder = bare_mission(tmp_path / "raw" / "a")
        run(tmp_path)
        with (folder / "mission.yaml").open("a") as file:
            file.write(line)
        assert run(tmp_path)["a"].ran == stages

    @pytest.mark.parametrize("name", [name for outputs in OUTPUTS.values() for name in outputs if name[0] != "s"])
    def test_a_result_that_was_changed_or_removed_is(
        self, tmp_path: Path, called: list[tuple[str, str]], name: str
    ) -> None:
        bare_mission(tmp_path / "raw" / "a")
        run(tmp_path)
        before = contents(tmp_path)
        path = plan(tmp_path / "raw", tmp_path / "processed", tmp_path / "reports").jobs[0].path(name)
        stage = next(stage for stage in STAGES if name in OUTPUTS[stage])
        for spoil in (path.unlink, lambda: path.write_text("{}")):
            spoil()
            assert run(tmp_path)["a"].ran[0] == stage
            assert contents(tmp_path) == before

    def test_force_runs_all(self, tmp_path: Path, called: list[tuple[str, str]]) -> None:
        bare_mission(tmp_path / "raw" / "a")
        run(tmp_path)
        assert run(tmp_path, force=True)["a"].ran == STAGES

    def test_other_software_runs_all(
        self, tmp_path: Path, called: list[tuple[str, str]], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        bare_mission(tmp_path / "raw" / "a")
        run(tmp_path)
        monkeypatch.setattr(provenance, "versions", lambda: {"numpy": "of tomorrow"})
        assert run(tmp_path)["a"].ran == STAGES

    def test_the_engine_matters_to_the_estimate(self, tmp_path: Path, called: list[tuple[str, str]]) -> None:
        bare_mission(tmp_path / "raw" / "a")
        run(tmp_path)
        jobs = plan(tmp_path / "raw", tmp_path / "processed", tmp_path / "reports", "filterpy").jobs
        with Workers(lambda: ThreadPoolExecutor(1), 1) as workers:
            assert campaign.run(jobs, workers)[0].ran == ("estimate", "report")

    def test_a_spoilt_provenance_is_as_good_as_none(self, tmp_path: Path, called: list[tuple[str, str]]) -> None:
        bare_mission(tmp_path / "raw" / "a")
        run(tmp_path)
        (tmp_path / "processed" / "a" / "provenance.json").write_text("{")
        assert run(tmp_path)["a"].ran == STAGES


class TestWhatAFailureCosts:
    def failing(self, monkeypatch: pytest.MonkeyPatch, stage: str, name: str, error: BaseException) -> None:
        stages: dict[str, Stage] = dict(campaign._RUN)
        before = stages[stage]

        def fail(job: Job, mission: Mission, described: Mapping[str, Any]) -> None:
            if job.name == name:
                raise error
            before(job, mission, described)

        monkeypatch.setattr(campaign, "_RUN", {**stages, stage: fail})

    def test_one_mission_and_its_line_stands_in_the_index(
        self, tmp_path: Path, called: list[tuple[str, str]], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for name in ("a", "b", "c"):
            bare_mission(tmp_path / "raw" / name)
        self.failing(monkeypatch, "estimate", "b", InputError("log.csv", "row 2", found="no pitch"))
        outcomes = run(tmp_path)
        assert [outcome.error for outcome in outcomes.values()] == ["", "log.csv: row 2: found no pitch", ""]
        written = json.loads((tmp_path / "reports" / "index.html").read_text())
        assert written[1] == {"mission": "b", "error": "log.csv: row 2: found no pitch"}

    def test_results_that_are_no_longer_true_are_removed_and_come_back(
        self, tmp_path: Path, called: list[tuple[str, str]], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        folder = bare_mission(tmp_path / "raw" / "a")
        run(tmp_path)
        before = contents(tmp_path)
        with monkeypatch.context() as spoilt:
            self.failing(spoilt, "estimate", "a", InputError("log.csv", found="no pitch"))
            (folder / "mission.yaml").write_text("vehicle: petrel-ii\nballast: {std: 0.5}\n")
            run(tmp_path)
        left = {path.name for place in ("processed", "reports") for path in (tmp_path / place / "a").iterdir()}
        assert left == {"records.parquet", "ingest.json", "provenance.json", "summary.json"}
        (folder / "mission.yaml").write_text("vehicle: petrel-ii\n")
        assert run(tmp_path)["a"].ran == STAGES[1:]
        assert contents(tmp_path) == before

    def test_an_error_nobody_foresaw_is_one_line_and_its_account_a_file(
        self, tmp_path: Path, called: list[tuple[str, str]], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        bare_mission(tmp_path / "raw" / "a")
        self.failing(monkeypatch, "model", "a", ZeroDivisionError("division\nby zero"))
        line = run(tmp_path)["a"].error
        assert line.startswith("model: line ")
        assert line.endswith(
            ": found ZeroDivisionError: division by zero; expected no such error; "
            "please report it with processed/a/error.log"
        )
        account = (tmp_path / "processed" / "a" / "error.log").read_text()
        assert "ZeroDivisionError: division" in account
        assert str(provenance.PACKAGE) not in account

    def test_the_account_goes_when_the_error_does(
        self, tmp_path: Path, called: list[tuple[str, str]], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        bare_mission(tmp_path / "raw" / "a")
        with monkeypatch.context() as spoilt:
            self.failing(spoilt, "model", "a", ZeroDivisionError())
            run(tmp_path)
        run(tmp_path)
        assert not (tmp_path / "processed" / "a" / "error.log").exists()

    def test_a_full_disk_is_one_line(
        self, tmp_path: Path, called: list[tuple[str, str]], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        bare_mission(tmp_path / "raw" / "a")
        self.failing(monkeypatch, "ingest", "a", OSError(28, "No space left on device", "/x/records.parquet"))
        line = "ingest: records.parquet: found No space left on device; expected to read and write it"
        assert run(tmp_path)["a"].error == line

    @pytest.mark.parametrize("twice", [False, True])
    def test_a_killed_process_costs_its_mission_only_if_it_dies_alone_too(
        self, tmp_path: Path, called: list[tuple[str, str]], twice: bool
    ) -> None:
        for name in ("a", "b", "c"):
            bare_mission(tmp_path / "raw" / name)
        deaths: list[str] = []

        class Fragile(Executor):
            """Dies with mission b in stage estimate, and takes what runs beside it along."""

            def __init__(self) -> None:
                self.dead = False

            def submit(self, task: Any, /, *arguments: Any, **options: Any) -> Future[Any]:
                if self.dead:
                    raise BrokenProcessPool
                future: Future[Any] = Future()
                job, stage = arguments[:2]
                if (job.name, stage) == ("b", "estimate") and (twice or not deaths):
                    deaths.append(job.name)
                    self.dead = True
                    future.set_exception(BrokenProcessPool())
                else:
                    future.set_result(task(*arguments))
                return future

        outcomes = run(tmp_path, workers=Workers(Fragile, 2))
        killed = "estimate: found that its process was killed, twice; expected it to end by itself; "
        assert outcomes["a"].error == outcomes["c"].error == ""
        assert outcomes["b"].error.startswith(killed) if twice else outcomes["b"].error == ""

    def test_a_process_that_is_really_killed_is_replaced(self) -> None:
        with local(1) as workers:
            with pytest.raises(BrokenProcessPool):
                workers.submit(os._exit, 9).result()
            assert workers.submit(abs, -1).result() == 1


class TestWhatAMissionIs:
    def test_a_folder_with_mission_yaml_in_raw_or_raw_itself(self, tmp_path: Path) -> None:
        folder = bare_mission(tmp_path / "raw" / "a")
        bare_mission(tmp_path / "raw" / ".hidden")
        for raw in (tmp_path / "raw", folder):
            assert [job.folder for job in plan(raw, tmp_path, tmp_path).jobs] == [folder]

    def test_the_present_folder_has_a_name(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(bare_mission(tmp_path / "raw" / "a"))
        assert plan(Path(), tmp_path, tmp_path).jobs[0].name == "a"

    def test_a_folder_of_files_without_one_is_named_with_the_remedy(self, tmp_path: Path) -> None:
        bare_mission(tmp_path / "raw" / "a")
        (tmp_path / "raw" / "b").mkdir()
        (tmp_path / "raw" / "b" / "x.dbd").touch()
        (tmp_path / "raw" / "empty").mkdir()
        assert [str(item) for item in plan(tmp_path / "raw", tmp_path, tmp_path).strangers] == [
            "raw/b: found no mission.yaml; expected one in every folder of logs; "
            "not analysed; the smallest useful one is 'vehicle: slocum-g2'"
        ]

    @pytest.mark.parametrize("name", ["../a", ".a", "a/b", "index.html", "index.json"])
    def test_a_name_that_would_leave_the_folder_of_results_is_refused(self, tmp_path: Path, name: str) -> None:
        bare_mission(tmp_path / "raw" / "a", f"name: '{name}'\n")
        planned = plan(tmp_path / "raw", tmp_path, tmp_path)
        assert not planned.jobs
        assert planned.failed[0].error == f"a/mission.yaml: name: found '{name}'; expected a folder's name"

    def test_an_override_of_an_unknown_coefficient_names_the_nearest(self, tmp_path: Path) -> None:
        bare_mission(tmp_path / "raw" / "a", "coefficients: {parasitic_drag: 7.0}\n")
        line = "mission.yaml: coefficients.parasitic_drag: found an unknown coefficient; did you mean 'parasite_drag'?"
        assert plan(tmp_path / "raw", tmp_path, tmp_path).failed[0].error == line

    def test_the_mass_kept_in_the_logs_is_taken_and_the_fitted_polar_is_not(self, tmp_path: Path) -> None:
        mission = load(bare_mission(tmp_path / "a", "coefficients: {lift_slope: 300.0}\n"))
        vehicle = resolve_vehicle(mission, {"mass": 52.0, "hd_b": 0.01, "hd_a": 0.003, "abs_compress": 9e-6})
        plain = resolve_vehicle(load(bare_mission(tmp_path / "b")), {})
        assert vehicle["mass"] == 52.0
        assert vehicle["lift_slope"] == 300.0
        assert vehicle.std("lift_slope") / 300.0 == pytest.approx(plain.std("lift_slope") / plain["lift_slope"])
        for name in ("parasite_drag", "induced_drag", "compressibility"):
            assert vehicle[name] == plain[name]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Take the first minutes of two missions through the four stages as they are."""
    root = tmp_path_factory.mktemp("undisturbed")
    for name in ("a", "b"):
        small_mission(root / "raw" / name)
    done = subprocess.run([SEATRIAL, "run", "--jobs", "2"], cwd=root, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")  # no bar where there is no terminal
    assert done.stdout.splitlines()[-1] == "2 done, 0 failed: reports/index.html"
    return root


class TestRealStages:
    """The four stages as they are, on the first minutes of two missions."""

    def test_every_result_is_there(self, undisturbed: Path) -> None:
        expected = {f"processed/{m}/{name}" for m in "ab" for s in STAGES[:3] for name in OUTPUTS[s]}
        expected |= {f"reports/{m}/{name}" for m in "ab" for name in set(REPORTED) - set(files.NAMES)}
        expected |= {f"processed/{m}/{name}" for m in "ab" for name in set(OUTPUTS["report"]) - set(REPORTED)}
        expected |= {f"processed/{place}provenance.json" for place in ("a/", "b/", "")}
        expected |= {f"reports/{name}" for name in (*index.OUTPUTS, *index.FIGURES)}
        found = {name for name in contents(undisturbed) if "/figures/" not in name}
        assert found == {name for name in expected if not name.endswith("stored.parquet")}

    def test_every_figure_is_there_as_drawing_picture_and_table(self, undisturbed: Path) -> None:
        figures = {name for name in contents(undisturbed) if "/figures/" in name}
        drawn = {name.removesuffix(".svg") for name in figures if name.endswith(".svg")}
        assert {"reports/a/figures/water", "reports/b/figures/flight"} <= drawn
        assert figures == {f"{name}.{kind}" for name in drawn for kind in files.KINDS}
        assert figures <= {f"reports/{m}/{name}" for m in "ab" for name in files.NAMES}

    def test_results_do_not_depend_on_the_place_nor_on_what_else_was_run(
        self, undisturbed: Path, tmp_path: Path
    ) -> None:
        shutil.copytree(undisturbed / "raw", tmp_path / "raw")
        places = ["--processed", str(tmp_path / "processed"), "--reports", str(tmp_path / "reports")]
        for stage in STAGES:
            subprocess.run([SEATRIAL, stage, str(tmp_path / "raw" / "b"), *places], check=True, capture_output=True)
        found = {name: data for name, data in contents(tmp_path).items() if "/b/" in name}
        assert found == {name: data for name, data in contents(undisturbed).items() if "/b/" in name}
        assert not [name for name, data in found.items() if str(tmp_path).encode() in data]

    def test_a_second_run_imports_nothing_heavy(self, undisturbed: Path) -> None:
        code = (
            "import sys; from pipeline import cli\n"
            "try: cli.app(['run'])\n"
            "except SystemExit as end: assert end.code == 0, end.code\n"
            "print(sorted({'numba', 'matplotlib', 'pyarrow', 'scipy', 'jinja2', 'rich'} & set(sys.modules)))"
        )
        done = subprocess.run([sys.executable, "-c", code], cwd=undisturbed, capture_output=True, text=True, check=True)
        assert done.stdout.splitlines() == [
            "a: unchanged",
            "b: unchanged",
            "2 done, 0 failed: reports/index.html",
            "[]",
        ]

    def test_a_stage_reads_only_the_keys_that_its_record_holds(self, undisturbed: Path, tmp_path: Path) -> None:
        read: set[str] = set()

        class Watched(Mission):
            def __getattribute__(self, name: str) -> Any:
                if name in Mission.model_fields:
                    read.add(name)
                return super().__getattribute__(name)

        shutil.copytree(undisturbed, tmp_path / "copy")
        job = plan(tmp_path / "copy/raw/a", tmp_path / "copy/processed", tmp_path / "copy/reports").jobs[0]
        mission = load(job.folder)
        watched = Watched(**{name: getattr(mission, name) for name in Mission.model_fields})
        resolved = {"folder", "name", "vehicle", "coefficients"}  # in the record as the vehicle and the name
        for stage in STAGES:
            described = campaign.stage_key(job, stage)
            read.clear()
            campaign._RUN[stage](job, watched, described)
            assert not (read & UNREAD[stage]) - (resolved if stage != "ingest" else {"folder", "name"}), stage

    def test_a_run_killed_at_any_moment_leaves_whole_files_and_the_next_one_the_same_bytes(
        self, undisturbed: Path, tmp_path: Path
    ) -> None:
        import pyarrow.parquet as pq

        shutil.copytree(undisturbed / "raw" / "a", tmp_path / "raw" / "a")
        command = [SEATRIAL, "run"]
        begin = time.monotonic()
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
        whole_run = time.monotonic() - begin
        expected = contents(tmp_path)
        moments = random.Random(20140728)
        kills, wanted = 0, 20
        while kills < wanted:  # at random, one in every twentieth of a run
            begin, from_nothing = time.monotonic(), not (tmp_path / "processed").exists()
            process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL)
            try:
                process.wait(timeout=0.9 * (kills + moments.random()) / wanted * whole_run)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                kills += 1
            if process.returncode == 0:
                if from_nothing:
                    whole_run = min(whole_run, time.monotonic() - begin)
                assert contents(tmp_path) == expected
                for folder in ("processed", "reports"):
                    shutil.rmtree(tmp_path / folder)
            for path in (path for folder in ("processed", "reports") for path in (tmp_path / folder).rglob("*.*")):
                if path.suffix == ".parquet":
                    pq.read_table(path)
                elif path.suffix == ".json":
                    json.loads(path.read_text())
                elif path.suffix == ".html":
                    assert path.read_text().rstrip().endswith("</html>")
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
        assert contents(tmp_path) == expected

    def test_workers_end_with_the_run_that_started_them(self, undisturbed: Path) -> None:
        code = (
            "import os, time; from pipeline.workers import local\n"
            "with local(1) as workers:\n"
            "    print(workers.submit(os.getpid).result(), flush=True)\n"
            "    workers.submit(time.sleep, 600)\n"
            "    os.kill(os.getpid(), 9)\n"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        worker = Path("/proc") / done.stdout.strip()
        patience = time.monotonic() + 30
        while worker.exists() and "zombie" not in (worker / "status").read_text():
            assert time.monotonic() < patience, "the worker outlived its run"
            time.sleep(0.05)

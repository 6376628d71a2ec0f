"""The command line: exit codes, the one line that every error gets, JSON that parses, and a start without delay."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from pipeline import __version__

SEATRIAL = str(Path(sys.executable).with_name("seatrial"))
COMMANDS = (
    "run",
    "ingest",
    "estimate",
    "model",
    "report",
    "check",
    "steady",
    "trim",
    "simulate",
    "fetch",
    "vehicles",
)


def seatrial(*arguments: str, cwd: Path | None = None) -> tuple[int, str, str]:
    """Return exit code, standard output and standard error of a command."""
    done = subprocess.run([SEATRIAL, *arguments], cwd=cwd, capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    return done.returncode, done.stdout, done.stderr


def mission(folder: Path, text: str = "vehicle: petrel-ii\n") -> Path:
    """Make a mission whose one log cannot be read for want of a pitch."""
    folder.mkdir(parents=True)
    (folder / "mission.yaml").write_text(text)
    (folder / "log.csv").write_text("time,pressure\n2020-01-01T00:00:00,1\n2020-01-01T00:00:02,2\n")
    return folder


class TestStart:
    def test_help_lists_every_command_and_the_exit_codes(self) -> None:
        code, out, _ = seatrial("--help")
        assert code == 0
        for command in COMMANDS:
            assert f"  {command} " in out
        assert "2 wrong usage" in " ".join(out.split())

    @pytest.mark.parametrize("command", COMMANDS)
    def test_every_command_has_help(self, command: str) -> None:
        code, out, _ = seatrial(command, "--help")
        assert code == 0
        assert out.startswith(f"Usage: seatrial {command} ")

    def test_the_parser_imports_nothing_of_the_pipeline_nor_anything_heavy(self) -> None:
        code = (
            "import sys, pipeline.cli\n"
            "heavy = {'numpy', 'pandas', 'pyarrow', 'numba', 'scipy', 'matplotlib', 'pydantic', 'yaml', 'rich'}\n"
            "inside = {name for name in sys.modules if name.startswith('pipeline.')} - {'pipeline.cli'}\n"
            "print(sorted(heavy & set(sys.modules) | inside))"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]"

    def test_version(self) -> None:
        assert seatrial("--version") == (0, f"seatrial {__version__}\n", "")


class TestWrongUsageIsTwo:
    @pytest.mark.parametrize(
        "arguments",
        [
            ("fly",),
            ("run", "--depth", "3"),
            ("run", "--jobs", "0"),
            ("run", "--engine", "magic"),
            ("steady",),
            ("trim", "--net-buoyancy", "2.5"),
            ("trim", "--net-buoyancy", "2.5", "--pitch", "20", "--battery", "0.01"),
            ("trim", "--net-buoyancy", "2.5", "--pitch", "200"),
            ("steady", "--net-buoyancy", "7", "--thrust", "7", "--rpm", "1400"),
        ],
    )
    def test_unknown_or_impossible_arguments(self, arguments: tuple[str, ...]) -> None:
        code, out, error = seatrial(*arguments)
        assert code == 2
        assert out == ""
        assert "Error: " in error

    @pytest.mark.parametrize("command", ["run", "check"])
    def test_a_folder_that_is_not_there(self, tmp_path: Path, command: str) -> None:
        line = "raw: found no such folder; expected a folder of missions\n"
        assert seatrial(command, cwd=tmp_path) == (2, "", line)

    @pytest.mark.parametrize("command", ["run", "check"])
    def test_a_file_in_place_of_the_folder(self, tmp_path: Path, command: str) -> None:
        (tmp_path / "log.csv").touch()
        line = "log.csv: found a file; expected a folder of missions\n"
        assert seatrial(command, "log.csv", cwd=tmp_path) == (2, "", line)

    @pytest.mark.parametrize("command", ["run", "check"])
    def test_an_empty_folder(self, tmp_path: Path, command: str) -> None:
        (tmp_path / "raw").mkdir()
        line = (
            "raw: found no mission; expected folders of logs, each with a mission.yaml; "
            "the smallest useful mission.yaml is 'vehicle: slocum-g2'\n"
        )
        assert seatrial(command, cwd=tmp_path) == (2, "", line)

    def test_a_folder_of_logs_without_mission_yaml(self, tmp_path: Path) -> None:
        (mission(tmp_path / "raw" / "a") / "mission.yaml").unlink()
        line = (
            "raw: found no mission.yaml in raw/a; expected folders of logs, each with a mission.yaml; "
            "the smallest useful mission.yaml is 'vehicle: slocum-g2'\n"
        )
        assert seatrial("run", cwd=tmp_path) == (2, "", line)

    @pytest.mark.parametrize("option", ["processed", "reports"])
    def test_an_output_folder_that_cannot_be_written(self, tmp_path: Path, option: str) -> None:
        mission(tmp_path / "raw" / "a")
        (tmp_path / "taken").touch()
        line = (
            "taken: found a folder that cannot be written (File exists); expected one that can; "
            "choose another with --processed and --reports\n"
        )
        assert seatrial("run", f"--{option}", "taken", cwd=tmp_path) == (2, "", line)

    def test_a_stage_of_what_is_no_mission(self, tmp_path: Path) -> None:
        line = "nowhere: found no mission.yaml; expected the folder of one mission\n"
        assert seatrial("ingest", "nowhere", cwd=tmp_path) == (2, "", line)

    def test_a_stage_of_a_folder_of_missions(self, tmp_path: Path) -> None:
        mission(tmp_path / "raw" / "a")
        line = (
            "raw: found no mission.yaml; expected the folder of one mission; "
            "'seatrial run raw' does every stage of all missions in it\n"
        )
        assert seatrial("ingest", "raw", cwd=tmp_path) == (2, "", line)

    def test_a_scheduler_without_dask(self, tmp_path: Path) -> None:
        mission(tmp_path / "raw" / "a")
        code, _, error = seatrial("run", "--scheduler", "tcp://127.0.0.1:1", cwd=tmp_path)
        assert code == 2
        assert error in (
            "--scheduler: found no dask.distributed; expected the extra 'cluster'; pip install 'seatrial[cluster]'\n",
            "--scheduler: found no answer from 'tcp://127.0.0.1:1'; expected a dask scheduler, as in tcp://host:8786\n",
        )

    def test_an_unknown_vehicle_names_the_nearest(self) -> None:
        line = "--vehicle: found 'petrel-i'; expected a known vehicle; did you mean 'petrel-ii'?\n"
        assert seatrial("steady", "--net-buoyancy", "7", "--vehicle", "petrel-i") == (2, "", line)
        assert seatrial("vehicles", "petrel-i") == (2, "", line.replace("--vehicle", "seatrial vehicles"))

    def test_without_moments_steady_asks_for_an_angle_of_attack(self) -> None:
        code, out, err = seatrial("steady", "--net-buoyancy", "-2", "--vehicle", "slocum-g2")
        assert (code, out) == (2, "")
        assert "'slocum-g2' has no pitching moments, so no α_e = -K_M0/K_M; give --alpha" in " ".join(err.split())

    @pytest.mark.parametrize(
        ("command", "option", "value", "line"),
        [
            ("steady", "--density", "1.025", "density: found 1.025; expected 950 to 1150 kg/m3, in situ"),
            ("steady", "--rpm", "-3", "rpm: found -3; expected 0 to 10000 rev/min"),
            ("steady", "--thrust", "nan", "thrust: found nan; expected 0 to 10000 N"),
            ("steady", "--net-buoyancy", "nan", "net buoyancy: found nan; expected -10000 to 10000 N"),
            ("steady", "--alpha", "95", "alpha: found 95; expected -28.6 to 28.6 degrees"),
            ("trim", "--pitch", "100", "pitch: found 100; expected -90 to 90 degrees"),
            ("trim", "--battery", "-40", "battery position: found -40; expected -1 to 1 m"),
        ],
    )
    def test_what_no_glider_can_have_is_refused_in_the_unit_it_was_typed_in(
        self, command: str, option: str, value: str, line: str
    ) -> None:
        code, out, error = seatrial(command, "--net-buoyancy", "2", option, value)
        assert (code, out) == (2, "")
        assert line in " ".join(error.split())

    def test_an_unknown_trial_names_the_nearest(self, tmp_path: Path) -> None:
        code, _, error = seatrial("simulate", "petrel2-scs-2016", str(tmp_path / "out"))
        assert code == 2
        assert "did you mean 'petrel2-scs-201" in error

    def test_an_unknown_data_set_names_the_nearest(self, tmp_path: Path) -> None:
        line = "fetch: found 'comet2017'; expected a known data set; did you mean 'comet2016'?\n"
        assert seatrial("fetch", "comet2017", cwd=tmp_path) == (2, "", line)


class TestFailedMissionsAreOne:
    def test_a_misspelt_key_costs_its_mission_and_the_line_stands_on_the_index(self, tmp_path: Path) -> None:
        mission(tmp_path / "raw" / "a", "vehicle: petrel-ii\nbalast: {std: 1.0}\n")
        code, out, error = seatrial("run", cwd=tmp_path)
        assert code == 1
        assert error == "a: failed: a/mission.yaml: balast: found an unknown key; did you mean 'ballast'?\n"
        assert out == "0 done, 1 failed: reports/index.html\n"
        assert "did you mean" in (tmp_path / "reports" / "index.html").read_text()

    def test_two_missions_of_one_name_name_both_folders(self, tmp_path: Path) -> None:
        for name in ("a", "b"):
            mission(tmp_path / "raw" / name, "vehicle: petrel-ii\nname: trial\n")
        line = (
            "trial: failed: mission.yaml: name: found 'trial' in raw/a and raw/b; "
            "expected one name per mission; set another 'name' in one of them\n"
        )
        code, _, error = seatrial("run", cwd=tmp_path)
        assert (code, error) == (1, line * 2)

    def test_a_log_that_lacks_what_is_needed(self, tmp_path: Path) -> None:
        mission(tmp_path / "raw" / "a")
        code, _, error = seatrial("run", cwd=tmp_path)
        assert code == 1
        assert error.startswith("a: failed: ")
        assert "pitch" in error
        assert error.count("\n") == 1
        summary = json.loads((tmp_path / "reports" / "a" / "summary.json").read_text())
        assert summary == {"mission": "a", "error": error.removeprefix("a: failed: ").strip()}

    def test_check_says_so_beforehand_and_writes_nothing(self, tmp_path: Path) -> None:
        mission(tmp_path / "raw" / "a")
        code, out, _ = seatrial("check", cwd=tmp_path)
        assert code == 1
        assert out.startswith("a: would fail: ")
        assert sorted(path.name for path in tmp_path.iterdir()) == ["raw"]

    def test_a_stage_whose_predecessor_was_not_run(self, tmp_path: Path) -> None:
        mission(tmp_path / "raw" / "a")
        line = (
            "a: failed: processed/a/records.parquet: found no such file; expected the result of stage 'ingest'; "
            "run 'seatrial ingest raw/a' first\n"
        )
        assert seatrial("model", "raw/a", cwd=tmp_path) == (1, "", line)


class TestTables:
    def rows(self, *arguments: str) -> list[dict[str, Any]]:
        code, out, _ = seatrial(*arguments, "--json")
        assert code == 0
        rows: list[dict[str, Any]] = json.loads(out)
        return rows

    def test_steady_repeats_the_paper(self) -> None:
        """Niu et al. 2017, Section 4: V_e 1.3694, from 0.9754 to 1.3968 (computed 1.3967) m/s at T = G = 7 N."""
        row = self.rows("steady", "--net-buoyancy", "7", "--thrust", "7", "--signs", "paper")[0]
        assert row["V m/s"] == pytest.approx(1.36941, abs=5e-6)
        assert row["stable from m/s"] == pytest.approx(0.97538, abs=5e-6)
        assert row["to m/s"] == pytest.approx(1.39672, abs=5e-6)
        assert row["stable"] is True

    def test_trim_at_the_measured_pitch_closes_the_gap_at_danjiangkou(self) -> None:
        """Niu et al. 2017, Section 5: measured 0.62 m/s at 3.5 degrees and 780 rpm, theory with free pitch 0.789."""
        held = self.rows("trim", "--net-buoyancy", "2.5", "--pitch", "3.5", "--rpm", "780")[0]
        free = self.rows("steady", "--net-buoyancy", "2.5", "--rpm", "780")[0]
        assert held["V m/s"] == pytest.approx(0.615, abs=5e-4)
        assert free["V m/s"] == pytest.approx(0.789, abs=5e-4)

    def test_every_pair_of_inputs_has_a_row_and_a_reason_where_there_is_no_flight(self) -> None:
        rows = self.rows("trim", "--net-buoyancy", "-2", "--net-buoyancy", "2", "--pitch", "-25", "--pitch", "-35")
        assert [row["G N"] for row in rows] == [-2.0, -2.0, 2.0, 2.0]
        assert [row["V m/s"] is None for row in rows] == [bool(row["reason"]) for row in rows]
        assert [bool(row["reason"]) for row in rows] == [False, False, True, True]

    def test_a_battery_position_trims_too(self) -> None:
        rows = self.rows("trim", "--net-buoyancy", "-5", "--battery", "0.02", "--battery", "0.03")
        assert rows[1]["pitch deg"] < rows[0]["pitch deg"] < 0

    def test_tables_for_people_are_aligned(self) -> None:
        code, out, _ = seatrial("trim", "--net-buoyancy", "2.5", "--pitch", "3.5", "--rpm", "780")
        head, row = out.splitlines()
        assert code == 0
        assert head.index("V m/s") == row.index("0.614893")

    def test_vehicles_have_a_source_for_every_coefficient(self) -> None:
        for vehicle in self.rows("vehicles"):
            assert all(value["source"] for value in vehicle["coefficients"].values()), vehicle["name"]
        code, out, _ = seatrial("vehicles", "petrel-ii")
        assert code == 0
        row = next(line for line in out.splitlines() if line.startswith("parasite_drag "))
        assert row.split()[1:5] == ["K_D0", "7.3579", "0.736", "kg/m"]

    def test_fetch_without_a_name_lists_the_data_sets(self) -> None:
        assert {row["name"] for row in self.rows("fetch")} >= {"comet2016", "sg171-ekamsat2024"}

    def test_check_prints_json(self) -> None:
        raw = str(Path(__file__).parents[1] / "raw")
        rows = self.rows("check", raw)
        assert [row["mission"] for row in rows] == sorted(row["mission"] for row in rows)
        for row in rows:
            assert row["error"] == ""
            assert row["format"] == "table"
            assert {item["name"] for item in row["instruments"]} >= {"pressure", "pitch", "conductivity"}
            assert list(row["missing"]) == ["speed_through_water"]


def test_an_error_nobody_foresaw_is_one_line(tmp_path: Path) -> None:
    mission(tmp_path / "raw" / "a")
    code = (
        "import sys; from pipeline import cli, index\n"
        "def write(*folders): raise ZeroDivisionError('division\\nby zero')\n"
        "index.write = write; sys.argv = ['seatrial', 'run']; cli.main()"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    line = done.stderr.splitlines()[-1]
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert line.startswith("seatrial: line ")
    assert line.endswith(
        "of pipeline/cli.py: found ZeroDivisionError: division by zero; expected no such error; please report it"
    )


def test_ctrl_c_is_one_line_and_ends_the_run(tmp_path: Path) -> None:
    raw = str(Path(__file__).parents[1] / "raw")
    with subprocess.Popen([SEATRIAL, "run", raw], cwd=tmp_path, text=True, stderr=subprocess.PIPE) as process:
        patience = time.monotonic() + 60
        while not list(tmp_path.rglob("records.parquet")) and time.monotonic() < patience:
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
    assert error == "interrupted; what is finished is kept, and the next run goes on from there\n"
    assert process.returncode == 130

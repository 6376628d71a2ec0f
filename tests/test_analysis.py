"""A mission in a notebook: the example of the manual runs, and gives what the command gives."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pipeline
from pipeline import campaign, store
from pipeline.findings import InputError
from pipeline.roster import STAGES, plan

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Lay the beginning of a trial in raw/ into a folder of its own."""
    root = tmp_path_factory.mktemp("notebook")
    source, folder = ROOT / "raw" / "petrel2-scs-2015", root / "raw" / "my-mission"
    folder.mkdir(parents=True)
    shutil.copy(source / "mission.yaml", folder)
    for log in sorted(source.glob("*.csv")):
        (folder / log.name).write_text("".join(log.read_text().splitlines(keepends=True)[:1500]))
    return root


@pytest.fixture(scope="module")
def trial(place: Path) -> pipeline.Trial:
    return pipeline.analyse(place / "raw" / "my-mission", threads=1)


def test_the_examples_of_the_manual_run_and_write_what_they_say_and_no_more(
    place: Path, trial: pipeline.Trial, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(place)
    monkeypatch.setattr(pipeline, "analyse", lambda folder: trial if Path(folder).is_dir() else None, raising=False)
    before = {path for path in place.rglob("*") if path.is_file()}
    names: dict[str, object] = {}
    for example in re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "notebook.md").read_text(), flags=re.DOTALL):
        exec(compile(example, "notebook.md", "exec"), names)
    assert names["trial"] is trial
    assert {path for path in place.rglob("*") if path.is_file()} - before == {place / "my-mission.html"}
    assert (place / "my-mission.html").read_text() == trial.report().text
    (place / "my-mission.html").unlink()


def test_it_gives_what_the_stages_give_one_by_one_through_files(
    place: Path, trial: pipeline.Trial, tmp_path: Path
) -> None:
    job = plan(place / "raw", tmp_path / "processed", tmp_path / "reports").jobs[0]
    for stage in STAGES:
        assert campaign.run_stage(job, stage).error == ""
    assert store.plain(trial.summary) == store.read_json(job.path("summary.json"))
    assert trial.report().text == job.path("report.html").read_text()


def test_a_notebook_shows_the_answer_and_the_key_numbers(trial: pipeline.Trial) -> None:
    shown = trial._repr_html_()
    assert trial.summary["answer"]["sentence"] in shown
    assert shown.count("<tr>") == len(trial.summary["key_numbers"])
    assert f"<td>{trial.summary['data']['dives']}</td>" in shown
    assert "nan" not in shown
    assert repr(trial) == f"my-mission: {trial.summary['answer']['sentence']}"
    framed = trial.report()._repr_html_()
    assert framed.startswith('<iframe srcdoc="&lt;!DOCTYPE html&gt;')
    assert framed.count('"') == 10


def test_a_mission_that_cannot_be_analysed_raises_its_line(tmp_path: Path) -> None:
    (tmp_path / "mission.yaml").write_text("vehicle: petrel-ii\n")
    with pytest.raises(InputError, match="found an empty folder; expected plain tables"):
        pipeline.analyse(tmp_path)


def test_importing_the_package_imports_no_stage() -> None:
    code = "import sys, pipeline; print(sorted({'numpy', 'pipeline.analysis'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'pipeline' has no attribute 'analyze'"):
        pipeline.analyze  # noqa: B018

"""The benchmarks run: the short ones to their end at their smallest, all others as far as their imports."""

import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODULES = sorted(path.stem for path in (ROOT / "benchmarks").glob("*.py") if path.stem != "__init__")
README = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")


def printed(*words: str) -> str:
    """Return what a benchmark prints; a verdict of FAIL ends it with 1, which at its smallest says nothing."""
    done = subprocess.run(
        [sys.executable, str(ROOT / "benchmarks" / words[0]), *words[1:]],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "Traceback" not in done.stderr
    assert done.returncode in (0, 1), done.stderr
    return done.stdout


@pytest.mark.parametrize("name", MODULES)
def test_a_benchmark_can_be_imported(name: str) -> None:
    assert import_module(f"benchmarks.{name}").__doc__


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("stability.py",), "driven, propeller speed held: eigenvalues"),
        (("coverage.py", "1", "5", "--no-trials"), "kinematic"),
        (("recovery.py", "1"), "a cause named where nothing is wrong"),
        (("carried.py", "1"), "carried"),
    ],
    ids=lambda words: words[0] if isinstance(words, tuple) else "",
)
def test_a_benchmark_runs_to_its_end(words: tuple[str, ...], line: str) -> None:
    assert line in printed(*words)


def test_every_command_is_in_the_readme() -> None:
    commands = {path.name for path in (ROOT / "benchmarks").glob("*.py") if "def main(" in path.read_text("utf-8")}
    assert {name for name in commands if f"benchmarks/{name}" not in README} == set()

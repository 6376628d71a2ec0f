"""Compiled kernels are those of the sources as they are, wherever they may be kept."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

import pipeline

PROGRAM = "from pipeline.model.closure import glide_angle; from pipeline.vehicle import Polar; " + (
    "from pipeline.model.forces import drag; from pipeline.model.dynamics import derivatives, Body; "
    "from pipeline.vehicle import Propeller; "
    "print(derivatives(1.0, 0.3, 0.0, 0.0, Body(84.7, 84.7, 12.3, 0.0, -300.0, -7.0), "
    "Polar(0.0, 350.0, 7.0, 300.0, 0.0), Propeller(0.0, 0.0, 0.0), 1.0, 1020.0, 7.0, 0.0, 0.0, 0.0)[0])"
)


FOLDER = "import os, pathlib, pipeline; folder = pathlib.Path(os.environ['NUMBA_CACHE_DIR']); "
HELD = FOLDER + PROGRAM + "; print(folder, any(folder.rglob('*.nbc')))"


def test_a_changed_kernel_changes_those_that_call_it(tmp_path: Path) -> None:
    package = tmp_path / "pipeline"
    shutil.copytree(Path(pipeline.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}

    def deceleration() -> float:
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        return float(done.stdout)

    before = deceleration()
    forces = package / "model" / "forces.py"
    text = forces.read_text(encoding="utf-8")
    line = "return polar.parasite_drag * parasite"
    assert line in text
    forces.write_text(text.replace(line, "return 2.0 * polar.parasite_drag * parasite"), encoding="utf-8")
    assert deceleration() < before - 0.05


@pytest.mark.parametrize("home", [True, False])
def test_kernels_are_kept_elsewhere_where_the_package_cannot_be_written(tmp_path: Path, home: bool) -> None:
    package, cache, scratch = tmp_path / "pipeline", tmp_path / "cache", tmp_path / "scratch"
    shutil.copytree(Path(pipeline.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    scratch.mkdir()
    for path in [package / "__pycache__", package / "model" / "__pycache__"] + [cache] * (not home):
        path.touch()  # no folder can be made where a file lies, whoever tries
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    environment |= {"XDG_CACHE_HOME": str(cache), "TMPDIR": str(scratch)}
    done = subprocess.run(
        [sys.executable, "-c", HELD], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    folder, kept = done.stdout.splitlines()[-1].rsplit(" ", 1)
    assert kept == "True"
    assert Path(folder).is_relative_to(cache / "seatrial" if home else scratch)
    assert Path(folder).exists() is home


def test_kernels_of_sources_that_are_no_more_go_after_a_week(tmp_path: Path) -> None:
    package = tmp_path / "pipeline"
    shutil.copytree(Path(pipeline.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    kept = package / "__pycache__"
    for days, name in ((8.0, "kernels-old"), (6.0, "kernels-recent")):
        (kept / name / "model").mkdir(parents=True)
        then = time.time() - 86400.0 * days
        os.utime(kept / name, (then, then))
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    subprocess.run([sys.executable, "-c", "import pipeline"], cwd=tmp_path, env=environment, check=True)
    names = sorted(path.name for path in kept.glob("kernels-*"))
    assert len(names) == 2
    assert "kernels-recent" in names
    assert "kernels-old" not in names

"""Compiled kernels are those of the sources as they are."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pipeline

PROGRAM = "from pipeline.model.closure import glide_angle; from pipeline.vehicle import Polar; " + (
    "from pipeline.model.forces import drag; from pipeline.model.dynamics import derivatives, Body; "
    "from pipeline.vehicle import Propeller; "
    "print(derivatives(1.0, 0.3, 0.0, 0.0, Body(84.7, 84.7, 12.3, 0.0, -300.0, -7.0), "
    "Polar(0.0, 350.0, 7.0, 300.0, 0.0), Propeller(0.0, 0.0, 0.0), 1.0, 1020.0, 7.0, 0.0, 0.0, 0.0)[0])"
)


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

"""Logs as bad as they come through the whole command: analysed, or one line; no traceback, no warning."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline import mission, vehicle
from pipeline.estimate.stage import estimate
from pipeline.ingest import ingest

SEATRIAL = str(Path(sys.executable).with_name("seatrial"))
BARE = Path(__file__).with_name("bare.yaml")
FILES = ("ctd.csv", "attitude.csv", "engine.csv")
MISSION = """vehicle: {}
latitude: 18.0
longitude: 112.5
files:
  engine.csv:
    columns:
      buoyancy_volume: {{column: volume, unit: cm3}}
"""


def _good(folder: Path) -> None:
    """Write a yo to 60 m in plain tables, every 4 s."""
    folder.mkdir(parents=True)
    (folder / "mission.yaml").write_text(MISSION.format("petrel-ii"), encoding="utf-8")
    time = np.arange(0.0, 840.0, 4.0)
    depth = np.interp(time, [0.0, 400.0, 800.0, 840.0], [0.2, 60.0, 0.2, 0.2])
    pitch = np.interp(time, [0.0, 390.0, 410.0, 790.0, 800.0], [-25.0, -25.0, 25.0, 25.0, 0.0])
    stamps = pd.Timestamp("2015-02-11T03:00:00Z") + pd.to_timedelta(time, unit="s")
    written = stamps.strftime("%Y-%m-%dT%H:%M:%SZ")
    water = {"temperature [degC]": 20.0 - 0.05 * depth, "conductivity [S/m]": 4.8 - 0.005 * depth}
    pd.DataFrame({"time": written, "pressure [dbar]": depth, **water}).to_csv(folder / "ctd.csv", index=False)
    pd.DataFrame({"time": written, "pitch [deg]": pitch}).to_csv(folder / "attitude.csv", index=False)
    engine = np.where(time < 400.0, -250.0, 250.0)
    pd.DataFrame({"time": written, "volume": engine}).to_csv(folder / "engine.csv", index=False)


Spoil = Callable[[Path], None]


def _each(change: Callable[[pd.DataFrame], pd.DataFrame], files: tuple[str, ...] = FILES) -> Spoil:
    def spoil(folder: Path) -> None:
        for file in files:
            change(pd.read_csv(folder / file)).to_csv(folder / file, index=False)

    return spoil


def _bare(folder: Path) -> None:
    """Let a vehicle have flown whose lift and drag nobody knows."""
    shutil.copyfile(BARE, folder / BARE.name)
    (folder / "mission.yaml").write_text(MISSION.format(BARE.name), encoding="utf-8")


def _jumped(by_s: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        time = pd.to_datetime(table["time"])
        time = time.where(np.arange(len(table)) < 105, time + pd.Timedelta(seconds=by_s))
        return table.assign(time=time.dt.strftime("%Y-%m-%dT%H:%M:%SZ"))

    return change


def _spiked(table: pd.DataFrame) -> pd.DataFrame:
    spike = np.where(np.arange(len(table)) % 50 == 17, 100.0, 0.0)
    return table.assign(**{"pressure [dbar]": table["pressure [dbar]"] + spike})


def _stuck(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(**{"pitch [deg]": table["pitch [deg]"].where(np.arange(len(table)) < 60, -25.0)})


def _without_engine(folder: Path) -> None:
    (folder / "engine.csv").unlink()
    (folder / "mission.yaml").write_text("vehicle: petrel-ii\nlatitude: 18.0\n", encoding="utf-8")


RNG = np.random.default_rng(0)
#: How a good mission is damaged, and why it then has no force estimate, where it has none.
DAMAGED: dict[str, tuple[Spoil, str]] = {
    "good": (lambda folder: None, ""),
    "dropouts": (_each(lambda table: table[RNG.random(len(table)) > 0.4]), ""),
    "hours-apart": (_each(_jumped(5 * 3600.0)), ""),
    "clock-back": (_each(_jumped(-200.0)), ""),
    "twice": (_each(lambda table: table.assign(time=table["time"].where(table.index % 7 != 3, table["time"].shift(1)))),
              ""),
    "swapped": (_each(lambda table: table.iloc[[*range(60), 61, 60, *range(62, len(table))]]), ""),
    "spikes": (_each(_spiked, ("ctd.csv",)), ""),
    "stuck-pitch": (_each(_stuck, ("attitude.csv",)), ""),
    "one-dive": (_each(lambda table: table.iloc[:100]), ""),
    "one-sample": (_each(lambda table: table.iloc[50:51]), ""),
    "engine-reversed": (_each(lambda table: table.assign(volume=-table["volume"]), ("engine.csv",)),
                        "no buoyancy engine volume: no net buoyancy"),
    "no-engine": (_without_engine, "no buoyancy engine volume: no net buoyancy"),
    "no-salt": (_each(lambda table: table[["time", "pressure [dbar]"]], ("ctd.csv",)),
                "no mass or no density: no net buoyancy"),
    # Steep all the while: the sensor is dead, not the vehicle at rest.
    "constant-depth": (_each(lambda table: table.assign(**{"pressure [dbar]": 30.0}), ("ctd.csv",)),
                       "no mass or no density: no net buoyancy"),
    "surface": (_each(lambda table: table.assign(**{"pressure [dbar]": 0.2}), ("ctd.csv",)), ""),
    "unknown-lift": (_bare, "lift and drag of the vehicle are not known"),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED)
def test_numbers_are_finite_where_observable_and_nan_with_a_reason_elsewhere(tmp_path: Path, name: str) -> None:
    spoil, reason = DAMAGED[name]
    folder = tmp_path / name
    _good(folder)
    spoil(folder)
    settings = mission.load(folder)
    found = estimate(ingest(settings).records, vehicle.load(settings.vehicle, folder), settings)
    table = found.estimates
    seen = table["observable"].to_numpy()
    hidden = table[["speed", "speed_std", "angle_of_attack", "path_angle", "vertical_water_velocity"]]
    assert np.isfinite(hidden[seen]).all(axis=None)
    assert hidden[~seen].isna().all(axis=None)
    assert (table.loc[~seen, "reason"] != "").all()
    assert found.report["force"]["reason"] == reason
    assert set(table["method"]) == ({"kinematic"} if reason else {"kinematic", "force"})
    for method, rows in table.groupby("method"):
        assert rows["time"].is_monotonic_increasing, method
        assert rows["time"].is_unique, method
    if name == "good":
        assert seen.mean() > 0.6
    if name in ("one-sample", "surface", "unknown-lift"):
        assert not seen.any()


def test_a_value_that_is_flagged_bad_and_not_used_changes_nothing(tmp_path: Path) -> None:
    estimates = {}
    for name in ("lost", "absurd"):
        folder = tmp_path / name
        _good(folder)
        table = pd.read_csv(folder / "engine.csv").astype({"volume": float})
        table.loc[50, "volume"] = np.nan if name == "lost" else 5e4
        table.to_csv(folder / "engine.csv", index=False)
        settings = mission.load(folder)
        estimates[name] = estimate(ingest(settings).records, vehicle.load(settings.vehicle), settings).estimates
    pd.testing.assert_frame_equal(estimates["lost"], estimates["absurd"])


def test_the_command_analyses_them_to_the_end_and_says_nothing_else(tmp_path: Path) -> None:
    for name in ("no-engine", "one-sample", "spikes"):
        _good(tmp_path / "raw" / name)
        DAMAGED[name][0](tmp_path / "raw" / name)
    done = subprocess.run(
        [SEATRIAL, "run", "--jobs", "1"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONWARNINGS": "error"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    assert done.returncode == 0
    assert done.stdout.splitlines()[-1] == "3 done, 0 failed: reports/index.html"
    told = json.loads((tmp_path / "processed" / "no-engine" / "estimate.json").read_text(encoding="utf-8"))
    assert told["force"]["reason"] == "no buoyancy engine volume: no net buoyancy"
    assert all((tmp_path / "reports" / name / "report.html").is_file() for name in ("no-engine", "one-sample"))

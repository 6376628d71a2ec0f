"""Bad input beside good, through the command: one line for each bad mission, no traceback, the good one analysed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

SEATRIAL = str(Path(sys.executable).with_name("seatrial"))


def _good(folder: Path) -> None:
    """Write two yos to 60 m in plain tables."""
    folder.mkdir(parents=True)
    (folder / "mission.yaml").write_text("vehicle: petrel-ii\nlatitude: 18.0\nlongitude: 112.5\n", encoding="utf-8")
    time = np.arange(0.0, 1640.0, 2.0)
    turns = np.array([0.0, 400.0, 800.0, 1200.0, 1600.0, 1640.0])
    depth = np.interp(time, turns, [0.2, 60.0, 2.0, 60.0, 0.2, 0.2])
    pitch = np.interp(time % 800.0, [0.0, 390.0, 410.0, 790.0, 800.0], [-25.0, -25.0, 25.0, 25.0, 0.0])
    stamps = pd.Timestamp("2015-02-11T03:00:00Z") + pd.to_timedelta(time, unit="s")
    written = stamps.strftime("%Y-%m-%dT%H:%M:%SZ")
    water = {"temperature [degC]": 20.0 - 0.05 * depth, "conductivity [S/m]": 4.8 - 0.005 * depth}
    pd.DataFrame({"time": written, "pressure [dbar]": depth, **water}).to_csv(folder / "ctd.csv", index=False)
    pd.DataFrame({"time": written, "pitch [deg]": pitch}).to_csv(folder / "attitude.csv", index=False)


def _edit(file: str, change: Callable[[pd.DataFrame], pd.DataFrame]) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        change(pd.read_csv(folder / file)).to_csv(folder / file, index=False)

    return spoil


def _write(file: str, content: bytes) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        (folder / file).write_bytes(content)

    return spoil


def _slocum(content: bytes) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        shutil.rmtree(folder)
        folder.mkdir()
        (folder / "mission.yaml").write_text("vehicle: slocum-g2\n", encoding="utf-8")
        (folder / "a.dbd").write_bytes(content)

    return spoil


def _seaglider(content: bytes) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        shutil.rmtree(folder)
        folder.mkdir()
        (folder / "mission.yaml").write_text("vehicle: seaglider\n", encoding="utf-8")
        (folder / "p1710100.nc").write_bytes(content)

    return spoil


def _emptied(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.mkdir()


NO_PRESSURE = "mission: found no pressure in attitude.csv; expected a pressure column; "
#: How a good mission is spoilt, and the line that it then gets.
SPOILT: dict[str, tuple[Callable[[Path], None], str]] = {
    "empty": (_emptied, "raw/empty: found an empty folder; expected logs and a mission.yaml; "
              "put them there, or remove the folder"),
    "misspelt": (_write("mission.yaml", b"vehicle: petrel-ii\nlatitud: 18.0\n"),
                 "misspelt/mission.yaml: latitud: found an unknown key; did you mean 'latitude'?"),
    "no-pitch": (lambda folder: (folder / "attitude.csv").unlink(),
                 "mission: found no pitch in ctd.csv; expected a pitch column; "
                 "name it under files: … in mission.yaml"),
    "nan-pitch": (_edit("attitude.csv", lambda table: table.assign(**{"pitch [deg]": np.nan})),
                  "attitude.csv: column 'pitch [deg]': found no pitch in 820 records, only NaN; "
                  "expected a pitch sensor that reports; the mission cannot be analysed without it"),
    "degrees-as-radians": (_edit("attitude.csv", lambda table: table.rename(columns={"pitch [deg]": "pitch [rad]"})),
                           "attitude.csv: column 'pitch [rad]': found pitch from -25 to 25 rad; "
                           "expected -1.571 to 1.571 rad; correct its unit under files: in mission.yaml"),
    "bar-as-dbar": (_edit("ctd.csv", lambda table: table.assign(**{"pressure [dbar]": table["pressure [dbar]"] / 10})),
                    "ctd.csv: column 'pressure [dbar]': found depth changing by 0.015 m/s at 25° of pitch, "
                    "a speed of 0.035 m/s; expected 0.12 to 2.2 m/s through the water; "
                    "is the unit of pressure bar? correct it under files: in mission.yaml"),
    "dbar-as-bar": (_edit("ctd.csv", lambda table: table.rename(columns={"pressure [dbar]": "pressure [bar]"})),
                    "ctd.csv: column 'pressure [bar]': found depth changing by 1.5 m/s at 25° of pitch, "
                    "a speed of 3.5 m/s; expected 0.12 to 2.2 m/s through the water; "
                    "is the unit of pressure dbar? correct it under files: in mission.yaml"),
    "absurd-times": (_edit("ctd.csv", lambda table: table.assign(time=1e103)),
                     NO_PRESSURE + "ctd.csv: record 1: found an absurd time (1e+103), and 820 of 820 records like it; "
                     "expected a time from 1990 to 2100; left out"),
    "no-table": (_write("ctd.csv", b"\x00\x01\x02"),
                 NO_PRESSURE + "ctd.csv: found no text; expected a header line and records; "
                 "file left out; write it as CSV"),
    "empty-dbd": (_slocum(b""), "empty-dbd: found 1 Slocum file, none of them readable; "
                  "a.dbd: found an empty file; expected Slocum data; left out; copy the file again"),
    "no-dbd": (_slocum(b"hello\n"), "no-dbd: found 1 Slocum file, none of them readable; a.dbd: found no Slocum "
               "header; expected a file that begins with 'dbd_label'; left out; copy the file again"),
    "no-netcdf": (_seaglider(b"hello"), "no-netcdf: found 1 Seaglider file, none of them readable; p1710100.nc: found "
                  "no netCDF header; expected netCDF, classic or 4; left out; copy the file again"),
}  # fmt: skip


def _needs(name: str) -> bool:
    from importlib.util import find_spec

    return find_spec("dbdreader" if name.endswith("-dbd") else "h5netcdf" if "netcdf" in name else "numpy") is not None


@pytest.fixture(scope="module")
def ended(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """Return the folder of a run over all of them and a good mission, and how it ended."""
    place = tmp_path_factory.mktemp("bad")
    for name in ("good", *filter(_needs, SPOILT)):
        _good(place / "raw" / name)
        if name in SPOILT:
            SPOILT[name][0](place / "raw" / name)
    done = subprocess.run([SEATRIAL, "run", "--jobs", "1"], cwd=place, capture_output=True, text=True, check=False)
    return place, done


def test_every_bad_mission_gets_its_line_and_nothing_else_is_said(
    ended: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    lines = [f"{name}: failed: {SPOILT[name][1]}" for name in SPOILT if _needs(name)]
    assert sorted(ended[1].stderr.splitlines()) == sorted(lines)


def test_the_good_mission_is_analysed_and_the_code_says_that_some_failed(
    ended: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    place, done = ended
    bad = sum(map(_needs, SPOILT))
    assert done.returncode == 1
    assert done.stdout.splitlines() == [
        "good: ingest, estimate, model, report",
        f"1 done, {bad} failed: reports/index.html",
    ]
    assert (place / "reports" / "good" / "report.html").is_file()
    index = (place / "reports" / "index.html").read_text(encoding="utf-8")
    assert all(f"{name}" in index for name in SPOILT if _needs(name))

"""Stage 1 as a whole: which files, which format, which records, and what bad input gets."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline import ingest
from pipeline.findings import InputError
from pipeline.ingest.logs import of_one
from pipeline.mission import Mission, Table, load
from pipeline.records import RECORDS, Phase, Quality, seconds

Fly = Callable[..., object]
Write = Callable[..., Mission]


def test_plain_tables_become_the_canonical_records(mission: Mission) -> None:
    got = ingest.ingest(mission)
    assert got.format == "table"
    assert list(got.records.columns) == [column.name for column in RECORDS]
    assert got.records["time"].is_monotonic_increasing
    assert got.records["time"].is_unique
    assert got.records["dive"].max() == 4
    assert got.records["block"].max() + 1 >= 8
    assert got.constants == {}
    assert got.stored is None


def test_every_measurement_stands_in_the_records_at_its_instant_as_logged(mission: Mission) -> None:
    records = ingest.ingest(mission).records
    ctd = pd.read_csv(mission.folder / "ctd.csv")
    attitude = pd.read_csv(mission.folder / "attitude.csv")
    time = pd.Series(seconds(records["time"]))
    for table, column, name, factor in (
        (ctd, "pressure (dbar)", "pressure", 1.0),
        (ctd, "temperature (degC)", "temperature", 1.0),
        (attitude, "pitch (deg)", "pitch", np.pi / 180),
        (attitude, "oil_volume (cm3)", "buoyancy_volume", 1e-6),
    ):
        there = records[name].notna()
        np.testing.assert_allclose(time[there], table["time"], rtol=0, atol=1e-6)
        np.testing.assert_allclose(records.loc[there, name], table[column] * factor, rtol=1e-14)
        assert (records.loc[there, f"{name}_qc"] == Quality.GOOD).all()
        assert (records.loc[~there, f"{name}_qc"] == Quality.MISSING).all()


def test_depth_and_density_follow_teos_10(mission: Mission) -> None:
    records = ingest.ingest(mission).records.dropna(subset=["density"])
    assert len(records) == len(pd.read_csv(mission.folder / "ctd.csv"))
    np.testing.assert_allclose(records["salinity"], 35.0, rtol=1e-9)
    deepest = records.loc[records["depth"].idxmax()]
    assert deepest["depth"] == pytest.approx(80.0, abs=0.2)
    assert deepest["density"] == pytest.approx(1026.5, abs=0.1)  # SA 35.17 g/kg, 14.2 °C, 80.7 dbar


def test_the_findings_can_be_written_as_json(mission: Mission) -> None:
    findings = ingest.ingest(mission).findings
    assert json.loads(json.dumps([finding.as_dict() for finding in findings]))[0]["file"] == "attitude.csv"
    assert all(finding.severity == "note" for finding in findings)


def test_corrections_and_selections_of_mission_yaml_are_applied(fly: Fly, write_mission: Write, tmp_path: Path) -> None:
    yo = fly([0.0, *[80.0, 5.0] * 4, 0.0])
    plain = ingest.ingest(write_mission(tmp_path / "a", yo)).records
    yaml = "vehicle: petrel-ii\nlatitude: 54.75\npitch: {scale: 0.86, offset_rad: -0.004}\ndives: [2, 3]\n"
    got = ingest.ingest(write_mission(tmp_path / "b", yo, yaml))
    assert set(got.records["dive"]) == {2, 3}
    assert got.records["block"].min() == -1
    assert got.records.loc[got.records["block"] >= 0, "block"].min() == 0
    kept = plain[plain["dive"].isin([2, 3])]
    np.testing.assert_allclose(got.records["pitch"], 0.86 * kept["pitch"] - 0.004, rtol=1e-12)


def test_mission_yaml_comes_first_among_the_input_files_and_truth_is_none_of_them(mission: Mission) -> None:
    (mission.folder / "truth.parquet").write_bytes(b"")
    (mission.folder / "README.txt").write_text("about")
    assert [path.name for path in ingest.input_files(mission)] == ["mission.yaml", "attitude.csv", "ctd.csv"]


def test_a_vehicle_file_of_the_mission_is_an_input(mission: Mission) -> None:
    (mission.folder / "mine.yaml").write_text("name: mine\n")
    changed = mission.model_copy(update={"vehicle": "mine.yaml"})
    assert [path.name for path in ingest.input_files(changed)][:2] == ["mission.yaml", "mine.yaml"]


def test_files_named_by_a_pattern_are_inputs(mission: Mission) -> None:
    (mission.folder / "gli.1.gz").write_bytes(b"x")
    (mission.folder / "mission.yaml").write_text("vehicle: petrel-ii\nfiles: {'gli.*.gz': {}}\n")
    assert "gli.1.gz" in [path.name for path in ingest.input_files(load(mission.folder))]


def test_the_input_files_of_plain_tables_are_found_without_a_heavy_import(mission: Mission) -> None:
    code = (
        "import sys; from pathlib import Path; from pipeline import mission, ingest;"
        f"print(len(ingest.input_files(mission.load(Path({str(mission.folder)!r})))));"
        "print([name for name in ('pandas', 'numpy', 'gsw', 'xarray', 'scipy', 'numba') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[:2] == ["3", "[]"]


def _error(mission: Mission) -> str:
    with pytest.raises(InputError) as error:
        ingest.ingest(mission)
    return str(error.value)


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "trial"
    folder.mkdir()
    (folder / "mission.yaml").write_text("vehicle: petrel-ii\n")
    assert _error(load(folder)) == (
        "trial: found an empty folder; "
        "expected plain tables (.csv, .parquet), Slocum files (.dbd, .ebd …) or Seaglider files (p*.nc); "
        "put the logs beside mission.yaml"
    )


def test_a_folder_without_logs_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "trial"
    folder.mkdir()
    (folder / "mission.yaml").write_text("vehicle: petrel-ii\n")
    (folder / "photo.jpg").write_bytes(b"x")
    assert _error(load(folder)).startswith("trial: found no logs among photo.jpg; expected plain tables")


def test_several_formats_in_one_folder_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "trial"
    folder.mkdir()
    (folder / "mission.yaml").write_text("vehicle: petrel-ii\n")
    (folder / "p1710100.nc").write_bytes(b"")
    (folder / "unit-2016-174-05-000.dbd").write_bytes(b"")
    assert _error(load(folder)) == (
        "trial: found logs of several formats: slocum (unit-2016-174-05-000.dbd), seaglider (p1710100.nc); "
        "expected one format; set format: slocum or seaglider in mission.yaml"
    )


def test_a_table_beside_the_files_of_a_glider_counts_only_where_mission_yaml_names_it(mission: Mission) -> None:
    (mission.folder / "p1710100.nc").write_bytes(b"")
    assert ingest.recognise(mission) == "table"
    (mission.folder / "p1710100.nc").write_bytes(b"not empty, and not netCDF")
    assert ingest.recognise(mission) == "seaglider"
    with pytest.raises(InputError, match=r"to read the tables beside it \(attitude\.csv, ctd\.csv\), set"):
        ingest.ingest(mission)
    (mission.folder / "mission.yaml").write_text("vehicle: petrel-ii\nfiles: {ctd.csv: {}}\n")
    with pytest.raises(InputError) as error:
        ingest.recognise(load(mission.folder))
    assert str(error.value) == (
        "trial: found logs of several formats: seaglider (p1710100.nc), table (attitude.csv); "
        "expected one format; set format: seaglider or table in mission.yaml"
    )
    assert ingest.recognise(mission.model_copy(update={"format": "table"})) == "table"


def test_missing_pitch_is_refused(mission: Mission) -> None:
    table = pd.read_csv(mission.folder / "attitude.csv").drop(columns="pitch (deg)")
    table.to_csv(mission.folder / "attitude.csv", index=False)
    assert _error(mission) == (
        "mission: found no pitch in attitude.csv, ctd.csv; expected a pitch column; "
        "name it under files: … in mission.yaml"
    )


def test_missing_pressure_is_refused(mission: Mission) -> None:
    (mission.folder / "ctd.csv").unlink()
    assert _error(mission) == (
        "mission: found no pressure in attitude.csv; expected a pressure column; name it under files: … in mission.yaml"
    )


def test_a_pitch_that_is_only_nan_is_refused(mission: Mission) -> None:
    table = pd.read_csv(mission.folder / "attitude.csv").assign(**{"pitch (deg)": np.nan})
    table.to_csv(mission.folder / "attitude.csv", index=False)
    assert _error(mission) == (
        f"attitude.csv: column 'pitch (deg)': found no pitch in {len(table)} records, only NaN; "
        "expected a pitch sensor that reports; the mission cannot be analysed without it"
    )


def test_a_sensor_that_is_not_needed_may_be_only_nan(mission: Mission) -> None:
    table = pd.read_csv(mission.folder / "ctd.csv").assign(**{"conductivity (S/m)": np.nan})
    table.to_csv(mission.folder / "ctd.csv", index=False)
    got = ingest.ingest(mission)
    warnings = [str(finding) for finding in got.findings if finding.severity == "warning"]
    assert warnings == [
        f"ctd.csv: conductivity: found no number in {len(table)} records; expected measurements; not used",
        "mission: density: found no record with temperature, conductivity and pressure; expected a CTD; "
        "there is no density",
    ]
    assert got.records["density"].isna().all()
    assert got.records["depth"].notna().any()


def test_pressure_in_bar_declared_as_dbar_is_caught(mission: Mission) -> None:
    table = pd.read_csv(mission.folder / "ctd.csv")
    table["pressure (dbar)"] /= 10.0
    table.to_csv(mission.folder / "ctd.csv", index=False)
    assert _error(mission) == (
        "ctd.csv: column 'pressure (dbar)': found depth changing by 0.015 m/s at 25° of pitch, a speed of 0.035 m/s; "
        "expected 0.12 to 2.2 m/s through the water; "
        "is the unit of pressure bar? correct it under files: in mission.yaml"
    )


def test_times_that_go_backwards_and_garbage_cost_only_those_records(mission: Mission) -> None:
    clean = ingest.ingest(mission).records
    table = pd.read_csv(mission.folder / "ctd.csv")
    table.loc[100, "time"] = 1e103
    table.loc[200, "time"] -= 5000.0
    table.loc[300, "time"] = np.nan
    table.to_csv(mission.folder / "ctd.csv", index=False)
    got = ingest.ingest(mission)
    assert got.records["pressure"].count() == clean["pressure"].count() - 3
    assert [str(finding) for finding in got.findings if finding.severity == "warning"] == [
        "ctd.csv: record 301: found no time; expected a time; left out",
        "ctd.csv: record 101: found an absurd time (1e+103); expected a time from 1990 to 2100; left out",
        "ctd.csv: record 201: found a time that goes backwards (2016-06-21T22:40:00Z); "
        "expected times that increase; left out",
    ]


def test_no_steady_flight_is_said(fly: Fly, write_mission: Write, tmp_path: Path) -> None:
    mission = write_mission(tmp_path / "trial", fly([0.0, *[6.0, 2.0] * 8]))
    assert str(ingest.ingest(mission).findings[-1]) == (
        "mission: phases: found no steady flight; "
        "expected at least 60 s at one pitch, engine volume and propeller speed; nothing can be compared with theory; "
        "where dives are short, set minimum_block_s: in mission.yaml"
    )


def _mission(folder: Path, source: Path, yaml: str, pattern: str = "*") -> Mission:
    """Return a mission with copies of the files in `source`."""
    folder.mkdir()
    for path in sorted(source.glob(pattern)):
        if path.is_file():
            shutil.copy(path, folder / path.name)
    (folder / "mission.yaml").write_text(yaml)
    return load(folder)


def test_comet_has_nine_yos_with_blocks_and_the_density_and_pitch_of_the_published_series(
    data: Path, tmp_path: Path
) -> None:
    pytest.importorskip("dbdreader")
    yaml = "vehicle: petrel-ii\nsalinity: baltic\npitch: {scale: 0.86, offset_rad: -0.004}\n"
    got = ingest.ingest(_mission(tmp_path / "comet", data / "slocum/comet2016/raw", yaml))
    records = got.records
    assert got.format == "slocum"
    assert records["dive"].max() == 9
    blocks = records[records["block"] >= 0].groupby("block")
    assert blocks.ngroups == 18
    assert set(blocks["phase"].first()) == {Phase.ASCENT, Phase.DESCENT}
    spans = (blocks["time"].max() - blocks["time"].min()).dt.total_seconds()
    assert spans.min() > 100.0
    time, bar, pitch, _, density, _ = np.load(data / "slocum/comet2016/flight_P_pitch_vb_rho_U.npy")
    own = records.dropna(subset=["density"])
    inside = np.interp(seconds(own["time"]), time, bar) > 0.3
    error = own["density"] - np.interp(seconds(own["time"]), time, density)
    assert np.abs(error[inside]).median() < 0.002
    tilted = records.dropna(subset=["pitch"])
    error = tilted["pitch"] - np.interp(seconds(tilted["time"]), time, pitch)
    assert np.abs(error).median() < 1e-3


@pytest.mark.parametrize(
    ("source", "dives", "blocks"),
    [
        ("sg171_ekamsat2024", 5, 60),
        ("sg171_shilshole2024", 3, 15),
        ("sg249_nanoos2024", 3, 120),
        ("sg542", 4, 150),
        ("sg167", 3, 150),
        ("sg561_lofoten2016", 4, 60),
        ("sg005_2008", 5, 110),
    ],
)
def test_seagliders_have_a_dive_a_file_and_blocks_in_most_of_it(
    data: Path, tmp_path: Path, source: str, dives: int, blocks: int
) -> None:
    pytest.importorskip("h5netcdf")
    got = ingest.ingest(_mission(tmp_path / "sg", data / "seaglider" / source, "vehicle: petrel-ii\n"))
    assert got.format == "seaglider"
    assert got.records["dive"].max() == dives
    assert got.records["block"].max() + 1 >= blocks
    assert got.records["density"].notna().any()


def test_density_at_a_thousand_metres_is_not_that_at_the_surface(data: Path, tmp_path: Path) -> None:
    pytest.importorskip("h5netcdf")
    mission = _mission(tmp_path / "sg", data / "seaglider/sg249_nanoos2024", "vehicle: petrel-ii\n")
    records = ingest.ingest(mission).records
    deep = records[(records["pressure"] - 990.0).abs() < 5.0]
    assert deep["density"].median() == pytest.approx(1031.9, abs=0.15)


@pytest.mark.parametrize(("source", "dives"), [("slocum/osu2025", 3), ("slocum/misc", 6)])
def test_the_hard_slocum_folders_run_to_the_end(data: Path, tmp_path: Path, source: str, dives: int) -> None:
    pytest.importorskip("dbdreader")
    mission = _mission(tmp_path / "trial", data / source, "vehicle: petrel-ii\n")
    for cache in (data / source).glob("*/*.c?c"):
        shutil.copy(cache, mission.folder / cache.name)
    got = ingest.ingest(mission)
    assert got.records["dive"].max() >= dives
    assert any(finding.severity == "error" for finding in got.findings)


def test_kolumbo_is_a_powered_glider_with_three_yos(data: Path, tmp_path: Path) -> None:
    yaml = "vehicle: petrel-ii\nlatitude: 36.5\nfiles: {glider_data.csv: {columns: {depth: z}, ignore: [lat, lon]}}\n"
    records = ingest.ingest(_mission(tmp_path / "kolumbo", data / "slocum/kolumbo2019_hybrid", yaml)).records
    assert records["dive"].max() == 3
    assert records["block"].max() + 1 >= 6
    rate = np.gradient(records["depth"], seconds(records["time"]))
    assert np.median(rate[records["phase"] == Phase.DESCENT]) == pytest.approx(0.34, abs=0.03)


@pytest.mark.parametrize(
    ("yaml", "together", "words"),
    [
        ("", True, "its sign is turned"),
        ("pitch: {scale: -1}\n", True, "pitch = -1 · logged"),
        ("pitch: {scale: -1}\n", False, "pitch = -1 · logged"),
        ("", False, "if its sign is reversed, pitch: {scale: -1} in mission.yaml turns it"),
    ],
)
def test_a_reversed_pitch_comes_right_by_itself_or_by_the_line_that_is_told(
    mission: Mission, yaml: str, together: bool, words: str
) -> None:
    straight = ingest.ingest(mission).records["pitch"]
    path = mission.folder / "attitude.csv"
    table = pd.read_csv(path)
    table["pitch (deg)"] *= -1
    table.drop(columns=[] if together else ["oil_volume (cm3)"]).to_csv(path, index=False)
    (mission.folder / "mission.yaml").write_text(f"vehicle: petrel-ii\nlatitude: 54.75\nlongitude: 15.1\n{yaml}")
    found = ingest.ingest(load(mission.folder))
    sign = 1.0 if together or yaml else -1.0
    np.testing.assert_allclose(found.records["pitch"], sign * straight)
    about = [str(finding) for finding in found.findings if words in str(finding)]
    assert len(about) == 1
    assert len([finding for finding in found.findings if "on the way down" in finding.found]) == (0 if yaml else 1)


def test_a_column_to_ignore_that_is_not_there_is_told(mission: Mission) -> None:
    other = mission.model_copy(update={"files": {"attitude.csv": Table(ignore=["rol"])}})
    assert any(
        str(finding).startswith("mission.yaml: files.attitude.csv.ignore: found 'rol', no column of it")
        for finding in ingest.ingest(other).findings
    )


def test_files_of_two_gliders_are_told() -> None:
    assert of_one("m", {"SG171"}) == []
    assert [str(finding) for finding in of_one("m", {"SG171", "SG249"})] == [
        "m: found files of gliders named SG171, SG249; expected one; if these are not names of one vehicle, give each "
        "a folder of its own"
    ]

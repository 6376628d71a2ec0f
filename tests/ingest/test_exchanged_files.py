"""Formats in which gliders' series are exchanged: OceanGliders (OG1), EGO, IMOS, ERDDAP, pyglider, the Slocum tools."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline.ingest import table
from pipeline.ingest.logs import Logs
from pipeline.mission import load

START = 1466553600.0  # 2016-06-22 00:00 UTC
ROWS = np.arange(6.0)
SECONDS = {"units": "seconds since 1970-01-01T00:00:00Z"}
DEGREES = {"units": "degrees"}

Variables = dict[str, tuple[str | tuple[str, ...], np.ndarray, dict[str, object]]]


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., Logs]:
    """Return how to write a netCDF file of these variables and read it as a mission."""
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")

    def from_netcdf(variables: Variables, yaml: str = "", engine: str = "h5netcdf") -> Logs:
        xarray.Dataset(variables).to_netcdf(tmp_path / "unit.nc", engine=engine)
        (tmp_path / "mission.yaml").write_text("vehicle: petrel-ii\nlatitude: 45\n" + yaml, encoding="utf-8")
        return table.read(load(tmp_path))

    return from_netcdf


def _measured(dimension: str) -> Variables:
    """Return series whose positions are interpolated."""
    return {
        "TIME": (dimension, START + ROWS, SECONDS),
        "PRES": (dimension, 10 * ROWS, {"units": "decibar"}),
        "GLIDER_PITCH": (dimension, -20.0 - ROWS, {"units": "deg"}),
        "LATITUDE": (dimension, 50.0 + ROWS, {"units": "degrees_north"}),
        "LONGITUDE": (dimension, 10.0 + ROWS, {"units": "degrees_east"}),
    }


def _fixes(dimension: str, time: np.ndarray, latitude: np.ndarray) -> Variables:
    return {
        "TIME_GPS": (dimension, time, SECONDS),
        "LATITUDE_GPS": (dimension, latitude, {"units": "degrees_north"}),
        "LONGITUDE_GPS": (dimension, latitude - 40.0, {"units": "degrees_east"}),
        "LATITUDE_GPS_QC": (dimension, np.where(np.isnan(latitude), 9, 1).astype(np.int8), {}),
        "LONGITUDE_GPS_QC": (dimension, np.full(latitude.size, -128, dtype=np.int8), {"_FillValue": np.int8(-128)}),
    }


NAN = np.nan
#: A profile's fix repeated at each of its measurements; fixes at some of them; fixes on a dimension of their own.
FIXES = {
    "repeated": _fixes("N_MEASUREMENTS", START - 60.0 + np.repeat([0.0, 3600.0], 3), np.repeat([50.5, 51.5], 3)),
    "at some": _fixes(
        "N_MEASUREMENTS",
        np.array([START - 60.0, NAN, NAN, NAN, NAN, START + 3540.0]),
        np.array([50.5, NAN, NAN, NAN, NAN, 51.5]),
    ),
    "apart": _fixes("TIME_GPS", START - 60.0 + np.array([0.0, 3600.0]), np.array([50.5, 51.5])),
}


@pytest.mark.parametrize("kind", FIXES)
def test_fixes_of_a_receiver_are_read_on_its_own_clock_and_interpolated_positions_are_not(
    read: Callable[..., Logs], kind: str
) -> None:
    logs = read(_measured("N_MEASUREMENTS") | FIXES[kind])
    measured, fixes = sorted(logs.streams, key=lambda stream: "latitude" in stream)
    assert sorted(measured) == ["pitch", "pressure", "time"]
    np.testing.assert_allclose(measured["pitch"], np.radians(-20.0 - ROWS))
    assert fixes["time"].tolist() == [START - 60.0, START + 3540.0]
    assert fixes["latitude"].tolist() == [50.5, 51.5]
    assert fixes["longitude"].tolist() == [10.5, 11.5]
    assert fixes["latitude_qc"].tolist() == [1, 1]
    assert (
        "unit.nc: found positions beside the fixes of the receiver: LATITUDE, LONGITUDE; not read; the fixes are"
        in map(str, logs.findings)
    )


def test_a_receiver_without_a_fix_leaves_the_other_positions(read: Callable[..., Logs]) -> None:
    fixes = _fixes("N_MEASUREMENTS", NAN * ROWS, NAN * ROWS)
    logs = read(_measured("N_MEASUREMENTS") | fixes)
    columns = "'TIME_GPS', 'LATITUDE_GPS', 'LONGITUDE_GPS', 'LATITUDE_GPS_QC', 'LONGITUDE_GPS_QC'"
    assert f"unit.nc: found no fix in {columns}" in map(str, logs.findings)
    assert [stream["latitude"].tolist() for stream in logs.streams if "pressure" in stream] == [(50.0 + ROWS).tolist()]


def test_positions_that_mission_yaml_names_are_read_beside_fixes(read: Callable[..., Logs]) -> None:
    yaml = "files: {unit.nc: {columns: {latitude: LATITUDE, longitude: LONGITUDE}}}\n"
    logs = read(_measured("N_MEASUREMENTS") | FIXES["apart"], yaml)
    assert [stream["latitude"].tolist() for stream in logs.streams if "pressure" in stream] == [(50.0 + ROWS).tolist()]


def test_fixes_without_a_clock_of_their_own_go_before_interpolated_positions(read: Callable[..., Logs]) -> None:
    fixes = _fixes("N_MEASUREMENTS", ROWS, np.array([50.5, NAN, NAN, NAN, NAN, 51.5]))
    del fixes["TIME_GPS"]
    (stream,) = read(_measured("N_MEASUREMENTS") | fixes).streams
    np.testing.assert_array_equal(stream["latitude"], [50.5, NAN, NAN, NAN, NAN, 51.5])


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
@pytest.mark.parametrize(
    ("name", "flags"),
    [
        ("PRES_quality_control", np.array([1, 1, 2, 3, 4, 9], dtype=np.int8)),
        ("QC_PRES", np.array([1, 1, 2, 3, 4, 9], dtype=np.int8)),
        ("PRES_qartod_primary_flag", np.array([1, 1, 2, 3, 4, 9], dtype=np.int8)),
    ],
)
def test_flags_are_read_by_whatever_name(read: Callable[..., Logs], name: str, flags: np.ndarray, engine: str) -> None:
    (stream,) = read(_measured("TIME") | {name: ("TIME", flags, {})}, engine=engine).streams
    assert stream["pressure_qc"].tolist() == [1, 1, 2, 3, 4, 9]


def test_series_of_several_dimensions_are_read_where_time_has_them_too(read: Callable[..., Logs]) -> None:
    grid = ("trajectory", "obs")
    rows = ROWS.reshape(2, 3)
    (stream,) = read({"time": (grid, START + rows, SECONDS), "pitch": (grid, rows, DEGREES)}).streams
    assert stream["time"].tolist() == (START + ROWS).tolist()
    np.testing.assert_allclose(stream["pitch"], np.radians(ROWS))


def test_series_without_a_time_say_that_they_have_none(read: Callable[..., Logs]) -> None:
    """Ragged: the time is each profile's, the measurements are along obs."""
    rows = np.arange(8.0)
    ragged: Variables = {"time": ("profile", START + rows[:2], SECONDS), "pressure": ("obs", rows, {"units": "dbar"})}
    assert (
        "unit.nc: found 'pressure' along obs, of which there is no time; expected series along a time; "
        "file left out; give the logs that it was made of"
    ) in map(str, read(ragged).findings)


def test_profiles_on_a_grid_of_depths_say_what_they_are(read: Callable[..., Logs]) -> None:
    grid: Variables = {
        "time": ("profile", START + ROWS, SECONDS),
        "lat": ("profile", 50.0 + ROWS, {}),
        "depth": ("depth", 10.0 * ROWS[:4], {"units": "m"}),
        "temperature": (("profile", "depth"), np.ones((6, 4)), {"units": "degree_C"}),
    }
    assert (
        "unit.nc: found 'temperature' on a grid of profile by depth; expected series along a time; "
        "file left out; give the logs that it was made of"
    ) in map(str, read(grid).findings)


def test_a_name_of_several_quantities_is_believed_with_its_unit(read: Callable[..., Logs]) -> None:
    (stream,) = read(_measured("TIME") | {"buoyancy": ("TIME", 100.0 * ROWS, {"units": "cc"})}).streams
    np.testing.assert_allclose(stream["buoyancy_volume"], 1e-4 * ROWS)
    (stream,) = read(_measured("TIME") | {"buoyancy": ("TIME", 100.0 * ROWS, {"units": "g"})}).streams
    assert "buoyancy_volume" not in stream


SLOCUM = "m_present_time,m_pitch,m_heading,m_gps_mag_var\ntimestamp,rad,rad,rad\n"


def _headings(folder: Path, rows: str, head: str = SLOCUM, yaml: str = "") -> Logs:
    (folder / "unit.dba").write_text(head + rows, encoding="utf-8")
    (folder / "mission.yaml").write_text("vehicle: petrel-ii\nlatitude: 45\n" + yaml, encoding="utf-8")
    return table.read(load(folder))


def test_a_slocum_s_magnetic_heading_is_made_true_by_the_variation_that_is_positive_west(tmp_path: Path) -> None:
    rows = f"{START},0.1,0.1,0\n{START + 4},0.1,0.1,NaN\n{START + 8},0.1,3.0,0.25\n{START + 12},0.1,3.0,NaN\n"
    logs = _headings(tmp_path, rows)
    np.testing.assert_allclose(logs.streams[0]["heading"], [2 * np.pi - 0.15, 2 * np.pi - 0.15, 2.75, 2.75])
    assert (
        "unit.dba: column 'm_heading': found a magnetic variation of 14.3° W beside it; magnetic headings made true"
    ) in map(str, logs.findings)
    assert "magnetic_variation" not in logs.streams[0]


def test_a_slocum_s_heading_without_a_variation_is_told(tmp_path: Path) -> None:
    logs = _headings(tmp_path, f"{START},0.1,0.1,0\n")
    assert logs.streams[0]["heading"].tolist() == [0.1]
    assert (
        "unit.dba: column 'm_heading': found magnetic headings and no magnetic variation; "
        "expected it, to turn them true; heading stays magnetic"
    ) in map(str, logs.findings)


def test_a_heading_of_unknown_north_is_turned_only_where_mission_yaml_names_the_variation(tmp_path: Path) -> None:
    head, rows = "time,pitch (deg),heading (deg),declination\n", f"{START},10,20,5\n"
    for name in ("declination", "magnetic_declination"):
        logs = _headings(tmp_path, rows, head.replace("declination", name))
        np.testing.assert_allclose(logs.streams[0]["heading"], np.radians(20.0))
    assert (
        "unit.dba: column 'heading (deg)': found a magnetic variation of 5.0° E beside it; expected true headings; "
        "taken for true; if it is magnetic, name magnetic_variation: under files: unit.dba: columns: in mission.yaml"
    ) in map(str, logs.findings)
    yaml = "files: {unit.dba: {columns: {magnetic_variation: declination}}}\n"
    logs = _headings(tmp_path, rows, head, yaml)
    np.testing.assert_allclose(logs.streams[0]["heading"], np.radians(25.0))


def _standard(name: str, units: str) -> dict[str, object]:
    return {"standard_name": name, "units": units}


def test_cf_standard_names_tell_what_no_name_does_and_whose_sign_is_reversed(read: Callable[..., Logs]) -> None:
    logs = read(
        {
            "t": ("obs", START + ROWS, _standard("time", "seconds since 1970-01-01T00:00:00Z")),
            "var1": ("obs", 10 * ROWS, _standard("sea_water_pressure", "dbar")),
            "var2": ("obs", ROWS, _standard("platform_pitch_fore_down", "degree")),
            "roll": ("obs", ROWS, _standard("platform_roll_starboard_up", "degree")),
            "temperature": ("obs", ROWS, _standard("sea_water_temperature", "degree_C")),
            "optode": ("obs", ROWS + 5, _standard("sea_water_temperature", "degree_C")),
        }
    )
    (stream,) = logs.streams
    assert stream["pressure"].tolist() == (10 * ROWS).tolist()
    np.testing.assert_allclose(stream["pitch"], -np.radians(ROWS))
    np.testing.assert_allclose(stream["roll"], -np.radians(ROWS))
    assert stream["temperature"].tolist() == ROWS.tolist()
    assert any("'var2' is pitch in -degree" in str(finding) for finding in logs.findings)


def test_the_variation_of_a_slocum_is_positive_west_where_mission_yaml_names_it_too(tmp_path: Path) -> None:
    yaml = "files: {unit.dba: {columns: {magnetic_variation: m_gps_mag_var}}}\n"
    logs = _headings(tmp_path, f"{START},0.1,3.0,0.25\n", yaml=yaml)
    np.testing.assert_allclose(logs.streams[0]["heading"], [2.75])

"""Seaglider dives: what is read of which clock, what is no measurement, and what bad input gets."""

import gc
import re
import sys
from pathlib import Path

import gsw
import numpy as np
import pandas as pd
import pytest
from scipy.io import netcdf_file

from pipeline.findings import InputError
from pipeline.ingest import adcp, ingest, netcdf, seaglider
from pipeline.ingest.logs import UnreadableError
from pipeline.mission import Mission
from pipeline.records import Quality

xarray = pytest.importorskip("xarray", reason="netCDF files need the extra: pip install 'seatrial[netcdf]'")
h5py = pytest.importorskip("h5py", reason="netCDF files need the extra: pip install 'seatrial[netcdf]'")
pytest.importorskip("h5netcdf", reason="netCDF files need the extra: pip install 'seatrial[netcdf]'")

T0 = 1.7e9
DEPTHS = np.array([1.0, 50.0, 100.0, 50.0, 1.0])


def dive(start: float = T0, **changes):
    """Return a dive of five engineering samples and four of a CTD on its own clock; None takes a variable out."""
    eng, ctd, gps, scalar = "sg_data_point", "ctd_data_point", "gps_info", ()
    time = start + 10.0 * np.arange(5)
    ctd_time = start + 3.0 + 10.0 * np.arange(4)
    pressure = gsw.p_from_z(-DEPTHS, 45.0)
    variables = {
        "time": (eng, time),
        "pressure": (eng, pressure),
        "depth": (eng, DEPTHS),
        "eng_pitchAng": (eng, np.array([-30.0, -30.0, 0.0, 30.0, 30.0])),
        "eng_rollAng": (eng, np.full(5, 2.0)),
        "eng_head": (eng, np.full(5, 355.0)),
        "eng_vbdCC": (eng, np.array([-150.0, -150.0, 100.0, 100.0, 100.0])),
        "magnetic_variation": (scalar, 15.0),
        "ctd_time": (ctd, ctd_time),
        "ctd_pressure": (ctd, np.interp(ctd_time, time, pressure) + 0.5),
        "temperature": (ctd, np.array([15.0, 10.0, 8.0, 12.0])),
        "conductivity": (ctd, np.array([4.2, 3.8, 3.6, 3.9])),
        "temperature_qc": (ctd, np.array([b"1", b"8", b"4", b"0"])),
        "conductivity_qc": (ctd, np.array([b"1", b"1", b"1", b"2"])),
        "speed": (ctd, np.array([20.0, 25.0, 25.0, 20.0])),
        "vert_speed": (ctd, np.array([-10.0, -12.0, 12.0, 10.0])),
        "log_gps_time": (gps, start + np.array([-300.0, -10.0, 60.0])),
        "log_gps_lat": (gps, np.array([45.0, 45.001, 45.01])),
        "log_gps_lon": (gps, np.array([-125.0, -125.001, -125.01])),
        "sg_cal_mass": (scalar, 52.0),
        "sg_cal_volmax": (scalar, 51000.0),
        "sg_cal_vbdbias": (scalar, 30.0),
        "log_C_VBD": (scalar, 3000),
        "log_VBD_MIN": (scalar, 500),
        "log_VBD_CNV": (scalar, -0.25),
        "sg_cal_hd_a": (scalar, 0.0038),
    }
    variables |= changes
    return xarray.Dataset({name: value for name, value in variables.items() if value is not None})


def write(folder: Path, name: str, dataset, engine: str = "h5netcdf") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    kind = {"format": "NETCDF3_CLASSIC"} if engine == "scipy" else {}
    dataset.to_netcdf(folder / name, engine=engine, **kind)
    return folder


def read(folder: Path):
    return seaglider.read(Mission(vehicle="seaglider", folder=folder))


def named(logs) -> dict[str, pd.DataFrame]:
    return {frame.attrs["name"]: frame for frame in logs.streams}


def lines(logs) -> list[str]:
    return [str(finding) for finding in logs.findings]


# --- what is read ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
def test_units_and_signs_become_the_canonical_ones_in_both_kinds_of_netcdf(tmp_path, engine):
    engineering = named(read(write(tmp_path, "p1230001.nc", dive(), engine)))["engineering"]
    np.testing.assert_allclose(engineering["pitch"], np.radians([-30, -30, 0, 30, 30]))
    np.testing.assert_allclose(engineering["roll"], np.radians(2.0))
    np.testing.assert_allclose(engineering["heading"], np.radians(10.0))
    np.testing.assert_allclose(engineering["buoyancy_volume"], [-150e-6, -150e-6, 100e-6, 100e-6, 100e-6])
    np.testing.assert_allclose(engineering["pressure"], gsw.p_from_z(-DEPTHS, 45.0))
    assert engineering["time"].tolist() == [T0 + 10.0 * i for i in range(5)]


def test_interpolated_pressure_is_no_measurement(tmp_path):
    logs = read(write(tmp_path, "p1230001.nc", dive()))
    ctd = named(logs)["CTD"]
    assert "pressure" not in ctd
    assert ctd["pressure_interpolated"].notna().all()
    assert lines(logs) == [
        "p1230001.nc: found a CTD without pressure, on its own clock; "
        "pressure interpolated to its instants serves salinity and density, never depth"
    ]


def test_a_ctd_that_measures_pressure_replaces_the_vehicles(tmp_path):
    measured = np.array([2.0, 40.0, 95.0, 60.0])
    logs = read(write(tmp_path, "p1230001.nc", dive(legato_pressure=("ctd_data_point", measured))))
    streams = named(logs)
    assert streams["CTD"]["pressure"].tolist() == measured.tolist()
    assert "pressure" not in streams["engineering"]
    assert lines(logs) == ["p1230001.nc: found a CTD that measures pressure; the vehicle's own pressure is not used"]


@pytest.mark.parametrize("measured", [[2.0, np.nan, np.nan, np.nan], [np.nan] * 4])
def test_a_ctd_that_sleeps_does_not_take_the_vehicles_pressure_along(tmp_path, measured):
    """An hour and a half between samples: one alone says nothing of the others."""
    slow = {"time": ("sg_data_point", T0 + 1000.0 * np.arange(5)), "ctd_pressure": None}
    slow["ctd_time"] = ("ctd_data_point", T0 + 300.0 + 1000.0 * np.arange(4))
    logs = read(write(tmp_path, "p1230001.nc", dive(**slow, legato_pressure=("ctd_data_point", np.array(measured)))))
    streams = named(logs)
    assert streams["engineering"]["pressure"].notna().all()
    assert "pressure" not in streams["CTD"]
    assert streams["CTD"]["pressure_interpolated"].notna().all()
    said = "p1230001.nc: found a CTD that measures pressure; it sleeps too often: the vehicle's own is used"
    assert (said in lines(logs)) == bool(np.isfinite(measured).any())


def test_a_ctd_on_the_vehicles_clock_shares_its_rows_and_its_pressure(tmp_path):
    together = {
        "ctd_time": ("sg_data_point", T0 + 10.0 * np.arange(5)),
        "ctd_pressure": None,
        "temperature": ("sg_data_point", np.full(5, 9.0)),
        "conductivity": ("sg_data_point", np.full(5, 3.7)),
        "temperature_qc": None,
        "conductivity_qc": None,
        "speed": None,
    }
    logs = read(write(tmp_path, "p1230001.nc", dive(**together)))
    streams = named(logs)
    assert set(streams) == {"engineering", "GPS"}
    assert streams["engineering"][["temperature", "conductivity", "pressure"]].notna().all(axis=None)
    assert logs.stored is None


def test_flags_become_og1_and_interpolated_values_are_doubted(tmp_path):
    ctd = named(read(write(tmp_path, "p1230001.nc", dive())))["CTD"]
    assert ctd["temperature_qc"].tolist() == [Quality.GOOD, Quality.PROBABLY_BAD, Quality.BAD, Quality.NONE]
    assert ctd["conductivity_qc"].tolist() == [Quality.GOOD, Quality.GOOD, Quality.GOOD, Quality.PROBABLY_GOOD]


def test_conductivity_belongs_to_the_corrected_salinity(tmp_path):
    salinity = np.array([34.5, 34.7, np.nan, 34.6])
    changes = {"salinity": ("ctd_data_point", salinity), "salinity_qc": ("ctd_data_point", np.array([b"1"] * 4))}
    logs = read(write(tmp_path, "p1230001.nc", dive(**changes)))
    ctd = named(logs)["CTD"]
    again = gsw.SP_from_C(10.0 * ctd["conductivity"], ctd["temperature"], ctd["pressure_interpolated"])
    np.testing.assert_allclose(again, salinity, atol=1e-9)
    assert ctd["conductivity_qc"].tolist() == [Quality.GOOD, Quality.GOOD, Quality.MISSING, Quality.PROBABLY_GOOD]
    expected = "p1230001.nc: found salinity corrected by the basestation; conductivity is turned back from it"
    assert expected in lines(logs)


def test_conductivity_in_ms_per_cm_is_known_by_its_values(tmp_path):
    changes = {"conductivity": ("ctd_data_point", np.array([42.0, 38.0, 36.0, 39.0]))}
    logs = read(write(tmp_path, "p1230001.nc", dive(**changes)))
    np.testing.assert_allclose(named(logs)["CTD"]["conductivity"], [4.2, 3.8, 3.6, 3.9])
    assert "p1230001.nc: found conductivity in mS/cm by its values; expected S/m; divided by 10" in lines(logs)


def test_battery_positions_are_positive_forward_from_either_source(tmp_path):
    control = dive(eng_pitchCtl=("sg_data_point", np.array([-1.0, -1.0, 0.0, 1.0, 1.0])))
    streams = named(read(write(tmp_path / "old", "p1230001.nc", control)))
    np.testing.assert_allclose(streams["engineering"]["battery_position"], [0.01, 0.01, 0.0, -0.01, -0.01])
    moves = dive(
        gc_st_secs=("gc_event", T0 + np.array([1.0, 21.0])),
        gc_end_secs=("gc_event", T0 + np.array([5.0, 25.0])),
        gc_pitch_ad_start=("gc_event", np.array([2000.0, 1500.0])),
        gc_pitch_ad=("gc_event", np.array([1500.0, 2500.0])),
        log_C_PITCH=((), 2000),
        log_PITCH_CNV=((), 0.004),
    )
    battery = named(read(write(tmp_path / "new", "p1230001.nc", moves)))["battery"]
    assert (battery["time"] - T0).tolist() == [1.0, 5.0, 21.0, 25.0]
    np.testing.assert_allclose(battery["battery_position"], [0.0, 0.02, 0.02, -0.02], atol=1e-15)


def test_the_supply_under_the_current_of_a_motor_is_no_battery_voltage(tmp_path):
    volts = {f"gc_{motor}_volts": ("gc_event", np.array([30.0, 14.7])) for motor in ("pitch", "roll", "vbd")}
    events = {f"gc_{end}_secs": ("gc_event", T0 + np.array([1.0, 21.0])) for end in ("st", "end")}
    streams = read(write(tmp_path, "p1230001.nc", dive(log_MINV_24V=((), 14.0), **volts, **events))).streams
    assert not any("battery_voltage" in frame for frame in streams)


def test_a_fix_that_two_dives_share_is_kept_once_and_bad_ones_are_not(tmp_path):
    write(tmp_path, "p1230001.nc", dive())
    shared = {
        "log_gps_time": ("gps_info", T0 + np.array([60.0, 90.0, 160.0])),
        "log_gps_lat": ("gps_info", np.array([45.01, 45.02, 45.03])),
        "log_gps_lon": ("gps_info", np.array([-125.01, -125.02, -125.03])),
        "log_gps_qc": ("gps_info", np.array([b"1", b"4", b"1"])),
    }
    fixes = named(read(write(tmp_path, "p1230002.nc", dive(T0 + 100.0, **shared))))["GPS"]
    assert (fixes["time"] - T0).tolist() == [-300.0, -10.0, 60.0, 160.0]


def test_no_bit_of_a_file_makes_noise_when_it_is_flipped(tmp_path):
    """Warnings are errors, and so are exceptions where nobody can catch them."""
    path = (
        write(tmp_path, "p1230001.nc", dive().assign_attrs(title="a dive", glider="123", source="made up"))
        / "p1230001.nc"
    )
    whole, rng, lost = path.read_bytes(), np.random.default_rng(0), 0
    for place in rng.integers(0, min(len(whole), 6000), 100):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1 << int(rng.integers(8))]) + whole[place + 1 :])
        try:
            netcdf.variables(path, re.compile("time|pressure"))
            netcdf.series(path)
        except UnreadableError:
            lost += 1
        gc.collect()
    assert lost > 3


def test_a_sector_that_was_lost_from_a_heap_does_not_hang(tmp_path):
    path = write(tmp_path, "p1230001.nc", dive()) / "p1230001.nc"
    whole = path.read_bytes()
    heap = whole.index(b"GCOL") + 64
    path.write_bytes(whole[:heap] + bytes(512) + whole[heap + 512 :])
    with pytest.raises(UnreadableError, match="a damaged netCDF file"):
        netcdf.variables(path, re.compile("time"))


def test_the_stored_solution_is_in_si_and_up_positive(tmp_path):
    stored = read(write(tmp_path, "p1230001.nc", dive())).stored
    np.testing.assert_allclose(stored["speed"], [0.20, 0.25, 0.25, 0.20])
    np.testing.assert_allclose(stored["vertical_speed"], [-0.10, -0.12, 0.12, 0.10])


@pytest.mark.parametrize("absurd", [1e300, -1e300, np.inf, np.nan, 0.0])
def test_a_stored_solution_goes_without_the_instants_that_are_no_times(tmp_path, absurd):
    time = T0 + 3.0 + 10.0 * np.arange(4)
    time[1] = absurd
    folder = write(tmp_path, "p1230001.nc", dive(ctd_time=("ctd_data_point", time)))
    got = ingest(Mission(vehicle="seaglider", folder=folder))
    assert got.stored["speed"].tolist() == [np.float32(0.20), np.float32(0.25), np.float32(0.20)]


def test_the_volume_of_the_hull_follows_from_the_calibration(tmp_path):
    constants = read(write(tmp_path, "p1230001.nc", dive())).constants
    assert constants["hull_volume"] == pytest.approx((51000.0 - 30.0 + 2500.0 * -0.25) * 1e-6)
    assert constants["mass"] == 52.0
    without = read(write(tmp_path / "old", "p1230001.nc", dive(sg_cal_mass=None, log_MASS=((), 52500.0)))).constants
    assert without["mass"] == 52.5


def test_constants_that_differ_between_dives_become_their_median_and_it_is_said(tmp_path):
    for number, value in enumerate((0.003, 0.004, 0.006), start=1):
        write(tmp_path, f"p123000{number}.nc", dive(T0 + 100.0 * number, sg_cal_hd_a=((), value)))
    logs = read(tmp_path)
    assert logs.constants["hd_a"] == 0.004
    expected = "sg_cal: found hd_a from 0.003 to 0.006 over the dives; expected one value; the median 0.004 is used"
    assert expected in lines(logs)


def test_pressure_follows_from_depth_where_only_depth_was_written(tmp_path):
    logs = read(write(tmp_path, "p1230001.nc", dive(pressure=None)))
    np.testing.assert_allclose(named(logs)["engineering"]["pressure"], gsw.p_from_z(-DEPTHS, 45.001), rtol=1e-9)
    assert "p1230001.nc: found no variable pressure; depth is turned into pressure" in lines(logs)


# --- the current profiler -------------------------------------------------------------------------------------


def test_speed_is_the_length_of_the_mean_velocity_of_the_three_nearest_cells():
    velocity = np.full((2, 15, 3), 9.0)
    velocity[:, :3] = [[0.3, 0.4, 0.0], [0.3, 0.4, 0.0], [0.3, 0.4, 0.0]]
    frame = adcp.through_water(np.array([0.0, 60.0]), velocity, np.array([50.0, 5.0]))
    np.testing.assert_allclose(frame["speed_through_water"], 0.5)
    np.testing.assert_allclose(frame["speed_through_water_std"], 0.01)
    assert frame["speed_through_water_qc"].tolist() == [Quality.GOOD, Quality.PROBABLY_BAD]


def test_cells_that_disagree_make_an_ensemble_doubtful_and_lone_ones_make_none():
    velocity = np.full((2, 15, 3), np.nan)
    velocity[0, :3] = [[0.3, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0]]
    velocity[1, 0] = [0.3, 0.0, 0.0]
    frame = adcp.through_water(np.array([0.0, 60.0]), velocity, np.full(2, np.nan))
    assert frame["speed_through_water"][0] == pytest.approx(0.2)
    assert frame["speed_through_water_std"][0] == pytest.approx(0.1 / np.sqrt(3.0) / np.sqrt(3.0))
    assert np.isnan(frame["speed_through_water"][1])
    assert frame["speed_through_water_qc"].tolist() == [Quality.PROBABLY_BAD, Quality.MISSING]


# --- bad input ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"", "p1230002.nc: found an empty file; expected netCDF; left out; copy the file again"),
        (
            b"dbd_label: DBD",
            "p1230002.nc: found no netCDF header; expected netCDF, classic or 4; left out; copy the file again",
        ),
        (
            b"CDF\x01" + bytes(3),
            "p1230002.nc: found a damaged netCDF file; expected a whole one; left out; copy the file again",
        ),
        (
            b"\x89HDF\r\n\x1a\n" + bytes(100),
            "p1230002.nc: found a damaged netCDF file; expected a whole one; left out; copy the file again",
        ),
    ],
)
def test_a_bad_file_costs_that_file_and_says_why_in_one_line(tmp_path, capfd, content, line):
    write(tmp_path, "p1230001.nc", dive())
    (tmp_path / "p1230002.nc").write_bytes(content)
    logs = read(tmp_path)
    assert lines(logs)[0] == line
    assert len(named(logs)["engineering"]) == 5
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.9, 0.99])
def test_a_file_cut_short_is_told_and_never_raises(tmp_path, engine, share):
    write(tmp_path, "p1230001.nc", dive())
    write(tmp_path / "other", "p1230002.nc", dive(T0 + 100.0), engine)
    data = (tmp_path / "other/p1230002.nc").read_bytes()
    (tmp_path / "p1230002.nc").write_bytes(data[: int(share * len(data))])
    logs = read(tmp_path)
    damaged = "p1230002.nc: found a damaged netCDF file; expected a whole one; left out; copy the file again"
    assert damaged in lines(logs) or len(named(logs)["engineering"]) == 10


@pytest.mark.parametrize(
    ("missing", "line"),
    [
        (
            {"eng_pitchAng": None},
            "p1230002.nc: found no variable eng_pitchAng; expected it in a per-dive file of the basestation; "
            "the dive goes without",
        ),
        (
            {"temperature": None},
            "p1230002.nc: found no variable temperature; expected it in a per-dive file of the basestation; "
            "the dive goes without",
        ),
        (
            {"pressure": None, "depth": None},
            "p1230002.nc: found neither pressure nor depth; expected one of them on the clock 'time'; "
            "the dive goes without",
        ),
        (
            {"time": None},
            "p1230002.nc: found no variable time; expected the engineering clock; engineering data left out",
        ),
        (
            {"log_gps_lat": None},
            "p1230002.nc: found no GPS fixes; expected log_gps_time, log_gps_lat, log_gps_lon; the dive goes without",
        ),
        (
            {"magnetic_variation": None},
            "p1230002.nc: found no magnetic_variation; expected it, to turn eng_head true; heading stays magnetic",
        ),
    ],
)
def test_a_missing_variable_is_named_with_its_file(tmp_path, missing, line):
    write(tmp_path, "p1230001.nc", dive())
    write(tmp_path, "p1230002.nc", dive(T0 + 100.0, **missing))
    assert line in lines(read(tmp_path))


def test_a_mission_without_pitch_stops(tmp_path):
    write(tmp_path / "m", "p1230001.nc", dive(eng_pitchAng=None))
    with pytest.raises(InputError) as caught:
        read(tmp_path / "m")
    assert str(caught.value) == (
        "m: found no pitch; expected eng_pitchAng in a per-dive file of the basestation; "
        "process the dives again with the basestation"
    )


def test_a_mission_without_a_readable_file_stops_with_the_first_reason(tmp_path):
    (tmp_path / "m").mkdir()
    (tmp_path / "m/p1230001.nc").write_bytes(b"")
    with pytest.raises(InputError) as caught:
        read(tmp_path / "m")
    assert str(caught.value) == (
        "m: found 1 Seaglider file, none of them readable; "
        "p1230001.nc: found an empty file; expected netCDF; left out; copy the file again"
    )


@pytest.mark.parametrize("module", ["xarray", "h5netcdf"])
def test_a_missing_package_names_the_extra(tmp_path, monkeypatch, module):
    write(tmp_path, "p1230001.nc", dive())
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError) as caught:
        read(tmp_path)
    assert str(caught.value) == f"netCDF files: found no {module} to read them with; pip install 'seatrial[netcdf]'"


def test_per_dive_files_are_known_by_name(tmp_path):
    for name in ("p1230002.nc", "p1230001.nc", "p0050001_20080606.nc", "sg123_timeseries.nc", "p123.nc"):
        (tmp_path / name).write_bytes(b"")
    assert [path.name for path in seaglider.files(tmp_path)] == ["p0050001_20080606.nc", "p1230001.nc", "p1230002.nc"]


# --- real gliders ---------------------------------------------------------------------------------------------


def raw_depth(path: Path) -> np.ndarray:
    if path.read_bytes()[:3] == b"CDF":
        with netcdf_file(path, mmap=False) as file:
            return np.array(file.variables["depth"].data)
    with h5py.File(path) as file:
        return file["depth"][...]


@pytest.mark.parametrize(
    ("mission", "dives", "streams"),
    [
        ("sg005_2008", 5, {"engineering", "GPS"}),
        ("sg542", 4, {"engineering", "GPS"}),
        ("sg561_lofoten2016", 4, {"engineering", "GPS"}),
        ("sg167", 3, {"engineering", "CTD", "GPS"}),
        ("sg171_ekamsat2024", 5, {"engineering", "CTD", "GPS", "battery", "AD2CP"}),
        ("sg171_shilshole2024", 3, {"engineering", "CTD", "GPS", "battery", "AD2CP"}),
        ("sg249_nanoos2024", 3, {"engineering", "CTD", "GPS", "battery"}),
    ],
)
def test_every_layout_since_2008_is_read(data, mission, dives, streams):
    logs = read(data / "seaglider" / mission)
    found = named(logs)
    assert set(found) == streams
    carrier = next(frame for frame in logs.streams if "pressure" in frame)
    assert sum("pressure" in frame for frame in logs.streams) == 1
    latitude = found["GPS"]["latitude"].median()
    deepest = max(raw_depth(path).max() for path in (data / "seaglider" / mission).glob("p*.nc"))
    assert -gsw.z_from_p(carrier["pressure"].max(), latitude) == pytest.approx(deepest, rel=0.005)
    assert 2 * dives < len(found["GPS"]) <= 3 * dives
    assert found["engineering"]["time"].is_monotonic_increasing
    assert 1000.0 < logs.constants["mass"] / logs.constants["hull_volume"] < 1040.0


def test_counts_and_values_are_those_of_the_files(data):
    folder = data / "seaglider/sg171_ekamsat2024"
    raw = xarray.open_dataset(folder / "p1710102.nc", decode_times=False, engine="h5netcdf")
    streams = named(read(folder))
    engineering = streams["engineering"]
    rows = engineering[engineering["time"].isin(raw["time"].values)]
    assert len(rows) == 684
    np.testing.assert_allclose(rows["pressure"], raw["pressure"], rtol=1e-12)
    np.testing.assert_allclose(np.degrees(rows["pitch"]), raw["eng_pitchAng"], rtol=1e-12)
    np.testing.assert_allclose(np.degrees(rows["heading"]), (raw["eng_head"] - 1.2) % 360.0, rtol=1e-9)
    ctd = streams["CTD"][streams["CTD"]["time"].isin(raw["ctd_time"].values)]
    again = gsw.SP_from_C(10.0 * ctd["conductivity"], ctd["temperature"], ctd["pressure_interpolated"])
    np.testing.assert_allclose(again, raw["salinity"], atol=1e-8)
    assert np.bincount(ctd["temperature_qc"], minlength=4)[[Quality.GOOD, Quality.PROBABLY_BAD]].tolist() == [652, 30]


@pytest.mark.parametrize("mission", ["sg171_ekamsat2024", "sg171_shilshole2024"])
def test_speed_through_water_is_that_of_the_published_truth(data, mission):
    truth = pd.read_csv(data / "seaglider" / mission / "truth_adcp.csv")
    measured = named(read(data / "seaglider" / mission))["AD2CP"]
    both = truth.assign(time=truth["time_unix_s"]).merge(measured.assign(time=measured["time"].round(0)), on="time")
    steady = both[both["ok"] == 1]
    assert len(steady) > 0.9 * (truth["ok"] == 1).sum()
    np.testing.assert_allclose(steady["speed_through_water"], steady["V_ttw_m_s"], atol=5.1e-5)
    assert (steady["speed_through_water_qc"] == Quality.GOOD).mean() > 0.99


@pytest.mark.parametrize("mission", ["sg005_2008", "sg171_ekamsat2024", "sg542"])
def test_stored_vertical_speed_has_the_sign_of_the_depth_rate(data, mission):
    logs = read(data / "seaglider" / mission)
    engineering = named(logs)["engineering"]
    rising = -np.gradient(engineering["pressure"], engineering["time"])
    at = np.interp(logs.stored["time"], engineering["time"], rising)
    assert np.corrcoef(at, logs.stored["vertical_speed"])[0, 1] > 0.9

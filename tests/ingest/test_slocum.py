"""Slocum files: what is read, what is recognised, and what bad input gets."""

import sys
from pathlib import Path

import gsw
import numpy as np
import pandas as pd
import pytest
from dinkum_files import FLIGHT, KNOWN, SCIENCE, compressed, dbd, header, record, sensor_list, write
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from pipeline.findings import InputError
from pipeline.ingest import dinkum, slocum
from pipeline.ingest.logs import UnreadableError
from pipeline.mission import Mission

pytest.importorskip("dbdreader", reason="Slocum files need the extra: pip install 'seatrial[slocum]'")

T0 = 1704067200.0


def flight_row(second: float, **values: float) -> dict[str, float]:
    return {"m_present_time": T0 + second, "m_pitch": -0.4, **values}


def science_row(second: float, **values: float) -> dict[str, float]:
    ctd = {"sci_water_pressure": 2.5, "sci_water_temp": 10.0, "sci_water_cond": 3.5}
    return {"sci_m_present_time": T0 + second, **ctd, "sci_ctd41cp_timestamp": T0 + second - 0.25, **values}


FLIGHT_ROWS = [flight_row(4.0 * i, m_pitch=-0.1 * i, m_pressure=float(i)) for i in range(6)]
SCIENCE_ROWS = [science_row(float(i), sci_water_pressure=0.1 * i + 0.1) for i in range(8)]


def read(folder: Path):
    return slocum.read(Mission(vehicle="slocum-g2", folder=folder))


def lines(folder: Path) -> list[str]:
    return [str(finding) for finding in read(folder).findings]


def linked(tmp_path: Path, *sources: Path) -> Path:
    """Return a mission folder made of links to real files, none of them copied."""
    folder = tmp_path / "mission"
    folder.mkdir()
    for source in sources:
        (folder / source.name).symlink_to(source)
    return folder


# --- what is read ---------------------------------------------------------------------------------------------


def test_each_computer_keeps_its_own_clock_and_the_stale_first_record_is_left_out(tmp_path):
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, FLIGHT_ROWS))
    write(tmp_path, "00010000.ebd", dbd(SCIENCE, SCIENCE_ROWS))
    flight, ctd = read(tmp_path).streams
    assert flight["time"].tolist() == [T0 + 4.0 * i for i in range(1, 6)]
    np.testing.assert_allclose(flight["pitch"], [-0.1 * i for i in range(1, 6)], rtol=1e-6)
    assert ctd["time"].tolist() == [T0 + i - 0.25 for i in range(1, 8)]
    np.testing.assert_allclose(ctd["pressure"], [i + 1.0 for i in range(1, 8)], rtol=1e-6)
    np.testing.assert_allclose(flight["pressure"], [10.0 * i for i in range(1, 6)], rtol=1e-6)


def test_depth_is_turned_into_pressure_where_no_pressure_was_logged_and_lent_to_a_ctd_without(tmp_path):
    sensors = dict(FLIGHT) | {"m_depth": 4}
    write(tmp_path, "00010000.dbd", dbd(sensors, [flight_row(4.0 * i, m_depth=10.0 * i) for i in range(6)]))
    water = {name: size for name, size in SCIENCE.items() if name != "sci_water_pressure"}
    rows = [{name: value for name, value in row.items() if name in water} for row in SCIENCE_ROWS]
    write(tmp_path, "00010000.ebd", dbd(water, rows))
    logs = read(tmp_path)
    flight, ctd = logs.streams
    expected = gsw.p_from_z(-10.0 * np.arange(1, 6), 45.0)
    np.testing.assert_allclose(flight["pressure"], expected, rtol=1e-6)
    lent = np.interp([4.75, 5.75, 6.75], [4.0, 8.0], expected[:2])
    np.testing.assert_allclose(ctd["pressure_interpolated"].to_numpy()[4:], lent)
    said = " ".join(str(finding) for finding in logs.findings)
    assert "pressure: found no pressure of a CTD; expected sci_water_pressure; m_depth is used" in said
    assert "CTD: found a CTD without pressure; pressure interpolated to its instants serves salinity" in said


def test_the_absolute_pressure_of_an_rbr_ctd_is_taken_where_there_is_none_of_the_sea(tmp_path):
    sensors = {name: size for name, size in SCIENCE.items() if name != "sci_water_pressure"}
    rows = [science_row(float(i)) | {"sci_rbrctd_pressure_00": 10.1325 + i} for i in range(8)]
    rows = [{name: value for name, value in row.items() if name != "sci_water_pressure"} for row in rows]
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, FLIGHT_ROWS))
    write(tmp_path, "00010000.ebd", dbd(sensors | {"sci_rbrctd_pressure_00": 8}, rows))
    _, ctd = read(tmp_path).streams
    np.testing.assert_allclose(ctd["pressure"], np.arange(1.0, 8.0))


def test_units_and_signs_become_the_canonical_ones(tmp_path):
    values = {"m_roll": 0.1, "m_heading": 0.05, "m_gps_mag_var": 0.2, "m_de_oil_vol": 250.0, "m_battpos": 0.5}
    values |= {"m_thruster_power": 3.5, "m_battery": 14.25}
    rows = [flight_row(0), flight_row(4, **values), flight_row(8, m_de_oil_vol=-250.0)]
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, rows))
    write(tmp_path, "00010000.ebd", dbd(SCIENCE, SCIENCE_ROWS))
    flight, ctd = read(tmp_path).streams
    first = flight.iloc[0]
    assert first["roll"] == pytest.approx(0.1)
    assert first["heading"] == pytest.approx(0.05 - 0.2 + 2 * np.pi)
    assert first["buoyancy_volume"] == pytest.approx(250e-6)
    assert first["battery_position"] == pytest.approx(0.0127)
    assert first["propeller_power"] == pytest.approx(3.5)
    assert first["battery_voltage"] == 14.25
    assert "propeller_speed" not in flight
    assert ctd["temperature"].tolist() == [10.0] * 7
    assert ctd["conductivity"].tolist() == [3.5] * 7


def test_a_sensor_that_did_not_report_is_nan_and_nothing_fills_it(tmp_path):
    rows = [flight_row(0), flight_row(4, m_battpos=1.0), flight_row(8), flight_row(12, m_battpos=2.0)]
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, rows))
    battery = read(tmp_path).streams[0]["battery_position"]
    np.testing.assert_allclose(battery, [0.0254, np.nan, 0.0508], rtol=1e-6)


def test_only_new_and_valid_fixes_are_positions(tmp_path):
    fixes = [
        (5445.0, 1505.0, 0),
        (5445.6, 1506.0, 0),
        (5445.6, 1506.0, 0),
        (69696969.0, 69696969.0, 0),
        (5446.0, 1506.0, 1),
        (5446.2, 1506.0, 0),
    ]
    rows = [flight_row(4 * i, m_gps_lat=a, m_gps_lon=b, m_gps_status=s) for i, (a, b, s) in enumerate(fixes)]
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, rows))
    flight = read(tmp_path).streams[0]
    np.testing.assert_allclose(flight["latitude"], [54.76, np.nan, np.nan, np.nan, 54.77], rtol=1e-9)
    np.testing.assert_allclose(flight["longitude"].dropna(), [15.1, 15.1], rtol=1e-9)


def test_the_engine_that_moves_is_the_engine(tmp_path):
    rows = [flight_row(4 * i, m_de_oil_vol=0.0, m_ballast_pumped=100.0 * (-1) ** i) for i in range(4)]
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, rows))
    logs = read(tmp_path)
    np.testing.assert_allclose(logs.streams[0]["buoyancy_volume"], [-1e-4, 1e-4, -1e-4])
    assert "buoyancy engine: found m_ballast_pumped [cc] in use" in [str(finding) for finding in logs.findings]


def test_ctd_samples_from_old_memory_are_left_out(tmp_path):
    nothing = {"sci_water_pressure": 0.0, "sci_water_temp": 0.0, "sci_water_cond": 0.0, "sci_ctd41cp_timestamp": 0.0}
    rows = [science_row(0), science_row(1, **nothing), *(science_row(i) for i in range(2, 6))]
    rows.append(science_row(6, sci_ctd41cp_timestamp=T0 + 5 - 0.25))
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, FLIGHT_ROWS))
    write(tmp_path, "00010000.ebd", dbd(SCIENCE, rows))
    logs = read(tmp_path)
    assert logs.streams[1]["time"].tolist() == [T0 + i - 0.25 for i in range(2, 6)]
    assert "CTD: found 2 samples repeated or without a measurement; left out" in [str(f) for f in logs.findings]


def test_without_a_ctd_the_flight_computers_pressure_is_used_and_said(tmp_path):
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, FLIGHT_ROWS))
    logs = read(tmp_path)
    assert logs.streams[0]["pressure"].tolist() == [10.0, 20.0, 30.0, 40.0, 50.0]
    expected = "pressure: found no pressure of a CTD; expected sci_water_pressure; m_pressure is used"
    assert expected in [str(finding) for finding in logs.findings]


def test_without_magnetic_variation_the_heading_stays_magnetic_and_it_is_said(tmp_path):
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, [flight_row(4 * i, m_heading=1.0) for i in range(3)]))
    logs = read(tmp_path)
    assert logs.streams[0]["heading"].tolist() == [1.0, 1.0]
    expected = (
        "heading: found no magnetic variation (m_gps_mag_var); expected it, to turn m_heading true; "
        "heading stays magnetic"
    )
    assert expected in [str(finding) for finding in logs.findings]


def test_the_fullest_version_of_a_segment_is_used_and_the_others_are_noted(tmp_path):
    write(tmp_path, "00010000.sbd", dbd(FLIGHT, FLIGHT_ROWS[:3]))
    write(tmp_path, "00010000.dcd", compressed(dbd(FLIGHT, FLIGHT_ROWS[:4])))
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, FLIGHT_ROWS))
    logs = read(tmp_path)
    assert len(logs.streams[0]) == 5
    expected = "00010000.dcd: and 1 more file: found another version of a segment; the fullest one is used"
    assert str(logs.findings[0]) == expected


def test_the_next_version_of_a_segment_stands_in_for_a_broken_one(tmp_path):
    write(tmp_path, "00010000.sbd", dbd(FLIGHT, FLIGHT_ROWS[:3]))
    write(tmp_path, "00010000.dbd", b"")
    logs = read(tmp_path)
    assert len(logs.streams[0]) == 2
    assert (
        str(logs.findings[0])
        == "00010000.dbd: found an empty file; expected Slocum data; left out; copy the file again"
    )


@pytest.mark.parametrize("name", ["00010000.dcd", "00010000.DCD"])
def test_compressed_files_read_like_plain_ones(tmp_path, name):
    write(tmp_path / "plain", "00010000.dbd", dbd(FLIGHT, FLIGHT_ROWS))
    write(tmp_path / "packed", name, compressed(dbd(FLIGHT, FLIGHT_ROWS)))
    plain, packed = read(tmp_path / "plain").streams[0], read(tmp_path / "packed").streams[0]
    pd.testing.assert_frame_equal(plain, packed)


@pytest.mark.parametrize("name", ["0BADCAFE.CAC", "0badcafe.cac", "cac/0badcafe.cac", "Cache/0BADCAFE.cac"])
def test_cache_files_are_found_beside_the_data_and_in_folders_whatever_the_case(tmp_path, name):
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, FLIGHT_ROWS, cache="0badcafe"))
    write((tmp_path / name).parent, Path(name).name, sensor_list(FLIGHT))
    before = sorted(path.name for path in tmp_path.rglob("*"))
    assert len(read(tmp_path).streams[0]) == 5
    assert tmp_path / name in slocum.files(tmp_path)
    assert sorted(path.name for path in tmp_path.rglob("*")) == before


def test_a_compressed_cache_file_serves_as_well(tmp_path):
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, FLIGHT_ROWS, cache="0badcafe"))
    write(tmp_path / "cache", "0badcafe.ccc", compressed(sensor_list(FLIGHT)))
    assert len(read(tmp_path).streams[0]) == 5


def test_segments_follow_each_other_in_time_whatever_their_names(tmp_path):
    write(tmp_path, "unit-2024-1-0-10.dbd", dbd(FLIGHT, [flight_row(100 + i) for i in range(3)]))
    write(tmp_path, "unit-2024-1-0-9.dbd", dbd(FLIGHT, [flight_row(i) for i in range(3)]))
    assert (read(tmp_path).streams[0]["time"] - T0).tolist() == [1.0, 2.0, 101.0, 102.0]


# --- what is recognised ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "data", "expected"),
    [
        ("00010000.dbd", b"", True),
        ("00010000.TCD", b"anything", True),
        ("segment.bin", b"dbd_label:    DBD(dinkum_binary_data)file\n", True),
        ("segment.bin", b"\x3a\xea\xf1\x27dbd_label:    DBD", True),
        ("ctd.csv", b"time,pressure\n", False),
        ("00010000.dba", b"time", False),
    ],
)
def test_slocum_files_are_known_by_extension_or_first_bytes(tmp_path, name, data, expected):
    assert slocum.recognises(write(tmp_path, name, data)) is expected


def test_a_renamed_file_is_read_for_what_its_header_says(tmp_path):
    write(tmp_path, "segment.bin", dbd(FLIGHT, FLIGHT_ROWS))
    assert len(read(tmp_path).streams[0]) == 5


# --- bad input ------------------------------------------------------------------------------------------------

GOOD = dbd(FLIGHT, FLIGHT_ROWS)
START = GOOD.index(KNOWN)
#: Lengths at which a record has just ended.
BETWEEN = [len(GOOD), *(len(dbd(FLIGHT, FLIGHT_ROWS[:n])) - 1 for n in range(len(FLIGHT_ROWS) + 1))]
AGAIN = "left out; copy the file again"


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (b"", f"bad.dbd: found an empty file; expected Slocum data; {AGAIN}"),
        (b"GIF89a", f"bad.dbd: found no Slocum header; expected a file that begins with 'dbd_label'; {AGAIN}"),
        (
            dbd(FLIGHT, FLIGHT_ROWS, version=6),
            "bad.dbd: found encoding version 6; expected version 5; left out",
        ),
        (
            GOOD[:60],
            f"bad.dbd: found a header without a readable num_ascii_tags; expected a whole Slocum header; {AGAIN}",
        ),
        (GOOD[:200], f"bad.dbd: found a header cut short; expected 14 lines; {AGAIN}"),
        (
            dbd(FLIGHT, FLIGHT_ROWS, cache="0badcafe"),
            "bad.dbd: found no cache file 0badcafe.cac; expected it beside the data or in a folder 'cac'; "
            "copy it from the folder state/cache on the glider",
        ),
        (
            GOOD.replace(b"state_bytes_per_cycle:    4", b"state_bytes_per_cycle:    9"),
            f"bad.dbd: found a header with 9 state bytes for {len(FLIGHT)} sensors; "
            f"expected four sensors a byte; {AGAIN}",
        ),
        (
            header(FLIGHT) + sensor_list(FLIGHT)[:100],
            "bad.dbd: found a list of sensors abcdef01.cac that cannot be read; "
            "expected a line a sensor; copy it again",
        ),
        (
            GOOD[:START] + bytes(40),
            f"bad.dbd: found no known values behind the header; expected 123.456; {AGAIN}",
        ),
        (
            b"\x00\x20\xf0\x10dbd_label" + bytes(20),
            f"bad.dbd: found a first block that LZ4 cannot decode; expected compressed Slocum data; {AGAIN}",
        ),
    ],
)
def test_a_bad_file_costs_that_file_and_says_why_in_one_line(tmp_path, capfd, data, line):
    write(tmp_path, "bad.dbd", data)
    write(tmp_path, "good.dbd", GOOD)
    logs = read(tmp_path)
    assert str(logs.findings[0]) == line
    assert logs.findings[0].severity == "error"
    assert len(logs.streams[0]) == 5
    assert capfd.readouterr() == ("", "")


def test_a_broken_record_ends_the_file_there(tmp_path):
    rows = b"".join(record(FLIGHT, row) for row in FLIGHT_ROWS[:3])
    data = header(FLIGHT) + sensor_list(FLIGHT) + KNOWN + rows + b"?" + rows
    write(tmp_path, "00010000.dbd", data)
    logs = read(tmp_path)
    assert len(logs.streams[0]) == 2
    at = len(data) - len(rows) - 1
    assert str(logs.findings[0]) == (
        f"00010000.dbd: byte {at} of {len(data)}: found a broken record after 2 intact ones; "
        "the rest of the file is left out"
    )


def test_a_record_with_an_impossible_time_is_left_out(tmp_path):
    rows = [*FLIGHT_ROWS[:4], flight_row(1e103), *FLIGHT_ROWS[4:]]
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, rows))
    logs = read(tmp_path)
    assert len(logs.streams[0]) == 5
    expected = "00010000.dbd: found 1 record with an impossible time; expected 1990 to 2100; left out"
    assert str(logs.findings[0]) == expected


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(length=st.integers(0, len(GOOD)))
@example(length=START + len(KNOWN))
@example(length=START + len(KNOWN) - 1)
def test_a_file_cut_anywhere_gives_a_beginning_of_what_it_held_or_a_reason(tmp_path, length):
    whole = dinkum.read(write(tmp_path, "whole.dbd", GOOD), tmp_path, ("m_pitch", "m_pressure")).frame
    cut = write(tmp_path, "cut.dbd", GOOD[:length])
    if length < START + len(KNOWN):
        with pytest.raises(UnreadableError):
            dinkum.read(cut, tmp_path, ("m_pitch", "m_pressure"))
        return
    sensors = dinkum.read(cut, tmp_path, ("m_pitch", "m_pressure"))
    pd.testing.assert_frame_equal(sensors.frame, whole.iloc[: len(sensors.frame)])
    assert bool(sensors.damage) == (length not in BETWEEN)


def test_a_compressed_file_cut_short_keeps_its_whole_blocks(tmp_path):
    packed = compressed(dbd(FLIGHT, [flight_row(float(i)) for i in range(200)]))
    write(tmp_path, "00010000.dcd", packed[:-40])
    logs = read(tmp_path)
    assert 150 < len(logs.streams[0]) < 199
    assert str(logs.findings[0]).endswith("intact ones; the rest of the file is left out")


def test_a_file_without_pitch_is_named_and_its_other_sensors_are_used(tmp_path):
    bare = {"m_present_time": 8, "m_battpos": 4}
    write(tmp_path, "00010000.sbd", dbd(bare, [{"m_present_time": T0 + i, "m_battpos": 1.0} for i in range(3)]))
    write(tmp_path, "00020000.dbd", GOOD)
    logs = read(tmp_path)
    expected = "00010000.sbd: found no m_pitch; expected m_pitch in a flight file; its other sensors are used"
    assert str(logs.findings[0]) == expected
    assert logs.streams[0]["battery_position"].notna().sum() == 2


def test_the_same_complaint_about_many_files_is_made_once(tmp_path):
    for number in range(4):
        write(tmp_path, f"0001000{number}.dbd", dbd(FLIGHT, FLIGHT_ROWS, cache="0badcafe"))
    write(tmp_path, "good.dbd", GOOD)
    assert lines(tmp_path)[0] == (
        "00010000.dbd: and 3 more files: found no cache file 0badcafe.cac; expected it beside the data or in a folder "
        "'cac'; copy it from the folder state/cache on the glider"
    )


def test_a_mission_without_a_readable_file_stops_with_the_first_reason(tmp_path):
    write(tmp_path / "m", "00010000.dbd", b"")
    write(tmp_path / "m", "00010001.dbd", b"GIF89a")
    with pytest.raises(InputError) as caught:
        read(tmp_path / "m")
    assert str(caught.value) == (
        "m: found 2 Slocum files, none of them readable; "
        "00010000.dbd: found an empty file; expected Slocum data; left out; copy the file again"
    )


def test_a_mission_without_pitch_stops(tmp_path):
    write(tmp_path / "m", "00010000.ebd", dbd(SCIENCE, SCIENCE_ROWS))
    with pytest.raises(InputError) as caught:
        read(tmp_path / "m")
    assert str(caught.value) == (
        "m: found no pitch; expected m_pitch in a flight file (.dbd, .mbd, .sbd); "
        "add the flight files, or m_pitch to the glider's sbdlist.dat"
    )


def test_a_mission_whose_pitch_is_lost_with_a_file_stops_with_that_reason(tmp_path):
    write(tmp_path / "m", "00010000.sbd", dbd(FLIGHT, FLIGHT_ROWS, cache="616d8972"))
    write(tmp_path / "m", "00010000.tbd", dbd(SCIENCE, SCIENCE_ROWS))
    with pytest.raises(InputError) as caught:
        read(tmp_path / "m")
    assert str(caught.value) == (
        "m: found no pitch; expected m_pitch in a flight file (.dbd, .mbd, .sbd); 00010000.sbd: found no cache file "
        "616d8972.cac; expected it beside the data or in a folder 'cac'; "
        "copy it from the folder state/cache on the glider"
    )


def test_a_missing_dbdreader_names_the_extra(tmp_path, monkeypatch):
    write(tmp_path, "00010000.dbd", GOOD)
    monkeypatch.setitem(sys.modules, "dbdreader", None)
    with pytest.raises(InputError) as caught:
        read(tmp_path)
    assert str(caught.value) == "Slocum files: found no dbdreader to read them with; pip install 'seatrial[slocum]'"


# --- real gliders ---------------------------------------------------------------------------------------------


def test_comet_gives_the_ctd_of_the_published_series_sample_by_sample(data):
    published = np.load(data / "slocum/comet2016/flight_P_pitch_vb_rho_U.npy")
    ctd = read(data / "slocum/comet2016/raw").streams[1]
    assert ctd["time"].to_numpy().tolist() == published[0].tolist()
    np.testing.assert_allclose(ctd["pressure"], 10.0 * published[1], rtol=1e-12)


def test_comet_gives_pitch_and_engine_of_the_published_series(data):
    published = np.load(data / "slocum/comet2016/flight_P_pitch_vb_rho_U.npy")
    flight = read(data / "slocum/comet2016/raw").streams[0]
    pitch = np.interp(published[0], flight["time"], flight["pitch"])
    engine = np.interp(published[0], flight["time"], flight["buoyancy_volume"])
    scale, offset = np.polyfit(pitch, published[2], 1)
    assert scale == pytest.approx(0.86, abs=0.001)
    assert offset == pytest.approx(-0.004, abs=0.0003)
    assert np.nanmedian(np.abs(1e6 * engine - published[3])) < 0.5


def test_comet_agrees_with_raw_dbdreader_and_findings_are_few(data):
    import dbdreader

    folder = data / "slocum/comet2016/raw"
    logs = read(folder)
    raw = [dbdreader.DBD(str(path), str(folder)).get("m_pitch") for path in sorted(folder.glob("*.dbd"))]
    assert logs.streams[0]["time"].tolist() == np.concatenate([time for time, _ in raw]).tolist()
    assert logs.streams[0]["pitch"].tolist() == np.concatenate([value for _, value in raw]).tolist()
    assert [str(finding) for finding in logs.findings] == [
        "CTD: found 1 sample repeated or without a measurement; left out",
        "heading: found magnetic headings, variation 3.9° E; made true",
        "buoyancy engine: found m_ballast_pumped [cc] in use",
    ]
    assert logs.streams[0]["latitude"].dropna().between(54.74, 54.76).all()


def test_amadeus_uses_the_full_files_with_their_positions_valid(data, tmp_path):
    source = data / "slocum/misc"
    folder = linked(tmp_path, *source.glob("amadeus*"), source / "cac")
    flight, ctd = read(folder).streams
    assert (len(flight), len(ctd)) == (897, 1971)
    assert ctd["pressure"].max() == pytest.approx(40.74, abs=0.01)
    assert flight["latitude"].notna().sum() == 25
    assert flight["latitude"].max() < 55.0


def test_the_hard_files_of_misc_are_each_told_in_one_line(data, capfd):
    found = {
        finding.file: str(finding) for finding in read(data / "slocum/misc").findings if finding.severity == "error"
    }
    assert found == {
        "02450137.tcd": "02450137.tcd: found a first block that LZ4 cannot decode; expected compressed Slocum data; "
        "left out; copy the file again",
        "empty-2014-204-05-000.dbd": "empty-2014-204-05-000.dbd: found an empty file; expected Slocum data; "
        "left out; copy the file again",
        "hal_1002-2024-183-4-4.sbd": "hal_1002-2024-183-4-4.sbd: found no cache file 616d8972.cac; expected it beside "
        "the data or in a folder 'cac'; copy it from the folder state/cache on the glider",
        "invalid_encoding-2014-204-05-000.dbd": "invalid_encoding-2014-204-05-000.dbd: found encoding version 6; "
        "expected version 5; left out",
    }
    assert capfd.readouterr() == ("", "")


def test_the_deep_glider_loses_its_garbage_and_nothing_else(data, capfd):
    logs = read(data / "slocum/osu2025")
    flight, ctd = logs.streams
    told = [str(finding) for finding in logs.findings]
    assert told[:4] == [
        "01330000.dcd: and 7 more files: found another version of a segment; the fullest one is used",
        "01330005.ecd: byte 688168 of 692034: found a broken record after 8734 intact ones; "
        "the rest of the file is left out",
        "01330005.ecd: found 1 record with an impossible time; expected 1990 to 2100; left out",
        "01330013.ecd: and 1 more file: found no Slocum header; expected a file that begins with 'dbd_label'; "
        "left out; copy the file again",
    ]
    assert len(flight) == 2156 + 2202 + 2328 + 2187
    assert ctd["temperature"].between(5.0, 27.0).all()
    assert ctd["pressure"].between(0.0, 760.0).all()
    assert capfd.readouterr() == ("", "")


def test_the_thruster_burst_at_the_surface_can_be_seen(data):
    power = read(data / "slocum/osu2025").streams[0][["time", "propeller_power"]].dropna()
    assert power["propeller_power"].max() == pytest.approx(3.456, abs=1e-3)
    assert (power["propeller_power"] > 1.0).sum() == 6


def test_the_battery_voltage_of_a_slocum_is_that_of_the_flight_computer(data):
    voltage = read(data / "slocum/osu2025").streams[0]["battery_voltage"].dropna()
    # dbdreader by itself: m_battery of 01330000, 01330002, 01330005 and 01330013.dbd
    assert voltage.size == 1954 + 2014 + 2110 + 1988
    assert (voltage.min(), voltage.max()) == pytest.approx((13.859337, 15.357407), abs=1e-6)


def test_a_flight_only_mission_of_2008_takes_the_vehicles_pressure(data, tmp_path):
    source = data / "slocum/misc"
    folder = linked(tmp_path, source / "ammonite-2008-028-01-000.mbd", source / "cac")
    (flight,) = read(folder).streams
    assert flight["pressure"].max() == pytest.approx(608.4, abs=0.1)
    assert flight["buoyancy_volume"].max() == pytest.approx(273.4e-6, abs=1e-7)


def test_138_decimated_little_endian_files_make_one_mission(data):
    logs = read(data / "slocum/maria997")
    flight, ctd = logs.streams
    assert -gsw.z_from_p(ctd["pressure"].max(), 48.6) == pytest.approx(186.0, abs=1.0)
    assert ctd["time"].is_monotonic_increasing
    assert flight["pitch"].notna().sum() == 998


def test_files_of_several_gliders_are_doubted_by_name(tmp_path):
    mine = dbd(FLIGHT, [flight_row(0), flight_row(4)])
    write(tmp_path, "00010000.dbd", mine)
    write(tmp_path, "00020000.dbd", mine.replace(b"unit-2024-001-0-0", b"other-2024-002-0-0"))
    assert (
        f"{tmp_path.name}: found files of gliders named other, unit; expected one; "
        "if these are not names of one vehicle, give each a folder of its own"
    ) in [str(finding) for finding in read(tmp_path).findings]


RBR = {
    "sci_m_present_time": 8,
    "sci_water_pressure": 4,
    "sci_water_cond": 4,
    "sci_rbrctd_seapressure_00": 8,
    "sci_rbrctd_temperature_00": 8,
    "sci_rbrctd_conductivity_00": 8,
    "sci_rbrctd_timestamp": 8,
}


@pytest.mark.parametrize("zero", [True, False])
def test_an_rbr_ctd_is_read_where_the_sensors_of_the_others_are_silent(tmp_path, zero):
    write(tmp_path, "00010000.dbd", dbd(FLIGHT, FLIGHT_ROWS))
    rows = [
        {
            "sci_m_present_time": T0 + k,
            "sci_rbrctd_timestamp": T0 + k - 0.2,
            "sci_rbrctd_seapressure_00": 1.0 + k,
            "sci_rbrctd_temperature_00": 10.0,
            "sci_rbrctd_conductivity_00": 35.0,
        }
        | ({"sci_water_pressure": 0.0, "sci_water_cond": 0.0} if zero else {})
        for k in range(8)
    ]
    write(tmp_path, "00010000.ebd", dbd(RBR, rows))
    _, ctd = read(tmp_path).streams
    assert ctd["time"].tolist() == [T0 + k - 0.2 for k in range(1, 8)]
    np.testing.assert_allclose(ctd["pressure"], [1.0 + k for k in range(1, 8)])
    np.testing.assert_allclose(ctd["temperature"], 10.0)
    np.testing.assert_allclose(ctd["conductivity"], 3.5)
    names = "sci_rbrctd_conductivity_00, sci_rbrctd_seapressure_00, sci_rbrctd_temperature_00"
    assert f"CTD: found an RBR CTD: {names}; in use" in lines(tmp_path)

"""Plain tables: what is read, what is guessed, what is said about it, and what is refused."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.findings import InputError
from pipeline.ingest import adcp, fills, headers, recognise, table, times, units
from pipeline.mission import Mission, load

START = 1466553600.0  # 2016-06-22 00:00 UTC
YAML_P = "files: {a.csv: {columns: {pressure: {column: Druck P (dbar), unit: dbar}}}}\n"


@pytest.fixture
def make(tmp_path: Path) -> Callable[..., Mission]:
    """Return how to write files and mission.yaml into a folder."""

    def write(files: dict[str, str | bytes], yaml: str = "") -> Mission:
        for name, content in files.items():
            (tmp_path / name).write_bytes(content.encode() if isinstance(content, str) else content)
        (tmp_path / "mission.yaml").write_text("vehicle: petrel-ii\nlatitude: 45\n" + yaml, encoding="utf-8")
        return load(tmp_path)

    return write


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("Pressure (dbar)", "pressure", "dbar"),
        ("pres", "pressure", None),
        ("P", "pressure", None),
        ("p", None, None),
        ("p (dbar)", "pressure", "dbar"),
        ("depth_m", "depth", "m"),
        ("z", "depth", None),
        ("Pitch_deg", "pitch", "deg"),
        ("PitchDeg", "pitch", "deg"),
        ("pitch_rate_deg_s", "pitch_rate", "deg_s"),
        ("PitchRate [rad/s]", "pitch_rate", "rad/s"),
        ("Pitch rate (dps)", "pitch_rate", "dps"),
        ("eng_pitchAng", "pitch", None),
        ("rpm", "propeller_speed", "rpm"),
        ("unix_time", "time", None),
        ("time_unix_s", "time", "s"),
        ("datetime", "time", None),
        ("temp [°C]", "temperature", "°C"),
        ("T_degC", "temperature", "degc"),
        ("WaterTemperature", "temperature", None),
        ("conductivity_mS_cm", "conductivity", "ms_cm"),
        ("GPCTD_PRESSURE", "pressure", None),
        ("sci_water_pressure", "pressure", "bar"),
        ("speed_through_water_cm_s", "speed_through_water", "cm_s"),
        ("pressure_qc", "pressure_qc", None),
        ("PRES_QC", "pressure_qc", None),
        ("oxygen_qc", None, None),
        ("sci_rbrctd_seapressure_00", "pressure", None),
        ("sci_rbrctd_conductivity_00", "conductivity", None),
        ("sci_rbrctd_pressure_00", None, None),
        ("AHRS pitch (deg)", "pitch", "deg"),
        ("phi_deg", "roll", "deg"),
        ("psi", None, None),
        ("heading_true", "heading", None),
        ("battery_voltage [V]", "battery_voltage", "V"),
        ("Voltage", "battery_voltage", None),
        ("NAV_VOLTAGE", "battery_voltage", None),
        ("BatteryVoltage", "battery_voltage", None),
        ("batt_voltage_mV", "battery_voltage", "mv"),
        ("m_battery", "battery_voltage", None),
        ("battery [mm]", None, None),
        ("AD2CP_PRESSURE", "profiler_pressure", "dbar"),
        ("AD2CP_V1_CN1", "beam_fore", "m/s"),
        ("AD2CP_V1_CN2", None, None),
        ("AD2CP_PITCH", None, None),
        ("vel_over_ground_N", None, None),
        ("Pa", None, None),
        ("q", None, None),
        ("", None, None),
    ],
)
def test_headers_people_write_are_understood(header: str, name: str | None, unit: str | None) -> None:
    assert headers.quantity(header) == (name, unit)


@pytest.mark.parametrize(
    ("name", "value", "unit", "expected"),
    [
        ("pressure", 1.0, "bar", 10.0),
        ("pressure", 1013.25, "hPa", 10.1325),
        ("pressure", 1.0, "MPa", 100.0),
        ("pressure", 1.0, "kPa", 0.1),
        ("pressure", 1e4, "Pa", 1.0),
        ("pressure", 14.503773773, "psi", 10.0),
        ("pressure", 110.1325, "dbara", 100.0),
        ("pressure", 11.01325, "bara", 100.0),
        ("pressure", 14.6959488, "psia", 0.0),
        ("temperature", 283.15, "K", 10.0),
        ("temperature", 50.0, "°F", 10.0),
        ("conductivity", 42.914, "mS/cm", 4.2914),
        ("conductivity", 42914.0, "µS/cm", 4.2914),
        ("conductivity", 4.2914, "S m-1", 4.2914),
        ("pitch", 180.0, "deg", np.pi),
        ("pitch_rate", 180.0, "deg/s", np.pi),
        ("pitch_rate", 180.0, "°/s", np.pi),
        ("pitch_rate", 180.0, "-dps", -np.pi),
        ("pitch_rate", 0.5, "rad s-1", 0.5),
        ("pitch", 180.0, "-deg", -np.pi),
        ("pitch", 335.0, "deg", np.radians(-25.0)),
        ("pitch", 335.0, "-deg", np.radians(25.0)),
        ("pitch", 1000.0, "deg", np.radians(1000.0)),
        ("roll", 5.0, "rad", 5.0 - 2 * np.pi),
        ("propeller_speed", 780.0, "rpm", 13.0),
        ("propeller_speed", 13.0, "Hz", 13.0),
        ("buoyancy_volume", 230.0, "cc", 230e-6),
        ("buoyancy_volume", 0.23, "L", 230e-6),
        ("buoyancy_volume", 230.0, "cm³", 230e-6),
        ("battery_position", 1.0, "in", 0.0254),
        ("battery_position", 10.0, "mm", 0.01),
        ("speed_through_water", 35.0, "cm/s", 0.35),
        ("speed_through_water", 1.0, "kn", 0.514444444),
        ("propeller_power", 5.0, "W", 5.0),
        ("battery_voltage", 28.6, "Volts", 28.6),
        ("battery_voltage", 14250.0, "mV", 14.25),
        ("latitude", 5442.5, "ddmm", 54.7083333333),
        ("longitude", -12813.450, "nmea", -128.2241666667),
    ],
)
def test_units_are_converted_to_those_of_the_records(name: str, value: float, unit: str, expected: float) -> None:
    found = units.convert(np.array([value]), name, unit, "x.csv", "x")
    assert found[0] == pytest.approx(expected, rel=1e-9, abs=1e-6)


def test_an_unknown_unit_names_the_nearest() -> None:
    with pytest.raises(InputError) as error:
        units.convert(np.zeros(1), "pressure", "dbr", "ctd.csv", "P")
    assert str(error.value) == (
        "ctd.csv: column 'P': found unit 'dbr' for pressure; expected a unit of pressure; did you mean 'dbar'?"
    )


@pytest.mark.parametrize(
    ("name", "values", "unit"),
    [
        ("pitch", [-25.0, 25.0], "deg"),
        ("pitch", [-0.4, 0.4], "rad"),
        ("pitch_rate", [-2.0, 2.0], "deg/s"),
        ("pitch_rate", [-0.03, 0.03], "rad/s"),
        ("heading", [3.0, 350.0], "deg"),
        ("heading", [0.1, 6.2], "rad"),
        ("temperature", [283.0, 290.0], "k"),
        ("temperature", [48.0, 64.0], "degf"),
        ("conductivity", [42.0, 43.0], "ms/cm"),
        ("conductivity", [4.2, 4.3], "s/m"),
        ("conductivity", [42000.0], "us/cm"),
        ("buoyancy_volume", [-230.0, 230.0], "cm3"),
        ("buoyancy_volume", [-0.23, 0.23], "l"),
        ("buoyancy_volume", [-2.3e-4, 2.3e-4], "m3"),
        ("propeller_speed", [0.0, 780.0], "rpm"),
        ("propeller_speed", [0.0, 23.3], "rev/s"),
        ("battery_voltage", [14.2, 28.6], "v"),
        ("battery_voltage", [14200.0], "mv"),
        ("speed_through_water", [35.0], "cm/s"),
        ("latitude", [5442.5], "ddmm"),
        ("pressure", [500.0], "dbar"),
        ("pitch", [np.nan], "rad"),
    ],
)
def test_a_unit_is_guessed_by_the_range_of_the_values(name: str, values: list[float], unit: str) -> None:
    assert units.by_range(np.array(values), name) == unit


@pytest.mark.parametrize(
    ("text", "zone", "expected"),
    [
        ("2016-06-22T00:00:00Z", "UTC", START),
        ("2016-06-22 00:00:00", "UTC", START),
        ("2016-06-22T02:00:00+02:00", "America/New_York", START),
        ("2016-06-22 02:00:00", "Europe/Berlin", START),
        ("2016-06-22 00:00:00 UTC", "Europe/Berlin", START),
        ("2016-06-22T00:00:00.250", "UTC", START + 0.25),
        ("22/06/2016 00:00:01", "UTC", START + 1),
        ("06/22/2016 00:00", "UTC", START),
        ("06/22/2016 12:00:01 AM", "UTC", START + 1),
        ("22-06-2016 00:00:01", "UTC", START + 1),
        ("2.6.2016 00:00:01,5", "UTC", START - 20 * 86400 + 1.5),
        ("22-Jun-2016 00:00:01", "UTC", START + 1),
        ("2016/06/22 00:00:01", "UTC", START + 1),
        ("2016-06-22 02:00:00+02", "UTC", START),
        ("2016-06-22 02:00:00.5+02", "UTC", START + 0.5),
        ("nonsense", "UTC", np.nan),
    ],
)
def test_times_as_text_become_seconds_of_utc(text: str, zone: str, expected: float) -> None:
    found = times.textual(pd.Series([text, None], dtype="object"), None, zone, "x.csv", "time")
    assert found[0] == pytest.approx(expected, abs=1e-6, nan_ok=True)
    assert np.isnan(found[1])


def test_times_with_and_without_zone_may_stand_in_one_column() -> None:
    texts = pd.Series(["2016-06-22T00:00:00Z", "2016-06-22T02:00:01", "2016-06-22T01:00:02+01:00"])
    found = times.textual(texts, None, "Europe/Berlin", "x.csv", "time")
    assert found.tolist() == [START, START + 1, START + 2]


@pytest.mark.parametrize("dtype", ["object", "string"])
@pytest.mark.parametrize(
    "texts",
    [
        ["2016-06-22T00:00:00Z", None, "2016-06-22T00:00:00.250Z"],
        ["2016-06-22 02:00:00+02:00", "2016-06-21T23:59Z", "2016-06-22T00:00:00.123456789+0000"],
        [None, None],
    ],
)
def test_times_that_all_name_their_zone_are_read_at_once_and_come_out_the_same(
    texts: list[str | None], dtype: str
) -> None:
    found = times.zoned(pd.Series(texts, dtype=dtype), "UTC", "x.csv")
    assert found is not None
    assert np.array_equal(found, times.textual(pd.Series(texts, dtype="object"), None, "UTC", "x.csv", "time"), True)


@pytest.mark.parametrize("other", ["2016-06-22T00:00:00", "22/06/2016", "", "x", "2016-06-22T00:00:60Z", "1466553600"])
def test_times_of_any_other_kind_are_not_read_at_once(other: str) -> None:
    assert times.zoned(pd.Series(["2016-06-22T00:00:00Z", other]), "UTC", "x.csv") is None


@pytest.mark.parametrize("factor", [1.0, 1e3, 1e6, 1e9])
def test_numeric_times_are_seconds_milliseconds_or_finer_by_their_size(factor: float) -> None:
    assert times.numeric(np.array([START]) * factor, None, "x.csv", "time")[0] == pytest.approx(START)


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (736503.0, None, START),  # MATLAB: datestr(736503) is 22-Jun-2016
        (736503.25, "datenum", START + 21600.0),
        (2457561.5, None, START),  # USNO: 2016-06-22 00:00 is JD 2457561.5
        (5.198688e14, "microseconds since 2000-01-01", START),
        (519868800.0, "seconds since 2000-01-01T00:00:00Z", START),
        (24279.0, "days since 1950-01-01", START),
        (60.0, "minutes since 2016-06-22 01:00 +02:00", START),
    ],
)
def test_numeric_times_may_count_days_or_from_another_date(value: float, unit: str | None, expected: float) -> None:
    assert times.numeric(np.array([value]), unit, "x.csv", "time")[0] == pytest.approx(expected, abs=1e-3)


def test_an_unknown_unit_of_time_and_an_unknown_origin_are_refused() -> None:
    with pytest.raises(InputError) as error:
        times.numeric(np.zeros(1), "fortnights", "a.csv", "t")
    assert str(error.value).startswith(
        "a.csv: column 't': found unit 'fortnights' for time; expected s, ms, us, ns, datenum, julian, "
        "'days since 2000-01-01', iso or a format such as '%d/%m/%Y %H:%M:%S'; "
    )
    with pytest.raises(InputError) as error:
        times.numeric(np.zeros(1), "days since launch", "a.csv", "t")
    assert str(error.value) == (
        "a.csv: column 't': found times since 'launch'; expected times since a date in ISO 8601; "
        "correct its unit under files: … time: in mission.yaml"
    )


@given(st.integers(0, 2_100_000_000_000_000))
def test_a_time_written_to_the_microsecond_is_read_to_the_microsecond(micro: int) -> None:
    stamp = pd.Timestamp(micro * 1000, tz="UTC")
    found = times.textual(pd.Series([stamp.isoformat()]), None, "UTC", "x.csv", "time")
    assert found[0] == pytest.approx(micro * 1e-6, abs=5e-7)


@pytest.mark.parametrize("text", ["3014-01-01T00:00:00Z", "3014-01-01T00:00:00", "0001-01-01 00:00:00"])
def test_a_year_that_no_log_is_of_costs_its_record(text: str) -> None:
    found = times.textual(pd.Series(["2020-01-01T00:00:00", text]), None, "UTC", "ctd.csv", "time")
    assert found[0] == 1577836800.0
    assert np.isnan(found[1])


def test_day_and_month_that_cannot_be_told_apart_are_refused() -> None:
    with pytest.raises(InputError) as error:
        times.textual(pd.Series(["08/09/2020 17:45:56"]), None, "UTC", "gli.csv", "Timestamp")
    assert str(error.value) == (
        "gli.csv: column 'Timestamp': found '08/09/2020 17:45:56', where the day cannot be told from the month; "
        "expected ISO 8601, or the format given as unit; "
        "for day/month/year: files: {gli.csv: {time: {column: Timestamp, unit: '%d/%m/%Y %H:%M:%S'}}} in mission.yaml"
    )
    given_format = times.textual(pd.Series(["08/09/2020 17:45:56"]), "%d/%m/%Y %H:%M:%S", "UTC", "gli.csv", "t")
    assert given_format[0] == pd.Timestamp("2020-09-08T17:45:56Z").timestamp()


def test_times_that_count_from_the_start_are_refused() -> None:
    with pytest.raises(InputError) as error:
        times.numeric(np.arange(0.0, 3601.0), None, "ctd.csv", "t")
    assert str(error.value) == (
        "ctd.csv: column 't': found times from 0 to 3600 s; expected seconds since 1970-01-01 UTC or ISO 8601 text; "
        "say what they count from: files: {ctd.csv: {time: {column: t, unit: 'seconds since 2000-01-01'}}} "
        "in mission.yaml"
    )


@pytest.mark.parametrize("time", ["2016-06-22", "2016-06-22T00:00:00Z"])
def test_an_unknown_time_zone_names_the_nearest(make: Callable[..., Mission], time: str) -> None:
    mission = make({"a.csv": f"time,pitch\n{time},0.1\n"}, "files: {a.csv: {timezone: Europe/Berlim}}\n")
    with pytest.raises(InputError) as error:
        table.read(mission)
    assert str(error.value) == (
        "mission.yaml: files.a.csv.timezone: found 'Europe/Berlim'; expected an IANA time zone; "
        "did you mean 'Europe/Berlin'?"
    )


def test_guesses_and_ignored_columns_are_listed(make: Callable[..., Mission]) -> None:
    logs = table.read(
        make({"a.csv": f"Timestamp,Pitch,Heading (deg),rpm,Voltage,Altitude\n{START},-25,350,780,14,-1\n"})
    )
    (stream,) = logs.streams
    assert stream.to_dict("list") == {
        "time": [START],
        "pitch": [pytest.approx(np.radians(-25.0))],
        "heading": [pytest.approx(np.radians(350.0))],
        "propeller_speed": [pytest.approx(13.0)],
        "battery_voltage": [14.0],
    }
    assert [str(finding) for finding in logs.findings] == [
        "a.csv: found columns that are not read: Altitude",
        "a.csv: found guessed from header and range: 'Timestamp' is time, 'Pitch' is pitch in deg, "
        "'Heading (deg)' is heading in deg, 'rpm' is propeller_speed in rpm, 'Voltage' is battery_voltage in v",
    ]


def test_mission_yaml_decides_over_the_header(make: Callable[..., Mission]) -> None:
    yaml = """files:
  a.csv:
    time: {column: when, unit: ms}
    columns: {pressure: {column: depth, unit: bar}, pitch: {column: theta, unit: -deg}}
    ignore: [roll]
"""
    logs = table.read(make({"a.csv": f"when,depth,theta,roll\n{START * 1000:.0f},5,25,3\n"}, yaml))
    (stream,) = logs.streams
    assert stream.to_dict("list") == {"time": [START], "pressure": [50.0], "pitch": [pytest.approx(np.radians(-25.0))]}
    assert logs.findings == []


def test_a_depth_named_in_mission_yaml_keeps_a_pressure_from_being_guessed(make: Callable[..., Mission]) -> None:
    logs = table.read(make({"a.csv": f"time,z,P\n{START},9.9,0.03\n"}, "files: {a.csv: {columns: {depth: z}}}\n"))
    assert logs.streams[0]["pressure"][0] == pytest.approx(9.98, abs=0.02)
    assert str(logs.findings[0]) == "a.csv: found columns that are not read: P"


def test_a_date_and_a_time_of_day_in_columns_of_their_own_are_put_together(make: Callable[..., Mission]) -> None:
    text = "date,time,pitch (rad)\n22.06.2016,00:00:00,0.1\n22.06.2016,00:00:01.5,0.2\n"
    logs = table.read(make({"a.csv": text}))
    assert logs.streams[0]["time"].tolist() == [START, START + 1.5]
    assert str(logs.findings[0]) == (
        "a.csv: found guessed from header and range: 'date' and 'time' are time, 'pitch (rad)' is pitch in rad"
    )


@pytest.mark.parametrize(
    "text",
    [
        "date,time,P\n20160622,0,1\n20160622,1,1\n20160622,,1\n20160622,123456,1\n",
        "date,time,P\n20160622,000000,1\n20160622,000001,1\n,5,1\n20160622,123456,1\n",
        "date,time,P\n20160622,00:00:00,1\n20160622,00:00:01,1\n20160622,,1\n20160622,12:34:56,1\n",
    ],
    ids=["numbers", "padded numbers", "a clock"],
)
def test_a_day_run_together_has_its_time_of_day_beside_it(make: Callable[..., Mission], text: str) -> None:
    time = table.read(make({"a.csv": text})).streams[0]["time"]
    assert time.dropna().tolist() == [START, START + 1.0, START + 45296.0]


def test_a_day_that_is_none_is_not_put_together(make: Callable[..., Mission]) -> None:
    for day, hour in (("20161322", "0"), ("20160622", "6000")):
        with pytest.raises(InputError, match=r"a.csv: .*found times from 2.016\d*e\+07"):
            table.read(make({"a.csv": f"date,time,P\n{day},{hour},1\n{day},{hour},1\n"}))


def test_the_format_of_a_date_may_be_told_with_the_time_of_day_in_another_column(make: Callable[..., Mission]) -> None:
    text = "day,time,pitch (rad)\n6/2/2016,00:00:01,0.1\n6/2/2016,00:00:02,0.1\n"
    mission = make({"a.csv": text}, "files: {a.csv: {time: {column: day, unit: '%m/%d/%Y'}}}\n")
    assert table.read(mission).streams[0]["time"].tolist() == [START - 20 * 86400 + 1, START - 20 * 86400 + 2]


def test_rows_of_two_computers_have_the_time_of_their_own(make: Callable[..., Mission]) -> None:
    text = (
        f"m_present_time,sci_m_present_time,m_pitch,sci_water_pressure\n{START},NaN,-0.4,NaN\nNaN,{START + 1},NaN,2\n"
    )
    logs = table.read(make({"a.csv": text}))
    assert logs.streams[0]["time"].tolist() == [START, START + 1]
    assert logs.streams[0]["pressure"].tolist()[1] == 20.0
    assert "'sci_m_present_time' is time where 'm_present_time' has none" in str(logs.findings[0])


def test_texts_that_are_no_time_are_shown(make: Callable[..., Mission]) -> None:
    def told(first: str) -> str:
        return str(table.read(make({"a.csv": f"time,pitch (rad)\n{first},0.1\n{first},0.1\n"})).findings[0])

    assert told("00:00:01") == (
        "a.csv: column 'time': found times of day without a date, first '00:00:01'; expected a date with each, or in a "
        "column beside it; those records are left out"
    )
    for first, example in (("2016/174 00:00:01", "%d/%m/%Y %H:%M:%S"), ("2016/174 1:00:01PM", "%d/%m/%Y %I:%M:%S %p")):
        assert told(first) == (
            f"a.csv: column 'time': found 2 of 2 texts that are no time, first '{first}'; "
            "expected ISO 8601, a date and a time of day, or the format given as unit; "
            "those records are left out; if it is another format, "
            f"files: {{a.csv: {{time: {{column: time, unit: '{example}'}}}}}} in mission.yaml says which"
        )


def test_a_file_whose_clock_was_set_back_to_1970_costs_that_file(make: Callable[..., Mission]) -> None:
    text = "time,pitch (rad)\n{},0.1\n{},0.2\n"
    logs = table.read(make({"a.csv": text.format(START, START + 1), "b.csv": text.format(30, 31)}))
    assert len(logs.streams) == 1
    assert str(logs.findings[1]) == (
        "b.csv: column 'time': found times from 30 to 31 s; expected seconds since 1970-01-01 UTC or ISO 8601 text; "
        "file left out; say what they count from: "
        "files: {b.csv: {time: {column: time, unit: 'seconds since 2000-01-01'}}} in mission.yaml"
    )


@pytest.mark.parametrize(("idle", "what"), [("0", "that never changes"), ("NaN", "without a value")])
def test_of_two_columns_for_one_quantity_the_one_that_changes_is_taken(
    make: Callable[..., Mission], idle: str, what: str
) -> None:
    text = f"time,m_ballast_pumped,m_de_oil_vol\n{START},{idle},-230\n{START + 8},{idle},230\n"
    logs = table.read(make({"a.csv": text}))
    np.testing.assert_allclose(logs.streams[0]["buoyancy_volume"], [-230e-6, 230e-6])
    assert str(logs.findings[0]) == (
        f"a.csv: column 'm_ballast_pumped': found a second column for buoyancy_volume, {what}; expected one; "
        "'m_de_oil_vol' is taken; if that is wrong, name the right one under files: in mission.yaml"
    )


def test_of_two_columns_of_one_name_the_one_that_changes_is_taken(make: Callable[..., Mission]) -> None:
    (stream,) = table.read(make({"a.csv": f"time,P,P\n{START},0,5.5\n{START + 1},0,6\n"})).streams
    assert stream["pressure"].tolist() == [5.5, 6.0]


def test_fixes_go_before_dead_reckoned_positions_and_the_pressure_of_the_ctd_before_another(
    make: Callable[..., Mission],
) -> None:
    text = (
        "time,m_lat,m_gps_lat,m_lon,m_gps_lon,m_pressure,sci_water_pressure,sci_water_cond\n"
        f"{START},1.5,1.25,2.5,2.25,0.5,NaN,NaN\n{START + 1},1.6,1.26,2.6,2.26,NaN,0.6,4\n"
        f"{START + 2},1.7,NaN,2.7,NaN,0.7,0.8,4\n"
    )
    (stream,) = table.read(make({"a.csv": text})).streams
    np.testing.assert_array_equal(stream["latitude"], [1.25, 1.26, np.nan])
    np.testing.assert_array_equal(stream["longitude"], [2.25, 2.26, np.nan])
    np.testing.assert_array_equal(stream["pressure"], [np.nan, 6.0, 8.0])


def test_degrees_and_minutes_run_together_in_one_of_a_position_are_so_in_both(make: Callable[..., Mission]) -> None:
    (stream,) = table.read(make({"gps.csv": f"time,lat,lon\n{START},-42.0,-3130.0\n{START + 1},5442,330\n"})).streams
    np.testing.assert_allclose(stream["latitude"], [-0.7, 54.7])
    np.testing.assert_allclose(stream["longitude"], [-31.5, 3.5])


def test_the_pressure_of_the_sea_goes_before_another(make: Callable[..., Mission]) -> None:
    (stream,) = table.read(
        make({"a.csv": f"time,Pressure,Sea pressure\n{START},10.2,0.1\n{START + 1},11.2,1.1\n"})
    ).streams
    assert stream["pressure"].tolist() == [0.1, 1.1]


def test_fill_values_are_no_measurements_and_do_not_decide_units(make: Callable[..., Mission]) -> None:
    rows = "".join(f"{START + 2 * k},{0.01 * k},-999\n{START + 2 * k + 1},-9999,{10 * k - 30}\n" for k in range(7))
    logs = table.read(make({"a.csv": f"time,pitch,ballast\n{rows}"}))
    (stream,) = logs.streams
    assert np.nanmax(stream["pitch"]) == 0.06
    assert stream["buoyancy_volume"].min() == pytest.approx(-30e-6)
    assert stream["pitch"].isna().sum() == stream["buoyancy_volume"].isna().sum() == 7
    assert str(logs.findings[0]) == (
        "a.csv: found the fill value -9999 in 'pitch'; -999 in 'ballast'; expected measurements; taken for not measured"
    )


def test_fill_values_of_four_bytes_and_short_ones_far_from_the_rest_are_known() -> None:
    single = np.array([-9999.9, -999.9, 4.0, 5.0], dtype=np.float32).astype(np.float64)
    assert fills.fills(single).tolist() == [True, True, False, False]
    assert fills.fills(np.array([-99.99, -20.0, 20.0])).tolist() == [True, False, False]
    assert fills.fills(np.array([-99.99, -100.0, -98.0])).tolist() == [False, False, False]


def test_what_a_name_without_its_prefix_would_be_taken_for_is_not_read() -> None:
    for name in ("m_gps_heading", "gps_course", "m_vehicle_temp", "m_water_depth", "water_depth"):
        assert headers.quantity(name) == (None, None), name
    assert headers.quantity("m_heading")[0] == "heading"
    assert headers.quantity("m_gps_lat.lat") == ("latitude", "lat")
    assert headers.quantity("m_present_time.timestamp")[0] == "time"
    assert headers.quantity("LEGATO_CONDUCTIVITY") == ("conductivity", "mS/cm")


def test_of_two_columns_the_one_of_the_ctd_and_the_precise_clock_are_taken(make: Callable[..., Mission]) -> None:
    rows = "".join(f"{START},{START + k},{4.5 + 0.01 * k},{3.5 + 0.01 * k},{0.1 * k}\n" for k in range(4))
    (stream,) = table.read(
        make({"a.csv": f"time,precise_time,m_water_cond,sci_water_cond,sci_water_pressure\n{rows}"})
    ).streams
    assert stream["time"].tolist() == (START + ROWS).tolist()
    np.testing.assert_allclose(stream["conductivity"], 3.5 + 0.01 * ROWS)


def test_a_ctd_that_sleeps_in_a_table_of_two_computers_lends_its_pressure_to_density_alone(
    make: Callable[..., Mission],
) -> None:
    rows = [f"{START + 2 * k},{k / 10},,,0.1" for k in range(400)]
    rows += [f"{START + 2 * k + 1},,{k / 10},{4.0 + 1e-4 * k:.4f}," for k in range(200)]
    logs = table.read(
        make({"a.csv": "m_present_time,m_pressure,sci_water_pressure,sci_water_cond,m_pitch\n" + "\n".join(rows)})
    )
    (stream,) = logs.streams
    assert stream["pressure"].notna().sum() == 400
    assert stream["pressure_interpolated"].notna().sum() == 200
    np.testing.assert_allclose(stream["pressure_interpolated"].dropna(), np.arange(200.0), atol=1e-9)


def test_positions_that_the_vehicle_reckoned_are_no_fixes(make: Callable[..., Mission]) -> None:
    text = "time,pitch,latitude,longitude,DeadReckoning\n" + "".join(
        f"{START + k},0.1,45.0,10.0,{int(k > 1)}\n" for k in range(5)
    )
    payload = f"time,depth,NAV_LATITUDE,NAV_LONGITUDE\n{START},1,45,10\n{START + 1},2,45,10\n"
    logs = table.read(make({"a.csv": text, "b.csv": payload}))
    attitude, ctd = sorted(logs.streams, key=lambda stream: "depth" in stream)
    assert attitude["latitude_qc"].tolist() == attitude["longitude_qc"].tolist() == [0, 0, 4, 4, 4]
    assert ctd["latitude_qc"].tolist() == [4, 4]
    said = "a.csv: found 3 positions by dead reckoning; expected fixes; flagged bad"
    assert said in [str(finding) for finding in logs.findings]


@pytest.mark.parametrize(
    ("header", "text"),
    [
        ("Date (dd/mm/yyyy)", "05/06/2023 07:08:09"),
        ("Date [mm/dd/yyyy]", "06/05/2023 07:08:09"),
        ("Time (dd-mm-yyyy hh:mm:ss)", "05-06-2023 07:08:09"),
        ("Date (dd.mm.yy)", "05.06.23 07:08"),
    ],
)
def test_a_layout_of_dates_in_the_header_is_used(make: Callable[..., Mission], header: str, text: str) -> None:
    (stream,) = table.read(make({"a.csv": f"{header},pitch_deg\n{text},20\n{text[:-1]}9,21\n"})).streams
    expected = pd.Timestamp("2023-06-05T07:08:09Z" if text.count(":") == 2 else "2023-06-05T07:08:00Z")
    assert stream["time"].iloc[0] == expected.timestamp()


def test_layouts_that_are_none_stay_as_they_are() -> None:
    for unit in ("s", "UTC", "days since 1950-01-01", "yyyy-mm-dd hh:mm:ss", "mm", "hh:mm:ss", "%d/%m/%Y"):
        assert times.as_format(unit) == unit
    assert times.as_format("dd/mm/yyyy hh:mm:ss") == "%d/%m/%Y %H:%M:%S"


def test_seconds_since_1900_are_told_by_their_size() -> None:
    since_1900 = np.array([3745594521.77, 3745594522.77])
    found = times.numeric(since_1900, None, "a.csv", "time")
    assert pd.Timestamp(found[0], unit="s").year == 2018
    np.testing.assert_allclose(found, since_1900 - 2208988800.0)
    np.testing.assert_allclose(times.numeric(np.array([1.7e9]), None, "a.csv", "time"), 1.7e9)


def test_a_table_of_r_has_one_header_less_than_fields(make: Callable[..., Mission]) -> None:
    rows = "".join(f'"{k + 1}" {START + k} {0.1 * k} 0.2\n' for k in range(5))
    (stream,) = table.read(make({"a.txt": f'"time" "pressure" "pitch"\n{rows}'})).streams
    assert stream["time"].tolist() == [START + k for k in range(5)]
    np.testing.assert_allclose(stream["pressure"], 0.1 * np.arange(5))
    assert stream["pitch"].tolist() == [0.2] * 5


@pytest.mark.parametrize(
    ("name", "unit"),
    [("pitch", "arc_degree"), ("heading", "degrees_true"), ("conductivity", "S m^{-1}"),
     ("conductivity", "siemens_per_meter"), ("conductivity", "millisiemens/cm")],
)  # fmt: skip
def test_more_spellings_of_units(name: str, unit: str) -> None:
    assert units.known(name, unit)


def test_a_number_like_a_fill_value_within_the_range_of_the_others_is_a_measurement() -> None:
    values = np.array([-1200.0, -999.0, 300.0, 9999.0, np.nan, 1e20])
    assert fills.fills(values).tolist() == [False, False, False, True, False, True]
    assert fills.fills(np.full(2, -999.0)).all()


def test_names_that_other_quantities_have_too_are_believed_with_a_unit_that_fits() -> None:
    assert headers.quantity("theta") == headers.quantity("theta (degC)") == (None, None)
    assert headers.quantity("theta (deg)") == headers.quantity("theta_deg") == ("pitch", "deg")
    assert headers.quantity("buoyancy") == headers.quantity("Buoyancy [g]") == (None, None)
    assert headers.quantity("Buoyancy [cc]") == ("buoyancy_volume", "cc")


def test_a_depth_that_is_positive_up_is_turned_and_told_and_refused_where_mission_yaml_states_the_unit(
    make: Callable[..., Mission],
) -> None:
    rows = "".join(f"{START + k},{-10 * k}\n" for k in range(4))
    for header, unit in (("z", "-m"), ("z (m)", "-m"), ("z (cm)", "-cm")):
        logs = table.read(make({"a.csv": f"time,{header}\n{rows}"}))
        deepest = 0.3024 if "cm" in unit else 30.24
        assert logs.streams[0]["pressure"].iloc[-1] == pytest.approx(deepest, rel=1e-3)
        assert any(f"'{header}' is depth in {unit}" in str(finding) for finding in logs.findings)
    yaml = "files: {a.csv: {columns: {depth: {column: z, unit: m}}}}\n"
    with pytest.raises(InputError) as error:
        table.read(make({"a.csv": f"time,z\n{rows}"}, yaml))
    assert str(error.value) == (
        "a.csv: column 'z': found depth from -30 to 0 m; expected depth positive down; "
        "give its unit with a minus sign (-m) under files: in mission.yaml"
    )


CHINESE = (
    "时间,深度（米）,俯仰角(°),横滚角,航向角(度),温度(℃),油量(毫升),推进器转速(转/分),纬度,经度\n"
    f"{START},10,-20,1,90,20,100,300,18,112\n"
)


@pytest.mark.parametrize("encoding", ["utf-8", "gb18030", "gbk"])
def test_chinese_headers_are_understood_in_either_encoding(make: Callable[..., Mission], encoding: str) -> None:
    (stream,) = table.read(make({"a.csv": CHINESE.replace("℃", "°C").encode(encoding)})).streams
    row = stream.iloc[0]
    assert row["pressure"] == pytest.approx(10.08, abs=0.02)
    np.testing.assert_allclose(row[["pitch", "heading"]].astype(float), np.radians([-20.0, 90.0]))
    assert row[["temperature", "latitude", "longitude"]].tolist() == [20.0, 18.0, 112.0]
    np.testing.assert_allclose(row[["buoyancy_volume", "propeller_speed"]].astype(float), [1e-4, 5.0])


def test_a_degree_sign_before_a_letter_is_no_chinese(make: Callable[..., Mission]) -> None:
    text = f"time,T (°C),pitch (°),Größe,Länge über alles\n{START},20,10,1,1\n"
    (stream,) = table.read(make({"a.csv": text.encode("latin-1")})).streams
    assert stream["temperature"].tolist() == [20.0]


@pytest.mark.parametrize(
    ("name", "spelt", "unit"),
    [
        ("temperature", "ITS-90, deg C", "degc"),
        ("temperature", "℃", "degc"),
        ("conductivity", "mmho/cm", "ms/cm"),
        ("conductivity", "S.m-1", "s/m"),
        ("conductivity", "Siemens/m", "s/m"),
        ("latitude", "ddmm.mmmm", "ddmm"),
        ("longitude", "deg E", "deg"),
        ("propeller_speed", "1/min", "rpm"),
        ("speed_through_water", "mm/s", "mm/s"),
        ("pressure", "dbars", "dbar"),
    ],
)
def test_units_people_write_are_understood(name: str, spelt: str, unit: str) -> None:
    assert units.spelling(spelt) == unit
    assert units.known(name, spelt)


def test_depth_serves_where_the_column_of_pressure_is_empty(make: Callable[..., Mission]) -> None:
    (stream,) = table.read(make({"a.csv": f"time,pressure,depth\n{START},NaN,9.9\n"})).streams
    assert stream["pressure"].tolist() == [pytest.approx(9.98, abs=0.02)]


def test_a_column_that_is_not_there_names_the_nearest(make: Callable[..., Mission]) -> None:
    mission = make({"a.csv": f"time,Pitch\n{START},1\n"}, "files: {a.csv: {columns: {pitch: Pich}}}\n")
    with pytest.raises(InputError) as error:
        table.read(mission)
    assert str(error.value) == (
        "a.csv: column 'Pich': found no such column among 'time', 'Pitch'; "
        "expected the column that mission.yaml names for pitch; did you mean 'Pitch'?"
    )


def test_an_unknown_quantity_names_the_nearest(make: Callable[..., Mission]) -> None:
    mission = make({"a.csv": f"time,Pitch\n{START},1\n"}, "files: {a.csv: {columns: {pich: Pitch}}}\n")
    with pytest.raises(InputError) as error:
        table.read(mission)
    assert str(error.value) == (
        "mission.yaml: files.a.csv.columns.pich: found an unknown quantity; did you mean 'pitch'?"
    )


def test_a_file_that_is_not_there_names_the_nearest(make: Callable[..., Mission]) -> None:
    mission = make({"ctd.csv": f"time,P\n{START},1\n"}, "files: {cdt.csv: {}}\n")
    with pytest.raises(InputError) as error:
        table.read(mission)
    assert str(error.value) == (
        "mission.yaml: files.cdt.csv: found no such file; expected a file in the mission's folder; "
        "did you mean 'ctd.csv'?"
    )


def test_an_unknown_unit_in_a_header_costs_that_column(make: Callable[..., Mission]) -> None:
    logs = table.read(make({"a.csv": f"time,pressure (counts),pitch (deg)\n{START},8000,1\n"}))
    assert list(logs.streams[0].columns) == ["time", "pitch"]
    assert str(logs.findings[0]) == (
        "a.csv: column 'pressure (counts)': found unit 'counts' for pressure; expected a unit of pressure; "
        "column left out; known: bar, bara, dbar, dbara, hpa, kpa, mbar, mpa, pa, psi, psia"
    )


@pytest.mark.parametrize(
    ("content", "line"),
    [
        ("", "a.csv: found an empty file; expected a header line and records; file left out; copy it again"),
        (
            b"\x00\x01\x02",
            "a.csv: found no text; expected a header line and records; file left out; write it as CSV",
        ),
        (
            b"\x1f\x8bgarbage" * 9,
            "a.csv: found a file that cannot be read (Unknown compression method); "
            "expected a header line and records; file left out; copy it again",
        ),
        (
            f"{START},0.1\n",
            "a.csv: found numbers without a header; expected a header line and records; "
            "file left out; add a first line that names the columns",
        ),
        ("# a\n# b\n", "a.csv: found nothing but comments; expected a header line and records; file left out"),
        (
            "deployed at noon\nall well here\n",
            "a.csv: found nothing that is known among the columns 'deployed', 'at', 'noon'; expected a time and "
            "measurements; file left out; if it is a log, name its columns under files: a.csv: in mission.yaml",
        ),
        ("time,pitch\n", "a.csv: found a header and no records; expected records; file left out"),
        (
            "clock,pitch\n1,2\n",
            "a.csv: found no time among the columns 'clock', 'pitch'; expected a time column; "
            "file left out; name it under files: a.csv: time: in mission.yaml",
        ),
        (
            "time,volts\n1,2\n",
            "a.csv: found nothing but time known among the columns 'time', 'volts'; expected a measurement; "
            "file left out; name columns under files: a.csv: columns: in mission.yaml",
        ),
    ],
)
def test_a_file_that_is_no_table_costs_that_file(make: Callable[..., Mission], content: str | bytes, line: str) -> None:
    logs = table.read(make({"a.csv": content, "b.csv": f"time,pitch (rad)\n{START},0.1\n"}))
    assert len(logs.streams) == 1
    assert line in [str(finding) for finding in logs.findings]


def test_broken_lines_and_fields_cost_those_and_are_counted(make: Callable[..., Mission]) -> None:
    text = f"time,pitch (rad)\n{START},0.1\n{START + 1}\n{START + 2},0.2,7\n{START + 3},x\n{START + 4},\n"
    logs = table.read(make({"a.csv": text}))
    np.testing.assert_array_equal(logs.streams[0]["pitch"], [0.1, np.nan, np.nan])
    assert [str(finding) for finding in logs.findings[:2]] == [
        "a.csv: found 2 lines with a wrong number of fields, first line 3; "
        "expected one number or time in each field; those were left out",
        "a.csv: found 1 of 3 fields of column 'pitch (rad)' that are no number, first 'x'; "
        "expected one number or time in each field; those were left out",
    ]


@pytest.mark.parametrize(
    "text",
    [
        "time;P;\n1466553600;5.5;\n1466553601;;\n",
        "time\tP\n1466553600\t5.5\n1466553601\t\n",
        "\ufeff# made by a logger\n# in the field\ntime,P\n1466553600,5.5\n1466553601,NaN\n",
        "time,P\nUTC,dbar\n1466553600,5.5\n1466553601,\n",
        "time;P\n1466553600;5,5\n1466553601;\n",
        "time   P\n1466553600  5.5\n1466553601  nan\n",
        '"time","P"\r\n"1466553600","5.5"\r\n"1466553601",""\r\n',
        "time|P\n2016-06-22T00:00:00Z|5.5\n2016-06-22T00:00:01Z|\n",
        "% logger 7\nOperator: us\n\ntime,P\n1466553600,5.5\n1466553601,\n",
        "#time,P\n1466553600,5.5\n1466553601,\n",
        "trajectory,time,P,salinity\n,UTC,dbar,1\nru29,2016-06-22T00:00:00Z,5.5,35\nru29,2016-06-22T00:00:01Z,NaN,35\n",
        "time,P\n(UTC),(bar)\n1466553600,0.55\n1466553601,\n",
        "time,P,state\nUTC,bar,-\n1466553600,0.55,1\n1466553601,,1\n",
        "time,P\rUTC,dbar\r1466553600,5.5\r1466553601,\r",
    ],
)
def test_separator_decimal_mark_comments_and_unit_lines_are_found_out(make: Callable[..., Mission], text: str) -> None:
    (stream,) = table.read(make({"a.csv": text})).streams
    assert stream["time"].tolist() == [START, START + 1]
    np.testing.assert_array_equal(stream["pressure"], [5.5, np.nan])


def test_a_decimal_comma_is_seen_below_a_first_record_of_whole_numbers(make: Callable[..., Mission]) -> None:
    text = f"time;P\n{START:.0f};0\n{START + 1:.0f};0,25\n{START + 2:.0f};-12,5\n"
    assert table.read(make({"a.csv": text})).streams[0]["pressure"].tolist() == [0.0, 0.25, -12.5]


def test_numbers_in_each_others_countries_writing_are_read_and_told(make: Callable[..., Mission]) -> None:
    text = (
        "time;P (mbar);T (°C);C\n"
        f'{START:,.1f};12.5;"10,25";3.5\n{START + 1:,.1f};1,074.7;"9,5";3.6\n{START + 2:,.1f};"10 500";"n/a";3.7\n'
    )
    logs = table.read(make({"a.csv": text}))
    (stream,) = logs.streams
    assert stream["time"].tolist() == [START, START + 1, START + 2]
    np.testing.assert_allclose(stream["pressure"], [0.125, 10.747, 105.0])
    np.testing.assert_array_equal(stream["temperature"], [10.25, 9.5, np.nan])
    assert [str(finding) for finding in logs.findings[:3]] == [
        "a.csv: column 'time': found thousands set apart, first '1,466,553,600.0'",
        "a.csv: column 'P (mbar)': found thousands set apart, first '1,074.7'",
        "a.csv: column 'T (°C)': found a decimal comma",
    ]


def test_times_with_a_decimal_comma_are_numbers(make: Callable[..., Mission]) -> None:
    text = f"time;P\n{START:.0f},0;5,5\n{START + 1:.0f},25;6,5\n"
    assert table.read(make({"a.csv": text})).streams[0]["time"].tolist() == [START, START + 1.25]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_text_in_utf_16_is_read(make: Callable[..., Mission], end: str) -> None:
    text = end.join(["time\ttemp (°C)", f"{START:.0f}\t10.5", f"{START + 1:.0f}\tx", ""])
    stream = table.read(make({"a.txt": text.encode("utf-16")})).streams[0]
    np.testing.assert_array_equal(stream["temperature"], [10.5, np.nan])


@pytest.mark.parametrize("name", ["unit-2024-100-0-0.dbdasc", "unit.dba", "unit.asc", "unit.txt"])
def test_an_ascii_table_of_the_slocum_tools_is_a_plain_table(make: Callable[..., Mission], name: str) -> None:
    head = "dbd_label: DBD_ASC(dinkum_binary_data_ascii)file\nnum_ascii_tags: 14\nmission_name: YO.MI\n"
    body = (
        "m_present_time m_pitch m_ballast_pumped m_gps_lat sci_water_pressure \ntimestamp rad cc lat bar \n8 4 4 8 4 \n"
    )
    rows = f"{START} -0.45 -230 5442.5 NaN \n{START + 4} NaN NaN NaN 1.5 \n"
    mission = make({name: head + body + rows})
    assert recognise(mission) == "table"
    (stream,) = table.read(mission).streams
    assert stream["time"].tolist() == [START, START + 4]
    np.testing.assert_allclose(stream["pitch"], [-0.45, np.nan])
    np.testing.assert_allclose(stream["buoyancy_volume"], [-230e-6, np.nan])
    np.testing.assert_allclose(stream["latitude"], [54.0 + 42.5 / 60, np.nan])
    np.testing.assert_allclose(stream["pressure"], [np.nan, 15.0])


@pytest.mark.parametrize("name", ["sea063.22.gli.sub.120.gz", "sea063.22.pld1.raw.7", "SEA046.GLI.SUB.ALL.gz"])
def test_files_of_a_seaexplorer_are_plain_tables_by_their_names(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    assert table.recognises(tmp_path / name)


def test_dates_of_a_seaexplorer_have_the_day_first(make: Callable[..., Mission]) -> None:
    text = "Timestamp;Pitch;\n08/09/2020 17:45:56;-25.5;\n08/09/2020 17:46:16;-25.1;\n"
    (stream,) = table.read(make({"sea063.22.gli.sub.1.gz": gzip.compress(text.encode())})).streams
    assert stream["time"].iloc[0] == pd.Timestamp("2020-09-08T17:45:56Z").timestamp()


def test_seaexplorer_logs_need_no_mapping(data: Path, make: Callable[..., Mission]) -> None:
    files = {path.name: path.read_bytes() for path in sorted((data / "seaexplorer/sea063_ad2cp").glob("*.gz"))}
    attitude, _, ctd = table.read(make(files)).streams
    assert (len(attitude), len(ctd)) == (271, 164)
    assert attitude["time"].iloc[0] == pd.Timestamp("2021-08-23T23:22:20Z").timestamp()
    assert ctd["conductivity"].median() == pytest.approx(1.5, abs=1.0)  # the Baltic: 8 to 20 mS/cm
    assert "speed_through_water" not in ctd


def test_a_quoted_field_may_hold_the_separator_and_broken_lines_are_named_by_their_place(
    make: Callable[..., Mission],
) -> None:
    text = f'# log\ntime,"comment, free",P\n{START},"a, b",5.5\n{START + 1},6.5\n'
    logs = table.read(make({"a.csv": text}))
    assert logs.streams[0]["pressure"].tolist() == [5.5]
    assert logs.findings[1].found == "1 line with a wrong number of fields, first line 4"


def test_latin_letters_in_a_header_do_no_harm(make: Callable[..., Mission]) -> None:
    text = f"time,temp (°C)\n{START},10.5\n".encode("latin-1")
    assert table.read(make({"a.csv": text})).streams[0]["temperature"].tolist() == [10.5]


def test_gzip_is_seen_through_and_a_truncated_one_gives_what_it_holds(make: Callable[..., Mission]) -> None:
    rows = "".join(f"{START + k},{np.sin(k):.12f}\n" for k in range(5000))
    packed = gzip.compress(b"time,pitch (rad)\n" + rows.encode())
    whole = table.read(make({"a.csv.gz": packed}))
    assert len(whole.streams[0]) == 5000
    part = table.read(make({"a.csv.gz": packed[: len(packed) // 2]}))
    assert 1000 < len(part.streams[0]) < 4000
    assert part.findings[0].found.startswith("a file cut short (")
    assert part.findings[0].remedy == f"its first {len(part.streams[0])} records are used; copy it again"
    begun = table.read(make({"a.csv.gz": packed[:2000]}))
    assert 10 < len(begun.streams[0]) < 1000


def test_parquet_is_read_with_its_own_units_and_zones(make: Callable[..., Mission], tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    frame = pd.DataFrame({"time": pd.to_datetime([START, START + 1], unit="s", utc=True), "P": [1.0, 2.0]})
    whole = pa.Table.from_pandas(frame)
    fields = [whole.schema.field("time"), whole.schema.field("P").with_metadata({"unit": "bar"})]
    pq.write_table(whole.cast(pa.schema(fields)), tmp_path / "ctd.parquet")
    (stream,) = table.read(make({})).streams
    assert stream["time"].tolist() == [START, START + 1]
    assert stream["pressure"].tolist() == [10.0, 20.0]


BEAMS = "PLD_REALTIMECLOCK;LEGATO_PRESSURE;AD2CP_TIME;AD2CP_HEADING;AD2CP_PITCH;AD2CP_PRESSURE;" + ";".join(
    f"AD2CP_V{k}_CN{cell}" for cell in (1, 2) for k in (1, 2, 3, 4)
)


def _row(second: int, speed: float, side: float = 0.02, pressure: float = 50.0) -> str:
    """Return a record of a SeaExplorer that moves forward through still water and sinks through it."""
    along, across = speed * np.sin(np.radians(47.5)), np.cos(np.radians(25.0))
    normal = side / across
    beams = [normal * np.cos(np.radians(47.5)) - along, side, normal * np.cos(np.radians(47.5)) + along, side]
    values = ";".join(f"{value:.6f}" for value in beams * 2)
    return f"23/08/2021 23:23:{second + 9:02d}.500;{pressure};082321 23:23:{second:02d};240;-16;{pressure};{values}\n"


def test_the_beams_of_a_profiler_are_a_speed_sensor_on_its_own_clock(make: Callable[..., Mission]) -> None:
    rows = _row(0, 0.35) + _row(10, 0.30) + _row(20, 0.25, pressure=3.0)
    rows += "23/08/2021 23:23:40.500;50;082321 23:23:31;" + ";".join(["9999.0"] * 11) + "\n"
    logs = table.read(make({"sea063.22.pld1.sub.120": f"{BEAMS}\n{rows}"}))
    streams = {tuple(stream.columns): stream for stream in logs.streams}
    sensor = streams["time", "speed_through_water", "speed_through_water_std", "speed_through_water_qc"]
    first = pd.Timestamp("2021-08-23T23:23:00Z").timestamp()
    assert sensor["time"].tolist() == [first, first + 10.0, first + 20.0, first + 31.0]
    upward = 0.02 / np.cos(np.radians(25.0))
    np.testing.assert_allclose(sensor["speed_through_water"][:3], np.hypot([0.35, 0.30, 0.25], upward), rtol=1e-5)
    assert sensor["speed_through_water_std"][:3].tolist() == [0.01, 0.01, 0.01]
    assert sensor["speed_through_water_qc"].tolist() == [1, 1, 3, 9]
    assert all("speed_through_water" not in stream for key, stream in streams.items() if "pressure" in key)
    assert any("'AD2CP_TIME' is time" in str(finding) for finding in logs.findings)


def test_three_beams_are_no_speed_sensor(make: Callable[..., Mission]) -> None:
    text = f"{BEAMS}\n{_row(0, 0.35)}".replace("AD2CP_V4_CN1", "AD2CP_ALT")
    logs = table.read(make({"sea063.22.pld1.sub.120": text}))
    assert not any("speed_through_water" in stream for stream in logs.streams)
    unread = " ".join(str(finding) for finding in logs.findings if "not read" in str(finding))
    assert "AD2CP_V1_CN1" in unread
    assert "AD2CP_PRESSURE" in unread


@given(
    noise=st.floats(0.002, 0.03),
    velocity=st.tuples(st.floats(0.1, 1.0), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
    seed=st.integers(0, 99),
)
def test_noise_of_the_beams_is_found_by_their_redundancy(
    noise: float, velocity: tuple[float, float, float], seed: int
) -> None:
    away = np.array(
        [
            [-np.sin(adcp.ALONG), 0.0, np.cos(adcp.ALONG)],
            [0.0, -np.sin(adcp.ACROSS), np.cos(adcp.ACROSS)],
            [np.sin(adcp.ALONG), 0.0, np.cos(adcp.ALONG)],
            [0.0, np.sin(adcp.ACROSS), np.cos(adcp.ACROSS)],
        ]
    )
    true = np.tile(away @ np.array(velocity), (400, 1))
    still = adcp.by_beams(true, np.full(400, 50.0))
    np.testing.assert_allclose(still["speed_through_water"], np.linalg.norm(velocity))
    noisy = adcp.by_beams(true + noise * np.random.default_rng(seed).standard_normal(true.shape), np.full(400, 50.0))
    wanted = max(noise / np.sqrt(2.0) / np.sin(adcp.ALONG), adcp.FLOOR)
    assert noisy["speed_through_water_std"][0] == pytest.approx(wanted, rel=0.3)


def test_the_beams_of_a_real_seaexplorer_agree_with_its_depth_rate(data: Path, make: Callable[..., Mission]) -> None:
    """The path that its depth rate and the speed make is 3 to 8° steeper than the pitch of the profiler."""
    files = {path.name: path.read_bytes() for path in sorted((data / "seaexplorer/sea063_ad2cp").glob("*.gz"))}
    streams = table.read(make(files)).streams
    sensor = next(stream for stream in streams if "speed_through_water" in stream)
    ctd = next(stream for stream in streams if "conductivity" in stream)
    raw = pd.concat(pd.read_csv(path, sep=";") for path in sorted((data / "seaexplorer/sea063_ad2cp").glob("*pld1*")))
    assert len(sensor) == len(raw) == 164
    good = sensor[(sensor["speed_through_water_qc"] == 1) & sensor["speed_through_water"].between(0.1, 0.8)]
    assert len(good) > 120
    rate = np.gradient(ctd["pressure"], ctd["time"]) * 0.99
    sinking = np.interp(good["time"], ctd["time"], rate)
    pitch = np.abs(raw["AD2CP_PITCH"].to_numpy()[good.index])
    steepness = np.degrees(np.arcsin(np.clip(np.abs(sinking) / good["speed_through_water"], 0.0, 1.0)))
    for way in (1.0, -1.0):
        leg = (way * sinking > 0.05) & (pitch < 25.0)
        assert leg.sum() > 40
        assert 3.0 < np.median(steepness[leg] - pitch[leg]) < 8.0


def test_a_damaged_parquet_file_is_left_out_with_one_error(make: Callable[..., Mission], tmp_path: Path) -> None:
    frame = pd.DataFrame({"time": START + np.arange(5000.0), "P": np.sin(np.arange(5000.0))})
    frame.to_parquet(tmp_path / "ctd.parquet")
    whole = (tmp_path / "ctd.parquet").read_bytes()
    good = f"time,pitch\n{START},0.1\n"
    logs = table.read(make({"ctd.parquet": b"PAR1" + bytes(3000) + whole[3004:], "attitude.csv": good}))
    (error,) = (str(finding) for finding in logs.findings if finding.severity == "error")
    assert error.startswith("ctd.parquet: found a damaged file (")
    assert error.endswith("); expected Parquet; file left out; copy it again")
    assert "\n" not in error


@pytest.mark.parametrize("garbage", [b"\xc3(\xa0\xff\n", b"1\xff,2\n", b"\xff\xfe,\x81,\x82\n", b"\xc3"])
def test_bytes_that_are_no_text_cost_their_line(make: Callable[..., Mission], garbage: bytes) -> None:
    lines = [f"{START + k},{k}.5".encode() for k in range(4)]
    text = b"time,pressure\n" + b"\n".join(lines[:2]) + b"\n" + garbage.rstrip(b"\n") + b"\n" + b"\n".join(lines[2:])
    logs = table.read(make({"a.csv": text}))
    kept = logs.streams[0].dropna()
    assert kept["pressure"].tolist() == [0.5, 1.5, 2.5, 3.5]
    assert any("wrong number of fields" in str(finding) or "no number" in str(finding) for finding in logs.findings)


def test_a_long_table_of_another_encoding_is_read_to_its_end(make: Callable[..., Mission]) -> None:
    """Longer than what is read at a time, with characters of two bytes at the seams."""
    rows = "".join(f"{START + k};{k % 97},5;{'µ' * (k % 5)}\n" for k in range(90_000))
    for encoding in ("latin-1", "utf-8", "utf-16"):
        (stream,) = table.read(make({"a.csv": f"time;Druck P (dbar);größe\n{rows}".encode(encoding)}, YAML_P)).streams
        np.testing.assert_array_equal(stream["pressure"], np.arange(90_000) % 97 + 0.5)


ROWS = np.arange(4.0)
SECONDS = {"units": "seconds since 1970-01-01T00:00:00Z"}


def _netcdf(path: Path, variables: dict[str, tuple[str, np.ndarray, dict[str, object]]], engine: str) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    xarray.Dataset(variables).to_netcdf(path, engine=engine)


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
def test_netcdf_is_a_table_for_each_dimension_with_a_time(
    make: Callable[..., Mission], tmp_path: Path, engine: str
) -> None:
    pressure = np.array([0.0, 1.0, 99999.0, 3.0], dtype=np.float32)
    variables = {
        "m_present_time": ("i", START + 4 * ROWS, {"units": "timestamp"}),
        "m_pitch": ("i", 0.1 * ROWS, {"units": "rad"}),
        "TIME": ("j", ROWS, {"units": "minutes since 2016-06-22T00:00:00Z"}),
        "PRES": ("j", pressure, {"units": "decibar", "_FillValue": np.float32(99999.0)}),
        "PRES_QC": ("j", np.array([1, 1, 9, 4], dtype=np.int8), {}),
        "CNDC_QC": ("j", np.array([b"1", b"4", b"1", b"2"]), {}),
        "CNDC": ("j", 4.0 + ROWS, {"units": "mhos/m"}),
        "bins": ("k", ROWS, {"units": "m"}),
    }
    _netcdf(tmp_path / "unit.nc", variables, engine)
    mission = make({}, "files: {unit.nc: {columns: {pitch: {column: m_pitch, unit: deg}}}}\n")
    assert recognise(mission) == "table"
    logs = table.read(mission)
    attitude, ctd = sorted(logs.streams, key=lambda stream: "pressure" in stream)
    assert attitude["time"].tolist() == (START + 4 * ROWS).tolist()
    np.testing.assert_allclose(attitude["pitch"], np.radians(0.1 * ROWS))
    assert ctd["time"].tolist() == (START + 60 * ROWS).tolist()
    np.testing.assert_array_equal(ctd["pressure"], [0.0, 1.0, np.nan, 3.0])
    assert ctd["pressure_qc"].tolist() == [1, 1, 9, 4]
    assert ctd["conductivity"].tolist() == [4.0, 5.0, 6.0, 7.0]
    assert ctd["conductivity_qc"].tolist() == [1, 4, 1, 2]
    assert str(logs.findings[0]) == (
        "unit.nc: found netCDF; expected the logs themselves; "
        "what the program that wrote it interpolated cannot be told from what was measured"
    )


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"", "b.nc: found an empty file; expected netCDF; left out; copy the file again"),
        (b"x", "b.nc: found no netCDF header; expected netCDF, classic or 4; left out; copy the file again"),
        (
            b"\x89HDF\r\n\x1a\n cut",
            "b.nc: found a damaged netCDF file; expected a whole one; left out; copy the file again",
        ),
    ],
)
def test_netcdf_that_cannot_be_read_costs_that_file(make: Callable[..., Mission], content: bytes, line: str) -> None:
    pytest.importorskip("h5netcdf")
    logs = table.read(make({"a.csv": f"time,pitch (rad)\n{START},0.1\n", "b.nc": content}))
    assert len(logs.streams) == 1
    assert line in [str(finding) for finding in logs.findings]


def test_netcdf_without_a_series_costs_that_file(make: Callable[..., Mission], tmp_path: Path) -> None:
    _netcdf(tmp_path / "b.nc", {}, "h5netcdf")
    logs = table.read(make({"a.csv": f"time,pitch (rad)\n{START},0.1\n"}))
    assert "b.nc: found no table; expected a header line and records; file left out" in map(str, logs.findings)


def test_per_dive_files_of_a_seaglider_are_no_plain_tables(tmp_path: Path) -> None:
    for name, plain in (("p1710100.nc", False), ("p0050001_20080606.nc", False), ("sg171_timeseries.nc", True)):
        (tmp_path / name).touch()
        assert table.recognises(tmp_path / name) is plain


def test_flags_of_salinity_and_depth_go_with_what_is_computed_from_them(make: Callable[..., Mission]) -> None:
    text = f"time,depth,depth_qc,temp,PSAL,PSAL_QC\n{START},9.9,1,10,35,4\n{START + 1},19.9,3,10,35,1\n"
    (stream,) = table.read(make({"a.csv": text})).streams
    assert stream["pressure_qc"].tolist() == [1, 3]
    assert stream["conductivity_qc"].tolist() == [4, 1]
    assert not {"depth_qc", "salinity_qc"} & set(stream.columns)


def test_the_truth_of_a_simulation_is_not_read(make: Callable[..., Mission], tmp_path: Path) -> None:
    pd.DataFrame({"time": [START], "pitch": [0.1]}).to_parquet(tmp_path / "truth.parquet")
    logs = table.read(make({"a.csv": f"time,pitch (rad)\n{START},0.1\n"}))
    assert len(logs.streams) == 1
    assert str(logs.findings[0]) == "truth.parquet: found the truth of a simulation; not read: it is not a log"


def test_files_of_one_instrument_that_follow_each_other_are_one_stream_in_one_unit(
    make: Callable[..., Mission],
) -> None:
    logs = table.read(
        make(
            {
                "a.2.csv": f"time,pitch\n{START + 10},-1\n{START + 11},1\n",
                "a.1.csv": f"time,pitch\n{START},-25\n{START + 1},-26\n",
            },
            "files: {'a.*.csv': {}}\n",
        )
    )
    (stream,) = logs.streams
    assert stream["time"].tolist() == [START, START + 1, START + 10, START + 11]
    np.testing.assert_allclose(np.degrees(stream["pitch"]), [-25.0, -26.0, -1.0, 1.0])


def test_files_of_one_kind_that_report_otherwise_at_a_time_stay_apart(make: Callable[..., Mission]) -> None:
    text = f"time,pitch (rad)\n{START},0.1\n{START + 1},0.2\n"
    assert len(table.read(make({"a.csv": text, "b.csv": text.replace("0.", "0.0")})).streams) == 2


def test_kolumbo_is_read_through_a_mapping(data: Path, make: Callable[..., Mission]) -> None:
    content = (data / "slocum/kolumbo2019_hybrid/glider_data.csv").read_bytes()
    yaml = "files: {glider_data.csv: {columns: {depth: z}, ignore: [lat, lon]}}\n"
    (stream,) = table.read(make({"glider_data.csv": content}, yaml)).streams
    assert len(stream) == 614
    assert stream["pressure"].max() == pytest.approx(351.2, abs=0.5)
    assert np.degrees(stream["pitch"].quantile(0.25)) == pytest.approx(-25.0, abs=1.0)
    assert stream["buoyancy_volume"].quantile(0.2) == pytest.approx(-262e-6, abs=3e-6)
    assert stream["propeller_power"].median() == pytest.approx(5.0, abs=0.2)


def test_seaexplorer_text_is_read_through_a_mapping(data: Path, make: Callable[..., Mission]) -> None:
    files = {path.name: path.read_bytes() for path in sorted((data / "seaexplorer/sea063_ad2cp").glob("*.gz"))}
    yaml = """files:
  '*.gli.*.gz': {time: {column: Timestamp, unit: '%d/%m/%Y %H:%M:%S'}, ignore: [Temperature]}
  '*.pld1.*.gz':
    time: {column: PLD_REALTIMECLOCK, unit: '%d/%m/%Y %H:%M:%S.%f'}
    columns: {conductivity: {column: LEGATO_CONDUCTIVITY, unit: mS/cm}}
"""
    attitude, _, ctd = table.read(make(files, yaml)).streams
    assert (len(attitude), len(ctd)) == (271, 164)
    assert attitude["time"].iloc[0] == pd.Timestamp("2021-08-23T23:22:20Z").timestamp()
    assert attitude["latitude"].iloc[0] == pytest.approx(55.4897, abs=1e-4)
    assert attitude["battery_voltage"].iloc[0] == 28.6
    assert attitude["battery_voltage"].between(28.0, 29.0).all()
    assert ctd["pressure"].iloc[0] == pytest.approx(2.4714)


def test_the_hour_that_comes_twice_in_autumn_is_told_by_the_order_of_the_records() -> None:
    local = ["2015-10-25 02:30:00", "2015-10-25 02:50:00", "2015-10-25 02:10:00", "2015-10-25 02:55:00"]
    utc = ["2015-10-25T00:30:00", "2015-10-25T00:50:00", "2015-10-25T01:10:00", "2015-10-25T01:55:00"]
    found = times.textual(pd.Series(local, dtype="object"), None, "Europe/Berlin", "f.csv", "t")
    assert found.tolist() == [pd.Timestamp(text, tz="UTC").timestamp() for text in utc]


def test_seconds_may_have_a_decimal_comma() -> None:
    found = times.textual(pd.Series(["2015-10-25T02:30:00,250Z"], dtype="object"), None, "UTC", "f.csv", "t")
    assert found.tolist() == [pd.Timestamp("2015-10-25T02:30:00.25", tz="UTC").timestamp()]


@pytest.mark.parametrize(
    "text",
    ["Wed Jun 22 00:00:01 2016", "Jun 22, 2016 00:00:01", "22 June 2016 00:00:01", "20160622T000001", "20160622000001"],
)
def test_a_date_that_names_its_month_or_runs_together_is_read(make: Callable[..., Mission], text: str) -> None:
    (stream,) = table.read(make({"a.csv": f'time,P\n"{text}",1\n'})).streams
    assert stream["time"].tolist() == [START + 1]


@pytest.mark.parametrize(
    "rows",
    [
        "year,month,day,hour,minute,second,P\n2016,6,22,0,0,1.5,1\n",
        "YYYY;MON;DD;HH;MN;SS;P\n16;06;22;00;00;01.5;1\n",
        "date_year,date_month,date_day,time_hour,P\n2016,6,22,0.00041666666666666664,1\n",
        "year,yday,P\n2016,174.0000173611111,1\n",
        "Year,Day of year,Hour,Min,Sec,P\n2016,174,0,0,1.5,1\n",
    ],
)
def test_a_date_in_columns_of_its_parts_is_time(make: Callable[..., Mission], rows: str) -> None:
    logs = table.read(make({"a.csv": rows}))
    np.testing.assert_allclose(logs.streams[0]["time"], [START + 1.5])
    assert len(logs.findings) == 1
    assert " are time, 'P' is pressure" in str(logs.findings[0])


@pytest.mark.parametrize("day", [-3, 368, ""])
def test_a_day_that_no_year_has_costs_its_record(make: Callable[..., Mission], day: object) -> None:
    (stream,) = table.read(make({"a.csv": f"year,doy,P\n2016,174,1\n2016,{day},1\n"})).streams
    np.testing.assert_array_equal(stream["time"], [START, np.nan])


@pytest.mark.parametrize(
    "rows", ["datenum,P\n736503.0,1\n", "matlab_time,P\n736503.0,1\n", "JULD (days since 1950-01-01),P\n24279.0,1\n"]
)
def test_names_of_days_are_times(make: Callable[..., Mission], rows: str) -> None:
    assert table.read(make({"a.csv": rows})).streams[0]["time"].tolist() == [START]


def test_parts_of_a_date_that_are_none_cost_their_record(make: Callable[..., Mission]) -> None:
    rows = "year,month,day,hour,P\n2016,13,22,0,1\n,6,22,0,1\n2016,6,22,,1\n2016,6,22,0,1\n"
    (stream,) = table.read(make({"a.csv": rows})).streams
    np.testing.assert_array_equal(stream["time"], [np.nan, np.nan, np.nan, START])


@pytest.mark.parametrize(
    ("number", "unit", "local"),
    [
        (20160622080000.0, None, True),
        (736503.0 + 8 / 24, "datenum", True),
        (42543.0 + 8 / 24, "days since 1899-12-30", True),
        (START, "s", False),
        (42543.0, "days since 1899-12-30T00:00:00Z", False),
    ],
)
def test_the_zone_of_a_file_is_that_of_days_and_dates_and_not_of_seconds_since_1970(
    number: float, unit: str | None, local: bool
) -> None:
    told = times.numeric(np.array([number, np.nan]), unit, "a.csv", "time", "Asia/Shanghai")
    np.testing.assert_allclose(told, [START, np.nan], atol=1e-4)
    in_utc = times.numeric(np.array([number]), unit, "a.csv", "time")
    assert in_utc[0] - told[0] == pytest.approx(8 * 3600.0 if local else 0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (42543.0, "'days since 1899-12-30' if 42543 is a date of Excel (2016-06-22 00:00)"),
        (57561.0, "'days since 1858-11-17' if 57561 is a Modified Julian Day (2016-06-22 00:00)"),
        (24279.0, "'days since 1950-01-01' if 24279 is days of Argo and EGO (2016-06-22 00:00)"),
    ],
)
def test_days_of_a_calendar_come_with_the_unit_to_give(number: float, words: str) -> None:
    with pytest.raises(InputError) as caught:
        times.numeric(np.array([number]), None, "a.csv", "time")
    assert str(caught.value).endswith(f"in mission.yaml; {words}")
    unit = words.split("'")[1]
    assert times.numeric(np.array([number]), unit, "a.csv", "time").tolist() == [START]


def test_a_block_of_nul_bytes_costs_its_line(make: Callable[..., Mission]) -> None:
    rows = [f"{START + k},{0.01 * k}\n" for k in range(40)]
    text = "time,pitch (rad)\n" + "".join(rows[:20]) + "\0" * 300 + "\n" + "".join(rows[20:]) + "\0" * 100
    (stream,) = table.read(make({"a.csv": text})).streams
    np.testing.assert_allclose(stream["pitch"], 0.01 * np.arange(40))


@pytest.mark.parametrize("at", [30, 4000])
@pytest.mark.parametrize("mark", ["", '"'])
def test_a_stray_quotation_mark_costs_its_line(make: Callable[..., Mission], at: int, mark: str) -> None:
    rows = [f"{mark}{START + k}{mark},{0.01 * k}\n" for k in range(5000)]
    rows[at] = '"' + rows[at]
    logs = table.read(make({"a.csv": "time,pitch (rad)\n" + "".join(rows)}))
    assert len(logs.streams[0].dropna()) == 4999
    assert any(finding.severity == "warning" for finding in logs.findings)


@pytest.mark.parametrize("header", ["time,Pitch,Roll", "time,pitch (deg),Roll", "time,heading,Roll"])
def test_a_small_roll_has_the_unit_of_the_other_angles(make: Callable[..., Mission], header: str) -> None:
    rows = "".join(f"{START + k},{20.0 + k},{0.1 * k}\n" for k in range(10))
    (stream,) = table.read(make({"a.csv": f"{header}\n{rows}"})).streams
    np.testing.assert_allclose(stream["roll"], np.radians(0.1 * np.arange(10)))


def test_small_angles_all_of_them_are_radians(make: Callable[..., Mission]) -> None:
    rows = "".join(f"{START + k},{0.4 - 0.1 * k},{0.1 * k}\n" for k in range(10))
    (stream,) = table.read(make({"a.csv": f"time,Pitch,Roll\n{rows}"})).streams
    np.testing.assert_allclose(stream["roll"], 0.1 * np.arange(10))


def test_a_zone_by_its_letters_comes_with_the_line_that_reads_it(make: Callable[..., Mission]) -> None:
    rows = "time,P\n2016-06-21 20:00:01 EDT,1\n"
    (finding,) = [finding for finding in table.read(make({"a.csv": rows})).findings if "no time" in finding.found]
    line = "files: {a.csv: {time: {column: time, unit: '%Y-%m-%d %H:%M:%S EDT'}, timezone: America/New_York}}"
    assert finding.remedy.endswith(f"{line} in mission.yaml says which")
    assert table.read(make({"a.csv": rows}, f"{line}\n")).streams[0]["time"].tolist() == [START + 1]


@pytest.mark.parametrize(
    ("header", "hours"),
    [
        ("Time (UTC+8)", 8),
        ("Time [UTC-03:00]", -3),
        ("北京时间", 8),
        ("Time (GMT)", 0),
        ("Time (UTC+0)", 0),
        ("time", 0),
    ],
)
def test_the_zone_in_the_header_of_the_times_is_theirs(make: Callable[..., Mission], header: str, hours: int) -> None:
    logs = table.read(make({"a.csv": f"{header},P\n2016-06-22 00:00:00,1\n"}))
    assert logs.streams[0]["time"].tolist() == [START - 3600.0 * hours]
    assert any("times in UTC" in finding.found for finding in logs.findings) == ("+" in header or hours != 0)
    yaml = f"files: {{a.csv: {{time: {{column: '{header}'}}, timezone: Asia/Tokyo}}}}\n"
    assert table.read(make({}, yaml)).streams[0]["time"].tolist() == [START - 3600.0 * 9]


@pytest.mark.parametrize("zone", ["EST", "MST", "local", "UTC+5:30"])
def test_a_zone_in_the_header_that_cannot_be_told_is_told(make: Callable[..., Mission], zone: str) -> None:
    logs = table.read(make({"a.csv": f"Time ({zone}),P\n2016-06-22 00:00:00,1\n"}))
    assert logs.streams[0]["time"].tolist() == [START]
    assert str(logs.findings[0]) == (
        f"a.csv: column 'Time ({zone})': found times in '{zone}'; expected UTC, or UTC and whole hours; "
        "read as UTC; name the zone: files: {a.csv: {timezone: Asia/Kolkata}} in mission.yaml"
    )


@pytest.mark.parametrize("unit", ["s", "ms", "UTC", "sec", "Z", "timestamp"])
def test_a_unit_of_time_is_no_zone(make: Callable[..., Mission], unit: str) -> None:
    number = START * 1000 if unit == "ms" else START
    text = "2016-06-22T00:00:00" if unit in ("UTC", "Z") else f"{number:.0f}"
    logs = table.read(make({"a.csv": f"time ({unit}),P\n{text},1\n"}))
    assert logs.streams[0]["time"].tolist() == [START]
    assert not any("times in" in finding.found for finding in logs.findings)


def test_bytes_of_no_encoding_cost_their_field(make: Callable[..., Mission]) -> None:
    rows = [f"{START + k},{0.01 * k},\u4e2d\u6587\n".encode("gb18030") for k in range(5000)]
    rows[4500] = f"{START + 4500},\n".encode()[:-1] + b"\xb8\x20\xff,\xce\n"
    (stream,) = table.read(
        make({"a.csv": "time,pitch (rad),\u5907\u6ce8\n".encode("gb18030") + b"".join(rows)})
    ).streams
    assert stream["pitch"].notna().sum() == 4999

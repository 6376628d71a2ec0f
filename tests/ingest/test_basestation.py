"""The basestation's text files of a Seaglider: what is read of .eng and .log, and what bad ones get."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq

from pipeline.findings import InputError
from pipeline.ingest import ingest, recognise, seaglider
from pipeline.ingest.logs import Logs
from pipeline.mission import Mission, load

START = pd.Timestamp("2016-06-22 10:00:48", tz="UTC").timestamp()
HEAD = "%version: 66.11\n%glider: 123\n%dive: 1\n%start: 06 22 116 10 00 48\n%columns: {}\n%data:\n"
COLUMNS = "elaps_t_0000,elaps_t,depth,head,pitchAng,rollAng,pitchCtl,rollCtl,vbdCC,rec,GC_phase"
#: Of a sensor nobody has, of the size that Sea-Bird's have.
T = (4.4e-3, 6.3e-4, 2.2e-5, 2.1e-6)
C = (-9.9, 1.12, -1.5e-3, 1.9e-4)
LOG = """version: 66.11
start: 6 22 116 10 0 48
data:
$ID,123
$MASS,52000
$C_PITCH,2700
$PITCH_CNV,0.003
$C_VBD,2650
$VBD_CNV,-0.25
$GPS1,220616,095512,4530.000,-12515.000,13,0.9,14,15.5
$GPS2,220616,100020,4530.060,-12515.060,13,0.9,14,15.5
$TGT_NAME,HEADING
$GPS,220616,103000,4530.600,-12515.600,13,0.9,14,15.5
"""
GC = """$GCHEAD,st_secs,pitch_ctl,vbd_pot1_ad_start,vbd_pot2_ad_start,pitch_ad_start,end_secs,pitch_ad,vbd_ad
$GC,10,-0.6,3249,3251,2700,30,2500,3250
$GC,600,0.6,3252,3248,2500,700,2900,2050
"""
ROWS = (
    (42.0, 216.0, 355.0, -25.0, 2.0, -0.5, 0.0, -150.0, 0.0, 2.0),
    (72.0, 1000.0, 355.0, -24.0, 2.0, -0.5, 0.0, -150.0, 1.0, 6.0),
    (102.0, 500.0, 355.0, 24.0, 2.0, 0.5, 0.0, 150.0, 2.0, 6.0),
)


def eng(columns: str = COLUMNS, rows: tuple[tuple[float, ...], ...] = ROWS, more: tuple[float, ...] = ()) -> str:
    """Return an engineering record, the columns `more` the same in each row."""
    lines = (" ".join(f"{x:.3f}" for x in (36048.0 + row[0], *row, *more)) for row in rows)
    return HEAD.format(columns) + "".join(f"{line} \n" for line in lines)


def write(folder: Path, **files: str) -> Mission:
    """Write a dive's text files into `folder`; a name's last underscore stands for its dot."""
    for name, text in files.items():
        path = folder / ".".join(name.rsplit("_", 1)).replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="latin-1")
    (folder / "mission.yaml").write_text("vehicle: seaglider\n", encoding="utf-8")
    return load(folder)


def read(folder: Path, **files: str) -> Logs:
    return seaglider.read(write(folder, **files))


def named(logs: Logs) -> dict[str, pd.DataFrame]:
    return {str(frame.attrs["name"]): frame for frame in logs.streams}


def lines(logs: Logs) -> list[str]:
    return [str(finding) for finding in logs.findings]


def test_an_engineering_record_and_its_log_are_a_dive(tmp_path: Path) -> None:
    mission = write(tmp_path, p1230001_eng=eng(), p1230001_log=LOG)
    assert recognise(mission) == "seaglider"
    logs = seaglider.read(mission)
    record, fixes = named(logs)["engineering"], named(logs)["GPS"]
    assert (record["time"] - START).tolist() == [42.0, 72.0, 102.0]
    np.testing.assert_allclose(record["pitch"], np.radians([-25.0, -24.0, 24.0]))
    np.testing.assert_allclose(record["roll"], np.radians(2.0))
    np.testing.assert_allclose(record["heading"], np.radians(10.5))  # magnetic 355, variation 15.5 E
    np.testing.assert_allclose(record["buoyancy_volume"], [-150e-6, -150e-6, 150e-6])
    np.testing.assert_allclose(record["battery_position"], [0.005, 0.005, -0.005])
    # A metre of the glider's own depth is 1 / 0.685 psi.
    np.testing.assert_allclose(record["pressure"], np.array([2.16, 10.0, 5.0]) / 0.685 * 0.6894757, rtol=1e-6)
    assert [str(pd.Timestamp(t, unit="s")) for t in fixes["time"]] == [
        "2016-06-22 09:55:12",
        "2016-06-22 10:00:20",
        "2016-06-22 10:30:00",
    ]
    np.testing.assert_allclose(fixes["latitude"], [45.5, 45.501, 45.51])
    np.testing.assert_allclose(fixes["longitude"], [-125.25, -125.251, -125.26])
    assert logs.constants["mass"] == 52.0


def test_motor_moves_stand_for_engine_and_battery_where_the_record_has_neither(tmp_path: Path) -> None:
    columns = "elaps_t_0000,elaps_t,depth,head,pitchAng,rollAng,rec,GC_state"
    rows = tuple(row[:5] + row[-2:] for row in ROWS)
    logs = read(tmp_path, p1230001_eng=eng(columns, rows), p1230001_log=LOG + GC)
    engine, battery = named(logs)["engine"], named(logs)["battery"]
    assert (engine["time"] - START).tolist() == [10.0, 30.0, 600.0, 700.0]
    np.testing.assert_allclose(engine["buoyancy_volume"], [-150e-6, -150e-6, -150e-6, 150e-6])
    np.testing.assert_allclose(battery["battery_position"], [0.0, 0.006, 0.006, -0.006], atol=1e-15)
    without = read(tmp_path, p1230001_eng=eng(columns, rows), p1230001_log=LOG)
    assert "engine" not in named(without)
    assert (
        "p1230001.eng: found no variable eng_vbdCC; expected it, or the motor's moves; the dive goes without"
        in lines(without)
    )


def _frequencies(temperature: float, conductivity: float, pressure: float) -> tuple[float, float]:
    """Return the frequencies [Hz] at which Sea-Bird's equations give a temperature [°C] and a conductivity [S/m]."""

    def of_temperature(hertz: float) -> float:
        x = np.log(1000.0 / hertz)
        return float(1.0 / (T[0] + T[1] * x + T[2] * x**2 + T[3] * x**3) - 273.15 - temperature)

    def of_conductivity(kilohertz: float) -> float:
        cell = C[0] + C[1] * kilohertz**2 + C[2] * kilohertz**3 + C[3] * kilohertz**4
        return float(cell / (10.0 * (1.0 + 3.25e-6 * temperature - 9.57e-8 * pressure)) - conductivity)

    return brentq(of_temperature, 1500.0, 9000.0), 1000.0 * brentq(of_conductivity, 3.0, 12.0)


@pytest.mark.parametrize(
    "names", ["sbect.condFreq,sbect.tempFreq", "condFreq,tempFreq", "sbect9.CondFreq,scct.TempFreq"]
)
@pytest.mark.parametrize("where", ["calibration", "log"])
def test_frequencies_become_temperature_and_conductivity(tmp_path: Path, names: str, where: str) -> None:
    hertz_t, hertz_c = _frequencies(8.0, 3.5, 10.0)
    letters = [(f"t_{k}", value) for k, value in zip("ghij", T, strict=True)]
    letters += [(f"c_{k}", value) for k, value in zip("ghij", C, strict=True)]
    log, calibration = LOG, {}
    if where == "log":
        log += "".join(f"$SEABIRD_{name.upper()},{value}\n" for name, value in letters)
    else:
        text = "id_str = '123'; % a comment; mass = 1;\n" + "".join(f"{name}={value};" for name, value in letters)
        calibration = {"sg_calib_constants_m": f"{text}\nmass = 53.5; volmax = 52000;\n"}
    record = eng(f"{COLUMNS},{names}", more=(hertz_c, hertz_t))
    logs = read(tmp_path, p1230001_eng=record, p1230001_log=log, **calibration)
    water = named(logs)["engineering"]
    np.testing.assert_allclose(water["temperature"], 8.0, atol=1e-5)
    np.testing.assert_allclose(water["conductivity"], 3.5, atol=1e-5)
    assert logs.constants["mass"] == (52.0 if where == "log" else 53.5)
    assert any("without the basestation's corrections" in line for line in lines(logs))


def test_a_ctd_without_a_calibration_is_told_and_not_guessed(tmp_path: Path) -> None:
    nominal = "$SEABIRD_T_G,0.0043\n$SEABIRD_T_H,0.00064\n$SEABIRD_T_I,2.5e-05\n$SEABIRD_T_J,4.3e-06\n"
    nominal += "$SEABIRD_C_G,-10\n$SEABIRD_C_H,1\n$SEABIRD_C_I,-0.002\n$SEABIRD_C_J,0.0002\n"
    record = eng(f"{COLUMNS},sbect.condFreq,sbect.tempFreq", more=(6000.0, 3400.0))
    for log in (LOG, LOG + nominal):
        logs = read(tmp_path, p1230001_eng=record, p1230001_log=log)
        assert "temperature" not in named(logs)["engineering"]
        assert (
            "p1230001.eng: found frequencies of a CTD and no calibration; expected t_g to c_j in sg_calib_constants.m; "
            "the dive goes without a CTD"
        ) in lines(logs)


def test_a_ctd_that_computes_its_values_is_read_with_its_own_pressure(tmp_path: Path) -> None:
    record = eng(
        f"{COLUMNS},rbr_conduc,rbr_conducTemp,rbr_temp,rbr_pressure,aa4831.Temp", more=(35.0, 9.0, 8.0, 7.0, 9.9)
    )
    engineering = named(read(tmp_path, p1230001_eng=record, p1230001_log=LOG))["engineering"]
    np.testing.assert_allclose(engineering["temperature"], 8.0)
    np.testing.assert_allclose(engineering["conductivity"], 3.5)
    np.testing.assert_allclose(engineering["pressure"], 7.0)


def test_a_ctd_that_was_off_leaves_the_vehicles_depth(tmp_path: Path) -> None:
    record = eng(f"{COLUMNS},rbr_conduc,rbr_temp,rbr_pressure", more=(math.nan, math.nan, math.nan))
    engineering = named(read(tmp_path, p1230001_eng=record, p1230001_log=LOG))["engineering"]
    assert engineering["pressure"].notna().all()
    assert "temperature" not in engineering


@pytest.mark.parametrize("place", ["sc0001{0}__psc1230001{0}_legatoPoll_ct", "psc1230001{0}_legatoPoll_ct"])
def test_the_ctd_of_the_scientific_controller_has_a_clock_of_its_own(tmp_path: Path, place: str) -> None:
    names = " ".join(f"legatoPoll.{name}" for name in ("time", "conduc", "temp", "pressure"))
    head = f"%instrument: ct legatoPoll\n%columns: {names}\n%start: 6 22 116 10 0 58 305\n"
    parts = {
        f"{place.format(half)}_eng": f"{head}{START + at:.3f} 35.0 8.0 {at / 10} \n%stop: 6 22 116\n"
        for half, at in (("a", 50.0), ("b", 100.0))
    }
    logs = read(tmp_path, p1230001_eng=eng(), p1230001_log=LOG, **parts)
    ctd = named(logs)["CTD"]
    assert (ctd["time"] - START).tolist() == [50.0, 100.0]
    np.testing.assert_allclose(ctd["conductivity"], 3.5)
    np.testing.assert_allclose(ctd["pressure"], [5.0, 10.0])
    assert {path.name for path in seaglider.files(tmp_path)} >= {f"psc1230001{half}_legatoPoll_ct.eng" for half in "ab"}


def test_text_beside_the_netcdf_of_its_dive_is_not_read(tmp_path: Path) -> None:
    write(tmp_path, p1230001_nc="x", p1230001_eng=eng(), p1230002_eng=eng(), p1230002_log=LOG)
    assert [path.name for path in seaglider.files(tmp_path)] == ["p1230001.nc", "p1230002.eng", "p1230002.log"]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "found an empty file; expected an engineering record of the basestation; left out; copy the file again"),
        (
            "garbage\n",
            "found no line '%columns:'; expected an engineering record of the basestation; "
            "left out; copy the file again",
        ),
        (
            HEAD.format(COLUMNS),
            "found no records; expected an engineering record of the basestation; left out; copy the file again",
        ),
        (
            eng().replace("%start: 06", "%start: 13"),
            "found no date in '%start:'; expected an engineering record of the basestation; left out",
        ),
        (
            eng().replace("elaps_t,", "when,"),
            "found no column elaps_t; expected an engineering record of the basestation; left out",
        ),
    ],
)
def test_a_bad_record_costs_its_dive(tmp_path: Path, text: str, line: str) -> None:
    logs = read(tmp_path, p1230001_eng=text, p1230002_eng=eng(), p1230002_log=LOG)
    assert f"p1230001.eng: {line}" in lines(logs)
    assert len(named(logs)["engineering"]) == 3
    with pytest.raises(InputError, match="1 Seaglider file, none of them readable"):
        read(tmp_path / "alone", p1230001_eng=text)


def test_broken_lines_cost_themselves_and_a_missing_log_the_fixes(tmp_path: Path) -> None:
    record = eng() + "%columns: a,b\n36170.000 1\n36180.0 132.0 x 1e999 -20.0 0 0 0 0 3 6\n"
    log = LOG.replace("220616,100020", "220699,100020").replace("4530.600", "1e999")
    log += GC + "$GCHEAD,a,b\n$GC,1,2\n"
    logs = read(tmp_path, p1230001_eng=record, p1230001_log=log)
    assert len(named(logs)["engineering"]) == 4
    assert len(named(logs)["GPS"]) == 1
    assert (
        "p1230001.log: GPS: found '220616,103000,1e999,-12515.600,13,0.9,14,15.5'; "
        "expected a date, a time and a position; fix left out"
    ) in lines(logs)
    (tmp_path / "p1230001.log").unlink()
    alone = seaglider.read(load(tmp_path))
    assert "p1230001.eng: found no p1230001.log beside it; expected it; the dive has no fixes" in lines(alone)
    assert "GPS" not in named(alone)


def _as_text(source: Path, folder: Path) -> None:
    """Write the dives in `source` as text, from the copies of it that the basestation keeps in its netCDF."""
    h5netcdf = pytest.importorskip("h5netcdf")
    for path in sorted(source.glob("*.nc")):
        with h5netcdf.File(path, "r") as file:
            values = {name: np.asarray(variable[...]) for name, variable in file.variables.items()}
        start = pd.Timestamp(round(float(values["time"][0] - values["eng_elaps_t"][0])), unit="s")
        names = [name for name in values if name.startswith("eng_")]
        columns = ",".join(name.removeprefix("eng_").replace("sbect_", "sbect.") for name in names)
        rows = "\n".join(" ".join(f"{x:.3f}" for x in row) for row in np.column_stack([values[n] for n in names]))
        text = f"%start: {start:%m %d} {start.year - 1900} {start:%H %M %S}\n%columns: {columns}\n%data:\n{rows}\n"
        log = "".join(
            f"${name.removeprefix('log_')},{float(value):.9g}\n"
            for name, value in values.items()
            if name.startswith("log_") and value.shape == () and value.dtype.kind in "fi"
        )
        for k, name in enumerate(("GPS1", "GPS2", "GPS")):
            moment = pd.Timestamp(float(values["log_gps_time"][k]), unit="s")
            place = [abs(float(values[f"log_gps_{axis}"][k])) for axis in ("lat", "lon")]
            position = ",".join(f"{int(x) * 100 + x % 1 * 60:.3f}" for x in place)
            log += f"${name},{moment:%d%m%y,%H%M%S},{position},9,0.9,9,{float(values['log_gps_magvar'][k]):.1f}\n"
        calibration = "".join(
            f"{name.removeprefix('sg_cal_')} = {float(value):.12g}; % of this dive\n"
            for name, value in values.items()
            if name.startswith("sg_cal_") and value.shape == () and value.dtype.kind in "fi"
        )
        dive = {f"{path.stem}_eng": text, f"{path.stem}_log": log, "sg_calib_constants_m": calibration}
        write(folder, **dive)


def test_the_text_of_real_dives_is_read_as_their_netcdf(data: Path, tmp_path: Path) -> None:
    source = data / "seaglider" / "sg561_lofoten2016"
    _as_text(source, tmp_path)
    text = named(seaglider.read(load(tmp_path)))
    netcdf = named(seaglider.read(Mission(vehicle="seaglider", folder=source)))
    for stream, columns in (
        ("engineering", ("time", "pressure", "pitch", "roll", "heading", "buoyancy_volume", "battery_position")),
        ("GPS", ("time", "latitude", "longitude")),
    ):
        for column in columns:
            np.testing.assert_allclose(text[stream][column], netcdf[stream][column], rtol=1e-9, atol=1e-9)
    # Before its corrections for lags and thermal mass, the basestation has the same by its own program.
    h5netcdf = pytest.importorskip("h5netcdf")
    with h5netcdf.File(source / "p5610004.nc", "r") as file:
        time, raw = (np.asarray(file.variables[name][...]) for name in ("time", "temperature_raw"))
        cell = np.asarray(file.variables["conductivity_raw"][...])
    dive = text["engineering"].set_index("time").loc[time]
    np.testing.assert_allclose(dive["temperature"], raw, atol=2e-6)
    np.testing.assert_allclose(dive["conductivity"], cell, atol=2e-6)
    assert ingest(load(tmp_path)).format == "seaglider"

"""The netCDF: opened by xarray it has the numbers of the Parquet tables, CF's names, and the same bytes each time."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pages import complete

from pipeline import store
from pipeline.records import Quality
from pipeline.report import Inputs, build, og1
from pipeline.vehicle import Vehicle

xarray = pytest.importorskip("xarray", reason="the extra 'netcdf' is not installed")

#: From the CF standard name table.
STANDARD = {
    "time",
    "latitude",
    "longitude",
    "depth",
    "platform_speed_wrt_sea_water",
    "platform_pitch_fore_up",
    "upward_sea_water_velocity",
    "quality_flag",
    "status_flag",
}


@pytest.fixture(scope="module")
def inputs(petrel: Vehicle) -> Inputs:
    return complete(petrel)


def write(path: Path, given: Inputs) -> Path:
    with store.whole(path) as file:
        og1.write(
            file, given.mission, given.vehicle, given.records, {"kinematic": given.estimates, "force": given.force}
        )
    return path


@pytest.fixture(scope="module")
def found(inputs: Inputs, tmp_path_factory: pytest.TempPathFactory) -> Any:
    with xarray.open_dataset(write(tmp_path_factory.mktemp("nc") / "estimates.nc", inputs)) as dataset:
        return dataset.load()


@pytest.mark.parametrize("method", ["kinematic", "force"])
@pytest.mark.parametrize("variable", og1.VARIABLES, ids=lambda variable: variable.column)
def test_numbers_are_those_of_the_tables(found: Any, inputs: Inputs, method: str, variable: og1.Variable) -> None:
    table = inputs.estimates if method == "kinematic" else inputs.force
    name = og1.name_of(variable, method)
    for suffix, column in (("", variable.column), ("_STD", f"{variable.column}_std")):
        values = table[column].to_numpy()
        if variable.unit == "degree":
            values = np.degrees(values)
        np.testing.assert_allclose(found[name + suffix].values, values, rtol=1e-6, atol=1e-7)
        assert np.isnan(found[name + suffix].encoding["_FillValue"])


def test_time_and_fixes_are_those_of_the_records(found: Any, inputs: Inputs) -> None:
    assert found.sizes == {"N_MEASUREMENTS": len(inputs.records)}
    time = pd.DatetimeIndex(inputs.records["time"]).tz_localize(None)
    assert np.abs((pd.DatetimeIndex(found["TIME"].values) - time).total_seconds()).max() < 1e-6
    for name in ("LATITUDE", "LONGITUDE"):
        expected = inputs.records[name.lower()].to_numpy()
        assert (name in found.coords) == np.isfinite(expected).any()
        if name in found.coords:
            np.testing.assert_array_equal(found[name].values, expected)  # none between the fixes


def test_without_fixes_there_is_no_position(inputs: Inputs, tmp_path: Path) -> None:
    lost = Inputs(**{**vars(inputs), "records": inputs.records.assign(latitude=np.nan, longitude=np.nan)})
    with xarray.open_dataset(write(tmp_path / "estimates.nc", lost)) as dataset:
        assert not {"LATITUDE", "LONGITUDE"} & set(dataset.variables)
        assert "geospatial_lat_min" not in dataset.attrs


def test_without_a_force_estimate_only_the_kinematic_is_there(inputs: Inputs, tmp_path: Path) -> None:
    alone = Inputs(**{**vars(inputs), "force": inputs.force.iloc[:0]})
    with xarray.open_dataset(write(tmp_path / "estimates.nc", alone)) as dataset:
        assert "SPEED_KINEMATIC" in dataset
        assert not [name for name in dataset.variables if "FORCE" in str(name)]


def test_a_table_of_other_instants_is_refused(inputs: Inputs, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="one a record"):
        write(tmp_path / "estimates.nc", Inputs(**{**vars(inputs), "force": inputs.force.iloc[1:]}))
    assert not list(tmp_path.iterdir())


def test_conventions_and_names_are_cfs(found: Any) -> None:
    assert found.attrs["Conventions"] == "CF-1.10"
    assert found.attrs["featureType"] == "trajectory"
    assert found["TRAJECTORY"].attrs["cf_role"] == "trajectory_id"
    named = {
        str(name): item.attrs["standard_name"]
        for name, item in found.variables.items()
        if "standard_name" in item.attrs
    }
    assert {name.removesuffix(" standard_error") for name in named.values()} <= STANDARD
    assert named["SPEED_FORCE"] == "platform_speed_wrt_sea_water"
    assert named["SPEED_FORCE_STD"] == "platform_speed_wrt_sea_water standard_error"
    assert found["SPEED_FORCE"].attrs["units"] == "m s-1"
    assert named["VERTICAL_WATER_VELOCITY_KINEMATIC"] == "upward_sea_water_velocity"
    assert "ANGLE_OF_ATTACK_KINEMATIC" not in named
    for item in found.variables.values():
        assert item.attrs["long_name"]
        assert set(item.attrs.get("ancillary_variables", "").split()) <= set(found.variables)


@pytest.mark.parametrize("method", ["kinematic", "force"])
def test_flags_tell_where_the_speed_is_determined_and_why_not(found: Any, inputs: Inputs, method: str) -> None:
    table = inputs.estimates if method == "kinematic" else inputs.force
    observable = table["observable"].to_numpy(dtype=bool)
    flag = found[f"SPEED_{method.upper()}_QC"]
    np.testing.assert_array_equal(flag.to_numpy() == Quality.GOOD, observable)
    status = found[f"STATUS_{method.upper()}"]
    np.testing.assert_array_equal(status.to_numpy() == 0, table["reason"].to_numpy() == "")
    for item in (flag, status, found["PHASE"]):
        meanings = item.attrs["flag_meanings"].split()
        assert len(meanings) == np.size(item.attrs["flag_values"])
        assert set(np.unique(item.values)) <= set(np.atleast_1d(item.attrs["flag_values"]).tolist())
        assert all(letter.isalnum() or letter in "_-.+@" for word in meanings for letter in word)


def test_the_same_input_gives_the_same_bytes(inputs: Inputs, tmp_path: Path) -> None:
    first, second = (write(tmp_path / place / "estimates.nc", inputs) for place in ("a", "b"))
    assert first.read_bytes() == second.read_bytes()
    assert str(tmp_path).encode() not in first.read_bytes()


def test_without_the_extra_a_finding_says_what_to_install(inputs: Inputs, monkeypatch: pytest.MonkeyPatch) -> None:
    assert og1.missing() is None
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    finding = og1.missing()
    assert str(finding) == (
        "estimates.nc: found no h5netcdf to write it with; expected the extra 'netcdf'; pip install 'seatrial[netcdf]'"
    )
    summary, page, _ = build(inputs)
    assert not summary["export"]["netcdf"]
    assert {"stage": "report", **finding.as_dict()} in summary["findings"]
    assert "estimates.nc was not written" in page

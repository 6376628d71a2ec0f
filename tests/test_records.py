"""The canonical tables: names, types, and time to the microsecond."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import records
from pipeline.records import BLOCKS, ESTIMATES, MEASURED, PREDICTIONS, RECORDS, STORED, Phase, Quality


@pytest.mark.parametrize("table", [RECORDS, ESTIMATES, BLOCKS, PREDICTIONS, STORED])
def test_no_name_stands_twice_and_every_column_has_a_meaning(table: tuple[records.Column, ...]) -> None:
    names = [column.name for column in table]
    assert len(names) == len(set(names))
    assert all(column.meaning for column in table)
    assert list(records.units(table)) == names


def test_every_measurement_has_a_flag() -> None:
    names = {column.name for column in RECORDS}
    assert all(f"{column.name}_qc" in names for column in MEASURED)


def test_phases_and_flags_have_the_numbers_of_og1() -> None:
    assert {phase.name: phase.value for phase in Phase} == {
        "UNKNOWN": 0,
        "ASCENT": 1,
        "DESCENT": 2,
        "SURFACING": 3,
        "PARKING": 4,
        "INFLEXION": 5,
        "PROPELLED": 6,
        "TRANSITION": 7,
    }
    assert [int(flag) for flag in Quality] == [0, 1, 2, 3, 4, 9]


@pytest.mark.parametrize("table", [RECORDS, ESTIMATES, BLOCKS, PREDICTIONS, STORED])
def test_conform_gives_every_column_in_order_with_its_type(table: tuple[records.Column, ...]) -> None:
    first = table[0]
    content = pd.to_datetime([0, 1], utc=True, unit="s") if first.dtype.startswith("datetime") else [0, 1]
    found = records.conform(pd.DataFrame({first.name: content}, index=[7, 9]), table)
    assert list(found.columns) == [column.name for column in table]
    assert [str(dtype) for dtype in found.dtypes] == [column.dtype for column in table]
    assert found.index.tolist() == [0, 1]


def test_what_is_missing_is_missing_and_never_zero() -> None:
    found = records.conform(pd.DataFrame({"time": records.timestamps(np.array([1.5e9]))}), RECORDS)
    row = found.iloc[0]
    assert np.isnan(row["pitch"])
    assert row["pitch_qc"] == Quality.MISSING
    assert row["block"] == -1
    assert row["phase"] == Phase.UNKNOWN


def test_a_column_that_no_table_knows_is_refused() -> None:
    with pytest.raises(KeyError, match="not in the canonical table: speed, yaw"):
        records.conform(pd.DataFrame({"yaw": [1.0], "speed": [1.0]}), RECORDS)


@given(st.lists(st.integers(631152000 * 10**6, 4102444800 * 10**6), min_size=1, max_size=20))
def test_time_goes_to_stamps_and_back_to_the_microsecond(micro: list[int]) -> None:
    posix = np.array(micro) * 1e-6
    stamps = records.timestamps(posix)
    assert str(stamps.dtype) == "datetime64[ns, UTC]"
    assert stamps.as_unit("us").asi8.tolist() == micro
    np.testing.assert_allclose(records.seconds(pd.Series(stamps)), posix, rtol=0, atol=1e-6)


def test_what_is_flagged_bad_or_probably_bad_does_not_enter() -> None:
    flags = np.array([1, 2, 3, 4, 9], dtype=np.int8)
    frame = pd.DataFrame(
        {
            "pressure": np.arange(5.0),
            "pressure_qc": flags,
            "depth": np.arange(5.0),
            "buoyancy_volume": np.arange(5.0),
            "buoyancy_volume_qc": flags[::-1],
            "roll": np.arange(5.0),
        }
    )
    found = records.undoubted(frame)
    np.testing.assert_array_equal(found["pressure"], [0.0, 1.0, np.nan, np.nan, 4.0])
    np.testing.assert_array_equal(found["depth"], [0.0, 1.0, np.nan, np.nan, 4.0])
    np.testing.assert_array_equal(found["buoyancy_volume"], [0.0, np.nan, np.nan, 3.0, 4.0])
    assert found["roll"].tolist() == frame["roll"].tolist()
    assert frame["pressure"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_usable_is_what_was_measured_and_not_flagged_bad() -> None:
    frame = pd.DataFrame({"pitch": [0.1, 0.1, 0.1, 0.1, 0.1, np.nan], "pitch_qc": [0, 1, 2, 3, 4, 1]})
    assert records.usable(frame, "pitch").tolist() == [True, True, True, False, False, False]

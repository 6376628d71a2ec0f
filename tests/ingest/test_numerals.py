"""Numerals: a column says by itself how it is written, or the file does."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.ingest import numerals

APART = "thousands set apart, first "


@pytest.mark.parametrize(
    ("usual", "fields", "numbers", "written"),
    [
        (".", ["0.5", "-1,074.69"], [0.5, -1074.69], f"{APART}'-1,074.69'"),
        (".", ["0,5", "1.074,69"], [0.5, 1074.69], f"a decimal comma and {APART}'1.074,69'"),
        (".", ["1,074", "0,500"], [1.074, 0.5], "a decimal comma"),
        (".", ["1,234,567", "2"], [1234567.0, 2.0], f"{APART}'1,234,567'"),
        (".", ["1'230.5", "1\u00a0000"], [1230.5, 1000.0], f"{APART}'1'230.5'"),
        (",", ["1 230,5", "nan"], [1230.5, np.nan], f"{APART}'1 230,5'"),
        (",", ["0.5", "1.25"], [0.5, 1.25], "a decimal point"),
        (".", ["1.5D+02", "2e1"], [150.0, 20.0], ""),
        (".", ["1.5", "x", "", "-inf"], [1.5, np.nan, np.nan, -np.inf], ""),
        (".", ["1.5", "2,5", "3,5"], [np.nan, 2.5, 3.5], "a decimal comma"),
        # Nothing in the column says which: the other columns of the file do.
        (".", ["1,074", "2,500"], [1074.0, 2500.0], "thousands set apart by the mark of other columns, first '1,074'"),
        (",", ["1,074", "2,500"], [1.074, 2.5], ""),
        (",", ["1.074", "2.500"], [1074.0, 2500.0], "thousands set apart by the mark of other columns, first '1.074'"),
    ],
)  # fmt: skip
def test_a_column_says_how_it_is_written(usual: str, fields: list[str], numbers: list[float], written: str) -> None:
    found, told = numerals.values(pd.Series(fields, dtype="object"), usual)
    np.testing.assert_array_equal(found, numbers)
    assert told == written


@given(st.lists(st.decimals(-1e6, 1e6, places=2), min_size=1, max_size=8), st.sampled_from([",", ""]))
def test_what_python_writes_comes_back_in_both_countries(values: list[float], group: str) -> None:
    points = [format(value, f"{group}.2f") for value in values]
    commas = [text.translate(str.maketrans(",.", ".,")) for text in points]
    for fields, usual in ((points, "."), (commas, ",")):
        found, _ = numerals.values(pd.Series(fields, dtype="object"), usual)
        np.testing.assert_allclose(found, [float(value) for value in values])
        assert all(numerals.is_numeral(text) for text in fields)


@pytest.mark.parametrize("text", ["", "x", "1,2,3", "2016-06-22", "1.2.3", "12:30"])
def test_what_is_no_numeral(text: str) -> None:
    assert not numerals.is_numeral(text)

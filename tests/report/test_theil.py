"""Theil's split: shares that add to one, each the whole of its own kind of error, and those of a regression."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.stats import linregress

from pipeline.report.theil import SHARES, split

MEASURED = np.array([0.2, 0.25, 0.3, 0.4, 0.5])
EQUAL = np.ones(5)
ERRORS = st.lists(st.floats(-0.3, 0.3), min_size=5, max_size=5).map(np.array)
WEIGHTS = st.lists(st.floats(0.1, 10.0), min_size=5, max_size=5).map(np.array)


def shares(predicted: np.ndarray, weights: np.ndarray = EQUAL, measured: np.ndarray = MEASURED) -> list[float]:
    found = split(predicted, measured, weights)
    assert tuple(found) == SHARES
    return list(found.values())


@given(ERRORS, WEIGHTS)
def test_shares_lie_between_nothing_and_all_and_add_to_one(error: np.ndarray, weights: np.ndarray) -> None:
    assume(np.max(np.abs(error)) > 1e-6)
    found = shares(MEASURED + error, weights)
    assert sum(found) == pytest.approx(1.0)
    assert all(0.0 <= share <= 1.0 for share in found)


@given(ERRORS, WEIGHTS, st.floats(0.01, 100.0))
def test_neither_units_nor_the_size_of_all_weights_matter(error: np.ndarray, weights: np.ndarray, unit: float) -> None:
    assume(np.max(np.abs(error)) > 1e-3)
    here, there = shares(MEASURED + error, weights), shares(unit * (MEASURED + error), 7.0 * weights, unit * MEASURED)
    np.testing.assert_allclose(there, here, atol=1e-9)


@given(ERRORS)
def test_they_are_those_of_the_measured_regressed_on_the_predicted(error: np.ndarray) -> None:
    predicted = MEASURED + error
    assume(np.ptp(predicted) > 1e-3)
    line = linregress(predicted, MEASURED)
    square = np.mean(error**2)
    assume(square > 1e-6)
    left = MEASURED - line.intercept - line.slope * predicted
    expected = [np.mean(error) ** 2, (1.0 - line.slope) ** 2 * np.var(predicted), np.mean(left**2)]
    np.testing.assert_allclose(shares(predicted), np.array(expected) / square, atol=1e-9)


@pytest.mark.parametrize(
    ("predicted", "expected"),
    [
        (MEASURED + 0.05, [1.0, 0.0, 0.0]),
        (MEASURED.mean() + 1.3 * (MEASURED - MEASURED.mean()), [0.0, 1.0, 0.0]),
        (np.full(5, MEASURED.mean()), [0.0, 0.0, 1.0]),
    ],
    ids=["offset", "slope", "scatter"],
)
def test_each_kind_of_error_is_all_of_itself(predicted: np.ndarray, expected: list[float]) -> None:
    np.testing.assert_allclose(shares(predicted), expected, atol=1e-12)


@pytest.mark.parametrize("few", [1, 2])
def test_of_fewer_than_three_blocks_and_of_no_error_nothing_is_said(few: int) -> None:
    assert all(math.isnan(share) for share in shares(MEASURED[:few] + 0.1, EQUAL[:few], MEASURED[:few]))
    assert all(math.isnan(share) for share in shares(MEASURED))

"""Peaks are those that SciPy finds, with the same prominence."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import find_peaks

from pipeline.ingest.peaks import peaks


@given(st.lists(st.integers(0, 6), max_size=60), st.floats(0.0, 6.0))
def test_peaks_saddles_and_plateaus_are_those_of_scipy(heights: list[int], prominence: float) -> None:
    curve = np.array(heights, dtype=float)
    assert peaks(curve, prominence).tolist() == find_peaks(curve, prominence=prominence)[0].tolist()


@pytest.mark.parametrize("prominence", [0.01, 1.0, 3.0, 8.0])
def test_the_turns_of_a_noisy_saw_are_those_of_scipy(prominence: float) -> None:
    rng = np.random.default_rng(3)
    depth = np.interp(np.arange(20_000.0), np.arange(0, 20_001, 500), rng.uniform(0.0, 200.0, 41))
    depth += rng.normal(0.0, 0.5, depth.size)
    for curve in (depth, -depth):
        assert peaks(curve, prominence).tolist() == find_peaks(curve, prominence=prominence)[0].tolist()


@pytest.mark.parametrize("curve", [[], [1.0], [1.0, 1.0], [0.0, 1.0], [1.0, 0.0, 1.0]])
def test_an_end_is_no_peak(curve: list[float]) -> None:
    assert peaks(np.array(curve), 0.0).size == 0

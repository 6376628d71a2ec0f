"""Drawing: thinning keeps what a line shows, and the same figure gives the same bytes."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.report.figures.drawing import canvas, clock, envelope, inline, render, spans, style, thin, with_gaps


@given(st.integers(3001, 20_000), st.integers(0, 100))
def test_thinning_keeps_the_extremes_and_the_order(size, seed):
    rng = np.random.default_rng(seed)
    time, values = np.sort(rng.uniform(0.0, 1e4, size)), rng.normal(size=size)
    t, v = thin(time, values)
    assert t.size <= 3000
    assert np.all(np.diff(t) >= 0)
    assert (v.min(), v.max()) == (values.min(), values.max())


def test_thinning_leaves_gaps_as_gaps():
    time, values = np.arange(30_000.0), np.sin(np.arange(30_000.0))
    values[10_000:20_000] = np.nan
    t, v = thin(time, values)
    assert np.isnan(v[(t > 10_100) & (t < 19_900)]).all()
    assert np.isfinite(v[(t < 9_900) | (t > 20_100)]).all()


def test_a_short_series_is_drawn_as_it_is():
    time, values = np.arange(100.0), np.arange(100.0)
    assert thin(time, values)[1] is values


def test_five_million_rows_become_a_few_thousand_points():
    time = np.arange(5_000_000.0)
    assert thin(time, np.sin(time))[0].size <= 3000
    assert envelope(time, time - 1.0, time + 1.0)[0].size <= 3000


def test_a_thinned_band_still_covers_the_whole_band():
    rng = np.random.default_rng(1)
    time, low = np.arange(50_000.0), rng.normal(size=50_000)
    t, lowest, highest = envelope(time, low, low + 1.0)
    nearest = np.searchsorted(t, time, side="right") - 1
    assert np.all(lowest[nearest] <= low)
    assert np.all(highest[nearest] >= low + 1.0)


def test_a_line_is_broken_where_nothing_was_measured_for_long():
    t, v = with_gaps(np.array([0.0, 1.0, 2.0, 50.0, 51.0]), np.array([1.0, np.nan, 3.0, 4.0, 5.0]), 10.0)
    assert t.tolist() == [0.0, 2.0, 2.0, 50.0, 51.0]
    np.testing.assert_array_equal(v, [1.0, 3.0, np.nan, 4.0, 5.0])


@pytest.mark.parametrize(
    ("where", "found"),
    [
        ([0, 0, 0, 0], []),
        ([1, 1, 0, 1], [(0.0, 2.0), (3.0, 3.0)]),
        ([0, 1, 1, 1], [(1.0, 3.0)]),
    ],
)
def test_spans_are_the_stretches_where_a_condition_holds(where, found):
    assert spans(np.arange(4.0), np.array(where, dtype=bool)) == found


@pytest.mark.parametrize(("length", "unit", "last"), [(7200.0, "hours", 2.0), (864_000.0, "days", 10.0)])
def test_long_missions_are_told_in_days(length, unit, last):
    values, chosen = clock(np.array([1e9, 1e9 + length]), 1e9)
    assert (chosen, values[-1]) == (unit, last)


def drawing() -> str:
    with style():
        figure = canvas(4.0, 3.0)
        axes = figure.subplots()
        axes.plot([0, 1], [0, 1], color="#0072b2", label="measured")
        axes.fill_between([0, 1], [0, 0], [1, 2], color="#d55e00", alpha=0.2)
        axes.legend()
        return render(figure, "test")


def test_the_same_figure_gives_the_same_bytes():
    assert drawing() == drawing()


def test_identifiers_are_the_figures_own_and_resolve():
    svg = drawing()
    identifiers = re.findall(r'\bid="([^"]+)"', svg)
    assert identifiers
    assert len(identifiers) == len(set(identifiers))
    assert all(name.startswith("test-") for name in identifiers)
    assert set(re.findall(r'(?:href="#|url\(#)([^")]+)', svg)) <= set(identifiers)


def test_colours_follow_the_style_sheet_and_nothing_says_when_it_was_drawn():
    svg = inline(drawing())
    assert "var(--measured, #0072b2)" in svg
    assert "var(--held, #d55e00)" in svg
    assert "var(--ink, #1f2933)" in svg
    assert "dc:date" not in svg
    assert svg.startswith("<svg")

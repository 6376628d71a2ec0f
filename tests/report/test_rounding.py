"""Rounding: two digits of every uncertainty, and numbers of a column beneath each other."""

from __future__ import annotations

import re

import pytest

from pipeline.report.rounding import aligned, amount, uncertainty


@pytest.mark.parametrize(
    ("value", "std", "shown"),
    [(0.61234, 0.0104, "0.612 ± 0.010"), (-1.0, 0.0996, "−1.00 ± 0.10"), (1234.5, 61.0, "1234 ± 61"),
     (2.0, 0.0, "2.000 ± 0.000"), (5e-10, 1.04e-10, "(5.0 ± 1.0)·10⁻¹⁰"), (0.0, 2e-9, "(0.0 ± 2.0)·10⁻⁹"),
     (-0.04, 2.2, "0.0 ± 2.2"), (0.000123, 0.0000456, "0.000123 ± 0.000046")],
)  # fmt: skip
def test_an_uncertainty_has_two_digits_and_its_value_as_many_decimals(value: float, std: float, shown: str) -> None:
    assert amount(value, std, sign=False) == shown


@pytest.mark.parametrize(("std", "shown"), [(0.0104, "0.010"), (61.0, "61"), (1.04e-10, "1.0·10⁻¹⁰"), (0.0, "0.000")])
def test_an_uncertainty_alone_has_two_digits(std: float, shown: str) -> None:
    assert uncertainty(std) == shown


def column(*cells: str) -> list[str]:
    """Return the cells of a column as a reader's eye has them, _ for what is not seen."""
    rows = "".join(f'<tr><th scope="row">x</th><td class="number">{cell}</td><td>1.5</td></tr>\n' for cell in cells)
    page = aligned(f"<table><thead><tr><th>1.25</th></tr></thead><tbody>\n{rows}</tbody></table>")
    assert page.count("<td>1.5</td>") == len(cells)
    assert "<th>1.25</th>" in page
    seen = re.sub(r'<i class="pad" data-pad="([^"]*)"></i>', lambda pad: "_" * len(pad[1]), page)
    return re.findall(r'<td class="number">(.*?)</td>', seen)


def test_decimal_points_and_uncertainties_stand_beneath_each_other() -> None:
    assert column("7", "0.612 ± 0.010", "−12.5 ± 11.0", "–") == [
        "7____" + "_" * 9,
        "0.612 ± _0.010",
        "−12.5__ ± 11.0__",
        "–____" + "_" * 9,
    ]


def test_ranges_and_second_lines_are_no_obstacle_and_flags_stay_before_their_number() -> None:
    flag = '<span aria-hidden="true">▲ </span>'
    assert column("0.95 to 1.051", "0.9 to 1.1") == ["0.95 to 1.051", "0.9_ to 1.1__"]
    assert column(f"{flag}1.5", '2.25<span class="unit">dives</span>', "3<br>4.5") == [
        f"{flag}1.5_", '2.25<span class="unit">dives</span>', "3___<br>4.5",
    ]  # fmt: skip


def test_cells_that_are_built_otherwise_or_are_words_are_left_alone() -> None:
    assert column("1.5 ± 0.5", "1 to 2") == ["1.5 ± 0.5", "1 to 2"]
    assert column("legs", "12") == ["legs", "12"]

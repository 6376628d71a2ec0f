"""The coefficient block: values and 1-sigma of both forms, and a plain word where a form cannot hold the vehicle."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pipeline.conventions import from_seaglider, from_slocum
from pipeline.report.coefficients import text
from pipeline.vehicle import Vehicle, load

ROW = re.compile(r"^  (\w+) +([-\d.e+]+)(?: ± ([-\d.e+]+))?")


def rows(block: str) -> dict[str, tuple[float, float]]:
    found = [match.groups() for line in block.splitlines() if (match := ROW.match(line))]
    return {name: (float(value), float(std or 0.0)) for name, value, std in found}


def test_slocums_coefficients_come_out_as_they_went_in() -> None:
    kept = {"C_D0": 0.144, "C_D1": 2.88, "a_h": 3.1, "a_w": 3.73427, "S": 0.1}
    found = rows(text(from_slocum(load("slocum-g2"), kept, source="fit"), "m"))
    assert {name: found[name][0] for name in kept} == pytest.approx(kept, rel=1e-5)


def test_a_seagliders_own_constants_come_out_as_they_went_in() -> None:
    kept = {"hd_a": 0.003836, "hd_b": 0.010078, "hd_c": 9.85e-6, "abs_compress": 4.1e-6, "therm_expan": 7.05e-5}
    block = text(from_seaglider(load("seaglider"), kept, source="log"), "m")
    found = rows(block)
    assert {name: found[name][0] for name in kept} == pytest.approx(kept, rel=1e-6)
    assert found["hd_s"][0] == -0.25
    assert "  not to be had: seaglider: found drag_exponent -0.5; Slocum's law has none" in block


def test_relative_1_sigma_is_that_of_the_vehicle(petrel: Vehicle) -> None:
    found = rows(text(petrel, "m"))
    for name, base in (("C_D0", "parasite_drag"), ("hd_b", "parasite_drag"), ("hd_a", "lift_slope")):
        value, std = found[name]
        assert std / value == pytest.approx(petrel.std(base) / petrel[base], rel=0.01)
    lift = found["a_h"][0] + found["a_w"][0]
    assert found["a_h"][1] / lift == pytest.approx(petrel.std("lift_slope") / petrel["lift_slope"], rel=0.01)
    assert found["abs_compress"] == pytest.approx((4.2e-6, 1e-6))  # 1/dbar, ten thousand times that per Pa
    assert found["a_w"][1] == 0.0


def test_lift_at_zero_fits_neither(petrel: Vehicle) -> None:
    block = text(petrel.with_values({"lift_at_zero": 2.0}, "test"), "m")
    assert block.count("not to be had: petrel-ii: found lift_at_zero 2") == 2


def test_unknown_coefficients_are_called_so() -> None:
    block = text(load("bare.yaml", Path(__file__).parents[1]), "m")
    assert re.search(r"C_D0 +unknown", block)
    assert "nan" not in block

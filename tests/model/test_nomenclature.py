"""The page of nomenclature lists every name that results and inputs of the model go by."""

import re
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from pipeline.model.dimensionless import Scales
from pipeline.model.dynamics import Body
from pipeline.model.gradient import Gradient
from pipeline.model.steady import Steady
from pipeline.model.trajectory import Flight, Inputs
from pipeline.vehicle import Polar, Propeller

PAGE = (Path(__file__).parents[2] / "docs" / "nomenclature.md").read_text(encoding="utf-8")
LISTED = set(re.findall(r"`([a-z_0-9]+)`", PAGE))
#: Names that speak for themselves, and those that a vehicle file spells out.
PLAIN = {"reason", "polar", "thrust_slope", "diameter"}


@pytest.mark.parametrize("table", [Steady, Flight, Inputs, Scales, Gradient, Body, Polar, Propeller])
def test_every_name_is_listed(table: Any) -> None:
    names = {field.name for field in fields(table)} if hasattr(table, "__dataclass_fields__") else set(table._fields)
    assert names - PLAIN <= LISTED


def test_every_row_has_symbol_name_unit_and_meaning() -> None:
    rows = [line for line in PAGE.splitlines() if line.startswith("|") and not line.startswith("|---")]
    assert len(rows) > 40
    for row in rows:
        assert len([cell for cell in row.strip("|").split("|") if cell.strip()]) == 4, row

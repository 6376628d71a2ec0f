"""What figures are drawn from: distances on the map, parts of each dive's error, what would return to steady flight."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from synthetic import SETTINGS, START, blocks, inputs

from pipeline.mission import Mission
from pipeline.model.predict import predict
from pipeline.records import RECORDS, conform, timestamps
from pipeline.report.averages import parity as parts
from pipeline.report.compare import compare
from pipeline.report.figures.parity import parity
from pipeline.report.figures.profiles import profiles
from pipeline.report.figures.stability import stability
from pipeline.report.figures.track import track
from pipeline.report.fitting.fit import fit
from pipeline.vehicle import Coefficient, Vehicle


def fixes(latitude: list[float], longitude: list[float], every: float) -> pd.DataFrame:
    frame = pd.DataFrame({"time": timestamps(START + every * np.arange(len(latitude)))})
    for name, values in (("latitude", latitude), ("longitude", longitude)):
        frame[name] = values
        frame[f"{name}_qc"] = np.where(np.isfinite(values), 1, 9).astype(np.int8)
    return conform(frame, RECORDS)


def test_the_map_is_in_metres_of_the_ellipsoid_and_counts_stretches_without_a_fix() -> None:
    """One degree of latitude at the equator is 110 574 m, of longitude 111 320 m (WGS 84)."""
    nothing = {"reason": "no heading", "passages": [], "sentence": ""}
    found = track(fixes([0.0, 1.0, np.nan, 1.0], [0.0, 0.0, np.nan, 1.0], 1000.0), nothing)
    assert found is not None
    assert found.table is not None
    assert found.table.frame["north"].tolist() == pytest.approx([0.0, 110_574.0, 110_574.0], rel=2e-4)
    assert found.table.frame["east"].tolist() == pytest.approx([0.0, 0.0, 111_320.0], rel=2e-4)
    assert "2 stretches without a fix" in found.alt
    assert "No current is drawn: no heading." in found.caption
    assert track(fixes([0.0], [0.0], 1.0), nothing) is None


def test_parts_of_all_dives_are_the_mean_of_the_parts_of_each(petrel: Vehicle) -> None:
    table = blocks(dives=5, each=2, extra_drag=1.0)
    comparison = compare(table, predict(petrel, table), petrel, sensor_used=False, settings=SETTINGS)
    one, mean = parts(comparison, SETTINGS, by_dive=True), parts(comparison, SETTINGS)
    for (trim, quantity), group in one.groupby(["trim", "quantity"]):
        row = mean[(mean["trim"] == trim) & (mean["quantity"] == quantity)].iloc[0]
        assert len(group) == row["dives"] == 5
        assert group["even"].mean() == pytest.approx(row["even"])
        assert group["odd"].mean() == pytest.approx(row["odd"])
    found = parity(comparison, SETTINGS)
    assert found is not None
    assert found.table is not None
    assert sorted(set(found.table.frame["dive"])) == [-1, 1, 2, 3, 4, 5]
    assert parity(comparison[comparison["direction"] < 0], SETTINGS) is None


def test_steady_flight_of_petrel_returns_from_what_is_near_and_an_unknown_inertia_is_said(petrel: Vehicle) -> None:
    table = blocks(dives=2)
    found = stability(table, predict(petrel, table), petrel)
    assert found is not None
    share = int(found.alt.split(", ")[-1].split(" % die out")[0])
    assert 50 <= share <= 100
    item = petrel.coefficients["pitch_inertia"]
    unknown = {**petrel.coefficients, "pitch_inertia": Coefficient(np.nan, np.nan, item.unit, "unknown")}
    vehicle = Vehicle(petrel.name, petrel.description, unknown)
    blind = stability(table, predict(vehicle, table), vehicle)
    assert blind is not None
    assert "The region of attraction is not known: the vehicle file leaves pitch_inertia unknown." in blind.alt
    assert "Right:" in found.caption
    assert "Right:" not in blind.caption
    assert found.svg.count("axes_2") == 1
    assert "axes_2" not in blind.svg  # no empty panel


def test_flight_by_the_propellers_power_has_its_region_too(petrel: Vehicle) -> None:
    by_power = petrel.with_values({"propulsive_efficiency": 0.5}, "a test")
    table = blocks(dives=2, powered_climbs=True).query("powered").assign(propeller_speed=np.nan, propeller_power=20.0)
    found = stability(table, predict(by_power, table), by_power)
    assert found is not None
    assert "climbs under propeller" in found.alt
    assert 50 <= int(found.alt.split(", ")[-1].split(" % die out")[0]) <= 100


def test_without_theory_there_is_no_figure_of_stability(unknown: Vehicle) -> None:
    given = inputs(Mission(vehicle="petrel-ii"), unknown, blocks(dives=1))
    assert stability(given.blocks, given.predictions, unknown) is None


def test_caption_of_profiles_speaks_of_resamples_only_where_some_were_drawn(petrel: Vehicle) -> None:
    few, many = (fit(blocks(dives=dives), petrel) for dives in (3, 6))
    for found, drawn in ((few, False), (many, True)):
        picture = profiles(found)
        assert picture is not None
        assert ("Orange" in picture.caption) is drawn

"""Part by part: where a mission is cut, and that neither parts, nor threads, nor the file change what is found."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import mission, simulate, store, vehicle
from pipeline.estimate import stage
from pipeline.estimate.ballast import hull
from pipeline.estimate.blocks import means
from pipeline.estimate.preparation import Prepared, prepare
from pipeline.estimate.stage import InMemory, Summary, cuts, estimate, stream
from pipeline.ingest import ingest
from pipeline.mission import Mission
from pipeline.records import RECORDS, Phase, conform, of_method
from pipeline.vehicle import Vehicle

#: Records that the mission is prepared on, and in a part of it.
STRETCH, SIZE = 2_000, 4_000


def flags(surfaced: list[int], block: list[int]) -> pd.DataFrame:
    phase = np.full(len(block), int(Phase.DESCENT), dtype=np.int8)
    phase[surfaced] = Phase.SURFACING
    return pd.DataFrame({"phase": phase, "block": np.array(block, dtype=np.int32)})


def test_a_cut_is_made_at_the_surface_if_it_is_near() -> None:
    assert cuts(flags([90, 160], [-1] * 240), 100) == [(0, 90), (90, 240)]


def test_a_cut_far_from_the_surface_is_made_between_blocks() -> None:
    block = [0] * 95 + [1] * 125 + [-1] * 20
    assert cuts(flags([], block), 100) == [(0, 95), (95, 240)]


def test_a_block_longer_than_a_part_stays_whole() -> None:
    assert cuts(flags([], [0] * 250 + [1] * 50), 100) == [(0, 250), (250, 300)]
    assert cuts(flags([], [0] * 300), 100) == [(0, 300)]


def test_parts_are_alike_and_even_in_number() -> None:
    lengths = [last - first for first, last in cuts(flags([], [-1] * 700), 100)]
    assert len(lengths) == 8
    assert set(lengths) <= {87, 88}
    assert len(cuts(flags([], [-1] * 500), 100)) == 4
    assert cuts(flags([], [-1] * 150), 100) == [(0, 150)]


@given(
    st.lists(st.tuples(st.integers(1, 120), st.booleans(), st.booleans()), max_size=12),
    st.integers(2, 100),
)
def test_cuts_cover_every_record_once_and_split_no_block(runs: list[tuple[int, bool, bool]], size: int) -> None:
    block = [k if inside else -1 for k, (length, inside, _) in enumerate(runs) for _ in range(length)]
    afloat = [up for length, _, up in runs for _ in range(length)]
    frame = flags([k for k, up in enumerate(afloat) if up], block)
    bounds = cuts(frame, size)
    assert [first for first, _ in bounds] == [0] + [last for _, last in bounds[:-1]]
    assert bounds[-1][1] == len(block)
    for first, _ in bounds[1:]:
        assert block[first] < 0 or block[first] != block[first - 1]


class Case(NamedTuple):
    """A simulated mission with fixes, and what its parts know of the whole."""

    mission: Mission
    vehicle: Vehicle
    records: pd.DataFrame
    prepared: Prepared


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    folder = tmp_path_factory.mktemp("raw") / "glide"
    simulate.simulate("petrel2-scs-2014", folder, seed=0)
    settings = mission.load(folder)
    craft = vehicle.load(settings.vehicle, folder)
    records = ingest(settings).records.iloc[:14_000]
    body = hull(settings, craft, {}, records)
    return Case(settings, craft, records, prepare([records.iloc[:STRETCH]], craft, settings, body))


@pytest.fixture(autouse=True)
def prepared_once(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage, "prepare", lambda *given, **options: case.prepared)
    monkeypatch.setattr(stage, "PART_RECORDS", SIZE)


def run(source: stage.Source, case: Case, threads: int = 1) -> tuple[pd.DataFrame, Summary]:
    tables: list[pd.DataFrame] = []
    summary = stream(source, case.vehicle, case.mission, tables.append, constants={}, threads=threads)
    return pd.concat(tables, ignore_index=True), summary


def same(a: tuple[pd.DataFrame, Summary], b: tuple[pd.DataFrame, Summary]) -> None:
    pd.testing.assert_frame_equal(a[0], b[0], check_exact=True)
    pd.testing.assert_frame_equal(a[1].blocks, b[1].blocks, check_exact=True)
    assert store.plain(a[1].report) == store.plain(b[1].report)
    assert a[1].findings == b[1].findings


def test_threads_and_file_change_no_digit(case: Case, tmp_path: Path) -> None:
    assert len(cuts(case.records)) > 2
    one = run(InMemory(case.records), case)
    same(one, run(InMemory(case.records), case, threads=3))
    store.write_table(tmp_path / "records.parquet", case.records, RECORDS)
    with store.table_reader(tmp_path / "records.parquet") as records:
        same(one, run(records, case, threads=2))


def test_estimators_prepared_at_the_same_time_are_prepared_the_same(case: Case) -> None:
    body = hull(case.mission, case.vehicle, {}, case.records)
    both = prepare([case.records.iloc[:STRETCH]], case.vehicle, case.mission, body, threads=2)
    assert both.adjusted is not None
    assert case.prepared.adjusted is not None
    assert repr(both.kinematic.noise) == repr(case.prepared.kinematic.noise)
    assert both.adjusted.report == case.prepared.adjusted.report
    np.testing.assert_array_equal(both.adjusted.craft.value, case.prepared.adjusted.craft.value)
    assert repr(both.adjusted) == repr(case.prepared.adjusted)


def test_parts_give_what_the_whole_gives(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    parts, in_parts = run(InMemory(case.records), case)
    monkeypatch.setattr(stage, "PART_RECORDS", len(case.records))
    whole, _ = run(InMemory(case.records), case)
    for method in stage.METHODS:
        found, expected = of_method(parts, method), of_method(whole, method)
        assert (found["observable"] == expected["observable"]).mean() > 0.99
        both = (found["observable"] & expected["observable"]).to_numpy()
        assert both.any()
        gap = (np.abs(found["speed"] - expected["speed"]) / expected["speed_std"])[both]
        assert gap.median() < 0.1
        assert gap.max() < 1.0
    body, _ = hull(case.mission, case.vehicle, {}, case.records)
    blocks = means(case.records, of_method(whole, "kinematic"), case.vehicle, case.mission, body)
    assert in_parts.blocks["block"].tolist() == blocks["block"].tolist()
    np.testing.assert_allclose(in_parts.blocks["depth_rate"], blocks["depth_rate"], rtol=1e-9)
    np.testing.assert_allclose(in_parts.blocks["net_buoyancy"], blocks["net_buoyancy"], rtol=1e-4)


def test_a_mission_without_records_has_tables_without_rows(case: Case, tmp_path: Path) -> None:
    store.write_table(tmp_path / "records.parquet", conform(pd.DataFrame(), RECORDS), RECORDS)
    with store.table_reader(tmp_path / "records.parquet") as records:
        table, summary = run(records, case)
    assert len(table) == len(summary.blocks) == 0
    assert estimate(case.records.iloc[:0], case.vehicle, case.mission).estimates.empty

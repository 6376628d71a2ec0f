"""The index: every mission's key numbers as page, JSON and table, what wants attention, and what failed."""

from __future__ import annotations

import io
import json
import math
import re
from typing import Any

import pandas as pd
import pytest
from pages import Page, marking, numbers, unsaid
from synthetic import blocks, inputs

from pipeline import store
from pipeline.mission import Mission
from pipeline.report import Index, Report, build, frontpage, index
from pipeline.report.figures import NO_CAMPAIGN_FIGURE, files
from pipeline.report.figures import missions as figures
from pipeline.report.guide import guide
from pipeline.report.overview import KEYS, frame, overview, tsv
from pipeline.report.rounding import amount
from pipeline.vehicle import Vehicle

LINE = "bad/ctd.csv: found no column of pressure; expected one"


def as_read(content: Any) -> Any:
    """Return `content` as it comes back from its file: null where there is no number."""
    return json.loads(json.dumps(store.plain(content)))


@pytest.fixture(scope="module")
def summaries(petrel: Vehicle, built: Report) -> list[dict[str, Any]]:
    """Return a mission that has everything, three of one vehicle, one without steady flight and one that failed."""
    plain = Mission(vehicle="petrel-ii", name="plain")
    twins = [build(inputs(plain.model_copy(update={"name": f"m{k}"}), petrel, blocks(seed=k)))[0] for k in range(2)]
    nothing = build(inputs(plain.model_copy(update={"name": "empty"}), petrel, blocks().iloc[:0]))[0]
    return [*(as_read(each) for each in (built.summary, *twins, nothing)), {"mission": "bad", "error": LINE}]


@pytest.fixture(scope="module")
def made(summaries: list[dict[str, Any]]) -> Index:
    return index(summaries)


def test_the_page_lists_missions_sortable_and_the_failed_with_their_line(made: Index) -> None:
    page = Page(made.page)
    assert page.open == []
    assert "4 of 5 missions analysed, 1 failed." in page.words
    assert f"Failed bad : {LINE}" in page.words
    assert 'href="complete/report.html"' in made.page
    assert made.page.count('aria-sort="none"') == made.page.count("<button") == len(KEYS) - 1
    named = re.findall(
        r'<th scope="row" data-value="([^"]+)"><a [^>]+>\1</a><span class="unit">petrel-ii</span>', made.page
    )
    assert sorted(named) == sorted(row["mission"] for row in made.content["missions"])
    assert len(page.identifiers) == len(set(page.identifiers))
    assert [item for item in page.loads if not item.startswith(("data:", "#"))] == []
    assert len(page.figures) == 2
    assert set(re.findall(r'href="(index\.figures/[^"]+)"', made.page)) == set(files.CAMPAIGN_NAMES)
    assert all(len(words) > 40 for words in page.figures)
    assert page.headings[0] == 1
    assert all(after - before <= 1 for before, after in zip(page.headings, page.headings[1:], strict=False))


def test_every_number_of_the_table_is_in_the_json(made: Index) -> None:
    row = made.content["missions"][0]
    for key in KEYS:
        assert key.column.name in row
        assert key.std is None or key.std.name in row
    words = Page(made.page).words
    assert amount(row["measured_m_s"], row["measured_m_s_std"], sign=False) in words
    assert amount(row["error_cm_s"], row["error_cm_s_std"]) in words
    drag = made.content["vehicles"][0]["coefficients"][0]
    assert drag["name"] == "parasite_drag"
    assert drag["verdict"] in made.page


def test_every_number_on_the_page_is_in_index_json(made: Index) -> None:
    with marking():
        text = frontpage.render(made.content, made.pictures)
    assert len(numbers(text)) > 60
    assert unsaid(text, made.content) == []


def test_a_mission_without_steady_flight_is_flagged_with_the_reason(made: Index) -> None:
    row = next(row for row in made.content["missions"] if row["mission"] == "empty")
    assert row["flags"]["blocks"] == "no steady block is used"
    assert "▲ empty : no steady block is used" in Page(made.page).words
    vehicle = made.content["vehicles"][0]
    assert vehicle["left_out"] == [{"mission": "empty", "reason": "no steady block"}]
    assert "Without empty: no steady block." in Page(made.page).words


def test_a_significant_gap_and_a_drag_against_the_vehicle_file_are_flagged(summaries: list[dict[str, Any]]) -> None:
    loud = as_read(summaries[1])
    for part in loud["parts"]:
        part["significance"] = 3.1
    loud["fit"]["parameters"][0]["verdict"] = "determined by the data, against the prior"
    loud["findings"] = [{"severity": "error"}, {"severity": "warning"}, {"severity": "note"}]
    row = index([loud]).content["missions"][0]
    assert row["flags"] == {
        "significance": "theory and measurement differ significantly",
        "drag_percent": "the drag contradicts the vehicle file",
        "warnings": "1 of the findings is an error",
    }
    assert row["warnings"] == 2


def test_a_correction_that_the_data_tell_less_well_than_was_known_has_no_number(
    summaries: list[dict[str, Any]],
) -> None:
    told = json.loads(json.dumps(summaries[0]))
    item = next(each for each in told["fit"]["parameters"] if each["name"] == "parasite_drag")
    untold = json.loads(json.dumps(told))
    for each in untold["fit"]["parameters"]:
        each["std"] = 1.01 * each["prior_std"]
    (known,), (unknown,) = (overview([one])["missions"] for one in (told, untold))
    assert known["drag_percent"] == item["percent"]
    assert unknown["drag_percent"] is None or math.isnan(unknown["drag_percent"])
    assert unknown["force_drag_percent"] == pytest.approx(known["force_drag_percent"], nan_ok=True)


def test_a_coefficient_in_two_units_has_a_row_and_a_panel_each(summaries: list[dict[str, Any]]) -> None:
    """The fit tells the drag that a vehicle file leaves unknown in kg/m, the force estimate as a share of it."""
    unknown = as_read(summaries[0]) | {"mission": "unknown"}
    item = next(item for item in unknown["fit"]["parameters"] if item["name"] == "parasite_drag")
    item |= {"percent": None, "percent_std": None, "vehicle_value": None}
    made = index([summaries[0], unknown])
    known, rows = (
        [one for one in row["coefficients"] if one["name"] == "parasite_drag"] for row in made.content["missions"]
    )
    assert [one["unit"] for one in known] == ["%"]
    assert [one["unit"] for one in rows] == ["kg/m", "%"]
    assert (rows[0]["value"], rows[0]["std"]) == (item["value"], item["std"])
    assert math.isnan(rows[0]["force_value"])
    assert math.isnan(rows[1]["value"])
    assert rows[1]["force_value"] == known[0]["force_value"]
    assert math.isnan(made.content["missions"][1]["drag_percent"])
    drawn = made.pictures["coefficients"]
    assert drawn is not None
    assert {"ΔK_D0, %", "ΔK_D0, kg/m"} < set(drawn.alt.split(": ")[0].split("; "))


def test_tables_hold_the_same_as_the_json(made: Index) -> None:
    table, columns = frame(made.content)
    assert table["mission"].tolist() == [row["mission"] for row in made.content["missions"]]
    assert [column.name for column in columns] == list(table.columns)
    assert table["drag_percent"].tolist() == pytest.approx(
        [row["drag_percent"] for row in made.content["missions"]], nan_ok=True
    )
    text = pd.read_csv(io.StringIO(tsv(made.content)), sep="\t")
    assert "measured_m_s [m/s]" in text
    assert text["significance"].to_numpy() == pytest.approx(table["significance"].to_numpy(), rel=1e-5, nan_ok=True)


def test_the_same_summaries_give_the_same_bytes(summaries: list[dict[str, Any]], made: Index) -> None:
    assert index(summaries).page == made.page


def test_an_index_of_nothing_says_what_to_do() -> None:
    made = index([])
    assert "put a folder of logs with a mission.yaml into raw/" in Page(made.page).words
    missing = {name: {"reason": reason} for name, reason in NO_CAMPAIGN_FIGURE.items()}
    assert made.content == {"missions": [], "failed": [], "vehicles": [], "figures": missing}
    assert len(frame(made.content)[0]) == 0
    assert tsv(made.content).startswith("mission\tvehicle\tstart\tduration_h [h]\t")


def test_an_index_of_failures_alone_lists_them() -> None:
    page = Page(index([{"mission": "bad", "error": LINE}]).page)
    assert page.open == []
    assert "0 of 1 missions analysed, 1 failed." in page.words
    assert LINE in page.words


def test_one_mission_of_a_vehicle_says_nothing_of_the_vehicle(summaries: list[dict[str, Any]]) -> None:
    words = Page(index(summaries[:1]).page).words
    assert "Cannot be said: one mission only (complete)." in words


def test_every_section_and_figure_of_the_index_is_explained() -> None:
    assert set(guide()["campaign_figures"]) == set(NO_CAMPAIGN_FIGURE)
    assert set(guide()["campaign_sections"]) == {"table", "vehicles"}


def test_names_are_spared_where_missions_are_many(made: Index) -> None:
    row = made.content["missions"][0]
    many = [{**row, "mission": f"mission-{k:02d}"} for k in range(40)]
    drawn = figures.draw({"missions": many, "vehicles": []})["gaps"]
    assert drawn is not None
    assert "of 40 missions" in drawn.alt
    assert len(re.findall(r'id="gaps-xtick_\d+"', drawn.svg)) <= figures.NAMED


def test_the_vehicles_mean_is_drawn_in_the_units_of_its_missions() -> None:
    item = {"name": "parasite_drag", "unit": "kg/m", "vehicle_value": 8.0, "relative_to": 8.0, "value": 10.0,
            "std": 0.4}  # fmt: skip
    assert figures.shown(item) == (pytest.approx(25.0), pytest.approx(5.0), "%")
    carried = {**item, "name": "parasite_drag@ctd", "vehicle_value": 0.0, "value": 2.0}  # a share of the bare hull's
    assert figures.shown(carried) == (pytest.approx(25.0), pytest.approx(5.0), "%")
    thrust = figures.shown(
        {**item, "name": "thrust_scale", "unit": "1", "vehicle_value": 0.0, "value": -0.2, "std": 0.1}
    )
    assert thrust == (pytest.approx(-20.0), pytest.approx(10.0), "%")
    assert figures.shown({**item, "vehicle_value": 0.0, "relative_to": math.nan}) == (10.0, 0.4, "kg/m")
    assert math.isnan(figures.shown({**item, "vehicle_value": math.nan})[0])

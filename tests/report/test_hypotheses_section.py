"""The reasons on the page: verdict, table and figure say what summary.json says."""

import copy
import math

from pages import Page
from synthetic import blocks, inputs

from pipeline.report import build, page
from pipeline.report.figures.hypotheses import COLUMNS, hypotheses


def test_the_verdict_leads_its_section_and_stands_under_the_answer(built):
    ranking, words = built[0]["hypotheses"], Page(built[1]).words
    assert ranking["verdict"] in built[0]["answer"]["more"]
    section = words[words.index("Which reason explains the difference") :]
    assert ranking["verdict"] in section
    for row in ranking["rows"]:
        assert row["words"] in section
        assert row["verdict"] in section


def test_the_figure_has_the_most_probable_reason_first(built):
    drawn = hypotheses(built[0]["hypotheses"])
    frame = drawn.table.frame
    assert list(frame.columns) == [column.name for column in COLUMNS]
    assert frame["behind"].min() == 0.0
    assert frame["delta_bic"].min() == 0.0
    assert built[0]["hypotheses"]["rows"][0]["name"] == frame["name"][0]


def test_without_blocks_the_page_says_why_nothing_is_ranked(mission, petrel):
    table = blocks(dives=1).assign(used=False)
    summary, text = build(inputs(mission, petrel, table))[:2]
    assert summary["hypotheses"]["reason"] == "none of 8 steady blocks is used"
    assert "What may be wrong cannot be ranked: none of 8 steady blocks is used." in Page(text).words
    assert hypotheses(summary["hypotheses"]) is None


def test_a_reason_that_no_size_of_would_show_says_so(built):
    summary, pictures = copy.deepcopy(built[0]), built[2]
    row = next(row for row in summary["hypotheses"]["rows"] if row["name"] != "nothing")
    row["parameters"] = [{"symbol": "κ", "value": 1.0, "std": 0.3, "unit": "1"}]
    for seen, words in ((math.nan, "no size"), (0.4, "0.4")):
        row["seen_from"] = seen
        section = Page(page.report(summary, pictures)).words
        assert f"{row['words']} κ +1.00 ± 0.30 {words} " in section[section.index("Which reason explains") :]


def test_what_is_moved_where_nothing_is_wrong_is_seen_from_no_size(built):
    summary, pictures = copy.deepcopy(built[0]), built[2]
    (row,) = (row for row in summary["hypotheses"]["rows"] if row["words"].startswith("Nothing is wrong"))
    row["parameters"] = [{"symbol": "ΔG", "value": 0.3, "std": 0.1, "unit": "N"}]
    row["seen_from"] = math.nan
    section = Page(page.report(summary, pictures)).words
    section = section[section.index("Which reason explains the difference") :]
    assert "+0.30 ± 0.10" in section
    assert "nan" not in section[: section.index("Nothing is wrong") + 300]

"""The pages: self-contained, parseable, the same bytes every time, and never without a reason."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from pages import Page, complete, marking, numbers, section, unsaid
from synthetic import SETTINGS, blocks, inputs, level_blocks

from pipeline import store
from pipeline.mission import Mission, Nominal
from pipeline.report import build, page
from pipeline.report.figures import NO_FIGURE, files
from pipeline.report.figures.interactive import interactive
from pipeline.report.page import number, report, spread


def test_page_parses_and_every_figure_has_an_alternative_text(built):
    page = Page(built[1])
    assert page.open == []
    assert len(page.figures) == len(NO_FIGURE)
    assert set(re.findall(r'href="(figures/[^"]+)"', built[1])) == set(files.NAMES)
    assert all(len(words) > 40 for words in page.figures)


def test_page_is_self_contained_and_identifiers_are_unique(built):
    page = Page(built[1])
    assert [item for item in page.loads if not item.startswith(("data:", "#"))] == []
    own = re.sub(r"<script>.*?</script>", "<script></script>", built[1], flags=re.DOTALL)
    assert not re.search(r"url\((?!#)|@import|<script[^>]*src", own)
    assert len(page.identifiers) == len(set(page.identifiers))
    assert len(built[1]) < 5_000_000


def test_headings_are_in_order_and_the_answer_leads(built):
    page = Page(built[1])
    assert page.headings[0] == 1
    assert all(b - a <= 1 for a, b in zip(page.headings, page.headings[1:], strict=False))
    assert built[1].index('class="answer"') < built[1].index('id="figure-answer"') < built[1].index('id="numbers"')


def test_text_from_outside_is_escaped(built):
    assert "<than>" not in built[1]
    assert "a &lt;spike&gt;" in built[1]


def test_the_same_inputs_give_the_same_bytes_with_no_place_and_no_time(petrel, built, tmp_path):
    again = build(complete(petrel))
    assert again[1] == built[1]
    assert json.dumps(store.plain(again[0])) == json.dumps(store.plain(built[0]))
    assert str(tmp_path.parent) not in built[1]
    assert not re.search(r"/(?:home|root|work|tmp|Users)/", built[1] + json.dumps(store.plain(built[0])))


def test_summary_is_json_and_says_what_the_page_says(built):
    summary = json.loads(json.dumps(store.plain(built[0]), allow_nan=False))
    words = Page(built[1]).words
    assert summary["answer"]["sentence"] in words
    assert " ".join(summary["methods"].split()) in words
    for finding in summary["findings"]:
        assert finding["found"] in words
    for line in (*summary["borrowed"], *summary["citations"], *summary["stored_model"]["sentences"]):
        assert line in words
    for item in summary["fit"]["parameters"]:
        assert item["verdict"] in words
    assert "0" * 32 in words


def test_the_page_says_nothing_that_is_not_in_summary_json(petrel, built):
    """Made again from the file as it lies on disk, drawings aside, the page is the same to the letter."""
    there = json.loads(json.dumps(store.plain(built.summary), allow_nan=False))
    live = interactive(complete(petrel))
    assert report(_unknown(there, built.summary), built.pictures, live) == built.page
    for name, picture in built.pictures.items():
        assert there["figures"][name] == {"alt": picture.alt, "caption": picture.caption}
    assert there["series"]["layers"] == live.layers


def _unknown(there, made):
    """Return what was read, with NaN where null was written for it: all that is taken from what was `made`."""
    if isinstance(there, dict):
        return {name: _unknown(part, made[name]) for name, part in there.items()}
    if isinstance(there, list):
        return [_unknown(*pair) for pair in zip(there, made, strict=True)]
    return math.nan if there is None and isinstance(made, float) else there


def test_every_number_on_the_page_is_in_the_summary(petrel, built):
    """A number may be rounded, or shown in cm/s or %; what a template or the help says itself is known by its place."""
    live = interactive(complete(petrel))
    with marking():
        text = report(built.summary, built.pictures, live)
    assert len(numbers(text)) > 300
    assert unsaid(text, built.summary) == []
    assert unsaid(text, {}) == sorted(numbers(text))


def test_a_number_of_the_help_or_of_a_template_is_not_taken_for_data():
    """What a template says, ``7.25`` here, is no data; what it takes from data, ``3.5``, is, also through a macro."""
    with marking():
        made = page.environment()
    text = made.from_string(
        "{% macro twice(x) %}<b>7.25 {{ x }}</b>{% endmacro %}<p>7.25 {{ twice(1.5) }} {{ 3.5 | number(1) }}</p>"
        '<details class="help">9.75 {{ 8.5 }}</details><p>{{ 4.5 }}</p>'
    ).render()
    assert numbers(text) == {"1.5", "3.5", "4.5"}
    assert unsaid(text, {"a": [1.44, 3.5], "b": "4.5"}) == ["1.5"]


def test_page_says_whether_each_estimate_is_consistent_and_what_it_means_if_not(built):
    words = Page(built[1]).words
    section = words[words.index("Is the estimator consistent?") : words.rindex("What was borrowed")]
    assert [row["method"] for row in built[0]["consistency"]] == ["kinematic", "force"]
    for found in built[0]["consistency"]:
        assert f"The {found['method']} estimate {found['sentence']}" in section
    for shown in ("1.004", "1.991", "0.949 to 1.051", "2988", "21.7 0.357", "−0.02", "correlated", "0.137", "94.4",
                  "0 measurements in steady flight", "3 stretches", "at 877 instants: bias −0.42 cm/s, RMSE 1.23 cm/s",
                  "intervals of what is measured too narrow"):  # fmt: skip
        assert shown in section, shown
    assert built[1].count('class="number significant">1.991') == 1
    assert 'class="number significant">1.004' not in built[1]


def test_page_without_a_consistency_report_says_so(petrel, mission):
    summary, page, _ = build(inputs(mission, petrel, blocks(dives=1)))
    assert summary["consistency"] == []
    assert "No consistency report: the estimates came without one." in Page(page).words


def test_key_numbers_on_the_page_are_those_of_the_summary(built):
    words = Page(built[1]).words
    shown = {row["name"]: row for row in built[0]["key_numbers"]}
    assert shown["RMSE against the speed sensor, kinematic"]["value"] == pytest.approx(1.23)
    assert shown["95 % interval covers, force"]["value"] == pytest.approx(96.1)
    for row in shown.values():
        assert row["name"] in words
    assert "1.23 cm/s kinematic estimate, 877 instants, held out" in words


def test_the_first_sentence_says_where_only_the_mean_of_dive_and_climb_is_significant(petrel):
    mission = Mission(vehicle="petrel-ii", name="drag")
    for extra, said in ((2.5, True), (0.0, False)):
        flown = blocks(dives=8, extra_drag=extra).assign(net_buoyancy_std=1.0)  # ballast, which cancels in the mean
        summary, _, _ = build(inputs(mission, petrel, flown))
        rows = summary["comparison"]["even_odd"]
        row = next(row for row in rows if row["quantity"] == "speed" and row["trim"] == "pitch")
        answer = summary["answer"]
        assert "no significant difference (E = " in answer["sentence"]
        assert (row["even"] > 2.0 * row["even_u"]) is said
        assert ("cm/s too fast: significant." in answer["sentence"]) is said
        assert any("does not differ significantly" in line for line in answer["more"]) is not said
        assert sum("Averaged over dive and climb" in line for line in (answer["sentence"], *answer["more"])) == 1


def test_the_answer_says_what_a_correction_cannot_be_told_from(petrel):
    flown = blocks(dives=8, powered_climbs=True)
    climbs = flown["powered"]
    flown.loc[climbs, "depth_rate"] *= 0.93  # thrust lost on every climb: 10 % more drag, as well
    summary, page, _ = build(inputs(Mission(vehicle="petrel-ii", name="thrust"), petrel, flown))
    drag = summary["fit"]["parameters"][0]
    assert drag["value"] > 2.0 * drag["std"]
    rejected = {row["name"]: row for row in summary["fit"]["selection"]["rejected"]}
    assert abs(rejected["thrust_scale"]["correlation"]) > 0.95
    assert rejected["thrust_scale"]["why"].startswith("cannot be told apart from ΔK_D0 (correlation +0.9")
    said = "ΔK_D0 cannot be told apart from Δscale_T, which is held within what is stated: it may be either."
    assert said in summary["answer"]["more"][-1]
    assert said in Page(page).words


def test_the_answer_gives_no_number_to_what_cannot_be_told_apart(petrel):
    flown = blocks(dives=8)
    climbs = flown[flown["direction"] == 1].reset_index(drop=True)
    summary, _, _ = build(inputs(Mission(vehicle="petrel-ii", name="climbs"), petrel, climbs))
    assert [item["verdict"].partition(";")[0] for item in summary["fit"]["parameters"]] == [
        "cannot be told apart from ΔG", "cannot be told apart from ΔK_D0"
    ]  # fmt: skip
    assert (
        f"Fitted to {len(climbs)} blocks: ΔK_D0 and ΔG cannot be told apart: would be resolved by dives flown like the "
        "climbs."
    ) in summary["answer"]["more"]


def test_danjiangkou_page_tells_the_papers_story(petrel):
    part = Nominal(name="fixed depth 10 m", net_buoyancy=2.5, propeller_speed_rpm=780.0, pitch_deg=3.5,
                   published_speed=0.62, powered=True)  # fmt: skip
    mission = Mission(vehicle="petrel-ii", name="danjiangkou", nominal=[part])
    legs = {"gps": {"legs": [], "speed": 0.62, "speed_std": 0.01}}
    summary, page, _ = build(inputs(mission, petrel, level_blocks(), observable=False, estimate=legs))
    words = Page(page).words
    sentence = summary["answer"]["sentence"]
    assert sentence in words
    for part_of_it in (
        "measured 0.620 ± 0.010 m/s",
        "predicts 0.615 ± 0.030 m/s, no significant difference (E = −0.5 ± 3.2 cm/s)",
        "0.789 ± 0.078 m/s at 77°",
    ):
        assert part_of_it in sentence
    assert "this is not exact depth keeping" in words
    without, page, _ = build(inputs(mission, petrel, level_blocks(), observable=False))
    assert "depth carries no speed here" in without["answer"]["sentence"]
    assert "unobservable" in Page(page).words


def empties(petrel, unknown):
    plain = Mission(vehicle="petrel-ii", name="empty")
    one = blocks(dives=1)
    return {
        "no steady block": (inputs(plain, petrel, one.iloc[:0]), "the records hold no stretch of steady flight"),
        "every block left out": (
            inputs(plain, petrel, one.assign(used=False, reason="speed unobservable: near level"), observable=False),
            "speed unobservable: near level",
        ),
        "one dive only": (inputs(plain, petrel, one), "one dive only: none can be left out"),
        "one direction": (inputs(plain, petrel, blocks(sides=(-1,), pitches_deg=(25.0,), spread=0.0)), "refused"),
        "unknown coefficients": (inputs(plain, unknown, one), "the vehicle file leaves parasite_drag unknown"),
        "no net buoyancy": (
            inputs(plain, petrel, one.assign(net_buoyancy=math.nan)), "no steady block with a net buoyancy",
        ),
        "unobservable": (
            inputs(
                plain, petrel,
                one.assign(speed=np.nan, speed_std=np.nan, angle_of_attack=np.nan, path_angle=np.nan),
                observable=False,
            ),
            "near level: depth carries no speed",
        ),
        "no temperature": (_without(inputs(plain, petrel, one), "temperature"), "down to 500 m"),
        "no depth": (_without(inputs(plain, petrel, one), "depth", "pressure"), "no depth was measured"),
    }  # fmt: skip


def _without(given, *names):
    for name in names:
        given.records[name] = np.nan
    return given


@pytest.mark.parametrize(
    "case",
    ["no steady block", "every block left out", "one dive only", "one direction", "unknown coefficients",
     "no net buoyancy", "unobservable", "no temperature", "no depth"],
)  # fmt: skip
def test_what_is_missing_gives_a_page_with_the_reason(petrel, unknown, case):
    given, reason = empties(petrel, unknown)[case]
    summary, text, _ = build(given)
    page = Page(text)
    assert page.open == []
    assert reason in page.words + " ".join(page.figures)
    assert summary["answer"]["sentence"]
    json.dumps(store.plain(summary), allow_nan=False)
    assert "nan" not in re.findall(r"[a-z]+", page.words.lower())


def test_a_mission_of_many_blocks_is_still_a_small_page(petrel, mission):
    table = blocks(dives=60, each=4, sensor=True)
    assert len(build(inputs(mission, petrel, table)).page) < 5_000_000


@pytest.mark.parametrize(
    ("value", "digits", "sign", "shown"),
    [(1.2345, 2, False, "1.23"), (-0.5, 1, True, "−0.5"), (0.5, 1, True, "+0.5"), (7, 3, False, "7"),
     (None, 3, False, "–"), (math.nan, 3, False, "–"), (math.inf, 3, False, "–"), (True, 0, False, "–")],
)  # fmt: skip
def test_numbers_have_a_true_minus_and_a_dash_where_there_is_none(value, digits, sign, shown):
    assert number(value, digits, sign=sign) == shown


def test_spread_leaves_out_an_unknown_deviation():
    assert spread(1.0, math.nan, 1) == "1.0"
    assert spread(1.0, 0.25, 1) == "1.00 ± 0.25"
    assert spread(-1.0, 0.0953, 1) == "−1.000 ± 0.095"


def test_settings_of_the_estimator_are_in_the_methods(built):
    assert "1.00 cm/s" in built[0]["methods"]
    assert f"{SETTINGS['tau_w']:.0f} s" in built[0]["methods"]


def test_table_of_parts_has_no_column_without_a_number_and_says_once_what_holds_for_all(petrel, mission):
    """A vehicle whose moments nobody knows has no theory with the pitch left free, and nothing was published of it."""
    known = {name: item for name, item in petrel.coefficients.items() if not name.startswith("moment_")}
    made = inputs(mission, replace(petrel, coefficients=known), blocks(dives=2))
    shown = section(build(made).page, "trial")
    for missing in ("published V m/s", "theory, pitch free", "stable range, pitch free", "Pitch left free"):
        assert missing not in shown
    assert shown.count("No theory with the pitch left free") == 1
    assert "Every part: No theory with the pitch left free: the vehicle file leaves" in shown
    whole = section(build(inputs(mission, petrel, blocks(dives=2))).page, "trial")
    for present in ("theory, pitch free", "stable range, pitch free", "Pitch left free"):
        assert present in whole
    assert "published V m/s" not in whole


def test_a_difference_among_the_key_numbers_has_its_sign(built):
    """A correction or a bias without a plus would be read as a size."""
    rows = {row["name"]: row for row in built.summary["key_numbers"]}
    shown = section(built.page, "numbers")
    drag = rows["ΔK_D0"]
    assert drag["value"] > 0.0
    assert f"ΔK_D0 {spread(drag['value'], drag['std'], sign=True)} kg/m" in re.sub(r" ?± ?", " ± ", shown)
    assert "bias against the speed sensor, force +0.38 cm/s" in shown
    assert "RMSE against the speed sensor, force 1.57 cm/s" in shown


@pytest.mark.parametrize("each", [1, 2])
def test_page_says_why_the_error_of_a_few_blocks_is_not_split(petrel, mission, each):
    shown = section(build(inputs(mission, petrel, blocks(dives=1, each=each))).page, "comparison")
    assert f"{each} block{'s' * (each > 1)}, which an offset and a slope meet exactly whatever they are" in shown
    assert "circular: E says nothing" in shown


def test_theory_has_no_more_decimals_than_what_it_is_compared_with(built):
    """Where both sides solve the same closure their difference is rounding, and theory had ten decimals by it."""
    table = built.page[built.page.index("Theory with measured pitch held") :]
    table = table[: table.index("</table>")]
    shown = [max(map(len, re.findall(r"\.(\d+)", row)), default=0) for row in re.findall(r"<tr>.*?</tr>", table)]
    assert max(shown) <= 3

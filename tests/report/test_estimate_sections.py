"""What the page says of the force estimate, of the instruments, and of a speed sensor that was held out."""

import json
import math

import numpy as np
import pandas as pd
import pytest
from pages import Page, adjusted, agreeing, section
from synthetic import START, blocks, inputs

from pipeline import store
from pipeline.estimate import craft
from pipeline.estimate.settings import Settings
from pipeline.records import PREDICTIONS, conform, timestamps
from pipeline.report import build
from pipeline.report.adjustment import EXPERIMENTS, NOISE, PARAMETERS, adjustment
from pipeline.report.compatibility import compatibility
from pipeline.report.figures.flight import flight


def test_page_scores_each_estimate_against_a_sensor_that_was_held_out(built):
    line = next(line for line in built[0]["answer"]["more"] if "held out" in line)
    assert "the kinematic estimate has a bias of −0.42 cm/s and an RMSE of 1.23 cm/s" in line
    assert "its 95 % interval covers 93 % of 877 instants; the force estimate has a bias of +0.38 cm/s" in line
    assert "at 931 instants: bias +0.38 cm/s, RMSE 1.57 cm/s; the 95 % interval covers 96.1 %" in Page(built[1]).words


def test_page_shows_what_was_adjusted_in_units_of_people_and_what_would_tell_the_rest(built):
    words = section(built[1], "force")
    for shown in (
        "parasite drag 0 ± 10 −2.8 ± 3.7 % determined",
        "net buoyancy 0.00 ± 0.30 −0.814 ± 0.090 N determined",
        "compressibility of the hull 0.0 ± 1.0 +0.52 ± 0.99 10⁻¹⁰/Pa not determined",
        "temperature 150 ± 150 241 ± 36 s determined",
        "bias of pitch 0.00 ± 0.30 0.00 ± 0.30 ° considered",
        "Not determined: bias of pitch and lift slope. It would take a speed sensor that may be used",
        "Not determined: compressibility of the hull. It would take dives deeper than the 500 m of this mission.",
        "Against what was known before stands thermal expansion of the hull",
        "Nothing that was logged depends on thrust (the propeller did not turn).",
        "90.0 % of the samples. Not in 8.0 %, at the surface; or in 2.0 %, stalled.",
        "vertical velocity of the water 1.00 0.34 cm/s", "its correlation time 300 504 s", "– 3.00 mm/s per √s",
    ):  # fmt: skip
        assert shown in words, shown
    assert "propeller on and off" not in words
    assert built[1].count('significant">contradicts what was known before, by 5.4 sigma') == 1
    assert "take the values with care" not in words


@pytest.mark.parametrize(("given", "reason"), [
    ({"reason": "no mass or no density: no net buoyancy"}, "no mass or no density: no net buoyancy"),
    (None, "the estimates came without one"),
])  # fmt: skip
def test_page_without_a_force_estimate_says_why(petrel, mission, given, reason):
    summary, text, _ = build(inputs(mission, petrel, blocks(dives=1), estimate={"force": given}))
    assert f"No force estimate: {reason}." in section(text, "force")
    assert "theory, adjusted" not in text
    assert "Brown" not in text
    json.dumps(store.plain(summary), allow_nan=False)


def test_adjustment_to_a_sensor_says_so_and_does_not_ask_for_one():
    names = ("net_buoyancy", "thermal_expansion", "hull_time", "parasite_drag", "carried_water", "flushing_time")
    rest = {name: {"verdict": "not determined"} for name in names}
    found = adjustment({"force": adjusted(**rest) | {"converged": False}}, sensor_used=True, depth=math.nan)
    said = " ".join(found["sentences"])
    assert "the depth rate and the speed sensor determines nothing better" in said
    assert "Taken as known before, with what that leaves open: bias of pitch and lift slope." in said
    assert "speed_sensor: use" not in said
    assert "dives deeper than these" in said
    assert "still moving" in said


def test_every_parameter_of_the_force_model_has_words_and_every_open_one_an_experiment():
    assert set(craft.PARAMETERS) == set(PARAMETERS)
    assert {name for names, _ in EXPERIMENTS for name in names} == set(craft.PARAMETERS)
    assert set(NOISE) <= set(Settings._fields)


def test_page_says_whether_the_instruments_agree_and_what_is_not_known(built, petrel, mission):
    words = section(built[1], "instruments")
    for shown in (
        "Not in everything: depth bends 1.48 ± 0.47 s after the pitch does. Nothing was applied.",
        "pressure read at the surface +0.12 ± 0.31 dbar not significant",
        "lag of the pressure sensor – s not determined told by nothing",
        "scale of pitch, true over logged – not determined needs a speed sensor that may be used",
        "outliers of pitch 0 none found",
    ):  # fmt: skip
        assert shown in words, shown
    assert "outliers of speed" not in words
    assert any("Do the instruments agree?" in line for line in built[0]["answer"]["more"])
    summary, text, _ = build(inputs(mission, petrel, blocks(dives=1), estimate={"compatibility": agreeing()}))
    assert "no difference is significant, and nothing was applied; 3 of 5 quantities" in section(text, "instruments")
    assert not any("Do the instruments agree?" in line for line in summary["answer"]["more"])
    assert "there are no records" in section(build(inputs(mission, petrel, blocks(dives=1)))[1], "instruments")


def test_what_was_applied_is_said_in_degrees_and_centimetres_a_second():
    bias = {"value": math.radians(0.8), "std": math.radians(0.1), "significant": True, "applied": True}
    offset = {"value": -1.2, "std": 0.3, "significant": True, "applied": True}
    spikes = {"instruments": {"speed": {"count": 2, "first": [{"time_s": 4821.0, "value": 0.612}]}}}
    given = {"compatibility": agreeing(pitch_bias=bias, pressure_offset=offset, outliers=spikes)}
    found = compatibility(given, sensor_used=True)
    assert found["sentence"] == (
        "Not in everything: pressure at the surface is 1.20 ± 0.30 dbar too small; pitch is 0.80 ± 0.10° too low; 2 "
        "outliers of speed. Applied: pressure read at the surface, bias of pitch, outliers, by leaving them out."
    )
    assert found["outliers"] == [
        {"instrument": "speed", "count": 2, "unit": "cm/s", "first": [{"at_s": 4821.0, "value": pytest.approx(61.2)}]}
    ]
    assert found["undetermined"][0] == {"reason": "told by nothing", "quantities": ["lag of the pressure sensor"]}
    scale = compatibility({"compatibility": agreeing(
        pitch_scale={"value": 0.861, "std": 0.011, "significant": True, "applied": True},
        pitch_bias=bias | {"applied": False})}, sensor_used=True)["sentence"]  # fmt: skip
    assert "pitch is 0.861 ± 0.011 times what is logged" in scale
    assert scale.endswith("Applied: scale of pitch, true over logged; not applied: bias of pitch.")


def test_a_quantity_of_a_mission_in_parts_names_them_and_says_whether_they_agree():
    parts = {"known": 4, "of": 5, "lowest": 0.011, "highest": 0.024, "chi_square": 3.9, "agree": True}
    scale = agreeing()["pitch_scale"] | {"value": 0.018, "std": 0.003, "significant": True, "applied": True}
    scale |= {"reason": "1-sigma 1 % before the mission, 0.3 % now"}

    def row(**changes):
        given = {"compatibility": {}, "speed_scale": {"kinematic": scale | {"parts": parts | changes}}}
        return compatibility(given, sensor_used=True)["quantities"][-1]

    assert row()["reason"] == (
        "1-sigma 1 % before the mission, 0.3 % now; mean of 4 of 5 parts, each by itself, from +1.10 to +2.40 %, no "
        "farther apart than their 1σ say"
    )
    apart = row(agree=False, chi_square=14.25)
    assert apart["reason"].endswith("farther apart than their 1σ say (χ² 14.2 for 3), so this is wider")
    assert row(known=1)["reason"].endswith("; told by one of 5 parts")


def test_figure_of_flight_draws_both_estimates_each_in_its_colour(built):
    figure = built[1][built[1].index('id="figure-flight"') :]
    figure = figure[: figure.index("</figure>")]
    assert figure.count("var(--measured") > 4
    assert figure.count("var(--force") >= 6  # three lines and three bands
    caption = figure[figure.index("<figcaption>") :]
    assert "borrows the ratio of lift to drag alone" in caption
    assert "(the force estimate), which borrows net buoyancy, thrust and all coefficients" in caption


def test_figure_of_a_long_mission_is_no_larger_than_that_of_a_short_one(petrel, mission):
    given = inputs(mission, petrel, blocks(dives=1), force=True)
    short = _drawn(given.records, given.estimates, given.force)
    longer = [pd.concat([table] * 1500, ignore_index=True) for table in (given.records, given.estimates, given.force)]
    for table in longer:
        table["time"] = timestamps(START + np.arange(len(table)))
    assert len(longer[0]) == 300_000
    assert len(_drawn(*longer)) < 5 * len(short)


def _drawn(records, estimates, force_estimates):
    nothing = blocks(dives=1).iloc[:0], conform(pd.DataFrame({"block": []}), PREDICTIONS)
    return flight(records, estimates, force_estimates, *nothing, None).svg

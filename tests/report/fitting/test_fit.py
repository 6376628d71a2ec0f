"""The fit against missions whose truth is known, and against data that cannot carry it."""

import math

import numpy as np
import pytest
from synthetic import SETTINGS, blocks

from pipeline.report.fitting.fit import fit
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.text import text
from pipeline.vehicle import Vehicle


def solve(vehicle: Vehicle, table, **options):
    return fit(table, vehicle, Given(**({"settings": SETTINGS, "pitch_std": 0.0} | options)))


def values(result) -> dict[str, tuple[float, float]]:
    return {item["name"]: (item["value"], item["std"]) for item in result["parameters"]}


def test_in_still_water_the_truth_is_found_exactly(exact):
    table = blocks(extra_drag=1.53, extra_force=0.3, sigma_w=0.0, noise=1e-7)
    found = values(solve(exact, table))
    assert found["parasite_drag"][0] == pytest.approx(1.53, abs=1e-4)
    assert found["net_buoyancy"][0] == pytest.approx(0.3, abs=1e-4)


def test_truth_lies_inside_the_95_percent_interval_as_often_as_it_should(exact):
    truth = {"parasite_drag": 1.53, "net_buoyancy": 0.3}
    inside = dict.fromkeys(truth, 0)
    chi_square = []
    seeds = 80
    for seed in range(seeds):
        table = blocks(dives=3, each=3, extra_drag=1.53, extra_force=0.3, seed=seed)
        result = solve(exact, table)
        chi_square.append(result["reduced_chi_square"])
        for name, (value, std) in values(result).items():
            inside[name] += abs(value - truth[name]) < 1.96 * std
    for count in inside.values():
        assert 0.90 * seeds <= count <= 0.99 * seeds
    assert np.mean(chi_square) == pytest.approx(1.0, abs=0.1)


def test_injected_drag_is_found_significantly_and_called_determined(exact):
    result = solve(exact, blocks(dives=12, extra_drag=1.53, seed=5))
    drag = result["parameters"][0]
    assert drag["value"] > 5.0 * drag["std"]
    assert drag["percent"] == pytest.approx(100 * drag["value"] / 7.3579)
    assert drag["verdict"] == "determined by the data"
    left = result["left_out_dives"]
    assert left["rmse_after_m_s"] < 0.7 * left["rmse_before_m_s"]
    assert result["blocks"] == result["values_fitted"] == 96
    assert len(result["residuals"]["after_m_s"]) == 96


def test_what_is_borrowed_widens_the_interval(petrel, exact):
    table = blocks(dives=6)
    narrow, wide = solve(exact, table), solve(petrel, table, pitch_std=math.radians(0.3))
    assert values(wide)["parasite_drag"][1] > 1.05 * values(narrow)["parasite_drag"][1]
    assert {item["name"] for item in wide["borrowed"]} == {"lift_slope", "induced_drag", "pitch"}
    assert not narrow["borrowed"]


def test_pitch_bias_is_confused_with_ballast_and_its_prior_says_how_much(exact):
    table = blocks(dives=6, sigma_w=0.001)
    sure, unsure = solve(exact, table), solve(exact, table, pitch_std=math.radians(1.0))
    assert values(unsure)["net_buoyancy"][1] > 3.0 * values(sure)["net_buoyancy"][1]


def test_one_pitch_and_one_buoyancy_in_one_direction_is_refused_as_singular(exact):
    result = solve(exact, blocks(dives=4, pitches_deg=(25.0,), spread=0.0, sides=(-1,)))
    assert "refused" in result["reason"]
    assert "ΔK_D0 and ΔG cannot be told apart" in result["reason"]
    assert "climbs flown like the dives" in result["reason"]
    assert result["condition_index"] > 1000
    assert all(math.isnan(item["value"]) for item in result["parameters"])
    assert result["left_out_dives"]["reason"] == result["reason"]


def test_dives_alone_at_slightly_different_buoyancies_cannot_tell_drag_from_ballast(exact):
    result = solve(exact, blocks(dives=6, sides=(-1,), spread=1.0))
    for item in result["parameters"]:
        assert item["verdict"].startswith("cannot be told apart from")
        assert "climbs flown like the dives" in item["verdict"]
    assert result["condition_index"] < 1000
    assert abs(result["correlation"][0][1]) > 0.95


def test_where_the_water_moves_too_much_the_prior_decides(exact):
    result = solve(exact, blocks(dives=2, each=1, sigma_w=0.15), settings={"sigma_w": 0.15, "tau_w": 300.0})
    ballast = result["parameters"][1]
    assert ballast["verdict"] == "not determined: prior decides"
    assert ballast["std_with_prior"] < ballast["prior_std"] < ballast["std"]


def test_what_the_data_tell_hardly_better_than_the_prior_is_not_called_determined_by_them(petrel):
    result = solve(petrel, blocks(dives=2, each=1, sigma_w=0.02), settings={"sigma_w": 0.02, "tau_w": 300.0})
    drag = result["parameters"][0]
    assert 0.5 * drag["prior_std"] < drag["std"] < drag["prior_std"]
    assert drag["verdict"] == "partly determined: prior says as much"


def test_a_correction_far_beyond_its_prior_is_said_to_contradict_it(exact):
    result = solve(exact, blocks(dives=8, extra_drag=4.0))
    assert result["parameters"][0]["verdict"] == "determined by the data, against the prior"


def test_scatter_beyond_what_was_assumed_widens_the_interval(exact):
    table = blocks(dives=8, sigma_w=0.03)
    result, told = solve(exact, table), solve(exact, table, settings={"sigma_w": 0.03, "tau_w": 300.0})
    assert result["depth_rate_scatter"] == pytest.approx(3.0, rel=0.2)
    assert result["reduced_chi_square"] == pytest.approx(1.0, abs=0.3)
    assert "depth rates scatter" in result["text"]
    for found, known in zip(result["parameters"], told["parameters"], strict=True):
        assert found["value_with_prior"] == pytest.approx(known["value_with_prior"], abs=0.3 * known["std_with_prior"])
        assert found["std"] == pytest.approx(known["std"], rel=0.25)


def test_ordinary_scatter_is_left_as_it_is(exact):
    assert solve(exact, blocks(dives=8))["depth_rate_scatter"] == 1.0


def test_speeds_by_a_sensor_sharpen_the_fit_when_they_are_used(exact):
    table = blocks(dives=6, sensor=True, extra_drag=1.53)
    without, used = solve(exact, table), solve(exact, table, use_sensor=True)
    assert used["sensor_speeds"] == 48
    assert values(used)["parasite_drag"][1] < 0.5 * values(without)["parasite_drag"][1]
    assert without["left_out_dives"]["speed_rmse_after_m_s"] < without["left_out_dives"]["speed_rmse_before_m_s"]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"used": False}, "none of 8 steady blocks is used"),
        ({"used": False, "reason": "near level"}, "none of 8 steady blocks is used, near level"),
        ({"net_buoyancy": math.nan}, "no steady block with a net buoyancy"),
        ({"depth_rate": math.nan}, "no steady block with a depth rate"),
        (
            {"powered": True, "propeller_speed": math.nan},
            "no steady block with a thrust that follows from what is logged",
        ),
        ({"pitch": 0.001, "net_buoyancy": 5.0}, "theory has no steady flight at the pitch and buoyancy of any block"),
    ],
)
def test_what_cannot_be_fitted_is_refused_with_the_reason(exact, change, reason):
    result = solve(exact, blocks(dives=1).assign(**change))
    assert result["reason"] == reason
    assert all(math.isnan(item["value"]) for item in result["parameters"])


def test_unknown_coefficients_are_named(unknown):
    assert solve(unknown, blocks(dives=1))["reason"] == "the vehicle file leaves parasite_drag unknown"


def test_two_blocks_are_too_few_for_two_corrections(exact):
    reason = solve(exact, blocks(dives=1, each=1))["reason"]
    assert reason == "2 steady blocks for 2 corrections: at least 3 are needed"


def test_one_dive_only_leaves_none_out(exact):
    assert solve(exact, blocks(dives=1))["left_out_dives"]["reason"] == "one dive only: none can be left out"


def test_report_in_text_has_values_errors_correlations_and_could_not_estimate(exact):
    words = solve(exact, blocks(dives=4))["text"]
    for part in ("[[Fit statistics]]", "reduced chi-square", "[[Corrections]]", "ΔK_D0", "+/-", "C(ΔK_D0, ΔG) = "):
        assert part in words
    refused = solve(exact, blocks(dives=4).assign(used=False))
    assert text(refused) == refused["text"]
    assert "could not estimate: none of 32 steady blocks is used" in refused["text"]


def test_blocks_may_come_in_any_order(exact):
    table = blocks(dives=4)
    shuffled = table.sample(frac=1.0, random_state=3)
    assert values(solve(exact, shuffled)) == values(solve(exact, table))


@pytest.mark.parametrize(
    ("astray", "sentence"),
    [
        ([3], "1 of 48 values is an outlier and counts for less (Huber's loss): block 3"),
        ([3, 43], "2 of 48 values are outliers and count for less (Huber's loss): blocks 3, 43"),
        ([], ""),
    ],
)
def test_outliers_are_told_by_number_and_block(exact, astray, sentence):
    table = blocks(dives=6)
    table.loc[table["block"].isin(astray), "depth_rate"] += 0.5
    assert solve(exact, table)["robust"]["sentence"] == sentence

"""Means of comparisons: what averages out and what does not."""

import math

import numpy as np
import pandas as pd
import pytest
from synthetic import SETTINGS, blocks

from pipeline.model.predict import predict
from pipeline.report.averages import combine, means, parity
from pipeline.report.compare import EFFECTS, SHARED, compare


def comparisons(error: list[float], *, own: float = 0.0, shared: float = 0.0, common: bool = False, **columns: object):
    """Return comparisons of one kind, an hour apart."""
    size = len(error)
    frame = pd.DataFrame(
        {
            "trim": "pitch", "quantity": "speed", "direction": -1, "powered": False, "dive": np.arange(size),
            "start_s": 3600.0 * np.arange(size), "end_s": 3600.0 * np.arange(size) + 300.0,
            "error": error, "measured": 0.5, "predicted": 0.5 + np.array(error), "own_input": 0.0,
            "own_measured": own, "water_sign": 1.0, "common": common, "label": "shares polar", "why": "because",
        }
    )  # fmt: skip
    for name in EFFECTS:
        frame[f"predicted_{name}"] = shared if name == "lift_slope" else 0.0
    for name in SHARED:
        frame[f"measured_{name}"] = 0.0
    frame["u_val"] = math.hypot(own, shared) or 1.0
    return frame.assign(**columns)


def test_independent_noise_averages_out_by_the_square_root():
    row = means(comparisons([0.01, 0.03, 0.02, 0.02], own=0.02), {"sigma_w": 0.01, "tau_w": 60.0}).iloc[0]
    assert row["error"] == pytest.approx(0.02)
    assert row["u_val"] == pytest.approx(0.02 / math.sqrt(4), rel=1e-6)
    assert row["relative_error"] == pytest.approx(0.04)


def test_the_mean_square_error_is_split_unless_the_comparison_is_circular():
    spread = comparisons([0.01, 0.03, 0.02, 0.02], measured=np.array([0.5, 0.4, 0.45, 0.3]))
    spread["predicted"] = spread["measured"] + spread["error"]
    row = means(spread, SETTINGS).iloc[0]
    assert row["offset_share"] == pytest.approx(0.02**2 / np.mean(np.square([0.01, 0.03, 0.02, 0.02])))
    assert row["offset_share"] + row["slope_share"] + row["scatter_share"] == pytest.approx(1.0)
    assert row["split_reason"] == ""
    circular = means(spread.assign(label="circular"), SETTINGS)
    assert circular[["offset_share", "slope_share"]].isna().all(axis=None)
    assert circular["split_reason"].tolist() == ["circular: E says nothing"]


@pytest.mark.parametrize(("blocks", "words"), [(1, "1 block, which"), (2, "2 blocks, which")])
def test_where_the_mean_square_is_not_split_it_is_said_why(blocks, words):
    row = means(comparisons([0.01, 0.03][:blocks]), SETTINGS).iloc[0]
    assert math.isnan(row["offset_share"])
    assert row["split_reason"].startswith(words)
    assert row["split_reason"].endswith("3 are needed")
    same = means(comparisons([0.0] * 4), SETTINGS).iloc[0]
    assert same["split_reason"] == "no error to split"


def test_what_blocks_share_does_not_average_out():
    row = means(comparisons([0.01] * 9, shared=0.03), SETTINGS).iloc[0]
    assert row["u_val"] == row["predicted_std"] == pytest.approx(0.03)
    assert row["measured_std"] == 0.0


def test_an_error_common_to_all_blocks_does_not_average_out():
    row = means(comparisons([0.01] * 9, own=0.02, common=True), SETTINGS).iloc[0]
    assert row["u_val"] == row["measured_std"] == pytest.approx(0.02)
    assert row["predicted_std"] == 0.0


def test_what_a_block_has_been_told_of_its_own_is_the_theorys_alone_and_adds_up_as_if_it_were_shared():
    row = means(comparisons([0.01] * 9, own_input=0.03, shared=0.04), SETTINGS).iloc[0]
    assert row["u_val"] == row["predicted_std"] == pytest.approx(0.05)
    assert row["measured_std"] == 0.0


def test_neighbouring_blocks_share_the_motion_of_the_water():
    starts = 300.0 * np.arange(4)
    near = comparisons([0.0] * 4, own=0.02, start_s=starts, end_s=starts + 300.0)
    slow = {"sigma_w": 0.01, "tau_w": 1e7}
    assert combine(near, np.full(4, 0.25), slow)["u_val"] == pytest.approx(0.02, rel=1e-3)


def test_a_dive_with_its_climb_cancels_steady_vertical_water_exactly():
    pair = comparisons([0.0, 0.0], own=0.02, water_sign=[-1.0, 1.0], start_s=[0.0, 300.0], end_s=[300.0, 600.0])
    assert combine(pair, np.full(2, 0.5), {"sigma_w": 0.01, "tau_w": 1e7})["u_val"] == pytest.approx(0.0, abs=2e-4)


def test_drag_is_even_and_ballast_odd_in_dive_and_climb(petrel):
    still = {"sigma_w": 0.0, "noise": 0.0, "spread": 0.0, "dives": 3}
    dragged, heavy = blocks(extra_drag=1.5, **still), blocks(extra_force=0.3, **still)
    out = {}
    for name, table in (("drag", dragged), ("ballast", heavy)):
        both = parity(compare(table, predict(petrel, table), petrel, settings=SETTINGS), SETTINGS)
        out[name] = both[(both["trim"] == "pitch") & (both["quantity"] == "speed")].iloc[0]
    assert out["drag"]["even"] > 0.03
    assert abs(out["drag"]["odd"]) < 1e-9
    assert abs(out["ballast"]["even"]) < 0.001
    assert out["ballast"]["odd"] > 0.01
    assert out["drag"]["dives"] == 3


def test_parity_needs_both_directions(petrel):
    table = blocks(dives=3, sides=(-1,))
    assert parity(compare(table, predict(petrel, table), petrel, settings=SETTINGS), SETTINGS).empty


def test_measured_speed_of_a_mission_is_right_within_its_uncertainty(petrel):
    table = blocks(dives=8, seed=3)
    row = means(compare(table, predict(petrel, table), petrel, settings=SETTINGS), SETTINGS)
    row = row[(row["trim"] == "pitch") & (row["quantity"] == "speed")]
    assert set(row["direction"]) == {-1, 1}
    assert (row["significance"] < 2.0).all()
    assert (row["blocks"] == 32).all()

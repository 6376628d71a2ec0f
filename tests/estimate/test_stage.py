"""The stage as a whole: its engines and methods."""

from __future__ import annotations

import numpy as np
from dives import Flown

from pipeline.estimate.stage import InMemory, estimate, stream
from pipeline.mission import Water
from pipeline.model.forces import GRAVITY
from pipeline.records import ESTIMATES, of_method, seconds


def test_filterpy_gives_the_same_force_estimates_to_1e9(flown: Flown) -> None:
    first = int(np.argmax(flown.records["phase"].to_numpy() == 2))
    records = flown.records.iloc[first : first + 60].reset_index(drop=True)
    ours = of_method(estimate(records, flown.vehicle, flown.mission).estimates, "force")
    theirs = of_method(estimate(records, flown.vehicle, flown.mission, engine="filterpy").estimates, "force")
    assert ours["observable"].any()
    for name in ("speed", "speed_std", "angle_of_attack", "path_angle", "depth", "vertical_water_velocity"):
        np.testing.assert_allclose(theirs[name], ours[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_a_method_not_asked_for_is_left_out(flown: Flown) -> None:
    result = estimate(flown.records.iloc[:60], flown.vehicle, flown.mission, methods=("kinematic",))
    assert set(result.estimates["method"]) == {"kinematic"}
    assert result.report["force"] == {"reason": "not asked for"}


def test_a_density_that_the_mission_lends_counts_where_none_was_measured(flown: Flown) -> None:
    lent = flown.mission.model_copy(update={"water": Water(density=1025.0, std=0.5)})
    unmeasured = flown.records.assign(absolute_salinity=np.nan)
    measured, borrowed = (
        stream(InMemory(table), flown.vehicle, lent, lambda _: None, constants={}, methods=("kinematic",)).blocks
        for table in (flown.records, unmeasured)
    )
    displaced = GRAVITY * flown.vehicle["mass"] / 1025.0
    extra = np.sqrt(borrowed["net_buoyancy_std"] ** 2 - measured["net_buoyancy_std"] ** 2)
    np.testing.assert_allclose(extra, 0.5 * displaced, rtol=0.02)
    assert borrowed["density_std"].min() >= 0.5 > measured["density_std"].max()


def test_no_records_give_an_empty_table(flown: Flown) -> None:
    result = estimate(flown.records.iloc[:0], flown.vehicle, flown.mission)
    assert list(result.estimates.columns) == [column.name for column in ESTIMATES]
    assert len(result.estimates) == 0
    assert result.report["force"] == {"reason": "no records"}
    assert seconds(result.estimates["time"]).size == 0

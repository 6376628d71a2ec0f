"""What the estimators take from the records: flags and geometry against hand-made flights."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from truth import Trial

from pipeline.estimate.series import AFTER, ASTRAY, BEFORE, changed_within, from_records, held, increasing, powered
from pipeline.records import MEASURED, RECORDS, Phase, conform, timestamps


def flight(**columns: object) -> pd.DataFrame:
    """Return records of 20 minutes of sinking at 0.2 m/s, a row a second."""
    time = np.arange(1200.0)
    base: dict[str, object] = {
        "time": timestamps(time),
        "pressure": 0.2 * time,
        "depth": 0.2 * time,
        "pitch": -0.4,
        "phase": int(Phase.DESCENT),
    }
    base |= columns
    flags = {f"{column.name}_qc": np.int8(1) for column in MEASURED if column.name in base}
    return conform(pd.DataFrame(base).assign(**flags), RECORDS)


def test_steady_sinking_is_no_manoeuvre_and_its_depth_rate_is_found() -> None:
    series = from_records(flight())
    assert not series.manoeuvre[10:-10].any()
    np.testing.assert_allclose(series.depth_rate_guess[30:-30], 0.2, rtol=1e-6)
    assert not series.powered.any()
    assert not series.unmeasured.any()


def test_a_pitch_step_is_a_manoeuvre_with_its_margins_and_no_more() -> None:
    time = np.arange(1200.0)
    pitch = np.where(time < 600, -0.4, 0.4)
    depth = 120.0 - 0.2 * np.abs(time - 600.0)
    manoeuvre = from_records(flight(pitch=pitch, depth=depth, pressure=depth)).manoeuvre
    assert manoeuvre[600 - int(BEFORE) : 600 + int(AFTER)].all()
    assert not manoeuvre[: 600 - int(BEFORE) - 20].any()
    assert not manoeuvre[600 + int(AFTER) + 20 :].any()


def test_a_slow_turn_of_pitch_steps_as_far_as_its_random_walk_and_noise_does_not() -> None:
    time = np.arange(1200.0)
    rate = np.radians(0.1)
    turn = -0.4 - rate * np.clip(time - 500.0, 0.0, 100.0)
    for spacing in (1, 4):
        pitch = np.where(time % spacing == 0.0, turn, np.nan)
        found = from_records(flight(pitch=pitch))
        assert not found.manoeuvre[100:-100].any()
        np.testing.assert_allclose(found.swinging[530:570], rate**2 * spacing, rtol=0.1)
        assert not found.swinging[20:450].any()
        assert not found.swinging[650:-20].any()
    noisy = -0.4 + np.radians(0.2) * np.random.default_rng(5).standard_normal(time.size)
    assert np.mean(from_records(flight(pitch=noisy)).swinging > 0.0) < 0.02


def test_pitch_turns_as_fast_as_it_was_turned() -> None:
    time = np.arange(1200.0)
    turned = -0.4 + 0.8 * np.clip((time - 600.0) / 40.0, 0.0, 1.0)
    turning = from_records(flight(pitch=turned, depth=120.0 - 0.2 * np.abs(time - 600.0))).turning
    np.testing.assert_allclose(turning[610:630], 0.8 / 40.0, rtol=1e-6)
    np.testing.assert_allclose(turning[[500, 700]], 0.0, atol=1e-12)


def test_speed_comes_to_be_anything_once_where_the_engine_works_or_is_not_known_to_rest() -> None:
    time = np.arange(1200.0)
    turned = np.where(time < 600.0, -0.4, 0.4)
    rises = 120.0 - 0.2 * np.abs(time - 600.0)
    unlogged = from_records(flight(pitch=turned, depth=rises, pressure=rises))  # no engine is logged
    np.testing.assert_array_equal(unlogged.loose > 0.0, unlogged.manoeuvre)
    stroke = 4e-4 * np.clip((time - 600.0) / 80.0, 0.0, 1.0)
    working = from_records(flight(buoyancy_volume=stroke)).loose
    assert (working[605:675] > 0.0).all()
    assert np.sum(working) == pytest.approx(1.0), "per second, at a record a second: once"
    assert not working[20:590].any()
    assert not working[700:].any()
    at_rest = {"buoyancy_volume": np.full(1200, 4e-4)}
    afloat = np.where(time < 100.0, int(Phase.SURFACING), int(Phase.DESCENT))
    started = np.where(time > 600.0, 10.0, 0.0)
    for found, begin in (
        (from_records(flight(phase=afloat, **at_rest)).loose, 100),
        (from_records(flight(propeller_speed=started, **at_rest)).loose, 601),
    ):
        assert found[begin + 10]
        assert not found[begin + int(AFTER) + 5 :].any()


def test_a_gap_that_hides_a_turn_of_pitch_is_a_manoeuvre() -> None:
    time = np.arange(1200.0)
    logged = {"buoyancy_volume": np.full(1200, 4e-4)}
    for turn, hidden in ((0.4, True), (0.0, False)):
        pitch = -0.4 - turn * (time > 600.0)
        pitch[580:620] = np.nan
        found = from_records(flight(pitch=pitch, **logged))
        assert found.manoeuvre[580:620].all() == hidden
        assert (found.loose[580:620] > 0.0).all() == hidden
        assert not found.loose[:540].any()
    often = np.where(time % 30.0 == 0.0, -0.4 - 0.002 * time, np.nan)  # a sample every half a minute hides nothing
    assert not from_records(flight(pitch=often, **logged)).loose[100:-100].any()


def test_between_two_samples_of_pitch_it_may_have_been_where_the_turn_or_the_depth_says() -> None:
    """Half-way between its ends a random walk of intensity q over a gap T has the variance q T / 4."""
    time = np.arange(1200.0)
    turned = [np.where(time < 590.0, -0.4, after) for after in (-0.8, 0.4)]
    apex = 0.2 * np.minimum(time, 1180.0 - time)
    between = np.where(np.abs(time - 570.0) < 25.0, 228.0 - 0.2 * time, 0.2 * time)
    for pitch, depth, open_, manoeuvre in (
        (np.full(1200, -0.4), 0.2 * time, 0.0, False),
        (turned[0], 0.2 * time, 0.2, True),  # half of the turn from one sample to the next
        (turned[1], apex, ASTRAY, True),  # a straight line from one to the other would sink nose up
        (np.full(1200, -0.4), between, ASTRAY, True),  # and rise nose down
    ):
        seen = np.where(time % 60.0 == 0.0, pitch, np.nan)
        found = from_records(flight(pitch=seen, depth=depth))
        known = np.flatnonzero(np.isfinite(seen))
        gap = slice(known[known < 590][-1], known[known > 590][0])
        np.testing.assert_allclose(np.sqrt(found.hiding[gap] * 60.0) / 2.0, open_)
        assert found.manoeuvre[gap].all() == manoeuvre
        assert not from_records(flight(pitch=pitch, depth=depth)).hiding.any(), "every sample seen"


def test_sinking_nose_up_is_a_manoeuvre() -> None:
    assert from_records(flight(pitch=0.4)).manoeuvre[100:-100].all()


def test_a_propeller_setting_holds_until_the_next_report() -> None:
    reported = np.full(1200, np.nan)
    reported[[0, 300, 900]] = [0.0, 13.0, 0.0]
    on = powered(flight(propeller_speed=reported))
    assert on[300:900].all()
    assert not on[:300].any()
    assert not on[900:].any()
    assert powered(flight(propeller_power=np.where(np.arange(1200) > 600, 5.0, -0.1)))[601:].all()


def test_a_setting_reported_regularly_has_changed_in_the_middle_between_two_reports() -> None:
    time = np.arange(1200.0)
    value = np.where(time > 603.0, 13.0, 0.0)
    for spacing in (1.0, 8.0, 30.0):
        found = held(time, np.where(time % spacing == 0.0, value, np.nan))
        after = spacing * np.ceil(604.0 / spacing)
        np.testing.assert_array_equal(found, np.where(time >= after - 0.5 * spacing, 13.0, 0.0))
        within = changed_within(time, np.where(time % spacing == 0.0, value, np.nan))
        assert within[np.flatnonzero(found == 13.0)[0] - 1] == spacing
        assert np.count_nonzero(within) == 1
    lost = np.where((time % 8.0 == 0.0) & ((time < 500.0) | (time > 700.0)), value, np.nan)
    assert not held(time, lost)[:704].any(), "across a gap in the reports it holds"
    assert not changed_within(time, lost).any()
    assert np.isnan(held(time, np.full(1200, np.nan))).all()
    assert np.isnan(held(time, np.where(time == 50.0, 1.0, np.nan))[:50]).all()


def test_flagged_measurements_are_not_taken() -> None:
    records = flight()
    records.loc[5:9, "pressure_qc"] = np.int8(4)
    records.loc[20, "pitch_qc"] = np.int8(3)
    series = from_records(records)
    assert np.flatnonzero(np.isnan(series.depth)).tolist() == [5, 6, 7, 8, 9]
    assert np.flatnonzero(np.isnan(series.pitch)).tolist() == [20]


def test_silence_of_pitch_is_marked_beyond_two_minutes() -> None:
    pitch = np.full(1200, -0.4)
    pitch[300:900] = np.nan
    series = from_records(flight(pitch=pitch))
    assert series.unmeasured[425:775].all()
    assert not series.unmeasured[:410].any()
    assert not series.unmeasured[790:].any()


@pytest.mark.parametrize("longitude", [115.0, 179.9995])
def test_fixes_become_metres_also_across_the_date_line(longitude: float) -> None:
    latitude, east = np.full(1200, np.nan), np.full(1200, np.nan)
    latitude[[0, 1199]], east[[0, 1199]] = [20.0, 20.01], [longitude, longitude + 0.001]
    east = np.where(east > 180.0, east - 360.0, east)
    series = from_records(flight(latitude=latitude, longitude=east))
    assert series.north[1199] == pytest.approx(0.01 * 110704.3, rel=1e-4), "NGA's length of a degree at 20 N, m"
    assert series.east[1199] == pytest.approx(0.001 * 104647.5, rel=1e-4)
    assert not series.located, "no heading"


def test_cruises_are_the_held_stretches_of_the_level_trial(trial: Callable[[str], Trial]) -> None:
    case = trial("petrel2-danjiangkou-2014")
    series = from_records(case.records)
    pitch = np.degrees(case.true("pitch"))[series.cruising]
    assert 0.2 < series.cruising.mean() < 0.6
    assert np.mean(np.abs(pitch - 3.5) < 1.0) > 0.97
    assert not series.new_setting.any()
    assert not from_records(trial("petrel2-scs-2014").records).cruising.any()


def test_a_clock_that_stands_or_runs_back_is_made_to_run_on() -> None:
    np.testing.assert_array_equal(increasing(np.array([0.0, 1.0, 3.0])), [0.0, 1.0, 3.0])
    mended = increasing(np.array([0.0, 1.0, 1.0, 0.5, 4.0]))
    assert (np.diff(mended) > 0.0).all()
    assert mended[-1] == 4.0
    assert mended[:4] == pytest.approx([0.0, 1.0, 1.001, 1.002], abs=2e-3)

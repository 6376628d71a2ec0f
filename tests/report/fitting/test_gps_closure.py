"""The closure against analytic cases, known truth and its own symmetries."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from voyages import drift, passages, records

from pipeline.records import seconds
from pipeline.report.fitting import closure
from pipeline.report.fitting.closure import FREER, HELD, UNDETERMINED, close
from pipeline.report.fitting.passages import find, through_water

HEADINGS = st.lists(st.floats(0.0, 2.0 * math.pi), min_size=4, max_size=8)


prior = closure._prior


def velocities(headings: list[float], speed: float = 0.3) -> np.ndarray:
    return speed * np.exp(1j * (0.5 * np.pi - np.array(headings)))


def test_two_opposite_headings_give_half_the_difference_over_ground() -> None:
    through = velocities([0.7, 0.7 + math.pi] * 3)
    found = close(*passages(through, 1.4 * through + (0.2 - 0.1j)))
    assert found.beta == pytest.approx(0.4, abs=1e-3)
    assert found.turn == pytest.approx(0.0, abs=1e-3)
    assert found.condition_index == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(found.residual, 0.2 - 0.1j, atol=1e-3)


def test_a_compass_that_reads_too_little_shows_as_a_turn_and_not_as_a_speed() -> None:
    turn = math.radians(12.0)
    through = velocities([0.0, 2.0, 4.0, 5.5, 1.0, 3.0])
    found = close(*passages(through, np.exp(-1j * turn) * through + 0.1j))
    assert found.turn == pytest.approx(turn, abs=2.0 * found.turn_std)
    assert found.turn > 5.0 * found.turn_std
    assert found.beta == pytest.approx(0.0, abs=0.01)


def test_a_compass_error_in_the_logs_comes_out_with_its_sign() -> None:
    table = records([(0.0,), (2.0,), (4.0,), (5.5,), (1.0,), (3.0, 1.0)], speed=0.3, compass=math.radians(10.0))
    found = find(table)
    result = close(found, through_water(found, seconds(table["time"]), np.full(len(table), 0.25)))
    assert math.degrees(result.turn) == pytest.approx(10.0, abs=1.0)
    assert result.beta == pytest.approx(0.2, abs=0.01)


def test_one_heading_tells_nothing_and_says_so() -> None:
    through = velocities([1.0, 1.02, 0.98, 1.01])
    rng = np.random.default_rng(1)
    found = close(*passages(through, through + drift(rng, 4, 0.05, 2e4)))
    assert math.isnan(found.beta)
    assert math.isnan(found.turn)
    assert found.beta_std > UNDETERMINED
    assert found.reason.startswith("4 passages whose directions spread by 1 degrees do not tell speed from current")
    assert found.condition_index > 30.0


def test_one_passage_tells_nothing_and_says_so() -> None:
    found = close(*passages(velocities([1.0]), np.array([0.2 + 0.2j])))
    assert found.reason.startswith("one passage: a current does all that a wrong speed does (1-sigma of β 3.3")
    assert math.isnan(found.beta)


def test_what_the_current_was_assumed_to_be_is_not_told_as_a_measurement() -> None:
    """On one heading β is as uncertain as the current, and of two passages nothing tells how much it changes."""
    rng = np.random.default_rng(2)
    for headings, shown in (([1.0] * 8, "8 passages"), ([1.0, 1.0 + math.pi], "2 passages")):
        through = velocities(headings)
        found = close(*passages(through, 1.1 * through + drift(rng, through.size, 0.05, 2e4)))
        assert found.assumed > 0.8
        assert math.isnan(found.beta)
        assert found.reason.startswith(shown)
        assert "what was assumed of the current decides β, not the fixes" in found.reason
        assert found.reason.endswith("more passages on reciprocal headings would tell")


def test_the_share_of_what_was_assumed_falls_with_passages_on_reciprocal_headings() -> None:
    shares = []
    for pairs in (1, 2, 4, 8):
        through = velocities([0.5, 0.5 + math.pi] * pairs)
        over = 1.1 * through + drift(np.random.default_rng(3), through.size, 0.05, 2e4)
        shares.append(close(*passages(through, over)).assumed)
    assert shares == sorted(shares, reverse=True)
    assert shares[1] < HELD
    assert 0.0 <= shares[-1] < 0.1


@pytest.mark.parametrize("headings", [[1.0, 1.3, 0.8], [0.0, 2.0, 4.0, 1.0, 5.0]])
def test_the_share_of_what_was_assumed_is_how_the_interval_follows_it(
    headings: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The 1-sigma with everything assumed of the current twice as strong from the start."""
    through = velocities(headings)
    over = 1.1 * through + drift(np.random.default_rng(5), through.size, 0.05, 2e4)
    before = close(*passages(through, over))
    monkeypatch.setattr(closure, "ANY", closure.ANY * FREER)
    monkeypatch.setattr(closure, "_prior", lambda current, freedom: prior(current, FREER * freedom))
    after = close(*passages(through, over))
    assert after.beta_std == pytest.approx(before.beta_std * FREER**before.assumed, rel=1e-6)


def test_a_model_without_speed_is_named() -> None:
    found, through = passages(velocities([0.0, 2.0]), velocities([0.0, 2.0]))
    still = close(found, through._replace(velocity=np.zeros(2, dtype=np.complex128)))
    assert still.reason == "the model does not move"
    blind = close(found, through._replace(velocity=np.full(2, np.nan + 0j), seen=np.zeros(2)))
    assert blind.reason == "the model's speed is not known in any passage"
    assert not blind.used.any()


def test_no_passage_hands_its_reason_on() -> None:
    table = records([(0.0,)]).assign(latitude=np.nan)
    found = find(table)
    assert close(found, through_water(found, np.arange(3.0), np.ones(3))).reason == "fewer than two fixes"


@pytest.mark.parametrize("headings", ["any", "two opposite"])
def test_intervals_hold_the_truth_and_are_centred(headings: str) -> None:
    rng = np.random.default_rng(7)
    pulls = []
    for _ in range(150):
        angle = rng.uniform(0.0, 2.0 * math.pi, 8)
        if headings == "two opposite":
            angle = np.array([0.5, 0.5 + math.pi] * 4) + 0.1 * rng.standard_normal(8)
        strength, lasting = 0.05 * 2.0 ** rng.standard_normal(), 2.16e4 * 2.0 ** rng.standard_normal()
        beta, turn = rng.uniform(-0.3, 0.7), math.radians(5.0) * rng.standard_normal()
        through = velocities(list(angle)) * (1.0 + 0.1 * rng.standard_normal(8))
        over = (1.0 + beta) * np.exp(-1j * turn) * through + drift(rng, 8, strength, lasting)
        found = close(*passages(through, over))
        if not found.reason:
            pulls.append(((found.beta - beta) / found.beta_std, (found.turn - turn) / found.turn_std))
    pull = np.array(pulls)
    assert len(pull) > 140
    held = np.mean(np.abs(pull) < 1.96, axis=0)
    assert np.all((held > 0.90) & (held < 0.99)), "binomial: 0.95 ± 3 x 0.018"
    assert np.all(np.abs(pull.mean(axis=0)) < 0.25)


def test_a_passage_gone_astray_is_left_out() -> None:
    rng = np.random.default_rng(3)
    through = velocities(list(rng.uniform(0.0, 6.28, 12)))
    over = 1.2 * through + drift(rng, 12, 0.03, 2e4)
    clean = close(*passages(through, over))
    assert clean.used.all()
    over[4] += 1.5 - 1.0j
    found = close(*passages(through, over))
    assert np.flatnonzero(~found.used).tolist() == [4]
    assert found.beta == pytest.approx(1.2 - 1.0, abs=3.0 * found.beta_std)


@given(headings=HEADINGS, turn=st.floats(-math.pi, math.pi), seed=st.integers(0, 99))
@settings(max_examples=15)
def test_turning_headings_and_displacements_together_changes_nothing(
    headings: list[float], turn: float, seed: int
) -> None:
    through = velocities(headings)
    over = 1.3 * through + drift(np.random.default_rng(seed), through.size, 0.04, 2e4)
    round_by = np.exp(1j * turn)
    one, other = close(*passages(through, over)), close(*passages(round_by * through, round_by * over))
    assert other.beta_std == pytest.approx(one.beta_std, rel=1e-6)
    assert other.beta == pytest.approx(one.beta, abs=1e-6, nan_ok=True)
    np.testing.assert_allclose(other.residual, round_by * one.residual, atol=1e-6)


@given(headings=HEADINGS, factor=st.floats(0.7, 1.5), seed=st.integers(0, 99))
@settings(max_examples=15)
def test_a_model_faster_by_a_factor_needs_less_by_that_factor(headings: list[float], factor: float, seed: int) -> None:
    # A speed that is a factor off changes the restricted likelihood by a constant, and the prior of the turn a little.
    through = velocities(headings)
    over = 1.1 * through + drift(np.random.default_rng(seed), through.size, 0.04, 2e4)
    one, other = close(*passages(through, over)), close(*passages(factor * through, over))
    assert factor * other.beta_std == pytest.approx(one.beta_std, rel=0.1)
    if not (one.reason or other.reason):
        assert factor * (1.0 + other.beta) == pytest.approx(1.0 + one.beta, abs=0.3 * one.beta_std)


@given(headings=HEADINGS, current=st.complex_numbers(max_magnitude=0.3))
@settings(max_examples=15)
def test_a_constant_current_of_any_size_leaves_the_speed_alone(headings: list[float], current: complex) -> None:
    through = velocities(headings)
    changing = drift(np.random.default_rng(5), through.size, 0.04, 2e4)
    one, other = (close(*passages(through, through + changing + add)) for add in (0.0, current))
    if not (one.reason or other.reason):
        assert other.beta == pytest.approx(one.beta, abs=0.25 * one.beta_std)

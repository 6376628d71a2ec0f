"""The constraint on a fit: residuals, their derivatives, and that it says of a common factor what the closure says."""

import math

import numpy as np
import pytest
from voyages import drift, passages, records

from pipeline.report.covariance import water
from pipeline.report.fitting.constraint import Constraint, constrain, dense
from pipeline.report.fitting.passages import Passages, find


def case(seed: int, k: int = 8, beta: float = 0.3) -> tuple[Passages, np.ndarray, np.ndarray]:
    """Return passages of one block each, and bounds of the blocks."""
    rng = np.random.default_rng(seed)
    through = 0.3 * np.exp(1j * rng.uniform(0.0, 2.0 * math.pi, k))
    found, _ = passages(through, (1.0 + beta) * through + drift(rng, k, 0.04, 2e4))
    return found, found.start + 60.0, found.end - 60.0


def made(found: Passages, start: np.ndarray, end: np.ndarray, speed: np.ndarray) -> Constraint:
    constraint, reason = constrain(found, start, end, speed)
    assert constraint is not None, reason
    return constraint


def test_a_common_factor_on_all_speeds_is_fitted_as_the_closure_finds_it() -> None:
    found, start, end = case(1)
    speed = np.full(start.size, 0.3)
    constraint = made(found, start, end, speed)
    slope = constraint.jacobian(speed[:, np.newaxis])
    step = -float(slope[:, 0] @ constraint.residuals(speed)) / float(slope[:, 0] @ slope[:, 0])
    assert step == pytest.approx(constraint.closure.beta, abs=0.5 * constraint.closure.beta_std)
    assert (slope[:, 0] @ slope[:, 0]) ** -0.5 == pytest.approx(constraint.closure.beta_std, rel=0.4)


def test_residuals_are_of_unit_variance_when_the_speeds_are_right() -> None:
    squares = []
    for seed in range(60):
        found, start, end = case(seed, beta=0.0)
        constraint = made(found, start, end, np.full(start.size, 0.3))
        squares.append(np.mean(constraint.residuals(np.full(start.size, 0.3)) ** 2))
    # The constant current and the turn are as good as free: 13 of 16 degrees of freedom are left.
    assert np.mean(squares) == pytest.approx(13.0 / 16.0, abs=0.2)


def test_derivatives_are_those_of_the_residuals() -> None:
    found, start, end = case(2)
    rng = np.random.default_rng(0)
    speed, slopes = rng.uniform(0.2, 0.4, start.size), rng.standard_normal((start.size, 3))
    constraint = made(found, start, end, speed)
    step = 1e-6 * rng.standard_normal(3)
    change = constraint.residuals(speed + slopes @ step) - constraint.residuals(speed)
    np.testing.assert_allclose(change, constraint.jacobian(slopes) @ step, atol=1e-9)
    assert constraint.size == change.size == 2 * start.size


def test_a_constant_current_is_not_seen() -> None:
    found, start, end = case(3)
    speed = np.full(start.size, 0.39)
    constraint = made(found, start, end, speed)
    moved = Constraint(constraint.over_ground + 0.05, constraint.weights, constraint.root, constraint.closure)
    before, after = (np.sum(item.residuals(speed) ** 2) for item in (constraint, moved))
    assert abs(after - before) < 0.2


def test_what_is_missing_is_named() -> None:
    found, start, end = case(4)
    assert constrain(found, start[:1], end[:1], np.full(1, 0.3)) == (
        None,
        "1 passages between fixes with steady flight: at least 2 are needed",
    )
    nothing = find(records([(0.0,)]).assign(heading=np.nan))
    assert constrain(nothing, start, end, np.full(start.size, 0.3)) == (None, "no heading")


def test_a_block_that_theory_cannot_fly_costs_its_passage() -> None:
    found, start, end = case(5)
    speed = np.full(start.size, 0.3)
    speed[2] = np.nan
    constraint, _ = constrain(found, start, end, speed)
    assert constraint is not None
    assert constraint.size == 14
    assert np.isfinite(constraint.residuals(speed)).all()


def test_a_band_is_filled_out() -> None:
    band = water(np.arange(3.0) * 10.0, np.arange(3.0) * 10.0 + 5.0, 1.0, 20.0).band
    full = dense(band)
    np.testing.assert_array_equal(full, full.T)
    assert full[0, 2] == band[2, 0]

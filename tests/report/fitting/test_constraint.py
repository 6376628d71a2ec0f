"""The constraint on a fit: residuals, their slopes, and that it says of a common factor what the closure says."""

import math
from dataclasses import replace

import numpy as np
import pytest
from synthetic import blocks
from voyages import drift, passages, records

from pipeline.records import timestamps
from pipeline.report.covariance import water
from pipeline.report.fitting.constraint import Displacements, dense
from pipeline.report.fitting.fit import fit, solvable
from pipeline.report.fitting.given import Given
from pipeline.report.fitting.model import Model
from pipeline.report.fitting.passages import Passages, find
from pipeline.report.fitting.points import Points
from pipeline.report.fitting.selection import fitted
from pipeline.vehicle import Vehicle

DIVES = 8


def case(vehicle: Vehicle, seed: int, factor: float = 1.0, dives: int = DIVES) -> tuple[Passages, Model]:
    """Return passages of two blocks each, flown `factor` times as fast as theory says, and the theory."""
    table = blocks(dives=dives, each=1, seed=seed)
    start = 1.4e9 + 3600.0 * (table["dive"].to_numpy() - 1) + 1800.0 * (table["direction"].to_numpy() > 0)
    table["start"], table["end"] = timestamps(start), timestamps(start + 1700.0)
    model = Model(vehicle, Points.of(table, vehicle), ())
    speed = model.fly(np.zeros(0)).horizontal_speed.reshape(dives, 2)
    rng = np.random.default_rng(seed)
    heading = np.exp(1j * rng.uniform(0.0, 2.0 * math.pi, dives))
    current = drift(rng, dives, 0.04, 2e4, each=3500.0, pause=100.0)
    found, _ = passages(heading, factor * speed.mean(axis=1) * heading + current, each=3500.0, pause=100.0)
    step = np.repeat(1750.0 * heading, 2)
    number = np.repeat(np.arange(dives), 2)
    time = found.start[number] + np.tile([875.0, 2625.0], dives)
    return replace(found, number=number, time=time, step=step), model


def test_a_common_factor_on_all_speeds_is_found_as_by_the_closure(petrel: Vehicle) -> None:
    found, model = case(petrel, 1, 1.3)
    constraint = Displacements.made(found, model)
    flight = model.fly(np.zeros(0))
    column = constraint._white(constraint.weights @ flight.horizontal_speed)
    step, std = column @ constraint.residual(flight) / (column @ column), (column @ column) ** -0.5
    assert step == pytest.approx(constraint.closure.beta, abs=0.5 * constraint.closure.beta_std)
    assert std == pytest.approx(constraint.closure.beta_std, rel=0.4)
    assert constraint.tells_speed


def test_residuals_are_of_unit_variance_when_the_speeds_are_right(petrel: Vehicle) -> None:
    squares = []
    for seed in range(40):
        found, model = case(petrel, seed)
        squares.append(np.mean(Displacements.made(found, model).residual(model.fly(np.zeros(0))) ** 2))
    # The constant current and the turn are as good as free: 13 of 16 degrees of freedom are left.
    assert np.mean(squares) == pytest.approx(13.0 / 16.0, abs=0.2)


def test_slopes_are_those_of_the_residuals(petrel: Vehicle) -> None:
    found, plain = case(petrel, 2)
    model = Model(petrel, plain.points, ("parasite_drag", "lift_slope", "net_buoyancy", "pitch"))
    constraint = Displacements.made(found, model)
    x, size = np.array([0.3, 20.0, 0.2, 0.01]), np.array([1e-4, 1e-2, 1e-4, 1e-5])
    slope = constraint.jacobian(model.fly(x))
    for k, step in enumerate(size):
        side = np.where(np.arange(4) == k, step, 0.0)
        change = constraint.residual(model.fly(x + side)) - constraint.residual(model.fly(x - side))
        np.testing.assert_allclose(slope[:, k], change / (2.0 * step), rtol=1e-5, atol=1e-7)
    assert slope.shape == (2 * DIVES, 4)


def test_a_constant_current_is_not_seen(petrel: Vehicle) -> None:
    found, model = case(petrel, 3)
    flight = model.fly(np.zeros(0))
    one = Displacements.made(found, model)
    other = replace(one, over_ground=one.over_ground + 0.05)
    before, after = (np.sum(item.residual(flight) ** 2) for item in (one, other))
    assert abs(after - before) < 0.2


def test_half_of_the_dives_keeps_their_passages_and_the_same_current(petrel: Vehicle) -> None:
    found, model = case(petrel, 4)
    whole = Displacements.made(found, model)
    half = whole.of(model.points.only(model.points.dive % 2 == 1))
    assert sorted(set(half.dives.tolist())) == [1, 3, 5, 7]
    assert half.closure is whole.closure
    flight = model.at(half.points).fly(np.zeros(0))
    assert half.residual(flight).shape == (DIVES,)
    one = whole.of(model.points.only(model.points.dive == 1))
    assert one.dives.size == 0
    assert not one.tells_speed
    assert one.residual(model.at(one.points).fly(np.zeros(0))).shape == (0,)


def test_one_heading_does_not_tell_speed(petrel: Vehicle) -> None:
    found, model = case(petrel, 5)
    straight = np.abs(found.step) * np.exp(0.3j)
    constraint = Displacements.made(replace(found, step=straight), model)
    assert constraint.dives.size == 2 * DIVES
    assert not constraint.tells_speed


def test_without_passages_nothing_is_constrained(petrel: Vehicle) -> None:
    _, model = case(petrel, 6)
    nothing = Displacements.made(find(records([(0.0,)]).assign(heading=np.nan)), model)
    assert nothing.dives.size == 0
    assert nothing.closure.reason == "no heading"
    assert nothing.jacobian(model.fly(np.zeros(0))).shape[0] == 0


def test_a_block_that_theory_cannot_fly_counts_as_it_did(petrel: Vehicle) -> None:
    found, model = case(petrel, 7)
    constraint = Displacements.made(found, model)
    flight = model.fly(np.zeros(0))
    lost = replace(flight, speed=np.where(np.arange(2 * DIVES) == 3, np.nan, flight.speed))
    np.testing.assert_allclose(constraint.residual(lost), constraint.residual(flight))
    assert np.isfinite(constraint.jacobian(lost)).all()


def test_lift_may_be_freed_thanks_to_the_fixes_and_is_found(petrel: Vehicle) -> None:
    table = blocks(dives=24, each=2, seed=9, pitches_deg=(16.0, 25.0, 38.0), sigma_w=0.003)
    true = petrel.with_values({"lift_slope": 0.75 * petrel["lift_slope"]}, "injected")
    flown = Model(true, Points.of(table, true), ()).fly(np.zeros(0))
    table["depth_rate"] = flown.depth_rate + 0.003 * np.random.default_rng(1).standard_normal(len(table))
    points = Points.of(table, petrel)
    rng = np.random.default_rng(2)
    heading = np.exp(1j * rng.uniform(0.0, 2.0 * math.pi, 24))
    start = np.array([points.start[points.dive == dive].min() for dive in range(1, 25)])
    end = np.array([points.end[points.dive == dive].max() for dive in range(1, 25)])
    plain, _ = passages(heading, heading)
    number = points.dive - 1
    step = (points.end - points.start) * heading[number]
    total = np.bincount(number, points.end - points.start)
    mean = np.bincount(number, (points.end - points.start) * flown.horizontal_speed) / total
    over = mean * heading + 0.1 + 0.01 * (rng.standard_normal(24) + 1j * rng.standard_normal(24))
    found = replace(
        plain, start=start, end=end, over_ground=over, number=number, step=step,
        time=0.5 * (points.start + points.end),
    )  # fmt: skip
    free = ("parasite_drag", "net_buoyancy", "lift_slope")
    refused = fit(table, petrel, free=free, resamples=0)
    assert "depth rates alone do not tell lift" in refused["reason"]
    begin, _ = solvable(table, petrel)
    problem, _ = solvable(table, petrel, Given(constraints=(Displacements.made(found, begin.model),)))
    solution = fitted(problem.freeing(free))
    assert solution is not None
    change, std = solution.x[2], math.sqrt(solution.covariance[2, 2])
    assert change == pytest.approx(-0.25 * petrel["lift_slope"], abs=2.5 * std)
    assert std < 0.15 * petrel["lift_slope"]


def test_a_band_is_filled_out() -> None:
    band = water(np.arange(3.0) * 10.0, np.arange(3.0) * 10.0 + 5.0, 1.0, 20.0).band
    full = dense(band)
    np.testing.assert_array_equal(full, full.T)
    assert full[0, 2] == band[2, 0]

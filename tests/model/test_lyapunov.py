"""Lyapunov functions: reference values, where they hold and where not, sublevel sets by sampling and by flight."""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import minimize

from pipeline.model.dynamics import trajectory
from pipeline.model.lyapunov import Certificate, Lyapunov, certificate, composite, inertia_limit, quadratic
from pipeline.model.modes import Equilibrium, deviation_rates, equilibrium, modes
from pipeline.model.perturbation import Bounds
from pipeline.vehicle import Vehicle, load

PETREL = load("petrel-ii")
LIGHT = PETREL.with_values({"pitch_inertia": 4.0}, "test")
ROOM = Bounds(0.5, 1.0, 0.4, math.inf)


@cache
def steady(thrust: float) -> Equilibrium:
    """Return the steady flight of the paper's example at a constant thrust."""
    return equilibrium(PETREL, 7.0, thrust=thrust)


def inside(found: Certificate, count: int, *, skin: float = 0.0) -> np.ndarray:
    """Return deviations inside the sublevel set, evenly in volume, or on `skin` of its level if that is given."""
    draws = np.random.default_rng(7)
    rays = draws.standard_normal((count, 4))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    rays = rays @ np.linalg.inv(np.linalg.cholesky(found.function.matrix)) * math.sqrt(found.level)
    if skin:
        size = np.sqrt(found.function.value(rays) / found.level)
        return rays / size[:, None] * math.sqrt(skin)
    points = rays * 1.3 * draws.uniform(0.0, 1.0, count)[:, None] ** 0.25
    return points[found.function.value(points) < found.level]


def test_group_f_composite_function(cases: dict[str, Any], vehicle_of: Callable[[dict[str, Any]], Vehicle]) -> None:
    for case in cases["f"]:
        inputs, expected = case["inputs"], case["physical"]
        vehicle = vehicle_of(inputs)
        changes = {
            "mass_forward": vehicle["mass_normal"],
            "moment_at_zero": -vehicle["moment_slope"] * inputs["alpha"],
        }
        state = equilibrium(
            vehicle.with_values(changes, "test"), inputs["G"], angle_of_attack=inputs["alpha"], thrust=inputs["T"]
        )
        corrected, printed = (composite(state, weight=expected["d"], formulas=f) for f in ("corrected", "printed"))
        y = expected["y"]
        assert float(corrected.value(y)) == pytest.approx(expected["v_corrected"], rel=1e-8)
        assert float(printed.value(y)) == pytest.approx(expected["v_eq32"], rel=1e-8)
        assert expected["tau"] * float(corrected.rate(y)) == pytest.approx(expected["vdot_corrected"], rel=1e-8)


@given(
    y=st.tuples(st.floats(-0.4, 0.4), st.floats(-1.0, 1.0), st.floats(-0.3, 0.3), st.floats(-0.05, 0.05)),
    weight=st.floats(0.05, 0.95),
)
def test_rate_is_the_slope_of_the_value_along_the_motion(y: tuple[float, ...], weight: float) -> None:
    step = 1e-6
    change = step * np.array(deviation_rates(*y, steady(7.0).flight))
    for function in (
        quadratic(steady(7.0)),
        composite(steady(7.0), weight=weight),
        composite(steady(7.0), weight=weight, formulas="printed"),
    ):
        after, before = function.value([np.array(y) + change, np.array(y) - change])
        assert float(function.rate(y)) == pytest.approx((after - before) / (2.0 * step), rel=1e-5, abs=1e-7)


def test_corrected_fast_part_falls_as_the_proof_says_and_the_printed_does_not() -> None:
    # At rest in speed and path the fast motion alone moves: d/dt_n of v is -d r_2 (ᾱ² + q̄²)/μ if path is held too.
    flight = steady(7.0).flight
    slow = -flight.body.pitch_inertia / (flight.body.pitch_damping * flight.speed**2)
    for formulas, agrees in (("corrected", True), ("printed", False)):
        function = composite(steady(7.0), weight=0.5, formulas=formulas)  # type: ignore[arg-type]
        c1, cross, c2 = (2.0 * function.matrix[i] / 0.5 for i in ((2, 2), (2, 3), (3, 3)))
        a, q = 0.02, -0.01
        a_rate, q_rate = q / flight.rate_scale, -(a + q) / slow
        fall = (c1 * a + cross * q) * a_rate + (c2 * q + cross * a) * q_rate
        assert (fall == pytest.approx(-(a * a + q * q) / slow, rel=1e-9)) == agrees


def test_inertia_up_to_which_the_corrected_function_holds() -> None:
    assert inertia_limit(PETREL, 7.0, thrust=7.0) == pytest.approx(11.4, abs=0.05)
    assert inertia_limit(PETREL, 7.0) == pytest.approx(8.1, abs=0.05)


@pytest.mark.parametrize("thrust", [0.0, 7.0])
@pytest.mark.parametrize("formulas", ["printed", "corrected"])
def test_the_composite_function_does_not_hold_at_the_paper_s_inertia(thrust: float, formulas: Any) -> None:
    state = steady(thrust)
    function = composite(state, formulas=formulas)
    assert not function.holds
    assert function.reason == "the function grows along some small motion, at any weight d"
    for weight in np.linspace(0.01, 0.99, 99):
        tried = composite(state, weight=float(weight), formulas=formulas)
        assert tried.decay <= function.decay + 1e-9
        # The counterexample: a small motion along which the function grows.
        slopes = modes(state).matrix
        values, vectors = np.linalg.eigh(tried.matrix @ slopes + slopes.T @ tried.matrix)
        assert float(tried.rate(1e-4 * vectors[:, np.argmax(values)])) > 0.0
    found = certificate(function)
    assert not found.holds
    assert found.reason == function.reason
    assert math.isnan(found.level)


FUNCTIONS: dict[str, Callable[[], Lyapunov]] = {
    "quadratic, gliding": lambda: quadratic(steady(0.0)),
    "quadratic, driven": lambda: quadratic(steady(7.0)),
    "quadratic, Q = 1": lambda: quadratic(steady(7.0), damping=np.eye(4)),
    "quadratic, held pitch, diving": lambda: quadratic(equilibrium(PETREL, -3.0, pitch=-0.6, moment_sin=-4.0)),
    "composite, light and driven": lambda: composite(
        equilibrium(LIGHT, 7.0, thrust=7.0, hold="propeller_speed"),
    ),
    "composite, light and gliding": lambda: composite(equilibrium(LIGHT, 7.0)),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_function_falls_everywhere_in_its_sublevel_set_and_not_beyond(name: str) -> None:
    function = FUNCTIONS[name]()
    found = certificate(function, ROOM)
    assert found.holds
    points = inside(found, 400_000)
    assert len(points) > 100_000
    assert function.value(points).min() > 0.0
    assert function.rate(points).max() < 0.0
    assert (np.abs(points) <= np.array(ROOM)).all()
    assert float(function.value(found.limit)) == pytest.approx(found.level, rel=1e-9)
    touches = np.isclose(np.abs(found.limit), np.array(ROOM), rtol=1e-12).any()
    assert touches or float(function.rate(1.0001 * found.limit)) > 0.0


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if name.startswith("quadratic")])
def test_another_optimiser_finds_no_lower_point_where_the_function_does_not_fall(name: str) -> None:
    function = FUNCTIONS[name]()
    found = certificate(function)
    spread = np.linalg.inv(np.linalg.cholesky(function.matrix)).T * math.sqrt(found.level)
    limits = (
        {"type": "ineq", "fun": lambda z: float(function.rate(spread @ z)) / found.level},
        {"type": "ineq", "fun": lambda z: z @ z - 0.04},
    )
    lowest = math.inf
    for start in np.random.default_rng(11).standard_normal((30, 4)):
        end = minimize(
            lambda z: z @ z,
            1.5 * start / np.linalg.norm(start),
            method="SLSQP",
            constraints=limits,
            options={"maxiter": 200, "ftol": 1e-10},
        )
        if end.success and limits[0]["fun"](end.x) >= -1e-8:
            lowest = min(lowest, float(end.fun))
    assert lowest == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("name", ["quadratic, gliding", "quadratic, driven", "composite, light and gliding"])
def test_motions_from_the_edge_of_the_sublevel_set_return(name: str) -> None:
    function = FUNCTIONS[name]()
    found = certificate(function, ROOM)
    vehicle = LIGHT if "light" in name else PETREL
    flight = function.state.flight
    at_rest = np.array([flight.speed, flight.path_angle, flight.angle_of_attack, 0.0])
    units = np.array([flight.speed, 1.0, 1.0, 1.0 / flight.rate_scale])
    # A thrust law with slope zero holds the thrust constant.
    driven = vehicle.with_values({"thrust_static": flight.thrust / 1020.0, "thrust_slope": 0.0}, "test")
    driven = driven.with_values({"propeller_diameter": 1.0}, "test")
    for y in inside(found, 12, skin=0.999):
        flown = trajectory(
            driven, at_rest + y * units, np.linspace(0.0, 200.0, 401), net_buoyancy=7.0, propeller_speed=1.0
        )
        deviations = (flown - at_rest) / units
        values = function.value(deviations)
        assert (np.diff(values[values > 1e-12 * found.level]) < 0.0).all()
        assert np.abs(deviations[-1]).max() < 1e-3


def test_axes_are_where_the_set_ends() -> None:
    for function in (quadratic(steady(7.0)), composite(equilibrium(LIGHT, 7.0))):
        found = certificate(function, ROOM)
        for axis, reach in zip(np.eye(4), found.semi_axes, strict=True):
            assert function.value([reach * axis, -reach * axis]).max() == pytest.approx(found.level, rel=1e-9)
    found = certificate(quadratic(steady(7.0)), ROOM)
    reached = np.abs(inside(found, 200_000, skin=1.0)).max(axis=0)
    assert (reached <= found.extents * (1.0 + 1e-12)).all()
    np.testing.assert_allclose(reached, found.extents, rtol=0.01)


def test_quadratic_function_of_given_damping_solves_the_lyapunov_equation() -> None:
    damping = np.diag([1.0, 2.0, 3.0, 4.0])
    slopes = modes(steady(7.0)).matrix
    form = quadratic(steady(7.0), damping=damping).matrix
    np.testing.assert_allclose(slopes.T @ form + form @ slopes, -damping, atol=1e-9)
    np.testing.assert_allclose(form, solve_continuous_lyapunov(slopes.T, -damping), rtol=1e-12)


def test_sum_of_mode_amplitudes_decays_twice_as_fast_as_the_slowest_mode() -> None:
    for state in (steady(0.0), steady(7.0)):
        assert quadratic(state).decay == pytest.approx(2.0 / modes(state).time_constants[0], rel=1e-6)


def test_guaranteed_sets_are_wider_than_those_of_unit_damping() -> None:
    # Known before: semi-axes (V̄, γ̄, ᾱ) of .242/.165/.269 gliding and .320/.153/.156 driven.
    for state, known in ((steady(0.0), (0.242, 0.165, 0.269)), (steady(7.0), (0.320, 0.153, 0.156))):
        by_modes, by_one = (certificate(quadratic(state, damping=q)) for q in (None, np.eye(4)))
        assert (by_modes.semi_axes > by_one.semi_axes).all()
        assert (by_modes.semi_axes[:3] > known).all()


@settings(max_examples=15)
@given(g=st.floats(1.0, 9.0), pitch=st.floats(0.4, 1.3))
def test_dives_have_the_functions_of_their_mirrored_climbs(g: float, pitch: float) -> None:
    vehicle = PETREL.with_values({"moment_at_zero": 0.0}, "symmetric")
    up, down = (equilibrium(vehicle, s * g, pitch=s * pitch, moment_sin=-4.0) for s in (1.0, -1.0))
    y = np.array([0.05, 0.1, 0.01, 0.002])
    mirrored = y * [1.0, -1.0, -1.0, -1.0]
    for make in (quadratic, composite):
        here, there = make(up), make(down)
        assert here.holds == there.holds
        assert float(here.value(y)) == pytest.approx(float(there.value(mirrored)), rel=1e-4)
        assert here.decay == pytest.approx(there.decay, rel=1e-4, abs=1e-6)


def test_no_function_where_a_mode_grows_or_nothing_flies() -> None:
    wild = equilibrium(PETREL.with_values({"moment_slope": 313.8643, "moment_at_zero": 0.7959}, "test"), 7.0)
    nowhere = equilibrium(PETREL, 7.0, angle_of_attack=0.1, thrust=60.0)
    for state, reason in ((wild, "a mode grows"), (nowhere, "no equilibrium")):
        function = quadratic(state)
        assert not function.holds
        assert reason in function.reason
        assert not certificate(function).holds
    assert not composite(wild).holds
    assert composite(nowhere).reason == nowhere.reason


@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_weights_outside_their_range_are_refused(weight: float) -> None:
    with pytest.raises(ValueError, match="between 0 and 1"):
        composite(steady(7.0), weight=weight)


def test_senseless_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="symmetric, positive definite"):
        quadratic(steady(7.0), damping=-np.eye(4))
    with pytest.raises(ValueError, match="expected positive numbers"):
        quadratic(steady(7.0), weights=(1.0, 0.0, 1.0, 1.0))
    with pytest.raises(ValueError, match="that of speed below 1"):
        certificate(quadratic(steady(7.0)), Bounds(1.0, 1.0, 1.0, 1.0))
    with pytest.raises(ValueError, match="expected 'printed' or 'corrected'"):
        composite(steady(7.0), formulas="right")  # type: ignore[arg-type]

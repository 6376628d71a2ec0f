"""Steady flight: published numbers, limits, symmetries, and what is refused or cannot be had."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pipeline.model.closure import glide_angle
from pipeline.model.forces import drag, lift, thrust
from pipeline.model.steady import Steady, steady_state, trim_at_moment, trim_at_pitch, trim_sensitivities
from pipeline.model.trajectory import Inputs, simulate
from pipeline.vehicle import Vehicle, load

PETREL = load("petrel-ii")
SYMMETRIC = PETREL.with_values({"moment_at_zero": 0.0}, "symmetric")
SEAGLIDER = load("seaglider")
ALPHA_E = -0.7959 / 313.8643

pitches = st.floats(0.15, 1.5)
buoyancies = st.floats(0.3, 12.0)


def scaled(vehicle: Vehicle, factor: float) -> Vehicle:
    names = ("lift_at_zero", "lift_slope", "parasite_drag", "induced_drag", "thrust_static", "thrust_slope")
    return vehicle.with_values({name: factor * vehicle[name] for name in names}, "scaled")


# Numbers of the paper and its errata


@pytest.mark.parametrize(("g", "force", "speed"), [(7.0, 7.0, 1.3694), (7.0, 7.1025, 1.3743), (2.5, 2.2501, 0.7979)])
def test_speeds_of_the_paper_at_its_thrusts_in_its_signs(petrel: Vehicle, g: float, force: float, speed: float) -> None:
    assert float(steady_state(petrel, g, ALPHA_E, thrust=force, signs="paper").speed) == pytest.approx(speed, abs=1e-4)


def test_danjiangkou_free_and_held_pitch(petrel: Vehicle) -> None:
    free = steady_state(petrel, 2.5, ALPHA_E, propeller_speed=13.0)
    assert float(free.speed) == pytest.approx(0.789, abs=5e-4)
    assert math.degrees(float(free.pitch)) == pytest.approx(77.0, abs=0.2)
    held = trim_at_pitch(petrel, 2.5, math.radians(3.5), propeller_speed=13.0)
    assert float(held.speed) == pytest.approx(0.615, abs=5e-4)
    assert float(held.required_moment) == pytest.approx(-1.88, abs=5e-3)


def test_south_china_sea_held_pitch(petrel: Vehicle) -> None:
    held = trim_at_pitch(petrel, 7.0, math.radians(43.5), propeller_speed=1400.0 / 60.0)
    assert float(held.speed) == pytest.approx(1.294, abs=5e-4)
    assert math.degrees(float(held.path_angle)) == pytest.approx(43.98, abs=5e-3)
    assert math.degrees(float(held.angle_of_attack)) == pytest.approx(-0.48, abs=5e-3)
    assert float(held.required_moment) == pytest.approx(-3.11, abs=5e-3)


# Limits


@given(g=buoyancies, pitch=st.floats(0.4, 1.5))
def test_unpowered_trim_is_the_glide_of_the_polar_closure(g: float, pitch: float) -> None:
    for vehicle in (PETREL, load("slocum-g2")):
        trim = trim_at_pitch(vehicle, g, pitch)
        alpha = glide_angle(vehicle.polar, float(trim.speed), pitch)
        alpha = alpha[0] if isinstance(alpha, tuple) else alpha
        assert float(trim.angle_of_attack) == pytest.approx(alpha, rel=1e-8)
        assert math.tan(float(trim.path_angle)) == pytest.approx(
            -drag(vehicle.polar, 1.0, alpha) / lift(vehicle.polar, 1.0, alpha), rel=1e-8
        )


@given(g=st.floats(-9.0, 9.0).filter(lambda g: abs(g) > 0.1), alpha=st.floats(-0.1, 0.1))
def test_zero_thrust_is_the_glide_of_eq_21_without_b(g: float, alpha: float) -> None:
    # A V⁴ = G², γ = -atan(K_De/K_Le).
    d, l = 7.3579 + 318.0849 * alpha**2, 351.357 * alpha  # noqa: E741
    state = steady_state(PETREL, g, alpha, propeller_speed=0.0)
    assert float(state.speed) == pytest.approx(math.sqrt(abs(g)) / (d**2 + l**2) ** 0.25, rel=1e-10)
    assert float(state.path_angle) == pytest.approx(
        math.atan2(math.copysign(d, g), -math.copysign(1.0, g) * l), rel=1e-10
    )


@given(g=st.floats(-9.0, 9.0).filter(lambda g: abs(g) > 0.1), pitch=st.floats(0.4, 1.4), alpha=st.floats(0.005, 0.1))
def test_thrust_goes_to_zero_without_a_jump(g: float, pitch: float, alpha: float) -> None:
    side = math.copysign(1.0, g)
    for at in (
        lambda t: trim_at_pitch(PETREL, g, side * pitch, thrust=t),
        lambda t: steady_state(PETREL, g, alpha, thrust=t),
    ):
        glide, barely, braked = at(0.0), at(1e-9), at(-1e-9)
        for name in ("speed", "path_angle", "angle_of_attack", "required_moment"):
            for other in (barely, braked):
                assert float(getattr(other, name)) == pytest.approx(float(getattr(glide, name)), rel=1e-7, abs=1e-8)


def test_powered_flight_without_net_buoyancy_follows_the_nose() -> None:
    state = trim_at_pitch(PETREL, 0.0, 0.1, thrust=5.0)
    assert float(state.path_angle) == pytest.approx(0.1, abs=1e-15)
    assert float(state.speed) == pytest.approx(math.sqrt(5.0 / 7.3579), rel=1e-12)


@given(pitch=st.floats(-1.2, 1.2), turning=st.floats(8.0, 25.0))
def test_net_buoyancy_goes_to_zero_without_a_jump(pitch: float, turning: float) -> None:
    at = [float(trim_at_pitch(PETREL, g, pitch, propeller_speed=turning).speed) for g in (-1e-7, 0.0, 1e-7)]
    assert at[0] == pytest.approx(at[1], rel=1e-6)
    assert at[2] == pytest.approx(at[1], rel=1e-6)


def test_powered_flight_crosses_level_without_a_gap() -> None:
    pitch = np.linspace(-0.1, 0.1, 401)
    state = trim_at_pitch(PETREL, 2.5, pitch, propeller_speed=13.0)
    assert np.isfinite(state.speed).all()
    assert (np.diff(state.path_angle) > 0.0).all()
    assert state.path_angle[0] < 0.0 < state.path_angle[-1]
    assert np.abs(np.diff(state.speed)).max() < 1e-3


def test_level_powered_flight_at_a_held_angle_of_attack_exists() -> None:
    # γ = 0 where T cos α = D: take that α from the held pitch, and ask again with α held.
    pitch = np.linspace(-0.02, 0.05, 141)
    held = trim_at_pitch(PETREL, 2.5, pitch, propeller_speed=13.0)
    again = steady_state(PETREL, 2.5, held.angle_of_attack, propeller_speed=13.0)
    np.testing.assert_allclose(again.speed, held.speed, rtol=1e-9)
    np.testing.assert_allclose(again.path_angle, held.path_angle, atol=1e-9)


def test_vertical_glide_has_no_lift() -> None:
    state = trim_at_pitch(PETREL, 7.0, 0.5 * math.pi)
    assert float(state.angle_of_attack) == pytest.approx(0.0, abs=1e-15)
    assert float(state.speed) == pytest.approx(math.sqrt(7.0 / 7.3579), rel=1e-9)


def test_glide_flatter_than_the_best_does_not_exist() -> None:
    # Flattest glide in pitch: minimise θ(α) = atan(D/-L) + α over α; more induced drag brings it to small α.
    draggy = PETREL.with_values({"induced_drag": 1500.0}, "draggy")
    alpha = np.linspace(-0.3, -1e-3, 2000001)
    d, l = 7.3579 + 1500.0 * alpha**2, 351.357 * alpha  # noqa: E741
    shallowest = (np.arctan2(d, -l) + alpha).min()
    above, below = trim_at_pitch(draggy, 3.0, [shallowest + 1e-8, shallowest - 1e-8]).speed
    assert np.isfinite(above)
    assert np.isnan(below)


# Symmetry, scale, monotony


@given(g=buoyancies, pitch=pitches, turning=st.sampled_from([0.0, 10.0, 20.0]))
def test_mirrored_in_depth_and_pitch_gives_mirrored_flight(g: float, pitch: float, turning: float) -> None:
    up = trim_at_pitch(SYMMETRIC, g, pitch, propeller_speed=turning)
    down = trim_at_pitch(SYMMETRIC, -g, -pitch, propeller_speed=turning)
    np.testing.assert_array_equal(up.speed, down.speed)
    np.testing.assert_array_equal(up.path_angle, -down.path_angle)
    np.testing.assert_array_equal(up.required_moment, -down.required_moment)


@given(
    g=buoyancies,
    alpha=st.floats(1e-3, 0.1),
    turning=st.sampled_from([0.0, 10.0, 20.0]),
    signs=st.sampled_from(["physical", "paper"]),
)
def test_mirrored_angle_of_attack_gives_mirrored_flight(g: float, alpha: float, turning: float, signs: Any) -> None:
    up = steady_state(PETREL, g, -alpha, propeller_speed=turning, signs=signs)
    down = steady_state(PETREL, -g, alpha, propeller_speed=turning, signs=signs)
    np.testing.assert_array_equal(up.speed, down.speed)
    np.testing.assert_array_equal(up.path_angle, -down.path_angle)


@given(g=buoyancies, pitch=pitches, turning=st.sampled_from([0.0, 12.0]), factor=st.floats(0.2, 5.0))
def test_all_forces_scaled_alike_leave_the_flight_as_it_is(
    g: float, pitch: float, turning: float, factor: float
) -> None:
    before = trim_at_pitch(PETREL, g, pitch, propeller_speed=turning)
    assume(np.isfinite(before.speed))
    after = trim_at_pitch(scaled(PETREL, factor), factor * g, pitch, propeller_speed=turning)
    assert float(after.speed) == pytest.approx(float(before.speed), rel=1e-9)
    assert float(after.angle_of_attack) == pytest.approx(float(before.angle_of_attack), rel=1e-7, abs=1e-12)
    assert float(after.thrust) == pytest.approx(factor * float(before.thrust), rel=1e-9)


@given(g=buoyancies, pitch=pitches, density=st.floats(990.0, 1060.0))
def test_denser_water_slows_a_glide_by_the_root_of_density(g: float, pitch: float, density: float) -> None:
    reference = trim_at_pitch(PETREL, g, pitch)
    assume(np.isfinite(reference.speed))
    other = trim_at_pitch(PETREL, g, pitch, density=density)
    assert float(other.speed) == pytest.approx(float(reference.speed) * math.sqrt(1020.0 / density), rel=1e-10)
    assert float(other.path_angle) == pytest.approx(float(reference.path_angle), rel=1e-10)


@given(pitch=st.floats(0.5, 1.5), turning=st.sampled_from([0.0, 12.0, 20.0]))
def test_more_net_buoyancy_is_more_speed_on_the_climb(pitch: float, turning: float) -> None:
    speed = trim_at_pitch(PETREL, np.linspace(0.2, 12.0, 60), pitch, propeller_speed=turning).speed
    assert (np.diff(speed) > 0.0).all()


# Speed exponent


@given(g=buoyancies, pitch=st.floats(0.5, 1.5), exponent=st.sampled_from([-0.5, -0.6, 0.2]), k_l0=st.floats(-3.0, 3.0))
def test_flight_with_a_speed_exponent_balances_the_forces(g: float, pitch: float, exponent: float, k_l0: float) -> None:
    vehicle = SEAGLIDER.with_values({"drag_exponent": exponent, "lift_at_zero": k_l0}, "exponent")
    state = trim_at_pitch(vehicle, g, pitch)
    v, gamma, alpha = float(state.speed), float(state.path_angle), float(state.angle_of_attack)
    assert drag(vehicle.polar, v, alpha) == pytest.approx(g * math.sin(gamma), rel=1e-9)
    assert lift(vehicle.polar, v, alpha) == pytest.approx(-g * math.cos(gamma), rel=1e-7, abs=1e-9 * g)
    again = steady_state(vehicle, g, alpha)
    assert float(again.speed) == pytest.approx(v, rel=1e-9)


def test_exponent_so_small_that_it_is_none_changes_nothing() -> None:
    nearly = PETREL.with_values({"drag_exponent": 1e-13}, "nearly none")
    for turning in (0.0, 15.0):
        here, there = (trim_at_pitch(v, 4.0, [0.5, 1.0], propeller_speed=turning) for v in (nearly, PETREL))
        np.testing.assert_allclose(here.speed, there.speed, rtol=1e-11)


# Moment balance


@given(g=buoyancies, pitch=st.floats(0.35, 1.2), turning=st.sampled_from([0.0, 15.0]))
def test_moment_balance_finds_the_pitch_whose_moment_the_battery_gives(g: float, pitch: float, turning: float) -> None:
    steep = PETREL.with_values({"righting_moment": -30.0}, "bottom-heavy")
    held = trim_at_pitch(steep, g, pitch, propeller_speed=turning)
    assume(np.isfinite(held.speed))
    moment_cos = (float(held.required_moment) + 30.0 * math.sin(pitch)) / math.cos(pitch)
    position = steep["battery_neutral_position"] - moment_cos / (steep["battery_mass"] * 9.81)
    found = trim_at_moment(steep, g, battery_position=position, propeller_speed=turning)
    assert str(found.reason) == ""
    left = float(found.required_moment) - moment_cos * math.cos(found.pitch) + 30.0 * math.sin(found.pitch)
    assert left == pytest.approx(0.0, abs=1e-9)
    assert abs(float(found.pitch)) <= pitch + 1e-9


def test_battery_forward_puts_the_nose_down() -> None:
    pitch = trim_at_moment(PETREL, -5.0, battery_position=[0.01, 0.02, 0.03]).pitch
    assert (np.diff(pitch) < 0.0).all()
    assert (pitch < 0.0).all()


def test_unstable_trims_are_not_flown() -> None:
    tail_heavy = PETREL.with_values({"moment_slope": 313.0, "righting_moment": 30.0}, "unstable")
    state = trim_at_moment(tail_heavy, 5.0, moment_cos=0.0)
    assert str(state.reason).startswith("no equilibrium: ")
    assert np.isnan(state.speed)


# What cannot be had


@pytest.mark.parametrize(
    ("state", "reason"),
    [
        (trim_at_pitch(PETREL, 0.0, 0.3), "no equilibrium: neither net buoyancy nor thrust"),
        (
            trim_at_pitch(PETREL, -3.0, 0.3),
            "no equilibrium: the forces do not balance at this pitch (too shallow, or against the net buoyancy)",
        ),
        (
            steady_state(PETREL, 7.0, -0.1047, thrust=8.0),
            "no equilibrium: the forces do not balance at this angle of attack",
        ),
        (
            steady_state(PETREL, 0.0, -0.01, thrust=8.0),
            "no equilibrium: without net buoyancy the path is undetermined at a held angle of attack",
        ),
        (trim_at_pitch(PETREL, math.nan, 0.3), "no net_buoyancy given"),
        (trim_at_pitch(PETREL, 3.0, math.nan), "no pitch given"),
        (steady_state(PETREL, 3.0, math.nan), "no angle_of_attack given"),
        (trim_at_pitch(PETREL, 3.0, 0.3, propeller_speed=math.nan), "no propeller_speed or thrust given"),
        (trim_at_pitch(PETREL, 3.0, 0.3, density=math.nan), "no density given"),
        (trim_at_moment(PETREL, 3.0, battery_position=math.nan), "no battery_position given"),
        (
            trim_at_pitch(load("slocum-g2"), 3.0, 0.3, propeller_speed=5.0),
            "powered, but the vehicle file has no thrust law",
        ),
        (
            trim_at_pitch(PETREL.with_values({"lift_slope": math.nan}, "unknown"), 3.0, 0.3),
            "the vehicle file leaves lift_slope unknown",
        ),
        (
            trim_at_moment(SEAGLIDER, 3.0, battery_position=0.0),
            "the vehicle file leaves mass_forward, mass_normal, pitch_inertia, moment_at_zero, moment_slope, "
            "pitch_damping, battery_mass unknown",
        ),
    ],
)
def test_what_cannot_be_had_is_nan_with_its_reason(state: Steady, reason: str) -> None:
    assert str(state.reason) == reason
    for name in ("speed", "path_angle", "angle_of_attack", "pitch", "thrust", "advance_ratio", "required_moment"):
        assert np.isnan(getattr(state, name)), name


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"parasite_drag": 0.0}, "parasite_drag is 0 kg/m; expected a positive number"),
        ({"parasite_drag": -7.36}, "parasite_drag is -7.36 kg/m; expected a positive number"),
        ({"induced_drag": -318.0}, "induced_drag is -318 kg/m/rad2; expected a positive number"),
        ({"lift_slope": 0.0}, "lift_slope is 0 kg/m/rad; expected a positive number"),
        ({"propeller_diameter": -0.08}, "propeller_diameter is -0.08 m; expected a positive number"),
        ({"mass_forward": -84.7}, "mass_forward is -84.7 kg; expected a positive number"),
        ({"pitch_inertia": 0.0}, "pitch_inertia is 0 kg m2; expected a positive number"),
        ({"battery_mass": -11.0}, "battery_mass is -11 kg; expected a positive number"),
    ],
)
def test_an_impossible_coefficient_is_a_reason_wherever_it_is_needed(change: dict[str, float], reason: str) -> None:
    vehicle = PETREL.with_values(change, "impossible")
    states = [trim_at_moment(vehicle, -5.0, battery_position=0.02)]
    if not {"mass_forward", "pitch_inertia", "battery_mass"} & set(change):
        states += [trim_at_pitch(vehicle, 5.0, 0.6), steady_state(vehicle, 5.0, -0.02)]
    for state in states:
        assert np.isnan(state.speed)
        assert str(state.reason) == reason
    flight = simulate(vehicle, [0.6, 0.5, 0.0, 0.0], Inputs(0.0, 5.0, 0.02), [0.0, 1.0])
    assert np.isnan(flight.speed).all()
    assert flight.reason == reason


def test_one_bad_case_does_not_spoil_its_neighbours() -> None:
    state = trim_at_pitch(PETREL, [7.0, math.nan, 7.0], [[0.6, 0.6, -0.6]])
    assert state.speed.shape == (1, 3)
    np.testing.assert_array_equal(np.isfinite(state.speed), [[True, False, False]])
    assert list(state.reason[0] == "") == [True, False, False]


def test_unknown_moments_leave_the_flight_and_drop_the_moment() -> None:
    state = trim_at_pitch(SEAGLIDER, 2.0, 0.4)
    assert np.isfinite(state.speed)
    assert np.isnan(state.required_moment)
    assert str(state.reason) == ""


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: steady_state(PETREL, 7.0, -1.45), "angle_of_attack: found -1.45; expected at most 0.5 rad; degrees?"),
        (lambda: trim_at_pitch(PETREL, 7.0, 43.5), "pitch: found 43.5; expected at most 1.571 rad; degrees?"),
        (
            lambda: trim_at_pitch(PETREL, 7.0, 0.7, propeller_speed=1400.0),
            "propeller_speed: found 1400; expected at most 100 rev/s; rev/s, not rpm?",
        ),
        (
            lambda: trim_at_pitch(PETREL, 7.0, 0.7, density=-1020.0),
            "density: found -1020; expected a positive number of kg/m3",
        ),
        (
            lambda: trim_at_pitch(PETREL, 7.0, 0.7, thrust=1.0, propeller_speed=1.0),
            "found both thrust and propeller_speed; give one of them",
        ),
        (
            lambda: trim_at_moment(PETREL, 7.0),
            "found both or neither of battery_position and moment_cos; give one of them",
        ),
        (
            lambda: steady_state(PETREL, 7.0, 0.0, signs="printed"),  # type: ignore[arg-type]
            "signs: found 'printed'; expected 'physical' or 'paper'",
        ),
    ],
)
def test_wrong_units_are_refused_with_a_hint(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match="found") as caught:
        call()
    assert str(caught.value) == message


# Sensitivities


@pytest.mark.parametrize(
    ("vehicle", "g", "pitch", "turning"),
    [
        (PETREL, 2.5, 0.0611, 13.0),
        (PETREL, 7.0, 0.759, 23.3),
        (PETREL, -4.0, -0.45, 0.0),
        (SEAGLIDER.with_values({"lift_at_zero": 0.8}, "cambered"), 2.0, 0.4, 0.0),
    ],
)
def test_sensitivities_agree_with_central_differences(vehicle: Vehicle, g: float, pitch: float, turning: float) -> None:
    found = trim_sensitivities(vehicle, g, pitch, propeller_speed=turning, density=1024.0)

    def flight(changed: Vehicle, g: float, pitch: float, turning: float) -> np.ndarray:
        state = trim_at_pitch(changed, g, pitch, propeller_speed=turning, density=1024.0)
        return np.array([float(state.speed), float(state.path_angle)])

    def check(name: str, difference: np.ndarray) -> None:
        np.testing.assert_allclose(np.array(found[name], dtype=float), difference, rtol=2e-6, atol=1e-9, err_msg=name)

    for name in ("parasite_drag", "lift_slope", "lift_at_zero", "induced_drag"):
        step = 1e-5 * max(1.0, abs(vehicle[name]))
        ends = [
            flight(vehicle.with_values({name: vehicle[name] + s * step}, "moved"), g, pitch, turning) for s in (1, -1)
        ]
        check(name, (ends[0] - ends[1]) / (2.0 * step))
    step = 1e-5
    check(
        "net_buoyancy", (flight(vehicle, g + step, pitch, turning) - flight(vehicle, g - step, pitch, turning)) / 2e-5
    )
    check("pitch", (flight(vehicle, g, pitch + step, turning) - flight(vehicle, g, pitch - step, turning)) / 2e-5)
    if turning:
        check(
            "propeller_speed",
            (flight(vehicle, g, pitch, turning + step) - flight(vehicle, g, pitch, turning - step)) / 2e-5,
        )
        law = {name: vehicle[name] for name in ("thrust_static", "thrust_slope")}
        ends = [
            flight(vehicle.with_values({k: v * (1.0 + s * step) for k, v in law.items()}, "moved"), g, pitch, turning)
            for s in (1, -1)
        ]
        check("thrust_scale", (ends[0] - ends[1]) / (2.0 * step))
    else:
        assert not np.any(np.array(found["thrust_scale"]))
        assert not np.any(np.array(found["propeller_speed"]))


def test_sensitivities_keep_the_shape_and_are_nan_where_there_is_no_trim() -> None:
    found = trim_sensitivities(PETREL, [[3.0, -3.0]], [[0.5], [0.6]])
    for speed, path in found.values():
        assert speed.shape == path.shape == (2, 2)
        np.testing.assert_array_equal(np.isnan(speed), [[False, True], [False, True]])


def test_petrel_needs_as_much_thrust_as_its_law_gives() -> None:
    state = trim_at_pitch(PETREL, 2.5, 0.0611, propeller_speed=13.0)
    law = PETREL.propeller
    assert law is not None
    assert float(state.thrust) == pytest.approx(thrust(law, 1020.0, 13.0, float(state.speed)), rel=1e-12)
    assert float(state.advance_ratio) == pytest.approx(float(state.speed) / (13.0 * 0.08), rel=1e-12)

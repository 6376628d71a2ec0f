"""Flight of a propeller whose power alone is known: against momentum theory written out here, and scipy."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq

from pipeline.model.case import NO_THRUST_LAW, driven
from pipeline.model.forces import power_for, relative_thrust_std, thrust_by_power
from pipeline.model.modes import equilibrium, modes
from pipeline.model.predict import predict
from pipeline.model.steady import (
    Steady,
    steady_state,
    trim_at_moment,
    trim_at_pitch,
    trim_sensitivities,
    trims_at_moment,
)
from pipeline.records import BLOCKS, conform
from pipeline.vehicle import Coefficient, Vehicle, load

HYBRID = load("slocum-thruster")
DENSITY = 1028.0


def momentum_thrust(power: float, speed: float, efficiency: float = 0.5, diameter: float = 0.22) -> float:
    """Return T with T (V + v) = η P and T = 2 ρ A (V + v) v, by scipy's brentq over v."""
    area = 0.25 * math.pi * diameter**2
    added = brentq(
        lambda v: 2.0 * DENSITY * area * (speed + v) ** 2 * v - efficiency * power, 1e-9, 10.0, xtol=1e-15, rtol=1e-14
    )
    return efficiency * power / (speed + added)


@pytest.mark.parametrize(("force", "pitch"), [(-3.0, -0.4), (2.0, 0.4), (0.0, 0.0), (-0.5, 0.2), (4.0, 0.3)])
@pytest.mark.parametrize("power", [0.5, 5.0, 60.0])
def test_flight_by_power_is_that_by_the_thrust_of_momentum_theory_at_its_speed(
    force: float, pitch: float, power: float
) -> None:
    found = trim_at_pitch(HYBRID, force, pitch, propeller_power=power, density=DENSITY)
    tried = np.linspace(0.02, 4.0, 400)
    thrust = [momentum_thrust(power, speed) for speed in tried]
    ahead = trim_at_pitch(HYBRID, force, pitch, thrust=thrust, density=DENSITY).speed - tried
    roots = np.flatnonzero((ahead[:-1] > 0.0) & (ahead[1:] <= 0.0))
    assert roots.size
    assert tried[roots[-1]] <= float(found.speed) <= tried[roots[-1] + 1]
    assert float(found.thrust) == pytest.approx(momentum_thrust(power, float(found.speed)), rel=1e-9)
    constant = trim_at_pitch(HYBRID, force, pitch, thrust=float(found.thrust), density=DENSITY)
    assert float(found.speed) == pytest.approx(float(constant.speed), rel=1e-9)
    assert float(found.path_angle) == pytest.approx(float(constant.path_angle), abs=1e-9)


def test_level_flight_by_power_balances_drag_alone() -> None:
    speed = float(trim_at_pitch(HYBRID, 0.0, 0.0, propeller_power=5.0, density=DENSITY).speed)
    drag = HYBRID["parasite_drag"] * DENSITY / HYBRID["reference_density"]
    wanted = brentq(lambda v: drag * v**2 - momentum_thrust(5.0, v), 0.1, 3.0, xtol=1e-14)
    assert speed == pytest.approx(wanted, rel=1e-9)


def test_flight_by_power_at_a_held_angle_of_attack_agrees_with_that_at_the_pitch() -> None:
    held = trim_at_pitch(HYBRID, -3.0, -0.4, propeller_power=5.0, density=DENSITY)
    other = steady_state(HYBRID, -3.0, held.angle_of_attack, propeller_power=5.0, density=DENSITY)
    assert float(other.speed) == pytest.approx(float(held.speed), rel=1e-8)
    assert float(other.pitch) == pytest.approx(-0.4, abs=1e-8)


def test_slopes_agree_with_differences() -> None:
    slopes = trim_sensitivities(HYBRID, -3.0, -0.4, propeller_power=5.0, density=DENSITY)

    def speed(vehicle: Vehicle = HYBRID, force: float = -3.0, pitch: float = -0.4, power: float = 5.0) -> float:
        return float(trim_at_pitch(vehicle, force, pitch, propeller_power=power, density=DENSITY).speed)

    drag = HYBRID["parasite_drag"]
    more, less = (speed(HYBRID.with_values({"parasite_drag": drag + step}, "moved")) for step in (1e-3, -1e-3))
    assert float(slopes["parasite_drag"][0]) == pytest.approx((more - less) / 2e-3, rel=1e-5)
    for name, step in (("net_buoyancy", 1e-3), ("pitch", 1e-4), ("propeller_power", 1e-3)):
        key = {"net_buoyancy": "force", "propeller_power": "power"}.get(name, name)
        at = {"force": -3.0, "pitch": -0.4, "power": 5.0}[key]
        change = speed(**{key: at + step}) - speed(**{key: at - step})
        assert float(slopes[name][0]) == pytest.approx(change / (2.0 * step), rel=1e-5)


def test_power_for_a_thrust_is_the_inverse_and_the_exponent_the_difference() -> None:
    assert HYBRID.disk is not None
    power, speed = np.array([0.5, 5.0, 50.0]), np.array([0.0, 0.4, 0.8])
    newton, _, exponent = thrust_by_power(HYBRID.disk, DENSITY, power, speed)
    np.testing.assert_allclose(newton, [momentum_thrust(p, v) for p, v in zip(power, speed, strict=True)], rtol=1e-9)
    np.testing.assert_allclose(power_for(HYBRID.disk, DENSITY, newton, speed), power, rtol=1e-10)
    assert exponent[0] == pytest.approx(2.0 / 3.0)
    more = [momentum_thrust(1.001 * p, v) for p, v in zip(power, speed, strict=True)]
    np.testing.assert_allclose(exponent, np.log(more / newton) / math.log(1.001), rtol=1e-3)
    wider = [momentum_thrust(p, v, diameter=0.22 * 1.001) for p, v in zip(power, speed, strict=True)]
    np.testing.assert_allclose(2.0 * (1.0 - exponent), np.log(wider / newton) / math.log(1.001), rtol=1e-2)


def test_thrust_by_power_is_as_uncertain_as_efficiency_and_diameter() -> None:
    at_rest, fast = relative_thrust_std(HYBRID, DENSITY, 0.0, 5.0, np.array([0.0, 50.0]))
    assert at_rest == pytest.approx(2.0 / 3.0 * math.hypot(0.3, 0.05 / 0.22))
    assert fast == pytest.approx(0.3, rel=1e-3)
    assert math.isnan(float(relative_thrust_std(HYBRID, DENSITY, 0.0, 0.0, 0.0)))


def test_thrust_by_speed_is_as_uncertain_as_both_of_its_coefficients_at_the_advance_ratio(petrel: Vehicle) -> None:
    # 780 and 1400 rpm at the speeds of Niu et al. (2017), Section 5; 1e5 draws of K_1 and K_2.
    n, speed = np.array([13.0, 1400.0 / 60.0]), np.array([0.62, 1.2])
    ratio = speed / (n * petrel["propeller_diameter"])
    white = np.random.default_rng(1).standard_normal((2, 100_000))
    for correlation in (0.0, -1.0, 0.5):
        tied = correlation * white[0] + math.sqrt(1.0 - correlation**2) * white[1]
        static = petrel["thrust_static"] + petrel.std("thrust_static") * white[0]
        slope = petrel["thrust_slope"] + petrel.std("thrust_slope") * tied
        drawn = static + slope * ratio[:, None]
        craft = replace(petrel, correlations={("thrust_static", "thrust_slope"): correlation})
        found = relative_thrust_std(craft, DENSITY, n, 0.0, speed)
        np.testing.assert_allclose(found, drawn.std(axis=1) / drawn.mean(axis=1), rtol=0.02)
    assert relative_thrust_std(petrel, DENSITY, 0.0, 0.0, 0.5) == pytest.approx(0.03 / 0.6136)
    beyond = relative_thrust_std(petrel, DENSITY, 1.0, 0.0, 0.5)  # braking: no share of nothing
    assert 1.0 < beyond < 100.0


def test_thrust_follows_from_speed_where_there_is_a_law_for_it_and_else_from_power(petrel: Vehicle) -> None:
    powered, nan = np.array([True, True, True, False]), math.nan
    logged = np.array([13.0, 13.0, nan, nan]), np.array([5.0, nan, 5.0, nan])
    for vehicle, speed, power in (
        (HYBRID, [0.0, nan, 0.0, 0.0], [5.0, nan, 5.0, 0.0]),
        (petrel, [13.0, 13.0, nan, 0.0], [0.0, 0.0, nan, 0.0]),
    ):
        found = driven(vehicle, powered, *logged)
        np.testing.assert_array_equal(found, [speed, power])


def test_blocks_under_power_are_predicted_with_the_1_sigma_of_their_thrust_or_say_why_not(petrel: Vehicle) -> None:
    row = {
        "block": 0, "powered": True, "used": True, "pitch": -0.4, "pitch_std": 0.0, "net_buoyancy": -3.0,
        "net_buoyancy_std": 0.0, "propeller_power": 5.0, "propeller_power_std": 0.0, "density": DENSITY,
        "battery_position": 0.0, "battery_position_std": 0.0,
    }  # fmt: skip
    blocks = conform(pd.DataFrame([row]), BLOCKS)
    exact = {
        name: item if name.startswith("prop") else Coefficient(item.value, 0.0, item.unit, item.source)
        for name, item in HYBRID.coefficients.items()
    }
    known = Vehicle("known", "", exact)
    held = predict(known, blocks).iloc[0]
    trim = trim_at_pitch(known, -3.0, -0.4, propeller_power=5.0, density=DENSITY)
    assert held["speed"] == pytest.approx(float(trim.speed))
    more, less = (
        float(trim_at_pitch(known.with_values({"propulsive_efficiency": 0.5 + step}, ""), -3.0, -0.4,
                            propeller_power=5.0, density=DENSITY).speed)
        for step in (1e-3, -1e-3)
    )  # fmt: skip
    wide, narrow = (
        float(trim_at_pitch(known.with_values({"propeller_diameter": 0.22 + step}, ""), -3.0, -0.4,
                            propeller_power=5.0, density=DENSITY).speed)
        for step in (1e-4, -1e-4)
    )  # fmt: skip
    wanted = math.hypot((more - less) / 2e-3 * 0.15, (wide - narrow) / 2e-4 * 0.05)
    assert held["speed_std"] == pytest.approx(wanted, rel=1e-3)
    assert predict(petrel, blocks).iloc[0]["reason"] == NO_THRUST_LAW


@pytest.fixture
def by_power(petrel: Vehicle) -> Vehicle:
    """Return Petrel-II with an efficiency and a great propeller, and without a law for its speed."""
    laws = ("thrust_static", "thrust_slope")
    bare = {name: item for name, item in petrel.coefficients.items() if name not in laws}
    bare["propulsive_efficiency"] = Coefficient(0.5, 0.1, "1", "a test")
    bare["propeller_diameter"] = Coefficient(0.22, 0.02, "m", "a test")
    return Vehicle("petrel-ii by power", "", bare)


@pytest.mark.parametrize(("force", "position", "power"), [(-5.0, 0.02, 3.0), (4.0, -0.02, 8.0), (3.0, -0.001, 30.0)])
def test_the_trim_in_moment_balance_by_power_is_that_at_its_pitch_and_its_moments_balance(
    by_power: Vehicle, force: float, position: float, power: float
) -> None:
    found = trim_at_moment(by_power, force, battery_position=position, propeller_power=power, density=DENSITY)
    pitch = float(found.pitch)
    assert float(found.thrust) == pytest.approx(momentum_thrust(power, float(found.speed)), rel=1e-9)
    held = trim_at_pitch(by_power, force, pitch, propeller_power=power, density=DENSITY)
    assert float(held.speed) == pytest.approx(float(found.speed), rel=1e-12)
    lean = -by_power["battery_mass"] * 9.81 * position * math.cos(pitch)
    assert lean + by_power["righting_moment"] * math.sin(pitch) == pytest.approx(
        float(found.required_moment), abs=1e-7 * abs(lean)
    )
    glide = trim_at_moment(by_power, force, battery_position=position, density=DENSITY)
    idle = trim_at_moment(by_power, force, battery_position=position, propeller_power=0.0, density=DENSITY)
    assert float(idle.pitch) == float(glide.pitch)
    assert abs(pitch - float(glide.pitch)) > 0.005


@pytest.mark.parametrize("power", [2.0, 30.0])
def test_modes_of_a_trim_by_power_are_those_with_the_power_held(by_power: Vehicle, power: float) -> None:
    trims = trims_at_moment(by_power, 4.0, battery_position=-0.02, propeller_power=power, density=DENSITY)
    k = int(np.flatnonzero(trims.stable)[0])
    state = equilibrium(
        by_power, 4.0, pitch=float(trims.steady.pitch[k]), propeller_power=power, density=DENSITY,
        moment_sin=by_power["righting_moment"],
    )  # fmt: skip
    wanted, found = modes(state).eigenvalues, trims.eigenvalues[k]
    np.testing.assert_allclose(np.sort(found.real), np.sort(wanted.real), rtol=1e-4)
    np.testing.assert_allclose(np.sort(abs(found.imag)), np.sort(abs(wanted.imag)), rtol=1e-4, atol=1e-9)
    constant = modes(
        equilibrium(
            by_power, 4.0, pitch=float(trims.steady.pitch[k]), thrust=float(trims.steady.thrust[k]), density=DENSITY,
            moment_sin=by_power["righting_moment"],
        )
    ).eigenvalues  # fmt: skip
    assert abs(found.real.max() / constant.real.max() - 1.0) > 1e-2  # thrust that falls with V damps


def test_a_block_by_power_has_a_battery_trim_with_the_1_sigma_of_power_and_efficiency(by_power: Vehicle) -> None:
    row = {
        "block": 0, "powered": True, "used": True, "pitch": 0.4, "pitch_std": 0.0, "net_buoyancy": 4.0,
        "net_buoyancy_std": 0.0, "propeller_power": 5.0, "propeller_power_std": 0.2, "density": DENSITY,
        "battery_position": -0.02, "battery_position_std": 0.0,
    }  # fmt: skip
    open_ = ("propulsive_efficiency", "propeller_diameter")
    exact = {
        name: item if name in open_ else Coefficient(item.value, 0.0, item.unit, item.source)
        for name, item in by_power.coefficients.items()
    }
    known = Vehicle("known", "", exact)
    found = predict(known, conform(pd.DataFrame([row]), BLOCKS)).iloc[1]
    assert (found["trim"], found["reason"]) == ("battery", "")

    def flown(power: float = 5.0, **changes: float) -> Steady:
        return trim_at_moment(
            known.with_values(changes, "moved"), 4.0, battery_position=-0.02, propeller_power=power, density=DENSITY
        )

    for name in ("speed", "pitch"):
        assert found[name] == pytest.approx(float(getattr(flown(), name)), rel=1e-12)
        parts = [
            0.2 * (getattr(flown(5.01), name) - getattr(flown(4.99), name)) / 0.02,
            0.1 * (getattr(flown(propulsive_efficiency=0.501), name)
                   - getattr(flown(propulsive_efficiency=0.499), name)) / 2e-3,
            0.02 * (getattr(flown(propeller_diameter=0.2201), name)
                    - getattr(flown(propeller_diameter=0.2199), name)) / 2e-4,
        ]  # fmt: skip
        assert found[f"{name}_std"] == pytest.approx(float(np.linalg.norm(parts)), rel=2e-3)


def test_a_battery_trim_by_power_without_a_law_for_it_says_so(petrel: Vehicle) -> None:
    found = trim_at_moment(petrel, 4.0, battery_position=-0.02, propeller_power=5.0)
    assert str(found.reason) == NO_THRUST_LAW
    assert math.isnan(float(found.speed))
    with pytest.raises(ValueError, match="propeller_power: found -5; expected 0 W or more"):
        trim_at_moment(petrel, 4.0, battery_position=-0.02, propeller_power=-5.0)


def test_both_a_thrust_and_a_power_or_a_negative_one_are_refused() -> None:
    with pytest.raises(ValueError, match="found both thrust and propeller_power; give one of them"):
        trim_at_pitch(HYBRID, -3.0, -0.4, thrust=1.0, propeller_power=5.0)
    with pytest.raises(ValueError, match="propeller_power: found -5; expected 0 W or more"):
        trim_at_pitch(HYBRID, -3.0, -0.4, propeller_power=-5.0)

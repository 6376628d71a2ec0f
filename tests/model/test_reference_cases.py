"""Every reference case of the equations that this room solves, within the tolerance of the cases' own header."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pipeline.model.dynamics import body_of, jacobian, trajectory
from pipeline.model.forces import GRAVITY, propeller_of
from pipeline.model.stability import stable_range
from pipeline.model.steady import steady_state, trim_at_moment, trim_at_pitch, trims_at_moment
from pipeline.model.trajectory import Inputs, simulate
from pipeline.vehicle import Vehicle

Cases = dict[str, Any]
Maker = Callable[[dict[str, Any]], Vehicle]
STEADY = {"rel": 1e-8, "abs": 1e-12}
BOUNDS = {"rel": 1e-7, "abs": 1e-12}


def check_steady(state: Any, expected: dict[str, Any]) -> None:
    assert bool(np.isfinite(state.speed)) == expected["exists"]
    assert (str(state.reason) == "") == expected["exists"]
    if not expected["exists"]:
        return
    pairs = {"V": state.speed, "gamma": state.path_angle, "theta": state.pitch, "T": state.thrust}
    for name, value in pairs.items():
        assert float(value) == pytest.approx(expected[name], **STEADY), name
    if "J0" in expected and expected["J0"] is not None:
        assert float(state.advance_ratio) == pytest.approx(expected["J0"], **STEADY)
    if "M_required" in expected:
        assert float(state.required_moment) == pytest.approx(expected["M_required"], **STEADY)


@pytest.mark.parametrize("signs", ["physical", "paper"])
def test_group_a_constant_thrust_at_a_held_angle_of_attack(cases: Cases, vehicle_of: Maker, signs: Any) -> None:
    for case in cases["a"]:
        inputs = case["inputs"]
        state = steady_state(vehicle_of(inputs), inputs["G"], inputs["alpha"], thrust=inputs["T"], signs=signs)
        check_steady(state, case[signs])


@pytest.mark.parametrize("signs", ["physical", "paper"])
def test_group_b_propeller_speed_at_a_held_angle_of_attack(cases: Cases, vehicle_of: Maker, signs: Any) -> None:
    for case in cases["b"]:
        inputs = case["inputs"]
        state = steady_state(
            vehicle_of(inputs), inputs["G"], inputs["alpha"], propeller_speed=inputs["n"] / 60.0, signs=signs
        )
        check_steady(state, case[signs])


def test_group_b_slowest_eigenvalue(cases: Cases, vehicle_of: Maker) -> None:
    for case in cases["b"]:
        inputs, expected = case["inputs"], case["physical"]
        vehicle = vehicle_of(inputs)
        trimmed = vehicle.with_values(
            {
                "mass_forward": vehicle["mass_normal"],
                "moment_at_zero": -vehicle["moment_slope"] * inputs["alpha"],
            },
            "trimmed at the case's angle of attack",
        )
        density = vehicle["reference_density"]
        matrix = jacobian(
            expected["V"],
            expected["gamma"],
            inputs["alpha"],
            0.0,
            body_of(trimmed),
            trimmed.polar,
            propeller_of(trimmed),
            1.0,
            density,
            inputs["G"],
            inputs["n"] / 60.0,
            0.0,
            0.0,
        )
        assert np.linalg.eigvals(matrix).real.max() == pytest.approx(expected["max_re_eig"], abs=1e-7)


def test_group_c_held_pitch(cases: Cases, vehicle_of: Maker) -> None:
    for case in cases["c_pitch"]:
        inputs, expected = case["inputs"], case["physical"]
        state = trim_at_pitch(vehicle_of(inputs), inputs["G"], inputs["theta"], propeller_speed=inputs["n"] / 60.0)
        check_steady(state, expected)
        assert float(state.angle_of_attack) == pytest.approx(expected["alpha"], **STEADY)


def test_group_c_moment_balance(cases: Cases, vehicle_of: Maker) -> None:
    for case in cases["c_moment"]:
        inputs = case["inputs"]
        vehicle = vehicle_of(inputs).with_values({"righting_moment": inputs["Ms"]}, "reference case")
        state = trim_at_moment(vehicle, inputs["G"], moment_cos=inputs["Mc"], propeller_speed=inputs["n"] / 60.0)
        assert float(state.pitch) == pytest.approx(case["design_theta"], **STEADY)
        expected = next(s for s in case["solutions"] if abs(s["theta"] - case["design_theta"]) < 1e-9)
        check_steady(state, expected)


def test_group_c_moment_balance_all_trims_and_their_stability(cases: Cases, vehicle_of: Maker) -> None:
    for case in cases["c_moment"]:
        inputs = case["inputs"]
        vehicle = vehicle_of(inputs).with_values({"righting_moment": inputs["Ms"]}, "reference case")
        trims = trims_at_moment(vehicle, inputs["G"], moment_cos=inputs["Mc"], propeller_speed=inputs["n"] / 60.0)
        for expected in case["solutions"]:
            k = int(np.nanargmin(np.abs(trims.steady.pitch - expected["theta"])))
            for name, symbol in {"pitch": "theta", "speed": "V", "required_moment": "M_required"}.items():
                assert float(getattr(trims.steady, name)[k]) == pytest.approx(expected[symbol], **STEADY), name
            assert bool(trims.stable[k]) == expected["stable"]


def test_group_d_trajectories(cases: Cases, vehicle_of: Maker) -> None:
    for case in cases["d"]:
        inputs = case["inputs"]
        flown = trajectory(
            vehicle_of(inputs),
            inputs["x0"],
            case["t"],
            net_buoyancy=inputs["G"],
            propeller_speed=inputs["n"] / 60.0,
            moment_cos=inputs["Mc"],
            moment_sin=inputs["Ms"],
        )
        np.testing.assert_allclose(flown, np.array(case["x"]), rtol=0.0, atol=1e-8)


def test_group_d_trajectories_by_the_compiled_integrator(cases: Cases, vehicle_of: Maker) -> None:
    for case in cases["d"]:
        inputs = case["inputs"]
        vehicle = vehicle_of(inputs).with_values({"righting_moment": inputs["Ms"]}, "reference case")
        position = -inputs["Mc"] / (vehicle["battery_mass"] * GRAVITY) + vehicle["battery_neutral_position"]
        schedule = Inputs(0.0, inputs["G"], position, inputs["n"] / 60.0)
        flight = simulate(vehicle, inputs["x0"], schedule, case["t"], step=2e-3)
        flown = np.column_stack([flight.speed, flight.path_angle, flight.angle_of_attack, flight.pitch_rate])
        np.testing.assert_allclose(flown, np.array(case["x"]), rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("signs", ["physical", "paper"])
def test_group_e_inequalities(cases: Cases, vehicle_of: Maker, signs: Any) -> None:
    for case in cases["e"]:
        inputs, expected = case["inputs"], case[signs]
        found = stable_range(vehicle_of(inputs), inputs["G"], inputs["alpha"], inputs["T"], signs=signs)
        assert float(found.thrust_bound) == pytest.approx(expected["T_bound_inf"], **BOUNDS)
        assert float(found.bound_angle) == pytest.approx(expected["alpha_at_bound"], abs=1e-7)
        assert float(found.speed_lower) == pytest.approx(expected["V_lower"], **BOUNDS)
        assert float(found.discriminant) == pytest.approx(expected["c24_disc"], **BOUNDS)
        for name, value in {"V": found.speed, "KDp": found.drag_margin, "V_max": found.speed_upper}.items():
            if name in expected:
                assert float(value) == pytest.approx(expected[name], **BOUNDS), name
        verdicts = {
            "c23": found.drag_holds,
            "c24": found.discriminant_holds,
            "c25": found.root_holds,
            "c27": found.speed_holds,
            "c28": found.thrust_holds,
        }
        for name, verdict in verdicts.items():
            assert bool(verdict) == expected.get(name, False), name
        assert bool(found.stable) == all(expected.get(name, False) for name in verdicts)

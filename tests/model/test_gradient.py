"""Derivatives of the three trims by the implicit function theorem, against central differences of the trims."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from pipeline.model.gradient import (
    Gradient,
    gradients_of_steady_state,
    gradients_of_trim_at_moment,
    gradients_of_trim_at_pitch,
)
from pipeline.model.steady import Steady, steady_state, trim_at_moment, trim_at_pitch
from pipeline.vehicle import load

PETREL = load("petrel-ii").with_values(
    {"lift_at_zero": 0.4, "mass_normal": 95.0, "drag_exponent": -0.2, "righting_moment": -6.0}, "all coefficients"
)
LAW = ("thrust_static", "thrust_slope")

CASES: dict[str, tuple[Callable[..., dict[str, Gradient]], Callable[..., Steady], dict[str, Any]]] = {
    "glide at alpha": (gradients_of_steady_state, steady_state, {"net_buoyancy": 5.0, "angle_of_attack": -0.03}),
    "powered at alpha, printed signs": (
        gradients_of_steady_state,
        steady_state,
        {"net_buoyancy": 5.0, "angle_of_attack": -0.01, "propeller_speed": 14.0, "density": 1027.0, "signs": "paper"},
    ),
    "thrust at alpha": (
        gradients_of_steady_state,
        steady_state,
        {"net_buoyancy": -5.0, "angle_of_attack": 0.02, "thrust": 2.0},
    ),
    "glide at pitch": (gradients_of_trim_at_pitch, trim_at_pitch, {"net_buoyancy": -4.0, "pitch": -0.5}),
    "thrust at pitch": (
        gradients_of_trim_at_pitch,
        trim_at_pitch,
        {"net_buoyancy": 4.0, "pitch": 0.3, "thrust": 3.0, "density": 1030.0},
    ),
    "powered at pitch": (
        gradients_of_trim_at_pitch,
        trim_at_pitch,
        {"net_buoyancy": 2.5, "pitch": 0.06, "propeller_speed": 13.0},
    ),
    "glide at battery position": (
        gradients_of_trim_at_moment,
        trim_at_moment,
        {"net_buoyancy": -5.0, "battery_position": 0.02, "density": 1027.0},
    ),
    "powered at moment": (
        gradients_of_trim_at_moment,
        trim_at_moment,
        {"net_buoyancy": 4.0, "moment_cos": 2.0, "propeller_speed": 15.0},
    ),
}


def numbers(state: Steady) -> np.ndarray:
    assert str(state.reason) == ""
    return np.array([float(getattr(state, name)) for name in Gradient._fields])


def difference(flight: Callable[..., Steady], inputs: dict[str, Any], name: str) -> np.ndarray:
    """Return the derivative with respect to a coefficient or input by central differences of fourth order."""

    def at(step: float) -> np.ndarray:
        if name in inputs:
            return numbers(flight(PETREL, **inputs | {name: inputs[name] + step}))
        names = LAW if name == "thrust_scale" else (name,)
        moved = {key: PETREL[key] + step * (PETREL[key] if name == "thrust_scale" else 1.0) for key in names}
        return numbers(flight(PETREL.with_values(moved, "moved"), **inputs))

    value = 1.0 if name == "thrust_scale" else inputs.get(name) or PETREL[name]
    h = 2e-4 * max(abs(value), 0.05)
    result: np.ndarray = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h)
    return result


@pytest.mark.parametrize("name", CASES)
def test_derivatives_are_those_of_central_differences(name: str) -> None:
    gradients, flight, inputs = CASES[name]
    found = gradients(PETREL, **inputs)
    for parameter, gradient in found.items():
        if parameter == "propeller_speed" and parameter not in inputs:
            continue  # a propeller at rest gives no thrust; one that only just turns brakes
        expected = difference(flight, inputs, parameter)
        got = np.array([float(value) for value in gradient])
        np.testing.assert_allclose(got, expected, rtol=3e-7, atol=3e-9, err_msg=parameter)


@pytest.mark.parametrize("name", CASES)
def test_every_input_and_every_coefficient_that_matters_is_told_of(name: str) -> None:
    gradients, flight, inputs = CASES[name]
    found = gradients(PETREL, **inputs)
    assert {key for key in inputs if key != "signs"} <= set(found)
    for coefficient in PETREL.coefficients:
        if coefficient not in found:
            moved = PETREL.with_values({coefficient: 1.01 * PETREL[coefficient]}, "moved")
            np.testing.assert_array_equal(numbers(flight(moved, **inputs)), numbers(flight(PETREL, **inputs)))


def test_derivatives_broadcast_and_are_nan_where_there_is_no_trim() -> None:
    found = gradients_of_trim_at_pitch(PETREL, [[4.0, -4.0]], [[0.5], [0.6]])
    for gradient in found.values():
        for name in ("speed", "path_angle", "pitch", "thrust", "required_moment"):
            values = getattr(gradient, name)
            assert values.shape == (2, 2)
            np.testing.assert_array_equal(np.isnan(values), [[False, True], [False, True]])


def test_unknown_moments_leave_the_other_derivatives() -> None:
    found = gradients_of_trim_at_pitch(load("seaglider"), 2.0, 0.4)["parasite_drag"]
    assert found.speed < 0.0
    assert math.isnan(found.required_moment)

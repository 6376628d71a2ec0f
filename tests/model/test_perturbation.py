"""Time scales and interconnection constants: the reference cases, the paper's numbers, and that the bounds bound."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.model.perturbation import Bounds, Interconnection, interconnection
from pipeline.model.steady import steady_state
from pipeline.vehicle import Vehicle, load

PETREL = load("petrel-ii")
ALPHA_E = -0.7959 / 313.8643
SYMBOLS = {
    "tau": "time_scale",
    "eps1": "epsilon_alpha",
    "eps2": "epsilon_pitch",
    "mu": "mu",
    "r1": "ratio_alpha",
    "r2": "ratio_pitch",
    "a1": "slow_decay",
    "a2": "fast_decay",
    "beta1": "beta_slow",
    "beta2": "beta_fast",
    "gamma2p": "gamma_alpha",
    "gamma2pp": "gamma_change",
    "d_star": "weight",
    "mu_d": "mu_limit",
}


@pytest.mark.parametrize("signs", ["physical", "paper"])
def test_group_f_constants(cases: dict[str, Any], vehicle_of: Callable[[dict[str, Any]], Vehicle], signs: Any) -> None:
    assert len(cases["f"]) == 8
    for case in cases["f"]:
        inputs = case["inputs"]
        found = interconnection(vehicle_of(inputs), inputs["G"], inputs["alpha"], inputs["T"], signs=signs)
        for symbol, name in SYMBOLS.items():
            assert getattr(found, name) == pytest.approx(case[signs][symbol], rel=1e-8), symbol
        assert found.gamma_alpha + found.gamma_change == pytest.approx(case[signs]["gamma2"], rel=1e-8)
        assert found.holds == (case[signs]["mu"] < case[signs]["mu_d"])


def test_numbers_of_the_paper() -> None:
    found = interconnection(PETREL, 7.0, ALPHA_E, 7.0, signs="paper")
    assert found.epsilon_alpha == pytest.approx(1.3079e-3, abs=5e-8)
    assert found.epsilon_pitch == pytest.approx(5.495e-2, abs=5e-6)
    lighter = interconnection(
        PETREL.with_values({"pitch_inertia": 0.300}, "fits the printed ε_2"), 7.0, ALPHA_E, 7.0, signs="paper"
    )
    assert lighter.epsilon_pitch == pytest.approx(1.340e-3, abs=5e-7)


@pytest.mark.parametrize("inertia", [0.3, 12.3])
@pytest.mark.parametrize("thrust", [2.0, 7.0])
def test_the_printed_constants_prove_nothing_for_the_driven_vehicle(inertia: float, thrust: float) -> None:
    found = interconnection(PETREL.with_values({"pitch_inertia": inertia}, "test"), 7.0, ALPHA_E, thrust)
    assert not found.holds
    assert found.reason.startswith("mu = ")


def test_the_corrected_bounds_prove_stability_with_the_inertia_behind_the_printed_epsilon() -> None:
    # With J_2 = 0.300, from which the printed ε_2 and μ follow, μ = 1.340e-3 is below μ_d = 1.549e-3.
    light = PETREL.with_values({"pitch_inertia": 0.300}, "fits the printed ε_2")
    found = interconnection(light, 7.0, ALPHA_E, 7.0, formulas="corrected")
    assert found.holds
    assert found.mu == pytest.approx(1.3398e-3, abs=5e-7)
    assert found.mu_limit == pytest.approx(1.5487e-3, abs=5e-7)
    assert not interconnection(PETREL, 7.0, ALPHA_E, 7.0, formulas="corrected").holds


def test_weight_is_where_the_limit_is_largest() -> None:
    found = interconnection(PETREL, 7.0, ALPHA_E, 7.0)
    assert found.limit_at(found.weight) == pytest.approx(found.mu_limit, rel=1e-12)
    around = [found.limit_at(found.weight + step) for step in (-1e-3, 1e-3)]
    assert max(around) < found.mu_limit


def excess(vehicle: Vehicle, found: Interconnection, thrust: float, y: np.ndarray) -> float:
    """Return v' less its bound at `y`, written out from Eqs. (9)-(12), (17)-(20) and (32) with T = u V²."""
    state = steady_state(vehicle, 7.0, ALPHA_E, thrust=thrust)
    speed, gamma_e = float(state.speed), float(state.path_angle)
    u = thrust / speed**2
    drag_k = 7.3579 + 318.0849 * ALPHA_E**2 - u * math.cos(ALPHA_E)
    v, g, a, q = y
    x, alpha = 1.0 + v, ALPHA_E + a
    pull = 7.0 / speed**2
    f1 = (pull * math.sin(gamma_e + g) - (7.3579 + 318.0849 * alpha**2 - u * math.cos(alpha)) * x * x) / drag_k
    f2 = (pull * math.cos(gamma_e + g) + (351.357 * alpha + u * math.sin(alpha)) * x * x) / (drag_k * x)
    a_rate = q / found.epsilon_alpha - f2
    q_rate = -(a + q) * x * x / found.epsilon_pitch
    d, r1, r2 = found.weight, found.ratio_alpha, found.ratio_pitch
    c1, c2 = 1.0 + 2.0 * r2 * x * x / r1, 1.0 + r1 / (r2 * x * x)
    slow = (x * x - math.cos(g)) * f1 + x * math.sin(g) * f2
    change = 2.0 * r2 / r1 * x * a * a - r1 / r2 * q * q / x**3
    fast = (c1 * a + q) * a_rate + (c2 * q + a) * q_rate + change * f1
    psi = math.sqrt((v + 2.0) ** 2 * v * v + 4.0 * x * x * math.sin(0.5 * g) ** 2)
    phi = x * math.hypot(a, q)
    crossed = (1.0 - d) * found.beta_slow + d * found.beta_fast
    inner = found.fast_decay / found.mu - found.gamma_alpha - found.gamma_change
    bound = -(1.0 - d) * psi**2 + crossed * psi * phi - d * inner * phi**2
    return (1.0 - d) * slow + d * fast - bound


@pytest.mark.parametrize(("inertia", "thrust"), [(12.3, 7.0), (0.3, 7.0), (12.3, 0.0), (4.0, 3.0)])
def test_corrected_constants_bound_the_derivative_of_the_composite_function(inertia: float, thrust: float) -> None:
    vehicle = PETREL.with_values({"pitch_inertia": inertia}, "test")
    found = interconnection(vehicle, 7.0, ALPHA_E, thrust, formulas="corrected")
    draws = np.random.default_rng(1)
    for y in draws.uniform(-1.0, 1.0, (4000, 4)) * Bounds():
        assert excess(vehicle, found, thrust, y) <= 1e-12


@given(
    g=st.floats(0.5, 10.0), thrust=st.floats(0.0, 0.9), alpha=st.floats(-0.05, 0.05), density=st.floats(990.0, 1050.0)
)
def test_dives_have_the_constants_of_their_mirrored_climbs(
    g: float, thrust: float, alpha: float, density: float
) -> None:
    for formulas in ("printed", "corrected"):
        up, down = (
            interconnection(PETREL, side * g, side * alpha, thrust * g, density=density, formulas=formulas)  # type: ignore[arg-type]
            for side in (1.0, -1.0)
        )
        assert up.holds == down.holds
        for name in SYMBOLS.values():
            assert getattr(up, name) == pytest.approx(getattr(down, name), rel=1e-9, nan_ok=True), name


def test_what_cannot_be_had_is_nan_with_a_reason() -> None:
    for vehicle, thrust, reason in (
        (load("slocum-g2"), 0.0, "the vehicle file leaves pitch_inertia"),
        (PETREL, 60.0, "no equilibrium"),
        (PETREL.with_values({"drag_exponent": -0.5}, "test"), 0.0, "the proof does not know"),
    ):
        found = interconnection(vehicle, 7.0, 0.1, thrust)
        assert math.isnan(found.mu_limit)
        assert not found.holds
        assert reason in found.reason


def test_corrected_formulas_in_the_paper_s_signs_are_refused() -> None:
    with pytest.raises(ValueError, match="corrected formulas are physical"):
        interconnection(PETREL, 7.0, ALPHA_E, 7.0, signs="paper", formulas="corrected")
    with pytest.raises(ValueError, match="found 'right'; expected 'printed' or 'corrected'"):
        interconnection(PETREL, 7.0, ALPHA_E, 7.0, formulas="right")  # type: ignore[arg-type]

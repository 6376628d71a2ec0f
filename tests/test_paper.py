"""The paper computed again: its numbers, the verdicts on them, the page, and the algebra behind the errata."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from typer.testing import CliRunner

from pipeline import paper
from pipeline.cli import app
from pipeline.model.dynamics import Body, derivatives
from pipeline.paper.claim import Claim, Reading, meets
from pipeline.paper.errata import ERRATA
from pipeline.paper.figures import flights
from pipeline.paper.trials import DANJIANGKOU, SOUTH_CHINA_SEA, held_speed
from pipeline.vehicle import Polar, Propeller, Vehicle, load

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return load("petrel-ii")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("paper") / "deep" / "out"
    result = CliRunner().invoke(app, ["paper", str(out), "--json"])
    assert result.exit_code == 0
    assert json.loads(result.stdout) == json.loads((out / paper.NUMBERS).read_text(encoding="utf-8"))
    return out


@pytest.fixture(scope="module")
def content(written: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((written / "paper.json").read_text(encoding="utf-8"))
    return found


def row(content: dict[str, Any], where: str, quantity: str) -> dict[str, Any]:
    found = [item for item in content["numbers"] if item["where"] == where and item["quantity"] == quantity]
    assert len(found) == 1, f"{where}: {quantity}"
    return found[0]


#: Where, quantity, computed in the signs of the paper by independent software, tolerance, verdict.
EXPECTED = [
    ("Section 4", "V_e, (21)", 1.36941, 5e-6, "reproduced"),
    ("Section 4", "K'_De, (26)", 3.62719, 5e-6, "reproduced"),
    ("Section 4", "lower bound of V, (27)", 0.97538, 5e-6, "reproduced"),
    ("Section 5, South China Sea", "lower bound of V, (27)", 0.98249, 5e-6, "reproduced"),
    ("Section 5, Danjiangkou", "lower bound of V, (27)", 0.55300, 5e-6, "reproduced"),
    ("Section 4", "bound of T_e, (28)", 7.57235, 5e-6, "reproduced"),
    ("Section 4", "V_max, at that bound", 1.39672, 5e-6, "reproduced"),
    ("Section 5, South China Sea", "upper bound of V, (28)", 1.39672, 5e-6, "reproduced"),
    ("Section 5, Danjiangkou", "upper bound of V, (28)", 0.83470, 5e-6, "reproduced"),
    ("Section 5, South China Sea", "V_e", 1.37434, 5e-6, "reproduced"),
    ("Section 5, Danjiangkou", "V_e", 0.79795, 5e-6, "reproduced"),
    ("Section 4", "propeller speed for T_e = 7 N", 1391.30, 5e-3, "reproduced"),
    ("Section 5, South China Sea", "θ_e", 76.096, 5e-4, "misprint"),
    ("Section 5, Danjiangkou", "θ_e", 76.873, 5e-4, "misprint"),
    ("Section 4", "γ_e, (22)", 1.33239, 5e-6, "misprint"),
    ("Section 4", "ε_1", 1.3079e-3, 5e-8, "reproduced"),
    ("Section 4", "ε_2", 5.495e-2, 5e-6, "misprint"),
    ("Section 4", "μ = max(ε_1, ε_2)", 5.495e-2, 5e-6, "misprint"),
    ("Section 4", "lower bound of V, |V̄| ≤ 0.2", 1.0955, 5e-5, "reproduced"),
    ("Section 4", "upper bound of V, |V̄| ≤ 0.2", 1.6433, 5e-5, "reproduced"),
    ("Section 5, South China Sea", "lower bound of V, |V̄| ≤ 0.2", 1.0994, 1e-4, "reproduced"),
    ("Section 5, South China Sea", "upper bound of V, |V̄| ≤ 0.2", 1.6492, 1e-4, "reproduced"),
    ("Section 5, Danjiangkou", "lower bound of V, |V̄| ≤ 0.2", 0.63836, 5e-6, "misprint"),
    ("Section 5, Danjiangkou", "upper bound of V, |V̄| ≤ 0.2", 0.95753, 1e-5, "misprint"),
    ("Section 5, South China Sea", "lower bound of the pitch, |γ̄| ≤ 0.1", 70.366, 1e-3, "misprint"),
    ("Fig. 4", "angle of attack at the greatest horizontal speed, gliding", -1.66, 5e-3, "reproduced"),
    ("Fig. 5", "path angle at the greatest horizontal speed, gliding", 36.8, 5e-2, "reproduced"),
    ("Fig. 6", "angle of attack at the greatest horizontal speed, hybrid", -0.86, 5e-3, "reproduced"),
    ("Fig. 7", "path angle at the greatest horizontal speed, hybrid", 19.9, 5e-2, "reproduced"),
    ("(15)", "K_1, fit of Table 2", 0.6076, 5e-5, "misprint"),
    ("(15)", "K_2, fit of Table 2", -0.4029, 5e-5, "misprint"),
    ("Section 4", "K_M", -313.8643, 1e-9, "misprint"),
    ("Section 4", "K_M0", -0.7959, 1e-9, "misprint"),
    ("Section 4", "d", 0.79253, 5e-6, "not reproducible"),
    ("Section 4", "μ_d", 3.4744e-4, 5e-9, "not reproducible"),
]


@pytest.mark.parametrize(("where", "quantity", "computed", "tolerance", "verdict"), EXPECTED)
def test_numbers_of_the_paper_are_those_of_independent_software(
    content: dict[str, Any], where: str, quantity: str, computed: float, tolerance: float, verdict: str
) -> None:
    found = row(content, where, quantity)
    assert found["computed_paper_signs"] == pytest.approx(computed, abs=tolerance)
    assert found["verdict"] == verdict
    assert found["relative_difference"] == pytest.approx(found["computed_paper_signs"] / found["printed"] - 1.0)
    if verdict != "reproduced":
        assert found["because"]


def test_nearest_reading_of_what_cannot_be_reproduced_is_told(content: dict[str, Any]) -> None:
    weight, limit = (row(content, "Section 4", name)["readings"][-1] for name in ("d", "μ_d"))
    assert weight["value"] == pytest.approx(0.929, abs=5e-4)
    assert limit["value"] == pytest.approx(1.11e-3, abs=5e-6)


def test_angles_of_the_range_of_path_angles_come_from_an_eighth_of_a_turn(content: dict[str, Any]) -> None:
    reading = row(content, "Section 5, South China Sea", "lower bound of the pitch, |γ̄| ≤ 0.1")["readings"][0]
    assert reading["value"] == pytest.approx(31.28, abs=5e-3)


def test_physical_signs_change_the_bound_on_thrust_but_hardly_the_speed(content: dict[str, Any]) -> None:
    assert row(content, "Section 4", "V_e, (21)")["computed_physical_signs"] == pytest.approx(1.3689897, abs=1e-7)
    bound = row(content, "Section 4", "bound of T_e, (28)")["computed_physical_signs"]
    assert bound == pytest.approx(7.0215401, abs=1e-7)


def test_powered_trials_with_the_pitch_held(content: dict[str, Any]) -> None:
    lake, sea = content["trials"]
    assert lake["held_pitch_speed_m_s"] == pytest.approx(0.615, abs=5e-4)
    assert lake["held_pitch_at_published_rpm_m_s"] == pytest.approx(0.630, abs=5e-4)
    assert lake["free_pitch_speed_m_s"] == pytest.approx(0.789, abs=5e-4)
    assert sea["held_pitch_speed_m_s"] == pytest.approx(1.294, abs=5e-4)
    assert sea["held_pitch_path_angle_deg"] == pytest.approx(43.98, abs=5e-3)
    assert sea["held_pitch_angle_of_attack_deg"] == pytest.approx(-0.48, abs=5e-3)
    assert sea["gap_closed_percent"] == pytest.approx(46.0, abs=0.5)
    assert lake["gap_closed_percent"] > 100.0
    assert lake["required_moment_N_m"] == pytest.approx(-1.88, abs=5e-3)
    assert sea["required_moment_N_m"] == pytest.approx(-3.11, abs=5e-3)


def test_what_is_left_of_the_second_trial(content: dict[str, Any], vehicle: Vehicle) -> None:
    left = content["remainder"]
    assert left["extra_parasite_drag_kg_m"] == pytest.approx(1.53, abs=5e-3)
    assert left["extra_parasite_drag_percent"] == pytest.approx(21.0, abs=0.5)
    assert left["thrust_scale"] == pytest.approx(0.724, abs=5e-4)
    assert left["propeller_speed_rpm"] == pytest.approx(1249.0, abs=0.5)
    assert left["net_buoyancy_N"] == pytest.approx(3.8, abs=0.05)
    assert left["first_trial_with_that_drag_m_s"] == pytest.approx(0.572, abs=5e-4)
    assert left["both_correlation"] == pytest.approx(0.995, abs=5e-4)
    for trial in (DANJIANGKOU, SOUTH_CHINA_SEA):
        both = held_speed(
            vehicle,
            trial,
            extra_drag=left["both_extra_parasite_drag_kg_m"],
            thrust_scale=left["both_thrust_scale"],
        )
        assert both == pytest.approx(trial.speed, rel=1e-8)


def test_what_follows_from_the_paper(content: dict[str, Any]) -> None:
    values = [item["value"] for item in content["derived"]]
    expected = [3.31, 0.0, 0.0800, 0.0800, 0.0798, -0.054, -0.236, -3.406, 6.485, -0.111, -0.236, -0.295]
    assert values == pytest.approx(expected, abs=5e-3)
    assert values[2:5] == pytest.approx([0.0800, 0.0800, 0.0798], abs=5e-5)
    assert values[5:] == pytest.approx(expected[5:], abs=5e-4)


def test_targets_of_both_powered_trials_have_their_rows(content: dict[str, Any]) -> None:
    rows = {(row["where"], row["quantity"]): row["printed"] for row in content["numbers"]}
    for trial, depth, pitch in (("Danjiangkou", 10.0, 0.0), ("South China Sea", 500.0, 45.0)):
        assert rows[f"Section 5, {trial}", "target depth"] == depth
        assert rows[f"Section 5, {trial}", "target pitch"] == pitch


def test_certificate_does_not_hold_for_the_vehicle(content: dict[str, Any]) -> None:
    real = [item for item in content["certificate"] if item["pitch_inertia_kg_m2"] == 12.3]
    assert [item["holds"] for item in real] == [False] * 4
    limits = [item["corrected_32_holds_below_inertia_kg_m2"] for item in content["regions"]]
    assert limits == pytest.approx([8.1, 11.4], abs=0.05)
    assert not any(item["printed_32_holds"] or item["corrected_32_holds"] for item in content["regions"])
    assert all(item["quadratic_holds"] for item in content["regions"])
    plain = [item["diagonal_semi_axes"] for item in content["regions"]]
    known = [[0.242, 0.165, 0.269], [0.320, 0.153, 0.156]]  # independent, its Q not known
    np.testing.assert_allclose(plain, known, rtol=0.02)
    assert content["ordering"].endswith("do not reproduce it in V̄.")


def test_page_is_self_contained_and_shows_every_number_and_figure(written: Path, content: dict[str, Any]) -> None:
    page = (written / "paper.html").read_text(encoding="utf-8")
    for number in range(4, 11):
        assert f'id="figure-fig{number}"' in page
    table = page[page.index('id="claims"') : page.index('id="certificate"')]
    assert table.count("<tr>") == len(content["numbers"]) + 1
    assert not re.search(r"(src|href)=\"(?!#|data:)", page)
    assert not re.search(r"url\((?!#)", page)
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL).lower().replace("nann", "")


def test_tables_of_the_paper_are_on_the_page(content: dict[str, Any]) -> None:
    assert [item["printed"] for item in content["table_2"]] == [0.45, 0.36, 0.13, 0.04]
    assert content["table_2"][0]["line_15"] == pytest.approx(0.6136 - 0.4091 * 0.4)
    assert len(content["table_1"]) == 7


def test_command_says_where_the_page_is_and_how_many_numbers_it_judged(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(paper, "write", lambda out: {"verdicts": {"reproduced": 2, "misprint": 1}})
    result = CliRunner().invoke(app, ["paper", str(tmp_path)])
    assert result.stdout == f"{tmp_path / 'paper.html'}: 2 reproduced, 1 misprint\n"


def test_curves_of_diving_flight_mirror_those_of_climbing_flight(vehicle: Vehicle) -> None:
    for thrust in (0.0, 7.0):
        angle, state = flights(vehicle, 7.0, thrust, "physical")
        assert angle[::-1] == pytest.approx(-angle, nan_ok=True)
        assert state.speed[::-1] == pytest.approx(state.speed, rel=1e-9, nan_ok=True)
        assert state.path_angle[::-1] == pytest.approx(-state.path_angle, rel=1e-9, nan_ok=True)
        assert np.isnan(angle).sum() == 1


def claim(printed: str, computed: float, **more: Any) -> Claim:
    return Claim("here", "x", "1", printed, computed, computed, **more)


def test_verdict_follows_from_the_numbers_alone() -> None:
    assert claim("1.3694", 1.36941).verdict == "reproduced"
    assert claim("1.3694", 1.37).verdict == "not reproducible"
    assert claim("7.5732", 7.57235).verdict == "reproduced"
    tried = (Reading("squares", 3.0), Reading("no squares", 1.3694))
    assert claim("1.3694", 2.0, readings=tried).verdict == "misprint"
    assert claim("1.3694", 2.0, readings=tried).because == "because no squares gives 1.3694"
    assert claim("1.3694", 2.0, readings=tried[:1]).because == "tried squares: 3"
    assert claim("-1.8", -1.66, span=(-1.98, -1.4)).verdict == "reproduced"
    assert claim("-1.8", -1.66, span=(-1.7, -1.4)).verdict == "not reproducible"
    assert claim("12.3", 12.3, kind="input").verdict == "used as printed"
    assert claim("0.62", 0.8, kind="measured").verdict == "set or measured"


def test_slip_of_one_digit_must_be_one_digit_and_meet_what_is_computed() -> None:
    assert claim("1.339", 1.33239, slip="1.333").verdict == "misprint"
    assert claim("1.339", 1.33239, slip="1.332").verdict == "misprint"
    assert claim("1.339", 1.33239, slip="1.322").verdict == "not reproducible"
    assert claim("1.339", 1.45, slip="1.333").verdict == "not reproducible"


@given(value=st.floats(0.01, 1e4), digits=st.integers(0, 6))
def test_rounded_number_is_met_by_what_was_rounded(value: float, digits: int) -> None:
    printed = f"{value:.{digits}f}"
    assert meets(printed, value)
    assert not meets(printed, float(printed) + max(2.0 * 10.0**-digits, 3e-4 * float(printed)))


def test_relative_difference_from_a_printed_zero_is_unknown() -> None:
    assert math.isnan(claim("0", 0.3).relative_difference)


def test_every_erratum_has_its_derivation_in_the_manual() -> None:
    manual = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (.*)$", manual, flags=re.MULTILINE)
    for erratum in ERRATA:
        assert any(erratum.where in heading for heading in headings), erratum.where


# The algebra of docs/errata.md, by numbers drawn at random.

STATE = {
    "speed": st.floats(0.2, 2.0),
    "gamma": st.floats(-1.4, 1.4),
    "alpha": st.floats(-0.3, 0.3),
    "q": st.floats(-0.3, 0.3),
    "force": st.floats(-10.0, 10.0),
    "thrust": st.floats(0.0, 10.0),
}
POLAR = Polar(0.5, 351.357, 7.3579, 318.0849, 0.0)


def forces(speed: float, alpha: float) -> tuple[float, float]:
    """Return lift and drag of `POLAR`, N."""
    lift = (POLAR.lift_at_zero + POLAR.lift_slope * alpha) * speed**2
    return lift, (POLAR.parasite_drag + POLAR.induced_drag * alpha**2) * speed**2


@given(**STATE)
def test_erratum_1_and_2_the_equations_in_v_and_gamma_are_kirchhoffs(
    speed: float, gamma: float, alpha: float, q: float, force: float, thrust: float
) -> None:
    m1, m3 = 84.7, 120.0
    lift, drag = forces(speed, alpha)
    # The plain form: Newton's law along and across the body, in Cartesian components of the velocity.
    u, w, pitch = speed * math.cos(alpha), speed * math.sin(alpha), gamma + alpha
    along = np.array([math.cos(gamma), math.sin(gamma)])
    across = np.array([-math.sin(gamma), math.cos(gamma)])
    nose = np.array([math.cos(pitch), math.sin(pitch)])
    belly = np.array([math.sin(pitch), -math.cos(pitch)])
    total = thrust * nose - drag * along + lift * across + force * np.array([0.0, 1.0])
    u_rate = (float(total @ nose) - m3 * w * q) / m1
    w_rate = (float(total @ belly) + m1 * u * q) / m3
    speed_rate = u_rate * math.cos(alpha) + w_rate * math.sin(alpha)
    alpha_rate = (w_rate * math.cos(alpha) - u_rate * math.sin(alpha)) / speed
    # The form of docs/errata.md.
    ca, sa, dm = math.cos(alpha), math.sin(alpha), m3 - m1
    bracket = -force * math.sin(pitch) - lift * sa + drag * ca - thrust
    v_form = (force * math.sin(gamma) - drag + thrust * ca) / m3 - dm * ca / (m1 * m3) * (
        bracket + (m1 + m3) * speed * q * sa
    )
    gamma_form = (force * math.cos(gamma) + lift + thrust * sa) / (m3 * speed) - dm / (m1 * m3 * speed) * (
        bracket * sa + (m3 * sa**2 - m1 * ca**2) * speed * q
    )
    assert v_form == pytest.approx(speed_rate, rel=1e-9, abs=1e-12)
    assert gamma_form == pytest.approx(q - alpha_rate, rel=1e-9, abs=1e-12)
    body = Body(m1, m3, 12.3, -0.7959, -313.8643, -7.0)
    model = derivatives(
        speed, gamma, alpha, q, body, POLAR, Propeller(thrust, 0.0, 1.0), 1.0, 1.0, force, 1.0, 0.0, 0.0
    )
    assert model[0] == pytest.approx(v_form, rel=1e-9, abs=1e-12)
    assert model[1] == pytest.approx(gamma_form, rel=1e-9, abs=1e-12)


def test_erratum_munk_moment_by_energy() -> None:
    """Kinetic energy (m1 u² + m3 w² + J2 q²)/2 is kept without forces only if the moment is (m3 - m1) u w."""
    m1, m3, inertia = 84.7, 120.0, 12.3

    def energy_change(sign: float) -> float:
        def rate(_: float, x: np.ndarray) -> list[float]:
            u, w, q = x
            return [-m3 * w * q / m1, m1 * u * q / m3, sign * (m3 - m1) * u * w / inertia]

        end = solve_ivp(rate, (0.0, 3.0), [1.0, 0.1, 0.05], rtol=1e-11, atol=1e-12).y[:, -1]
        energy = np.array([m1, m3, inertia]) / 2.0
        return float(energy @ end**2 - energy @ np.array([1.0, 0.1, 0.05]) ** 2)

    assert abs(energy_change(1.0)) < 1e-7
    assert abs(energy_change(-1.0)) > 1e-2


@given(
    alpha=st.floats(-0.3, 0.3),
    force=st.floats(0.5, 20.0),
    share=st.floats(0.0, 0.99),
)
def test_erratum_21_steady_flight_satisfies_the_quadratic_with_minus_b(
    alpha: float, force: float, share: float
) -> None:
    thrust = share * force
    lift, drag = forces(1.0, alpha)
    a = drag**2 + lift**2
    b = -2.0 * thrust * (drag * math.cos(alpha) - lift * math.sin(alpha))
    c = thrust**2 - force**2
    square = (-b + math.sqrt(b**2 - 4.0 * a * c)) / (2.0 * a)
    u = thrust / square
    along = (drag - u * math.cos(alpha)) * square
    across = (lift + u * math.sin(alpha)) * square
    assert math.hypot(along, across) == pytest.approx(force, rel=1e-9)


def test_erratum_32_boundary_layer_function_decays_as_claimed() -> None:
    """With c1 = 1 + 2 r2 (1 + V̄)²/r1 the derivative of W along the boundary layer is -r2 (1 + V̄)² (ᾱ² + q̄²)."""
    r1, r2 = 42.0, 1.0

    def worst(c1: float, edge: float) -> float:
        square = (1.0 + edge) ** 2
        form = 0.5 * np.array([[c1, 1.0], [1.0, 1.0 + r1 / (r2 * square)]])
        flow = np.array([[0.0, r1], [-r2 * square, -r2 * square]])
        change = form @ flow + flow.T @ form
        return float(np.abs(change + r2 * square * np.eye(2)).max())

    for edge in (-0.2, 0.0, 0.2):
        square = (1.0 + edge) ** 2
        assert worst(1.0 + 2.0 * r2 * square / r1, edge) == pytest.approx(0.0, abs=1e-12)
        assert worst(r1 + square * (r1 + r2), edge) > 1.0


@given(v=st.floats(-0.9, 2.0), g=st.floats(-3.0, 3.0))
def test_erratum_phi_is_the_decay_of_the_slow_function(v: float, g: float) -> None:
    """Φ = 2/3 - (1+V̄) cos γ̄ + (1+V̄)³/3 along the slow flow with γ_e as it comes: -Φ' = (V̄+2)² V̄² + 4 (1+V̄)² sin²."""
    drag, lift = 3.6272, -0.85
    gamma_e = math.atan2(drag, -lift)
    pull = math.hypot(drag, lift)
    edge = 1.0 + v
    v_rate = -(-pull * math.sin(g + gamma_e) + drag * edge**2) / drag
    g_rate = -(-pull * math.cos(g + gamma_e) - lift * edge**2) / (drag * edge)
    slope_v, slope_g = -math.cos(g) + edge**2, edge * math.sin(g)
    decay = -(slope_v * v_rate + slope_g * g_rate)
    phi = (v + 2.0) ** 2 * v**2 + 4.0 * edge**2 * math.sin(g / 2.0) ** 2
    assert decay == pytest.approx(phi, rel=1e-9, abs=1e-11)


@given(width=st.floats(1e-4, 0.3), trim=st.floats(-0.05, 0.05))
def test_erratum_h_bounds_the_difference_of_cosines(width: float, trim: float) -> None:
    difference = abs(math.cos(trim + math.copysign(width, trim)) - math.cos(trim))
    assert difference <= width * math.sin(width / 2.0 + abs(trim)) * (1.0 + 1e-12) + 1e-16


def test_erratum_h_as_printed_is_too_small() -> None:
    width, trim = 0.01, 0.0025358
    printed = math.sin(width / 2.0) ** 2 + math.sin(width / 2.0 + trim) ** 2
    assert math.cos(trim) - math.cos(trim + width) > width * printed


@given(alpha=st.floats(-0.2, 0.2), speed=st.floats(0.1, 2.0), thrust=st.floats(0.0, 10.0))
def test_erratum_27_is_sufficient_for_26_not_necessary(alpha: float, speed: float, thrust: float) -> None:
    drag = 7.3579 + 318.0849 * alpha**2
    if speed > math.sqrt(thrust / 7.3579):
        assert drag - thrust / speed**2 * math.cos(alpha) > 0.0


def test_erratum_27_an_example_where_26_holds_and_27_does_not() -> None:
    alpha, thrust = 0.1, 7.0
    speed = 0.95
    assert speed < math.sqrt(thrust / 7.3579)
    assert 7.3579 + 318.0849 * alpha**2 - thrust / speed**2 * math.cos(alpha) > 0.0


def test_erratum_4_weight_ahead_of_the_centre_of_buoyancy_puts_the_nose_down() -> None:
    ahead = np.array([0.1, 0.0, 0.0])
    weight = np.array([0.0, 0.0, -10.0])  # z up; the nose points along x
    nose_up = -np.cross(ahead, weight)[1]  # a turn from x towards z is about -y
    assert nose_up == pytest.approx(-0.1 * 10.0)


def test_erratum_slow_function_is_an_integral_of_lanchesters_motion() -> None:
    """The slow function has its minimum, zero, at steady flight, and grows as its slope says."""
    rise, _ = quad(lambda v: -1.0 + (1.0 + v) ** 2, 0.0, 0.3)
    assert rise == pytest.approx(2.0 / 3.0 - 1.3 + 1.3**3 / 3.0)

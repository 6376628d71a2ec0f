"""The polar closure: against the equations it solves, its own slopes and its symmetries."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.model.closure import glide_angle, glide_angles
from pipeline.vehicle import Polar, load

PETREL = load("petrel-ii").polar
polars = st.builds(
    Polar,
    st.just(0.0),
    st.floats(100, 600),
    st.floats(2, 20),
    st.floats(50, 600),
    st.sampled_from([0.0, -0.5]),
)
pitches = st.floats(math.radians(20), math.radians(75))


@given(polars, pitches, st.floats(0.1, 2.0))
def test_lift_and_drag_balance_along_and_across_the_path(polar: Polar, pitch: float, speed: float) -> None:
    alpha, _, _, steady = glide_angle(polar, speed, pitch)
    if not steady:
        return
    drag = polar.parasite_drag * speed**polar.drag_exponent + polar.induced_drag * alpha**2
    lift = polar.lift_slope * alpha
    assert math.tan(pitch - alpha) == pytest.approx(-drag / lift, rel=1e-9)
    assert alpha < 0.0


@given(polars, pitches, st.floats(0.1, 2.0), st.floats(0.2, 5.0))
def test_a_common_factor_on_all_coefficients_changes_nothing(
    polar: Polar, pitch: float, speed: float, factor: float
) -> None:
    scaled = Polar(*(value * factor for value in polar[:4]), polar.drag_exponent)
    assert glide_angle(scaled, speed, pitch)[0] == pytest.approx(glide_angle(polar, speed, pitch)[0], rel=1e-9)


@given(polars, st.floats(-1.3, 1.3), st.floats(0.1, 2.0))
def test_dive_and_climb_are_mirror_images(polar: Polar, pitch: float, speed: float) -> None:
    up, down = glide_angle(polar, speed, pitch), glide_angle(polar, speed, -pitch)
    assert up[0] == pytest.approx(-down[0], abs=1e-12)
    assert up[1] == pytest.approx(down[1], abs=1e-9)


@pytest.mark.parametrize("polar", [PETREL, Polar(1.0, 300.0, 7.0, 300.0, -0.5)])
@pytest.mark.parametrize("pitch_deg", [-60.0, -25.0, 18.0, 43.5])
def test_slopes_are_those_of_central_differences(polar: Polar, pitch_deg: float) -> None:
    pitch, speed, step = math.radians(pitch_deg), 0.5, 1e-6
    _, by_pitch, by_speed, _ = glide_angle(polar, speed, pitch)
    ahead, behind = glide_angle(polar, speed, pitch + step)[0], glide_angle(polar, speed, pitch - step)[0]
    faster, slower = glide_angle(polar, speed + step, pitch)[0], glide_angle(polar, speed - step, pitch)[0]
    assert by_pitch == pytest.approx((ahead - behind) / (2 * step), rel=1e-6)
    assert by_speed == pytest.approx((faster - slower) / (2 * step), rel=1e-5, abs=1e-9)


def test_the_paper_s_best_gliding_angles_are_reproduced() -> None:
    """At α = −1.66° the path climbs at 36.8° (paper: α −1.8°, γ 35°, a flat maximum)."""
    alpha = math.radians(-1.66)
    path = math.radians(36.8)
    assert glide_angle(PETREL, 0.6, path + alpha)[0] == pytest.approx(alpha, abs=math.radians(0.02))


def test_angle_of_attack_is_continuous_through_level_flight() -> None:
    pitch = np.linspace(-0.5, 0.5, 2001)
    alpha, _, _, steady = glide_angles(PETREL, np.full(pitch.size, 0.5), pitch)
    assert np.abs(np.diff(alpha)).max() < 2e-3
    assert not steady[np.abs(pitch) < 0.05].any()
    assert steady[np.abs(pitch) > 0.2].all()

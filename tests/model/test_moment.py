"""All trims in moment balance: each is an equilibrium, none is missed, and their eigenvalues tell the stable ones."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.model.dynamics import body_of, derivatives, jacobian
from pipeline.model.forces import propeller_of
from pipeline.model.steady import Trims, trim_at_moment, trim_at_pitch, trims_at_moment
from pipeline.vehicle import Vehicle, load

PETREL = load("petrel-ii")
#: The flow of the propeller's speed presses its nose down, more so the faster it is: two trims when powered.
CAMBERED = PETREL.with_values({"moment_at_zero": -3.0, "righting_moment": 1.0}, "cambered")


def check(vehicle: Vehicle, trims: Trims, g: float, moment_cos: float, turning: float) -> None:
    """Hold every trim found against the equations of motion and against a sweep over pitch."""
    count = int(np.isfinite(trims.steady.speed).sum())
    args = (body_of(vehicle), vehicle.polar, propeller_of(vehicle), 1.0, 1020.0, g, turning, moment_cos)
    for k in range(count):
        state = [float(getattr(trims.steady, name)[k]) for name in ("speed", "path_angle", "angle_of_attack")]
        rates = derivatives(*state, 0.0, *args, vehicle["righting_moment"])
        np.testing.assert_allclose(rates, 0.0, atol=1e-10)
        values = np.linalg.eigvals(jacobian(*state, 0.0, *args, vehicle["righting_moment"]))
        np.testing.assert_array_equal(np.sort_complex(values), np.sort_complex(trims.eigenvalues[k]))
        assert trims.stable[k] == (values.real.max() < 0.0)
    assert (np.diff(trims.steady.pitch[:count]) > 0.0).all()
    assert not trims.stable[count:].any()
    assert (str(trims.reason) == "") == (count > 0)

    pitch = np.deg2rad(np.linspace(-80.0, 80.0, 1281))
    held = trim_at_pitch(vehicle, g, pitch, propeller_speed=turning)
    left = moment_cos * np.cos(pitch) + vehicle["righting_moment"] * np.sin(pitch) - held.required_moment
    turns = np.flatnonzero(left[1:] * left[:-1] < 0.0)
    smooth = [i for i in turns if abs(held.speed[i + 1] - held.speed[i]) < 0.05]
    if np.diff(smooth).size and np.diff(smooth).min() < 9:
        return
    found = trims.steady.pitch[:count]
    for i in smooth:
        assert np.any((found >= pitch[i]) & (found <= pitch[i + 1])), math.degrees(pitch[i])


@settings(max_examples=40)
@given(
    g=st.floats(-9.0, 9.0).filter(lambda g: abs(g) > 0.3),
    lean=st.floats(-4.0, 4.0),
    turning=st.sampled_from([0.0, 14.0]),
)
def test_every_trim_is_found_and_is_an_equilibrium(g: float, lean: float, turning: float) -> None:
    for vehicle in (PETREL, CAMBERED):
        trims = trims_at_moment(vehicle, g, moment_cos=lean, propeller_speed=turning)
        check(vehicle, trims, g, lean, turning)


def test_of_two_trims_the_stable_one_is_flown_though_the_other_is_nearer_to_level() -> None:
    trims = trims_at_moment(CAMBERED, 3.0, moment_cos=1.0, propeller_speed=22.0)
    assert list(trims.stable) == [False, True, False, False, False, False]
    assert list(trims.steady.reason) == ["", ""] + ["no further trim"] * 4
    assert -float(trims.steady.pitch[0]) < float(trims.steady.pitch[1])
    chosen = trim_at_moment(CAMBERED, 3.0, moment_cos=1.0, propeller_speed=22.0)
    assert float(chosen.pitch) == float(trims.steady.pitch[1])


def test_trims_broadcast_with_a_last_axis_for_the_trims() -> None:
    trims = trims_at_moment(PETREL, [[-5.0], [math.nan]], battery_position=[0.01, 0.02, 0.03])
    assert trims.steady.speed.shape == trims.stable.shape == (2, 3, 6)
    assert trims.eigenvalues.shape == (2, 3, 6, 4)
    assert trims.reason.shape == (2, 3)
    assert (trims.reason[1] == "no net_buoyancy given").all()
    assert (trims.steady.reason[1] == "no net_buoyancy given").all()
    for k, position in enumerate((0.01, 0.02, 0.03)):
        one = trims_at_moment(PETREL, -5.0, battery_position=position)
        np.testing.assert_array_equal(one.steady.pitch, trims.steady.pitch[0, k])


def test_slowest_eigenvalue_of_the_paper_s_example() -> None:
    # T = 7 N at n = 1391 rpm, no static moment: -3.406 ± 6.485i, -0.054 1/s, at 76 degrees nose up.
    free = PETREL.with_values({"righting_moment": 0.0}, "neutral")
    trims = trims_at_moment(free, 7.0, moment_cos=0.0, propeller_speed=1391.3 / 60.0)
    assert trims.stable[0]
    assert math.degrees(float(trims.steady.pitch[0])) == pytest.approx(76.0, abs=0.2)
    values = trims.eigenvalues[0]
    assert values.real.max() == pytest.approx(-0.054, abs=5e-4)
    assert np.abs(values.imag).max() == pytest.approx(6.485, abs=5e-3)

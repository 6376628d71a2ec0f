"""The force model: against steady flight, the full dynamics, a plain second writing of its equations, and symmetry."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import arrays
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline import vehicle
from pipeline.estimate import force, reference, smoother
from pipeline.estimate.craft import PARAMETERS, Adjusted, Craft
from pipeline.estimate.flown import solve, unsettled
from pipeline.estimate.force import DEPTH, LOAD, PITCH, SPEED, WATER, Path, follow, linearise
from pipeline.estimate.forcing import Forcing, with_carried_water, with_thermal_lag
from pipeline.estimate.problem import Problem
from pipeline.estimate.series import Series
from pipeline.estimate.settings import Noise, Settings
from pipeline.model.dynamics import trajectory
from pipeline.model.exchange import FLUSHING_BEFORE, lagged
from pipeline.model.forces import disk_thrust, propeller_of, thrust
from pipeline.model.steady import trim_at_moment, trim_at_pitch
from pipeline.vehicle import Polar, Vehicle

PETREL = vehicle.load("petrel-ii")
STEADY = Settings()


def linear(series: Series, given: Forcing, craft: Craft, at: Path) -> tuple[Problem, np.ndarray]:
    """Return the problem of the force model along a path, and α with its slopes."""
    along = follow(series, given, craft, at)
    return linearise(series, along, STEADY, speed=False), along.alphas


def marched(craft: Craft, given: Forcing, time: np.ndarray, pitch: np.ndarray, start: float) -> tuple[np.ndarray, ...]:
    """Return V, z and α that the force model foretells along `pitch` without measuring anything, shape (m,) each."""
    at = Path(np.full(time.size, start), pitch, np.zeros(time.size))
    flown = arrays.series(time, pitch)
    for _ in range(60):
        problem, alphas = linear(flown, given, craft, at)
        x, z = np.empty(time.size), np.empty(time.size)
        x[0], z[0] = start, 0.0
        state = np.zeros(LOAD + 1)
        for k in range(time.size - 1):
            state[SPEED], state[PITCH], state[DEPTH] = x[k], pitch[k], z[k]
            x[k + 1], z[k + 1] = problem.rows[k] @ state + problem.shift[k, :, 0]
        if np.max(np.abs(x - at.speed)) < 1e-13:
            break
        at = at._replace(speed=x)
    return x, z, alphas[:, 0]


# --- Steady flight ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["petrel-ii", "seaglider", "slocum-g2", "slocum-deep"])
@pytest.mark.parametrize("pitch_deg", [12.0, 25.0, 45.0, 70.0])
@pytest.mark.parametrize("newton", [1.5, 6.0])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_it_comes_to_rest_at_the_steady_flight_of_the_theory(
    name: str, pitch_deg: float, newton: float, side: float
) -> None:
    craft = vehicle.load(name)
    pitch, density = side * math.radians(pitch_deg), 1.01 * craft["reference_density"]
    trim = trim_at_pitch(craft, side * newton, pitch, density=density)
    assert np.isfinite(trim.speed)
    time = np.arange(0.0, 900.0, 10.0)
    v, z, alpha = marched(
        arrays.craft(craft), arrays.inputs(time.size, side * newton, density), time, np.full(time.size, pitch), 0.4
    )
    assert v[-1] == pytest.approx(float(trim.speed), rel=1e-6)
    assert alpha[-1] == pytest.approx(float(trim.angle_of_attack), abs=1e-6)
    assert (z[-1] - z[-2]) / 10.0 == pytest.approx(-float(trim.speed * np.sin(trim.path_angle)), rel=1e-6)


@pytest.mark.parametrize(
    ("pitch_deg", "newton", "turns"), [(3.5, 2.5, 13.0), (-20.0, -3.0, 18.0), (30.0, 5.0, 20.0), (10.0, 0.0, 15.0)]
)
def test_under_power_too(pitch_deg: float, newton: float, turns: float) -> None:
    trim = trim_at_pitch(PETREL, newton, math.radians(pitch_deg), propeller_speed=turns)
    time = np.arange(0.0, 900.0, 10.0)
    given = arrays.inputs(time.size, newton, PETREL["reference_density"], turns)
    v, _, alpha = marched(arrays.craft(PETREL), given, time, np.full(time.size, math.radians(pitch_deg)), 0.4)
    assert v[-1] == pytest.approx(float(trim.speed), rel=1e-6)
    assert alpha[-1] == pytest.approx(float(trim.angle_of_attack), abs=1e-6)


@pytest.mark.parametrize(("pitch_deg", "newton", "watt"), [(-25.0, -2.6, 5.0), (24.0, 2.6, 5.0), (2.0, 0.0, 3.0)])
def test_under_a_known_power_it_comes_to_rest_where_the_thrust_of_that_speed_balances(
    pitch_deg: float, newton: float, watt: float
) -> None:
    craft, pitch = vehicle.load("slocum-thruster"), math.radians(pitch_deg)
    time = np.arange(0.0, 900.0, 10.0)
    given = arrays.inputs(time.size, newton, craft["reference_density"], propeller_power=watt)
    v, _, alpha = marched(arrays.craft(craft), given, time, np.full(time.size, pitch), 0.4)
    assert craft.disk is not None
    force, _ = disk_thrust(craft.disk, craft["reference_density"], watt, v[-1])
    trim = trim_at_pitch(craft, newton, pitch, thrust=force)
    assert v[-1] == pytest.approx(float(trim.speed), rel=2e-3)  # the trim has T sin α across the path
    assert alpha[-1] == pytest.approx(float(trim.angle_of_attack), abs=2e-3)


# --- The equations once more, plainly ---------------------------------------------------------------------------------


def plain(
    craft: Craft, given: Forcing, v: float, pitch: float, q: float, values: dict[str, float]
) -> tuple[float, float]:
    """Return V' and α by bisection and the textbook's forces, the parameters at `values`."""
    p, ratio = craft.polar, given.density[0] / craft.density
    k_l0 = p.lift_at_zero + values["lift_at_zero"]
    k_l = p.lift_slope * (1.0 + values["lift_slope"])
    k_d0 = p.parasite_drag * (1.0 + values["parasite_drag"]) * v**p.drag_exponent
    k_d = p.induced_drag * (1.0 + values["induced_drag"])
    g = given.net_buoyancy[0] + values["net_buoyancy"] + values["compressibility"] * given.by_compression[0]
    g += values["thermal_expansion"] * given.by_expansion[0] + values["hull_time"] * given.by_time[0]

    def normal(a: float) -> float:
        lift, drag = ratio * (k_l0 + k_l * a) * v * v, ratio * (k_d0 + k_d * a * a) * v * v
        return lift * math.cos(a) + drag * math.sin(a) + g * math.cos(pitch) - craft.inertia * v * q * math.cos(a)

    low, high = -0.3, 0.3
    assert normal(low) < 0.0 < normal(high)
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if normal(middle) < 0.0 else (low, middle)
    alpha = 0.5 * (low + high)
    d, n = craft.propeller.diameter, given.propeller_speed[0]
    pushing = given.density[0] * d**4 * n * n * (craft.propeller.thrust_static)
    pushing += given.density[0] * d**3 * n * v * craft.propeller.thrust_slope
    drag = ratio * (k_d0 + k_d * alpha**2) * v * v
    forward = (1.0 + values["thrust"]) * pushing * math.cos(alpha) - drag + g * math.sin(pitch - alpha)
    return forward / craft.inertia, alpha


#: What the measured pitch has, and what acts by a lag, of which the first step has none.
LAGGING = ("pitch", "hull_time", "carried_water", "flushing_time")
STEP = {"compressibility": 1e-12, "thermal_expansion": 1e-7, "hull_time": 1e-2}


@pytest.mark.parametrize("name", ["petrel-ii", "seaglider"])
@pytest.mark.parametrize(("v", "pitch", "q", "newton"), [(0.35, -0.5, 0.01, -4.0), (0.6, 0.35, -0.02, 6.0)])
def test_every_slope_is_that_of_a_plain_second_writing(
    name: str, v: float, pitch: float, q: float, newton: float
) -> None:
    named = vehicle.load(name)
    values = dict.fromkeys(PARAMETERS, 0.0) | {
        "parasite_drag": 0.1, "lift_slope": -0.15, "induced_drag": 0.2, "lift_at_zero": 0.3, "net_buoyancy": 0.2,
        "compressibility": 3e-11, "thermal_expansion": 4e-6, "thrust": 0.1,
    }  # fmt: skip
    craft = arrays.craft(named, **values)
    turns = 15.0 if named.propeller else 0.0
    given = arrays.inputs(2, newton, 1031.0, turns, by_compression=-3e9, by_expansion=-5e3)
    dt = 1.5
    at = Path(np.full(2, v), np.full(2, pitch), np.full(2, q))
    problem, alphas = linear(arrays.series(np.array([0.0, dt]), pitch), given, craft, at)

    def slopes(change: str) -> tuple[float, float]:
        step = STEP.get(change, 1e-5)
        found = []
        for side in (1.0, -1.0):
            moved = dict(values)
            w, t = v + side * step * (change == "speed"), pitch + side * step * (change == "angle")
            if change in moved:
                moved[change] += side * step
            found.append(plain(craft, given, w, t, q, moved))
        return tuple((a - b) / (2.0 * step) for a, b in zip(*found, strict=True))  # type: ignore[return-value]

    rate, alpha = plain(craft, given, v, pitch, q, values)
    rate_v, alpha_v = slopes("speed")
    rate_t, alpha_t = slopes("angle")
    assert rate_v < -0.01
    reach = (math.exp(rate_v * dt) - 1.0) / rate_v
    farther = (dt - reach) / -rate_v
    gamma = pitch - alpha
    z_v = -math.sin(gamma) + v * math.cos(gamma) * alpha_v
    z_t = -v * math.cos(gamma) * (1.0 - alpha_t)
    F, b = problem.rows[0], problem.shift[0]
    here = np.array([v, pitch, 0.0, 0.0, 0.0])
    assert alphas[0, :3] == pytest.approx([alpha, alpha_v, alpha_t], rel=1e-6, abs=1e-9)
    assert F[0, SPEED] == pytest.approx(math.exp(rate_v * dt), rel=1e-7)
    assert F[0, PITCH] == pytest.approx(rate_t * reach, rel=1e-6)
    assert F[1, SPEED] == pytest.approx(z_v * reach, rel=1e-6)
    assert F[1, PITCH] == pytest.approx(z_t * dt + z_v * rate_t * farther, rel=1e-6)
    assert F[0] @ here + b[0, 0] == pytest.approx(v + rate * reach, rel=1e-9)
    assert F[1] @ here + b[1, 0] == pytest.approx(-v * math.sin(gamma) * dt + z_v * rate * farther, rel=1e-9)
    for i, parameter in enumerate(PARAMETERS):
        rate_p, alpha_p = (0.0, 0.0) if parameter in LAGGING else slopes(parameter)
        assert alphas[0, 3 + i] == pytest.approx(alpha_p, rel=1e-5, abs=1e-9), parameter
        assert b[0, 1 + i] == pytest.approx(rate_p * reach, rel=1e-5, abs=1e-9), parameter
        deeper = v * math.cos(gamma) * alpha_p * dt + z_v * rate_p * farther
        assert b[1, 1 + i] == pytest.approx(deeper, rel=1e-5, abs=1e-9), parameter
        if parameter == "net_buoyancy":
            assert F[0, LOAD] == pytest.approx(rate_p * reach, rel=1e-5)
            assert F[1, LOAD] == pytest.approx(deeper, rel=1e-5)
    assert F[1, WATER] == pytest.approx(-STEADY.tau_w * (1.0 - math.exp(-dt / STEADY.tau_w)))
    assert problem.observed_by[1].tolist() == [float(name == "pitch") for name in PARAMETERS]


# --- The full dynamics ------------------------------------------------------------------------------------------------


class Stepped(NamedTuple):
    """A pitch step by the full dynamics: time [s], α [rad], q [rad/s], the path, and net buoyancy [N]."""

    time: np.ndarray
    angle_of_attack: np.ndarray
    pitch_rate: np.ndarray
    at: Path
    newton: float

    def slaved(self, path: Path) -> np.ndarray:
        """Return α of the lift balance along `path`, shape (m,), at the constant net buoyancy of the step."""
        given = arrays.inputs(self.time.size, self.newton, PETREL["reference_density"])
        series = arrays.series(self.time, path.pitch)
        _, alphas = linear(series, given, arrays.craft(PETREL), path)
        return alphas[:, 0]


def stepped(side: float) -> Stepped:
    """Return a flight at constant net buoyancy whose battery moves at once: pitch swings by about 15 degrees."""
    flat, steep = (
        float(trim_at_pitch(PETREL, side * 6.0, side * math.radians(angle)).required_moment)
        - PETREL["righting_moment"] * math.sin(side * math.radians(angle))
        for angle in (20.0, 35.0)
    )
    moments = [moment / math.cos(math.radians(angle)) for moment, angle in ((flat, 20.0), (steep, 35.0))]
    trim = trim_at_moment(PETREL, side * 6.0, moment_cos=moments[0])
    assert float(trim.pitch) == pytest.approx(side * math.radians(20.0), abs=1e-3)
    time = np.arange(0.0, 60.0, 0.5)
    start = [float(trim.speed), float(trim.path_angle), float(trim.angle_of_attack), 0.0]
    flown = trajectory(
        PETREL, start, time, net_buoyancy=side * 6.0, moment_cos=moments[1], moment_sin=PETREL["righting_moment"]
    )
    v, gamma, alpha, q = flown.T
    assert np.ptp(gamma + alpha) > math.radians(13.0)
    return Stepped(time, alpha, q, force.path(arrays.series(time, gamma + alpha), v, gamma + alpha), side * 6.0)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_alpha_follows_the_full_dynamics_through_a_pitch_step_because_of_the_pitch_rate(side: float) -> None:
    flight = stepped(side)
    at, q = flight.at, flight.pitch_rate
    later = flight.time > 2.0  # the fast mode that settles α takes a second; the step is sharper than any record
    assert at.pitch_rate[later] == pytest.approx(q[later], abs=0.03 * np.max(np.abs(q)))

    def worst(path: Path) -> float:
        return math.degrees(np.max(np.abs(flight.slaved(path) - flight.angle_of_attack)[later]))

    assert worst(at) < 0.05
    assert worst(at._replace(pitch_rate=np.zeros_like(q))) > 0.4


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_what_the_balance_leaves_of_alpha_while_it_settles_is_in_its_uncertainty(side: float) -> None:
    flight = stepped(side)
    left = np.abs(flight.slaved(flight.at) - flight.angle_of_attack)
    std = unsettled(arrays.series(flight.time, flight.at.pitch), flight.at, STEADY)
    assert np.max(left) > 3.0 * STEADY.slip
    assert np.all(left < 1.96 * std)
    assert std[-1] == pytest.approx(STEADY.slip, rel=0.01)


# --- The step ---------------------------------------------------------------------------------------------------------


def decay(dt: float, start: float = 1.2) -> tuple[np.ndarray, np.ndarray]:
    """Return V and z every 64 s of a dive that begins much too fast, by steps of `dt`."""
    time = np.arange(0.0, 192.1, dt)
    v, z, _ = marched(
        arrays.craft(PETREL), arrays.inputs(time.size, -4.0, 1025.0), time, np.full(time.size, -0.5), start
    )
    every = round(64.0 / dt)
    return v[::every], z[::every]


def test_v_is_open_by_when_the_propeller_started() -> None:
    """Within 8 s of start or not, evenly: the 1-sigma of what thrust over mass adds in that time, 8 s / √12 of it."""
    craft, time, start = arrays.craft(PETREL), np.arange(0.0, 60.0, 1.0), 30
    turning = np.where(np.arange(60) > start, 15.0, 0.0)
    at = Path(np.full(60, 0.5), np.full(60, -0.4), np.zeros(60))
    series = arrays.series(time, -0.4)
    told, untold = (
        linear(series, arrays.inputs(60, -4.0, 1025.0)._replace(propeller_speed=turning, switching=within), craft, at)[
            0
        ]
        for within in (np.zeros(60), np.where(np.arange(60) == start, 8.0, 0.0))
    )
    more = untold.noise[:, SPEED] - told.noise[:, SPEED]
    push = thrust(propeller_of(PETREL), 1025.0, 15.0, 0.5)
    assert more[start] == pytest.approx((push / craft.inertia * 8.0) ** 2 / 12.0)
    np.testing.assert_allclose(np.delete(more, start), 0.0, atol=1e-15)


def test_the_step_hardly_matters() -> None:
    """Second order in dt: from 2 to 8 s the error of a speed that decays by 0.8 m/s grows sixteenfold, to 1 cm/s."""
    fine = decay(0.125)
    worst = {dt: np.max(np.abs(decay(dt)[0] - fine[0])) for dt in (0.5, 2.0, 8.0)}
    assert worst[0.5] < 1e-4
    assert worst[2.0] < 1e-3
    assert worst[8.0] < 1e-2
    assert np.max(np.abs(decay(8.0)[1] - fine[1])) < 0.5
    assert np.max(np.abs(decay(2.0)[1] - fine[1])) < 0.05


@pytest.mark.parametrize("dt", [8.0, 64.0, 100.0])
def test_steps_far_longer_than_the_decay_stay_stable(dt: float) -> None:
    """Euler's step has the factor 1 + V' dt, beyond −4 here at 64 s; that of the exponential one stays positive."""
    trim = trim_at_pitch(PETREL, -4.0, -0.5, density=1025.0)
    time = np.arange(0.0, 20.0 * dt, dt)
    v, _, _ = marched(arrays.craft(PETREL), arrays.inputs(time.size, -4.0, 1025.0), time, np.full(time.size, -0.5), 1.2)
    assert v[-1] == pytest.approx(float(trim.speed), rel=3e-6)
    assert np.all(v > 0.9 * float(trim.speed))


# --- Symmetry and monotony --------------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(
    v=st.floats(0.1, 1.5),
    pitch=st.floats(-1.2, 1.2),
    q=st.floats(-0.05, 0.05),
    newton=st.floats(-12.0, 12.0),
    turns=st.sampled_from([0.0, 10.0, 20.0]),
    lift_at_zero=st.floats(-2.0, 2.0),
)
def test_upside_down_it_is_the_same_model(
    v: float, pitch: float, q: float, newton: float, turns: float, lift_at_zero: float
) -> None:
    time = np.array([0.0, 4.0, 8.0])
    found = []
    for side in (1.0, -1.0):
        craft = arrays.craft(PETREL, lift_at_zero=side * lift_at_zero)
        at = Path(np.full(3, v), np.full(3, side * pitch), np.full(3, side * q))
        given = arrays.inputs(3, side * newton, 1025.0, turns)
        found.append(linear(arrays.series(time, side * pitch), given, craft, at))
    (up, alpha_up), (down, alpha_down) = found
    flip = np.array([1.0, -1.0, -1.0, -1.0, -1.0])  # V stays; θ, z, w_w and the load change sign
    mirrored = np.array([-1.0 if name in ("lift_at_zero", "net_buoyancy") else 1.0 for name in PARAMETERS])
    by = np.concatenate([[1.0], mirrored])
    np.testing.assert_array_equal(down.rows, up.rows * flip[[SPEED, DEPTH]][:, None] * flip)
    np.testing.assert_array_equal(down.shift, up.shift * flip[[SPEED, DEPTH]][:, None] * by)
    np.testing.assert_array_equal(down.noise, up.noise)
    np.testing.assert_array_equal(down.cross, up.cross * -flip)
    np.testing.assert_array_equal(alpha_down[:, 0], -alpha_up[:, 0])


def scaled(craft: Vehicle, factor: float) -> Vehicle:
    """Return `craft` with all masses and coefficients of force by a common factor."""
    names = ("lift_at_zero", "lift_slope", "parasite_drag", "induced_drag", "mass", "mass_forward")
    return craft.with_values({name: factor * craft[name] for name in names}, "scaled")


@settings(max_examples=15)
@given(factor=st.floats(0.2, 5.0), pitch=st.floats(0.3, 1.0), newton=st.floats(1.0, 10.0))
def test_a_vehicle_larger_in_every_force_flies_as_fast(factor: float, pitch: float, newton: float) -> None:
    time = np.arange(0.0, 80.0, 4.0)
    held = np.full(time.size, pitch)
    v, z, alpha = marched(arrays.craft(PETREL), arrays.inputs(time.size, newton, 1025.0), time, held, 0.7)
    larger = arrays.craft(scaled(PETREL, factor))
    w, y, beta = marched(larger, arrays.inputs(time.size, factor * newton, 1025.0), time, held, 0.7)
    np.testing.assert_allclose(w, v, rtol=1e-10)
    np.testing.assert_allclose(y, z, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(beta, alpha, rtol=1e-9)


@settings(max_examples=15)
@given(pitch=st.floats(0.35, 1.0), newton=st.floats(1.5, 8.0), more=st.floats(0.05, 0.5), side=st.sampled_from([-1, 1]))
def test_more_buoyancy_is_faster_and_more_drag_is_slower(pitch: float, newton: float, more: float, side: int) -> None:
    time = np.arange(0.0, 200.0, 4.0)
    held = np.full(time.size, side * pitch)

    def last(pushed: float, **values: float) -> float:
        given = arrays.inputs(time.size, side * pushed, 1025.0)
        return float(marched(arrays.craft(PETREL, **values), given, time, held, 0.4)[0][-1])

    usual = last(newton)
    assert last(newton * (1.0 + more)) > usual
    assert last(newton, parasite_drag=more) < usual
    assert last(newton, induced_drag=more) < usual


# --- Engines ----------------------------------------------------------------------------------------------------------


def test_filterpy_solves_the_same_problem_to_1e9() -> None:
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(1.0, 6.0, 60))
    pitch = np.where(time < 100.0, -0.45, 0.45) + 0.003 * rng.standard_normal(60)
    depth = np.interp(time, [0.0, 100.0, 240.0], [50.0, 75.0, 40.0]) + 0.05 * rng.standard_normal(60)
    depth[rng.random(60) < 0.3] = np.nan
    flown = arrays.series(time, pitch, depth)
    given = arrays.inputs(60, np.where(time < 100.0, -5.0, 5.0), 1025.0)
    craft = arrays.craft(PETREL)
    at = force.path(flown, np.full(60, 0.45), pitch)
    columns = np.diag([0.005, 0.1, 0.2, 0.2, 0.1, 0.3, 0.0, 0.0, 0.05, 10.0, 0.2, 0.5])[:, [0, 1, 2, 5]]
    adjusted = Adjusted(craft, Noise(STEADY), columns, {})
    ours, _, solution, _ = solve(flown, given, adjusted, at, speed=False, solver=smoother.solve)
    theirs, _, other, _ = solve(flown, given, adjusted, at, speed=False, solver=reference.solve)
    np.testing.assert_allclose(theirs.state, ours.state, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(theirs.std, ours.std, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(other.covariance, solution.covariance, rtol=1e-8, atol=1e-10)
    assert other.log_likelihood == pytest.approx(solution.log_likelihood, rel=1e-9)


# --- The hull's warmth ------------------------------------------------------------------------------------------------


def test_the_lag_is_the_analytic_response_to_a_ramp_and_to_a_step() -> None:
    rng = np.random.default_rng(1)
    time = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 40.0, 60))])
    tau = 150.0
    ramp = lagged(time, 0.02 * time, tau)
    np.testing.assert_allclose(ramp, 0.02 * (time - tau * (1.0 - np.exp(-time / tau))), rtol=1e-10, atol=1e-12)
    rise = np.concatenate([[-1e-9], time])
    step = lagged(rise, np.concatenate([[0.0], np.ones(time.size)]), tau)
    np.testing.assert_allclose(step[1:], 1.0 - np.exp(-time / tau), atol=1e-9)


def test_no_time_constant_is_no_lag_and_an_endless_one_never_follows() -> None:
    time, value = np.array([0.0, 1.0, 5.0, 5.0, 9.0]), np.array([1.0, 3.0, -2.0, -2.0, 4.0])
    np.testing.assert_array_equal(lagged(time, value, 0.0), value)
    np.testing.assert_allclose(lagged(time, value, 1e-3), value, atol=0.01)
    np.testing.assert_allclose(lagged(time, value, 1e9), 1.0, atol=1e-6)
    np.testing.assert_allclose(lagged(time, value, 1e-9)[-1], 4.0)


@pytest.mark.parametrize("tau", [40.0, 150.0, 600.0])
def test_its_change_with_the_time_constant_is_the_finite_difference(tau: float) -> None:
    time = np.arange(0.0, 1500.0, 7.0)
    warmth = -4e3 * np.tanh((time - 400.0) / 120.0)
    given = arrays.inputs(time.size, -4.0, 1025.0)._replace(by_expansion=warmth)
    found = with_thermal_lag(given, time, 7e-5, tau)
    ahead, behind = (with_thermal_lag(given, time, 7e-5, tau + side) for side in (0.5, -0.5))
    slope = ahead.net_buoyancy - behind.net_buoyancy
    assert found.by_time == pytest.approx(slope, abs=0.03 * np.max(np.abs(slope)))
    np.testing.assert_allclose(found.net_buoyancy, -4.0 + 7e-5 * (found.by_expansion - warmth), rtol=1e-12)


def test_a_changed_expansion_acts_on_the_warmth_of_the_hull_alone() -> None:
    """The buoyancy that the model flies with is that of a hull expanding by the changed coefficient, no more."""
    time = np.arange(0.0, 600.0, 5.0)
    warmth = np.interp(time, [0.0, 200.0, 300.0, 600.0], [0.0, 0.0, 5e3, 5e3])
    craft = arrays.craft(PETREL, thermal_expansion=3e-5, hull_time=120.0)
    given = arrays.inputs(time.size, 0.0, 1025.0)._replace(
        net_buoyancy=-5.0 + craft.expansion * warmth, by_expansion=warmth
    )
    late = lagged(time, warmth, 120.0)
    same = arrays.inputs(time.size, 0.0, 1025.0)._replace(net_buoyancy=-5.0 + (craft.expansion + 3e-5) * late)
    at = Path(np.full(time.size, 0.4), np.full(time.size, -0.4), np.zeros(time.size))
    flown = arrays.series(time, -0.4)
    one, _ = linear(flown, given, craft, at)
    other, _ = linear(flown, same, arrays.craft(PETREL), at)
    # buoyancy is the mean over a step, the part of the changed coefficient that at its beginning
    np.testing.assert_allclose(one.shift[:-1, 0, 0], other.shift[:-1, 0, 0], atol=3e-4)
    settled = (time > 1.0) & ((time < 195.0) | (time > 595.0))
    np.testing.assert_allclose(one.shift[settled][:-1, 0, 0], other.shift[settled][:-1, 0, 0], atol=2e-6)


# --- Water that the fairing carries -----------------------------------------------------------------------------------


@pytest.mark.parametrize("sinking", [1.0, -1.0])
def test_carried_water_lifts_a_sinking_vehicle_and_weighs_on_a_rising_one(sinking: float) -> None:
    """In a constant gradient it is as light as the water met a time constant ago: g V τ dσ/dt, after some of them."""
    gradient, volume, tau = sinking * 2e-3, 0.07, 200.0  # kg/m3/s; m3; s
    time = np.arange(0.0, 3000.0, 9.0)
    around = -9.81 * volume * (25.0 + gradient * time)
    found = with_carried_water(
        arrays.inputs(time.size, 0.0, 1025.0)._replace(by_carried=around), time, share=0.3, constant=tau
    )
    late = time > 10.0 * tau
    np.testing.assert_allclose(found.by_carried[late], 9.81 * volume * gradient * tau, rtol=1e-4)
    np.testing.assert_allclose(found.by_flushing[late], 0.3 * found.by_carried[late], rtol=6e-3)
    assert found.by_carried[0] == 0.0


def test_the_flight_with_carried_water_is_that_with_the_force_it_makes_and_its_slopes_are_differences() -> None:
    time = np.arange(0.0, 1200.0, 5.0)
    around = -0.7 * (25.0 + 4.0 * np.tanh((time - 500.0) / 150.0))
    given = arrays.inputs(time.size, -4.0, 1025.0)._replace(by_carried=around)
    at = Path(np.full(time.size, 0.4), np.full(time.size, -0.4), np.zeros(time.size))
    flown = arrays.series(time, -0.4)

    state = np.array([0.4, -0.4, 0.0, 0.0, 0.0])

    def ahead(craft: Craft, inputs: Forcing) -> tuple[np.ndarray, np.ndarray]:
        """Return V and z one step on, and the columns of the parameters."""
        problem, _ = linear(flown, inputs, craft, at)
        return (problem.rows @ state + problem.shift[:, :, 0])[:-1], problem.shift[:-1, :, 1:]

    share, folds = 0.3, 0.4
    late = lagged(time, around, FLUSHING_BEFORE * math.exp(folds)) - around
    same = arrays.inputs(time.size, 0.0, 1025.0)._replace(net_buoyancy=-4.0 + share * late)
    values = {"carried_water": share, "flushing_time": folds}
    here, columns = ahead(arrays.craft(PETREL, **values), given)
    effect = np.max(np.abs(here - ahead(arrays.craft(PETREL), given)[0]), axis=0)
    assert effect[0] > 2e-3
    # buoyancy is the mean over a step, the part of the carried water that at its beginning
    assert np.all(np.max(np.abs(here - ahead(arrays.craft(PETREL), same)[0]), axis=0) < 0.03 * effect)
    for name, step in (("carried_water", 1e-3), ("flushing_time", 1e-2)):
        more, less = (
            ahead(arrays.craft(PETREL, **values | {name: values[name] + side * step}), given)[0] for side in (1.0, -1.0)
        )
        slope = (more - less) / (2.0 * step)
        column = columns[:, :, PARAMETERS.index(name)]
        assert np.all(np.max(np.abs(column - slope), axis=0) < 0.02 * np.max(np.abs(slope), axis=0)), name


def test_stalled_or_hardly_moving_it_asks_nothing_of_the_lift_balance() -> None:
    slow = Path(np.full(2, 0.03), np.full(2, -0.4), np.zeros(2))
    problem, alphas = linear(
        arrays.series(np.array([0.0, 4.0]), -0.4),
        arrays.inputs(2, -9.0, 1025.0),
        arrays.craft(PETREL),
        slow,
    )
    assert np.all(np.abs(alphas[:, 0]) <= force.STALLED)
    assert not alphas[:, 1:3].any()
    assert np.isfinite(problem.rows).all()
    assert np.isfinite(problem.shift).all()


def test_flow_is_separated_beyond_the_bound_whatever_the_polar() -> None:
    weak = replace(PETREL).with_values({"lift_slope": 5.0}, "weak")
    _, alphas = linear(
        arrays.series(np.array([0.0, 4.0]), 0.2),
        arrays.inputs(2, 9.0, 1025.0),
        arrays.craft(weak),
        Path(np.full(2, 0.3), np.full(2, 0.2), np.zeros(2)),
    )
    assert alphas[0, 0] == pytest.approx(-force.STALLED)
    assert isinstance(weak.polar, Polar)

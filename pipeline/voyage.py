"""A voyage: orders, autopilot, motors and motion second by second, compiled.

The motion (V, γ, α, q; depth and place; the water in a fairing) is integrated by classical Runge-Kutta steps; the fast
modes (period 0.9 to 4.5 s, relaxation of α 0.17 to 0.8 s) are stable and resolved at 0.1 s. Orders, autopilot and
motors act once a second, motors moving linearly between; vertical water velocity, current and heading wander are given
at the same instants and linear between, so that a shorter step converges to the same motion; a factor on thrust holds
for a second. Afloat the vehicle drifts with the water, trims its nose down and swings to the next heading; it dives
once heavy enough.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.model.dynamics import Body
from pipeline.model.forces import GRAVITY, thrust
from pipeline.model.motion import INPUTS, STATES, Ballast, advance, surroundings
from pipeline.vehicle import Polar, Propeller

#: Interval of orders, motors, disturbances and truth, s.
TICK = 1.0
#: A vehicle afloat lies at this depth, m; it leaves heavier than this, N, at this speed, m/s.
FLOATING_DEPTH, LEAVING_FORCE, LEAVING_SPEED = 0.2, 0.5, 0.1

#: How an order ends: after some seconds, at some depth or deeper, at some depth or shallower.
AFTER, DEEPER, SHALLOWER = 0.0, 1.0, 2.0


class Rig(NamedTuple):
    """Everything of vehicle and plan that the compiled loop needs beside forces and inertia, as plain numbers."""

    reference_density: float
    battery_weight: float
    battery_neutral: float
    battery_offset: float
    righting_moment: float
    flushing_time: float
    pitch_bias: float
    pump_rate: float
    battery_rate: float
    battery_range: float
    propeller_ramp: float
    turn_rate: float
    pitch_slew: float
    deadband: float
    gain_proportional: float
    gain_integral: float
    substeps: int


@njit(cache=True)
def gauss_markov(white: NDArray[np.float64], std: float, correlation_time: float) -> NDArray[np.float64]:
    """Return a stationary first-order Gauss-Markov sequence at intervals of `TICK`, shape (n,).

    Parameters
    ----------
    white
        Independent standard normal numbers, shape (n,).
    std
        1-sigma of the result.
    correlation_time
        Time over which the autocorrelation falls to 1/e, s.
    """
    memory = math.exp(-TICK / correlation_time)
    fresh = std * math.sqrt(1.0 - memory * memory)
    out = np.empty(white.size)
    value = std * white[0]
    out[0] = value
    for k in range(1, white.size):
        value = memory * value + fresh * white[k]
        out[k] = value
    return out


@njit(cache=True)
def _toward(value: float, target: float, rate: float) -> float:
    """Return the rate at which `value` moves to `target` within one tick, at most `rate` either way."""
    return min(max((target - value) / TICK, -rate), rate)


@njit(cache=True)
def fly(
    stages: NDArray[np.float64],
    disturbances: NDArray[np.float64],
    body: Body,
    polar: Polar,
    propeller: Propeller,
    rig: Rig,
    column: NDArray[np.float64],
) -> tuple[NDArray[np.float64], bool]:
    """Return the mission second by second, shape (n, 18), and whether the last order was completed.

    Parameters
    ----------
    stages
        Per order: pitch [rad], engine volume [m³], propeller speed [rev/s], heading [rad], end (`AFTER`, …),
        value of the end, afloat (1 or 0); shape (m, 7).
    disturbances
        Per second: w_w, current east, current north [m/s], heading wander [rad], factor on thrust; shape (k, 5).
    body, polar, propeller, rig
        The vehicle.
    column
        As in `motion.surroundings`.
    """
    ticks = disturbances.shape[0] - 1
    out = np.empty((ticks, 18))
    y = np.zeros(STATES)
    y[1] = stages[0, 0]
    y[4] = FLOATING_DEPTH
    y[7] = surroundings(FLOATING_DEPTH, column)[2]
    now = np.zeros(INPUTS)
    now[0] = stages[0, 1]
    now[3] = stages[0, 3]
    rate = np.zeros(INPUTS)
    work = np.empty((7, STATES))
    ballast = Ballast(
        rig.reference_density,
        rig.battery_weight,
        rig.battery_neutral,
        rig.battery_offset,
        rig.righting_moment,
        rig.flushing_time,
    )
    renewed = -math.expm1(-TICK / rig.flushing_time)
    step = TICK / rig.substeps
    afloat, stage, elapsed = True, 0, 0.0
    reference, error = y[1], 0.0

    for k in range(ticks):
        # Orders: is this one done?
        end, value = stages[stage, 4], stages[stage, 5]
        deep_enough = end == DEEPER and y[4] >= value
        shallow_enough = end == SHALLOWER and y[4] <= value and not afloat
        if deep_enough or shallow_enough or (end == AFTER and elapsed >= value):
            stage += 1
            elapsed = 0.0
            if stage == stages.shape[0]:
                return out[:k], True
        order = stages[stage]
        elapsed += TICK
        hull, density, around = surroundings(y[4], column)
        force = hull + GRAVITY * density * now[0] + around - y[7]
        if not afloat and (order[6] == 1.0 or y[4] < 0.0):
            afloat = True
            y[0], y[1], y[2], y[3], y[4] = 0.0, y[1] + y[2], 0.0, 0.0, max(y[4], 0.0)
        elif afloat and order[6] == 0.0 and force < -LEAVING_FORCE:
            afloat = False
            y[0] = LEAVING_SPEED
            reference, error = y[1], 0.0

        # Motors: rates for the coming second.
        rate[0] = _toward(now[0], order[1], rig.pump_rate)
        rate[2] = _toward(now[2], 0.0 if afloat else order[2], rig.propeller_ramp)
        if afloat:
            reference = order[0]
            balance = rig.battery_neutral
            if rig.battery_weight > 0.0:
                balance += rig.righting_moment * math.tan(order[0]) / rig.battery_weight
            rate[1] = _toward(now[1], min(max(balance, -rig.battery_range), rig.battery_range), rig.battery_rate)
        else:
            reference += _toward(reference, order[0], rig.pitch_slew) * TICK
            previous, error = error, reference - (y[1] + y[2] + rig.pitch_bias)
            wanted = now[1]
            if abs(error) > rig.deadband:
                wanted -= rig.gain_proportional * (error - previous) + rig.gain_integral * error * TICK
            rate[1] = _toward(now[1], min(max(wanted, -rig.battery_range), rig.battery_range), rig.battery_rate)
        off = order[3] + disturbances[k + 1, 3] - now[3]
        rate[3] = _toward(0.0, math.atan2(math.sin(off), math.cos(off)), rig.turn_rate)

        # Water: linear through the coming second.
        for i in range(3):
            now[4 + i] = disturbances[k, i]
            rate[4 + i] = (disturbances[k + 1, i] - disturbances[k, i]) / TICK
        if afloat:
            now[4], rate[4] = 0.0, 0.0

        share = disturbances[k, 4]
        driving = Propeller(share * propeller.thrust_static, share * propeller.thrust_slope, propeller.diameter)

        out[k, :7] = y[:7]
        out[k, 7:14] = now
        out[k, 14] = force
        out[k, 15] = thrust(driving, density, now[2], y[0])
        out[k, 16] = 1.0 if afloat else 0.0
        out[k, 17] = stage

        if afloat:
            y[1] += _toward(y[1], order[0], 5.0 * rig.pitch_slew) * TICK
            y[4] += (FLOATING_DEPTH - y[4]) * 0.2
            y[7] += (around - y[7]) * renewed
            y[5] += TICK * (now[5] + 0.5 * TICK * rate[5])
            y[6] += TICK * (now[6] + 0.5 * TICK * rate[6])
            now += TICK * rate
        else:
            for _ in range(rig.substeps):
                advance(y, now, rate, step, body, polar, driving, ballast, column, work)
            if not abs(y[1] + y[2]) < math.pi:  # tumbled for want of flow, or not a number
                return out[: k + 1], False
    return out, False

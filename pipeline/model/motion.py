"""One step of the motion, compiled: shared by `trajectory` and by the simulated voyages.

The state is y = (V, γ, α, q, depth, east, north, weight of the water in a fairing): Eqs. (1)-(4) of Niu et al. (2017),
doi:10.1007/s13344-017-0061-y, in physical signs, the path through the water and over ground, and the lag of
`exchange.lagged`. The inputs are (engine volume, battery position, propeller speed, heading, w_w, current east,
current north), linear through the step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.model.dynamics import Body, derivatives
from pipeline.model.forces import GRAVITY
from pipeline.vehicle import Polar, Propeller

#: Spacing of the table of the water column, m.
SPACING = 0.5
STATES, INPUTS = 8, 7


class Ballast(NamedTuple):
    """Weights and where they are, as plain numbers; kg/m³, N, m, m, N m, s.

    Of the battery weight and place, the righting moment, and the time in which water in the fairing is renewed.
    """

    reference_density: float
    battery_weight: float
    battery_neutral: float
    battery_offset: float
    righting_moment: float
    flushing_time: float


@njit(cache=True)
def surroundings(depth: float, column: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return the numbers of `column` at `depth`, by linear interpolation.

    Parameters
    ----------
    depth
        m, down positive.
    column
        Net buoyancy without engine and water carried [N], density [kg/m³], and what water in the fairing weighs once
        it is the water there [N], every `SPACING` metres from the surface, shape (n, 3).
    """
    place = min(max(depth / SPACING, 0.0), column.shape[0] - 1.001)
    i = int(place)
    part = place - i
    return (
        column[i, 0] + part * (column[i + 1, 0] - column[i, 0]),
        column[i, 1] + part * (column[i + 1, 1] - column[i, 1]),
        column[i, 2] + part * (column[i + 1, 2] - column[i, 2]),
    )


@njit(cache=True)
def rates(
    y: NDArray[np.float64],
    inputs: NDArray[np.float64],
    body: Body,
    polar: Polar,
    propeller: Propeller,
    ballast: Ballast,
    column: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Write into `out` the rates of the state `y` under `inputs`, SI per second.

    Parameters
    ----------
    y, inputs
        State and inputs, shapes (8,) and (7,).
    body, polar, propeller
        Coefficients.
    ballast
        Battery, righting moment and fairing.
    column
        As in `surroundings`.
    out
        Rates, shape (8,).
    """
    hull, density, around = surroundings(y[4], column)
    out[0], out[1], out[2], out[3] = derivatives(
        y[0],
        y[1],
        y[2],
        y[3],
        body,
        polar,
        propeller,
        density / ballast.reference_density,
        density,
        hull + GRAVITY * density * inputs[0] + around - y[7],
        inputs[2],
        -ballast.battery_weight * (inputs[1] + ballast.battery_offset - ballast.battery_neutral),
        ballast.righting_moment,
    )
    level = y[0] * math.cos(y[1])
    out[4] = -y[0] * math.sin(y[1]) - inputs[4]
    out[5] = level * math.sin(inputs[3]) + inputs[5]
    out[6] = level * math.cos(inputs[3]) + inputs[6]
    out[7] = (around - y[7]) / ballast.flushing_time


@njit(cache=True)
def advance(
    y: NDArray[np.float64],
    now: NDArray[np.float64],
    rate: NDArray[np.float64],
    step: float,
    body: Body,
    polar: Polar,
    propeller: Propeller,
    ballast: Ballast,
    column: NDArray[np.float64],
    work: NDArray[np.float64],
) -> None:
    """Advance state `y` and inputs `now` in place by one classical Runge-Kutta step of fourth order.

    Parameters
    ----------
    y, now, rate
        State, inputs and the rates of the inputs, shapes (8,), (7,) and (7,).
    step
        Length of the step, s.
    body, polar, propeller, ballast, column
        As in `rates`.
    work
        Scratch memory, shape (7, 8).
    """
    middle, last, k1, k2, k3, k4, probe = work[0], work[1], work[2], work[3], work[4], work[5], work[6]
    half = 0.5 * step
    sixth = step / 6.0
    for i in range(INPUTS):
        middle[i] = now[i] + half * rate[i]
        last[i] = now[i] + step * rate[i]
    rates(y, now, body, polar, propeller, ballast, column, k1)
    for i in range(STATES):
        probe[i] = y[i] + half * k1[i]
    rates(probe, middle, body, polar, propeller, ballast, column, k2)
    for i in range(STATES):
        probe[i] = y[i] + half * k2[i]
    rates(probe, middle, body, polar, propeller, ballast, column, k3)
    for i in range(STATES):
        probe[i] = y[i] + step * k3[i]
    rates(probe, last, body, polar, propeller, ballast, column, k4)
    for i in range(STATES):
        y[i] += sixth * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    for i in range(INPUTS):
        now[i] = last[i]

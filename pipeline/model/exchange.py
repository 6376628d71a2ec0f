"""What a vehicle takes on from the water around it only in time: a hull its temperature, a fairing the water itself.

Both follow with a first-order lag. Water in a free-flooding fairing is as compressible as that around it, so that what
it weighs there is by the difference of their potential densities. Sinking, it comes from above and is light; rising,
it is heavy.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.vehicle import Vehicle

Array = NDArray[np.float64]

#: s, the time in which a hull takes on the temperature of the water, where nothing is known of it; and its 1-sigma.
HULL_TIME_BEFORE, HULL_TIME_STD = 150.0, 150.0
#: 1-sigma of the water carried, as a share of the hull's volume, where the vehicle file says nothing of it. Fairings
#: enclose about 0.1 (nose and tail of a Slocum) to 0.4 (the whole of a Seaglider) of it, more or less well flushed.
CARRIED_STD = 0.25
#: s, the time in which that water is renewed, where nothing is known of it; and the 1-sigma of its natural logarithm.
FLUSHING_BEFORE, FLUSHING_STD = 300.0, 1.0
#: Ratio of two times between which the slope in their logarithm is taken.
_RATIO = 1.01


class Fairing(NamedTuple):
    """Water that a fairing carries along: share of the hull's volume, time of renewal [s]; with 1-sigma."""

    share: float
    time: float
    share_std: float
    time_std: float


def fairing_of(vehicle: Vehicle) -> Fairing:
    """Return what the file of `vehicle` says of its fairing: no water where it names none.

    A time that it does not name is `FLUSHING_BEFORE`, within a factor e.

    Examples
    --------
    >>> from pipeline.vehicle import load
    >>> fairing_of(load("petrel-ii"))
    Fairing(share=0.0, time=300.0, share_std=0.0, time_std=300.0)
    """
    share, share_std = vehicle["carried_water"], vehicle.std("carried_water")
    time, time_std = vehicle["flushing_time"], vehicle.std("flushing_time")
    if math.isnan(time):
        time = FLUSHING_BEFORE
    return Fairing(
        float(np.nan_to_num(share)),
        time,
        float(np.nan_to_num(share_std)),
        FLUSHING_STD * time if math.isnan(time_std) else time_std,
    )


def carried(time: Array, around: Array, constant: float) -> tuple[Array, Array]:
    """Return net buoyancy, N, by water carried, per share of the hull's volume, and its slope in ln `constant`.

    Parameters
    ----------
    time
        s, shape (m,), increasing.
    around
        What a hull's volume of the water around weighs by its potential density, N, shape (m,); a constant added to
        it changes nothing.
    constant
        Time in which the water carried is renewed, s.

    Returns
    -------
    tuple of ndarray
        Shape (m,) each, up positive; at the first instant the fairing holds the water around.
    """
    late = lagged(time, around, constant)
    later = lagged(time, around, _RATIO * constant)
    return around - late, (late - later) / math.log(_RATIO)


@njit(cache=True, nogil=True)
def lagged(time: Array, value: Array, constant: float) -> Array:
    """Return `value`, linear between instants, as seen by a first-order lag with this constant, s; shapes (m,)."""
    late = value.copy()
    dt_0, gone = -1.0, 0.0
    for k in range(1, time.size):
        dt = time[k] - time[k - 1]
        if constant > 0.0:
            if dt != dt_0:
                gone, dt_0 = -math.expm1(-max(dt, 0.0) / constant), dt
            behind = (value[k] - value[k - 1]) * (gone * constant / dt if dt > 0.0 else 1.0)
            late[k] = value[k] - behind + (1.0 - gone) * (late[k - 1] - value[k - 1])
    return late

"""Acoustic Doppler current profiler: speed through water from the velocity of the water relative to the glider."""

from __future__ import annotations

import warnings

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.records import Quality

#: The nearest cells, in which the flow is the glider's own motion and not yet shear between glider and water.
CELLS = slice(0, 3)
#: Least 1-sigma of an ensemble mean [m/s].
FLOOR = 0.01
#: Cells that scatter by more than this [m/s], or surface waves above this pressure [dbar], make an ensemble doubtful.
SCATTER = 0.05
SURFACE = 10.0


def through_water(
    time: npt.NDArray[np.float64], velocity: npt.NDArray[np.float64], pressure: npt.NDArray[np.float64]
) -> pd.DataFrame:
    """Return speed through water by ensemble: ``time``, ``speed_through_water`` with ``_std`` and ``_qc``.

    V = |mean of the velocity over cells 1 to 3|; its 1-sigma is the scatter of those cells, root mean square over the
    components, over the root of their number, at least 1 cm/s. An ensemble is probably bad where the cells disagree
    by more than 5 cm/s (the profiler averaged over a turn, or an obstacle) or at less than 10 dbar (waves, bubbles).
    An ensemble of a Nortek AD2CP on a Seaglider is centred on its time stamp.

    Parameters
    ----------
    time
        Instants of the ensembles [s], shape (n,).
    velocity
        Velocity of the water relative to the glider in any Cartesian frame [m/s], shape (n, cells, 3).
    pressure
        Pressure at the instrument [dbar], shape (n,); NaN where unknown.
    """
    near = velocity[:, CELLS, :]
    valid = np.asarray(np.isfinite(near).all(axis=2))
    count = valid.sum(axis=1)
    near = np.where(np.expand_dims(valid, 2), near, np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        speed = np.linalg.norm(np.nanmean(near, axis=1), axis=1)
        scatter = np.sqrt(np.mean(np.nanvar(near, axis=1, ddof=1), axis=1))
    std = np.maximum(scatter / np.sqrt(np.maximum(count, 1)), FLOOR)
    doubtful = (scatter > SCATTER) | (pressure < SURFACE)
    flag = np.where(doubtful, Quality.PROBABLY_BAD, Quality.GOOD)
    few = count < 2
    return pd.DataFrame(
        {
            "time": time,
            "speed_through_water": np.where(few, np.nan, speed),
            "speed_through_water_std": np.where(few, np.nan, std),
            "speed_through_water_qc": np.where(few, Quality.MISSING, flag).astype(np.int8),
        }
    )

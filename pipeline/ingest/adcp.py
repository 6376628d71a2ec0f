"""Acoustic Doppler current profiler: speed through water from the velocity of the water relative to the glider."""

from __future__ import annotations

import math
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
#: Beams of a Nortek AD2CP for gliders from the axis of its head, rad: fore and aft, port and starboard (Todd et al.
#: 2017, doi:10.1175/JTECH-D-16-0156.1).
ALONG, ACROSS = math.radians(47.5), math.radians(25.0)
#: Standard deviation over median absolute deviation of a normal distribution.
_NORMAL = 1.4826


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


def by_beams(beams: npt.NDArray[np.float64], pressure: npt.NDArray[np.float64]) -> pd.DataFrame:
    """Return speed through water, with ``_std`` and ``_qc``, from the first cell of the four beams of a Nortek AD2CP.

    Two pairs of beams measure the velocity along the axis of the head. How far these differ tells the noise of a beam,
    and with it the 1-sigma of V, at least 1 cm/s. An ensemble is probably bad where they differ by more than 5 cm/s or
    at less than 10 dbar, as in `through_water`.

    Parameters
    ----------
    beams
        Velocity along the beams fore, port, aft and starboard, away from the instrument [m/s], shape (n, 4).
    pressure
        Pressure at the instrument [dbar], shape (n,); NaN where unknown.
    """
    fore, port, aft, starboard = beams.T
    forward = (aft - fore) / (2.0 * math.sin(ALONG))
    sideways = (starboard - port) / (2.0 * math.sin(ACROSS))
    pairs = np.stack([(fore + aft) / (2.0 * math.cos(ALONG)), (port + starboard) / (2.0 * math.cos(ACROSS))])
    weights = np.array([math.cos(ALONG) ** 2, math.cos(ACROSS) ** 2])
    upward = weights @ pairs / weights.sum()
    speed = np.sqrt(forward**2 + sideways**2 + upward**2)
    apart = pairs[0] - pairs[1]
    known = np.isfinite(apart)
    spread = _NORMAL * float(np.median(np.abs(apart[known] - np.median(apart[known])))) if known.any() else math.nan
    noise = spread / math.sqrt(float(np.sum(0.5 / weights)))
    std = max(noise / (math.sqrt(2.0) * math.sin(ALONG)), FLOOR)
    doubtful = (np.abs(apart) > SCATTER) | (pressure < SURFACE)
    flag = np.where(known, np.where(doubtful, Quality.PROBABLY_BAD, Quality.GOOD), Quality.MISSING)
    return pd.DataFrame(
        {
            "speed_through_water": speed,
            "speed_through_water_std": np.where(known, std, np.nan),
            "speed_through_water_qc": flag.astype(np.int8),
        }
    )

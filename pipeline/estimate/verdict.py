"""Where an estimate is observable, and why not elsewhere."""

from __future__ import annotations

import numpy as np

from pipeline.estimate.series import LEVEL, Series

#: A speed is called observable when its 1-sigma is below this share of it.
OBSERVABLE = 0.2
UNKNOWN_POLAR = "lift and drag of the vehicle are not known"


def verdict(
    series: Series,
    speed: np.ndarray,
    speed_std: np.ndarray,
    steady: np.ndarray,
    beyond: np.ndarray,
    *,
    depth_alone: bool,
    glide: bool = True,
    polar_known: bool = True,
) -> np.ndarray:
    """Return for every record why its speed is unobservable, or "" where the data determine it; shape (m,).

    Parameters
    ----------
    series
        Measurements and flags.
    speed, speed_std
        Estimated speed and its 1-sigma.
    steady
        Where the pitch is steep enough for a glide.
    beyond
        Where the angle of attack found is more than one under power can be.
    depth_alone
        Neither a speed sensor nor fixes are used: then powered level flight is unobservable whatever the filter says.
    glide
        The angle of attack is borrowed from steady glides.
    polar_known
        Lift and drag of the vehicle are known.
    """
    weak = ~(speed_std <= OBSERVABLE * speed)
    level = series.powered & (np.abs(series.pitch_guess) < LEVEL)
    reason = np.full(speed.size, "", dtype=object)
    reason[weak] = "the 1-sigma exceeds 20 % of the speed"
    if glide:
        reason[weak & series.manoeuvre] = "manoeuvre: no steady flight to borrow the polar from"
    reason[weak & ~steady] = "near level: depth carries no speed"
    reason[level & (weak | depth_alone)] = "powered and near level: depth carries no speed and no fixes determine it"
    if depth_alone:
        reason[beyond & (reason == "")] = (
            "powered: the angle of attack found is more than a glide's, and depth alone tells"
        )
    reason[~np.isfinite(speed)] = "no finite estimate was found" if polar_known else UNKNOWN_POLAR
    reason[series.unmeasured] = "no depth or no pitch within two minutes"
    reason[series.standing] = "depth stands still: on the bottom, held, or hovering"
    reason[series.afloat] = "at the surface"
    return reason

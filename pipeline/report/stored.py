"""The vehicle's own stored flight model, held against what was measured: depth rate, and a speed sensor if any."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.records import seconds, usable
from pipeline.report.compare import DIRECTIONS, floats
from pipeline.report.covariance import Noise, water, water_of, with_measurement
from pipeline.report.fitting.terms import FLOOR
from pipeline.report.rounding import amount

if TYPE_CHECKING:
    from pipeline.table import Columns

Array = NDArray[np.float64]

#: A mean difference beyond this many 1-sigma is significant.
SIGNIFICANT = 2.0
#: A change with pitch beyond this many 1-sigma is significant: it is looked for in every direction.
SIGNIFICANT_SLOPE = 3.0
#: Least blocks, and least standard deviation of their pitch in degrees, for a change with pitch.
LEAST_BLOCKS = 6
LEAST_SPREAD_DEG = 0.5
#: A difference below this, m/s, is of no consequence to anybody.
NEGLIGIBLE = 0.003
#: Least stored samples in a block for a mean.
LEAST_SAMPLES = 3
#: Stored speed within this of a sensor's instant counts as simultaneous, s.
SIMULTANEOUS = 60.0


def check(
    stored: pd.DataFrame | None,
    blocks: pd.DataFrame,
    records: Columns,
    *,
    constants: Mapping[str, float] | None = None,
    settings: Mapping[str, Any] | None = None,
    sensor: str = "speed sensor",
) -> dict[str, Any]:
    """Return how the stored solution differs from the blocks' depth rate and from the speed sensor.

    Parameters
    ----------
    stored
        The table `records.STORED`, or None.
    blocks, records
        The canonical tables.
    constants
        The stored coefficients, for the sentence.
    settings
        The estimator's ``sigma_w`` [m/s] and ``tau_w`` [s].
    sensor
        What the speed sensor is to be called.

    Returns
    -------
    dict
        ``reason`` where there is nothing to check; ``depth_rate`` (rows per direction), ``sensor_blocks``,
        ``sensor_instants``, ``sentences`` for what is significant. Differences are stored less measured, m/s; of
        depth rates by their size, so that minus means too slow.
    """
    empty: dict[str, Any] = {"depth_rate": [], "sensor_blocks": None, "sensor_instants": None, "sentences": []}
    if stored is None or stored.empty:
        return empty | {"reason": "the logs hold no flight model solution", "coefficients": {}}
    time = seconds(stored["time"])
    speed, sinking = floats(stored, "speed"), -floats(stored, "vertical_speed")
    used = blocks[blocks["used"].to_numpy(dtype=bool)].sort_values("start", kind="stable").reset_index(drop=True)
    mean_speed, mean_rate = block_average(time, speed, used), block_average(time, sinking, used)
    rows = _depth_rates(used, mean_rate, settings)
    result = empty | {
        "reason": "" if rows else "no steady block with a stored solution",
        "coefficients": dict(constants or {}),
        "depth_rate": rows,
        "sensor_blocks": _sensor_blocks(used, mean_speed),
        "sensor_instants": _sensor_instants(time, speed, records),
    }
    result["sentences"] = sentences(result, sensor)
    return result


def block_average(time: Array, values: Array, blocks: pd.DataFrame) -> Array:
    """Return the mean of `values` within each block, NaN where fewer than `LEAST_SAMPLES` lie in it, shape (n,)."""
    finite = np.isfinite(values)
    t, total = time[finite], np.concatenate([[0.0], np.cumsum(values[finite])])
    first = np.searchsorted(t, seconds(blocks["start"]), side="left")
    last = np.searchsorted(t, seconds(blocks["end"]), side="right")
    count = last - first
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(count >= LEAST_SAMPLES, (total[last] - total[first]) / count, np.nan)


def _depth_rates(used: pd.DataFrame, stored: Array, settings: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    sigma, tau = water_of(settings)
    measured = floats(used, "depth_rate")
    rows = []
    for side in (-1, 1):
        here = (used["direction"].to_numpy() == side) & np.isfinite(stored) & np.isfinite(measured)
        if not here.any():
            continue
        own = used[here]
        difference = -side * (stored - measured)[here]
        shared = water(seconds(own["start"]), seconds(own["end"]), sigma, tau)
        noise = with_measurement(shared, np.nan_to_num(floats(own, "depth_rate_std")))
        rows.append(
            {
                "direction": DIRECTIONS[side],
                **_statistics(difference, noise),
                **_slope(difference, np.degrees(np.abs(floats(own, "pitch"))), noise),
                "stored_m_s": float(np.mean(-side * stored[here])),
                "measured_m_s": float(np.mean(-side * measured[here])),
            }
        )
    return rows


def _slope(difference: Array, steepness: Array, noise: Noise) -> dict[str, float]:
    """Return how the difference changes per degree of pitch, by generalised least squares; NaN where it cannot be had.

    Water in vertical motion does not know the vehicle's pitch, so a change with pitch is the model's.
    """
    known = np.isfinite(steepness).all() and difference.size >= LEAST_BLOCKS
    if not known or float(np.std(steepness)) < LEAST_SPREAD_DEG:
        return {"per_degree_m_s": math.nan, "per_degree_std_m_s": math.nan}
    whiten = with_measurement(noise, np.full(difference.size, FLOOR)).whitener()
    columns = whiten(np.column_stack([np.ones(difference.size), steepness - steepness.mean()]))
    covariance = np.linalg.inv(columns.T @ columns)
    slope = covariance @ (columns.T @ whiten(difference))
    return {"per_degree_m_s": float(slope[1]), "per_degree_std_m_s": math.sqrt(covariance[1, 1])}


def _sensor_blocks(used: pd.DataFrame, stored: Array) -> dict[str, Any] | None:
    """Return stored less sensor speed over block means, None without a sensor."""
    measured = floats(used, "sensor_speed")
    here = np.isfinite(stored) & np.isfinite(measured)
    if not here.any():
        return None
    std = np.nan_to_num(floats(used, "sensor_speed_std"))[here]
    return _statistics((stored - measured)[here], Noise(std[np.newaxis, :] ** 2)) | {
        "stored_m_s": float(np.mean(stored[here])),
        "measured_m_s": float(np.mean(measured[here])),
    }


def _sensor_instants(time: Array, stored: Array, records: Columns) -> dict[str, Any] | None:
    """Return stored less sensor speed at the sensor's own instants, None without a sensor."""
    good = usable(records, "speed_through_water")
    finite = np.isfinite(stored)
    if not good.any() or np.count_nonzero(finite) < 2:
        return None
    instants, measured = seconds(records["time"])[good], floats(records, "speed_through_water")[good]
    t, v = time[finite], stored[finite]
    after = np.clip(np.searchsorted(t, instants), 1, t.size - 1)
    nearest = np.minimum(np.abs(t[after] - instants), np.abs(instants - t[after - 1]))
    here = nearest <= SIMULTANEOUS
    if not here.any():
        return None
    difference = np.interp(instants[here], t, v) - measured[here]
    return {
        "samples": int(here.sum()),
        "difference_m_s": float(np.mean(difference)),
        "rms_m_s": float(np.sqrt(np.mean(difference**2))),
        "stored_m_s": float(np.mean(difference) + np.mean(measured[here])),
        "measured_m_s": float(np.mean(measured[here])),
    }


def _statistics(difference: Array, noise: Noise) -> dict[str, Any]:
    """Return mean, its 1-sigma (the larger of noise and scatter) and RMS of block differences."""
    count = difference.size
    scatter = float(np.std(difference, ddof=1)) / math.sqrt(count) if count > 1 else 0.0
    expected = math.sqrt(noise.variance(np.full(count, 1.0 / count)))
    return {
        "blocks": count,
        "difference_m_s": float(np.mean(difference)),
        "difference_std_m_s": max(scatter, expected),
        "rms_m_s": float(np.sqrt(np.mean(difference**2))),
        "expected_rms_m_s": float(np.sqrt(np.mean(noise.band[0]))),
    }


def sentences(result: Mapping[str, Any], sensor: str) -> list[str]:
    """Return what is significant, in plain words: the depth rate first, then the sensor."""
    named = {key: value for key, value in result["coefficients"].items() if key.startswith("hd_")}
    whose = f" ({', '.join(f'{key} = {value:.4g}' for key, value in sorted(named.items()))})" if named else ""
    rates = [_rate_words(row) for row in result["depth_rate"] if _disagrees(row)]
    speeds = [
        f"stored speed {_amount(row)}" for row in (result["sensor_blocks"],) if row is not None and _significant(row)
    ]
    if not speeds and result["sensor_instants"] is not None and result["sensor_blocks"] is None:
        row = result["sensor_instants"]
        if abs(row["difference_m_s"]) > NEGLIGIBLE:
            speeds = [f"stored speed {_amount(row)} at {row['samples']} instants"]
    found = []
    if rates:
        found.append(f"with the depth rate: {'; '.join(rates)}")
    if speeds:
        found.append(f"with the {sensor}: {speeds[0]}")
    return [f"The stored coefficients{whose} disagree {', and '.join(found)}."] if found else []


def _significant(row: Mapping[str, Any]) -> bool:
    return bool(abs(row["difference_m_s"]) > max(SIGNIFICANT * row["difference_std_m_s"], NEGLIGIBLE))


def _disagrees(row: Mapping[str, Any]) -> bool:
    """Return whether a depth rate is off on average, changes with pitch, or scatters more than the water explains."""
    scatters = row["rms_m_s"] > max(SIGNIFICANT * row["expected_rms_m_s"], NEGLIGIBLE)
    return _significant(row) or _changes(row) or bool(scatters)


def _changes(row: Mapping[str, Any]) -> bool:
    return bool(abs(row["per_degree_m_s"]) > SIGNIFICANT_SLOPE * row["per_degree_std_m_s"])


def _rate_words(row: Mapping[str, Any]) -> str:
    steeper = ""
    if _changes(row):
        way = "slower" if row["per_degree_m_s"] < 0 else "faster"
        steeper = (
            f"the steeper the {way}, by {100 * abs(row['per_degree_m_s']):.2f} ± "
            f"{100 * row['per_degree_std_m_s']:.2f} cm/s per degree of pitch"
        )
    if _significant(row):
        words = f"{row['direction']} {_amount(row)}, RMS {100 * row['rms_m_s']:.1f} cm/s"
        return f"{words}, {steeper}" if steeper else words
    if steeper:
        return f"{row['direction']} {steeper}, RMS {100 * row['rms_m_s']:.1f} cm/s"
    return (
        f"{row['direction']} differ by {100 * row['rms_m_s']:.1f} cm/s RMS where the water explains "
        f"{100 * row['expected_rms_m_s']:.1f}"
    )


def _amount(row: Mapping[str, Any]) -> str:
    size, way = abs(row["difference_m_s"]), "slow" if row["difference_m_s"] < 0 else "fast"
    share = f" ({100 * size / abs(row['measured_m_s']):.0f} %)" if row["measured_m_s"] else ""
    std = row.get("difference_std_m_s")
    shown = f"{100 * size:.1f}" if std is None else amount(100 * size, 100 * std, sign=False)
    return f"{shown} cm/s too {way}{share}"

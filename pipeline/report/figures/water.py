"""The water column: depth and temperature against time, as Figs. 11 and 12 of the paper."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib import MatplotlibDeprecationWarning
from matplotlib.colors import Colormap

from pipeline.records import TIME, Column, Quality, seconds, usable
from pipeline.report.compare import floats
from pipeline.report.figures.drawing import (
    MEASURED,
    POINTS,
    VOID,
    WIDTH,
    Array,
    Drawn,
    Picture,
    canvas,
    clock,
    gap,
    picture,
    since,
    style,
    thin,
    with_gaps,
)

if TYPE_CHECKING:
    from pipeline.table import Columns
COLUMNS = (
    TIME,
    Column("depth", "m", "depth, positive down"),
    Column("temperature", "degC", "in-situ temperature, ITS-90"),
)


def water(records: Columns, estimates: Columns) -> Picture | None:
    """Return depth and temperature against time, as Figs. 11 and 12 of the paper; None without a depth.

    Where the thermometer runs on another clock than the pressure sensor, its points are drawn at the smoothed depth
    of `estimates`, row by row of the same instants as `records`.
    """
    depth = np.where(usable(records, "pressure"), floats(records, "depth"), np.nan)
    known = np.isfinite(depth)
    if not known.any():
        return None
    time = seconds(records["time"])
    start = float(time[known][0])
    measured = usable(records, "temperature") & (records["temperature_qc"].to_numpy() != Quality.MISSING)
    temperature = np.where(measured, floats(records, "temperature"), np.nan)  # none that mission.yaml lends
    smoothed = len(estimates) == len(records) and bool((~known & np.isfinite(temperature)).any())
    place = np.where(known, depth, floats(estimates, "depth")) if smoothed else depth
    warm = np.isfinite(place) & np.isfinite(temperature)
    with style():
        figure = canvas(WIDTH, 4.6 if warm.any() else 2.8)
        hours, unit = clock(time, start)
        if warm.any():
            upper, lower = figure.subplots(2, sharex=True, height_ratios=(3, 2))
            step = max(1, int(np.ceil(warm.sum() / POINTS)))
            upper.scatter(  # a rim, so that cold water is seen on a dark page and warm on a light one
                hours[warm][::step], place[warm][::step], color=VOID, s=7.0, rasterized=True, linewidths=0
            )
            points = upper.scatter(
                hours[warm][::step], place[warm][::step], c=temperature[warm][::step], s=2.5,
                cmap=thermal(), rasterized=True, linewidths=0,
            )  # fmt: skip
            figure.colorbar(points, ax=[upper, lower], label="temperature, °C", aspect=30, pad=0.01)
            lower.plot(*thin(*with_gaps(hours[warm], temperature[warm], gap(unit))), color=MEASURED, linewidth=0.8)
            lower.set_ylabel("temperature, °C")
        else:
            upper = lower = figure.subplots()
            upper.plot(*thin(*with_gaps(hours[known], depth[known], gap(unit))), color=MEASURED)
        upper.invert_yaxis()
        upper.set_ylabel("depth, m")
        lower.set_xlabel(since(start, unit))
        lower.margins(x=0.01)
        words, caption = _words(depth[known], temperature[warm], smoothed)
        rows = np.flatnonzero(warm if warm.any() else known)
        rows = rows[:: max(1, int(np.ceil(rows.size / POINTS)))]
        stamps = pd.DatetimeIndex(records["time"])[rows]
        frame = pd.DataFrame({"time": stamps, "depth": place[rows], "temperature": temperature[rows]})
        return picture(figure, "water", words, caption, Drawn(frame, COLUMNS))


def _words(depth: Array, temperature: Array, smoothed: bool) -> tuple[str, str]:
    """Return the alternative text and the caption."""
    words = f"Depth against time, down to {np.max(depth):.0f} m"
    if not temperature.size:
        return words + ".", "Measured depth against time; no temperature was measured."
    caption = "Measured depth against time, coloured by measured temperature; below, temperature."
    if smoothed:
        caption += " Temperature and pressure have clocks of their own: its points are drawn at the smoothed depth."
    return f"{words}, coloured by temperature from {np.min(temperature):.1f} to {np.max(temperature):.1f} °C.", caption


def thermal() -> Colormap:
    """Return cmocean's colour map for temperature (Thyng et al. 2016, doi:10.5670/oceanog.2016.66)."""
    with warnings.catch_warnings():
        # cmocean 4.0 makes its maps with an argument that matplotlib 3.11 deprecates.
        warnings.simplefilter("ignore", MatplotlibDeprecationWarning)
        import cmocean
    colours: Colormap = cmocean.cm.thermal
    return colours

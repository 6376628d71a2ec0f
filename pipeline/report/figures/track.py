"""The track: fixes on a map in kilometres, where passages went without one, and the current in each of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection

from pipeline.geodesy import apart
from pipeline.records import TIME, Column, seconds, timestamps, usable
from pipeline.report.compare import floats
from pipeline.report.figures.drawing import (
    INK,
    MEASURED,
    POINTS,
    VOID,
    Array,
    Drawn,
    Picture,
    canvas,
    clock,
    picture,
    since,
    style,
)
from pipeline.report.rounding import uncertainty

if TYPE_CHECKING:
    from pipeline.table import Columns

COLUMNS = (
    TIME,
    Column("what", "", "fix, or current: half-way in time between the fixes about it", "string"),
    Column("latitude", "degrees_north", "latitude of the fix"),
    Column("longitude", "degrees_east", "longitude of the fix"),
    Column("east", "m", "distance east of the first fix"),
    Column("north", "m", "distance north of the first fix"),
    Column("current_east", "m/s", "depth-average current towards east"),
    Column("current_north", "m/s", "depth-average current towards north"),
    Column("current_std", "m/s", "1-sigma of either component"),
)
#: The longest arrow as a share of the map, and the steps of the speed in its key, m/s.
ARROW, STEPS = 0.22, (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
#: Of more arrows the circles of 1-sigma are left out.
CIRCLED = 60
#: Without a fix for so long the vehicle is taken to have been under way, s.
AWAY = 600.0


def track(records: Columns, current: Mapping[str, Any]) -> Picture | None:
    """Return the fixes on a map, coloured by time, with the current of each dive; None with fewer than two fixes.

    Parameters
    ----------
    records
        Canonical records.
    current
        ``current`` of summary.json.
    """
    rows = np.flatnonzero(usable(records, "latitude") & usable(records, "longitude"))
    rows = rows[:: max(1, int(np.ceil(rows.size / POINTS)))]
    if rows.size < 2:
        return None
    time = seconds(records["time"])[rows]
    latitude, longitude = (floats(records, name)[rows] for name in ("latitude", "longitude"))
    east, north = apart(latitude, longitude, latitude[0], longitude[0])
    away = np.diff(time) > AWAY
    with style():
        figure = canvas(6.4, 5.0)
        axes = figure.subplots()
        elapsed, unit = clock(time, float(time[0]))
        first, last = np.flatnonzero(away), np.flatnonzero(away) + 1
        axes.plot(
            1e-3 * np.stack([east[first], east[last]]), 1e-3 * np.stack([north[first], north[last]]), color=VOID,
            linewidth=0.9, linestyle="--",
        )  # fmt: skip
        points = axes.scatter(1e-3 * east, 1e-3 * north, c=elapsed, s=14, cmap="viridis", zorder=3, linewidths=0.6,
                              edgecolors=VOID)  # fmt: skip
        axes.plot(0.0, 0.0, marker="o", markersize=10, color="none", markeredgecolor=INK, label="first fix")
        axes.plot([], [], color=VOID, linewidth=0.9, linestyle="--", label="no fix in between")
        axes.plot([], [], marker="o", markersize=3.5, color=MEASURED, linestyle="none", label="fix")
        figure.colorbar(points, ax=axes, label=since(float(time[0]), unit), aspect=30)
        arrows = _arrows(current, time, east, north)
        circled = _draw(axes, arrows, float(max(np.ptp(east), np.ptp(north)))) if len(arrows) else ""
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel("east of the first fix, km")
        axes.set_ylabel("north of the first fix, km")
        figure.legend(loc="outside upper center", ncols=3)
        frame = pd.DataFrame({"time": timestamps(time), "what": "fix", "latitude": latitude, "longitude": longitude})
        frame = frame.assign(east=east, north=north)
        told = (
            f" Arrows: depth-average current of each passage between fixes{circled}. It is the velocity over ground "
            "less the kinematic estimate's through water: it shares the estimate's polar, and takes the headings as "
            "logged."
            if len(arrows)
            else f" No current is drawn: {current['reason']}."
        )
        return picture(
            figure,
            "track",
            f"{rows.size} fixes on a map, {1e-3 * np.hypot(east[-1], north[-1]):.1f} km from first to last; "
            f"{int(away.sum())} stretches without a fix. {current['sentence']}".rstrip(),
            "Measured: fixes, coloured by time, from the first one. Dashed: straight lines over stretches without a "
            f"fix, where nothing was measured of the track.{told}",
            Drawn(pd.concat([frame, arrows]) if len(arrows) else frame, COLUMNS),
        )


def _arrows(current: Mapping[str, Any], time: Array, east: Array, north: Array) -> pd.DataFrame:
    """Return the currents that are known, each at its place on the straight line between the fixes about it."""
    known = [row for row in current["passages"] if not row["reason"]]
    stamps = pd.DatetimeIndex([row["time"] for row in known])
    middle = seconds(pd.Series(stamps)) if known else np.zeros(0)
    return pd.DataFrame(
        {
            "time": timestamps(middle),
            "what": "current",
            "east": np.interp(middle, time, east),
            "north": np.interp(middle, time, north),
            "current_east": [row["east_m_s"] for row in known],
            "current_north": [row["north_m_s"] for row in known],
            "current_std": [row["std_m_s"] for row in known],
        }
    )


def _draw(axes: Axes, arrows: pd.DataFrame, wide: float) -> str:
    """Draw the currents on a map `wide` metres across with a key to their scale; return what the circles are."""
    x, y = 1e-3 * arrows["east"].to_numpy(), 1e-3 * arrows["north"].to_numpy()
    u, v, std = (arrows[f"current_{name}"].to_numpy() for name in ("east", "north", "std"))
    fastest = float(np.hypot(u, v).max())
    step = max((step for step in STEPS if step <= fastest), default=STEPS[0])
    scale = ARROW * max(1e-3 * wide, 0.1) / max(fastest, step)
    drawn = axes.quiver(x, y, scale * u, scale * v, angles="xy", scale_units="xy", scale=1.0, color=INK, width=0.004,
                        zorder=4)  # fmt: skip
    for side in (-1.2 * scale * std, 1.2 * scale * std):  # so that the map holds arrows and circles
        axes.plot(x + scale * u + side, y + scale * v + side, linestyle="none")
    axes.set_title(" ")  # room for the key, where no track runs
    axes.quiverkey(drawn, 0.3, 1.04, scale * step, f"{step:g} m/s, 1σ {uncertainty(float(np.median(std)))} m/s",
                   labelpos="E", coordinates="axes", fontproperties={"size": 9})  # fmt: skip
    if len(arrows) > CIRCLED:
        return ""
    tips = np.column_stack([x + scale * u, y + scale * v])
    size = 2.0 * scale * std
    axes.add_collection(
        EllipseCollection(size, size, np.zeros_like(size), units="xy", offsets=tips, transOffset=axes.transData,
                          facecolors="none", edgecolors=VOID, linewidths=0.9, zorder=3.5), autolim=False,
    )  # fmt: skip
    return ", circles at their tips its 1σ"

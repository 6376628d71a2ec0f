"""The track: fixes on a map in kilometres, and where each submerged passage went without one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pipeline.geodesy import apart
from pipeline.records import TIME, Column, seconds, timestamps, usable
from pipeline.report.compare import floats
from pipeline.report.figures.drawing import (
    INK,
    MEASURED,
    POINTS,
    VOID,
    Drawn,
    Picture,
    canvas,
    clock,
    picture,
    since,
    style,
)

if TYPE_CHECKING:
    from pipeline.table import Columns

COLUMNS = (
    TIME,
    Column("latitude", "degrees_north", "latitude of the fix"),
    Column("longitude", "degrees_east", "longitude of the fix"),
    Column("east", "m", "distance east of the first fix"),
    Column("north", "m", "distance north of the first fix"),
)
#: Without a fix for so long the vehicle is taken to have been under way, s.
AWAY = 600.0


def track(records: Columns) -> Picture | None:
    """Return the fixes on a map, coloured by time; None with fewer than two.

    Parameters
    ----------
    records
        Canonical records.
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
        points = axes.scatter(1e-3 * east, 1e-3 * north, c=elapsed, s=10, cmap="viridis", zorder=3, linewidths=0)
        axes.plot(0.0, 0.0, marker="o", markersize=10, color="none", markeredgecolor=INK, label="first fix")
        axes.plot([], [], color=VOID, linewidth=0.9, linestyle="--", label="no fix in between")
        axes.plot([], [], marker="o", markersize=3.5, color=MEASURED, linestyle="none", label="fix")
        figure.colorbar(points, ax=axes, label=since(float(time[0]), unit), aspect=30)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel("east of the first fix, km")
        axes.set_ylabel("north of the first fix, km")
        figure.legend(loc="outside upper center", ncols=3)
        frame = pd.DataFrame({"time": timestamps(time), "latitude": latitude, "longitude": longitude})
        return picture(
            figure,
            "track",
            f"{rows.size} fixes on a map, {1e-3 * np.hypot(east[-1], north[-1]):.1f} km from first to last; "
            f"{int(away.sum())} stretches without a fix.",
            "Measured: fixes, coloured by time, from the first one. Dashed: straight lines over stretches without a "
            "fix, where nothing was measured of the track.",
            Drawn(frame.assign(east=east, north=north), COLUMNS),
        )

"""Measured against predicted speed of each steady block."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from pipeline.records import Column
from pipeline.report.compare import DIRECTIONS, floats
from pipeline.report.figures.drawing import (
    INK,
    MARKERS,
    MEASURED,
    MOST_MARKS,
    SENSOR,
    WIDTH,
    Drawn,
    Picture,
    canvas,
    clock,
    picture,
    since,
    style,
)
from pipeline.report.rounding import signed

COLUMNS = (
    Column("block", "", "number of the block", "int32"),
    Column("dive", "", "dive number", "int32"),
    Column("direction", "", "-1 down, +1 up, 0 level", "int8"),
    Column("powered", "", "propeller turning", "bool"),
    Column("quantity", "", "speed: kinematic; sensor_speed: by the sensor; depth_rate: sinking positive", "string"),
    Column("start_s", "s", "first instant, POSIX time"),
    Column("end_s", "s", "last instant, POSIX time"),
    Column("predicted", "m/s", "quantity by theory, measured pitch held"),
    Column("u_input", "m/s", "1-sigma of predicted from coefficients and inputs"),
    Column("measured", "m/s", "quantity as measured"),
    Column("u_measured", "m/s", "1-sigma of measured"),
    Column("error", "m/s", "E = predicted - measured"),
    Column("u_val", "m/s", "validation uncertainty of error, 1-sigma"),
    Column("label", "", "how independent the two sides are", "string"),
)


#: What is drawn: quantity, what it is called, colour, panel of its difference.
KINDS = (
    ("speed", "kinematic speed", MEASURED, "speed"),
    ("sensor_speed", "speed sensor", SENSOR, "speed"),
    ("depth_rate", "depth rate", INK, "rate"),
)


def agreement(comparison: pd.DataFrame) -> Picture | None:
    """Return measured against predicted speed of each block, and E of speed and depth rate in time; None without any.

    Parameters
    ----------
    comparison
        The comparisons of `pipeline.report.compare`.
    """
    held = comparison[comparison["trim"] == "pitch"]
    drawn = held[held["quantity"].isin([kind for kind, *_look in KINDS])]
    speeds = drawn[drawn["quantity"] != "depth_rate"]
    if speeds.empty:
        return None
    start, last = float(floats(drawn, "start_s").min()), float(floats(drawn, "end_s").max())
    unit = clock(np.array([last]), start)[1]
    with style():
        figure = canvas(WIDTH, 4.8)
        axes = figure.subplot_mosaic([["equal", "speed"], ["equal", "rate"]], width_ratios=(1, 1.35))
        axes["speed"].sharex(axes["rate"])
        for quantity, label, colour, panel in KINDS:
            rows = drawn[drawn["quantity"] == quantity]
            middle = clock(0.5 * (floats(rows, "start_s") + floats(rows, "end_s")), start, unit)[0]
            for side, marker in MARKERS.items():
                here = rows["direction"].to_numpy() == side
                if not here.any():
                    continue
                look: dict[str, Any] = {
                    "color": colour, "marker": marker, "markersize": 4, "linestyle": "none", "elinewidth": 0.6,
                    "alpha": 0.8, "label": f"{label}, {DIRECTIONS[side]}", "rasterized": len(rows) > MOST_MARKS,
                }  # fmt: skip
                own = rows[here]
                if panel == "speed":
                    axes["equal"].errorbar(
                        floats(own, "predicted"), floats(own, "measured"), xerr=floats(own, "u_input"),
                        yerr=floats(own, "u_measured"), **look,
                    )  # fmt: skip
                axes[panel].errorbar(middle[here], 100 * floats(own, "error"), yerr=100 * floats(own, "u_val"), **look)
        _finish(axes, start, unit)
        handles, labels = axes["equal"].get_legend_handles_labels()
        more = axes["rate"].get_legend_handles_labels()
        figure.legend([*handles, *more[0]], [*labels, *more[1]], loc="outside upper center", ncols=4)
        mean = float(np.mean(floats(speeds, "error")))
        return picture(
            figure,
            "agreement",
            f"Predicted against measured speed in {len(speeds)} comparisons; the mean difference is "
            f"{signed(100 * mean)} cm/s.",
            "Left: each steady block's measured speed against theory with the measured pitch held, with the 1σ of "
            "either side. Right: E = theory − measured against time, of the speed and of the depth rate (sinking "
            "positive), with the validation uncertainty u_val, in which what both sides borrow from the polar is not "
            "counted twice. Theory borrows all coefficients; the kinematic speed borrows the lift/drag ratio, depth "
            "rate and sensor borrow nothing.",
            Drawn(drawn[[column.name for column in COLUMNS]], COLUMNS),
        )


def _finish(axes: Mapping[str, Axes], start: float, unit: str) -> None:
    """Label the panels, the left one with equal axes."""
    equal = axes["equal"]
    low, high = min(equal.get_xlim()[0], equal.get_ylim()[0]), max(equal.get_xlim()[1], equal.get_ylim()[1])
    equal.plot([low, high], [low, high], color=INK, linewidth=0.9, linestyle="--", label="equal")
    equal.set(xlim=(low, high), ylim=(low, high), aspect="equal")
    equal.set_xlabel("predicted speed, m/s")
    equal.set_ylabel("measured speed, m/s")
    for panel, words in (("speed", "speed"), ("rate", "depth rate")):
        axes[panel].axhline(0.0, color=INK, linewidth=0.9, linestyle="--")
        axes[panel].set_ylabel(f"E of {words}, cm/s")
    axes["speed"].tick_params(axis="x", labelbottom=False)
    axes["rate"].set_xlabel(since(start, unit))

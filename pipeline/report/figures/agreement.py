"""Measured against predicted speed of each steady block."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

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

COLUMNS = (
    Column("block", "", "number of the block", "int32"),
    Column("dive", "", "dive number", "int32"),
    Column("direction", "", "-1 down, +1 up, 0 level", "int8"),
    Column("powered", "", "propeller turning", "bool"),
    Column("quantity", "", "speed: kinematic; sensor_speed: by the sensor", "string"),
    Column("start_s", "s", "first instant, POSIX time"),
    Column("end_s", "s", "last instant, POSIX time"),
    Column("predicted", "m/s", "speed by theory, measured pitch held"),
    Column("u_input", "m/s", "1-sigma of predicted from coefficients and inputs"),
    Column("measured", "m/s", "measured speed"),
    Column("u_measured", "m/s", "1-sigma of measured"),
    Column("error", "m/s", "E = predicted - measured"),
    Column("u_val", "m/s", "validation uncertainty of error, 1-sigma"),
    Column("label", "", "how independent the two sides are", "string"),
)


def agreement(comparison: pd.DataFrame) -> Picture | None:
    """Return measured against predicted speed of each block, and their difference against time; None without any."""
    kinds = (("speed", "kinematic speed", MEASURED), ("sensor_speed", "speed sensor", SENSOR))
    held = comparison[comparison["trim"] == "pitch"]
    chosen = [(held[held["quantity"] == kind], label, colour) for kind, label, colour in kinds]
    chosen = [(rows, label, colour) for rows, label, colour in chosen if len(rows)]
    if not chosen:
        return None
    start = min(float(floats(rows, "start_s").min()) for rows, _label, _colour in chosen)
    last = max(float(floats(rows, "end_s").max()) for rows, _label, _colour in chosen)
    unit = "days" if last - start > 3 * 86400.0 else "hours"
    with style():
        figure = canvas(WIDTH, 4.2)
        left, right = figure.subplots(1, 2, width_ratios=(1, 1.35))
        for rows, label, colour in chosen:
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
                left.errorbar(
                    floats(own, "predicted"), floats(own, "measured"), xerr=floats(own, "u_input"),
                    yerr=floats(own, "u_measured"), **look,
                )  # fmt: skip
                right.errorbar(middle[here], 100 * floats(own, "error"), yerr=100 * floats(own, "u_val"), **look)
        low, high = left.get_xlim()
        low, high = min(low, left.get_ylim()[0]), max(high, left.get_ylim()[1])
        left.plot([low, high], [low, high], color=INK, linewidth=0.9, linestyle="--", label="equal")
        left.set(xlim=(low, high), ylim=(low, high), aspect="equal")
        left.set_xlabel("predicted speed, m/s")
        left.set_ylabel("measured speed, m/s")
        right.axhline(0.0, color=INK, linewidth=0.9, linestyle="--")
        right.set_ylabel("E = predicted − measured, cm/s (bars: u_val)")
        right.set_xlabel(since(start, unit))
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=4)
        drawn = pd.concat([rows for rows, _label, _colour in chosen])
        mean = float(np.mean(floats(chosen[0][0], "error")))
        return picture(
            figure,
            "agreement",
            f"Predicted against measured speed in {len(drawn)} comparisons; the mean difference is "
            f"{100 * mean:+.1f} cm/s.",
            "Left: each steady block's measured speed against theory with the measured pitch held, with the 1σ of "
            "either side. Right: their difference against time with the validation uncertainty u_val, in which what "
            "both sides borrow from the polar is not counted twice.",
            Drawn(drawn[[column.name for column in COLUMNS]], COLUMNS),
        )

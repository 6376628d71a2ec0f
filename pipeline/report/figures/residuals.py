"""Residuals of the fit against what could be behind them: pitch, depth, speed, time and heading."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from pipeline.records import Column
from pipeline.report.compare import DIRECTIONS
from pipeline.report.figures.drawing import (
    INK,
    MARKERS,
    MEASURED,
    MOST_MARKS,
    VOID,
    WIDTH,
    Array,
    Drawn,
    Picture,
    canvas,
    clock,
    picture,
    since,
    style,
)

COLUMNS = (
    Column("block", "", "number of the block", "int64"),
    Column("direction", "", "-1 down, +1 up, 0 level", "int64"),
    Column("pitch_deg", "deg", "measured pitch"),
    Column("depth_m", "m", "mean depth"),
    Column("speed_m_s", "m/s", "speed by the corrected theory"),
    Column("heading_deg", "deg", "mean heading, true north"),
    Column("before_m_s", "m/s", "depth rate, measured less predicted, before the corrections"),
    Column("after_m_s", "m/s", "the same after the corrections"),
)


def residuals(fit: Mapping[str, Any]) -> Picture | None:
    """Return the residuals of the depth rate, before and after, against pitch, depth, speed, time and heading."""
    if fit["reason"]:
        return None
    found = fit["residuals"]
    time = np.asarray(found["time_s"], dtype=np.float64)
    middle, unit = clock(time, float(time[0]))
    against: list[tuple[Array, str]] = [
        (np.asarray(found["pitch_deg"]), "pitch, °"),
        (np.asarray(found["depth_m"]), "depth, m"),
        (100.0 * np.asarray(found["speed_m_s"]), "speed by the corrected theory, cm/s"),
        (middle, since(float(time[0]), unit)),
        (np.asarray(found["heading_deg"]), "heading, °"),
    ]
    shown = [(value, label) for value, label in against if np.isfinite(value).any()]
    direction = np.asarray(found["direction"])
    before, after = (100.0 * np.asarray(found[name]) for name in ("before_m_s", "after_m_s"))
    with style():
        figure = canvas(WIDTH, 5.4)
        panels = figure.subplots(2, 3, sharey=True)
        for axes in panels.ravel()[len(shown) :]:
            axes.set_visible(False)
        for axes, (value, label) in zip(panels.ravel(), shown, strict=False):
            for side, marker in MARKERS.items():
                inside = direction == side
                if not inside.any():
                    continue
                look: dict[str, Any] = {"linestyle": "none", "marker": marker, "rasterized": time.size > MOST_MARKS}
                axes.plot(value[inside], before[inside], color=VOID, markersize=3.5, alpha=0.7, **look)
                axes.plot(
                    value[inside],
                    after[inside],
                    color=MEASURED,
                    markersize=4.0,
                    label=f"after, {DIRECTIONS[side]}",
                    **look,
                )
            axes.axhline(0.0, color=INK, linewidth=0.8, linestyle="--")
            axes.set_xlabel(label)
        for axes in panels[:, 0]:
            axes.set_ylabel("measured − predicted\ndepth rate, cm/s")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        grey = panels[0, 0].plot([], [], color=VOID, marker="o", markersize=3.5, linestyle="none")
        figure.legend([*grey, *handles], ["before", *labels], loc="outside upper center", ncols=4)
        return picture(
            figure,
            "residuals",
            f"Residuals of the depth rate of {time.size} blocks against {len(shown)} quantities: RMS "
            f"{_rms(before):.2f} cm/s before the corrections, {_rms(after):.2f} cm/s after.",
            "Depth rate of each block, measured less predicted, before (grey) and after (blue) the corrections. A "
            "slope or a bend that is left points to what the corrections do not contain.",
            Drawn(pd.DataFrame({column.name: found[column.name] for column in COLUMNS}), COLUMNS),
        )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values[np.isfinite(values)] ** 2)))

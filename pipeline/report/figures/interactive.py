"""Flight against time to zoom into: drawn in the reader's browser by BokehJS, which the page carries with it."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from pipeline.records import seconds, usable
from pipeline.report.compare import floats
from pipeline.report.figures import series
from pipeline.report.figures.drawing import FORCE, GAP, HELD, MEASURED, SENSOR, STORED, VARIABLES, VOID, with_gaps

if TYPE_CHECKING:
    from bokeh.models import ColumnDataSource
    from bokeh.models.renderers import GlyphRenderer
    from bokeh.plotting import figure

    from pipeline.report import Inputs
    from pipeline.table import Columns

Array = series.Array

DEGREES = 180.0 / np.pi
#: Panels: name, height in pixels, axis, column of the estimates, factor from SI.
PANELS = (
    ("depth", 130, "depth, m", "", 1.0),
    ("pitch", 120, "pitch, °", "", DEGREES),
    ("speed", 250, "speed, m/s", "speed", 1.0),
    ("alpha", 140, "angle of attack, °", "angle_of_attack", DEGREES),
    ("water", 140, "water, up, cm/s", "vertical_water_velocity", 100.0),
)
#: Methods of the estimates: and their colours.
METHODS = (("kinematic", MEASURED), ("force", FORCE))
#: Points of a series that is drawn beside the estimates.
BESIDE = 12_000
#: What may be shown or hidden: tag of its marks, and what it is called.
LAYERS = {
    "measured": "measured: as logged, and the kinematic estimate (2σ)",
    "force": "theory adjusted to the mission: the force estimate (2σ)",
    "held": "theory as in the vehicle file, measured pitch held",
    "sensor": "speed sensor",
    "stored": "the vehicle’s own stored model",
}


class Interactive(NamedTuple):
    """What the page needs to draw it.

    Attributes
    ----------
    item
        The drawing as JSON for ``Bokeh.embed.embed_item``.
    script
        BokehJS, from the installed package.
    layers
        What may be shown or hidden, by tag.
    account
        What of the estimates is shown, for summary.json.
    """

    item: str
    script: str
    layers: dict[str, str]
    account: Mapping[str, Any]


def interactive(inputs: Inputs) -> Interactive | None:
    """Return flight against time with depth, pitch, speed, angle of attack and water linked; None without estimates."""
    if inputs.records.empty or inputs.estimates.empty:
        return None
    from bokeh.embed import json_item
    from bokeh.layouts import gridplot
    from bokeh.resources import Resources

    turns = series.apexes(inputs.records)
    time = seconds(inputs.estimates["time"])
    thinned = series.thinning(time, turns)
    plots = _plots(float(time[0]), float(time[-1]))
    _measured(plots, inputs.records, turns)
    layers = {"measured"} | {_estimated(plots, method, table, turns) for method, table in _tables(inputs)}
    layers |= {
        name
        for name, drawn in (
            ("sensor", _sensor(plots, inputs.records)),
            ("stored", inputs.stored is not None and _stored(plots, inputs.stored, turns)),
            ("held", _theory(plots, inputs.blocks, inputs.predictions)),
        )
        if drawn
    }
    grid = gridplot(
        [[plot] for plot in plots.values()], sizing_mode="stretch_width", toolbar_location="right", merge_tools=True
    )
    shown = {name: words for name, words in LAYERS.items() if name in layers}
    item = json.dumps(json_item(grid), separators=(",", ":"), ensure_ascii=False)
    return Interactive(
        _numbered(item).replace("</", "<\\/"),
        "\n".join(Resources(mode="inline", components=["bokeh"], log_level="error").js_raw),
        shown,
        {**series.account(thinned, turns), "layers": shown},
    )


def _numbered(item: str) -> str:
    """Return the JSON with its identifiers numbered in their order: the library counts on from drawing to drawing."""
    known: dict[str, str] = {}
    return re.sub(r'"(p\d+)"', lambda found: f'"{known.setdefault(found[1], f"p{len(known)}")}"', item)


def _tables(inputs: Inputs) -> list[tuple[tuple[str, str], Columns]]:
    both = zip(METHODS, (inputs.estimates, inputs.force), strict=True)
    return [(method, table) for method, table in both if not table.empty]


def _plots(begin: float, end: float) -> dict[str, figure]:
    """Return the empty panels, their time axes one."""
    from bokeh.models import BoxZoomTool, CrosshairTool, PanTool, Range1d, ResetTool, WheelZoomTool
    from bokeh.models.annotations import Span
    from bokeh.plotting import figure

    edge = 0.01 * (end - begin)
    shared = Range1d(start=1e3 * (begin - edge), end=1e3 * (end + edge), name="time")
    line = Span(dimension="height", line_color=VOID, line_width=1, tags=["void"])
    plots = {}
    for name, height, label, _column, _factor in PANELS:
        last = name == PANELS[-1][0]
        zoom = BoxZoomTool(dimensions="width")
        plot = figure(
            height=height + (40 if last else 0), x_range=shared, x_axis_type="datetime", window_axis="x", name=name,
            min_border_left=64, min_border_right=8, min_border_top=4, min_border_bottom=4, output_backend="canvas",
            tools=[
                zoom, PanTool(dimensions="width"),
                WheelZoomTool(dimensions="width", modifiers={"ctrl": True}), ResetTool(), CrosshairTool(overlay=line),
            ],
        )  # fmt: skip
        plot.toolbar.active_drag = zoom
        plot.yaxis.axis_label = label
        plot.xaxis.visible = last
        plot.y_range.flipped = name == "depth"  # type: ignore[attr-defined]
        plot.background_fill_color = plot.border_fill_color = plot.outline_line_color = None
        if name in ("alpha", "water"):
            plot.add_layout(Span(dimension="width", location=0.0, line_color=VOID, line_width=1, tags=["void"]))
        plots[name] = plot
    plots[PANELS[-1][0]].xaxis.axis_label = "time, UTC"
    return plots


def _measured(plots: Mapping[str, figure], records: Columns, turns: list[series.Apex]) -> None:
    """Draw depth and pitch as logged, each on the clock of its own instrument."""
    time = seconds(records["time"])
    for name, instrument, factor, label in (
        ("depth", "pressure", 1.0, "depth, m"),
        ("pitch", "pitch", DEGREES, "pitch, °"),
    ):
        good = usable(records, instrument)
        values = factor * floats(records, name)
        if good.any():
            source = _line(time[good], values[good], turns)
            line = plots[name].line("time", "value", source=source, color=MEASURED, line_width=1.2)
            _hover(plots[name], _tagged(line, "measured"), [(label, "@value{0.0}")])


def _line(time: Array, values: Array, turns: list[series.Apex], gap: float = GAP) -> ColumnDataSource:
    """Return a thinned line that is broken where nothing was measured for `gap` seconds."""
    from bokeh.models import ColumnDataSource

    thinned = series.thinning(time, turns, BESIDE)
    t, v = with_gaps(thinned.instants(time), thinned.line(values), max(gap, 2.0 * gap * (thinned.longest > 1)))
    return ColumnDataSource({"time": 1e3 * t, "value": v.astype(np.float32)})


def _estimated(plots: Mapping[str, figure], method: tuple[str, str], table: Columns, turns: list[series.Apex]) -> str:
    """Draw one method's speed, angle of attack and water with their 2-sigma bands; return its tag."""
    from bokeh.models import ColumnDataSource

    name, colour = method
    tag = VARIABLES[colour]
    time = seconds(table["time"])
    thinned = series.thinning(time, turns)
    columns = {"time": 1e3 * thinned.instants(time)}
    for panel, _height, _label, column, factor in PANELS:
        if column:
            value, std = factor * floats(table, column), factor * floats(table, f"{column}_std")
            low, high = _closed(*thinned.band(value - 2.0 * std, value + 2.0 * std))
            columns |= {panel: thinned.line(value), f"{panel}_low": low, f"{panel}_high": high}
    small: dict[str, Any] = {
        key: value if key == "time" else value.astype(np.float32) for key, value in columns.items()
    }
    source = ColumnDataSource(small)
    for panel, _height, label, column, _factor in PANELS:
        if column:
            plot, lower, upper = plots[panel], f"{panel}_low", f"{panel}_high"
            _tagged(plot.varea("time", lower, upper, source=source, fill_color=colour, fill_alpha=0.2), tag)
            line = _tagged(plot.line("time", panel, source=source, color=colour, line_width=1.2), tag)
            if name == "kinematic":
                _hover(plot, line, [(label, f"@{panel}{{0.000}} (2σ: @{lower}{{0.000}} to @{upper}{{0.000}})")])
    return tag


def _closed(low: Array, high: Array) -> tuple[Array, Array]:
    """Return a band that has no width where it is unknown: the library draws across what is NaN."""
    known = np.isfinite(low) & np.isfinite(high)
    if not known.any():
        return low, high
    last = np.maximum.accumulate(np.where(known, np.arange(low.size), np.argmax(known)))
    middle = 0.5 * (low[last] + high[last])
    return np.where(known, low, middle), np.where(known, high, middle)


def _tagged(renderer: GlyphRenderer[Any], tag: str) -> GlyphRenderer[Any]:
    """Return marks that carry the name of their colour in the page's style sheet, by which they are also hidden."""
    renderer.tags = [tag]
    return renderer


def _hover(plot: figure, line: GlyphRenderer[Any], told: list[tuple[str, str]]) -> None:
    from bokeh.models import HoverTool

    plot.add_tools(
        HoverTool(
            renderers=[line], mode="vline", tooltips=[("time", "@time{%F %T}"), *told],
            formatters={"@time": "datetime"}, line_policy="nearest", attachment="horizontal",
        )
    )  # fmt: skip


def _sensor(plots: Mapping[str, figure], records: Columns) -> bool:
    """Draw the speed sensor, some of its points where there are many; return whether there is any."""
    from bokeh.models import ColumnDataSource

    rows = np.flatnonzero(usable(records, "speed_through_water"))
    rows = rows[:: max(1, int(np.ceil(rows.size / BESIDE)))]
    if rows.size:
        speed = floats(records, "speed_through_water")[rows].astype(np.float32)
        source = ColumnDataSource({"time": 1e3 * seconds(records["time"])[rows], "value": speed})
        _tagged(plots["speed"].scatter("time", "value", source=source, size=3, color=SENSOR), "sensor")
    return bool(rows.size)


def _stored(plots: Mapping[str, figure], stored: pd.DataFrame, turns: list[series.Apex]) -> bool:
    """Draw the vehicle's own solution; return whether there is any."""
    speed = floats(stored, "speed")
    known = np.isfinite(speed)
    if known.any():
        source = _line(seconds(stored["time"])[known], speed[known], turns, 2.0 * GAP)
        _tagged(plots["speed"].line("time", "value", source=source, color=STORED, line_width=1.2), "stored")
    return bool(known.any())


def _theory(plots: Mapping[str, figure], blocks: pd.DataFrame, predictions: pd.DataFrame) -> bool:
    """Draw theory with the measured pitch held for each steady block; return whether there is any."""
    from bokeh.models import ColumnDataSource

    held = predictions[(predictions["trim"] == "pitch") & np.isfinite(floats(predictions, "speed"))]
    held = held[["block", "speed", "angle_of_attack"]].merge(blocks[["block", "start", "end"]], on="block")
    if len(held):
        ends = {name: 1e3 * seconds(held[name]) for name in ("start", "end")}
        source = ColumnDataSource(
            {**ends, "speed": floats(held, "speed"), "alpha": DEGREES * floats(held, "angle_of_attack")}
        )
        for panel in ("speed", "alpha"):
            line = plots[panel].segment("start", panel, "end", panel, source=source, color=HELD, line_width=3)
            _tagged(line, "held")
    return bool(len(held))

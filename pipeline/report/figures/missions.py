"""The figures of a campaign: gaps between theory and measurement, and coefficients, mission by mission in time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes

from pipeline.report.figures.drawing import (
    FORCE,
    HELD,
    INK,
    MARKERS,
    MEASURED,
    VOID,
    WIDTH,
    Picture,
    canvas,
    render,
    style,
)

#: Missions named along the axis at most; of more, every second, third … is named.
NAMED = 14
#: |E|/u_val beyond which a mark is filled.
SIGNIFICANT = 2.0
#: Why a figure is not there.
NO_FIGURE = {
    "gaps": "no mission has both a measured and a predicted speed",
    "coefficients": "no correction was fitted or adjusted in any mission",
}


def draw(content: Mapping[str, Any]) -> dict[str, Picture | None]:
    """Return the figures of index.html by name, None where there is nothing to draw.

    Parameters
    ----------
    content
        As from `pipeline.report.overview.overview`.
    """
    missions = sorted(content["missions"], key=lambda row: (row["vehicle"], row["start"], row["mission"]))
    return {"gaps": gaps(missions), "coefficients": coefficients(missions, content["vehicles"])}


def gaps(missions: Sequence[Mapping[str, Any]]) -> Picture | None:
    """Return E with u_val of every part of every mission, None if there is none.

    Parameters
    ----------
    missions
        Rows of the overview, in the order of the axis.
    """
    rows = [
        (place + 0.16 * (k - 0.5 * (len(mission["parts"]) - 1)), part)
        for place, mission in enumerate(missions)
        for k, part in enumerate(mission["parts"])
        if math.isfinite(part["error_cm_s"]) and math.isfinite(part["u_val_cm_s"])
    ]
    if not rows:
        return None
    with style():
        figure = canvas(WIDTH, 3.9)
        axes = figure.subplots()
        for kind, marker in (("dive", MARKERS[-1]), ("climb", MARKERS[1]), ("under propeller", MARKERS[0])):
            own = [(x, part) for x, part in rows if _kind(part) == kind]
            for significant in (False, True):
                shown = [(x, part) for x, part in own if (part["significance"] > SIGNIFICANT) is significant]
                if not shown:
                    continue
                axes.errorbar(
                    [x for x, _ in shown], [part["error_cm_s"] for _, part in shown],
                    yerr=[part["u_val_cm_s"] for _, part in shown], color=HELD, marker=marker, markersize=7,
                    markerfacecolor=HELD if significant else "none", linestyle="none", capsize=3,
                    label=kind + (", significant" if significant else ""),
                )  # fmt: skip
        axes.axhline(0.0, color=INK, linewidth=0.9, linestyle="--")
        axes.set_ylabel("E = theory − measured speed,\ncm/s (bars: u_val)")
        _named(axes, missions)
        figure.legend(loc="outside upper center", ncols=4)
        svg = render(figure, "gaps")
    worst = max((part["significance"] for _, part in rows if math.isfinite(part["significance"])), default=math.nan)
    return Picture(
        "gaps",
        svg,
        f"Theory less measured speed in {len(rows)} parts of {len(missions)} missions; the greatest ratio to its "
        f"uncertainty is {worst:.1f}.",
        "Theory with the measured pitch held less measured speed, in every part of every mission, in time, with the "
        "validation uncertainty u_val. Filled: beyond 2 u_val.",
    )


def coefficients(missions: Sequence[Mapping[str, Any]], vehicles: Sequence[Mapping[str, Any]]) -> Picture | None:
    """Return what every mission says of each coefficient, one panel each, with the vehicle's; None if nothing is said.

    Parameters
    ----------
    missions
        Rows of the overview, in the order of the axis.
    vehicles
        As from `pipeline.report.fleet.fleet`.
    """
    items = [item for mission in missions for item in mission["coefficients"]]
    known = [item for item in items if math.isfinite(item["std"]) or math.isfinite(item["force_std"])]
    panels = {item["name"]: f"{item['symbol']}, {item['unit']}" for item in known}
    if not panels:
        return None
    with style():
        figure = canvas(WIDTH, 1.4 + 1.75 * len(panels))
        rows = dict(zip(panels, figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0], strict=True))
        for name, axes in rows.items():
            _vehicles(axes, name, missions, vehicles)
            for key, shift, colour, marker, label in (
                ("", -0.09, MEASURED, "o", "fitted to blocks, data alone"),
                ("force_", 0.09, FORCE, "D", "adjusted by the force estimate"),
            ):
                seen = [
                    (place + shift, item[f"{key}value"], item[f"{key}std"])
                    for place, mission in enumerate(missions)
                    for item in mission["coefficients"]
                    if item["name"] == name and math.isfinite(item[f"{key}std"])
                ]
                if seen:
                    x, value, std = zip(*seen, strict=True)
                    axes.errorbar(x, value, yerr=std, color=colour, marker=marker, markersize=6, linestyle="none",
                                  capsize=3, label=label)  # fmt: skip
            axes.axhline(0.0, color=HELD, linewidth=1.0, linestyle="--", label="vehicle file, ballast as given")
            axes.set_ylabel(panels[name])
        _named(next(reversed(rows.values())), missions)
        labels = {
            label: handle
            for axes in rows.values()
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(labels.values(), labels.keys(), loc="outside upper center", ncols=2)
        svg = render(figure, "coefficients")
    return Picture(
        "coefficients",
        svg,
        f"{'; '.join(panels.values())}: what each of {len(missions)} missions says, with 1-sigma.",
        "Each mission's corrections to the vehicle file with 1σ, in time: blue circles by the fit to steady blocks, "
        "from the data alone; brown diamonds as the force estimate was adjusted, priors included. Grey: the vehicle's "
        "mean with 1σ, where two missions or more determine it.",
    )


def _vehicles(
    axes: Axes, name: str, missions: Sequence[Mapping[str, Any]], vehicles: Sequence[Mapping[str, Any]]
) -> None:
    """Draw the mean of each vehicle with its 1-sigma behind its missions."""
    for vehicle in vehicles:
        item = next((item for item in vehicle["coefficients"] if item["name"] == name and not item["reason"]), None)
        if item is None:
            continue
        places = [place for place, mission in enumerate(missions) if mission["vehicle"] == vehicle["vehicle"]]
        value, std = shown(item)
        if math.isfinite(value):
            axes.fill_between([min(places) - 0.4, max(places) + 0.4], value - std, value + std, color=VOID, alpha=0.35,
                              linewidth=0, label="the vehicle, all missions together")  # fmt: skip


def shown(item: Mapping[str, Any]) -> tuple[float, float]:
    """Return the vehicle's change of a coefficient and its 1-sigma as the figure has it, relative ones in %."""
    base = item["vehicle_value"]
    if item["name"] == "thrust_scale":
        return 100.0 * item["value"], 100.0 * item["std"]
    if item["unit"] and base != 0.0 and math.isfinite(base):
        return 100.0 * (item["value"] - base) / base, abs(100.0 * item["std"] / base)
    return item["value"] - base, item["std"]


def _kind(part: Mapping[str, Any]) -> str:
    if part["powered"]:
        return "under propeller"
    return "dive" if part["pitch_deg"] < 0.0 else "climb"


def _named(axes: Axes, missions: Sequence[Mapping[str, Any]]) -> None:
    """Write the names of the missions and their dates along the axis."""
    step = math.ceil(len(missions) / NAMED)
    places = range(0, len(missions), step)
    words = [f"{missions[k]['mission']}\n{missions[k]['start']}" for k in places]
    crowded = len(places) > 4
    axes.set_xticks(places, words, rotation=35 if crowded else 0, ha="right" if crowded else "center", fontsize=8)
    axes.set_xlim(-0.6, len(missions) - 0.4)
    axes.grid(axis="x", visible=False)

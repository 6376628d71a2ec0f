"""The figures of a campaign: gaps between theory and measurement, and coefficients, mission by mission in time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from pipeline.records import Column
from pipeline.report.compare import SIGNIFICANT
from pipeline.report.figures.drawing import (
    FORCE,
    HELD,
    INK,
    MARKERS,
    MEASURED,
    VOID,
    WIDTH,
    Drawn,
    Picture,
    canvas,
    picture,
    style,
)

#: Missions named along the axis at most; of more, every second, third … is named.
NAMED = 14
#: Of which mission a row is; the first columns of both tables.
MISSION = (
    Column("mission", "", "name of the mission", "string"),
    Column("vehicle", "", "vehicle", "string"),
    Column("start", "", "first record, UTC", "string"),
)
GAPS = (
    *MISSION,
    Column("part", "", "part of the mission", "string"),
    Column("powered", "", "whether it was flown under propeller", "bool"),
    Column("pitch_deg", "degrees", "mean pitch, nose up positive"),
    Column("error_cm_s", "cm/s", "E, theory with the measured pitch held less measured speed"),
    Column("u_val_cm_s", "cm/s", "u_val, validation uncertainty of error_cm_s"),
    Column("significance", "1", "|E|/u_val"),
)
COEFFICIENTS = (
    *MISSION,
    Column("coefficient", "", "name of the coefficient", "string"),
    Column("unit", "", "unit of the values of the row", "string"),
    Column("value", "as in unit", "change of the vehicle file by the fit to steady blocks, from the data alone"),
    Column("std", "as in unit", "1-sigma of value"),
    Column("force_value", "as in unit", "the same as the force estimate was adjusted, priors included"),
    Column("force_std", "as in unit", "1-sigma of force_value"),
    Column("vehicle_value", "as in unit", "mean of the vehicle's missions; NaN where they do not determine it"),
    Column("vehicle_std", "as in unit", "1-sigma of vehicle_value"),
)


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
        worst = max((part["significance"] for _, part in rows if math.isfinite(part["significance"])), default=math.nan)
        return picture(
            figure,
            "gaps",
            f"Theory less measured speed in {len(rows)} parts of {len(missions)} missions; the greatest ratio to its "
            f"uncertainty is {worst:.1f}.",
            "Theory with the measured pitch held less measured speed, in every part of every mission, by vehicle and "
            f"in time, with the validation uncertainty u_val. Filled: beyond {SIGNIFICANT:.0f} u_val.",
            Drawn(_gaps(missions), GAPS),
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
    panels = {
        (item["name"], item["unit"]): f"{item['symbol']}, {item['unit']}"
        for mission in missions
        for item in mission["coefficients"]
        if math.isfinite(item["std"]) or math.isfinite(item["force_std"])
    }
    if not panels:
        return None
    table = _coefficients(missions, vehicles)
    with style():
        figure = canvas(WIDTH, 1.4 + 1.75 * len(panels))
        rows = dict(zip(panels, figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0], strict=True))
        for (name, unit), axes in rows.items():
            own = table[(table["coefficient"] == name) & (table["unit"] == unit)]
            _vehicles(axes, own)
            for key, shift, colour, marker, label in (
                ("", -0.09, MEASURED, "o", "fitted to blocks, data alone"),
                ("force_", 0.09, FORCE, "D", "adjusted by the force estimate"),
            ):
                seen = own[own[f"{key}std"].notna()]
                if len(seen):
                    axes.errorbar(seen["place"] + shift, seen[f"{key}value"], yerr=seen[f"{key}std"], color=colour,
                                  marker=marker, markersize=6, linestyle="none", capsize=3, label=label)  # fmt: skip
            axes.axhline(0.0, color=HELD, linewidth=1.0, linestyle="--", label="vehicle file, ballast as given")
            axes.set_ylabel(panels[name, unit])
        _named(next(reversed(rows.values())), missions)
        labels = {
            label: handle
            for axes in rows.values()
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(labels.values(), labels.keys(), loc="outside upper center", ncols=2)
        return picture(
            figure,
            "coefficients",
            f"{'; '.join(panels.values())}: what each of {len(missions)} missions says, with 1-sigma.",
            "Each mission's corrections to the vehicle file with 1σ, by vehicle and in time: blue circles by the fit "
            "to steady blocks, from the data alone where these tell more than was known; brown diamonds as the force "
            "estimate was adjusted, priors included. Grey: the vehicle's mean with 1σ, where two missions or more "
            "determine it.",
            Drawn(table.drop(columns="place"), COEFFICIENTS),
        )


def _gaps(missions: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Return what the figure of gaps is drawn from, one row a part of a mission."""
    own = [column.name for column in GAPS[len(MISSION) + 1 :]]
    return pd.DataFrame(
        [
            {**_mission(mission), "part": part["name"], **{name: part[name] for name in own}}
            for mission in missions
            for part in mission["parts"]
        ]
    )


def _coefficients(missions: Sequence[Mapping[str, Any]], vehicles: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Return what the figure of coefficients is drawn from, one row a mission and coefficient, and its place."""
    means = {
        (vehicle["vehicle"], item["name"], unit): {"vehicle_value": value, "vehicle_std": std}
        for vehicle in vehicles
        for item in vehicle["coefficients"]
        if not item["reason"]
        for value, std, unit in [shown(item)]
    }
    nothing = {"vehicle_value": math.nan, "vehicle_std": math.nan}
    return pd.DataFrame(
        [
            {
                **_mission(mission),
                "place": place,
                "coefficient": item["name"],
                **{name: item[name] for name in ("unit", "value", "std", "force_value", "force_std")},
                **means.get((mission["vehicle"], item["name"], item["unit"]), nothing),
            }
            for place, mission in enumerate(missions)
            for item in mission["coefficients"]
        ]
    )


def _mission(mission: Mapping[str, Any]) -> dict[str, str]:
    return {column.name: mission[column.name] for column in MISSION}


def _vehicles(axes: Axes, own: pd.DataFrame) -> None:
    """Draw the mean of each vehicle with its 1-sigma behind its missions."""
    for _, group in own[own["vehicle_value"].notna()].groupby("vehicle"):
        low, high = (group["vehicle_value"] + sign * group["vehicle_std"] for sign in (-1.0, 1.0))
        axes.fill_between([group["place"].min() - 0.4, group["place"].max() + 0.4], low.iloc[0], high.iloc[0],
                          color=VOID, alpha=0.35, linewidth=0, label="the vehicle, all missions together")  # fmt: skip


def shown(item: Mapping[str, Any]) -> tuple[float, float, str]:
    """Return the vehicle's change of a coefficient, its 1-sigma and unit as the figure has it, relative ones in %."""
    whole = 1.0 if item["name"] == "thrust_scale" else item["relative_to"]
    change, std = item["value"] - item["vehicle_value"], item["std"]
    if whole and math.isfinite(whole):
        return 100.0 * change / whole, abs(100.0 * std / whole), "%"
    return change, std, item["unit"]


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

"""The answer as one figure: speed of each part of the mission, measured and by theory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from pipeline.records import Column
from pipeline.report.figures.drawing import FREE, HELD, MEASURED, SENSOR, VOID, Drawn, Picture, canvas, picture, style
from pipeline.report.propulsion import setting
from pipeline.report.rounding import signed

COLUMNS = (
    Column("part", "", "part of the mission", "string"),
    Column("net_buoyancy_N", "N", "net buoyancy force, up positive"),
    Column("propeller_speed_rpm", "rpm", "propeller speed"),
    Column("propeller_power_W", "W", "propeller power, where thrust follows from it"),
    Column("pitch_deg", "deg", "pitch, nose up positive"),
    Column("measured_speed_m_s", "m/s", "measured speed through water"),
    Column("measured_speed_std_m_s", "m/s", "1-sigma of measured_speed_m_s"),
    Column("held_speed_m_s", "m/s", "speed by theory, measured pitch held"),
    Column("held_speed_std_m_s", "m/s", "1-sigma of held_speed_m_s"),
    Column("free_speed_m_s", "m/s", "speed by theory, pitch left free"),
    Column("free_speed_std_m_s", "m/s", "1-sigma of free_speed_m_s"),
    Column("sensor_speed_m_s", "m/s", "speed by a sensor in the same blocks"),
    Column("sensor_speed_std_m_s", "m/s", "1-sigma of sensor_speed_m_s"),
    Column("stable_speed_lower_m_s", "m/s", "lower bound of the stable range, Eq. (27)"),
    Column("stable_speed_upper_m_s", "m/s", "upper bound of the stable range, Eq. (28)"),
)


def answer(parts: Sequence[Mapping[str, Any]]) -> Picture | None:
    """Return measured and predicted speed of each part of the mission side by side; None where there is none.

    Parameters
    ----------
    parts
        Rows of `nominal.table`.
    """
    speeds = [f"{key}_speed_m_s" for key in ("measured", "held", "free", "sensor")]
    if not any(math.isfinite(part[key]) for part in parts for key in speeds):
        return None
    things = (
        ("measured_speed", "measured", MEASURED, "o"),
        ("held_speed", "theory, measured pitch held", HELD, "D"),
        ("free_speed", "theory, pitch left free", FREE, "X"),
        ("sensor_speed", "speed sensor", SENSOR, "s"),
    )
    with style():
        figure = canvas(7.4, 1.5 + 0.85 * len(parts))
        axes = figure.subplots()
        seen: set[str] = set()
        for row, part in enumerate(parts):
            base = len(parts) - 1.0 - row
            if row % 2 == 0:
                axes.axhspan(base - 0.5, base + 0.5, color=VOID, alpha=0.10, linewidth=0)
            low, high = part["stable_speed_lower_m_s"], part["stable_speed_upper_m_s"]
            if math.isfinite(low) and math.isfinite(high):
                axes.plot([low, high], [base - 0.36] * 2, color=VOID, linewidth=4, solid_capstyle="butt",
                          label=None if "range" in seen else "stable range, (27), (28)")  # fmt: skip
                seen.add("range")
            for place, (key, label, colour, marker) in enumerate(things):
                value, std = part[f"{key}_m_s"], part[f"{key}_std_m_s"]
                if not math.isfinite(value):
                    continue
                axes.errorbar(
                    value, base + 0.3 - 0.17 * place, xerr=std if math.isfinite(std) else None, color=colour,
                    marker=marker, markersize=7, capsize=3, linestyle="none", label=None if key in seen else label,
                )  # fmt: skip
                seen.add(key)
            if not math.isfinite(part["measured_speed_m_s"]):
                axes.annotate(
                    part["measured_reason"], (0.01, base + 0.36), xycoords=("axes fraction", "data"), fontsize=8,
                    va="top", color=MEASURED,
                )  # fmt: skip
        axes.set_yticks(range(len(parts)), [_wrapped(part) for part in reversed(parts)])
        axes.set_ylim(-0.55, len(parts) - 0.45)
        axes.grid(axis="y", visible=False)
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("speed through water, m/s (bars: 1σ)")
        axes.set_xlim(left=0.0)
        handles, labels = axes.get_legend_handles_labels()
        order = sorted(range(len(labels)), key=lambda i: labels[i].startswith("stable"))
        figure.legend([handles[i] for i in order], [labels[i] for i in order], loc="outside upper center", ncols=2)
        return picture(figure, "answer", _alt(parts), _caption(seen), _table(parts))


def _alt(parts: Sequence[Mapping[str, Any]]) -> str:
    words = [
        f"{part['name']}: measured {_value(part['measured_speed_m_s'])}, pitch held {_value(part['held_speed_m_s'])}, "
        f"pitch free {_value(part['free_speed_m_s'])} m/s"
        for part in parts
    ]
    return "Speeds of each part of the mission, measured and by theory. " + "; ".join(words) + "."


def _caption(seen: set[str]) -> str:
    caption = "Measured speed (blue) beside theory with the measured pitch held (orange diamonds)"
    if "free_speed" in seen:
        caption += " and with the pitch left free at α = −K_M0/K_M (purple crosses)"
    caption += ". Bars are 1σ"
    if "sensor_speed" in seen:
        caption += "; green squares: the speed sensor in the same blocks"
    if "range" in seen:
        caption += "; the grey bar is the stable range of the paper's inequalities with the pitch left free"
    return caption + "."


def _table(parts: Sequence[Mapping[str, Any]]) -> Drawn:
    frame = pd.DataFrame(list(parts)).rename(columns={"name": "part"})
    return Drawn(frame[[column.name for column in COLUMNS]], COLUMNS)


def _wrapped(part: Mapping[str, Any]) -> str:
    settings = f"{signed(part['net_buoyancy_N'])} N"
    driving = setting(part["propeller_speed_rpm"], part["propeller_power_W"])
    settings += f", {driving}" if driving else ""
    if math.isfinite(part["pitch_deg"]):
        settings += f", {signed(part['pitch_deg'])}°"
    return f"{part['name']}\n{settings}"


def _value(number: float) -> str:
    return f"{number:.3f}" if math.isfinite(number) else "unknown"

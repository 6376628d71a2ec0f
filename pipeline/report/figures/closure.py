"""What fixes say of each model's speed: what it lacks on each heading, and by what share it must change."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from pipeline.records import Column
from pipeline.report.figures.drawing import (
    FORCE,
    HELD,
    INK,
    MEASURED,
    MOST_MARKS,
    STORED,
    WIDTH,
    Drawn,
    Picture,
    canvas,
    picture,
    style,
)

COLOURS = {"theory": HELD, "kinematic": MEASURED, "force": FORCE, "stored": STORED}
MARKS = {"theory": "s", "kinematic": "o", "force": "D", "stored": "v"}
COLUMNS = (
    Column("model", "", "theory, kinematic, force or stored", "string"),
    Column("dive", "", "dive number", "int32"),
    Column("used", "", "whether the passage entered", "bool"),
    Column("direction", "degrees", "direction flown, true"),
    Column("speed", "m/s", "horizontal speed by the model"),
    Column("along", "m/s", "over ground less constant current less model, along the direction flown"),
    Column("across", "m/s", "the same across it, clockwise"),
    Column("beta", "1", "relative change that the model's speed needs; NaN where not determined"),
    Column("beta_std", "1", "1-sigma of beta"),
    Column("label", "", "independent, or circular where the model has used the fixes", "string"),
)


def closure(found: Mapping[str, Any]) -> Picture | None:
    """Return what each model lacks along the direction flown, by direction, and β of each with its interval.

    Parameters
    ----------
    found
        ``closure`` of summary.json.
    """
    if found["reason"]:
        return None
    with style():
        figure = canvas(WIDTH, 4.0)
        left, right = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
        many = len(found["passages"]) * len(found["models"]) > MOST_MARKS
        for row in found["models"]:
            name = row["model"]
            own = [item["models"][name] for item in found["passages"] if item["models"][name]["used"]]
            left.plot(
                [item["direction_deg"] for item in own],
                [100.0 * item["along_m_s"] for item in own],
                marker=MARKS[name], markersize=6, linestyle="none", color=COLOURS[name], label=name,
                alpha=0.9, rasterized=many,
            )  # fmt: skip
        left.axhline(0.0, color=INK, linewidth=0.9, linestyle="--")
        left.set_xlim(0.0, 360.0)
        left.set_xticks(np.arange(0, 361, 90), ["N", "E", "S", "W", "N"])
        left.set_xlabel("direction flown, true")
        left.set_ylabel("over ground − current − model,\nalong the direction flown, cm/s")
        left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
        places = np.arange(len(found["models"]))[::-1]
        for place, row in zip(places, found["models"], strict=True):
            colour = COLOURS[row["model"]]
            if row["reason"]:
                right.text(0.0, float(place), "  not determined", va="center", color=colour)
                continue
            right.errorbar(
                100.0 * row["beta"], place, xerr=196.0 * row["beta_std"], color=colour, marker=MARKS[row["model"]],
                capsize=3, markersize=6, fillstyle="none" if row["label"] == "circular" else "full",
            )  # fmt: skip
        right.axvline(0.0, color=INK, linewidth=0.9, linestyle="--")
        right.set_yticks(places, [row["model"] for row in found["models"]])
        right.set_ylim(-0.6, len(places) - 0.4)
        right.set_xlabel("β, change that the speed needs, %")
        verdicts = "; ".join(f"{row['meaning']}: {row['verdict']}" for row in found["models"])
        return picture(
            figure,
            "closure",
            f"What fixes say of the horizontal speed. {verdicts}.",
            "Left: velocity over ground of each passage between fixes, less the constant part of the current and less "
            "the model's velocity through water, along the direction flown: points above the line on all headings are "
            "of a model that is too slow. Right: β of each model with its 95 % interval; open where the model has used "
            "the fixes itself.",
            Drawn(_table(found), COLUMNS),
        )


def _table(found: Mapping[str, Any]) -> pd.DataFrame:
    """Return what is drawn, one row a model and passage."""
    return pd.DataFrame(
        [
            {
                "model": row["model"],
                "dive": item["dive"],
                "used": own["used"],
                "direction": own["direction_deg"],
                "speed": own["speed_m_s"],
                "along": own["along_m_s"],
                "across": own["across_m_s"],
                "beta": row["beta"],
                "beta_std": row["beta_std"],
                "label": row["label"],
            }
            for row in found["models"]
            for item in found["passages"]
            for own in [item["models"][row["model"]]]
        ]
    )

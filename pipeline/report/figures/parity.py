"""Even and odd parts of the error of each dive: which kind of cause a difference has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from pipeline.records import Column
from pipeline.report.averages import parity as parts
from pipeline.report.compare import floats
from pipeline.report.figures.drawing import (
    INK,
    MEASURED,
    MOST_MARKS,
    SENSOR,
    WIDTH,
    Drawn,
    Picture,
    canvas,
    message,
    picture,
    style,
)

COLUMNS = (
    Column("dive", "", "dive number, -1 for all", "int32"),
    Column("quantity", "", "speed: kinematic; sensor_speed: by the sensor; depth_rate: its size", "string"),
    Column("powered", "", "propeller turning", "bool"),
    Column("even", "m/s", "half the sum of a dive's and its climb's error E"),
    Column("even_u", "m/s", "1-sigma of even"),
    Column("odd", "m/s", "half the difference, dive less climb"),
    Column("odd_u", "m/s", "1-sigma of odd"),
)
PANELS = (
    ("speed through water", (("speed", "kinematic", MEASURED, "o"), ("sensor_speed", "speed sensor", SENSOR, "s"))),
    ("depth rate (its size)", (("depth_rate", "depth rate by pressure alone", INK, "o"),)),
)


def parity(comparison: pd.DataFrame, settings: Mapping[str, Any] | None) -> Picture | None:
    """Return the odd against the even part of each dive's error and of all; None without dive and climb pairs.

    Parameters
    ----------
    comparison
        The comparisons of `pipeline.report.compare`.
    settings
        The estimator's ``sigma_w`` and ``tau_w``.
    """
    drawn = [quantity for _title, kinds in PANELS for quantity, *_look in kinds]
    held = comparison[(comparison["trim"] == "pitch") & comparison["quantity"].isin(drawn)]
    dives, all_of_them = parts(held, settings, by_dive=True), parts(held, settings)
    if dives.empty:
        return None
    with style():
        figure = canvas(WIDTH, 4.4)
        for axes, (title, kinds) in zip(figure.subplots(1, 2), PANELS, strict=True):
            axes.set(title=title, xlabel="even part of E, cm/s: drag, lift, thrust")
            axes.axhline(0.0, color=INK, linewidth=0.9, linestyle="--")
            axes.axvline(0.0, color=INK, linewidth=0.9, linestyle="--")
            for quantity, label, colour, marker in kinds:
                one, mean = (table[table["quantity"] == quantity] for table in (dives, all_of_them))
                _crosses(axes, one, colour, marker, f"each dive, {label}", small=True)
                _crosses(axes, mean, colour, "D", f"all dives, {label}", small=False)
            if not len(axes.get_legend_handles_labels()[0]):
                message(axes, "no dive and climb with an independent comparison")
        figure.axes[0].set_ylabel("odd part of E, cm/s:\nballast, pitch bias, moving water")
        named = {
            label: handle
            for axes in figure.axes
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(named.values(), named.keys(), loc="outside lower center", ncols=max(1, len(named) // 2))
        table = pd.concat([dives, all_of_them.assign(dive=-1)])
        return picture(
            figure,
            "parity",
            f"Odd against even part of theory less measurement in {dives['dive'].nunique()} pairs of dive and climb.",
            "Half the sum (even) and half the difference (odd) of E = theory − measured between each dive and its "
            "climb, theory with the measured pitch held, bars 1σ. What is even comes from drag, lift or thrust; what "
            "is odd from ballast, pitch bias or moving water. The measured speed borrows the lift/drag ratio; the "
            "depth rate borrows nothing.",
            Drawn(table[[column.name for column in COLUMNS]], COLUMNS),
        )


def _crosses(axes: Axes, rows: pd.DataFrame, colour: str, marker: str, label: str, *, small: bool) -> None:
    if rows.empty:
        return
    even, odd, even_u, odd_u = (100.0 * floats(rows, name) for name in ("even", "odd", "even_u", "odd_u"))
    axes.errorbar(
        even, odd, xerr=even_u, yerr=odd_u, color=colour, marker=marker, markersize=4 if small else 8,
        elinewidth=0.6 if small else 1.4, alpha=0.7 if small else 1.0, linestyle="none", label=label,
        rasterized=len(rows) > MOST_MARKS, zorder=2 if small else 3,
    )  # fmt: skip

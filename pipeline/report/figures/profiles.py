"""Profile likelihood of each correction: how fast the fit gets worse on either side of the best value."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from pipeline.records import Column
from pipeline.report.figures.drawing import HELD, INK, MEASURED, VOID, WIDTH, Drawn, Picture, canvas, picture, style
from pipeline.report.fitting.uncertainty import HALF_WIDTH

#: Δχ² up to which a profile is drawn.
MOST = 10.0
#: Panels in a row.
ACROSS = 3

COLUMNS = (
    Column("correction", "", "symbol of the correction", "string"),
    Column("value", "", "value held, in the unit of the correction"),
    Column("delta_chi_square", "1", "rise of the least chi-square with the value held"),
)


def profiles(fit: Mapping[str, Any]) -> Picture | None:
    """Return Δχ² along each correction, all others fitted anew, beside the parabola of its 1-sigma."""
    if fit["reason"] or not fit["profiles"]:
        return None
    count = len(fit["profiles"])
    rows = math.ceil(count / ACROSS)
    with style():
        figure = canvas(WIDTH, 0.9 + 2.6 * rows)
        panels = figure.subplots(rows, min(count, ACROSS), squeeze=False, sharey=True)
        for axes in panels.ravel()[count:]:
            axes.set_visible(False)
        for k, (profile, item) in enumerate(zip(fit["profiles"], fit["parameters"], strict=True)):
            axes = panels.ravel()[k]
            value = np.asarray(profile["value"])
            axes.plot(value, profile["delta_chi_square"], color=MEASURED, marker="o", markersize=3.5, label="profile")
            fine = np.linspace(value[0], value[-1], 101)
            parabola = ((fine - item["value"]) / item["std"]) ** 2
            axes.plot(fine, parabola, color=VOID, linestyle=":", label="parabola of the 1σ")
            axes.axhline(HALF_WIDTH, color=INK, linewidth=0.8, linestyle="--")
            axes.axvline(0.0, color=INK, linewidth=0.6)
            ends = fit["bootstrap"]["interval_95"][k]
            if np.isfinite(ends).all():
                axes.plot(ends, [0.35, 0.35], color=HELD, linewidth=3.0, label="bootstrap by dives, 95 %")
            axes.set_xlim(value[0], value[-1])
            axes.set_ylim(0.0, MOST)
            axes.set_xlabel(f"{profile['symbol']}, {profile['unit']}")
            if k % ACROSS == 0:
                axes.set_ylabel("Δχ²")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
        resampled = "" if fit["bootstrap"]["reason"] else " Orange: 95 % of the resamples of whole dives."
        words = "; ".join(_words(profile) for profile in fit["profiles"])
        return picture(
            figure,
            "profiles",
            f"Profile likelihoods. {words}.",
            "How much worse the fit gets (Δχ², scaled to the scatter found) with one correction held beside its best "
            "value and all others fitted anew (blue); below the dashed line lies the 95 % interval. Dotted: what the "
            f"1σ alone would say.{resampled}",
            _table(fit["profiles"]),
        )


def _words(profile: Mapping[str, Any]) -> str:
    low, high = profile["interval_95"]
    if math.isfinite(low) and math.isfinite(high):
        return f"{profile['symbol']}: 95 % interval from {low:+.3g} to {high:+.3g} {profile['unit']}"
    return f"{profile['symbol']}: open on a side"


def _table(found: list[Mapping[str, Any]]) -> Drawn:
    frames = [pd.DataFrame({name: item[name] for name in ("value", "delta_chi_square")}) for item in found]
    for frame, item in zip(frames, found, strict=True):
        frame.insert(0, "correction", item["symbol"])
    return Drawn(pd.concat(frames, ignore_index=True), COLUMNS)

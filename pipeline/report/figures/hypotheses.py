"""The reasons for a difference, ranked: how probable each is, and how well it predicts dives left out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from pipeline.records import Column
from pipeline.report.figures.drawing import HELD, INK, MEASURED, VOID, WIDTH, Drawn, Picture, canvas, picture, style
from pipeline.report.fitting.judgement import POSITIVE, STRONG, VERY_STRONG

COLUMNS = (
    Column("name", "", "what may be wrong", "string"),
    Column("behind", "1", "2 ln of the evidence of the best over its own"),
    Column("delta_bic", "1", "BIC less the least"),
    Column("left_out_cm_s", "cm/s", "RMSE of the depth rate on dives left out"),
)
#: Bars end here; beyond, a reason is out of the question.
MOST = 20.0


def hypotheses(ranking: Mapping[str, Any]) -> Picture | None:
    """Return the ranking of the reasons as bars, the most probable on top."""
    rows = [row for row in ranking["rows"] if math.isfinite(row["ratio"])]
    if not rows:
        return None
    best = max(row["ratio"] for row in rows)
    frame = pd.DataFrame(
        {
            "name": [row["name"] for row in rows],
            "behind": [best - row["ratio"] for row in rows],
            "delta_bic": [row["delta_bic"] for row in rows],
            "left_out_cm_s": [100.0 * row["left_out_rmse_m_s"] for row in rows],
        }
    )
    place = np.arange(len(rows))
    leading = frame["behind"].to_numpy() < STRONG
    with style():
        figure = canvas(WIDTH, 1.2 + 0.34 * len(rows))
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1.6, 1.0))
        behind = np.minimum(frame["behind"], MOST)
        left.barh(place, behind + 0.12, height=0.62, color=np.where(leading, HELD, VOID), label="2 ln of probability")
        left.plot(
            np.minimum(frame["delta_bic"], MOST), place, marker="o", markersize=6, linestyle="none",
            markerfacecolor="none", markeredgecolor=INK, label="BIC",
        )  # fmt: skip
        for limit, words in ((POSITIVE, "positive"), (STRONG, "strong"), (VERY_STRONG, "very strong")):
            left.axvline(limit, color=INK, linewidth=0.7, linestyle="--")
            left.annotate(words, (limit, 1.0), xycoords=("data", "axes fraction"), xytext=(3, 2),
                          textcoords="offset points", fontsize=8.5)  # fmt: skip
        left.set_yticks(place, frame["name"])
        left.invert_yaxis()
        left.set_xlim(0.0, MOST + 0.6)
        left.set_xlabel(f"behind the best, cut at {MOST:.0f}: evidence against the reason")
        left.legend(loc="lower right")
        right.barh(place, frame["left_out_cm_s"], height=0.62, color=MEASURED)
        right.set_xlabel("RMSE of the depth rate on dives left out, cm/s")
        return picture(
            figure,
            "hypotheses",
            f"Reasons by falling probability: {', '.join(frame['name'])}. {ranking['verdict']}",
            "Left: how far each reason falls behind the most probable, in 2 ln of its probability (bars, orange where "
            "less than 6 behind) and in BIC (rings); dashed the steps of Kass and Raftery. Right: depth rate measured "
            "less predicted on dives that the reason was not fitted to.",
            Drawn(frame, COLUMNS),
        )

"""The corrections that the fit found: confidence ellipse and residuals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from pipeline.records import Column, timestamps
from pipeline.report.figures.drawing import (
    HELD,
    INK,
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
from pipeline.report.rounding import amount

COLUMNS = (
    Column("time", "", "middle of the block, UTC", "datetime64[ns, UTC]"),
    Column("before_m_s", "m/s", "depth rate, measured less predicted, before the corrections"),
    Column("after_m_s", "m/s", "the same after the corrections"),
    Column("std_m_s", "m/s", "1-sigma of either: measurement and moving water"),
)


def corrections(fit: Mapping[str, Any]) -> Picture | None:
    """Return the confidence ellipse of the first two corrections with their prior, and residuals before and after."""
    if fit["reason"] or len(fit["parameters"]) < 2:
        return None
    first, second = fit["parameters"][:2]
    residuals = fit["residuals"]
    time = np.asarray(residuals["time_s"], dtype=np.float64)
    middle, unit = clock(time, float(time[0]))
    with style():
        figure = canvas(WIDTH, 4.2)
        left, right = figure.subplots(1, 2, width_ratios=(1, 1.35))
        centre = np.array([first["value"], second["value"]])
        covariance = np.asarray(fit["covariance"], dtype=np.float64)[:2, :2]
        for scale, alpha, label in ((2.4477, 0.15, "data alone, 95 %"), (1.5096, 0.3, "data alone, 68 %")):
            left.fill(*_ellipse(centre, covariance, scale), color=MEASURED, alpha=alpha, linewidth=0, label=label)
        left.plot(*centre, marker="o", color=MEASURED, linestyle="none")
        with_prior = [item["value_with_prior"] for item in (first, second)]
        left.plot(*with_prior, marker="P", markersize=8, color=HELD, linestyle="none", label="with prior")
        prior = np.array([first["prior_std"], second["prior_std"]])
        if np.all(np.isfinite(prior)):
            left.plot(
                *_ellipse(np.zeros(2), np.diag(prior**2), 2.4477), color=VOID, linestyle="--", label="prior, 95 %"
            )
        left.axhline(0.0, color=INK, linewidth=0.6)
        left.axvline(0.0, color=INK, linewidth=0.6)
        left.set_xlabel(f"{first['symbol']}, {first['unit']}")
        left.set_ylabel(f"{second['symbol']}, {second['unit']}")
        for key, colour, marker, label in (
            ("before_m_s", VOID, "o", "before"),
            ("after_m_s", MEASURED, "D", "after"),
        ):
            values = 100 * np.asarray(residuals[key], dtype=np.float64)
            errors = 100 * np.asarray(residuals["std_m_s"], dtype=np.float64) if key == "after_m_s" else None
            label = f"{label}, RMS {np.sqrt(np.mean(values**2)):.2f} cm/s"
            right.errorbar(
                middle, values, yerr=errors, color=colour, marker=marker, markersize=4, linestyle="none",
                elinewidth=0.6, alpha=0.85, rasterized=time.size > MOST_MARKS, label=label,
            )  # fmt: skip
        right.axhline(0.0, color=INK, linewidth=0.9, linestyle="--")
        right.set_ylabel("measured − predicted depth rate, cm/s")
        right.set_xlabel(since(float(time[0]), unit))
        left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
        right.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
        return picture(
            figure,
            "corrections",
            f"Confidence ellipse of {first['symbol']} = {amount(first['value'], first['std'])} {first['unit']} and "
            f"{second['symbol']} = {amount(second['value'], second['std'])} {second['unit']}; residuals of "
            "the depth rate before and after the corrections.",
            "Left: what the data alone say of the two corrections (ellipses), the vehicle file's prior (dashed) and "
            "both together (orange cross). Right: depth rate of each block, measured less predicted, before and after "
            "the corrections, with the 1σ of measurement and moving water.",
            _table(residuals),
        )


def _table(residuals: Mapping[str, Any]) -> Drawn:
    frame = pd.DataFrame({name: residuals[name] for name in ("before_m_s", "after_m_s", "std_m_s")})
    frame.insert(0, "time", timestamps(np.asarray(residuals["time_s"], dtype=np.float64)))
    return Drawn(frame, COLUMNS)


def _ellipse(centre: Array, covariance: Array, scale: float) -> tuple[Array, Array]:
    """Return the points of the ellipse of `scale` standard deviations."""
    angle = np.linspace(0.0, 2.0 * math.pi, 181)
    values, vectors = np.linalg.eigh(covariance)
    circle = np.sqrt(np.maximum(values, 0.0))[:, np.newaxis] * np.stack([np.cos(angle), np.sin(angle)])
    points = centre[:, np.newaxis] + scale * vectors @ circle
    return points[0], points[1]

"""Flight against time, as Figs. 13 and 14 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import NDArray

from pipeline.records import ESTIMATES, conform, seconds, usable
from pipeline.report.compare import floats
from pipeline.report.figures.drawing import (
    FORCE,
    HELD,
    MEASURED,
    POINTS,
    SENSOR,
    STORED,
    VOID,
    WIDTH,
    Drawn,
    Picture,
    canvas,
    clock,
    envelope,
    gap,
    message,
    picture,
    scale,
    shade,
    since,
    spans,
    style,
    thin,
    with_gaps,
)

if TYPE_CHECKING:
    from pipeline.table import Columns


class Look(NamedTuple):
    """How an estimate is drawn: colour, opacity of its band, height of its line over others, what it is called."""

    colour: str
    band: float
    height: float
    label: str
    short: str


KINEMATIC = Look(MEASURED, 0.22, 2.4, "measured (kinematic)", "measured")
BY_FORCE = Look(FORCE, 0.16, 2.2, "theory, adjusted (force)", "adjusted")
#: Panels of the figure of flight in words.
WORDS = {
    "alpha": "angle of attack",
    "water": "vertical velocity of the water",
    "engine": "buoyancy engine",
    "propeller": "propeller speed",
}
#: Dives shown in the figure of flight, from the middle of the mission.
SHOWN_DIVES = 3
#: A mission no longer than this is shown whole, s.
SHOWN_WHOLE = 6 * 3600.0


def window(records: Columns) -> tuple[float, float, str]:
    """Return the stretch of time that the figure of flight shows, POSIX s, and what it is in words."""
    time = seconds(records["time"])
    dive = records["dive"].to_numpy()
    dives = np.unique(dive[dive > 0])
    if dives.size <= SHOWN_DIVES or time[-1] - time[0] <= SHOWN_WHOLE:
        return float(time[0]), float(time[-1]), "the whole mission"
    first = (dives.size - SHOWN_DIVES) // 2
    chosen = dives[first : first + SHOWN_DIVES]
    inside = time[np.isin(dive, chosen)]
    return float(inside[0]), float(inside[-1]), f"dives {chosen[0]} to {chosen[-1]} of {dives.size}"


def flight(
    records: Columns,
    estimates: Columns,
    force: Columns,
    blocks: pd.DataFrame,
    predictions: pd.DataFrame,
    stored: pd.DataFrame | None,
) -> Picture | None:
    """Return depth, pitch, engines and what was estimated against time, as Figs. 13 and 14 of the paper.

    Parameters
    ----------
    records
        Canonical records; None is returned without.
    estimates, force
        Estimates by the kinematic and by the force method; the latter may be empty.
    blocks, predictions
        Theory of each steady block.
    stored
        The vehicle's own solution, or None.
    """
    if records.empty or estimates.empty:
        return None
    begin, end, shown = window(records)
    part = _between(records, begin, end)
    guesses = [(look, _between(table, begin, end)) for look, table in ((KINEMATIC, estimates), (BY_FORCE, force))]
    time = seconds(part["time"])
    hours, unit = clock(time, begin)
    panels = ["depth", "pitch", "speed", "alpha", "water"]
    if np.isfinite(floats(part, "buoyancy_volume")).any():
        panels.append("engine")
    if (np.nan_to_num(floats(part, "propeller_speed")) > 0).any():
        panels.append("propeller")
    with style():
        figure = canvas(WIDTH, 1.0 + 1.45 * len(panels) + 0.6)
        axes = dict(zip(panels, figure.subplots(len(panels), sharex=True, height_ratios=_heights(panels)), strict=True))
        for name, column, factor, label in (
            ("depth", "depth", 1.0, "depth, m"),
            ("pitch", "pitch", 180.0 / np.pi, "pitch, °"),
            ("engine", "buoyancy_volume", 1e6, "engine,\ncm³"),
            ("propeller", "propeller_speed", 60.0, "propeller,\nrpm"),
        ):
            if name in axes:
                values = np.where(
                    usable(part, "pressure" if column == "depth" else column), floats(part, column), np.nan
                )
                steps: dict[str, Any] = {"drawstyle": "steps-post"} if name in ("engine", "propeller") else {}
                axes[name].plot(
                    *thin(*with_gaps(hours, factor * values, gap(unit))), color=MEASURED, linewidth=1.0, **steps
                )
                axes[name].set_ylabel(label)
        axes["depth"].invert_yaxis()
        _speed_panel(axes["speed"], guesses, part, blocks, predictions, stored, (begin, end), unit)
        for name, column, factor, label in (
            ("alpha", "angle_of_attack", 180.0 / np.pi, "angle of\nattack, °"),
            ("water", "vertical_water_velocity", 100.0, "water, up,\ncm/s"),
        ):
            for look, table in guesses:
                _estimated(axes[name], table, column, factor, look, begin, unit)
            axes[name].axhline(0.0, color=VOID, linewidth=0.6)
            axes[name].set_ylabel(label)
            reach = 1.3 * max(_reach(table, column, factor, 90.0, sigmas=2.0) for _, table in guesses) or 1.0
            axes[name].set_ylim(-reach, reach)
        lost = ~guesses[0][1]["observable"].to_numpy(dtype=bool)
        stretches = spans(clock(seconds(guesses[0][1]["time"]), begin)[0], lost, least=scale(unit) * 10.0)
        shade(axes["speed"], stretches[:500], "speed not observable (kinematic)")
        if axes["speed"].get_legend_handles_labels()[0]:
            axes["speed"].legend(
                loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, borderaxespad=0.2, columnspacing=1.4
            )
        axes[panels[-1]].set_xlabel(since(begin, unit))
        axes[panels[-1]].margins(x=0.01)
        figure.align_ylabels(list(axes.values()))
        by_theory = bool(np.isfinite(floats(predictions, "speed")).any())
        words, caption = _words(panels, shown, lost, both=len(force) > 0, by_theory=by_theory)
        table = pd.concat([conform(table, ESTIMATES) for _look, table in guesses])
        return picture(figure, "flight", words, caption, Drawn(table, ESTIMATES))


def _words(
    panels: Sequence[str], shown: str, lost: NDArray[np.bool_], *, both: bool, by_theory: bool
) -> tuple[str, str]:
    """Return the alternative text and the caption."""
    share = float(lost.mean()) if lost.size else 0.0
    adjusted = ""
    if both:
        adjusted = (
            " Brown: theory with the parameters adjusted to this mission (the force estimate), which borrows net "
            "buoyancy, thrust and all coefficients."
        )
    logged = " and ".join(panel for panel in ("engine", "propeller") if panel in panels)
    engines = f", with the {logged} as logged" if logged else ""
    orange = ""
    if by_theory:
        orange = " Orange: theory of each steady block as in the vehicle file, with the measured pitch held."
    return (
        f"{', '.join(WORDS.get(panel, panel) for panel in panels)} against time for {shown}; the speed is not "
        f"observable by the kinematic estimate in {100 * share:.0f} % of the samples.",
        "Measured (blue) against time: depth and pitch as logged; speed, angle of attack and vertical velocity of the "
        "water by the kinematic estimate, which borrows the ratio of lift to drag alone."
        f"{adjusted} Bands are 2σ.{orange} As SVG, PNG and in print {shown}{engines}; hatched where the data do not "
        "determine the speed, so that the kinematic estimate gives none.",
    )


def _heights(panels: Sequence[str]) -> list[float]:
    return [2.2 if panel == "speed" else 0.8 if panel in ("engine", "propeller") else 1.3 for panel in panels]


def _estimated(
    axes: Axes, table: pd.DataFrame, column: str, factor: float, look: Look, begin: float, unit: str
) -> None:
    """Draw one estimated quantity with its 2-sigma band, if it is known anywhere."""
    value, std = factor * floats(table, column), factor * floats(table, f"{column}_std")
    if not np.isfinite(value).any():
        return
    hours = clock(seconds(table["time"]), begin, unit)[0]
    axes.fill_between(*envelope(hours, value - 2 * std, value + 2 * std), color=look.colour, alpha=look.band,
                      linewidth=0, label=f"2σ, {look.short}")  # fmt: skip
    axes.plot(*thin(hours, value), color=look.colour, linewidth=1.0, zorder=look.height, label=look.label)


def _reach(table: pd.DataFrame, column: str, factor: float, percent: float, *, sigmas: float = 0.0) -> float:
    """Return what the size of a quantity and so many 1-sigma stay below in that share of the samples, 0 if unknown."""
    size = factor * (np.abs(floats(table, column)) + sigmas * floats(table, f"{column}_std"))
    return float(np.nanpercentile(size, percent)) if np.isfinite(size).any() else 0.0


def _speed_panel(
    axes: Axes,
    guesses: Sequence[tuple[Look, pd.DataFrame]],
    records: pd.DataFrame,
    blocks: pd.DataFrame,
    predictions: pd.DataFrame,
    stored: pd.DataFrame | None,
    bounds: tuple[float, float],
    unit: str,
) -> None:
    begin, end = bounds
    sensed = np.where(usable(records, "speed_through_water"), floats(records, "speed_through_water"), np.nan)
    tops = [float(np.nanpercentile(sensed, 99))] if np.isfinite(sensed).any() else []
    if tops:
        own_clock = clock(seconds(records["time"]), begin, unit)[0]
        good = np.isfinite(sensed)
        step = max(1, int(good.sum() / POINTS * 4))
        axes.plot(own_clock[good][::step], sensed[good][::step], ".", markersize=2.5, color=SENSOR, label="sensor",
                  rasterized=True)  # fmt: skip
    if stored is not None:
        own = _between(stored, begin, end)
        own_clock = clock(seconds(own["time"]), begin, unit)[0]
        axes.plot(*thin(*with_gaps(own_clock, floats(own, "speed"), 2.0 * gap(unit))), color=STORED, linewidth=0.9,
                  label="stored model")  # fmt: skip
    for look, table in guesses:
        _estimated(axes, table, "speed", 1.0, look, begin, unit)
    reached = [_reach(table, "speed", 1.0, 99.0) for _, table in guesses]
    tops += [top for top in reached if top]
    if not any(reached):
        estimates = guesses[0][1]
        reasons = estimates.loc[~estimates["observable"].to_numpy(dtype=bool), "reason"]
        message(axes, f"speed not observable: {reasons.mode().iloc[0] if len(reasons) else 'no estimate'}")
    held = predictions[(predictions["trim"] == "pitch") & np.isfinite(floats(predictions, "speed"))]
    held = held[["block", "speed"]].merge(blocks[["block", "start", "end"]], on="block")
    held = held[(seconds(held["end"]) > begin) & (seconds(held["start"]) < end)]
    if len(held):
        left, right = (clock(seconds(held[name]), begin, unit)[0] for name in ("start", "end"))
        axes.hlines(floats(held, "speed"), left, right, color=HELD, linewidth=2.2, label="theory, pitch held")
        tops.append(float(floats(held, "speed").max()))
    axes.set_ylabel("speed, m/s")
    axes.set_ylim(0.0, 1.25 * max(tops) if tops else 1.0)


def _between(frame: Columns, begin: float, end: float) -> pd.DataFrame:
    time = seconds(frame["time"])
    return frame[(time >= begin) & (time <= end)]

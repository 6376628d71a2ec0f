"""The figures of a report, one module each; all are inline SVG with a text that says what is to be seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.report import Inputs
    from pipeline.report.figures.drawing import Picture

    Start = Callable[..., Callable[[], Any]]

#: Why a figure of a mission's page is not there, and one of the index.
NO_FIGURE = {
    "answer": "no part of the mission has a speed, measured or by theory",
    "track": "fewer than two fixes were logged",
    "water": "no depth was measured",
    "flight": "there are no records to draw",
    "curves": "theory has no steady flight for what was flown, or the vehicle file leaves coefficients unknown",
    "agreement": "no block has both a measured and a predicted speed",
    "hypotheses": "the reasons were not ranked",
    "corrections": "no two corrections were fitted",
    "profiles": "no correction was fitted",
    "residuals": "no correction was fitted",
    "parity": "no dive and its climb were flown alike, both gliding or both under propeller, and could be compared",
    "stability": "theory has no steady flight for any block",
    "closure": "no fixes before and after flight on a recorded heading",
}
NO_CAMPAIGN_FIGURE = {
    "gaps": "no mission has both a measured and a predicted speed",
    "coefficients": "no correction was fitted or adjusted in any mission",
}


def draw(
    inputs: Inputs, summary: Mapping[str, Any], comparison: pd.DataFrame, start: Start
) -> dict[str, Callable[[], Picture | None]]:
    """Start to draw what was found, and return what waits for each figure, by name.

    A figure is None where there is nothing to draw, for `NO_FIGURE`'s reason.

    Parameters
    ----------
    inputs
        What the earlier stages hand over.
    summary
        The content of summary.json.
    comparison
        The comparisons of `pipeline.report.compare`.
    start
        Starts a task, as `pipeline.workers.beside` does.
    """
    from pipeline.report.figures.agreement import agreement
    from pipeline.report.figures.answer import answer
    from pipeline.report.figures.closure import closure
    from pipeline.report.figures.corrections import corrections
    from pipeline.report.figures.curves import curves
    from pipeline.report.figures.hypotheses import hypotheses
    from pipeline.report.figures.parity import parity
    from pipeline.report.figures.profiles import profiles
    from pipeline.report.figures.residuals import residuals
    from pipeline.report.figures.track import track

    gps = _gps(summary["parts"])
    return {
        "answer": start(answer, summary["parts"]),
        "track": start(track, inputs.records, summary["current"]),
        "curves": start(curves, inputs.blocks, inputs.vehicle, gps),
        "agreement": start(agreement, comparison),
        "hypotheses": start(hypotheses, summary["hypotheses"]),
        "parity": start(parity, comparison, inputs.estimate.get("settings")),
        "corrections": start(corrections, summary["fit"]),
        "profiles": start(profiles, summary["fit"]),
        "residuals": start(residuals, summary["fit"]),
        "closure": start(closure, summary["closure"]),
    }


def draw_flown(inputs: Inputs, start: Start) -> dict[str, Callable[[], Picture | None]]:
    """Start to draw what was flown, for which nothing need be found, and return what waits for each figure, as `draw`.

    Parameters
    ----------
    inputs
        What the earlier stages hand over.
    start
        Starts a task, as `pipeline.workers.beside` does.
    """
    from pipeline.report.figures.flight import flight
    from pipeline.report.figures.stability import stability
    from pipeline.report.figures.water import water

    return {
        "water": start(water, inputs.records, inputs.estimates),
        "flight": start(
            flight, inputs.records, inputs.estimates, inputs.force, inputs.blocks, inputs.predictions, inputs.stored
        ),
        "stability": start(stability, inputs.blocks, inputs.predictions, inputs.vehicle),
    }


def words(pictures: Mapping[str, Picture | None], reasons: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Return what each figure says in words, for scripts: ``alt`` and ``caption``, or the ``reason`` for its absence.

    Parameters
    ----------
    pictures
        The figures by name.
    reasons
        Why one is not there, by name.
    """
    return {
        name: {"reason": reasons[name]} if picture is None else {"alt": picture.alt, "caption": picture.caption}
        for name, picture in pictures.items()
    }


def _gps(parts: list[Mapping[str, Any]]) -> tuple[float, float] | None:
    """Return the speed of level powered flight by GPS, m/s, as a part of the mission has it."""
    for part in parts:
        if part["measured_blocks"] == [-1]:
            return part["measured_speed_m_s"], part["measured_speed_std_m_s"]
    return None

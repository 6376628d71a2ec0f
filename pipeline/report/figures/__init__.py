"""The figures of a report, one module each; all are inline SVG with a text that says what is to be seen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.report import Inputs
    from pipeline.report.figures.drawing import Picture

#: Why a figure of a mission's page is not there, and one of the index.
NO_FIGURE = {
    "answer": "no part of the mission has a known net buoyancy and pitch",
    "track": "fewer than two fixes were logged",
    "water": "no depth was measured",
    "flight": "there are no records to draw",
    "curves": "theory has no steady flight for what was flown, or the vehicle file leaves coefficients unknown",
    "agreement": "no block has both a measured and a predicted speed",
    "hypotheses": "the reasons were not ranked",
    "corrections": "no two corrections were fitted",
    "profiles": "no correction was fitted",
    "residuals": "no correction was fitted",
    "parity": "no dive and its climb both have a comparison that is independent",
    "stability": "theory has no steady flight for any block",
    "closure": "no fixes before and after flight on a recorded heading",
}
NO_CAMPAIGN_FIGURE = {
    "gaps": "no mission has both a measured and a predicted speed",
    "coefficients": "no correction was fitted or adjusted in any mission",
}


def draw(inputs: Inputs, summary: Mapping[str, Any], comparison: pd.DataFrame) -> dict[str, Picture | None]:
    """Return the figures of what was found, by name; None where there is nothing to draw, for `NO_FIGURE`'s reason.

    Parameters
    ----------
    inputs
        What the earlier stages hand over.
    summary
        The content of summary.json.
    comparison
        The comparisons of `pipeline.report.compare`.
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
        "answer": answer(summary["parts"]),
        "track": track(inputs.records, summary["current"]),
        "curves": curves(inputs.blocks, inputs.vehicle, gps),
        "agreement": agreement(comparison),
        "hypotheses": hypotheses(summary["hypotheses"]),
        "parity": parity(comparison, inputs.estimate.get("settings")),
        "corrections": corrections(summary["fit"]),
        "profiles": profiles(summary["fit"]),
        "residuals": residuals(summary["fit"]),
        "closure": closure(summary["closure"]),
    }


def draw_flown(inputs: Inputs) -> dict[str, Picture | None]:
    """Return the figures of what was flown, for which nothing need be found, by name; None as in `draw`."""
    from pipeline.report.figures.flight import flight
    from pipeline.report.figures.stability import stability
    from pipeline.report.figures.water import water

    return {
        "water": water(inputs.records, inputs.estimates),
        "flight": flight(
            inputs.records, inputs.estimates, inputs.force, inputs.blocks, inputs.predictions, inputs.stored
        ),
        "stability": stability(inputs.blocks, inputs.predictions, inputs.vehicle),
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

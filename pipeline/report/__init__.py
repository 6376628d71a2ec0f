"""Stage 4: measured against theory, as numbers for a script and a page that people read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.mission import Mission
    from pipeline.report.figures.drawing import Picture
    from pipeline.table import Columns
    from pipeline.vehicle import Vehicle

__all__ = ["Inputs", "Report", "build", "index"]


@dataclass(frozen=True)
class Inputs:
    """What the earlier stages hand over.

    Attributes
    ----------
    mission, vehicle
        As resolved: the vehicle with the mission's overrides.
    records, estimates, blocks, predictions
        The canonical tables of `pipeline.records`; estimates by the kinematic method. Records and estimates may be
        in a file, see `pipeline.table`.
    force
        Estimates by the force method, empty where there are none.
    stored
        The vehicle's own flight model solution, `records.STORED`, or None.
    ingest, estimate
        The reports of these stages, each with ``findings``.
    provenance
        ``stages``: inputs, configuration and software of each stage.
    """

    mission: Mission
    vehicle: Vehicle
    records: Columns
    estimates: Columns
    force: Columns
    blocks: pd.DataFrame
    predictions: pd.DataFrame
    stored: pd.DataFrame | None
    ingest: Mapping[str, Any]
    estimate: Mapping[str, Any]
    provenance: Mapping[str, Any]


class Report(NamedTuple):
    """What is reported of a mission.

    Attributes
    ----------
    summary
        The content of summary.json.
    page
        The text of report.html.
    pictures
        The figures by name, None where there is nothing to draw.
    """

    summary: dict[str, Any]
    page: str
    pictures: dict[str, Picture | None]


def build(inputs: Inputs, start: Callable[..., Callable[[], Any]] = partial) -> Report:
    """Return what is reported of a mission.

    The same inputs give the same bytes: nothing in them depends on when or where the report is made.

    Parameters
    ----------
    inputs
        What the earlier stages hand over.
    start
        Starts a task, as `pipeline.workers.beside` does: to draw a figure.
    """
    from pipeline.report import page
    from pipeline.report.figures import NO_FIGURE, draw, draw_flown, words
    from pipeline.report.figures.interactive import interactive
    from pipeline.report.summary import summarise

    zoomed, flown = start(interactive, inputs), draw_flown(inputs, start)
    summary, comparison = summarise(inputs)
    started = {**flown, **draw(inputs, summary, comparison, start)}
    drawn = {name: finish() for name, finish in reversed(started.items())}
    live = zoomed()
    pictures = {name: drawn[name] for name in NO_FIGURE}
    summary["series"] = live.account if live is not None else None
    summary["figures"] = words(pictures, NO_FIGURE)
    return Report(summary, page.report(summary, pictures, live), pictures)


class Index(NamedTuple):
    """What is reported of a campaign.

    Attributes
    ----------
    content
        The content of index.json.
    page
        The text of index.html.
    pictures
        The figures by name, None where there is nothing to draw.
    """

    content: dict[str, Any]
    page: str
    pictures: dict[str, Picture | None]


def index(summaries: Sequence[Mapping[str, Any]]) -> Index:
    """Return what is reported of a campaign.

    Parameters
    ----------
    summaries
        The content of each summary.json; of a mission that failed, ``{"mission": name, "error": line}``.
    """
    from pipeline.report import frontpage
    from pipeline.report.figures import NO_CAMPAIGN_FIGURE, words
    from pipeline.report.figures.missions import draw
    from pipeline.report.overview import overview

    content = overview(summaries)
    pictures = draw(content)
    content["figures"] = words(pictures, NO_CAMPAIGN_FIGURE)
    return Index(content, frontpage.render(content, pictures), pictures)

"""index.html: the missions of a campaign side by side, rendered from the overview and its figures alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.report.figures import NO_CAMPAIGN_FIGURE
from pipeline.report.figures.drawing import Picture
from pipeline.report.figures.files import CAMPAIGN
from pipeline.report.guide import guide
from pipeline.report.overview import KEYS
from pipeline.report.page import environment
from pipeline.report.rounding import aligned


def render(content: Mapping[str, Any], pictures: Mapping[str, Picture | None]) -> str:
    """Return the text of index.html.

    Parameters
    ----------
    content
        The content of index.json.
    pictures
        Figures by name; None where there is nothing to draw.
    """
    words = guide()
    return aligned(environment().get_template("index.html").render(
        content=content,
        keys=KEYS,
        pictures=pictures,
        no_figure=NO_CAMPAIGN_FIGURE,
        folder=CAMPAIGN,
        guide={"sections": words["campaign_sections"], "figures": words["campaign_figures"]},
    ))  # fmt: skip

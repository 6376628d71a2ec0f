"""The figures as files: each as SVG, as PNG and, as a table, what it is drawn from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import store
from pipeline.report.figures import NO_CAMPAIGN_FIGURE, NO_FIGURE

if TYPE_CHECKING:
    from pipeline.report.figures.drawing import Picture

KINDS = ("svg", "png", "parquet")
#: Folders of the figures of a report and of the index, beside the page; no mission may have a name like the latter.
FOLDER, CAMPAIGN = "figures", "index.figures"
#: Every file of a figure that a report may have, and that the index may have.
NAMES = tuple(f"{FOLDER}/{name}.{kind}" for name in NO_FIGURE for kind in KINDS)
CAMPAIGN_NAMES = tuple(f"{CAMPAIGN}/{name}.{kind}" for name in NO_CAMPAIGN_FIGURE for kind in KINDS)


def write(
    path: Callable[[str], Path],
    pictures: Mapping[str, Picture | None],
    described: Mapping[str, str],
    folder: str = FOLDER,
) -> None:
    """Write the figures that there are, and remove those that are no longer there.

    Parameters
    ----------
    path
        Returns where one of `NAMES` or `CAMPAIGN_NAMES` is kept.
    pictures
        The figures by name.
    described
        Kept in each table beside what the figure shows, the name of the mission say.
    folder
        `FOLDER` or `CAMPAIGN`.
    """
    for name, picture in pictures.items():
        svg, png, table = (path(f"{folder}/{name}.{kind}") for kind in KINDS)
        if picture is None or picture.table is None:
            for file in (svg, png, table):
                file.unlink(missing_ok=True)
            continue
        store.write_text(svg, picture.svg)
        store.write_bytes(png, picture.png)
        words = {**described, "figure": picture.alt, "caption": picture.caption}
        store.write_table(table, picture.table.frame, picture.table.columns, words)

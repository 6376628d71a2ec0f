"""The figures as files: each as SVG, as PNG and, as a table, what it is drawn from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import store
from pipeline.report.figures import NO_FIGURE

if TYPE_CHECKING:
    from pipeline.report.figures.drawing import Picture

KINDS = ("svg", "png", "parquet")
#: Every file of a figure that a report may have.
NAMES = tuple(f"figures/{name}.{kind}" for name in NO_FIGURE for kind in KINDS)


def write(path: Callable[[str], Path], pictures: Mapping[str, Picture | None], mission: str) -> None:
    """Write the figures that there are, and remove those that are no longer there.

    Parameters
    ----------
    path
        Returns where one of `NAMES` is kept.
    pictures
        The figures by name.
    mission
        Name of the mission, kept in each table.
    """
    for name, picture in pictures.items():
        svg, png, table = (path(f"figures/{name}.{kind}") for kind in KINDS)
        if picture is None or picture.table is None:
            for file in (svg, png, table):
                file.unlink(missing_ok=True)
            continue
        store.write_text(svg, picture.svg)
        store.write_bytes(png, picture.png)
        described = {"mission": mission, "figure": picture.alt, "caption": picture.caption}
        store.write_table(table, picture.table.frame, picture.table.columns, described)

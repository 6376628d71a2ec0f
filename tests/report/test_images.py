"""Figures as images: marks, lines and bands where they were when last looked at, all text removed.

After a change that is meant, look at the figures, then ``python tests/report/test_images.py`` renews ``images/``.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.quiver import QuiverKey
from matplotlib.testing.compare import compare_images
from matplotlib.text import Text
from pages import caught, complete

from pipeline import store
from pipeline.report import Report, build, index
from pipeline.report.figures import NO_CAMPAIGN_FIGURE, NO_FIGURE, drawing
from pipeline.vehicle import load

IMAGES = Path(__file__).parent / "images"
#: Root mean square difference of pixels, of 255: lines one pixel off are found, anti-aliasing is not.
TOLERANCE = 3.0
NAMES = (*NO_FIGURE, *NO_CAMPAIGN_FIGURE)


def bare(figure: Figure) -> Figure:
    """Return the figure with its axes on their grid and without text: fonts differ between machines."""
    figure.set_layout_engine("none")
    figure.legends.clear()
    for axes in list(figure.axes):
        if axes.get_subplotspec() is None:
            axes.remove()
            continue
        axes.set_position(axes.get_subplotspec().get_position(figure))
        axes.tick_params(labelbottom=False, labelleft=False)
        if axes.get_legend() is not None:
            axes.get_legend().remove()
        for text in axes.findobj(Text):
            text.set_visible(False)
        for key in axes.findobj(QuiverKey):
            key.text.set_text("")
    return figure


def write(folder: Path, built: Report, drawn: Mapping[str, Figure]) -> None:
    """Draw every figure of a mission that has everything and of a campaign, without text, into `folder`."""
    with caught() as together:
        index(campaign(built))
    with drawing.style():
        for name, figure in (drawn | together).items():
            bare(figure).savefig(folder / f"{name}.png", dpi=40, facecolor="white", metadata={"Software": None})


def campaign(built: Report) -> list[dict[str, object]]:
    """Return summaries of the mission, of one a month later that found other values, and of one by another vehicle."""
    text = json.dumps(store.plain(built.summary))
    first, later, other = (json.loads(text) for _ in range(3))
    later |= {
        "mission": "later",
        "data": first["data"] | {"start": "2014-06-13T00:00:00Z", "end": "2014-06-14T00:00:00Z"},
    }
    for place, item in enumerate(later["fit"]["parameters"]):
        item["value"] += 2.0 * item["std"]
        item["percent"] = None if item["percent"] is None else item["percent"] + 2.0 * item["percent_std"]
        later["fit"]["joint"]["value"][place] += 2.0 * item["std"]
    for part in later["parts"]:
        part |= {"error_m_s": -0.5 * part["error_m_s"], "significance": 0.5 * part["significance"]}
    other |= {"mission": "other", "vehicle": first["vehicle"] | {"name": "other"}}
    for item in other["fit"]["parameters"]:
        if item["name"] == "parasite_drag":  # of a vehicle file that leaves it unknown
            item |= {"percent": None, "percent_std": None, "vehicle_value": None}
    return [first, later, other]


@pytest.fixture(scope="module")
def images(looked_at: tuple[Report, dict[str, Figure]], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("images")
    write(folder, *looked_at)
    return folder


def test_every_figure_of_the_pages_is_under_test(built: Report, images: Path) -> None:
    """Drawn is what has an image and what the pages know; a figure more, or one less, is seen here."""
    assert set(built.pictures) == set(NO_FIGURE)
    assert {path.stem for path in images.glob("*.png")} == {path.stem for path in IMAGES.glob("*.png")} == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_figure_looks_as_it_did(images: Path, name: str) -> None:
    assert compare_images(str(IMAGES / f"{name}.png"), str(images / f"{name}.png"), tol=TOLERANCE) is None


if __name__ == "__main__":
    IMAGES.mkdir(exist_ok=True)
    for old in IMAGES.glob("*.png"):
        old.unlink()
    with tempfile.TemporaryDirectory() as place:
        with caught() as figures:
            report = build(complete(load("petrel-ii")))
        write(Path(place), report, figures)
        for path in sorted(Path(place).glob("*.png")):
            (IMAGES / path.name).write_bytes(path.read_bytes())
            sys.stdout.write(f"{path.name}\n")

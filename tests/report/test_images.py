"""Figures as images: marks, lines and bands where they were when last looked at, all text removed.

After a change that is meant, look at the figures, then ``python tests/report/test_images.py`` renews ``images/``.
"""

from __future__ import annotations

import importlib
import sys
import tempfile
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.testing.compare import compare_images
from matplotlib.text import Text
from pages import complete

from pipeline.report import build
from pipeline.report.figures import drawing
from pipeline.vehicle import load

IMAGES = Path(__file__).parent / "images"
#: Root mean square difference of pixels, of 255: lines one pixel off are found, anti-aliasing is not.
TOLERANCE = 3.0
NAMES = ("agreement", "answer", "curves", "flight", "parity", "stability", "track", "water")


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
    return figure


def write(folder: Path) -> None:
    """Draw every figure of a mission that has everything, without text, into `folder`."""

    def caught(figure: Figure, name: str, *words: object) -> drawing.Picture:
        made = drawing.picture(figure, name, *words)  # type: ignore[arg-type]
        bare(figure).savefig(folder / f"{name}.png", dpi=40, facecolor="white", metadata={"Software": None})
        return made

    with pytest.MonkeyPatch.context() as patched:
        for name in NAMES:
            patched.setattr(importlib.import_module(f"pipeline.report.figures.{name}"), "picture", caught)
        build(complete(load("petrel-ii")))


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("images")
    write(folder)
    return folder


def test_every_figure_is_under_test(drawn: Path) -> None:
    assert {path.stem for path in drawn.glob("*.png")} == {path.stem for path in IMAGES.glob("*.png")} == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_figure_looks_as_it_did(drawn: Path, name: str) -> None:
    assert compare_images(str(IMAGES / f"{name}.png"), str(drawn / f"{name}.png"), tol=TOLERANCE) is None


if __name__ == "__main__":
    IMAGES.mkdir(exist_ok=True)
    for old in IMAGES.glob("*.png"):
        old.unlink()
    with tempfile.TemporaryDirectory() as place:
        write(Path(place))
        for path in sorted(Path(place).glob("*.png")):
            (IMAGES / path.name).write_bytes(path.read_bytes())
            sys.stdout.write(f"{path.name}\n")

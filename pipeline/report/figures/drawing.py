"""How figures are drawn: one style, one colour per thing, long series thinned, the same bytes every time."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pipeline.records import Column, timestamps

Array = NDArray[np.float64]

#: One colour per thing throughout, safe for the colour-blind (Okabe & Ito 2008).
MEASURED, HELD, FREE, SENSOR, STORED = "#0072b2", "#d55e00", "#b0578d", "#009e73", "#b8860b"
FORCE = "#7a3300"
INK, FAINT, VOID, PAPER = "#1f2933", "#d5dbe1", "#8b97a3", "#fefefe"

#: What a colour is called in the page's style sheet, which has other shades of it for a dark screen.
VARIABLES = {
    MEASURED: "measured",
    HELD: "held",
    FREE: "free",
    SENSOR: "sensor",
    STORED: "stored",
    FORCE: "force",
    INK: "ink",
    FAINT: "faint",
    VOID: "void",
    PAPER: "paper",
}

STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.facecolor": "none",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "xtick.color": INK,
    "ytick.color": INK,
    "figure.facecolor": "none",
    "savefig.facecolor": "none",
    "figure.dpi": 100,
    "savefig.dpi": 144,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "lines.linewidth": 1.3,
    "hatch.color": VOID,
    "hatch.linewidth": 0.5,
    "svg.fonttype": "path",
    "path.simplify": True,
    "axes.unicode_minus": True,
}

#: Width of a figure, inches.
WIDTH = 9.6
#: Dots per inch of a PNG.
PNG_DPI = 110
#: Points per line beyond which a series is thinned.
MOST = 3000
#: Coloured points of a quantity against time at most.
POINTS = 20_000
#: Marks with error bars beyond this many are drawn as an image.
MOST_MARKS = 400
#: A gap in a record longer than this breaks its line, s.
GAP = 120.0
#: How a dive, level flight and a climb are marked.
MARKERS = {-1: "v", 0: "s", 1: "^"}


@dataclass(frozen=True)
class Drawn:
    """What a figure is drawn from: rows for `store.write_table`, each column with its unit and meaning."""

    frame: pd.DataFrame
    columns: tuple[Column, ...]


@dataclass(frozen=True)
class Picture:
    """A figure: drawn as SVG and PNG, what is to be seen in words, a caption, and what it is drawn from.

    Attributes
    ----------
    name
        Short name, used for identifiers and files.
    svg
        The drawing, without XML header, identifiers prefixed by `name`.
    alt
        What a reader who cannot see it is told.
    caption
        What is measured, what is theory, what the bands are.
    png
        The same drawing on white; empty where no file is wanted.
    table
        What it is drawn from, None where no file is wanted.
    """

    name: str
    svg: str
    alt: str
    caption: str
    png: bytes = b""
    table: Drawn | None = None


@contextmanager
def style() -> Iterator[None]:
    """Draw in the house style, whatever a reader's own matplotlib configuration says."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


def canvas(width: float, height: float) -> Figure:
    """Return an empty figure of that size in inches, laid out by constraints."""
    return Figure(figsize=(width, height), layout="constrained")


def picture(figure: Figure, name: str, alt: str, caption: str, table: Drawn) -> Picture:
    """Return `figure` in all the forms in which it leaves the report; to be called within `style`."""
    svg, buffer = render(figure, name), io.BytesIO()
    figure.savefig(buffer, format="png", dpi=PNG_DPI, facecolor="white")
    return Picture(name, svg, alt, caption, buffer.getvalue(), table)


def render(figure: Figure, name: str) -> str:
    """Return `figure` as SVG without XML header, whose bytes do not vary."""
    buffer = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": name}):
        _settle(figure)
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', svg)
    svg = re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", svg)
    svg = re.sub(r'href="#([^"]+)"', rf'href="#{name}-\1"', svg)
    return re.sub(r"\n\s*\n", "\n", svg)


def inline(svg: str) -> str:
    """Return a drawing to stand inside the page: as wide as its place, in the colours of the page's style sheet."""
    svg = re.sub(r": (#[0-9a-f]{6})\b", lambda found: f": {_followed(found[1])}", svg)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    return re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)


def _followed(colour: str) -> str:
    variable = VARIABLES.get(colour)
    return f"var(--{variable}, {colour})" if variable else colour


def _settle(figure: Figure) -> None:
    """Lay out `figure` and round the result: the solver sums in the order of memory addresses, last digits vary."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
    figure.set_layout_engine(None)
    for axes in figure.axes:
        axes.set_position(tuple(round(bound, 6) for bound in axes.get_position().bounds))


def thin(time: Array, values: Array, most: int = MOST) -> tuple[Array, Array]:
    """Return a series thinned so that a line through it looks the same: lowest and highest of equal time bins.

    Parameters
    ----------
    time, values
        The series, shape (n,); gaps are NaN in `values` and stay gaps.
    most
        Points returned at most; a shorter series is returned as it is.
    """
    if time.size <= most:
        return time, values
    bins = most // 3
    edge = np.searchsorted(time, np.linspace(time[0], time[-1], bins + 1)[:-1], side="left")
    start = np.unique(edge)
    finite = np.isfinite(values)
    low = np.minimum.reduceat(np.where(finite, values, np.inf), start)
    high = np.maximum.reduceat(np.where(finite, values, -np.inf), start)
    present = np.logical_or.reduceat(finite, start)
    middle = time[start]
    low, high = np.where(present, low, np.nan), np.where(present, high, np.nan)
    rising = np.where(np.arange(start.size) % 2 == 0, low, high)
    falling = np.where(np.arange(start.size) % 2 == 0, high, low)
    return np.repeat(middle, 2), np.column_stack([rising, falling]).ravel()


def envelope(time: Array, low: Array, high: Array, most: int = MOST) -> tuple[Array, Array, Array]:
    """Return a band thinned so that it covers the same: lowest `low` and highest `high` of equal time bins."""
    if time.size <= most:
        return time, low, high
    start = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], most // 2 + 1)[:-1], side="left"))
    finite = np.isfinite(low) & np.isfinite(high)
    present = np.logical_or.reduceat(finite, start)
    lowest = np.minimum.reduceat(np.where(finite, low, np.inf), start)
    highest = np.maximum.reduceat(np.where(finite, high, -np.inf), start)
    return time[start], np.where(present, lowest, np.nan), np.where(present, highest, np.nan)


def with_gaps(time: Array, values: Array, longest: float) -> tuple[Array, Array]:
    """Return the finite part of a series with a NaN put in wherever nothing was measured for `longest` seconds."""
    finite = np.isfinite(values)
    t, v = time[finite], values[finite]
    breaks = np.flatnonzero(np.diff(t) > longest) + 1
    return np.insert(t, breaks, t[breaks - 1]) if breaks.size else t, np.insert(v, breaks, np.nan)


def spans(time: Array, where: NDArray[np.bool_], least: float = 0.0) -> list[tuple[float, float]]:
    """Return the stretches of `time` on which `where` holds, those shorter than `least` seconds left out."""
    if not where.any():
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    last = np.minimum(ends, time.size - 1)
    return [(float(a), float(b)) for a, b in zip(time[starts], time[last], strict=True) if b - a >= least]


def shade(axes: Axes, stretches: list[tuple[float, float]], label: str) -> None:
    """Hatch the `stretches` of the time axis: nothing is known there."""
    for i, (start, end) in enumerate(stretches):
        axes.axvspan(
            start, end, facecolor="none", edgecolor=VOID, hatch="////", linewidth=0.0, label=label if i == 0 else None
        )


def clock(time: Array, start: float, unit: str = "") -> tuple[Array, str]:
    """Return POSIX seconds as time since `start` in hours, or in days where it is long, and which of the two."""
    chosen = unit or ("days" if time.size and time[-1] - start > 3 * 86400.0 else "hours")
    return (time - start) * scale(chosen), chosen


def scale(unit: str) -> float:
    """Return hours or days per second."""
    return 1.0 / (86400.0 if unit == "days" else 3600.0)


def gap(unit: str) -> float:
    """Return the gap in a record that breaks its line, in hours or days."""
    return GAP * scale(unit)


def since(start: float, unit: str) -> str:
    """Return the label of a time axis."""
    return f"{unit} since {timestamps(np.array([start]))[0]:%Y-%m-%d %H:%M} UTC"


def message(axes: Axes, words: str) -> None:
    """Write into an empty panel why it is empty."""
    axes.text(0.5, 0.5, words, transform=axes.transAxes, ha="center", va="center", wrap=True, color=INK)

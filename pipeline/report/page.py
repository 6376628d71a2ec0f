"""The pages that people read: self-contained HTML, rendered from summary.json and the figures alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from pipeline.report.compare import DIRECTIONS
from pipeline.report.figures import NO_FIGURE
from pipeline.report.figures.drawing import Picture, inline
from pipeline.report.figures.files import FOLDER, KINDS
from pipeline.report.figures.interactive import Interactive
from pipeline.report.guide import guide
from pipeline.report.rounding import aligned, amount, counted, decimals, uncertainty

TEMPLATES = Path(__file__).parent / "templates"
#: Rows of a table of blocks on the page; all of them are in summary.json.
MOST_ROWS = 200
MISSING = "–"


class Section(NamedTuple):
    """A section of the page: templates/sections/<name>.html under its title, and what the navigation calls it."""

    name: str
    short: str
    title: str


SECTIONS = (
    Section("numbers", "Key numbers", "Key numbers"),
    Section("overview", "Mission", "The mission"),
    Section("findings", "Data quality", "Data quality"),
    Section("flight", "Flight", "Flight"),
    Section("trial", "Trial table", "The trial: published, theory, measured"),
    Section("comparison", "Comparison", "Measured against theory"),
    Section("stability", "Stable range", "Stable range"),
    Section("hypotheses", "Reasons", "Which reason explains the difference"),
    Section("fit", "Fit", "Which correction explains the difference"),
    Section("closure", "GPS closure", "Is the speed right? Fixes against every model"),
    Section("stored", "Stored model", "The vehicle's own stored model"),
    Section("force", "Force estimate", "The force estimate: theory adjusted to this mission"),
    Section("instruments", "Instruments", "Do the instruments agree?"),
    Section("observability", "Observability", "Estimates and observability"),
    Section("consistency", "Consistency", "Is the estimator consistent?"),
    Section("borrowed", "What was borrowed", "What was borrowed"),
    Section("take", "Take this with you", "Take this with you"),
    Section("methods", "Methods", "Methods"),
    Section("provenance", "Provenance", "Provenance"),
)


def report(
    summary: Mapping[str, Any], pictures: Mapping[str, Picture | None], interactive: Interactive | None = None
) -> str:
    """Return the text of report.html.

    Parameters
    ----------
    summary
        The content of summary.json.
    pictures
        Figures by name; None where there is nothing to draw.
    interactive
        Flight against time to zoom into, where there is any.
    """
    return aligned(environment().get_template("report.html").render(
        summary=summary,
        pictures=pictures,
        interactive=interactive,
        no_figure=NO_FIGURE,
        folder=FOLDER,
        sections=SECTIONS,
        guide=guide(),
        parts=_parts(summary["parts"]),
        block_rows=_block_rows(summary["comparison"]["blocks"]),
        most_rows=MOST_ROWS,
    ))  # fmt: skip


def environment() -> Environment:
    """Return the templates of the pages, with the filters that they use."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    environment.filters |= {
        "number": number,
        "spread": spread,
        "svg": svg,
        "amount": amounts,
        "sigma": sigma,
        "beside": beside,
        "counted": counted,
    }
    environment.globals |= {"kinds": KINDS}
    return environment


def number(value: Any, digits: int = 3, *, sign: bool = False) -> str:
    """Return a number with so many decimals, a true minus sign, and a dash where there is none; nothing has no sign."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return MISSING
    if isinstance(value, int):
        return str(value)
    value = round(value, digits) or 0.0
    text = f"{value:{'+' if sign and value else ''}.{digits}f}"
    return text.replace("-", "−")


def spread(value: Any, std: Any, digits: int = 3, *, sign: bool = False) -> str:
    """Return value ± 1-sigma with two digits of the latter; with so many decimals where it is not known."""
    return amount(value, std, sign=sign) if _known(value) and _known(std) else number(value, digits, sign=sign)


def amounts(value: Any, std: Any, *, sign: bool = False) -> str:
    """Return value ± 1-sigma with two digits of the latter, a dash where there is none."""
    return amount(value, std, sign=sign) if _known(value) and _known(std) else MISSING


def beside(value: Any, std: Any, digits: int = 2) -> str:
    """Return a number with as many decimals as go with a 1-sigma that stands elsewhere in its row."""
    return number(value, decimals(std) if _known(std) else digits)


def sigma(std: Any) -> str:
    """Return a 1-sigma with two digits, a dash where there is none."""
    return uncertainty(std) if _known(std) else MISSING


def svg(picture: Picture) -> Markup:
    """Return a figure's drawing with its alternative text, to stand inside the page."""
    label = Markup.escape(picture.alt)
    return Markup(inline(picture.svg).replace("<svg", f'<svg role="img" aria-label="{label}"', 1))


def _parts(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return which columns of the table of parts have something to show, and the notes that are those of every part."""
    shown = {
        "published": any(_known(row["published_speed_m_s"]) for row in rows),
        "published_theory": any(_known(row["published_theory_speed_m_s"]) for row in rows),
        "free": not all(row["free_reason"] for row in rows),
        "stable": not all(row["stable_reason"] for row in rows),
    }
    notes = [note for note in rows[0]["notes"] if all(note in row["notes"] for row in rows)] if len(rows) > 1 else []
    return shown | {"notes": notes}


def _chosen(columns: Mapping[str, Any]) -> list[int]:
    """Return the rows of comparisons with the pitch held, path angles left out."""
    return [
        i
        for i, (trim, quantity) in enumerate(zip(columns["trim"], columns["quantity"], strict=True))
        if trim == "pitch" and quantity != "path_angle"
    ]


def _block_rows(columns: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the first comparisons, one row each, speeds in cm/s."""
    rows = []
    for i in sorted(_chosen(columns), key=lambda i: (columns["block"][i], columns["quantity"][i]))[:MOST_ROWS]:
        row = {name: columns[name][i] for name in ("block", "dive", "quantity", "label")}
        row["flight"] = DIRECTIONS[columns["direction"][i]]
        scaled = {name: 100.0 * columns[name][i] for name in ("predicted", "measured", "error", "u_val")}
        rows.append(row | scaled)
    return rows


def _known(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)

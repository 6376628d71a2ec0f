"""The index of a campaign: reports/index.html and the same for scripts, made anew if a summary has changed."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from pipeline import provenance, store
from pipeline.report.figures import files

#: What is written of all missions together, the page first; and the figures there are something to draw of.
OUTPUTS = ("index.html", "index.json", "index.parquet", "index.tsv")
FIGURES = files.CAMPAIGN_NAMES


def write(processed: Path, reports: Path, start: Callable[..., Callable[[], Any]] = partial) -> Path:
    """Write the index of `reports` unless nothing has changed since the last time, and return the path of its page.

    Parameters
    ----------
    processed
        Where it is recorded what the index was made from.
    reports
        Folder of the missions' reports.
    start
        Starts a task, as `pipeline.workers.Workers` does: to make the index where missions have been reported already,
        and all that draws is at hand.
    """
    found = {file.parent.name: file for file in sorted(reports.glob("*/summary.json"))}
    described = provenance.key("report", provenance.digests(found), {})
    recorded = processed / provenance.FILE
    content: dict[str, Any] = {}
    with suppress(OSError, ValueError):
        content = store.read_json(recorded)
    if not provenance.is_current(content.get("index"), described, lambda name: reports / name):
        start(_make, reports, list(found.values()))()
        written = {name: reports / name for name in (*OUTPUTS, *FIGURES)}
        outputs = provenance.digests({name: path for name, path in written.items() if path.is_file()})
        store.write_json(recorded, {"index": {**described, "outputs": outputs}})
    return reports / OUTPUTS[0]


def _make(reports: Path, summaries: list[Path]) -> None:
    """Write all but the record of what it was made from."""
    from pipeline.report import index
    from pipeline.report.overview import frame, tsv

    made = index([store.read_json(file) for file in summaries])
    page, numbers, table, text = (reports / name for name in OUTPUTS)
    store.write_text(page, made.page)
    store.write_json(numbers, made.content)
    store.write_table(table, *frame(made.content))
    store.write_text(text, tsv(made.content))
    files.write(reports.joinpath, made.pictures, {}, files.CAMPAIGN)

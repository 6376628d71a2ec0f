"""The index of a campaign: reports/index.html and the same for scripts, made anew if a summary has changed."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from pipeline import provenance, store
from pipeline.report.figures import files

#: What is written of all missions together, the page first; and the figures there are something to draw of.
OUTPUTS = ("index.html", "index.json", "index.parquet", "index.tsv")
FIGURES = files.CAMPAIGN_NAMES


def write(processed: Path, reports: Path) -> Path:
    """Write the index of `reports` unless nothing has changed since the last time, and return the path of its page.

    Parameters
    ----------
    processed
        Where it is recorded what the index was made from.
    reports
        Folder of the missions' reports.
    """
    found = {file.parent.name: file for file in sorted(reports.glob("*/summary.json"))}
    described = provenance.key("report", provenance.digests(found), {})
    recorded = processed / provenance.FILE
    content: dict[str, Any] = {}
    with suppress(OSError, ValueError):
        content = store.read_json(recorded)
    if not provenance.is_current(content.get("index"), described, lambda name: reports / name):
        from pipeline.report import index
        from pipeline.report.overview import frame, tsv

        made = index([store.read_json(file) for file in found.values()])
        page, numbers, table, text = (reports / name for name in OUTPUTS)
        store.write_text(page, made.page)
        store.write_json(numbers, made.content)
        store.write_table(table, *frame(made.content))
        store.write_text(text, tsv(made.content))
        files.write(reports.joinpath, made.pictures, {}, files.CAMPAIGN)
        written = {name: reports / name for name in (*OUTPUTS, *FIGURES)}
        outputs = provenance.digests({name: path for name, path in written.items() if path.is_file()})
        store.write_json(recorded, {"index": {**described, "outputs": outputs}})
    return reports / OUTPUTS[0]

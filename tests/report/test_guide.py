"""How to read the page: every section and every figure is explained."""

from __future__ import annotations

from pathlib import Path

from pipeline.report import page
from pipeline.report.figures import NO_FIGURE
from pipeline.report.guide import guide

SECTIONS = Path(page.__file__).parent / "templates" / "sections"


def test_every_section_and_every_figure_is_explained_in_full() -> None:
    written = guide()
    assert set(written["sections"]) == {section.name for section in page.SECTIONS}
    assert set(written["figures"]) == set(NO_FIGURE)
    for words in (words for entries in written.values() for words in entries.values()):
        assert all(text.endswith(".") for text in (words.shows, words.good, words.bad, words.remedy))


def test_every_section_has_a_template_and_every_template_a_section() -> None:
    assert {path.stem for path in SECTIONS.glob("*.html")} == {section.name for section in page.SECTIONS}

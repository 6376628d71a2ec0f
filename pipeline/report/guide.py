"""How to read the page: for each section and figure what it shows, what a good and a bad one look like, what to do.

The words are in guide.yaml, one entry a section (`sections`) and a figure (`figures`) of a mission's page, and of
the page of a campaign (`campaign_sections`, `campaign_figures`).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import yaml

FILE = Path(__file__).with_name("guide.yaml")


@dataclass(frozen=True)
class Help:
    """What stands one click away beside a section or a figure.

    Attributes
    ----------
    shows
        What it shows: what is measured, what is theory, what was borrowed.
    good, bad
        What a good and a bad one look like.
    remedy
        What to do about a bad one.
    """

    shows: str
    good: str
    bad: str
    remedy: str


@functools.cache
def guide() -> dict[str, dict[str, Help]]:
    """Return the help of every section and figure of both pages: each kind, as in guide.yaml, by name."""
    written = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    return {kind: {name: Help(**words) for name, words in entries.items()} for kind, entries in written.items()}

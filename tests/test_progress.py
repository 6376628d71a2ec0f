"""The bar: on a terminal when work takes long, and never anywhere else."""

from __future__ import annotations

import io

import pytest

from pipeline import progress
from pipeline.progress import Bar


class Stream(io.StringIO):
    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal


@pytest.mark.parametrize(
    ("terminal", "patience", "shown"), [(True, 0.0, True), (False, 0.0, False), (True, 60.0, False)]
)
def test_a_bar_is_shown_on_a_terminal_after_a_while(
    monkeypatch: pytest.MonkeyPatch, terminal: bool, patience: float, shown: bool
) -> None:
    stream = Stream(terminal)
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setattr(progress, "PATIENCE_S", patience)
    monkeypatch.setenv("TERM", "xterm")
    with Bar(8) as bar:
        bar.update(3, ["comet estimate", "sg171 ingest"])
    assert ("3/8" in stream.getvalue() and "comet estimate, sg171 ingest" in stream.getvalue()) == shown
    assert bool(stream.getvalue()) == shown

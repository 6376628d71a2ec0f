"""Progress: a bar on a terminal for work that takes long, nothing anywhere else."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from types import TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

PATIENCE_S = 2.0


class Bar:
    """Steps done out of `total`, shown on a terminal's standard error once the work has taken `PATIENCE_S`."""

    def __init__(self, total: int) -> None:
        self._total = total
        self._begin = time.monotonic()
        self._shown: tuple[Progress, TaskID] | None = None

    def update(self, done: int, running: Iterable[str]) -> None:
        """Show `done` steps and what is `running`."""
        if self._shown is None:
            if not sys.stderr.isatty() or time.monotonic() - self._begin < PATIENCE_S:
                return
            self._shown = self._start()
        progress, task = self._shown
        progress.update(task, completed=done, description=", ".join(running))

    def _start(self) -> tuple[Progress, TaskID]:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        progress = Progress(
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.description}", markup=False),
            console=Console(stderr=True),
            transient=True,
            redirect_stdout=sys.stdout.isatty(),
        )
        progress.start()
        return progress, progress.add_task("", total=self._total)

    def __enter__(self) -> Bar:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown is not None:
            self._shown[0].stop()

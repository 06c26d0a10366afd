"""A bar of finished members with the time that is left, for whoever waits at a terminal or in a notebook."""

from __future__ import annotations

import os
import sys
import time
from typing import IO, Any, Self

from cosim.machine.notices import PATIENCE
from cosim.results.formatting import format_duration


class Counter:
    """A bar of finished members on standard error, if a person watches; else nothing."""

    def __init__(self, file: IO[str] | None = None) -> None:
        self._file = file or sys.stderr
        terminal = self._file.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")
        self._notebook = "ipykernel" in sys.modules and file is None
        self._watched = terminal or self._notebook
        self._began = time.perf_counter()
        self.done = self.total = 0
        self._first: int | None = None
        self._bar: Any = None

    def __enter__(self) -> Self:
        return self

    def update(self, done: int, total: int) -> None:
        """Show how many members are done. Those that needed no run say nothing about the time left."""
        self.done, self.total = done, total
        if self._first is None:
            self._first, self._began = done - 1, time.perf_counter()
        passed = time.perf_counter() - self._began
        if not self._watched or passed < PATIENCE:
            return
        if self._bar is None:
            self._open(total)
        left = passed / max(done - self._first - 1, 1) * (total - done)
        self._bar.update(self._task, completed=done, left=f"{format_duration(left)} left")

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def _open(self, total: int) -> None:
        if self._notebook:
            self._bar, self._task = _CellBar(total), 0
            return
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        columns = (BarColumn(bar_width=None), MofNCompleteColumn(), TextColumn("{task.fields[left]}"))
        self._bar = Progress(*columns, console=Console(file=self._file), transient=True, expand=True)
        self._task = self._bar.add_task("", total=total, left="")
        self._bar.start()


class _CellBar:
    """The same bar below a notebook's cell, with the methods of rich's that are used."""

    def __init__(self, total: int) -> None:
        from IPython.display import HTML, display

        self._html, self._total, self._shown = HTML, total, 0.0
        self._handle: Any = display(HTML(""), display_id=True)

    def update(self, _task: int, completed: int, left: str) -> None:
        """Show how many are done, a few times a second."""
        if (now := time.perf_counter()) - self._shown > PATIENCE:
            self._shown = now
            bar = f'<progress value="{completed}" max="{self._total}"></progress> {completed}/{self._total}, {left}'
            self._handle.update(self._html(bar))

    def stop(self) -> None:
        """Take it away."""
        self._handle.update(self._html(""))

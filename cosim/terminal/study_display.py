"""What a person sees of a study: its tables, and a bar with the time that is left."""

from __future__ import annotations

import os
import sys
import time
from typing import IO, Any, Self

from cosim.results.formatting import format_duration
from cosim.study.text_tables import TextTable
from cosim.terminal.screen import ASCII, CONTROLS, PATIENCE, print_table


def show(table: TextTable, file: IO[str] | None = None) -> None:
    """Print a table to standard output, or to `file`."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    console = Console(file=file or sys.stdout, highlight=False, markup=False, emoji=False)
    plain = not console.encoding.startswith("utf")
    shown = {**CONTROLS, **ASCII} if plain else CONTROLS
    made = Table(
        title=table.title.translate(CONTROLS) or None,
        title_justify="left",
        box=None if plain else box.SIMPLE_HEAD,
        pad_edge=False,
    )
    labels = len(table.head) - len(table.values[0]) if table.values else 1
    for k, name in enumerate(table.head):
        made.add_column(name, justify="left" if k < labels else "right", no_wrap=True)
    for row in table.rows:
        made.add_row(*(cell.translate(shown) for cell in row))
    print_table(made, console)
    for note in table.notes:
        console.print(note)


class Counter:
    """A bar of finished members on standard error, if a person watches; else nothing."""

    def __init__(self, file: IO[str] | None = None) -> None:
        self._file = file or sys.stderr
        self._watched = self._file.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")
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
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        columns = (BarColumn(bar_width=None), MofNCompleteColumn(), TextColumn("{task.fields[left]}"))
        self._bar = Progress(*columns, console=Console(file=self._file), transient=True, expand=True)
        self._task = self._bar.add_task("", total=total, left="")
        self._bar.start()

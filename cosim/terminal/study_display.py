"""What a person sees of a study: its tables."""

from __future__ import annotations

import sys
from typing import IO

from cosim.study.text_tables import TextTable
from cosim.terminal.screen import ASCII, CONTROLS, print_table


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

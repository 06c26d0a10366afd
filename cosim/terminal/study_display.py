"""What a person sees of a study: its tables."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import IO, TYPE_CHECKING

from cosim.results.text_table import TextTable
from cosim.terminal.screen import ASCII, CONTROLS, UNLIMITED, line_width, natural_width, print_table

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


def show(table: TextTable, file: IO[str] | None = None, numbers: bool = True) -> None:
    """Print a table to standard output, or to `file`; one that is too wide in parts, each with its labels.

    numbers: whether what is no label is a number, which stands at the right.
    """
    console = _console(file or sys.stdout)
    if table.title:
        console.print(table.title.translate(_shown(console)), style="italic", soft_wrap=True)
    for part in _parts(table, console):
        print_table(_made(part, console, numbers), console)
    for note in table.notes:
        console.print(note)


def fits(table: TextTable, file: IO[str] | None = None) -> bool:
    """Whether the table is no wider than the terminal."""
    console = _console(file or sys.stdout)
    return natural_width(_made(table, console), console) <= _room(console)


def _parts(table: TextTable, console: Console) -> Iterator[TextTable]:
    """The table in pieces that are no wider than the terminal, if each of its columns is."""
    labels, first, count = table.labels, table.labels, len(table.head)
    while first < count or first == labels:
        last = count
        while last > first + 1 and natural_width(_made(_cut(table, first, last), console), console) > _room(console):
            last -= 1
        yield _cut(table, first, last)
        first = max(last, labels + 1)


def _cut(table: TextTable, first: int, last: int) -> TextTable:
    """The labels and some of the other columns."""
    chosen = [[*row[: table.labels], *row[first:last]] for row in (table.head, *table.rows)]
    values = [row[first - table.labels : last - table.labels] for row in table.values]
    return TextTable("", chosen[0], chosen[1:], values)


def _made(table: TextTable, console: Console, numbers: bool = True) -> Table:
    from rich import box
    from rich.table import Table

    made = Table(box=box.SIMPLE_HEAD if console.encoding.startswith("utf") else None, pad_edge=False)
    for k, name in enumerate(table.head):
        made.add_column(name, justify="right" if numbers and k >= table.labels else "left", no_wrap=True)
    for row in table.rows:
        made.add_row(*(cell.translate(_shown(console)) for cell in row))
    return made


def _console(file: IO[str]) -> Console:
    from rich.console import Console

    return Console(file=file, highlight=False, markup=False, emoji=False)


def _room(console: Console) -> int:
    return line_width(console.file) or UNLIMITED


def _shown(console: Console) -> dict[int, str]:
    """What steers a terminal, or what it does not have, spelled out."""
    return CONTROLS if console.encoding.startswith("utf") else {**CONTROLS, **ASCII}

"""What a person sees: the table of metrics, the progress of a run, and mistakes with the line they were made in."""

from __future__ import annotations

import os
import re
import shutil
import sys
import textwrap
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Self

from cosim.errors import CosimError, Position
from cosim.machine.notices import PATIENCE
from cosim.results.formatting import format_change, format_duration, format_value, format_with_error

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

LIST_WIDTH = 26
NARROWEST = 24
"""Characters that a column of words needs to be worth one."""
UNLIMITED = 10_000
TIED = "\N{NO-BREAK SPACE}"
"""A space at which no line ends; `print_wrapped` prints it as any other."""
ASCII = str.maketrans(
    {"–": "-", "—": "-", "×": "x", "…": "...", "µ": "u", "²": "2", "³": "3", "√": "sqrt ", "·": ".", "±": "+/-"}
)


CONTROLS = {
    code: f"\\x{code:02x}" if code < 256 else f"\\u{code:04x}"
    for code in (*range(9), *range(11, 32), *range(127, 160), *range(0x202A, 0x202F), *range(0x2066, 0x206A))
}
"""What would steer a terminal, or turn the direction of text, spelled out."""


def say(text: str) -> None:
    """Print a line to standard output, in which nothing from a file steers the terminal."""
    print(text.translate(CONTROLS))


def metrics_table(
    metrics: Mapping[str, Any],
    previous: Mapping[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
    windows: Mapping[str, str] | None = None,
    file: IO[str] | None = None,
    errors: Mapping[str, float | None] | None = None,
) -> None:
    """Print a run's metrics to standard output, or to `file`; names, numbers and units stay in one piece.

    previous: those of the run before, to be compared with. units, windows: by metric, as text; `str(reduction)` is
    such a window. errors: by metric, by how much it may be off.
    """
    columns = ["metric", "value", "unit", *(["previous", "change"] if previous is not None else []), "reduction"]
    rows = []
    for name, value in metrics.items():
        cells = [
            name,
            _lines(format_with_error(value, (errors or {}).get(name))),
            "" if isinstance(value, list) else (units or {}).get(name, ""),
        ]
        if previous is not None:
            before = _lines(format_value(previous[name])) if name in previous else ""
            cells += [before, format_change(value, previous, name)]
        rows.append([*cells, (windows or {}).get(name, "")])
    figures_table(columns, rows, file)


def figures_table(columns: Sequence[str], rows: Sequence[Sequence[str]], file: IO[str] | None = None) -> None:
    """Print figures in columns to standard output, or to `file`; what the last column says is broken at its commas."""
    console = _console(file or sys.stdout)
    table = _table(console, columns, rows)
    if natural_width(table, console) > (line_width(console.file) or UNLIMITED):
        table = _table(console, columns, [[*row[:-1], row[-1].replace(", ", ",\n")] for row in rows])
    print_table(table, console)


def _table(console: Console, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    styles = {"metric": "bold", "requirement": "bold", "previous": "dim", "reduction": "dim", "smallest at": "dim"}
    table = Table(box=None if _ascii_only(console) else SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for name in columns:
        right = name in ("value", "margin", "previous", "change", "µs a step", "share", "calls a step")
        table.add_column(name, justify="right" if right else "left", no_wrap=True, style=styles.get(name, ""))
    for row in rows:
        table.add_row(*(_text(console, (cell, "")) for cell in row))
    return table


def natural_width(table: Table, console: Console) -> int:
    """How many characters a rich table takes where nothing is broken or cut."""
    return console.measure(table, options=console.options.update(width=UNLIMITED)).maximum


def print_table(table: Table, console: Console) -> None:
    """Print a rich table whole: where the terminal is too narrow, the lines run on."""
    console.width = max(natural_width(table, console), console.width)
    console.print(table)


def line_width(file: IO[str]) -> int | None:
    """How many characters fit on a line; None for a file or a pipe, unless $COLUMNS says."""
    if (said := os.environ.get("COLUMNS", "")).isdecimal() and int(said):
        return int(said)
    return shutil.get_terminal_size().columns if file.isatty() else None


def print_rows(rows: Sequence[Sequence[str]], indent: str = "", file: IO[str] | None = None) -> None:
    """Print rows in columns; the last one is broken between words where the line ends."""
    widths = [max(len(row[c]) for row in rows) for c in range(len(rows[0]) - 1)] if rows else []
    for row in rows:
        cells = [cell.ljust(width) for cell, width in zip(row[:-1], widths, strict=True)]
        begin = indent + "".join(f"{cell}  " for cell in cells)
        print_wrapped(begin + row[-1], len(begin), file)


def print_wrapped(text: str, hanging: int, file: IO[str] | None = None) -> None:
    """Print a text, broken between words where the line ends; further lines are indented. TIED keeps words together."""
    file = file or sys.stdout
    text = text.translate(CONTROLS)
    width = line_width(file)
    if width and len(text) > width:
        begin, rest = text[:hanging], text[hanging:]
        if width - hanging < NARROWEST:
            hanging = min(hanging, 4)
        lines = textwrap.wrap(rest, width - hanging, break_long_words=False, break_on_hyphens=False)
        if hanging == len(begin):
            text = begin + f"\n{' ' * hanging}".join(lines)
        else:
            begun = textwrap.wrap(begin, width, subsequent_indent=" " * 2 * hanging, break_on_hyphens=False)
            text = "\n".join([*begun, *(f"{' ' * hanging}{line}" for line in lines)])
    print(text.rstrip().replace(TIED, " "), file=file)


class Progress:
    """A bar with simulated time, speed and time left, on standard error, if a person watches; else nothing.

    As a context manager around a run to `stop` (s), which calls `update(time)` whenever it can. resumed: whether the
    run goes on from another time than zero, which it tells first.
    """

    def __init__(self, stop: float, file: IO[str] | None = None, resumed: bool = False) -> None:
        self._stop = stop
        self._file = file or sys.stderr
        self._watched = self._file.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")
        self._began = time.perf_counter()
        self._resumed, self._from = resumed, 0.0
        self._bar: Any = None

    def __enter__(self) -> Self:
        self._began = time.perf_counter()
        return self

    def update(self, simulated: float, stop: float | None = None) -> None:
        """Show how far the run is; simulated time in s. stop: its end, if that was not known before."""
        self._stop = self._stop if stop is None else stop
        if self._resumed:
            self._resumed, self._from, self._began = False, simulated, time.perf_counter()
        passed = time.perf_counter() - self._began
        if not self._watched or passed < PATIENCE:
            return
        if self._bar is None:
            self._open()
        speed = (simulated - self._from) / passed
        left = f"{format_duration((self._stop - simulated) / speed)} left" if speed else ""
        self._bar.update(self._task, completed=simulated, total=self._stop, speed=f"{speed:.3g} × real time", left=left)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def _open(self) -> None:
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bar

        console = _console(self._file)
        show = ["{task.completed:.4g} / {task.total:g} s", "{task.fields[speed]}", "{task.fields[left]}"]
        columns = [TextColumn(_plain(text, console)) for text in show]
        self._bar = Bar(BarColumn(bar_width=None), *columns, console=console, transient=True, expand=True)
        self._task = self._bar.add_task("", total=self._stop, speed="", left="")
        self._bar.start()


def print_errors(error: CosimError, file: IO[str] | None = None) -> None:
    """Print a mistake, or all those of a `DiagramErrors`, to standard error, each with its line and the usual fix."""
    _print_problems(error.each, "error", "bold red", file)
    if len(error.each) > 1:
        _console(file or sys.stderr).print(f"{len(error.each)} errors", style="bold red")


def print_warnings(warnings: Iterable[CosimError], file: IO[str] | None = None) -> None:
    """Print warnings to standard error, in the form of errors."""
    _print_problems(warnings, "warning", "bold yellow", file)


def _print_problems(problems: Iterable[CosimError], kind: str, style: str, file: IO[str] | None) -> None:
    console = _console(file or sys.stderr)
    for problem in problems:
        # The place comes first, as compilers write it, so that terminals and editors make a link of it.
        where = f"{problem.position}: " if problem.position else ""
        parts = [(where, "bold"), (f"{kind}: ", style), (problem.message, "")]
        if problem.position:
            parts += _excerpt(problem.position, style)
        if problem.fix:
            parts += [("\n    ", ""), ("fix: ", "bold green"), (problem.fix.replace("\n", "\n         "), "")]
        # Soft wrapping leaves the breaking of lines to the terminal, so that links and copies stay whole.
        console.print(_text(console, *parts), soft_wrap=True)


def _excerpt(position: Position, style: str) -> list[tuple[str, str]]:
    """The line of the file with a caret under the column; nothing if the file has no such line or cannot be read."""
    from rich.cells import cell_len

    if not position.line:
        return []
    try:
        lines = Path(position.file).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return []
    if not 0 < position.line <= len(lines):
        return []
    line = "".join(c if c.isprintable() else " " for c in lines[position.line - 1])
    gutter = f"\n{position.line:>7} | "
    parts = [(gutter, "dim"), (line, "")]
    if position.column:
        # Columns count characters, some of which are two cells wide.
        indent = " " * cell_len(line[: position.column - 1])
        parts += [(f"\n{'|':>9} {indent}", "dim"), ("^", style)]
    return parts


def _lines(text: str) -> str:
    """A list on several lines, broken between its elements."""
    if not text.startswith("["):
        return text
    lines = [""]
    for part in re.split(r"(?<=, )", text):
        if lines[-1] and len(lines[-1]) + len(part.rstrip()) > LIST_WIDTH:
            lines.append("")
        lines[-1] += part
    return "\n".join(line.rstrip() for line in lines)


def _console(file: IO[str]) -> Console:
    """Colours only on a terminal that has them, and not with NO_COLOR set."""
    from rich.console import Console

    return Console(file=file, highlight=False, markup=False, emoji=False)


def _ascii_only(console: Console) -> bool:
    return not console.encoding.startswith("utf")


def _plain(text: str, console: Console) -> str:
    """The same text with the characters that the terminal can show."""
    text = text.translate(CONTROLS)
    if not _ascii_only(console):
        return text
    return text.translate(ASCII).encode(console.encoding, "replace").decode(console.encoding)


def _text(console: Console, *parts: tuple[str, str]) -> Text:
    """Pieces of text, each with its style, as rich prints them: brackets are brackets, no markup."""
    from rich.text import Text

    return Text.assemble(*((_plain(text, console), style) for text, style in parts))

"""What a run and a table of runs say of themselves, as text and as HTML."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from cosim.engine.outcome import Outcome
from cosim.errors import CosimError
from cosim.language.diagram import Diagram
from cosim.results.formatting import format_value

REQUIREMENT_HEAD = ("requirement", "", "margin", "unit", "smallest at")


def text_of(outcome: Outcome) -> str:
    """How a run ended, with a line for each metric."""
    rows = _rows(outcome)
    lines = aligned(["metric", "value", "unit", "reduction"], rows) if rows else []
    if outcome.requirements:
        lines += [*([""] if lines else []), *aligned(REQUIREMENT_HEAD, _judged(outcome), (2,))]
    return "\n".join([*lines, *([""] if lines else []), *_words(outcome)])


def html_of(outcome: Outcome) -> str:
    """The same for a notebook."""
    rows = _rows(outcome)
    said = "".join(f"<p>{escape(line)}</p>" for line in _words(outcome))
    judged = html_table(REQUIREMENT_HEAD, _judged(outcome), {2}) if outcome.requirements else ""
    return (html_table(["metric", "value", "unit", "reduction"], rows, {1}) if rows else "") + judged + said


def aligned(head: Sequence[str], rows: Iterable[Sequence[str]], right: Iterable[int] = (1,)) -> list[str]:
    """The lines of a table of short texts; right: the columns that are aligned to the right."""
    cells = [list(head), *(_split(row) for row in rows)]
    flat = [line for row in cells for line in (row if row and isinstance(row[0], list) else [row])]
    widths = [max(len(str(line[k])) for line in flat) for k in range(len(head))]
    at = set(right)
    made = [
        "  ".join(
            str(cell).rjust(w) if k in at else str(cell).ljust(w)
            for k, (cell, w) in enumerate(zip(line, widths, strict=True))
        )
        for line in flat
    ]
    return [line.rstrip() for line in made]


def _split(row: Sequence[str]) -> list[Any]:
    """A row whose cells have several lines as several rows."""
    parts = [str(cell).split("\n") for cell in row]
    height = max(map(len, parts))
    return [[part[k] if k < len(part) else "" for part in parts] for k in range(height)]


def html_table(head: Sequence[str], rows: Iterable[Sequence[str]], right: Iterable[int] = ()) -> str:
    """A table; right: the columns that are aligned to the right."""
    at = set(right)

    def cell(kind: str, k: int, text: str) -> str:
        style = f' style="text-align: {"right" if k in at else "left"}"'
        return f"<{kind}{style}>{'<br>'.join(map(escape, str(text).split(chr(10))))}</{kind}>"

    top = "".join(cell("th", k, text) for k, text in enumerate(head))
    body = "".join(f"<tr>{''.join(cell('td', k, text) for k, text in enumerate(row))}</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def _rows(outcome: Outcome) -> list[list[str]]:
    return [
        [
            name,
            format_value(value),
            "" if isinstance(value, list) else outcome.units.get(name, ""),
            outcome.windows.get(name, ""),
        ]
        for name, value in outcome.metrics.items()
    ]


def _judged(outcome: Outcome) -> list[list[str]]:
    return [[v.name, v.word, v.margin_text, v.unit, v.place] for v in outcome.requirements.values()]


def _words(outcome: Outcome) -> list[str]:
    """How the run ended, what it is to be warned of, and what happened along it."""
    took = outcome.seconds.get("solve", 0.0)
    said = [f"{outcome.status} at {outcome.time:g} s after {outcome.steps} steps ({outcome.method}, {took:.3g} s)"]
    if outcome.reason:
        said.append(str(outcome.error or outcome.termination))
    said += [f"warning: {told(warning)}" for warning in outcome.warnings]
    return said + [f"warning: {event.signal}: {event.text}" for event in outcome.events]


def told(error: CosimError) -> str:
    """An error on one line."""
    return re.sub(r"\s*\n\s*", "; ", str(error))


def file_name(diagram: Diagram) -> str:
    """What a file of a diagram may be called."""
    return re.sub(r"[^\w.-]+", "_", diagram.path.stem) or "run"

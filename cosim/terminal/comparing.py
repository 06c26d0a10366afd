"""What a person sees of several results side by side: their metrics, what their diagrams say otherwise, who agrees."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any

from cosim.results.diagram_differences import Difference
from cosim.results.formatting import format_change, format_value
from cosim.results.text_table import TextTable
from cosim.terminal import study_display
from cosim.terminal.screen import line_width, print_rows, print_wrapped, say

ACROSS = 4
"""More results than this are rows of the table of metrics, and fewer are columns."""
NAMED = 6
"""Of more results with one value, only so many are named."""


def metrics_table(names: Sequence[str], metrics: Sequence[Mapping[str, Any]]) -> TextTable:
    """The metrics of all, and of two, what changed from the first to the second."""
    every = list(dict.fromkeys(name for one in metrics for name in one))
    cells = [[format_value(one[name]) if name in one else "" for name in every] for one in metrics]
    if len(names) > ACROSS:
        return TextTable("", ["result", *every], [[name, *own] for name, own in zip(names, cells, strict=True)])
    rows = [[name, *(own[k] for own in cells)] for k, name in enumerate(every)]
    if len(names) > 2:
        return TextTable("", ["metric", *names], rows)
    first, second = metrics
    for row in rows:
        both = row[0] in first and row[0] in second
        row.append(format_change(second[row[0]], first, row[0]) if both else "")
    return TextTable("", ["metric", *names, "change"], rows)


def show_differences(names: Sequence[str], unread: Sequence[str], found: Sequence[Difference]) -> None:
    """Print each key of the diagrams with what each says there. unread: results without a diagram."""
    for name in unread:
        say(f"{name} says nothing of its diagram")
    if len(names) < 2:
        return
    if not found:
        say("their diagrams are the same, key by key")
        return
    if len(names) == 2:
        say(f"in the diagrams of {names[0]} → {names[1]}:")
        print_rows([[item.key, " → ".join(item.texts)] for item in found], "  ")
        return
    table = TextTable("", ["in the diagrams", *names], [[item.key, *item.texts] for item in found])
    if len(names) <= ACROSS and study_display.fits(table):
        study_display.show(table, numbers=False)
        return
    print("in the diagrams:")
    for item in found:
        say(f"  {item.key}")
        groups: dict[str, list[str]] = {}
        for name, text in zip(names, item.texts, strict=True):
            groups.setdefault(text, []).append(name)
        print_rows([[text, _listed(own)] for text, own in groups.items()], "    ")


def show_verdicts(names: Sequence[str], verdicts: Sequence[str]) -> None:
    """Print how each lies to the first one."""
    say(f"beside {names[0]}:")
    width = max(map(len, names[1:]))
    limit = (line_width(sys.stdout) or 120) // 2
    for name, text in zip(names[1:], verdicts, strict=True):
        begin = f"  {name.ljust(min(width, limit))}  "
        print_wrapped(begin + text, len(begin))


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more

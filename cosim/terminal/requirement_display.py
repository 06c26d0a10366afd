"""What a person sees of requirements: whether runs keep them, by how much, and where the margin is smallest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from cosim.requirements.verdict import WORDS, Verdict, change
from cosim.results.comparison import Judgements
from cosim.results.formatting import format_value
from cosim.results.text_table import TextTable
from cosim.terminal.screen import figures_table

NO_ERRORS: Mapping[str, float | None] = MappingProxyType({})


def show(
    verdicts: Iterable[Verdict], previous: Judgements | None = None, errors: Mapping[str, float | None] = NO_ERRORS
) -> None:
    """Print a line for each requirement.

    previous: those of the run before, by name, to be compared with. errors: by how much a margin may be off, by name.
    """
    before = ["previous", "change"] if previous is not None else []
    rows = []
    for v in verdicts:
        cells = [v.name, v.word, v.margin_within(errors.get(v.name)), v.unit]
        if previous is not None:
            cells += _beside(v.as_json(), previous)
        rows.append([*cells, v.place])
    figures_table(["requirement", "", "margin", "unit", *before, "smallest at"], rows)


def _beside(judged: Mapping[str, Any], previous: Judgements) -> list[str]:
    """What stood there before, and what has changed."""
    name = judged["name"]
    if name not in previous:
        return ["", "new"]
    return [format_value(previous[name]["margin"]), change(previous[name], judged)]


def table(names: Sequence[str], judged: Sequence[Judgements]) -> TextTable:
    """The verdicts of several results side by side; of two, what changed from the first to the second."""
    every = list(dict.fromkeys(name for one in judged for name in one))
    rows = [[name, *(_cell(one[name]) if name in one else "" for one in judged)] for name in every]
    if len(names) != 2:
        return TextTable("", ["requirement", *names], rows)
    first, second = judged
    for row in rows:
        both = row[0] in first and row[0] in second
        row.append(change(first[row[0]], second[row[0]]) if both else "")
    return TextTable("", ["requirement", *names, "change"], rows)


def _cell(judged: Mapping[str, Any]) -> str:
    word = WORDS[judged["holds"]]
    return word if judged["margin"] is None else f"{word} {format_value(judged['margin'])}"

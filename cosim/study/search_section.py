"""Reads the section `search` of a study: over what `cosim falsify` searches, how long, and for what."""

from __future__ import annotations

from cosim.errors import WrongValue
from cosim.language.keys import read_value
from cosim.language.reader import Reader
from cosim.language.source import Node
from cosim.study.definition import Random, Search
from cosim.study.study_keys import SEARCH


def read(node: Node, space: Random | None, reader: Reader) -> Search | None:
    """The search; None where it does not say over what. space: what is varied, as of one draw."""
    entries = node.value
    if space is None or not _is_bounded(space, reader):
        return None
    names = entries.get("requirements")
    wanted = None
    if names is not None:
        nodes = names.value if isinstance(names.value, list) else [names]
        wanted = tuple(n for n in nodes if reader.text(n, "search.requirements"))
    runs = read_value(SEARCH["runs"], entries["runs"], "search.runs", reader) if "runs" in entries else None
    return Search(space, wanted, runs or SEARCH["runs"].default, node)


def _is_bounded(space: Random, reader: Reader) -> bool:
    """Whether all lies between two bounds, else a report: a search would go as far as there is any probability."""
    without = [draw for draw in space.draws if draw.normal]
    for draw in without:
        message = f"`search.over.{','.join(draw.paths)}` has no bounds, and a search looks at the ends too"
        reader.wrong(draw.node, message, "write {uniform: [least, most]}, such as three deviations around", WrongValue)
    return not without

"""Reads the section `search` of a study: over what `cosim falsify` searches, how long, and for what."""

from __future__ import annotations

from collections.abc import Mapping

from cosim.errors import MissingKey
from cosim.language.keys import read_value
from cosim.language.reader import Reader
from cosim.language.source import Node
from cosim.study import random_section
from cosim.study.definition import Random, Search
from cosim.study.study_keys import SEARCH


def read(node: Node, reader: Reader) -> Search | None:
    """The search; None where it does not say over what."""
    entries = node.value
    space = _space(node, entries, reader)
    if space is None:
        return None
    names = entries.get("requirements")
    wanted = None
    if names is not None:
        nodes = names.value if isinstance(names.value, list) else [names]
        wanted = tuple(n for n in nodes if reader.text(n, "search.requirements"))
    runs = read_value(SEARCH["runs"], entries["runs"], "search.runs", reader) if "runs" in entries else None
    return Search(space, wanted, runs or SEARCH["runs"].default, node)


def _space(node: Node, entries: Mapping[str, Node], reader: Reader) -> Random | None:
    """What is varied, as the draws of a study are."""
    if "over" not in entries:
        fix = "write search: {over: {blocks.plant.start.x: {uniform: [-1, 1]}}}"
        reader.problems.add(MissingKey("`search` has no `over`", node.place, fix))
        return None
    draws = {"count": Node(1, node.position), "draws": entries["over"]}
    kept = {key: entries[key] for key in ("seed", "accept") if key in entries}
    return random_section.read(Node({**draws, **kept}, node.position, node.place), reader, "search", "over")

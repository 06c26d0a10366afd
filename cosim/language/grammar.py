"""The closed grammar: a tree is cut down to the keys that are declared, and every other one is a mistake."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches

from cosim.errors import Problems, UnknownKey, WrongType, WrongValue, nearest
from cosim.language.keys import ANY, DIAGRAM, Key
from cosim.language.source import Node, describe

_VALUE = Key("")


def conform(
    node: Node, problems: Problems, grammar: Mapping[str, Key] = DIAGRAM, name: str = "", over: bool = False
) -> Node:
    """The tree without what the grammar does not have.

    A misspelt key is read as the one that it is nearest to, so that what stands below it is checked as well. A key
    without a value is a mistake, but for a section of which nothing is said. over: whether the tree lies over another.
    """
    if not grammar:
        return node
    if not isinstance(node.value, dict):
        message = f"`{name}` must be a mapping, not {describe(node)}"
        problems.add(WrongType(message, node.position, "write lines of `key: value` below it"))
        return replace(node, value={})
    entries: dict[str, Node] = {}
    for written, child in node.value.items():
        key = written
        if ANY not in grammar and key not in grammar:
            where = f"`{name}`" if name else "a diagram"
            problems.add(UnknownKey(f"{where} has no key `{key}`", child.place, nearest(key, grammar)))
            meant = get_close_matches(key, grammar, n=1, cutoff=0.5)
            if not meant or meant[0] in node.value:
                continue
            key = meant[0]
        declared = grammar.get(ANY) or grammar.get(key, _VALUE)
        where = f"{name}.{key}".strip(".")
        layered = over or (name == "blocks" and "/" in key)  # what is said of a block inside a diagram lies over it
        if child.value is not None:
            below = declared.below if declared.type is None or isinstance(child.value, dict) else {}
            entries[key] = conform(child, problems, below, where, layered or declared.layer)
        elif layered and not child.blank:
            entries[key] = child
        elif not child.blank:
            message = f"`{where}: ~` takes away what an overlay's base says of it, and nothing does"
            problems.add(WrongValue(message, child.place, "remove this line"))
        elif ANY in grammar or not declared.below:
            problems.add(WrongValue(f"`{where}` has no value", child.place, "write one, or `~` to have none"))
    return replace(node, value=entries)

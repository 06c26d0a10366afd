"""The closed grammar: a tree is cut down to the keys that are declared, and every other one is a mistake."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches

from cosim.errors import Problems, UnknownKey, WrongType, WrongValue, nearest
from cosim.language.keys import ADDS, ANY, DIAGRAM, Key
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
    entries = _additions(node, problems, grammar, name, over)
    for written, child in node.value.items():
        key = written
        if _adds(written, grammar):
            continue
        if ANY not in grammar and key not in grammar:
            message = f"{f'`{name}`' if name else 'a diagram'} has no key `{key}`"
            problems.add(UnknownKey(message, child.place, nearest(key, grammar)))
            meant = get_close_matches(key, grammar, n=1, cutoff=0.5)
            if not meant or meant[0] in node.value:
                continue
            key = meant[0]
        declared = grammar.get(ANY) or grammar.get(key, _VALUE)
        where = f"{name}.{key}".strip(".")
        layered = over or (name == "blocks" and "/" in key)  # what is said of a block inside a diagram lies over it
        if child.value is not None:
            entries[key] = conform(child, problems, _below(declared, child), where, layered or declared.layer)
        elif layered and not child.blank:
            entries[key] = child
        elif not child.blank or ANY in grammar or declared.type or not declared.below:
            problems.add(_nothing(child, where))
    return replace(node, value=entries)


def _below(key: Key, node: Node) -> Mapping[str, Key]:
    """What may stand below a key; nothing where its value is no mapping, or one of quite other names."""
    if key.type is None or (ANY in key.below and isinstance(node.value, dict)):
        return key.below
    written = node.value if isinstance(node.value, dict) else ()
    return key.below if any(get_close_matches(name, key.below, n=1, cutoff=0.5) for name in written) else {}


def _nothing(node: Node, where: str) -> WrongValue:
    """The mistake of a key without a value, or of one that takes away what is not there."""
    if node.blank:
        return WrongValue(f"`{where}` has no value", node.place, "write one, or `~` to have none")
    message = f"`{where}: ~` takes away what an overlay's base says of it, and nothing does"
    return WrongValue(message, node.place, "remove this line")


def _adds(key: str, grammar: Mapping[str, Key]) -> bool:
    """Whether a key says that it adds to the list of another."""
    return key.endswith(ADDS) and (ANY in grammar or key.removesuffix(ADDS) in grammar)


def _additions(node: Node, problems: Problems, grammar: Mapping[str, Key], name: str, over: bool) -> dict[str, Node]:
    """What a tree that lies over another adds to its lists; elsewhere each is a mistake, for want of a list."""
    found: dict[str, Node] = {}
    for key, child in node.value.items():
        if not _adds(key, grammar):
            continue
        if over and isinstance(child.value, list):
            found[key] = child
        else:
            problems.add(_no_addition(node, key, name))
    return found


def _no_addition(node: Node, key: str, name: str) -> WrongValue:
    """The mistake of a key `name+` that adds to nothing."""
    short, added = key.removesuffix(ADDS), node.value[key]
    where, there = f"{name}.{short}".strip("."), node.value.get(short)
    if not isinstance(added.value, list):
        message = f"`{where}{ADDS}` adds a list to a list, and this is {describe(added)}"
        return WrongValue(message, added.place, f"write {key}: [{added.plain()}]")
    if there is None:
        message = f"`{where}{ADDS}` adds to the list `{short}` of an overlay's base, and there is none"
        return WrongValue(message, added.place, f"write `{short}:`, or correct the name or `extends`")
    if isinstance(there.value, list):
        return WrongValue(f"`{where}` stands beside `{key}`", added.place, "write one list")
    message = f"`{where}{ADDS}` adds to a list, and `{short}` is {describe(there)}"
    return WrongValue(message, added.place, f"write `{short}:`, as a whole")

"""A Python mapping as a tree of nodes, as if it had been read from YAML: the place of each is the path of its keys.

What YAML has no word for and a program has, NumPy's arrays and numbers, paths and fractions, is taken for what a person
would write. A class is the type of a block.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from cosim.errors import KeyPath, TooLarge, WrongType, WrongValue
from cosim.language.source import Node

GIVEN = "the mapping"
_DEEPEST = 50
_KINDS = "a number, text, True, False, None, a list, an array or a mapping"


def tree_of(mapping: Mapping[str, Any], folder: str) -> Node:
    """The tree of a whole diagram or study; folder: what paths in it are relative to. Raises: as `node_of`."""
    if not isinstance(mapping, Mapping):
        fix = 'such as {"run": {"stop": 1, "step": 0.001}, "blocks": {…}}'
        raise WrongType(f"a diagram is a mapping, not {_called(mapping)}", fix=fix)
    return _mapping(mapping, "", KeyPath(GIVEN, keys=GIVEN, base=folder), 0)


def node_of(value: Any, position: KeyPath) -> Node:
    """A value as a node, all of it at one place. Raises: WrongType, WrongValue, TooLarge."""
    return _node(value, None, position, 0)


def _node(value: Any, path: str | None, place: KeyPath, depth: int) -> Node:
    """path: that of the value's keys; None where all of it is at one place."""
    if depth > _DEEPEST:
        raise TooLarge(f"values are nested more than {_DEEPEST} levels deep", place, "use fewer levels")
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return _mapping(value, path, place, depth)
    if isinstance(value, list | tuple):
        below = [None if path is None else f"{path}[{k}]" for k in range(len(value))]
        places = [place if keys is None else replace(place, keys=keys) for keys in below]
        parts = zip(value, below, places, strict=True)
        return Node([_node(item, keys, at, depth + 1) for item, keys, at in parts], place)
    if isinstance(value, type):
        return Node(value.__name__, place, made=value)
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, Fraction):
        value = str(value)
    if isinstance(value, bool) or value is None:
        return Node(value, place)
    if isinstance(value, int):
        return Node(_whole(int(value), place), place)
    if isinstance(value, float):
        return Node(float(value), place)
    if isinstance(value, str):
        if "\0" in value:
            raise WrongValue("the text contains the invisible character NUL", place, "remove it")
        return Node(str(value), place)
    raise WrongType(f"{_called(value)} is nothing that a diagram says", place, f"give {_KINDS}")


def _mapping(value: Mapping[Any, Any], path: str | None, place: KeyPath, depth: int) -> Node:
    entries: dict[str, Node] = {}
    for key, item in value.items():
        if not isinstance(key, str | int) or isinstance(key, bool):
            raise WrongType(f"a key is text, not {_called(key)}", place, "such as {'stop': 10}")
        below = None if path is None else f"{path}.{key}" if path else str(key)
        at = place if below is None else replace(place, keys=below)
        node = _node(item, below, at, depth + 1)
        entries[str(key)] = replace(node, key_position=at)
    return Node(entries, place)


def _whole(value: int, place: KeyPath) -> int | float:
    """An integer; one that no integer of 64 bits holds as a float, as YAML's are read."""
    if -(1 << 63) < value < 1 << 64:
        return value
    try:
        return float(value)
    except OverflowError:
        message = "the number is beyond the range of floating-point numbers"
        raise WrongValue(message, place, "from 2.3e-308 to 1.7e308") from None


def _called(value: Any) -> str:
    """What a value is, in words."""
    kind = type(value)
    return f"a value of type {kind.__name__}" if kind.__module__ == "builtins" else f"a {kind.__qualname__}"

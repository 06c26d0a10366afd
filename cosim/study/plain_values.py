"""Values as programs have them, numbers and texts in lists, and the nodes of a diagram that they are."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cosim.errors import Position
from cosim.language.source import Node


def as_node(value: Any, position: Position) -> Node:
    """A plain value as a node, all of it at one place."""
    if isinstance(value, list | tuple):
        return Node([as_node(item, position) for item in value], position)
    return Node(value, position)


def as_content(value: Any, position: Position) -> Node:
    """The same; a list of real numbers alone is kept as one array, which is read much faster than a node for each."""
    numbers = None if not isinstance(value, list) or not _is_real(value) else np.array(value)
    return as_node(value, position) if numbers is None else Node(numbers, position)


def _is_real(value: Any) -> bool:
    """Whether a value is a real number, or nested lists of such that are an array."""
    if not isinstance(value, list):
        return type(value) is float and not math.isnan(value)
    if not value or not all(map(_is_real, value)):
        return False
    return len({shape_of(item) for item in value}) == 1


def shape_of(value: Any) -> tuple[int, ...]:
    """The shape that lists of lists have, going by the first of each."""
    return (len(value), *(shape_of(value[0]) if value else ())) if isinstance(value, list | tuple) else ()


def names_member(value: Any) -> bool:
    """Whether a value contains text, which may be an expression in the member's number."""
    return any(map(names_member, value)) if isinstance(value, list | tuple) else isinstance(value, str)

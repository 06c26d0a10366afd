"""Whole numbers and indices as they stand in the text."""

from __future__ import annotations

import ast
from typing import Any

#: An index of an element: a number for each axis.
Index = tuple[int, ...]


def number(node: Any) -> int | None:
    """A whole number that is written out; None for anything else."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        inner = number(node.operand)
        return None if inner is None else -inner
    return node.value if isinstance(node, ast.Constant) and type(node.value) is int else None


def indices(subscript: ast.Subscript) -> list[Any]:
    """What stands between the brackets, for one axis after the other."""
    inside = subscript.slice
    return inside.elts if isinstance(inside, ast.Tuple) else [inside]


def constant_index(subscript: ast.Subscript) -> Index | None:
    """The index, where it is all of whole numbers that are written out."""
    numbers = [number(n) for n in indices(subscript)]
    return tuple(n for n in numbers if n is not None) if None not in numbers else None


def is_special(index: Any) -> bool:
    """Whether an index may change the number of axes in another way than a number or a slice."""
    return isinstance(index, ast.Starred) or (isinstance(index, ast.Constant) and index.value in (None, ...))

"""What has been written on a path: arrays as a whole or, where all their indices are constants, element by element."""

from __future__ import annotations

import ast
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

from cosim.authoring.dataflow.array_operations import SHAPE
from cosim.authoring.dataflow.indices import Index, constant_index

#: An array as a whole, or one of its elements.
Token = str | tuple[str, Index]
#: What is written on every path that leads here; None where no path does.
Written = frozenset[Token] | None

#: Arrays with more elements are written as a whole only.
_MOST = 64


def meet(*paths: Written) -> Written:
    """What is written whichever path was taken."""
    reached = [p for p in paths if p is not None]
    return frozenset.intersection(*reached) if reached else None


class Elements:
    """Of the arrays of known shape that are written at constant indices only, and by name: all their indices."""

    def __init__(self, function: Any, shapes: Mapping[str, Sequence[Any] | None]) -> None:
        self._shapes: dict[str, tuple[int, ...]] = {}
        self._indices: dict[str, list[Index]] = {}
        for name, shape in shapes.items():
            if shape is None or not all(isinstance(size, int) for size in shape):
                continue
            sizes = tuple(int(size) for size in shape)
            if 1 < math.prod(sizes) <= _MOST and _only_constant(function, name, len(sizes)):
                self._shapes[name] = sizes
                self._indices[name] = list(itertools.product(*map(range, sizes)))

    def mark(self, written: Written, name: str | None, index: Index | None = None) -> Written:
        """A path after a write of an array, or of one of its elements; name: None where it is not certain which."""
        if written is None or name is None:
            return written
        indices = self._indices.get(name)
        if indices is None or index is None:
            return written | {name, *((name, i) for i in indices or ())}
        place = tuple(i + size if i < 0 else i for i, size in zip(index, self._shapes[name], strict=True))
        written = written | {(name, place)}
        return written | {name} if all((name, i) in written for i in indices) else written

    def holds(self, written: frozenset[Token], name: str, node: Any) -> bool:
        """Whether the very element that a node reads is written."""
        if not isinstance(node, ast.Subscript) or name not in self._indices:
            return False
        index = constant_index(node)
        return index is not None and (name, index) in written

    def partly(self, written: frozenset[Token]) -> dict[str, list[Index]]:
        """Of the arrays of which some elements are written, the others."""
        left = {name: [i for i in indices if (name, i) not in written] for name, indices in self._indices.items()}
        return {name: some for name, some in left.items() if 0 < len(some) < len(self._indices[name])}


def _only_constant(function: Any, name: str, axes: int) -> bool:
    """Whether an array appears in nothing but `name[constants]` and the like of `name.size`."""
    harmless: set[int] = set()
    for n in ast.walk(function):
        inner = n.value if isinstance(n, ast.Subscript | ast.Attribute) else None
        if not (isinstance(inner, ast.Name) and inner.id == name):
            continue
        if isinstance(n, ast.Attribute) and n.attr in SHAPE:
            harmless.add(id(inner))
        elif isinstance(n, ast.Subscript):
            index = constant_index(n)
            if isinstance(n.ctx, ast.Load) or (index is not None and len(index) == axes):
                harmless.add(id(inner))
    names = [n for n in ast.walk(function) if isinstance(n, ast.Name) and n.id == name]
    return all(id(n) in harmless for n in names)

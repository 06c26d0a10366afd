"""What the names of a function stand for: arguments of a known shape, local names, things outside."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any

from cosim.authoring.author_source import arguments_of
from cosim.authoring.dataflow.bindings import Element, bindings
from cosim.authoring.dataflow.indices import indices, is_special
from cosim.authoring.scope import resolve, scope_of

#: The sizes of an array's axes, with anything else than an int where a size is not known; None where not even the
#: number of axes is.
Shape = Sequence[Any] | None


class Symbols:
    """The names of one function.

    arguments: in their order; shapes: of each; bindings: the expressions that each local name may stand for.
    """

    def __init__(self, function: Any, node: Any, shapes: Sequence[Shape]) -> None:
        self.node = node
        self.arguments = tuple(a.arg for a in arguments_of(node))
        self.shapes = dict(zip(self.arguments, shapes, strict=False))
        self.bindings = bindings(node)
        self._scope = scope_of(function)
        for name in (*function.__code__.co_varnames, *function.__code__.co_cellvars):
            self._scope.pop(name, None)

    def outside(self, node: Any) -> Any:
        """What a name or a dotted name stands for outside the function; None where that is not known."""
        return resolve(node, self._scope)

    def axes(self, node: Any, asking: frozenset[str] = frozenset()) -> int | None:
        """How many axes an expression's value has, where that is known; asking: local names that this is asked for."""
        if isinstance(node, ast.Name):
            if node.id in self.bindings:
                return self._axes_of_local(node.id, asking)
            shape = self.shapes.get(node.id)
            return None if shape is None else len(shape)
        if isinstance(node, Element):
            inner = self.axes(node.value, asking)
            return None if inner is None else max(0, inner - 1)
        if isinstance(node, ast.Subscript):
            inner = self.axes(node.value, asking)
            if inner is None or any(map(is_special, indices(node))):
                return None
            return max(0, inner - sum(not isinstance(i, ast.Slice) for i in indices(node)))
        return 0 if isinstance(node, ast.Constant) else None

    def _axes_of_local(self, name: str, asking: frozenset[str]) -> int | None:
        if name in self.arguments or name in asking:  # made from itself, so that looking does not tell
            return None
        found = {self.axes(value, asking | {name}) for value in self.bindings[name]}
        return found.pop() if len(found) == 1 else None

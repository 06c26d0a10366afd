"""What the names of a function stand for while it is lowered, and whether they have a value yet."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from typing import Any

from cosim.authoring.dataflow.bindings import bindings
from cosim.authoring.lowering.axis_sizes import Size
from cosim.authoring.lowering.lowered_values import (
    REAL,
    TRUTH,
    UNKNOWN,
    WHOLE,
    Array,
    Scalar,
    Several,
    Value,
)
from cosim.authoring.lowering.work import Refusal


class Names:
    """The names of one function.

    arguments: what each argument stands for; scope: what names of the module stand for. bound: the names of arrays
    that have a value on every path that leads here; None where no path does. lost: those whose value was refused.
    is_helper: otherwise it is a block's, of which it is said elsewhere that an argument gets another value.
    """

    def __init__(self, function: Any, arguments: Mapping[str, Value], scope: dict[str, Any], is_helper: bool) -> None:
        self.is_helper = is_helper
        self.values: dict[str, Value] = dict(arguments)
        self.arguments = frozenset(arguments)
        self.bound: frozenset[str] | None = self.arguments
        self.lost: set[str] = set()
        self.bindings = bindings(function)
        self.local = {*self.bindings, *arguments}
        self.scope = {name: value for name, value in scope.items() if name not in self.local}
        added = (n.target for n in ast.walk(function) if isinstance(n, ast.AugAssign))
        self._added_to = {target.id for target in added if isinstance(target, ast.Name)}
        self._in_loops = {id(n) for loop in _loops(function) for n in ast.walk(loop)}

    def is_local(self, node: Any) -> bool:
        """Whether a name, or the first part of a dotted one, is the function's own."""
        while isinstance(node, ast.Attribute):
            node = node.value
        return not isinstance(node, ast.Name) or node.id in self.local

    def look_up(self, node: ast.Name) -> Value | None:
        """What a local name stands for, None for one of the module. Raises: Refusal."""
        if node.id in self.lost:
            raise Refusal(node, "", "")
        if node.id not in self.local:
            return None
        value = self.values.get(node.id)
        if isinstance(value, (Array, Several)) and self.bound is not None and node.id not in self.bound:
            what = f"may read `{node.id}` before it has a value"
            raise Refusal(node, what, f"give `{node.id}` a value on every path, such as at the top")
        if value is None:
            return Scalar(node)
        return Scalar(node, value.element, value.size) if isinstance(value, Scalar) else value

    def give(self, name: str, value: Value) -> None:
        """A name stands for a value from here on."""
        if isinstance(value, Scalar) and (len(self.bindings.get(name, ())) > 1 or name in self._added_to):
            value = Scalar(value.node)
        self.values[name] = value
        if self.bound is not None:
            self.bound |= {name}

    def is_made_once(self, name: str) -> bool:
        """Whether an array is bound to a name by one statement only, which no loop repeats."""
        return len(self.bindings.get(name, ())) == 1 and id(self.bindings[name][0]) not in self._in_loops

    def meet(self, *paths: frozenset[str] | None) -> None:
        """Go on where several paths come together."""
        reached = [p for p in paths if p is not None]
        self.bound = frozenset.intersection(*reached) if reached else None


def _loops(function: Any) -> Iterable[Any]:
    return (n for n in ast.walk(function) if isinstance(n, ast.For | ast.While))


def kind_of_constant(node: Any, value: Any) -> Scalar:
    """A number of the text or of the module."""
    if isinstance(value, bool):
        return Scalar(node, TRUTH)
    if isinstance(value, int):
        return Scalar(node, WHOLE, Size(value))
    return Scalar(node, REAL if isinstance(value, float) else UNKNOWN)

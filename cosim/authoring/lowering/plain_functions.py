"""Functions in which there is nothing to lower, found at a glance: they reach arrays element by element only.

That spares most functions, at every start, the long way through `lowered_functions`.
"""

from __future__ import annotations

import ast
import types
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from cosim.authoring.author_source import arguments_of, function_text
from cosim.authoring.dataflow.array_operations import SHAPE
from cosim.authoring.scope import resolve, scope_of


class Glance:
    """A look at a function and the helpers that it calls.

    seen: by function, its node and what its global names stood for.
    """

    def __init__(self) -> None:
        self.seen: dict[Any, tuple[Any, dict[str, Any]]] = {}
        self._known: dict[Any, bool] = {}

    def is_current(self) -> bool:
        """Whether all that was seen is as it was."""
        return all(
            (text := function_text(python)) is not None
            and text.node is node
            and all(python.__globals__.get(name) is value for name, value in names.items())
            for python, (node, names) in self.seen.items()
        )

    def is_plain(self, python: Any, axes: Mapping[str, int]) -> bool:
        """Whether a function, and every helper that it calls, takes elements of arrays and does nothing else with them.

        axes: of its arguments, 0 for a number.
        """
        text = function_text(python)
        if text is None:
            return True
        key = python, tuple(axes.items())
        if key not in self._known:
            self._known[key] = False  # what calls itself is looked at closely
            names = {name: python.__globals__.get(name) for name in python.__code__.co_names}
            self.seen[python] = text.node, names
            self._known[key] = _Function(python, axes, self).passes(text.node.body)
        return self._known[key]


class _Function:
    """The expressions of one function."""

    def __init__(self, python: Any, axes: Mapping[str, int], glance: Glance) -> None:
        self._scope = scope_of(cast("types.FunctionType", python))
        for name in (*python.__code__.co_varnames, *python.__code__.co_cellvars):
            self._scope.pop(name, None)
        self._axes = axes
        self._glance = glance

    def passes(self, node: Any) -> bool:
        """Whether there is nothing to lower in a node, or a list of them."""
        match node:
            case list():
                return all(map(self.passes, node))
            case ast.Name():
                return not self._array(node)
            case ast.Subscript(value=ast.Name()) if self._array(node.value):
                return self._left(node) == 0 and self.passes(node.slice)
            case ast.Attribute(value=ast.Name()) if self._array(node.value):
                return node.attr in SHAPE
            case ast.Call():
                return self._call(node)
            case ast.List() | ast.BinOp(op=ast.MatMult()) | ast.AugAssign(op=ast.MatMult()):
                return False
        return all(self.passes(child) for child in ast.iter_child_nodes(node) if child._fields)  # no mere operators

    def _left(self, node: Any) -> int:
        """The number of axes of an array, or of a part of one by indices; -1 for anything else that an array is in."""
        if isinstance(node, ast.Name):
            return self._array(node)
        if not (isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and self._array(node.value)):
            return 0
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        left = self._array(node.value) - len(indices)
        return -1 if any(isinstance(i, ast.Slice | ast.Starred) for i in indices) else left

    def _array(self, node: Any) -> int:
        """The number of axes that a name has, 0 where it is no array."""
        if (axes := self._axes.get(node.id)) is not None:
            return axes
        value = self._scope.get(node.id)
        return value.ndim if isinstance(value, np.ndarray) else 0

    def _call(self, node: ast.Call) -> bool:
        rest = [*node.args, *(k.value for k in node.keywords)]
        match node.func:
            case ast.Attribute(value=ast.Name() as array, attr="fill") if self._array(array):
                return self.passes(rest)
            case ast.Attribute(value=ast.Call() as number) if self._is_number(number):  # such as its bits
                return self.passes([number, *rest])
        function = resolve(node.func, self._scope)
        function = getattr(function, "py_func", function)
        if not isinstance(function, types.FunctionType):
            known = isinstance(function, np.ufunc | type) or getattr(function, "__module__", "") in ("math", "builtins")
            return known and self.passes(rest)
        text = function_text(function) if isinstance(node.func, ast.Name) else None
        if text is None or node.keywords or len(node.args) != len(arguments_of(text.node)):
            return False
        axes = [self._left(a) for a in node.args]
        given = [
            a.slice if isinstance(a, ast.Subscript) and left > 0 else a for a, left in zip(node.args, axes, strict=True)
        ]
        given = [a for a in given if not (isinstance(a, ast.Name) and self._array(a))]
        if min(axes, default=0) < 0:
            return False
        names = [a.arg for a in arguments_of(text.node)]
        return self.passes(given) and self._glance.is_plain(function, dict(zip(names, axes, strict=True)))

    def _is_number(self, node: ast.Call) -> bool:
        """Whether a call makes one of numpy's numbers, if what it is given is one."""
        made = resolve(node.func, self._scope)
        return isinstance(made, type) and issubclass(made, np.generic)

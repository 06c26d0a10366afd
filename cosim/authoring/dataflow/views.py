"""Of which arguments a name or an expression may be another view, or certainly is."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable
from typing import Any

from cosim.authoring.dataflow.array_operations import VIEWING, VIEWS, views_first
from cosim.authoring.dataflow.bindings import Element
from cosim.authoring.dataflow.effects import Effects
from cosim.authoring.dataflow.symbols import Symbols

#: The effects of the author's function that a call calls; None where they cannot be told.
Called = Callable[[ast.Call], Effects | None]


class Views:
    """Which expressions of one function are views of which of its arguments."""

    def __init__(self, symbols: Symbols, called: Called) -> None:
        self.symbols = symbols
        self._called = called
        self._of_locals: dict[str, frozenset[str]] = {}
        for _ in range(4):  # a chain of views of views ends
            before = dict(self._of_locals)
            for name, values in symbols.bindings.items():
                self._of_locals[name] = self._of_all(values) - ({name} & {*symbols.arguments})
            if before == self._of_locals:
                return

    def roots(self, node: Any) -> frozenset[str]:
        """The arguments whose elements an expression's value may be, other than by copy."""
        match node:
            case ast.Name():
                own = {node.id} & {*self.symbols.arguments}
                return self._of_locals.get(node.id, frozenset()) | own
            case Element() | ast.Subscript():
                return self.roots(node.value) if self.symbols.axes(node) != 0 else frozenset()
            case ast.Attribute():
                return self.roots(node.value) if node.attr in VIEWS else frozenset()
            case ast.Starred() | ast.NamedExpr():
                return self.roots(node.value)
            case ast.IfExp():
                return self._of_all([node.body, node.orelse])
            case ast.BoolOp():
                return self._of_all(node.values)
            case ast.Tuple() | ast.List():
                return self._of_all(node.elts)
            case ast.Call():
                return self._returned(node)
        return frozenset()

    def sure_root(self, node: Any) -> str | None:
        """The one argument that what is written through an expression certainly belongs to."""
        while isinstance(node, ast.Subscript | ast.Attribute | ast.Call):
            if isinstance(node, ast.Call):
                node = node.func
                if not (isinstance(node, ast.Attribute) and node.attr in VIEWING):
                    return None
            node = node.value
        return self._only_root(node.id) if isinstance(node, ast.Name) else None

    def _only_root(self, name: str) -> str | None:
        """The one argument whose elements a name stands for wherever it is used."""
        bindings = self.symbols.bindings
        if name in self.symbols.arguments:
            return None if name in bindings else name
        roots = {self.roots(value) for value in bindings.get(name, ())}
        only = roots.pop() if len(roots) == 1 else frozenset()
        return next(iter(only)) if len(only) == 1 else None

    def _of_all(self, nodes: Iterable[Any]) -> frozenset[str]:
        return frozenset().union(*map(self.roots, nodes))

    def _returned(self, call: ast.Call) -> frozenset[str]:
        """The arguments that what a call returns may be a view of."""
        func, value = call.func, self.symbols.outside(call.func)
        if isinstance(func, ast.Attribute) and func.attr in VIEWING and value is None:
            return self.roots(func.value)
        if views_first(value) and call.args:
            return self.roots(call.args[0])
        if value in (zip, enumerate, reversed, iter, tuple, list):
            return self._of_all(call.args)
        inner = self._called(call)
        if inner is None:
            return frozenset()
        return self._of_all(given for name, given in inner.given(call) if name in inner.handed_on)

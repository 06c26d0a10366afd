"""What an expression reads, and writes by calls."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from typing import Any

from cosim.authoring.dataflow.array_operations import READING, WRITING, is_harmless, reads_elements, written_by_numpy
from cosim.authoring.dataflow.effects import Effects
from cosim.authoring.dataflow.record import WalkRecord
from cosim.authoring.dataflow.views import Called, Views
from cosim.authoring.dataflow.written import Elements, Written, meet


class Expressions:
    """The walk through expressions; each step gives what is written after it."""

    def __init__(self, views: Views, called: Called, elements: Elements, record: WalkRecord) -> None:
        self._views = views
        self._called = called
        self._elements = elements
        self._record = record

    def follow(self, node: Any, written: Written) -> Written:
        """An expression; None for one that is not there."""
        match node:
            case None | ast.Constant() | ast.Name() | ast.Lambda():
                return written
            case ast.BoolOp():
                return self._bool(node, written)
            case ast.IfExp():
                written = self.follow(node.test, written)
                return meet(self.follow(node.body, written), self.follow(node.orelse, written))
            case ast.ListComp() | ast.SetComp() | ast.GeneratorExp() | ast.DictComp():
                return self._comprehension(node, written)
        parts = _parts(node)
        for part in parts:
            written = self.follow(part, written)
        return self._after(node, parts, written)

    def _after(self, node: Any, parts: list[Any], written: Written) -> Written:
        """What an expression does with its parts, once they are there."""
        match node:
            case ast.NamedExpr():
                self._record.rebind(node, node.target.id)
            case ast.BinOp() | ast.Compare() | ast.UnaryOp():
                for operand in parts:
                    self._operand(operand, written)
            case ast.Subscript() if self._views.symbols.axes(node) == 0:
                self._record.read(node, self._views.roots(node.value), written)
            case ast.Call():
                return self._call(node, written)
        return written

    def _bool(self, node: ast.BoolOp, written: Written) -> Written:
        first = self.follow(node.values[0], written)
        for value in node.values[1:]:
            self._operand(value, self.follow(value, first))
        return first

    def _comprehension(self, node: Any, written: Written) -> Written:
        written = self.follow(node.generators[0].iter, written)
        for n in ast.walk(node):
            if isinstance(n, ast.Call):
                self._call(n, written)
        return written

    def _operand(self, node: Any, written: Written) -> None:
        """A whole array as an operand is read."""
        if isinstance(node, ast.Name):
            self._record.read(node, self._views.roots(node), written)

    def _call(self, node: ast.Call, written: Written) -> Written:
        func = node.func
        if isinstance(func, ast.Attribute) and func.attr in WRITING and self._views.roots(func.value):
            return self._outs(node, [func.value], written)
        if isinstance(func, ast.Attribute) and func.attr in READING:
            self._reads([func.value, *node.args], written)
        value = self._views.symbols.outside(func)
        if any(value is function for function in (sum, min, max)):
            self._reads(node.args, written)
        outs = written_by_numpy(node, value)
        if outs is not None:
            if reads_elements(value):
                self._reads(node.args[: getattr(value, "nin", None)], written)
            return self._outs(node, outs, written)
        if is_harmless(value):
            return written
        inner = self._called(node)
        return self._unknown_call(node, written) if inner is None else self._helper(node, inner, written)

    def _reads(self, given: Iterable[Any], written: Written) -> None:
        """A call reads whole arrays, or parts of them."""
        for array in given:
            self._record.read(array, self._views.roots(array), written)

    def _outs(self, node: ast.Call, outs: Iterable[Any], written: Written) -> Written:
        """A call writes some expressions as a whole."""
        for out in outs:
            self._record.write(node, self._views.roots(out))
            written = self._elements.mark(written, self._views.sure_root(out))
        return written

    def _helper(self, node: ast.Call, inner: Effects, written: Written) -> Written:
        """A call of another function, whose effects are known, has them on what it is given."""
        early = {place.name for place in inner.stale}
        for name, given in inner.given(node):
            roots = self._views.roots(given)
            if not roots:
                continue
            if name in inner.touched:
                self._record.write(node, roots)
            if name in inner.unknown:
                self._record.effects.unknown |= roots
            if name in early:
                self._record.read(node, roots, written)
            if name in inner.surely:
                written = self._elements.mark(written, self._views.sure_root(given))
        return written

    def _unknown_call(self, node: ast.Call, written: Written) -> Written:
        """What cannot be looked into may write what it is given."""
        for given in (*node.args, *(k.value for k in node.keywords)):
            for root in self._views.roots(given):
                self._record.effects.unknown |= {root}
                written = self._elements.mark(written, root)
        return written


def _parts(node: Any) -> list[Any]:
    """The expressions that an expression is made of, in the order in which they are computed."""
    inner = (child.value if isinstance(child, ast.keyword) else child for child in ast.iter_child_nodes(node))
    return [child for child in inner if isinstance(child, ast.expr)]

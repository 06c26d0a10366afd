"""What a statement stores, and what one does that has no way through it but one."""

from __future__ import annotations

import ast
from typing import Any

from cosim.authoring.author_source import arguments_of
from cosim.authoring.dataflow.expressions import Expressions
from cosim.authoring.dataflow.indices import constant_index
from cosim.authoring.dataflow.record import WalkRecord
from cosim.authoring.dataflow.views import Views
from cosim.authoring.dataflow.written import Elements, Written


class Statements:
    """The walk through simple statements; each step gives what is written after it."""

    def __init__(self, expressions: Expressions, views: Views, elements: Elements, record: WalkRecord) -> None:
        self._expressions = expressions
        self._views = views
        self._elements = elements
        self._record = record

    def follow(self, s: Any, written: Written) -> Written:
        """A statement that neither branches nor leaves."""
        match s:
            case ast.Assign():
                written = self._expressions.follow(s.value, written)
                if any(isinstance(target, ast.Subscript) for target in s.targets):
                    self._record.read(s.value, self._views.roots(s.value), written)
                for target in s.targets:
                    written = self.store(target, written)
            case ast.AnnAssign() if s.value is not None:
                return self.store(s.target, self._expressions.follow(s.value, written))
            case ast.AugAssign():
                return self._augmented(s, self._expressions.follow(s.value, written))
            case ast.Delete():
                for target in s.targets:
                    self.store(target, written)
            case ast.Expr():
                return self._expressions.follow(s.value, written)
            case ast.Assert():
                return self._expressions.follow(s.test, written)
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                return self._nested(s, written)
            case ast.Import() | ast.ImportFrom():
                for alias in s.names:
                    self._record.rebind(s, (alias.asname or alias.name).partition(".")[0])
        return written

    def store(self, target: Any, written: Written) -> Written:
        """Something is stored: a name gets another value, or elements are written."""
        match target:
            case ast.Tuple() | ast.List():
                for part in target.elts:
                    written = self.store(part, written)
            case ast.Starred():
                return self.store(target.value, written)
            case ast.Name():
                self._record.rebind(target, target.id)
            case ast.Subscript():
                return self._elements_of(target, self._expressions.follow(target.slice, written))
            case ast.Attribute():
                return self._elements_of(target, written)
        return written

    def _elements_of(self, target: Any, written: Written) -> Written:
        """Elements are written, of what the target is a part of."""
        self._record.write(target, self._views.roots(target.value))
        sure = self._views.sure_root(target.value)
        direct = isinstance(target.value, ast.Name) and target.value.id == sure
        index = constant_index(target) if isinstance(target, ast.Subscript) and direct else None
        return self._elements.mark(written, sure, index)

    def _augmented(self, s: ast.AugAssign, written: Written) -> Written:
        if isinstance(s.target, ast.Name):
            return self._augmented_name(s, s.target, written)
        written = self._expressions.follow(s.target.value, written)
        if isinstance(s.target, ast.Subscript):
            written = self._expressions.follow(s.target.slice, written)
            self._record.read(s.target, self._views.roots(s.target.value), written)
        return self.store(s.target, written)

    def _augmented_name(self, s: ast.AugAssign, target: ast.Name, written: Written) -> Written:
        """An array is written in place, and anything else gives the name another value."""
        symbols, name = self._views.symbols, target.id
        array = bool(symbols.shapes.get(name))
        if not array:
            self._record.rebind(s, name)
        roots = self._views.roots(target) if array or symbols.axes(target) not in (None, 0) else frozenset()
        self._record.read(s, roots, written)
        self._record.write(s, roots)
        own = name if name in symbols.arguments else None
        return self._elements.mark(written, self._views.sure_root(target) if roots and not array else own)

    def _nested(self, s: Any, written: Written) -> Written:
        """A function in a function: what it writes may be written, once it is called."""
        self._record.rebind(s, s.name)
        own = {a.arg for a in arguments_of(s)} if not isinstance(s, ast.ClassDef) else set()
        for n in ast.walk(s):
            if isinstance(n, ast.Subscript | ast.Attribute) and isinstance(n.ctx, ast.Store | ast.Del):
                roots = self._views.roots(n.value) - own
                self._record.write(n, roots)
                self._record.effects.unknown |= roots
                for root in roots:
                    written = self._elements.mark(written, root)
        return written

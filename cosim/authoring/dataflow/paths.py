"""Every path through a function's statements.

A `for` counts as entered, as no dimension is 0; a `while` only where its condition is constant or counts up from 0 to a
size.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any

from cosim.authoring.dataflow.counting import counts_from_zero, is_empty
from cosim.authoring.dataflow.expressions import Expressions
from cosim.authoring.dataflow.record import WalkRecord
from cosim.authoring.dataflow.statements import Statements
from cosim.authoring.dataflow.turns import plainly_written
from cosim.authoring.dataflow.views import Views
from cosim.authoring.dataflow.written import Written, meet


class Paths:
    """The walk along all paths; each step gives what is written where the next statement begins."""

    def __init__(self, statements: Statements, expressions: Expressions, views: Views, record: WalkRecord) -> None:
        self._statements = statements
        self._expressions = expressions
        self._views = views
        self._record = record
        self._exits: list[Written] = []
        self._breaks: list[list[Written]] = []  # of each loop that is being walked through
        self._continues: list[list[Written]] = []

    def to_the_end(self, body: Sequence[Any]) -> Written:
        """What is written wherever a function ends."""
        end = self._block(body, frozenset())
        return meet(*self._exits, end)

    def _block(self, statements: Sequence[Any], written: Written) -> Written:
        before: Any = None
        for statement in statements:
            written = self._statement(statement, before, written)
            before = statement
        return written

    def _statement(self, s: Any, before: Any, written: Written) -> Written:
        match s:
            case ast.If():
                return self._if(s, written)
            case ast.For() | ast.AsyncFor():
                return self._for(s, written)
            case ast.While():
                return self._while(s, before, written)
            case ast.Try() | ast.TryStar():
                return self._try(s, written)
            case ast.With() | ast.AsyncWith():
                return self._with(s, written)
            case ast.Match():
                return self._match(s, written)
            case ast.Return():
                self._exits.append(self._return(s, written))
                return None
            case ast.Break():
                self._breaks[-1].append(written)
                return None
            case ast.Continue():
                self._continues[-1].append(written)
                return None
            case ast.Raise():
                return None
        return self._statements.follow(s, written)

    def _if(self, s: ast.If, written: Written) -> Written:
        written = self._expressions.follow(s.test, written)
        constant = s.test.value if isinstance(s.test, ast.Constant) else None
        taken = self._block(s.body, None if constant is False else written)
        return meet(taken, self._block(s.orelse, None if constant is True else written))

    def _for(self, s: Any, written: Written) -> Written:
        written = self._expressions.follow(s.iter, written)
        end, breaks = self._turn(s.body, self._statements.store(s.target, written))
        if is_empty(s.iter, self._views.symbols):
            end = written
        return meet(self._block(s.orelse, end), *breaks)

    def _while(self, s: ast.While, before: Any, written: Written) -> Written:
        written = self._expressions.follow(s.test, written)
        end, breaks = self._turn(s.body, written)
        if isinstance(s.test, ast.Constant) and s.test.value:  # it ends by `break` only
            end = None
        elif not counts_from_zero(s.test, before, self._views.symbols):
            end = written
        return meet(self._block(s.orelse, end), *breaks)

    def _turn(self, body: Sequence[Any], written: Written) -> tuple[Written, list[Written]]:
        """Walk through a loop's body: what is written at its end, and at each `break`."""
        self._breaks.append([])
        self._continues.append([])
        with self._record.pardoned(plainly_written(body, self._views)):
            end = self._block(body, written)
        return meet(end, *self._continues.pop()), self._breaks.pop()

    def _try(self, s: Any, written: Written) -> Written:
        tried = self._block(s.body, written)
        ends = [self._block(s.orelse, tried)]
        for handler in s.handlers:
            if handler.name:
                self._record.rebind(handler, handler.name)
            ends.append(self._block(handler.body, written))  # it may fail before its first write
        end = meet(*ends)
        if not s.finalbody:
            return end
        final = self._block(s.finalbody, written if end is None else end)
        return None if end is None else final

    def _with(self, s: Any, written: Written) -> Written:
        for item in s.items:
            written = self._expressions.follow(item.context_expr, written)
            if item.optional_vars:
                written = self._statements.store(item.optional_vars, written)
        return self._block(s.body, written)

    def _match(self, s: ast.Match, written: Written) -> Written:
        written = self._expressions.follow(s.subject, written)
        ends = [self._block(case.body, self._pattern(case, written)) for case in s.cases]
        total = any(isinstance(c.pattern, ast.MatchAs) and not c.pattern.pattern and not c.guard for c in s.cases)
        return meet(*ends, *([] if total else [written]))

    def _pattern(self, case: ast.match_case, written: Written) -> Written:
        for n in ast.walk(case.pattern):
            name = getattr(n, "name", None) or getattr(n, "rest", None)
            if isinstance(name, str):
                self._record.rebind(n, name)
        return self._expressions.follow(case.guard, written)

    def _return(self, s: ast.Return, written: Written) -> Written:
        if s.value is None:
            return written
        self._record.effects.handed_on |= self._views.roots(s.value)
        if not (isinstance(s.value, ast.Constant) and s.value.value is None):
            self._record.effects.returned.append(s)
        return self._expressions.follow(s.value, written)

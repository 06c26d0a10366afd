"""Statements of an author's function: those that store whole arrays become loops, the others stay as they are."""

from __future__ import annotations

import ast
import copy
from collections.abc import Sequence
from typing import Any

from cosim.authoring.dataflow.bindings import stored as stored_names
from cosim.authoring.lowering import linear_calls, syntax
from cosim.authoring.lowering.array_names import ArrayNames
from cosim.authoring.lowering.loop_targets import iterated
from cosim.authoring.lowering.lowered_values import Array, Scalar, Several, Value, result_of
from cosim.authoring.lowering.names import Names
from cosim.authoring.lowering.returning import Returning
from cosim.authoring.lowering.slicing import indices
from cosim.authoring.lowering.work import Into, Lowerer, Refusal, Work, value_type


class _Stores:
    """Statements that store numbers and arrays."""

    def __init__(self, work: Work, names: Names, expressions: Lowerer) -> None:
        self._work = work
        self._names = names
        self._expressions = expressions
        self._binding = ArrayNames(work, names)

    def _assign(self, s: Any, targets: Sequence[Any], node: Any) -> None:
        value = self._expressions.lower(node, self._into(targets))
        if len(targets) == 1 and isinstance(value, Scalar) and not isinstance(targets[0], ast.Subscript):
            self._scalar(s, targets[0], value)
            return
        if len(targets) > 1:
            value = self._binding.apart(value, s)
        for target in targets:
            self._store(target, value, s)

    def _into(self, targets: Sequence[Any]) -> Into | None:
        """Where a value may be computed at once, without memory in between."""
        target = targets[0]
        if len(targets) > 1:
            return None
        if isinstance(target, ast.Name) and target.id not in self._names.arguments:
            known = self._names.values.get(target.id)
            if known is None or (isinstance(known, Array) and self._binding.owns(target.id)):
                return Into(target.id, known)
        if isinstance(target, ast.Subscript) and isinstance(target.value, ast.Name) and _is_whole(target):
            known = self._names.values.get(target.value.id)
            return Into("", known) if isinstance(known, Array) else None
        return None

    def _scalar(self, s: Any, target: Any, value: Scalar) -> None:
        """A number, or a tuple of numbers, gets a name or several."""
        if isinstance(target, ast.Name):
            self._binding.number(target, value)
            self._emit_assign(s, target, value)
            return
        for name in stored_names(ast.walk(target)):
            self._binding.number(ast.copy_location(ast.Name(name, ast.Store()), target), Scalar(syntax.name(name)))
        self._emit_assign(s, target, value)

    def _emit_assign(self, s: Any, target: Any, value: Scalar) -> None:
        if value.node is s.value and getattr(s, "targets", [target]) == [target]:
            self._work.emit(s)
        else:
            self._work.emit(ast.copy_location(ast.Assign([target], value.node), s))

    def _store(self, target: Any, value: Value, s: Any) -> None:
        match target:
            case ast.Name():
                if isinstance(value, Scalar):
                    self._binding.number(target, value)
                    self._emit_assign(s, target, value)
                else:
                    self._binding.bind(target, value, s)
            case ast.Tuple() | ast.List():
                self._taken_apart(target, value, s)
            case ast.Subscript():
                self._part(target, value, s)
            case _:
                if isinstance(value, Scalar):
                    self._emit_assign(s, target, value)

    def _taken_apart(self, target: Any, value: Value, s: Any) -> None:
        if isinstance(value, Several) and len(value.items) == len(target.elts):
            given = stored_names(ast.walk(target))
            roots = [item.root for item in value.items if isinstance(item, Array)]
            for part, item in zip(target.elts, value.items, strict=True):
                if isinstance(item, Array):
                    goes = item.root in given and roots.count(item.root) == 1
                    self._binding.note(part, item, goes)
            apart = self._binding.apart(value, s)
            for part, item in zip(target.elts, apart.items if isinstance(apart, Several) else (), strict=True):
                self._store(part, item, s)
        elif isinstance(value, Scalar):
            self._scalar(s, target, value)
        else:
            fix = "take its elements one by one, such as a = u[0]"
            self._work.refuse(target, f"takes `{syntax.brief(s.value)}` apart into {len(target.elts)} names", fix)

    def _part(self, target: ast.Subscript, value: Value, s: Any) -> None:
        """Elements of an array are written, or of a tuple, which numba refuses."""
        owner = self._expressions.lower(target.value)
        if not isinstance(owner, Array):
            if isinstance(value, Scalar):
                self._emit_assign(s, target, value)
                return
            self._work.refuse(target, f"puts an array into `{syntax.brief(target.value)}`, which is no array", "")
        self._work.writes(owner)
        if isinstance(value, Several):
            self._work.refuse(target, "puts a tuple of arrays into an array", "write its parts one by one")
        if isinstance(value, Scalar):
            kept = self._index(target, owner)
            self._emit_assign(s, kept, value)
            return
        region = owner if _is_whole(target) and owner.storage else self._expressions.part(target, owner)
        if isinstance(region, Array):
            self._work.store(region, value, s)
            return
        fix = f"write the element, such as {ast.unparse(target)} = …[0], or into a slice"
        self._work.refuse(s, f"puts an array of shape {value.kind} where one number has its place", fix)

    def _index(self, target: ast.Subscript, owner: Array) -> Any:
        """The target of a number, which numba and numpy put into one element or many."""
        with self._work.inside() as before:
            region = self._expressions.part(target, owner)
        if isinstance(region, Scalar):
            self._work.emit(*before)
            kept = copy.copy(region.node)
            kept.ctx = ast.Store()
            return target if region.node is target else kept
        *before, view = before
        self._work.emit(*before)
        kept = copy.copy(view.value)
        kept.ctx = ast.Store()
        return kept

    def _augmented(self, s: ast.AugAssign) -> None:
        if isinstance(s.target, ast.Name):
            known = self._expressions.lower(ast.copy_location(ast.Name(s.target.id, ast.Load()), s.target))
        elif isinstance(s.target, ast.Subscript):
            owner = self._expressions.lower(s.target.value)
            if not isinstance(owner, Array):
                self._work.emit(self._expressions.rebuilt(s, value=self._expressions.number(s.value).node))
                return
            known = owner if _is_whole(s.target) and owner.storage else self._expressions.part(s.target, owner)
        else:
            self._work.emit(s)
            return
        value = self._expressions.lower(s.value)
        if isinstance(known, Scalar):
            self._added_to_number(s, known, value)
            return
        if isinstance(known, Several) or isinstance(value, Several):
            self._work.refuse(s, "computes with a tuple of arrays", "take it apart first, such as a, b = …")
        self._work.writes(known)
        if isinstance(s.op, ast.MatMult):
            self._work.handled.add(id(s))
            self._work.store(known, _array(linear_calls.product(self._work, known, value, None, s)), s)
            return
        element = result_of(s.op, known.kind.element, value_type(value))
        result = self._work.elementwise([known, value], lambda a, b: ast.BinOp(a, s.op, b), s, element)
        self._work.store(known, result, s)

    def _added_to_number(self, s: ast.AugAssign, known: Scalar, value: Value) -> None:
        if not isinstance(value, Scalar):
            what = f"adds an array to the number `{syntax.brief(s.target)}` in place"
            self._work.refuse(s, what, "give the result a name of its own, or add np.sum(…) of it")
        kept = s.target
        if isinstance(s.target, ast.Subscript):
            kept = copy.copy(known.node)
            kept.ctx = ast.Store()
            kept = s.target if known.node is s.target else kept
        self._work.emit(self._expressions.rebuilt(s, target=kept, value=value.node))


class ArrayStatements(_Stores):
    """The walk through the statements of one function."""

    def __init__(self, work: Work, names: Names, expressions: Lowerer, returning: Returning | None) -> None:
        super().__init__(work, names, expressions)
        self._returning = returning

    def walk(self, body: Sequence[Any]) -> list[Any]:
        """Statements as they are lowered. What is refused is kept, and the walk goes on behind it."""
        found: list[Any] = []
        for statement in body:
            outer = self._work.whole, self._work.writing
            self._work.whole, self._work.writing = getattr(statement, "value", None), []
            with self._work.inside() as lowered:
                try:
                    self._statement(statement)
                    if len(lowered) > 1:  # some of it is done before the rest
                        self._work.refusals += self._work.writing
                except Refusal as refusal:
                    if refusal.what:
                        self._work.refusals.append(refusal)
                    self._names.lost.update(stored_names(ast.walk(statement)))
            self._work.whole, self._work.writing = outer
            syntax.located(lowered, statement)
            found += lowered
        if body and not found:  # its last array needs no statement
            found.append(ast.copy_location(ast.Pass(), body[0]))
        return found

    def finish(self) -> None:
        """What can be judged at the end only."""
        self._binding.judge()

    def _statement(self, s: Any) -> None:
        match s:
            case ast.Assign():
                self._assign(s, s.targets, s.value)
            case ast.AnnAssign() if s.value is not None:
                self._assign(s, [s.target], s.value)
            case ast.AugAssign():
                self._augmented(s)
            case ast.Expr():
                self._expression(s)
            case ast.If():
                self._if(s)
            case ast.For():
                self._for(s)
            case ast.While():
                self._while(s)
            case ast.Return():
                self._return(s)
            case ast.Raise() | ast.Break() | ast.Continue():
                self._work.emit(s)
                self._names.bound = None
            case ast.Assert():
                self._work.emit(self._expressions.rebuilt(s, test=self._expressions.number(s.test).node))
            case _:
                self._work.emit(s)

    def _expression(self, s: ast.Expr) -> None:
        value = self._expressions.lower(s.value)
        if isinstance(value, Scalar):
            self._work.emit(self._expressions.rebuilt(s, value=value.node))

    # ---- branches and loops ----

    def _if(self, s: ast.If) -> None:
        test = self._expressions.number(s.test).node
        before = self._names.bound
        body = self.walk(s.body)
        taken, self._names.bound = self._names.bound, before
        orelse = self.walk(s.orelse)
        self._names.meet(taken, self._names.bound)
        self._work.emit(
            self._expressions.rebuilt(s, test=test, body=_same(s.body, body), orelse=_same(s.orelse, orelse))
        )

    def _for(self, s: ast.For) -> None:
        iterator, values, entered = iterated(self._expressions, s.iter, s.target)
        before = self._names.bound
        for name, value in values.items():
            self._binding.view(name, value)
        body = self.walk(s.body)
        leaves = any(isinstance(n, ast.Break | ast.Continue) for n in ast.walk(s))
        if not entered or leaves or self._names.bound is None:
            self._names.bound = before
        orelse = self.walk(s.orelse)
        parts = {"iter": iterator, "body": _same(s.body, body), "orelse": _same(s.orelse, orelse)}
        self._work.emit(self._expressions.rebuilt(s, **parts))

    def _while(self, s: ast.While) -> None:
        with self._work.inside() as first:
            test = self._expressions.number(s.test).node
        before = self._names.bound
        body = self.walk(s.body)
        forever = isinstance(s.test, ast.Constant) and s.test.value
        self._names.bound = before
        orelse = self.walk(s.orelse)
        if not first:
            parts = {"test": test, "body": _same(s.body, body), "orelse": _same(s.orelse, orelse)}
            self._work.emit(self._expressions.rebuilt(s, **parts))
            return
        if orelse:
            self._work.refuse(s, "computes with arrays in a `while` that has an `else`", "compute before and inside it")
        assert not forever
        leave = syntax.when(ast.UnaryOp(ast.Not(), test), [ast.Break()])
        self._work.emit(ast.While(syntax.constant(True), [*first, leave, *body], []))

    def _return(self, s: ast.Return) -> None:
        if s.value is None or self._returning is None:
            self._work.emit(s)
        else:
            value = self._expressions.lower(s.value, self._returning.into())
            self._work.emit(*self._returning.give(self._work, self._names, value, s))
        self._names.bound = None


def _is_whole(target: ast.Subscript) -> bool:
    """Whether a target is ``array[:]`` or the like of more axes."""
    return all(
        isinstance(i, ast.Slice) and i.lower is None and i.upper is None and i.step is None for i in indices(target)
    )


def _same(old: list[Any], new: list[Any]) -> list[Any]:
    """The old statements, where they are the new ones."""
    alike = len(old) == len(new) and all(a is b for a, b in zip(old, new, strict=True))
    return old if alike else new


def _array(value: Value) -> Array:
    assert isinstance(value, Array)
    return value

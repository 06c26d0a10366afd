"""What a function does to the arrays that it is given: followed along every path of its syntax tree.

A write of any element counts as a write of the array, except where all indices that a function ever writes are
constants: then each element counts by itself. A `for` counts as entered, as no dimension is 0; a `while` only where
its condition is constant or counts up from 0 to a size. Where nothing but loops over `range` write an array, and all of
them certainly leave out the same element, that is told.
"""

from __future__ import annotations

import ast
import itertools
import types
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cosim.authoring.author_source import arguments_of, function_text

#: Attributes that are another view of the same elements, methods that return one, and methods that write.
VIEWS = frozenset({"T", "flat", "real", "imag"})
VIEWING = frozenset({"reshape", "ravel", "view", "transpose", "squeeze", "swapaxes", "diagonal"})
WRITING = frozenset({"fill", "itemset", "put", "partition", "resize", "setfield", "setflags", "sort"})
VIEWING_FUNCTIONS = frozenset({"asarray", "ascontiguousarray", "atleast_1d", "atleast_2d", "ravel", "reshape"}) | {
    "transpose",
    "squeeze",
    "swapaxes",
    "diagonal",
    "expand_dims",
    "broadcast_to",
}
WRITING_FUNCTIONS = frozenset({"copyto", "put", "place", "putmask", "fill_diagonal", "shuffle"})
SHAPE = frozenset({"size", "shape", "ndim", "dtype", "nbytes", "itemsize", "strides"})

#: An array as a whole, or one of its elements.
Token = str | tuple[str, tuple[int, ...]]
#: What is written on every path that leads here; None where no path does.
Written = frozenset[Token] | None


@dataclass(frozen=True)
class Place:
    """Where a function does something to the argument `name`."""

    node: Any
    name: str


@dataclass(frozen=True)
class LeftOut:
    """An element that no loop reaches: its index along one axis, negative from the end, and one of the loops."""

    loop: Any
    axis: int
    index: int


#: A whole number: a dimension ("": none) whose size it is, and what is added to that.
Extent = tuple[Any, int]


@dataclass
class Effects:
    """What a function does to its arguments.

    surely: those that every path to the end writes; partly: of those that it does not, the elements that are left;
    left_out: of those that loops write, an element that they do not reach;
    maybe: everything that some statement writes, also through views and helpers; rebound: arguments that are given
    another value; returned: `return` statements with a value; stale: reads of what is not yet written on some path;
    handed_on: arguments that the returned value may be a view of.
    """

    arguments: tuple[str, ...]
    surely: frozenset[str] = frozenset()
    partly: dict[str, list[tuple[int, ...]]] = field(default_factory=dict)
    left_out: dict[str, LeftOut] = field(default_factory=dict)
    maybe: list[Place] = field(default_factory=list)
    rebound: list[Place] = field(default_factory=list)
    returned: list[Any] = field(default_factory=list)
    stale: list[Place] = field(default_factory=list)
    handed_on: frozenset[str] = frozenset()
    unknown: frozenset[str] = frozenset()  # given to what cannot be looked into

    @property
    def touched(self) -> frozenset[str]:
        """All arguments that may be written."""
        return frozenset(p.name for p in self.maybe) | self.unknown


def effects(
    function: Any, shapes: Sequence[Sequence[Any] | None], known: dict[Any, Effects | None] | None = None
) -> Effects | None:
    """What a function does to its arguments; None where its source cannot be read, or it calls itself.

    shapes: of each argument, as sizes, with anything else than an int where a size is not known; None for an argument
    of which not even the number of axes is known. known: what has been found of helpers.
    """
    known = {} if known is None else known
    key = (function, tuple(None if s is None else tuple(s) for s in shapes))
    if key not in known:
        known[key] = None  # as long as it is being followed
        text = function_text(function)
        known[key] = _Walk(function, text.node, shapes, known).effects() if text else None
    return known[key]


def meet(*paths: Written) -> Written:
    """What is written whichever path was taken."""
    reached = [p for p in paths if p is not None]
    return frozenset.intersection(*reached) if reached else None


def resolve(node: Any, scope: dict[str, Any]) -> Any:
    """What a name or a dotted name stands for outside the function; None if that is not known."""
    if isinstance(node, ast.Name):
        return scope.get(node.id)
    if isinstance(node, ast.Attribute):
        owner = resolve(node.value, scope)
        return getattr(owner, node.attr, None) if isinstance(owner, types.ModuleType) else None
    return None


def scope_of(function: types.FunctionType) -> dict[str, Any]:
    """The names that a function sees from outside itself."""
    builtins = function.__globals__.get("__builtins__", {})
    scope = dict(vars(builtins) if isinstance(builtins, types.ModuleType) else builtins)
    scope.update(function.__globals__)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            scope[name] = cell.cell_contents
        except ValueError:  # not yet assigned
            scope.pop(name, None)
    return scope


class _Walk:
    """One walk through one function."""

    def __init__(
        self, function: Any, node: Any, shapes: Sequence[Sequence[Any] | None], known: dict[Any, Effects | None]
    ) -> None:
        self.node = node
        self.known = known
        self.names = [a.arg for a in arguments_of(node)]
        self.result = Effects(tuple(self.names))
        self.shapes = dict(zip(self.names, shapes, strict=False))
        self.scope = scope_of(function)
        for name in (*function.__code__.co_varnames, *function.__code__.co_cellvars):
            self.scope.pop(name, None)
        self.bindings = _bindings(node)
        self.asking: set[str] = set()
        self.views: dict[str, frozenset[str]] = {}
        self._find_views()
        self.elements = self._elements()
        self.exits: list[Written] = []
        self.loops: list[tuple[list[Written], list[Written]]] = []
        self.pardoned: list[frozenset[str]] = []
        self.handed: set[str] = set()
        self.unknown: set[str] = set()

    def effects(self) -> Effects:
        """The walk's findings."""
        self.exits.append(self._block(self.node.body, frozenset()))
        written = meet(*self.exits)
        result = self.result
        if written is None:  # it never returns
            result.surely = frozenset(self.names)
        else:
            result.surely = frozenset(n for n in self.names if n in written)
            for name, elements in self.elements.items():
                left = [e for e in elements if (name, e) not in written]
                if 0 < len(left) < len(elements):
                    result.partly[name] = left
            result.left_out = self._left_out()
        result.handed_on = frozenset(self.handed)
        result.unknown = frozenset(self.unknown)
        return result

    # ---- what stands for what ----

    def _find_views(self) -> None:
        """For each local name, the arguments whose elements it may be."""
        for _ in range(4):  # a chain of views of views ends
            before = dict(self.views)
            for name, values in self.bindings.items():
                roots = [r for value in values for r in self.roots(value)]
                self.views[name] = frozenset(roots) - ({name} if name in self.names else set())
            if before == self.views:
                return

    def roots(self, node: Any) -> frozenset[str]:
        """The arguments whose elements an expression's value may be, other than by copy."""
        if isinstance(node, ast.Name):
            own = {node.id} if node.id in self.names else set()
            return frozenset(own) | self.views.get(node.id, frozenset())
        if isinstance(node, _Element | ast.Subscript):
            return self.roots(node.value) if self.axes(node) != 0 else frozenset()
        if isinstance(node, ast.Attribute):
            return self.roots(node.value) if node.attr in VIEWS else frozenset()
        if isinstance(node, ast.Starred | ast.NamedExpr):
            return self.roots(node.value)
        if isinstance(node, ast.IfExp):
            return self.roots(node.body) | self.roots(node.orelse)
        if isinstance(node, ast.BoolOp):
            return frozenset().union(*(self.roots(v) for v in node.values))
        if isinstance(node, ast.Tuple | ast.List):
            return frozenset().union(*(self.roots(e) for e in node.elts))
        if isinstance(node, ast.Call):
            return self._returned_roots(node)
        return frozenset()

    def _returned_roots(self, node: ast.Call) -> frozenset[str]:
        if isinstance(node.func, ast.Attribute) and node.func.attr in VIEWING and self.value(node.func) is None:
            return self.roots(node.func.value)
        value = self.value(node.func)
        if _is_numpy(value) and value.__name__ in VIEWING_FUNCTIONS and node.args:
            return self.roots(node.args[0])
        if value in (zip, enumerate, reversed, iter, tuple, list):
            return frozenset().union(*(self.roots(a) for a in node.args))
        inner = self._effects_of(node)
        if inner is None:
            return frozenset()
        given = self._given(node, inner)
        return frozenset().union(*(self.roots(v) for n, v in given if n in inner.handed_on))

    def axes(self, node: Any) -> int | None:
        """How many axes an expression's value has, where that is known."""
        if isinstance(node, ast.Name):
            if node.id in self.bindings:
                return self._axes_of_local(node.id)
            shape = self.shapes.get(node.id)
            return None if shape is None else len(shape)
        if isinstance(node, _Element):
            inner = self.axes(node.value)
            return None if inner is None else max(0, inner - 1)
        if isinstance(node, ast.Subscript):
            inner = self.axes(node.value)
            indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            if inner is None or any(_is_special(i) for i in indices):
                return None
            return max(0, inner - sum(not isinstance(i, ast.Slice) for i in indices))
        if isinstance(node, ast.Constant):
            return 0
        return None

    def _axes_of_local(self, name: str) -> int | None:
        if name in self.names or name in self.asking:  # made from itself, so that looking does not tell
            return None
        self.asking.add(name)
        found = {self.axes(value) for value in self.bindings[name]}
        self.asking.remove(name)
        return found.pop() if len(found) == 1 else None

    def value(self, node: Any) -> Any:
        """What a callee stands for outside the function; None where that is not known."""
        return resolve(node, self.scope)

    def surely_views(self, name: str) -> str | None:
        """The one argument whose elements a name stands for wherever it is used."""
        if name in self.names:
            return None if name in self.bindings else name
        if name not in self.bindings:
            return None
        roots = {self.roots(value) for value in self.bindings[name]}
        only = roots.pop() if len(roots) == 1 else frozenset()
        return next(iter(only)) if len(only) == 1 else None

    def _sure_root(self, node: Any) -> str | None:
        while isinstance(node, ast.Subscript | ast.Attribute | ast.Call):
            if isinstance(node, ast.Call):
                node = node.func
                if not (isinstance(node, ast.Attribute) and node.attr in VIEWING):
                    return None
            node = node.value
        return self.surely_views(node.id) if isinstance(node, ast.Name) else None

    # ---- elements with constant indices ----

    def _elements(self) -> dict[str, list[tuple[int, ...]]]:
        """Of the arrays of known shape that are written at constant indices only, and by name: all their indices."""
        found = {}
        for name in self.names:
            shape = self.shapes.get(name)
            known = shape is not None and all(isinstance(s, int) for s in shape)
            if not known or not 1 < int(np.prod([int(s) for s in shape or ()])) <= 64:
                continue
            if self._only_constant(name, len(shape or ())):
                found[name] = list(itertools.product(*(range(int(s)) for s in shape or ())))
        return found

    def _only_constant(self, name: str, axes: int) -> bool:
        """Whether an array appears in nothing but `name[constants]` and the like of `name.size`."""
        harmless: set[int] = set()
        for n in ast.walk(self.node):
            inner = n.value if isinstance(n, ast.Subscript | ast.Attribute) else None
            if not (isinstance(inner, ast.Name) and inner.id == name):
                continue
            if isinstance(n, ast.Attribute) and n.attr in SHAPE:
                harmless.add(id(inner))
            elif isinstance(n, ast.Subscript):
                index = _constant_index(n.slice)
                reading = isinstance(n.ctx, ast.Load)
                if reading or (index is not None and len(index) == axes):
                    harmless.add(id(inner))
        names = [n for n in ast.walk(self.node) if isinstance(n, ast.Name) and n.id == name]
        return all(id(n) in harmless for n in names)

    def _mark(self, written: Written, name: str, index: tuple[int, ...] | None = None) -> Written:
        if written is None:
            return None
        elements = self.elements.get(name)
        if elements is None or index is None:
            return written | {name, *((name, e) for e in elements or ())}
        sizes = [int(s) for s in self.shapes[name] or ()]
        place = tuple(i + s if i < 0 else i for i, s in zip(index, sizes, strict=True))
        written = written | {(name, place)}
        return written | {name} if all((name, e) in written for e in elements) else written

    # ---- elements that loops leave out ----

    def _left_out(self) -> dict[str, LeftOut]:
        """For each array that only loops write: an element that certainly all of them leave out."""
        loops = [n for n in ast.walk(self.node) if isinstance(n, ast.For) and self._is_range(n.iter)]
        found = {}
        for name in self.names if loops else ():
            nodes = [p.node for p in self.result.maybe if p.name == name]
            if not nodes or name in self.unknown or name in self.bindings:
                continue
            missed = [self._missed(name, node, loops) for node in nodes]
            common = sorted(set(missed[0]).intersection(*missed[1:]))
            if common:
                found[name] = LeftOut(missed[0][common[0]], *common[0])
        return found

    def _missed(self, name: str, node: Any, loops: Sequence[ast.For]) -> dict[tuple[int, int], ast.For]:
        """The elements (axis, index) that a statement leaves out for certain, each with its loop."""
        if not (isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id == name):
            return {}
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        shape = self.shapes.get(name)
        if shape is None or len(indices) > len(shape) or any(map(_is_special, indices)):
            return {}
        return {
            (axis, k): loop
            for axis, index in enumerate(indices)
            for loop in self._loops_of(index, node, loops)
            for k in self._not_reached(loop, _extent_of(shape[axis]))
        }

    def _loops_of(self, index: Any, node: Any, loops: Sequence[ast.For]) -> list[ast.For]:
        """The loop that an index is the counter of where the node stands; none where that is not certain."""
        if not isinstance(index, ast.Name):
            return []
        inside = [
            (loop, [n for s in loop.body for n in ast.walk(s)])
            for loop in loops
            if isinstance(loop.target, ast.Name) and loop.target.id == index.id
        ]
        around = [(loop, nodes) for loop, nodes in inside if any(n is node for n in nodes)]
        if len(around) != 1 or index.id in _stored(around[0][1]):
            return []
        return [around[0][0]]

    def _not_reached(self, loop: ast.For, size: Extent | None) -> set[int]:
        """Indices below a size that a loop certainly leaves out; a few of them, -1 for the last."""
        numbers = loop.iter.args  # type: ignore[attr-defined]
        step = _number(numbers[2]) if len(numbers) == 3 else 1
        first, end = (self._extent(n) for n in numbers[:2]) if len(numbers) > 1 else (("", 0), self._extent(numbers[0]))
        if step == -1:  # the same from its other end
            first, end, step = _plus(end, 1), _plus(first, 1), 1
        if step is None or step < 1:
            return set()
        missed: set[int] = set()
        if first and first[0] == "" and first[1] >= 0:
            missed = {*range(min(first[1], _FEW)), *range(first[1] + 1, first[1] + min(step, _FEW))}
        if size and size[0] == "":
            missed = {k for k in missed if k < size[1]}
        if size and end and end[0] == size[0] and end[1] < size[1]:
            missed.add(size[1] - 1 if size[0] == "" else -1)
        return missed

    def _is_range(self, node: Any) -> bool:
        if not (isinstance(node, ast.Call) and self.value(node.func) is range and 0 < len(node.args) < 4):
            return False
        return not node.keywords and not any(isinstance(a, ast.Starred) for a in node.args)

    def _extent(self, node: Any) -> Extent | None:
        """What a whole number is made of, where it follows from sizes and constants."""
        number = _number(node)
        if number is not None:
            return "", number
        match node:
            case ast.Name() if node.id in self.bindings:
                return self._extent_of_local(node.id)
            case ast.Attribute(value=ast.Name(id=name), attr="size") if name in self.names:
                shape = self.shapes.get(name) or ()
                return _extent_of(shape[0]) if len(shape) == 1 and name not in self.bindings else None
            case ast.Call(args=[ast.Name(id=name)]) if self.value(node.func) is len:
                return self._extent_of_axis(name, 0)
            case ast.Subscript(value=ast.Attribute(value=ast.Name(id=name), attr="shape")):
                return self._extent_of_axis(name, _number(node.slice))
            case _Element(value=ast.Attribute(value=ast.Name(id=name), attr="shape")):
                return self._extent_of_axis(name, node.index)
            case ast.BinOp(op=ast.Add() | ast.Sub()) if (number := _number(node.right)) is not None:
                return _plus(self._extent(node.left), number if isinstance(node.op, ast.Add) else -number)
        return _extent_of(resolve(node, self.scope))

    def _extent_of_local(self, name: str) -> Extent | None:
        if name in self.names or name in self.asking or _stored(ast.walk(self.node)).count(name) != 1:
            return None
        self.asking.add(name)
        found = self._extent(self.bindings[name][0])
        self.asking.remove(name)
        return found

    def _extent_of_axis(self, name: str, axis: int | None) -> Extent | None:
        shape = self.shapes.get(name) if name not in self.bindings else None
        return _extent_of(shape[axis]) if shape and axis is not None and -len(shape) <= axis < len(shape) else None

    # ---- statements ----

    def _block(self, statements: Sequence[Any], written: Written) -> Written:
        before: Any = None
        for statement in statements:
            written = self._statement(statement, before, written)
            before = statement
        return written

    def _statement(self, s: Any, before: Any, written: Written) -> Written:
        match s:
            case ast.If():
                written = self._expression(s.test, written)
                constant = s.test.value if isinstance(s.test, ast.Constant) else None
                taken = self._block(s.body, None if constant is False else written)
                return meet(taken, self._block(s.orelse, None if constant is True else written))
            case ast.For() | ast.AsyncFor():
                return self._for(s, written)
            case ast.While():
                return self._while(s, before, written)
            case ast.Return():
                if s.value is not None:
                    written = self._expression(s.value, written)
                    self.handed |= self.roots(s.value)
                    if not (isinstance(s.value, ast.Constant) and s.value.value is None):
                        self.result.returned.append(s)
                self.exits.append(written)
                return None
            case ast.Raise():
                return None
            case ast.Break() | ast.Continue():
                self.loops[-1][isinstance(s, ast.Continue)].append(written)
                return None
            case ast.Try() | ast.TryStar():
                return self._try(s, written)
            case ast.With() | ast.AsyncWith():
                for item in s.items:
                    written = self._expression(item.context_expr, written)
                    if item.optional_vars:
                        written = self._target(item.optional_vars, None, written)
                return self._block(s.body, written)
            case ast.Match():
                written = self._expression(s.subject, written)
                ends = [self._block(case.body, self._patterns(case, written)) for case in s.cases]
                total = any(
                    isinstance(c.pattern, ast.MatchAs) and not c.pattern.pattern and not c.guard for c in s.cases
                )
                return meet(*ends, *([] if total else [written]))
            case ast.Assign():
                written = self._expression(s.value, written)
                for target in s.targets:
                    written = self._target(target, s.value, written)
                return written
            case ast.AnnAssign():
                if s.value is None:
                    return written
                return self._target(s.target, s.value, self._expression(s.value, written))
            case ast.AugAssign():
                return self._augmented(s, self._expression(s.value, written))
            case ast.Delete():
                for target in s.targets:
                    self._target(target, None, written)
                return written
            case ast.Expr():
                return self._expression(s.value, written)
            case ast.Assert():
                return self._expression(s.test, written)
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                return self._nested(s, written)
            case ast.Import() | ast.ImportFrom():
                for alias in s.names:
                    self._rebind(s, (alias.asname or alias.name).partition(".")[0])
                return written
        return written

    def _for(self, s: Any, written: Written) -> Written:
        written = self._expression(s.iter, written)
        inside = self._target(s.target, _Element(s.iter), written)
        breaks, continues = self._loop(s.body, inside)
        end = meet(self.end, *continues)
        if self._is_empty(s.iter):
            end = written
        return meet(self._block(s.orelse, end), *breaks)

    def _while(self, s: Any, before: Any, written: Written) -> Written:
        written = self._expression(s.test, written)
        forever = isinstance(s.test, ast.Constant) and bool(s.test.value)
        breaks, continues = self._loop(s.body, written)
        end: Written = None
        if not forever:
            entered = self._counts_from_zero(s.test, before)
            end = meet(self.end, *continues) if entered else written
        return meet(self._block(s.orelse, end), *breaks)

    def _loop(self, body: Sequence[Any], written: Written) -> tuple[list[Written], list[Written]]:
        """Walk a loop's body; what is written at its end is then in `self.end`."""
        self.loops.append(([], []))
        self.pardoned.append(self._plainly_written(body))
        self.end = self._block(body, written)
        self.pardoned.pop()
        return self.loops.pop()

    def _plainly_written(self, body: Sequence[Any]) -> frozenset[str]:
        """What a loop's body sets, so that a later turn may read what an earlier one wrote.

        What is set from itself, as in `y[q] = y[q] + u[q]`, has to have been set before.
        """
        found: set[str] = set()
        for n in itertools.chain.from_iterable(ast.walk(s) for s in body):
            if isinstance(n, ast.Assign):
                before = self._surely_read(n.value)
                for target in n.targets:
                    for part in target.elts if isinstance(target, ast.Tuple | ast.List) else [target]:
                        found |= self.roots(part.value) - before if isinstance(part, ast.Subscript) else set()
            if isinstance(n, ast.Call) and not _is_harmless(self.value(n.func)):
                found |= {r for a in [*n.args, *(k.value for k in n.keywords)] for r in self.roots(a)}
        return frozenset(found)

    def _surely_read(self, node: Any) -> frozenset[str]:
        """The arrays of which an expression reads an element, whichever way it goes."""
        match node:
            case ast.IfExp():
                return self._surely_read(node.test)
            case ast.BoolOp():
                return self._surely_read(node.values[0])
            case ast.Lambda() | ast.ListComp() | ast.SetComp() | ast.GeneratorExp() | ast.DictComp():
                return frozenset()
            case ast.Subscript() if self.axes(node) == 0:
                return self.roots(node.value) | self._surely_read(node.slice)
        return frozenset().union(*(self._surely_read(child) for child in ast.iter_child_nodes(node)))

    def _is_empty(self, iterator: Any) -> bool:
        if isinstance(iterator, ast.Tuple | ast.List) and not iterator.elts:
            return True
        if not (isinstance(iterator, ast.Call) and self.value(iterator.func) is range and not iterator.keywords):
            return False
        numbers = [_number(a) for a in iterator.args]
        if None in numbers or not 0 < len(numbers) < 4 or (len(numbers) == 3 and numbers[2] == 0):
            return False
        return not range(*[int(n) for n in numbers if n is not None])

    def _counts_from_zero(self, test: Any, before: Any) -> bool:
        """Whether `k < size` follows on `k = 0`, which makes a `while` a `for`."""
        if not (isinstance(test, ast.Compare) and len(test.ops) == 1 and isinstance(test.ops[0], ast.Lt)):
            return False
        zero = (
            isinstance(before, ast.Assign)
            and isinstance(before.value, ast.Constant)
            and before.value.value == 0
            and any(
                isinstance(t, ast.Name) and ast.dump(t).replace("Store", "Load") == ast.dump(test.left)
                for t in before.targets
            )
        )
        return zero and self._is_size(test.comparators[0])

    def _is_size(self, node: Any) -> bool:
        if isinstance(node, ast.Name) and len(self.bindings.get(node.id, [])) == 1:
            node = self.bindings[node.id][0]
        if isinstance(node, _Element):
            return isinstance(node.value, ast.Attribute) and node.value.attr == "shape"
        if isinstance(node, ast.Subscript):
            node = node.value
            return isinstance(node, ast.Attribute) and node.attr == "shape"
        if isinstance(node, ast.Attribute):
            return node.attr == "size"
        number = _number(node)
        return (number is not None and number > 0) or (isinstance(node, ast.Call) and self.value(node.func) is len)

    def _try(self, s: Any, written: Written) -> Written:
        tried = self._block(s.body, written)
        ends = [self._block(s.orelse, tried)]
        for handler in s.handlers:
            if handler.name:
                self._rebind(handler, handler.name)
            ends.append(self._block(handler.body, written))  # it may fail before its first write
        end = meet(*ends)
        if not s.finalbody:
            return end
        final = self._block(s.finalbody, written if end is None else end)
        return None if end is None else final

    def _patterns(self, case: Any, written: Written) -> Written:
        for n in ast.walk(case.pattern):
            name = getattr(n, "name", None) or getattr(n, "rest", None)
            if isinstance(name, str):
                self._rebind(n, name)
        return self._expression(case.guard, written) if case.guard else written

    def _nested(self, s: Any, written: Written) -> Written:
        """A function in a function: what it writes may be written, once it is called."""
        self._rebind(s, s.name)
        own = {a.arg for a in arguments_of(s)} if not isinstance(s, ast.ClassDef) else set()
        for n in ast.walk(s):
            if isinstance(n, ast.Subscript | ast.Attribute) and isinstance(n.ctx, ast.Store | ast.Del):
                for root in self.roots(n.value) - own:
                    self.result.maybe.append(Place(n, root))
                    self.unknown.add(root)
                    written = self._mark(written, root)
        return written

    def _augmented(self, s: ast.AugAssign, written: Written) -> Written:
        if isinstance(s.target, ast.Name):
            name = s.target.id
            array = self.shapes.get(name) is not None and len(self.shapes[name] or ()) > 0
            if name in self.names and not array:
                self.result.rebound.append(Place(s, name))
            roots = self.roots(s.target) if array or self.axes(s.target) not in (None, 0) else frozenset()
            for root in roots:
                self._read(s, root, written)
                self.result.maybe.append(Place(s, root))
            sure = self.surely_views(name) if roots else name if name in self.names else None
            if array and name in self.names:
                sure = name
            return self._mark(written, sure) if sure else written
        written = self._expression(s.target.value, written)
        if isinstance(s.target, ast.Subscript):
            written = self._expression(s.target.slice, written)
            for root in self.roots(s.target.value):
                self._read(s.target, root, written)
        return self._target(s.target, None, written)

    def _target(self, target: Any, value: Any, written: Written) -> Written:
        """Something is stored: a name gets another value, or elements are written."""
        if isinstance(target, ast.Tuple | ast.List):
            for part in target.elts:
                written = self._target(part, None, written)
            return written
        if isinstance(target, ast.Starred):
            return self._target(target.value, None, written)
        if isinstance(target, ast.Name):
            self._rebind(target, target.id)
            return written
        if not isinstance(target, ast.Subscript | ast.Attribute):
            return written
        if isinstance(target, ast.Subscript):
            written = self._expression(target.slice, written)
        for root in sorted(self.roots(target.value)):
            self.result.maybe.append(Place(target, root))
        sure = self._sure_root(target.value)
        if sure is None:
            return written
        direct = isinstance(target.value, ast.Name) and target.value.id == sure
        index = _constant_index(target.slice) if isinstance(target, ast.Subscript) and direct else None
        return self._mark(written, sure, index)

    def _rebind(self, node: Any, name: str) -> None:
        if name in self.names:
            self.result.rebound.append(Place(node, name))

    # ---- expressions ----

    def _expression(self, node: Any, written: Written) -> Written:
        match node:
            case None | ast.Constant() | ast.Name():
                return written
            case ast.NamedExpr():
                written = self._expression(node.value, written)
                self._rebind(node, node.target.id)
                return written
            case ast.BoolOp():
                first = self._expression(node.values[0], written)
                for value in node.values[1:]:
                    self._operand(value, self._expression(value, first))
                return first
            case ast.IfExp():
                written = self._expression(node.test, written)
                return meet(self._expression(node.body, written), self._expression(node.orelse, written))
            case ast.Lambda():
                return written
            case ast.ListComp() | ast.SetComp() | ast.GeneratorExp() | ast.DictComp():
                written = self._expression(node.generators[0].iter, written)
                for n in ast.walk(node):
                    if isinstance(n, ast.Call):
                        self._call(n, written)
                return written
            case ast.BinOp():
                written = self._expression(node.right, self._expression(node.left, written))
                self._operand(node.left, written)
                self._operand(node.right, written)
                return written
            case ast.Compare():
                written = self._expression(node.left, written)
                for value in node.comparators:
                    written = self._expression(value, written)
                for value in (node.left, *node.comparators):
                    self._operand(value, written)
                return written
            case ast.UnaryOp():
                written = self._expression(node.operand, written)
                self._operand(node.operand, written)
                return written
            case ast.Subscript():
                written = self._expression(node.slice, self._expression(node.value, written))
                if self.axes(node) == 0:
                    for root in self.roots(node.value):
                        self._read(node, root, written)
                return written
            case ast.Attribute():
                return self._expression(node.value, written)
            case ast.Call():
                written = self._expression(node.func, written)
                for argument in (*node.args, *(k.value for k in node.keywords)):
                    written = self._expression(argument, written)
                return self._call(node, written)
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr):
                written = self._expression(child, written)
        return written

    def _operand(self, node: Any, written: Written) -> None:
        """A whole array as an operand is read."""
        if isinstance(node, ast.Name):
            for root in self.roots(node):
                self._read(node, root, written)

    def _read(self, node: Any, root: str, written: Written) -> None:
        if written is None or root in written or any(root in names for names in self.pardoned):
            return
        if isinstance(node, ast.Subscript) and root in self.elements:
            index = _constant_index(node.slice)
            if index is not None and (root, index) in written:
                return
        self.result.stale.append(Place(node, root))

    def _call(self, node: ast.Call, written: Written) -> Written:
        func = node.func
        if isinstance(func, ast.Attribute) and func.attr in WRITING and self.roots(func.value):
            self.result.maybe.extend(Place(node, root) for root in sorted(self.roots(func.value)))
            sure = self._sure_root(func.value)
            return self._mark(written, sure) if sure else written
        value = self.value(func)
        outs = _written_by_numpy(node, value)
        if outs is not None:
            for out in outs:
                self.result.maybe.extend(Place(node, root) for root in sorted(self.roots(out)))
                sure = self._sure_root(out)
                written = self._mark(written, sure) if sure else written
            return written
        if _is_harmless(value):
            return written
        inner = self._effects_of(node)
        if inner is None:
            return self._unknown_call(node, written)
        for name, given in self._given(node, inner):
            roots = self.roots(given)
            if not roots:
                continue
            if name in inner.touched:
                self.result.maybe.extend(Place(node, root) for root in sorted(roots))
            if name in inner.unknown:
                self.unknown |= roots
            if any(p.name == name for p in inner.stale):
                for root in roots:
                    self._read(node, root, written)
            sure = self._sure_root(given) if name in inner.surely else None
            written = self._mark(written, sure) if sure else written
        return written

    def _unknown_call(self, node: ast.Call, written: Written) -> Written:
        """What cannot be looked into may write what it is given."""
        for given in (*node.args, *(k.value for k in node.keywords)):
            for root in self.roots(given):
                self.unknown.add(root)
                written = self._mark(written, root)
        return written

    def _effects_of(self, node: ast.Call) -> Effects | None:
        """The effects of a helper on its arguments; None where they cannot be told."""
        helper = getattr(self.value(node.func), "py_func", self.value(node.func))
        if not isinstance(helper, types.FunctionType):
            return None
        starred = any(isinstance(a, ast.Starred) for a in node.args) or any(k.arg is None for k in node.keywords)
        text = function_text(helper)
        if starred or text is None:
            return None
        names = [a.arg for a in arguments_of(text.node)]
        shapes: list[Sequence[Any] | None] = []
        by_name = {k.arg: k.value for k in node.keywords}
        for k, name in enumerate(names):
            given = node.args[k] if k < len(node.args) else by_name.get(name)
            axes = self.axes(given) if given is not None else None
            shapes.append(None if axes is None else (None,) * axes)
        return effects(helper, shapes, self.known)

    def _given(self, node: ast.Call, inner: Effects) -> list[tuple[str, Any]]:
        return [
            *zip(inner.arguments, node.args, strict=False),
            *((k.arg, k.value) for k in node.keywords if k.arg is not None),
        ]


#: Of how many elements that a loop leaves out is asked whether another one writes them.
_FEW = 8


def _extent_of(size: Any) -> Extent | None:
    """A size, or what a name stands for, as an extent."""
    if isinstance(size, str):
        return size, 0
    return ("", int(size)) if isinstance(size, int | np.integer) and not isinstance(size, bool) else None


def _plus(extent: Extent | None, number: int) -> Extent | None:
    return None if extent is None else (extent[0], extent[1] + number)


def _stored(nodes: Iterable[Any]) -> list[str]:
    """The names that are given a value, as often as they are."""
    return [n.id for n in nodes if isinstance(n, ast.Name) and not isinstance(n.ctx, ast.Load)]


class _Element(ast.expr):
    """What stands for one element of an iterable, or of a tuple that is taken apart (then its index is known)."""

    _fields = ("value",)

    def __init__(self, value: Any, index: int | None = None) -> None:
        super().__init__()
        self.value = value
        self.index = index


def _bindings(function: Any) -> dict[str, list[Any]]:
    """For each name that a function binds, the expressions that it may stand for."""
    found: dict[str, list[Any]] = {}

    def bind(target: Any, value: Any) -> None:
        if isinstance(target, ast.Starred):
            bind(target.value, value)
        elif isinstance(target, ast.Name):
            found.setdefault(target.id, []).append(value)
        elif isinstance(target, ast.Tuple | ast.List):
            starred = any(isinstance(part, ast.Starred) for part in target.elts)
            alike = isinstance(value, ast.Tuple | ast.List) and len(value.elts) == len(target.elts)
            for k, part in enumerate(target.elts):
                bind(part, value.elts[k] if alike else _Element(value, None if starred else k))

    for n in _own_nodes(function):
        match n:
            case ast.Assign():
                for target in n.targets:
                    bind(target, n.value)
            case ast.AnnAssign() if n.value is not None:
                bind(n.target, n.value)
            case ast.For() | ast.AsyncFor():
                iterator = n.iter
                sources = iterator.args if isinstance(iterator, ast.Call) and _is_zip(iterator) else []
                if isinstance(n.target, ast.Tuple) and len(sources) == len(n.target.elts):
                    for part, source in zip(n.target.elts, sources, strict=True):
                        bind(part, _Element(source))
                else:
                    bind(n.target, _Element(iterator))
            case ast.NamedExpr():
                bind(n.target, n.value)
            case ast.withitem() if n.optional_vars is not None:
                bind(n.optional_vars, n.context_expr)
    return found


def _own_nodes(function: Any) -> Iterable[Any]:
    """All nodes of a function but those inside functions and classes in it."""
    waiting = list(function.body)
    while waiting:
        node = waiting.pop()
        yield node
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Lambda):
            waiting.extend(ast.iter_child_nodes(node))


def _is_zip(node: ast.Call) -> bool:
    return isinstance(node.func, ast.Name) and node.func.id == "zip"


def _is_special(index: Any) -> bool:
    """Whether an index may change the number of axes in another way than a number or a slice."""
    return isinstance(index, ast.Starred) or (isinstance(index, ast.Constant) and index.value in (None, ...))


def _constant_index(node: Any) -> tuple[int, ...] | None:
    numbers = [_number(n) for n in (node.elts if isinstance(node, ast.Tuple) else [node])]
    return tuple(n for n in numbers if n is not None) if None not in numbers else None


def _number(node: Any) -> int | None:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        inner = _number(node.operand)
        return None if inner is None else -inner
    return node.value if isinstance(node, ast.Constant) and type(node.value) is int else None


def _is_numpy(value: Any) -> bool:
    module = getattr(value, "__module__", None)
    return callable(value) and (isinstance(value, np.ufunc) or (isinstance(module, str) and module.startswith("numpy")))


def _written_by_numpy(node: ast.Call, value: Any) -> list[Any] | None:
    """What a function of numpy writes; None where it is none, or one that is not known."""
    if not _is_numpy(value):
        return None
    outs = [k.value for k in node.keywords if k.arg == "out"]
    if isinstance(value, np.ufunc):
        outs += node.args[value.nin :]
    elif value.__name__ in WRITING_FUNCTIONS:
        outs += node.args[:1]
    return [part for out in outs for part in (out.elts if isinstance(out, ast.Tuple) else [out])]


def _is_harmless(value: Any) -> bool:
    """Whether a function of Python's own writes nothing."""
    module = getattr(value, "__module__", None)
    return value is not None and (module in ("builtins", "math", "cmath") and not isinstance(value, types.FunctionType))

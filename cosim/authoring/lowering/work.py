"""A lowered function while it is written: its statements, the memory that it needs, and what is wrong with it."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, NoReturn, Protocol

from cosim.authoring.lowering import syntax
from cosim.authoring.lowering.axis_sizes import Size, agree
from cosim.authoring.lowering.lowered_values import (
    REAL,
    Array,
    ArrayKind,
    Scalar,
    Several,
    Value,
    broadcast,
    element_of,
    joined,
    reads_of,
    stored,
)


class Refusal(Exception):
    """What a function may not do at a node, and what to write instead; nothing to say where it is a follow-up."""

    def __init__(self, node: Any, what: str, fix: str) -> None:
        super().__init__(what)
        self.node, self.what, self.fix = node, what, fix


@dataclass(frozen=True)
class Temporary:
    """Memory that a lowered function takes as an argument behind the author's own."""

    name: str
    kind: ArrayKind


@dataclass(frozen=True)
class LoweredFunction:
    """A function as the engines run it; temporaries: of which it takes memory behind the author's arguments.

    changed: whether it is another than the author's. result, is_view: see `Returning`; written: the arguments that it
    writes.
    """

    python: Any
    temporaries: tuple[Temporary, ...] = ()
    changed: bool = False
    result: Value | None = None
    is_view: bool = False
    written: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Into:
    """The name that what an expression stands for will have, and the array behind it where there is one yet."""

    name: str
    known: Array | None


@dataclass
class LoweredText:
    """The statements of a function that is being lowered.

    used: all names in it; dimensions: those of whose sizes memory may be; scope: its global names, to which helpers
    are added; handled: of the author's nodes those that are lowered, by id; changed: whether anything was lowered;
    in_place: names whose elements the author writes; sharing: names that may stand for the same memory;
    whole: the expression that the statement is about; writing: calls in it of helpers that write.
    """

    used: set[str]
    dimensions: frozenset[str]
    scope: dict[str, Any]
    added: dict[str, Any] = field(default_factory=dict)
    temporaries: list[Temporary] = field(default_factory=list)
    refusals: list[Refusal] = field(default_factory=list)
    handled: set[int] = field(default_factory=set)
    body: list[Any] = field(default_factory=list)
    changed: bool = False
    in_place: set[str] = field(default_factory=set)
    sharing: frozenset[str] = frozenset()
    whole: Any = None
    writing: list[Refusal] = field(default_factory=list)

    def writes(self, array: Array) -> None:
        """Elements of an array are written in place."""
        self.in_place |= {array.root, array.storage}

    def sharing_with(self, root: str) -> frozenset[str]:
        """All names that may stand for the same memory as one."""
        return self.sharing if root in self.sharing else frozenset({root})

    def refuse(self, node: Any, what: str, fix: str) -> NoReturn:
        """Raises: Refusal."""
        raise Refusal(node, what, fix)

    def fresh(self, stem: str) -> str:
        """A name that nothing has yet."""
        number = 0
        while (found := f"{stem}{number}") in self.used:
            number += 1
        self.used.add(found)
        return found

    def add(self, stem: str, value: Any) -> str:
        """A global name for a value."""
        known = next((name for name, other in self.added.items() if other is value), None)
        if known is None:
            known = self.fresh(stem)
            self.added[known] = value
        return known

    def emit(self, *statements: Any) -> None:
        """Put statements behind those that there are."""
        self.body.extend(statements)

    @contextmanager
    def inside(self) -> Iterator[list[Any]]:
        """Inside, statements are gathered in a list of their own."""
        outer, self.body = self.body, []
        try:
            yield self.body
        finally:
            self.body = outer

    def named(self, value: Scalar) -> Scalar:
        """A number that is computed once."""
        node = value.node
        plain = isinstance(node, (ast.Name, ast.Constant))
        if plain or (isinstance(node, ast.UnaryOp) and isinstance(node.operand, ast.Constant)):
            return value
        name = self.fresh("_number")
        self.emit(syntax.assign(name, node))
        return replace(value, node=syntax.name(name))

    def over(self, sizes: Sequence[Any], body: Callable[[list[Any]], list[Any]]) -> None:
        """Loops along axes, the last one inside; body: the statements at some indices."""
        counters = [self.fresh("_i") for _ in sizes]
        statements = body([syntax.name(c) for c in counters])
        for counter, size in reversed(list(zip(counters, sizes, strict=True))):
            statements = [syntax.loop(counter, size, statements)]
        self.emit(*statements)
        self.used.difference_update(counters)  # they may count again


@dataclass
class Work(LoweredText):
    """The same, with the memory of arrays, and what is stored there."""

    # ---- memory ----

    def room(self, kind: ArrayKind, node: Any, name: str = "", sizes: Callable[[int], Any] | None = None) -> Array:
        """Memory for an array; name: of the array; sizes: along its axes as it runs, where it may be cut short."""
        for size in kind.shape:
            if not size.dimensions() <= self.dimensions:
                fix = "make its size follow from dimensions, such as u.size, or write to a Local"
                self.refuse(node, "makes an array whose size is known only while it runs", fix)
        kind = replace(kind, element=kind.element or REAL)
        if all(size.exact for size in kind.shape):
            name = name or self.fresh("_work")
            self.temporaries.append(Temporary(name, kind))
            return stored(name, name, kind)
        whole = self.fresh("_work")
        self.temporaries.append(
            Temporary(whole, replace(kind, shape=tuple(replace(s, exact=True) for s in kind.shape)))
        )
        name = name or self.fresh("_part")
        assert sizes is not None
        cuts = [ast.Slice(None, sizes(axis)) for axis in range(len(kind.shape))]
        self.emit(syntax.assign(name, syntax.element(whole, cuts)))
        return stored(name, whole, kind)

    def materialised(self, array: Array, node: Any) -> Array:
        """The array where it lies somewhere, so that it may be read in any order, and as often as needed."""
        if array.storage:
            return array
        if array.view is not None:
            name = self.fresh("_view")
            self.emit(syntax.assign(name, array.view))
            return stored(name, array.root, array.kind)
        return self.copied(array, node)

    def ready(self, array: Array, node: Any) -> Array:
        """The array where it costs nothing to read an element of it."""
        return array if array.view is not None else self.copied(array, node)

    def copied(self, array: Array, node: Any) -> Array:
        """The array in memory of its own."""
        room = self.room(array.kind, node, sizes=array.size_at)
        self.each(room, array)
        return room

    def result(self, kind: ArrayKind, given: Sequence[Array], into: Into | None, node: Any, sizes: Any = None) -> Array:
        """Memory for what is computed from arrays, whose elements are read in any order: of its target, if it may."""
        self.changed = True
        if into is None or into.known is None:
            return self.room(kind, node, into.name if into else "", sizes)
        known, roots = into.known, {a.root for array in given for a in array.reads}
        exact = all(size.exact for size in kind.shape)
        fits = known.kind == kind and exact and not roots & self.sharing_with(known.root)
        return known if fits else self.room(kind, node, sizes=sizes)

    def each(self, target: Array, value: Array | Scalar) -> None:
        """Put each element of a value, which fits, into a storage."""
        self.changed = True
        if isinstance(value, Scalar):
            value = self.named(value)

        def body(indices: list[Any]) -> list[Any]:
            one = value.node if isinstance(value, Scalar) else element_of(value, target.kind.shape, indices)
            return [syntax.put(target.storage, indices, one)]

        self.over([target.size_at(axis) for axis in range(target.axes)], body)

    def store(self, target: Array, value: Array | Scalar, node: Any) -> None:
        """Put a value into a storage, which it may be made from. Raises: Refusal where it does not fit."""
        if isinstance(value, Array):
            if value.storage and value.storage == target.storage:
                return
            self.check_fit(value, target, node)
            brought = replace(value, reads=reads_of(value, target.kind.shape))
            if not brought.is_read_in_order(self.sharing_with(target.root), target.storage):
                value = self.copied(value, node)
        if value_type(value) == REAL != target.kind.element:
            fix = "begin it with real numbers, such as 0.0 for 0, or make whole numbers with int(…)"
            self.refuse(node, f"puts {_WORDS[value_type(value)]} into an array of {_WORDS[target.kind.element]}", fix)
        self.each(target, value)

    def check_fit(self, value: Array, target: Array, node: Any) -> None:
        """Have a value's shape checked against the one of where it is put. Raises: Refusal."""
        if value.axes > target.axes:
            self._misfit(value, target, node)
        for axis in range(value.axes):
            given, needed = value.kind.shape[axis], target.kind.shape[axis - value.axes]
            same = agree(given, needed)
            if given.constant == 1:
                continue
            if same is False:
                self._misfit(value, target, node)
            if same is None:
                self.check_sizes(value.size_at(axis), target.size_at(target.axes - value.axes + axis))

    def _misfit(self, value: Array, target: Array, node: Any) -> NoReturn:
        what = f"puts an array of shape {value.kind} where one of shape {target.kind} has its place"
        self.refuse(node, what, "make both of one shape, or take a slice of the longer one")

    def check_sizes(self, size: Any, needed: Any) -> None:
        """Have two sizes compared as the function runs."""
        test = syntax.call("_same_size", size, needed)
        self.scope_runtime()
        self.emit(ast.Expr(test))

    def scope_runtime(self) -> None:
        """Make the checks that lowered functions call known to them."""
        from cosim.authoring.lowering.routines import same_size

        self.added["_same_size"] = same_size

    # ---- element by element ----

    def elementwise(
        self, values: Sequence[Value], make: Callable[..., Any], node: Any, element: str | None = None
    ) -> Array:
        """An array of what `make` makes of the elements of arrays and of numbers. Raises: Refusal."""
        given = [self.one(v, node) for v in values]
        arrays = [v for v in given if isinstance(v, Array)]
        fitted = self.brought(arrays, node)
        shape = fitted.shape

        def at(indices: Sequence[Any]) -> Any:
            return make(*[element_of(v, shape, indices) if isinstance(v, Array) else v.node for v in given])

        def size_at(axis: int) -> Any:
            k, own = fitted.sources[axis]
            return arrays[k].size_at(own)

        self.changed = True
        kind = ArrayKind(shape, joined(*map(value_type, given)) if element is None else element)
        reads = frozenset().union(*(reads_of(a, shape) for a in arrays))
        return Array(kind, at, size_at, reads=reads)

    def one(self, value: Value, node: Any) -> Array | Scalar:
        """A number, which is computed once, or an array. Raises: Refusal for a tuple with arrays."""
        if isinstance(value, Several):
            self.refuse(node, "computes with a tuple of arrays", "take it apart first, such as a, b = …")
        return self.named(value) if isinstance(value, Scalar) else value

    def brought(self, arrays: Sequence[Array], node: Any) -> Any:
        """Bring arrays to one shape. Raises: Refusal where they do not fit."""
        fitted = broadcast(arrays)
        if fitted.wrong:
            a, b = (arrays[k].kind for k in fitted.wrong)
            fix = "make both of one shape, or take a slice of the longer one"
            self.refuse(node, f"computes with arrays of shapes {a} and {b} in `{syntax.brief(node)}`", fix)
        for (k, axis), (other, own) in fitted.checks:
            self.check_sizes(arrays[k].size_at(axis), arrays[other].size_at(own))
        return fitted

    def match(self, a: Array, axis: int, b: Array, other: int, node: Any) -> None:
        """Have two axes be equally long. Raises: Refusal where they are not."""
        same = agree(a.kind.shape[axis], b.kind.shape[other])
        if same is False:
            what = f"multiplies arrays of shapes {a.kind} and {b.kind} in `{syntax.brief(node)}`"
            self.refuse(node, what, "the last axis of the first has to be as long as the first axis of the second")
        if same is None:
            self.check_sizes(b.size_at(other), a.size_at(axis))


_WORDS = {"float64": "real numbers", "int64": "whole numbers", "bool": "truth values", "": "numbers"}


def value_type(value: Array | Scalar) -> str:
    """Of what type its elements are."""
    return value.kind.element if isinstance(value, Array) else value.element


class Lowerer(Protocol):
    """What lowers the expressions of a function."""

    work: Work
    names: Any

    def lower(self, node: Any, into: Into | None = None) -> Value:
        """What an expression stands for. Raises: Refusal."""

    def number(self, node: Any) -> Scalar:
        """An expression that is no array. Raises: Refusal."""

    def size(self, node: Any) -> Size | None:
        """The size that an expression is."""

    def rebuilt(self, node: Any, **parts: Any) -> Any:
        """The node with other parts; the node itself where they are the same."""

    def part(self, node: ast.Subscript, owner: Array) -> Value:
        """An element of an array, or a view of some."""

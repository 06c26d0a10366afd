"""What a helper returns: numbers as they are, a view as one, new arrays in memory that its caller gives it."""

from __future__ import annotations

import ast
from typing import Any

from cosim.authoring.lowering.lowered_values import UNKNOWN, Array, Scalar, Several, Value
from cosim.authoring.lowering.names import Names
from cosim.authoring.lowering.work import Into, Work


class Returning:
    """The returns of one helper.

    result: what it returns, where arrays lie in memory under the names of its own temporaries; None as long as nothing
    is known. is_view: whether that is a view of an argument.
    """

    def __init__(self) -> None:
        self.result: Value | None = None
        self.is_view = False

    def into(self) -> Into | None:
        """Where the value may be computed at once."""
        known = self.result if isinstance(self.result, Array) and not self.is_view else None
        return Into("", known) if known else None

    def give(self, work: Work, names: Names, value: Value, s: Any) -> list[Any]:
        """The statements of one return. Raises: Refusal."""
        view = isinstance(value, Array) and value.view is not None and value.root in names.arguments
        if self.result is None:
            self.is_view = view
        elif self.is_view != view or not _alike(self.result, value) or (view and _root(self.result) != _root(value)):
            fix = "return arrays of one shape on every path, with .copy() where one is an argument"
            work.refuse(s, "returns values of two kinds", fix)
        if isinstance(value, Scalar) or view:
            node = value.node if isinstance(value, Scalar) else value.view  # type: ignore[union-attr]  # a view is an Array
            element = value.element if isinstance(value, Scalar) and self.result is None else UNKNOWN
            self.result = value if view else Scalar(node, element)
            return [s if node is s.value else ast.Return(node)]
        with work.inside() as statements:
            known = self.result
            numbers: list[Any] = []
            self.result = self._kept(work, names, value, known, numbers, s)
        back = numbers[0] if len(numbers) == 1 else ast.Tuple(numbers, ast.Load()) if numbers else None
        return [*statements, ast.Return(back)]

    def _kept(self, work: Work, names: Names, value: Value, known: Value | None, numbers: list[Any], s: Any) -> Value:
        """Put arrays into memory that outlasts the call, and gather the numbers."""
        if isinstance(value, Scalar):
            numbers.append(work.named(value).node)
            return Scalar(value.node, value.element if known is None else UNKNOWN)
        if isinstance(value, Several):
            old = known.items if isinstance(known, Several) else [None] * len(value.items)
            return Several(
                tuple(self._kept(work, names, v, k, numbers, s) for v, k in zip(value.items, old, strict=True))
            )
        if value.view is not None and value.root in names.arguments:
            what = f"returns a part of its argument `{value.root}` among others, which would be the same memory"
            work.refuse(s, what, "return a copy, with .copy()")
        if not all(size.exact for size in value.kind.shape):
            fix = "have it fill an array that it is given"
            work.refuse(s, "returns an array whose size is known only while it runs", fix)
        if isinstance(known, Array):
            work.store(known, value, s)
            return known
        room = work.room(value.kind, s)
        work.each(room, value)
        return room


def _root(value: Value) -> str:
    return value.root if isinstance(value, Array) else ""


def numbers_in(value: Value) -> int:
    """How many numbers a helper hands back beside arrays."""
    return sum(map(numbers_in, value.items)) if isinstance(value, Several) else int(isinstance(value, Scalar))


def _alike(a: Value, b: Value) -> bool:
    if isinstance(a, Several) and isinstance(b, Several):
        return len(a.items) == len(b.items) and all(map(_alike, a.items, b.items))
    if isinstance(a, Array) and isinstance(b, Array):
        return a.axes == b.axes
    return type(a) is type(b)

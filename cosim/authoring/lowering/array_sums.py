"""Sums, extremes and the like of an array: one element after the other, from the first to the last."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from cosim.authoring.lowering import syntax
from cosim.authoring.lowering.lowered_values import REAL, TRUTH, WHOLE, Array, ArrayKind, Scalar, Value
from cosim.authoring.lowering.work import Into, Work

#: By name, the function of numpy.
NUMPY = {"sum": np.sum, "prod": np.prod, "mean": np.mean, "min": np.min, "max": np.max, "any": np.any, "all": np.all}

#: Given the result so far and an element: the statements that take it in.
Step = Callable[[str, Any], list[Any]]


def reduced(work: Work, array: Array, begin: Any, step: Step) -> str:
    """The name of a number that takes in all elements of an array."""
    work.changed = True
    name = work.fresh("_total")
    work.emit(syntax.assign(name, begin))
    work.over([array.size_at(axis) for axis in range(array.axes)], lambda indices: step(name, array.at(indices)))
    return name


def _along(work: Work, array: Array, axis: int, make: Callable[[Array], Scalar], into: Into | None, node: Any) -> Array:
    """A reduction along one axis, for all indices of the others."""
    axis = axis + array.axes if axis < 0 else axis
    if not 0 <= axis < array.axes:
        work.refuse(node, f"asks for axis {axis} of an array of shape {array.kind}", "axes are counted from 0")
    array = work.ready(array, node)
    others = [a for a in range(array.axes) if a != axis]
    found: list[Scalar] = []
    counters = [work.fresh("_at") for _ in others]
    with work.inside() as body:
        fixed = [syntax.name(c) for c in counters]
        row = Array(
            ArrayKind((array.kind.shape[axis],), array.kind.element),
            lambda i: array.at([*fixed[:axis], i[0], *fixed[axis:]]),
            lambda _: array.size_at(axis),
            reads=array.reads,
        )
        found.append(make(row))
    shape = tuple(array.kind.shape[a] for a in others)
    kind = ArrayKind(shape, found[0].element)
    room = work.result(kind, [array], into, node, lambda a: array.size_at(others[a]))
    statements: list[Any] = [*body, syntax.put(room.storage, [syntax.name(c) for c in counters], found[0].node)]
    for counter, other in reversed(list(zip(counters, others, strict=True))):
        statements = [syntax.loop(counter, array.size_at(other), statements)]
    work.emit(*statements)
    return room


def _reduction(make: Callable[[Work, Array], Scalar]) -> Callable[..., Value]:
    def of(work: Work, array: Array, axis: int | None, into: Into | None, node: Any) -> Value:
        if axis is None or array.axes == 1:
            return make(work, array)
        return _along(work, array, axis, lambda row: make(work, row), into, node)

    return of


def _adds(operator: ast.operator) -> Step:
    return lambda name, e: [syntax.assign(name, syntax.binary(syntax.name(name), operator, e))]


def _number(array: Array, value: int) -> Any:
    return syntax.constant(value if array.kind.element in (WHOLE, TRUTH) else float(value))


def _kind(array: Array) -> str:
    return WHOLE if array.kind.element == TRUTH else array.kind.element


def _sum(work: Work, array: Array) -> Scalar:
    step = _adds(ast.Add())
    if array.kind.element == TRUTH:
        step = lambda name, e: [syntax.when(e, _adds(ast.Add())(name, syntax.constant(1)))]  # noqa: E731
    return Scalar(syntax.name(reduced(work, array, _number(array, 0), step)), _kind(array))


def _product(work: Work, array: Array) -> Scalar:
    return Scalar(syntax.name(reduced(work, array, _number(array, 1), _adds(ast.Mult()))), _kind(array))


def _mean(work: Work, array: Array) -> Scalar:
    total = _sum(work, array)
    count = array.size_at(0)
    for axis in range(1, array.axes):
        count = syntax.binary(count, ast.Mult(), array.size_at(axis))
    return Scalar(syntax.binary(total.node, ast.Div(), count), REAL)


def _extreme(function: Any) -> Callable[[Work, Array], Scalar]:
    def of(work: Work, array: Array) -> Scalar:
        called = work.add("_extreme", function)
        begin = array.at([syntax.constant(0)] * array.axes)
        step = lambda name, e: [syntax.assign(name, syntax.call(called, syntax.name(name), e))]  # noqa: E731
        return Scalar(syntax.name(reduced(work, array, begin, step)), array.kind.element)

    return of


def _truth(begin: bool) -> Callable[[Work, Array], Scalar]:
    def of(work: Work, array: Array) -> Scalar:
        def step(name: str, e: Any) -> list[Any]:
            test = ast.UnaryOp(ast.Not(), e) if begin else e
            return [syntax.when(test, [syntax.assign(name, syntax.constant(not begin))])]

        return Scalar(syntax.name(reduced(work, array, syntax.constant(begin), step)), TRUTH)

    return of


def squares(work: Work, array: Array) -> Any:
    """The sum of the squares of an array's elements."""

    def step(name: str, e: Any) -> list[Any]:
        one = work.fresh("_one")
        product = syntax.binary(syntax.name(one), ast.Mult(), syntax.name(one))
        return [syntax.assign(one, e), syntax.assign(name, syntax.binary(syntax.name(name), ast.Add(), product))]

    return syntax.name(reduced(work, array, syntax.constant(0.0), step))


def norm(work: Work, array: Array, axis: int | None, _into: Into | None, node: Any) -> Value | None:
    """The Euclidean norm of a vector, or Frobenius's of a matrix."""
    if axis is not None or len(node.args) > 1:
        return None
    return Scalar(syntax.call(work.add("_root", math.sqrt), squares(work, array)), REAL)


def trace(work: Work, array: Array, axis: int | None, _into: Into | None, node: Any) -> Value | None:
    """The sum of a matrix's diagonal."""
    if axis is not None or array.axes != 2:
        return None
    matrix = work.ready(array, node)
    work.match(matrix, 1, matrix, 0, node)
    kind = ArrayKind(matrix.kind.shape[:1], matrix.kind.element)
    return _sum(work, Array(kind, lambda i: matrix.at([i[0], i[0]]), lambda _: matrix.size_at(0)))


OF = {
    "sum": _reduction(_sum),
    "prod": _reduction(_product),
    "mean": _reduction(_mean),
    "min": _reduction(_extreme(np.minimum)),
    "max": _reduction(_extreme(np.maximum)),
    "any": _reduction(_truth(begin=False)),
    "all": _reduction(_truth(begin=True)),
}

"""Products of vectors and matrices, and systems of equations, as loops in a fixed order."""

from __future__ import annotations

import ast
from dataclasses import replace
from typing import Any

from cosim.authoring.lowering import routines, syntax
from cosim.authoring.lowering.axis_sizes import Size
from cosim.authoring.lowering.lowered_values import (
    REAL,
    WHOLE,
    Access,
    Array,
    ArrayKind,
    Scalar,
    Value,
    has_arrays,
    joined,
)
from cosim.authoring.lowering.work import Into, Work


def transposed(array: Array) -> Array:
    """The same elements with their axes in the opposite order."""
    if array.axes < 2:
        return array
    kind = ArrayKind(array.kind.shape[::-1], array.kind.element)
    view = None if array.view is None else ast.Attribute(array.view, "T", ast.Load())
    return Array(
        kind,
        lambda indices: array.at(list(indices)[::-1]),
        lambda axis: array.size_at(array.axes - 1 - axis),
        root=array.root,
        reads=frozenset(Access(a.root, "") for a in array.reads),
        view=view,
    )


def _vectors(work: Work, a: Value, b: Value, node: Any) -> tuple[Array, Array]:
    """Two arrays of one or two axes, of which any element may be read as often as needed. Raises: Refusal."""
    if not (isinstance(a, Array) and isinstance(b, Array)) or not (a.axes <= 2 and b.axes <= 2):
        fix = "multiply numbers with `*`"
        work.refuse(node, f"multiplies what are no vectors or matrices in `{syntax.brief(node)}`", fix)
    return work.ready(a, node), work.ready(b, node)


def product(work: Work, a: Value, b: Value, into: Into | None, node: Any) -> Value:
    """``a @ b``. Raises: Refusal."""
    left, right = _vectors(work, a, b, node)
    work.match(left, left.axes - 1, right, 0, node)
    element = joined(left.kind.element, right.kind.element)
    rows, columns = left.kind.shape[:-1], right.kind.shape[1:]
    length = right.size_at(0) if left.kind.shape[-1].constant is None else left.size_at(left.axes - 1)
    if not rows and not columns:
        return Scalar(syntax.name(_summed(work, left, right, [], length, element)), element)

    def size_at(axis: int) -> Any:
        return left.size_at(0) if axis < len(rows) else right.size_at(1)

    room = work.result(ArrayKind((*rows, *columns), element), [left, right], into, node, size_at)
    counters = [work.fresh("_at") for _ in room.kind.shape]
    fixed = [syntax.name(c) for c in counters]
    with work.inside() as body:
        total = _summed(work, left, right, fixed, length, element)
        work.emit(syntax.put(room.storage, fixed, syntax.name(total)))
    statements = body
    for axis in reversed(range(len(counters))):
        statements = [syntax.loop(counters[axis], room.size_at(axis), statements)]
    work.emit(*statements)
    return room


def _summed(work: Work, left: Array, right: Array, fixed: list[Any], length: Any, element: str) -> str:
    """The name of a sum of products along a row of one and a column of the other."""
    work.changed = True
    row, column = fixed[: left.axes - 1], fixed[len(fixed) - (right.axes - 1) :]
    name = work.fresh("_total")
    work.emit(syntax.assign(name, syntax.constant(0 if element == WHOLE else 0.0)))

    def body(k: list[Any]) -> list[Any]:
        term = syntax.binary(left.at([*row, *k]), ast.Mult(), right.at([*k, *column]))
        return [syntax.assign(name, syntax.binary(syntax.name(name), ast.Add(), term))]

    work.over([length], body)
    return name


def dot(work: Work, a: Value, b: Value, into: Into | None, node: Any) -> Value | None:
    """``np.dot``: as `product`, and of a number and an array."""
    if isinstance(a, Scalar) and isinstance(b, Scalar):
        return None
    if isinstance(a, Scalar) or isinstance(b, Scalar):
        return work.elementwise([a, b], lambda x, y: syntax.binary(x, ast.Mult(), y), node)
    return product(work, a, b, into, node)


def inner(work: Work, a: Value, b: Value, into: Into | None, node: Any) -> Value | None:
    """``np.inner`` of two vectors."""
    if not (isinstance(a, Array) and isinstance(b, Array) and a.axes == b.axes == 1):
        return None
    return product(work, a, b, into, node)


def outer(work: Work, a: Value, b: Value, into: Into | None, node: Any) -> Value | None:
    """``np.outer`` of two vectors."""
    if not (isinstance(a, Array) and isinstance(b, Array) and a.axes == b.axes == 1):
        return None
    left, right = work.ready(a, node), work.ready(b, node)
    kind = ArrayKind((left.kind.shape[0], right.kind.shape[0]), joined(left.kind.element, right.kind.element))
    room = work.result(kind, [left, right], into, node, lambda axis: (left, right)[axis].size_at(0))
    work.over(
        [left.size_at(0), right.size_at(0)],
        lambda i: [syntax.put(room.storage, i, syntax.binary(left.at(i[:1]), ast.Mult(), right.at(i[1:])))],
    )
    return room


def cross(work: Work, a: Value, b: Value, into: Into | None, node: Any) -> Value | None:
    """``np.cross`` of two vectors of three elements."""
    if not (has_arrays(a) and has_arrays(b)):
        return None
    left, right = _vectors(work, a, b, node)
    for array in (left, right):
        if array.kind.shape != (Size(3),):
            fix = "give it two vectors of three elements"
            work.refuse(node, f"gives `{syntax.brief(node.func)}` an array of shape {array.kind}", fix)
    room = work.result(ArrayKind((Size(3),), joined(left.kind.element, right.kind.element)), [left, right], into, node)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        plus, minus = (
            syntax.binary(left.at([syntax.constant(p)]), ast.Mult(), right.at([syntax.constant(q)]))
            for p, q in ((i, j), (j, i))
        )
        work.emit(syntax.put(room.storage, [syntax.constant(k)], syntax.binary(plus, ast.Sub(), minus)))
    return room


def _factorised(work: Work, a: Value, node: Any) -> tuple[Array, Array, Array] | None:
    """A square matrix, its L and U, and the order of their rows; a singular one stops the run."""
    if not isinstance(a, Array) or a.axes != 2:
        work.refuse(node, f"gives `{syntax.brief(node.func)}` what is no matrix", "give it a matrix of two axes")
    matrix = work.materialised(a, node)
    work.match(matrix, 1, matrix, 0, node)
    size = matrix.kind.shape[0] if matrix.kind.shape[0].exact else matrix.kind.shape[1]
    lu = work.result(ArrayKind((size, size), REAL), [matrix], None, node, matrix.size_at)
    rows = work.room(ArrayKind((size,), WHOLE), node, sizes=matrix.size_at)
    called = syntax.call(work.add("_factorised", routines.factorised), *map(_name, (matrix, lu, rows)))
    text = f"the matrix given to {ast.unparse(node.func)} is singular"
    raising = ast.Raise(ast.Call(syntax.name("ValueError"), [syntax.constant(text)], []), None)
    work.emit(syntax.when(ast.UnaryOp(ast.Not(), called), [raising]))
    return matrix, lu, rows


def _name(array: Array) -> Any:
    return syntax.name(array.storage)


def solve(work: Work, a: Value, b: Value, into: Into | None, node: Any) -> Value | None:
    """``np.linalg.solve``, by elimination with the largest pivots."""
    factors = _factorised(work, a, node)
    if factors is None or not isinstance(b, Array) or b.axes > 2:
        return None
    matrix, lu, rows = factors
    right = work.materialised(b, node)
    work.match(matrix, 1, right, 0, node)
    room = work.result(replace(right.kind, element=REAL), [matrix, right], into, node, right.size_at)
    routine = routines.solved if right.axes == 2 else routines.solved_vector
    called = syntax.call(work.add("_solved", routine), *map(_name, (lu, rows, right, room)))
    work.emit(ast.Expr(called))
    return room


def inverse(work: Work, a: Value, _axis: int | None, into: Into | None, node: Any) -> Value | None:
    """``np.linalg.inv``."""
    factors = _factorised(work, a, node)
    if factors is None:
        return None
    _, lu, rows = factors
    room = work.result(lu.kind, [lu], into, node, lu.size_at)
    work.emit(ast.Expr(syntax.call(work.add("_inverted", routines.inverted), *map(_name, (lu, rows, room)))))
    return room

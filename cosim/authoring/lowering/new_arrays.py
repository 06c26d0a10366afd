"""Arrays that numpy makes: of zeros, of numbers, of other arrays."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from cosim.authoring.lowering import syntax
from cosim.authoring.lowering.axis_sizes import Size
from cosim.authoring.lowering.lowered_values import (
    REAL,
    TRUTH,
    WHOLE,
    Array,
    ArrayKind,
    Scalar,
    Value,
    has_arrays,
    joined,
)
from cosim.authoring.lowering.work import Into, Lowerer, Work

Handler = Callable[[Lowerer, ast.Call, Into | None], Value | None]


def given(node: ast.Call, *names: str) -> list[Any]:
    """A call's arguments in the order of their names; None for one that is left out."""
    by_name = {k.arg: k.value for k in node.keywords}
    return [node.args[k] if k < len(node.args) else by_name.get(name) for k, name in enumerate(names)]


def knows(node: ast.Call, names: Sequence[str]) -> bool:
    """Whether a call gives arguments of these names only."""
    return len(node.args) <= len(names) and all(k.arg in names for k in node.keywords)


def _shape(lowerer: Lowerer, node: Any) -> tuple[Size, ...]:
    """The shape that an argument gives. Raises: Refusal."""
    parts = node.elts if isinstance(node, ast.Tuple | ast.List) else [node]
    if isinstance(node, ast.Attribute) and node.attr == "shape":
        of = lowerer.lower(node.value)
        if isinstance(of, Array):
            return of.kind.shape
    sizes = [lowerer.size(part) for part in parts]
    known = [s for s in sizes if s is not None and s.exact]
    if len(known) < len(sizes):
        fix = "give numbers or sizes of arrays, such as np.zeros(u.size), or write to a Local"
        what = f"makes an array whose size `{syntax.brief(node)}` is known only while it runs"
        lowerer.work.refuse(node, what, fix)
    return tuple(known)


def _element(lowerer: Lowerer, node: Any, otherwise: str) -> str:
    if node is None:
        return otherwise
    text = ast.unparse(node).rpartition(".")[2].strip("'\"")
    kinds = {"float": REAL, "float64": REAL, "int": WHOLE, "int64": WHOLE, "bool": TRUTH, "bool_": TRUTH}
    if text not in kinds:
        what = f"makes an array of `{text}`, and numbers are float64, int64 and bool"
        lowerer.work.refuse(node, what, "leave dtype out")
    return kinds[text]


def _filled(lowerer: Lowerer, kind: ArrayKind, value: Any, into: Into | None, node: Any) -> Array:
    room = lowerer.work.result(kind, [], into, node)
    lowerer.work.each(room, value if isinstance(value, Scalar) else Scalar(syntax.constant(value)))
    return room


def constant_maker(value: float) -> Handler:
    """``np.zeros`` and the like."""

    def make(lowerer: Lowerer, node: ast.Call, into: Into | None) -> Value | None:
        if not knows(node, ("shape", "dtype")):
            return None
        shape, dtype = given(node, "shape", "dtype")
        element = _element(lowerer, dtype, REAL)
        kind = ArrayKind(_shape(lowerer, shape), element)
        content = {REAL: value, WHOLE: int(value), TRUTH: bool(value)}[element]
        return _filled(lowerer, kind, content, into, node)

    return make


def full(lowerer: Lowerer, node: ast.Call, into: Into | None) -> Value | None:
    """``np.full``."""
    if not knows(node, ("shape", "fill_value", "dtype")):
        return None
    shape, value, dtype = given(node, "shape", "fill_value", "dtype")
    content = lowerer.lower(value)
    if not isinstance(content, Scalar):
        return None
    return _filled(
        lowerer, ArrayKind(_shape(lowerer, shape), _element(lowerer, dtype, content.element)), content, into, node
    )


def like(value: float | None) -> Handler:
    """``np.zeros_like`` and the like; None: filled with what is given."""
    names = ("a",) if value is not None else ("a", "fill_value")

    def make(lowerer: Lowerer, node: ast.Call, into: Into | None) -> Value | None:
        if not knows(node, names):
            return None
        model = lowerer.lower(node.args[0])
        if not isinstance(model, Array):
            return None
        content: Any = value if value is not None else lowerer.lower(given(node, *names)[1])
        if value is not None and model.kind.element != REAL:
            content = int(value) if model.kind.element == WHOLE else bool(value)
        room = lowerer.work.result(model.kind, [], into, node, model.size_at)
        lowerer.work.each(room, content if isinstance(content, Scalar) else Scalar(syntax.constant(content)))
        return room

    return make


def eye(lowerer: Lowerer, node: ast.Call, into: Into | None) -> Value | None:
    """``np.eye``."""
    if len(node.args) != 1 or node.keywords:
        return None
    (size,) = _shape(lowerer, node.args[0])
    room = lowerer.work.result(ArrayKind((size, size), REAL), [], into, node)

    def body(indices: list[Any]) -> list[Any]:
        one = ast.IfExp(syntax.compare(indices[0], ast.Eq(), indices[1]), syntax.constant(1.0), syntax.constant(0.0))
        return [syntax.put(room.storage, indices, one)]

    lowerer.work.over([room.size_at(0), room.size_at(1)], body)
    return room


def written_out(lowerer: Lowerer, node: ast.Call, into: Into | None) -> Value | None:
    """``np.array`` of numbers, of rows of numbers, of arrays, or of one array."""
    if not knows(node, ("object", "dtype")):
        return None
    content, dtype = given(node, "object", "dtype")
    if not isinstance(content, ast.List | ast.Tuple):
        return copy(lowerer, lowerer.lower(content), into, node)
    lowerer.work.handled |= {id(n) for n in ast.walk(content) if isinstance(n, ast.List | ast.Tuple)}
    rows: list[Any] = [e.elts if isinstance(e, ast.List | ast.Tuple) else e for e in content.elts]
    if not rows:
        return None
    if all(isinstance(row, list) for row in rows):
        values = [[lowerer.lower(e) for e in row] for row in rows]
        lengths = {len(row) for row in values}
        if len(lengths) > 1:
            lowerer.work.refuse(
                node, "makes a matrix of rows that are not equally long", "give every row as many numbers"
            )
        return _of_numbers(lowerer, values, (Size(len(rows)), Size(lengths.pop())), dtype, into, node)
    parts = [lowerer.lower(e) for e in content.elts]
    if any(isinstance(p, Array) for p in parts):
        return _stacked(lowerer, parts, into, node)
    return _of_numbers(lowerer, [parts], (Size(len(parts)),), dtype, into, node)


def _of_numbers(
    lowerer: Lowerer,
    rows: list[list[Value]],
    shape: tuple[Size, ...],
    dtype: Any,
    into: Into | None,
    node: Any,
) -> Array:
    values = [v for row in rows for v in row]
    if any(has_arrays(v) for v in values):
        lowerer.work.refuse(node, "mixes numbers and arrays in one array", "write its elements one by one")
    numbers = [v for v in values if isinstance(v, Scalar)]
    kind = ArrayKind(shape, _element(lowerer, dtype, joined(*(v.element for v in numbers)) or REAL))
    named = [lowerer.work.named(v) for v in numbers]  # before the first is written: they may be made from the target
    room = lowerer.work.result(kind, [], into, node)
    across = len(rows[0])
    for k, value in enumerate(named):
        index = [k] if len(shape) == 1 else [k // across, k % across]
        lowerer.work.emit(syntax.put(room.storage, [syntax.constant(i) for i in index], value.node))
    return room


def _stacked(lowerer: Lowerer, parts: Sequence[Value], into: Into | None, node: Any) -> Array:
    """Arrays as the rows of another."""
    arrays = [lowerer.work.ready(p, node) for p in parts if isinstance(p, Array)]
    if len(arrays) < len(parts):
        lowerer.work.refuse(node, "mixes numbers and arrays in one array", "write its elements one by one")
    shape = lowerer.work.brought(arrays, node).shape
    kind = ArrayKind((Size(len(parts)), *shape), joined(*(a.kind.element for a in arrays)))
    first = arrays[0]
    room = lowerer.work.result(kind, arrays, into, node, lambda axis: first.size_at(axis - 1))

    def rows(k: int) -> Callable[[list[Any]], list[Any]]:
        return lambda indices: [
            syntax.put(room.storage, [syntax.constant(k), *indices], arrays[k].at(indices)),
        ]

    for k in range(len(arrays)):
        lowerer.work.over([first.size_at(axis) for axis in range(len(shape))], rows(k))
    return room


def concatenated(lowerer: Lowerer, node: ast.Call, into: Into | None) -> Value | None:
    """Vectors, and numbers in brackets, one behind the other."""
    if len(node.args) != 1 or node.keywords or not isinstance(node.args[0], ast.Tuple | ast.List):
        return None
    lowerer.work.handled.add(id(node.args[0]))
    arrays = []
    for part in node.args[0].elts:
        value = (
            written_out(lowerer, ast.copy_location(ast.Call(node.func, [part], []), part), None)
            if isinstance(part, ast.List)
            else lowerer.lower(part)
        )
        if not isinstance(value, Array) or value.axes != 1:
            fix = "join vectors only, and write the rows of matrices one by one, such as P[0, :] = …"
            lowerer.work.refuse(node, f"joins what are no vectors in `{syntax.brief(node)}`", fix)
        arrays.append(lowerer.work.ready(value, node))
    total = Size()
    for array in arrays:
        total = total.plus(array.kind.shape[0])
    if not total.exact:
        lowerer.work.refuse(
            node, "joins slices whose sizes are known only while it runs", "write to a Local of its own"
        )
    room = lowerer.work.result(ArrayKind((total,), joined(*(a.kind.element for a in arrays))), arrays, into, node)
    begin: Any = syntax.constant(0)
    for array in arrays:
        _put_behind(lowerer.work, room, array, begin)
        begin = syntax.binary(begin, ast.Add(), array.size_at(0))
    return room


def _put_behind(work: Work, room: Array, array: Array, begin: Any) -> None:
    work.over(
        [array.size_at(0)],
        lambda i: [syntax.put(room.storage, [syntax.binary(begin, ast.Add(), i[0])], array.at(i))],
    )


def diagonal(lowerer: Lowerer, node: ast.Call, into: Into | None) -> Value | None:
    """``np.diag``, of a vector or of a matrix."""
    value = lowerer.lower(node.args[0]) if len(node.args) == 1 and not node.keywords else None
    if isinstance(node.args[0], ast.List | ast.Tuple):
        value = written_out(lowerer, ast.copy_location(ast.Call(node.func, [node.args[0]], []), node), None)
    if not isinstance(value, Array):
        return None
    array = lowerer.work.ready(value, node)
    if array.axes == 2:
        at = lambda i: array.at([i[0], i[0]])  # noqa: E731
        return replace(array, kind=ArrayKind(array.kind.shape[:1], array.kind.element), at=at, storage="", view=None)
    size = array.kind.shape[0]
    kind = ArrayKind((size, size), array.kind.element)
    room = lowerer.work.result(kind, [array], into, node, lambda _: array.size_at(0))
    zero = syntax.constant(0.0 if array.kind.element == REAL else 0)

    def body(i: list[Any]) -> list[Any]:
        one = ast.IfExp(syntax.compare(i[0], ast.Eq(), i[1]), array.at(i[:1]), zero)
        return [syntax.put(room.storage, i, one)]

    lowerer.work.over([array.size_at(0), array.size_at(0)], body)
    return room


def arange(lowerer: Lowerer, node: ast.Call, into: Into | None) -> Value | None:
    """``np.arange`` of one number."""
    if len(node.args) != 1 or node.keywords:
        return None
    room = lowerer.work.result(ArrayKind(_shape(lowerer, node.args[0]), WHOLE), [], into, node)
    lowerer.work.over([room.size_at(0)], lambda i: [syntax.put(room.storage, i, i[0])])
    return room


def copy(lowerer: Lowerer, value: Value, into: Into | None, node: Any) -> Value | None:
    """An array in memory of its own."""
    if not isinstance(value, Array):
        return None
    room = lowerer.work.result(value.kind, [value], into, node, value.size_at)
    lowerer.work.each(room, value)
    return room

"""What functions of numpy, and methods of arrays, do to whole arrays: as loops."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from cosim.authoring.lowering import linear_calls, reductions, syntax
from cosim.authoring.lowering.axis_sizes import Size
from cosim.authoring.lowering.lowered_values import (
    REAL,
    TRUTH,
    UNKNOWN,
    WHOLE,
    Array,
    ArrayKind,
    Scalar,
    Several,
    Value,
    has_arrays,
    joined,
)
from cosim.authoring.lowering.routines import sign
from cosim.authoring.lowering.work import Into, Work, value_type
from cosim.authoring.shared_operations import SHARED_NUMPY


class Lowerer(Protocol):
    """What lowers the expressions that a call is given."""

    work: Work

    def lower(self, node: Any, into: Into | None = None) -> Value:
        """What an expression stands for."""

    def size(self, node: Any) -> Size | None:
        """The size that an expression is."""


Handler = Callable[[Lowerer, ast.Call, Into | None], Value | None]


def given(node: ast.Call, *names: str) -> list[Any]:
    """A call's arguments in the order of their names; None for one that is left out."""
    by_name = {k.arg: k.value for k in node.keywords}
    return [node.args[k] if k < len(node.args) else by_name.get(name) for k, name in enumerate(names)]


def _knows(node: ast.Call, names: Sequence[str]) -> bool:
    return len(node.args) <= len(names) and all(k.arg in names for k in node.keywords)


# ---- new arrays ----


def _shape(l: Lowerer, node: Any) -> tuple[Size, ...]:  # noqa: E741
    """The shape that an argument gives. Raises: Refusal."""
    parts = node.elts if isinstance(node, ast.Tuple | ast.List) else [node]
    if isinstance(node, ast.Attribute) and node.attr == "shape":
        of = l.lower(node.value)
        if isinstance(of, Array):
            return of.kind.shape
    sizes = [l.size(part) for part in parts]
    known = [s for s in sizes if s is not None and s.exact]
    if len(known) < len(sizes):
        fix = "give numbers or sizes of arrays, such as np.zeros(u.size), or write to a Local"
        l.work.refuse(node, f"makes an array whose size `{syntax.brief(node)}` is known only while it runs", fix)
    return tuple(known)


def _element(l: Lowerer, node: Any, otherwise: str) -> str:
    if node is None:
        return otherwise
    text = ast.unparse(node).rpartition(".")[2].strip("'\"")
    kinds = {"float": REAL, "float64": REAL, "int": WHOLE, "int64": WHOLE, "bool": TRUTH, "bool_": TRUTH}
    if text not in kinds:
        l.work.refuse(node, f"makes an array of `{text}`, and numbers are float64, int64 and bool", "leave dtype out")
    return kinds[text]


def _filled(l: Lowerer, kind: ArrayKind, value: Any, into: Into | None, node: Any) -> Array:
    room = l.work.result(kind, [], into, node)
    l.work.each(room, value if isinstance(value, Scalar) else Scalar(syntax.constant(value)))
    return room


def _constant_maker(value: float) -> Handler:
    def make(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
        if not _knows(node, ("shape", "dtype")):
            return None
        shape, dtype = given(node, "shape", "dtype")
        element = _element(l, dtype, REAL)
        kind = ArrayKind(_shape(l, shape), element)
        content = {REAL: value, WHOLE: int(value), TRUTH: bool(value)}[element]
        return _filled(l, kind, content, into, node)

    return make


def _full(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
    if not _knows(node, ("shape", "fill_value", "dtype")):
        return None
    shape, value, dtype = given(node, "shape", "fill_value", "dtype")
    content = l.lower(value)
    if not isinstance(content, Scalar):
        return None
    return _filled(l, ArrayKind(_shape(l, shape), _element(l, dtype, content.element)), content, into, node)


def _like(value: float | None) -> Handler:
    names = ("a",) if value is not None else ("a", "fill_value")

    def make(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
        if not _knows(node, names):
            return None
        model = l.lower(node.args[0])
        if not isinstance(model, Array):
            return None
        content: Any = value if value is not None else l.lower(given(node, *names)[1])
        if value is not None and model.kind.element != REAL:
            content = int(value) if model.kind.element == WHOLE else bool(value)
        room = l.work.result(model.kind, [], into, node, model.size_at)
        l.work.each(room, content if isinstance(content, Scalar) else Scalar(syntax.constant(content)))
        return room

    return make


def _eye(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
    if len(node.args) != 1 or node.keywords:
        return None
    (size,) = _shape(l, node.args[0])
    room = l.work.result(ArrayKind((size, size), REAL), [], into, node)

    def body(indices: list[Any]) -> list[Any]:
        one = ast.IfExp(syntax.compare(indices[0], ast.Eq(), indices[1]), syntax.constant(1.0), syntax.constant(0.0))
        return [syntax.put(room.storage, indices, one)]

    l.work.over([room.size_at(0), room.size_at(1)], body)
    return room


def _array(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
    """``np.array`` of numbers, of rows of numbers, of arrays, or of one array."""
    if not _knows(node, ("object", "dtype")):
        return None
    content, dtype = given(node, "object", "dtype")
    if not isinstance(content, ast.List | ast.Tuple):
        return _copy(l, l.lower(content), into, node)
    l.work.handled |= {id(n) for n in ast.walk(content) if isinstance(n, ast.List | ast.Tuple)}
    rows = [e.elts if isinstance(e, ast.List | ast.Tuple) else e for e in content.elts]
    if not rows:
        return None
    if all(isinstance(row, list) for row in rows):
        values = [[l.lower(e) for e in row] for row in rows]
        lengths = {len(row) for row in values}
        if len(lengths) > 1:
            l.work.refuse(node, "makes a matrix of rows that are not equally long", "give every row as many numbers")
        return _of_numbers(l, values, (Size(len(rows)), Size(lengths.pop())), dtype, into, node)
    parts = [l.lower(e) for e in content.elts]
    if any(isinstance(p, Array) for p in parts):
        return _stacked(l, parts, into, node)
    return _of_numbers(l, [parts], (Size(len(parts)),), dtype, into, node)


def _of_numbers(
    l: Lowerer,  # noqa: E741
    rows: list[list[Value]],
    shape: tuple[Size, ...],
    dtype: Any,
    into: Into | None,
    node: Any,
) -> Array:
    values = [v for row in rows for v in row]
    if any(has_arrays(v) for v in values):
        l.work.refuse(node, "mixes numbers and arrays in one array", "write its elements one by one")
    numbers = [v for v in values if isinstance(v, Scalar)]
    kind = ArrayKind(shape, _element(l, dtype, joined(*(v.element for v in numbers)) or REAL))
    named = [l.work.named(v) for v in numbers]  # before the first is written: they may be made from the target
    room = l.work.result(kind, [], into, node)
    across = len(rows[0])
    for k, value in enumerate(named):
        index = [k] if len(shape) == 1 else [k // across, k % across]
        l.work.emit(syntax.put(room.storage, [syntax.constant(i) for i in index], value.node))
    return room


def _stacked(l: Lowerer, parts: Sequence[Value], into: Into | None, node: Any) -> Array:  # noqa: E741
    """Arrays as the rows of another."""
    arrays = [l.work.ready(p, node) for p in parts if isinstance(p, Array)]
    if len(arrays) < len(parts):
        l.work.refuse(node, "mixes numbers and arrays in one array", "write its elements one by one")
    shape = l.work.brought(arrays, node).shape
    kind = ArrayKind((Size(len(parts)), *shape), joined(*(a.kind.element for a in arrays)))
    first = arrays[0]
    room = l.work.result(kind, arrays, into, node, lambda axis: first.size_at(axis - 1))

    def rows(k: int) -> Callable[[list[Any]], list[Any]]:
        return lambda indices: [
            syntax.put(room.storage, [syntax.constant(k), *indices], arrays[k].at(indices)),
        ]

    for k in range(len(arrays)):
        l.work.over([first.size_at(axis) for axis in range(len(shape))], rows(k))
    return room


def _concatenated(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
    """Vectors, and numbers in brackets, one behind the other."""
    if len(node.args) != 1 or node.keywords or not isinstance(node.args[0], ast.Tuple | ast.List):
        return None
    l.work.handled.add(id(node.args[0]))
    arrays = []
    for part in node.args[0].elts:
        value = _array(l, ast.copy_location(ast.Call(node.func, [part], []), part), None) if isinstance(part, ast.List) else l.lower(part)
        if not isinstance(value, Array) or value.axes != 1:
            fix = "join vectors only, and write the rows of matrices one by one, such as P[0, :] = …"
            l.work.refuse(node, f"joins what are no vectors in `{syntax.brief(node)}`", fix)
        arrays.append(l.work.ready(value, node))
    total = Size()
    for array in arrays:
        total = total.plus(array.kind.shape[0])
    if not total.exact:
        l.work.refuse(node, "joins slices whose sizes are known only while it runs", "write to a Local of its own")
    room = l.work.result(ArrayKind((total,), joined(*(a.kind.element for a in arrays))), arrays, into, node)
    begin: Any = syntax.constant(0)
    for array in arrays:
        _put_behind(l.work, room, array, begin)
        begin = syntax.binary(begin, ast.Add(), array.size_at(0))
    return room


def _put_behind(work: Work, room: Array, array: Array, begin: Any) -> None:
    work.over(
        [array.size_at(0)],
        lambda i: [syntax.put(room.storage, [syntax.binary(begin, ast.Add(), i[0])], array.at(i))],
    )


def _diagonal(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
    value = l.lower(node.args[0]) if len(node.args) == 1 and not node.keywords else None
    if isinstance(node.args[0], ast.List | ast.Tuple):
        value = _array(l, ast.copy_location(ast.Call(node.func, [node.args[0]], []), node), None)
    if not isinstance(value, Array):
        return None
    array = l.work.ready(value, node)
    if array.axes == 2:
        at = lambda i: array.at([i[0], i[0]])  # noqa: E731
        return replace(array, kind=ArrayKind(array.kind.shape[:1], array.kind.element), at=at, storage="", view=None)
    size = array.kind.shape[0]
    room = l.work.result(ArrayKind((size, size), array.kind.element), [array], into, node, lambda _: array.size_at(0))
    zero = syntax.constant(0.0 if array.kind.element == REAL else 0)

    def body(i: list[Any]) -> list[Any]:
        one = ast.IfExp(syntax.compare(i[0], ast.Eq(), i[1]), array.at(i[:1]), zero)
        return [syntax.put(room.storage, i, one)]

    l.work.over([array.size_at(0), array.size_at(0)], body)
    return room


def _arange(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
    if len(node.args) != 1 or node.keywords:
        return None
    room = l.work.result(ArrayKind(_shape(l, node.args[0]), WHOLE), [], into, node)
    l.work.over([room.size_at(0)], lambda i: [syntax.put(room.storage, i, i[0])])
    return room


def _copy(l: Lowerer, value: Value, into: Into | None, node: Any) -> Value | None:  # noqa: E741
    if not isinstance(value, Array):
        return None
    room = l.work.result(value.kind, [value], into, node, value.size_at)
    l.work.each(room, value)
    return room


# ---- element by element ----


def elementwise(l: Lowerer, node: ast.Call, function: Any) -> Value | None:  # noqa: E741
    """A function of numpy that is one of numbers, where it is given an array."""
    if node.keywords or any(isinstance(a, ast.Starred) for a in node.args) or len(node.args) != function.nin:
        return None
    values = [l.lower(a) for a in node.args]
    if not any(map(has_arrays, values)):
        return None
    same = "l" * function.nin + "->l" in function.types and function not in (np.copysign, np.fabs)
    truth = function in (np.isnan, np.isinf, np.isfinite)
    make = lambda *e: ast.Call(node.func, list(e), [])  # noqa: E731
    return l.work.elementwise(values, make, node, TRUTH if truth else None if same else REAL)


def _sign(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
    if len(node.args) != 1 or node.keywords:
        return None
    value = l.lower(node.args[0])
    name = l.work.add("_sign", sign)
    make = lambda e: syntax.call(name, syntax.call("float", e))  # noqa: E731
    if isinstance(value, Scalar):
        l.work.changed = True
        return Scalar(make(value.node), REAL)
    return l.work.elementwise([value], make, node, REAL)


def _several(l: Lowerer, values: Sequence[Value], make: Any, node: Any, element: str) -> Value:  # noqa: E741
    """Of numbers or arrays, the same."""
    l.work.changed = True
    if any(map(has_arrays, values)):
        return l.work.elementwise(values, make, node, element)
    return Scalar(make(*[v.node for v in values if isinstance(v, Scalar)]), element)


def _real(value: Value) -> Value:
    """A whole number in the text as a real one, so that it may stand beside others."""
    if isinstance(value, Scalar) and isinstance(value.node, ast.Constant) and type(value.node.value) is int:
        return Scalar(syntax.constant(float(value.node.value)), REAL)
    return value


def _types(values: Sequence[Value]) -> str:
    return joined(*(value_type(v) for v in values if not isinstance(v, Several)))


def _clip(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
    arguments = given(node, "a", "a_min", "a_max")
    if any(a is None for a in arguments) or len(node.args) + len(node.keywords) > 3:
        return None
    values = [l.lower(a) for a in arguments]
    if _types(values) in (REAL, UNKNOWN):
        values = [_real(v) for v in values]
    least, most = l.work.add("_least", np.minimum), l.work.add("_most", np.maximum)
    make = lambda x, low, high: syntax.call(least, syntax.call(most, x, low), high)  # noqa: E731
    return _several(l, values, make, node, _types(values))


def _where(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
    if len(node.args) != 3 or node.keywords:
        return None
    test, *values = [l.lower(a) for a in node.args]
    if _types(values) in (REAL, UNKNOWN):
        values = [_real(v) for v in values]
    return _several(l, [test, *values], lambda t, a, b: ast.IfExp(t, a, b), node, _types(values))


def _transposed(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
    value = l.lower(node.args[0]) if len(node.args) == 1 and not node.keywords else None
    return linear_calls.transposed(value) if isinstance(value, Array) else None


def _of_one(make: Callable[..., Value | None]) -> Handler:
    """A function of one array, with an axis perhaps."""

    def call(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
        if not _knows(node, ("a", "axis")):
            return None
        array, axis = given(node, "a", "axis")
        value = l.lower(array)
        number = l.size(axis) if axis is not None else None
        along = number.constant if number else None
        if not isinstance(value, Array) or (axis is not None and along is None):
            return None
        return make(l.work, value, along, into, node)

    return call


def _of_two(make: Callable[..., Value | None]) -> Handler:
    def call(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
        if len(node.args) != 2 or node.keywords:
            return None
        a, b = (l.lower(e) for e in node.args)
        return make(l.work, a, b, into, node)

    return call


def _copied(l: Lowerer, node: ast.Call, into: Into | None) -> Value | None:  # noqa: E741
    return _copy(l, l.lower(node.args[0]), into, node) if len(node.args) == 1 and not node.keywords else None


#: What functions of numpy and of Python's own do where they are given arrays, or make some.
FUNCTIONS: dict[Any, Handler] = {
    np.zeros: _constant_maker(0.0),
    np.empty: _constant_maker(0.0),
    np.ones: _constant_maker(1.0),
    np.full: _full,
    np.zeros_like: _like(0.0),
    np.empty_like: _like(0.0),
    np.ones_like: _like(1.0),
    np.full_like: _like(None),
    np.eye: _eye,
    np.identity: _eye,
    np.array: _array,
    np.asarray: _array,
    np.concatenate: _concatenated,
    np.hstack: _concatenated,
    np.diag: _diagonal,
    np.arange: _arange,
    np.copy: _copied,
    np.sign: _sign,
    np.clip: _clip,
    np.where: _where,
    np.transpose: _transposed,
    np.dot: _of_two(linear_calls.dot),
    np.matmul: _of_two(linear_calls.product),
    np.inner: _of_two(linear_calls.inner),
    np.vdot: _of_two(linear_calls.inner),
    np.outer: _of_two(linear_calls.outer),
    np.cross: _of_two(linear_calls.cross),
    np.linalg.solve: _of_two(linear_calls.solve),
    np.linalg.inv: _of_one(linear_calls.inverse),
    np.linalg.norm: _of_one(reductions.norm),
    np.trace: _of_one(reductions.trace),
    **{function: _of_one(reductions.OF[name]) for name, function in reductions.NUMPY.items()},
    np.amin: _of_one(reductions.OF["min"]),
    np.amax: _of_one(reductions.OF["max"]),
    sum: _of_one(reductions.OF["sum"]),
    min: _of_one(reductions.OF["min"]),
    max: _of_one(reductions.OF["max"]),
}
#: Methods of arrays, by the function of numpy that does the same.
METHODS = {
    **reductions.NUMPY,
    "dot": np.dot,
    "copy": np.copy,
    "clip": np.clip,
    "transpose": np.transpose,
    "trace": np.trace,
}


def handler(function: Any) -> Handler | None:
    """How a function is lowered; None for one that is not known."""
    try:
        if found := FUNCTIONS.get(function):
            return found
        of_numbers = function in SHARED_NUMPY and isinstance(function, np.ufunc)
    except TypeError:  # it cannot be looked up
        return None
    if function is abs or of_numbers:
        ufunc = np.absolute if function is abs else function
        return lambda l, node, into: elementwise(l, node, ufunc)
    return None


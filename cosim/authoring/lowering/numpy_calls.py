"""What functions of numpy, and methods of arrays, do to whole arrays: as loops."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cosim.authoring.lowering import array_sums, linear_calls, new_arrays, syntax
from cosim.authoring.lowering.lowered_values import (
    REAL,
    TRUTH,
    UNKNOWN,
    Array,
    Scalar,
    Several,
    Value,
    has_arrays,
    joined,
)
from cosim.authoring.lowering.new_arrays import Handler, given, knows
from cosim.authoring.lowering.routines import sign
from cosim.authoring.lowering.work import Into, Lowerer, value_type
from cosim.authoring.shared_operations import SHARED_NUMPY

# ---- element by element ----


def elementwise(lowerer: Lowerer, node: ast.Call, function: Any) -> Value | None:
    """A function of numpy that is one of numbers, where it is given an array."""
    if node.keywords or any(isinstance(a, ast.Starred) for a in node.args) or len(node.args) != function.nin:
        return None
    values = [lowerer.lower(a) for a in node.args]
    if not any(map(has_arrays, values)):
        return None
    same = "l" * function.nin + "->l" in function.types and function not in (np.copysign, np.fabs)
    truth = function in (np.isnan, np.isinf, np.isfinite)
    make = lambda *e: ast.Call(node.func, list(e), [])  # noqa: E731
    return lowerer.work.elementwise(values, make, node, TRUTH if truth else None if same else REAL)


def _sign(lowerer: Lowerer, node: ast.Call, _into: Into | None) -> Value | None:
    if len(node.args) != 1 or node.keywords:
        return None
    value = lowerer.lower(node.args[0])
    name = lowerer.work.add("_sign", sign)

    def make(e: Any) -> Any:
        return syntax.call(name, syntax.call("float", e))

    if isinstance(value, Scalar):
        lowerer.work.changed = True
        return Scalar(make(value.node), REAL)
    return lowerer.work.elementwise([value], make, node, REAL)


def _several(lowerer: Lowerer, values: Sequence[Value], make: Any, node: Any, element: str) -> Value:
    """Of numbers or arrays, the same."""
    lowerer.work.changed = True
    if any(map(has_arrays, values)):
        return lowerer.work.elementwise(values, make, node, element)
    return Scalar(make(*[v.node for v in values if isinstance(v, Scalar)]), element)


def _real(value: Value) -> Value:
    """A whole number in the text as a real one, so that it may stand beside others."""
    if isinstance(value, Scalar) and isinstance(value.node, ast.Constant) and type(value.node.value) is int:
        return Scalar(syntax.constant(float(value.node.value)), REAL)
    return value


def _types(values: Sequence[Value]) -> str:
    return joined(*(value_type(v) for v in values if not isinstance(v, Several)))


def _clip(lowerer: Lowerer, node: ast.Call, _into: Into | None) -> Value | None:
    arguments = given(node, "a", "a_min", "a_max")
    if any(a is None for a in arguments) or len(node.args) + len(node.keywords) > 3:
        return None
    values = [lowerer.lower(a) for a in arguments]
    if _types(values) in (REAL, UNKNOWN):
        values = [_real(v) for v in values]
    least, most = lowerer.work.add("_least", np.minimum), lowerer.work.add("_most", np.maximum)
    make = lambda x, low, high: syntax.call(least, syntax.call(most, x, low), high)  # noqa: E731
    return _several(lowerer, values, make, node, _types(values))


def _where(lowerer: Lowerer, node: ast.Call, _into: Into | None) -> Value | None:
    if len(node.args) != 3 or node.keywords:
        return None
    test, *values = [lowerer.lower(a) for a in node.args]
    if _types(values) in (REAL, UNKNOWN):
        values = [_real(v) for v in values]
    return _several(lowerer, [test, *values], ast.IfExp, node, _types(values))


def _transposed(lowerer: Lowerer, node: ast.Call, _into: Into | None) -> Value | None:
    value = lowerer.lower(node.args[0]) if len(node.args) == 1 and not node.keywords else None
    return linear_calls.transposed(value) if isinstance(value, Array) else None


def _of_one(make: Callable[..., Value | None]) -> Handler:
    """A function of one array, with an axis perhaps."""

    def call(lowerer: Lowerer, node: ast.Call, into: Into | None) -> Value | None:
        if not knows(node, ("a", "axis")):
            return None
        array, axis = given(node, "a", "axis")
        value = lowerer.lower(array)
        number = lowerer.size(axis) if axis is not None else None
        along = number.constant if number else None
        if not isinstance(value, Array) or (axis is not None and along is None):
            return None
        return make(lowerer.work, value, along, into, node)

    return call


def _of_two(make: Callable[..., Value | None]) -> Handler:
    def call(lowerer: Lowerer, node: ast.Call, into: Into | None) -> Value | None:
        if len(node.args) != 2 or node.keywords:
            return None
        a, b = (lowerer.lower(e) for e in node.args)
        return make(lowerer.work, a, b, into, node)

    return call


def _copied(lowerer: Lowerer, node: ast.Call, into: Into | None) -> Value | None:
    return (
        new_arrays.copy(lowerer, lowerer.lower(node.args[0]), into, node)
        if len(node.args) == 1 and not node.keywords
        else None
    )


#: What functions of numpy and of Python's own do where they are given arrays, or make some.
FUNCTIONS: dict[Any, Handler] = {
    np.zeros: new_arrays.constant_maker(0.0),
    np.empty: new_arrays.constant_maker(0.0),
    np.ones: new_arrays.constant_maker(1.0),
    np.full: new_arrays.full,
    np.zeros_like: new_arrays.like(0.0),
    np.empty_like: new_arrays.like(0.0),
    np.ones_like: new_arrays.like(1.0),
    np.full_like: new_arrays.like(None),
    np.eye: new_arrays.eye,
    np.identity: new_arrays.eye,
    np.array: new_arrays.written_out,
    np.asarray: new_arrays.written_out,
    np.concatenate: new_arrays.concatenated,
    np.hstack: new_arrays.concatenated,
    np.diag: new_arrays.diagonal,
    np.arange: new_arrays.arange,
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
    np.linalg.norm: _of_one(array_sums.norm),
    np.trace: _of_one(array_sums.trace),
    **{function: _of_one(array_sums.OF[name]) for name, function in array_sums.NUMPY.items()},
    np.amin: _of_one(array_sums.OF["min"]),
    np.amax: _of_one(array_sums.OF["max"]),
    sum: _of_one(array_sums.OF["sum"]),
    min: _of_one(array_sums.OF["min"]),
    max: _of_one(array_sums.OF["max"]),
}
#: Methods of arrays, by the function of numpy that does the same.
METHODS = {
    **array_sums.NUMPY,
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
        return lambda lowerer, node, _: elementwise(lowerer, node, ufunc)
    return None

"""Expressions of an author's function: what stands for whole arrays becomes elements, and statements before it."""

from __future__ import annotations

import ast
import copy
import types
from collections.abc import Callable
from typing import Any

import numpy as np

from cosim.authoring.dataflow.array_operations import SHAPE, VIEWING, WRITING
from cosim.authoring.lowering import linear_calls, numpy_calls, slicing, syntax
from cosim.authoring.lowering.axis_sizes import Size
from cosim.authoring.lowering.lowered_values import (
    TRUTH,
    TUPLE,
    UNKNOWN,
    Array,
    ArrayKind,
    Scalar,
    Several,
    Value,
    has_arrays,
    result_of,
    stored,
)
from cosim.authoring.lowering.names import Names, kind_of_constant
from cosim.authoring.lowering.work import Into, Work
from cosim.authoring.scope import resolve

#: What lowers a call of an author's own function: its work, the call, the function, what it is given, the target.
CallsHelper = Callable[[Any, ast.Call, types.FunctionType, dict[str, Value], Into | None], Value]


class _Parts:
    """Names, and parts of what they stand for."""

    def __init__(self, work: Work, names: Names) -> None:
        self.work = work
        self.names = names

    def lower(self, node: Any, into: Into | None = None) -> Value:
        """What an expression stands for. Raises: Refusal."""
        raise NotImplementedError

    def number(self, node: Any) -> Scalar:
        """An expression that is no array. Raises: Refusal."""
        value = self.lower(node)
        if not isinstance(value, Scalar):
            what = f"has the array `{syntax.brief(node)}` where a number or a truth value has its place"
            self.work.refuse(node, what, "take an element, or say np.any(…), np.all(…), np.linalg.norm(…) or the like")
        return value

    def size(self, node: Any) -> Size | None:
        """The size that an expression is."""
        value = self.lower(node)
        return value.size if isinstance(value, Scalar) else None

    def rebuilt(self, node: Any, **parts: Any) -> Any:
        """The node with other parts; the node itself where they are the same."""
        if all(getattr(node, k) is v or _alike(getattr(node, k), v) for k, v in parts.items()):
            return node
        other = copy.copy(node)
        for key, value in parts.items():
            setattr(other, key, value)
        return other

    def _name(self, node: ast.Name) -> Value:
        found = self.names.look_up(node)
        if found is not None:
            return found
        return self._outside(node)

    def _outside(self, node: Any) -> Value:
        """A name, or a dotted one, of the module."""
        value = resolve(node, self.names.scope)
        if isinstance(value, np.ndarray) and value.ndim and value.dtype.kind in "biuf":
            element = {"b": TRUTH, "f": "float64"}.get(value.dtype.kind, "int64")
            name = node.id if isinstance(node, ast.Name) else self.work.add("_constant", value)
            return stored(name, name, ArrayKind(tuple(map(Size, value.shape)), element))
        return kind_of_constant(node, value)

    def _attribute(self, node: ast.Attribute) -> Value:
        if resolve(node, self.names.scope) is not None and not self.names.is_local(node):
            return self._outside(node)
        if node.attr not in (*SHAPE, "T"):
            return Scalar(node)
        owner = self.lower(node.value)
        if not isinstance(owner, Array):
            return Scalar(node)
        if node.attr == "T":
            return linear_calls.transposed(owner)
        lying = self.work.materialised(owner, node)
        found = self.rebuilt(node, value=syntax.name(lying.storage))
        size = None
        if node.attr == "ndim":
            size = Size(owner.axes)
        elif node.attr == "size":
            size = slicing.count(owner.kind)
        return Scalar(found, "int64", size)

    def _subscript(self, node: ast.Subscript) -> Value:
        if (axis := slicing.asked_axis(node)) is not None:  # A.shape[0]
            owner = self.lower(node.value.value)  # type: ignore[attr-defined]  # an Attribute
            if isinstance(owner, Array) and axis < owner.axes:
                lying = self.work.materialised(owner, node)
                inner = self.rebuilt(node.value, value=syntax.name(lying.storage))
                return Scalar(self.rebuilt(node, value=inner), "int64", owner.kind.shape[axis])
        owner = self.lower(node.value)
        if isinstance(owner, Several):
            return self._item(node, owner)
        if isinstance(owner, Scalar):
            parts = self.number(node.slice).node if not _has_slices(node.slice) else node.slice
            return Scalar(self.rebuilt(node, value=owner.node, slice=parts))
        return self.part(node, owner)

    def part(self, node: ast.Subscript, owner: Array) -> Value:
        """An element of an array, or a view of some."""
        indices = [self._index(i) for i in slicing.indices(node)]
        if len(indices) == 1 and not isinstance(indices[0], ast.Slice):
            value = self.lower(indices[0])
            if isinstance(value, Scalar) and value.element == TUPLE:
                return Scalar(self.rebuilt(node, slice=indices[0]))
        shape = slicing.shape_of(owner.kind, indices, self.size)
        if shape is None:
            fix = "give one index or slice for each axis, and no more"
            self.work.refuse(node, f"takes `{syntax.brief(node)}` of an array of shape {owner.kind}", fix)
        index = indices[0] if len(indices) == 1 else ast.Tuple(indices, ast.Load())
        index = self.rebuilt(node, slice=index).slice
        lying = self.work.materialised(owner, node)
        found = self.rebuilt(node, value=syntax.name(lying.storage), slice=index)
        if not shape:
            return Scalar(found, owner.kind.element)
        name = self.work.fresh("_view")
        self.work.emit(syntax.assign(name, _loaded(found)))
        return stored(name, lying.root, ArrayKind(shape, owner.kind.element))

    def _index(self, node: Any) -> Any:
        if isinstance(node, ast.Slice):
            parts = {k: v and self.number(v).node for k, v in ast.iter_fields(node)}
            return self.rebuilt(node, **parts)
        if isinstance(node, ast.Attribute) and node.attr == "newaxis":
            return syntax.constant(None)
        value = self.lower(node)
        if isinstance(value, Scalar) and value.element == TRUTH:
            what = "takes an element at an index that is a truth value"
            self.work.refuse(node, what, "make it a number with int(…)")
        if not isinstance(value, Scalar):
            fix = "loop over the elements, or use np.where(test, a, b)"
            self.work.refuse(node, f"takes the elements that `{syntax.brief(node)}` says", fix)
        return value.node

    def _item(self, node: ast.Subscript, owner: Several) -> Value:
        index = node.slice
        number = index.value if isinstance(index, ast.Constant) else None
        if type(number) is not int or not 0 <= number < len(owner.items):
            self.work.refuse(node, "takes an item of a tuple of arrays", "take the tuple apart, such as a, b = …")
        return owner.items[number]

    def _tuple(self, node: ast.Tuple) -> Value:
        values = [self.lower(e) for e in node.elts]
        if any(map(has_arrays, values)):
            return Several(tuple(values))
        return Scalar(self.rebuilt(node, elts=[v.node for v in values if isinstance(v, Scalar)]), TUPLE)


class ArrayExpressions(_Parts):
    """The walk through the expressions of one function; what it emits stands before the statement."""

    def __init__(self, work: Work, names: Names, calls_helper: CallsHelper) -> None:
        super().__init__(work, names)
        self._calls_helper = calls_helper

    def lower(self, node: Any, into: Into | None = None) -> Value:
        """What an expression stands for. Raises: Refusal."""
        match node:
            case ast.Name():
                return self._name(node)
            case ast.Constant():
                return kind_of_constant(node, node.value)
            case ast.BinOp():
                return self._binary(node, into)
            case ast.UnaryOp():
                return self._unary(node)
            case ast.Compare():
                return self._compare(node)
            case ast.BoolOp() | ast.IfExp():
                return self._branching(node)
            case ast.Call():
                return self._call(node, into)
            case ast.Subscript():
                return self._subscript(node)
            case ast.Attribute():
                return self._attribute(node)
            case ast.Tuple():
                return self._tuple(node)
        return Scalar(node)

    # ---- operators ----

    def _binary(self, node: ast.BinOp, into: Into | None) -> Value:
        left, right = self.lower(node.left), self.lower(node.right)
        if isinstance(node.op, ast.MatMult) and (has_arrays(left) or has_arrays(right)):
            self.work.handled.add(id(node))
            return linear_calls.product(self.work, left, right, into, node)
        if isinstance(left, Scalar) and isinstance(right, Scalar):
            found = self.rebuilt(node, left=left.node, right=right.node)
            element = result_of(node.op, left.element, right.element)
            return Scalar(found, element, slicing.computed(node.op, left, right))
        element = result_of(node.op, *(_type(v) for v in (left, right)))
        return self.work.elementwise([left, right], lambda a, b: ast.BinOp(a, node.op, b), node, element)

    def _unary(self, node: ast.UnaryOp) -> Value:
        value = self.lower(node.operand)
        if isinstance(value, Scalar):
            size = value.size.times(-1) if value.size and isinstance(node.op, ast.USub) else None
            found = self.rebuilt(node, operand=value.node)
            return Scalar(found, TRUTH if isinstance(node.op, ast.Not) else value.element, size)
        if isinstance(node.op, ast.Not | ast.Invert):
            fix = "compare element by element, such as np.where(u > 0.0, 0.0, 1.0)"
            self.work.refuse(node, f"inverts the array in `{syntax.brief(node)}`", fix)
        return self.work.elementwise([value], lambda a: ast.UnaryOp(node.op, a), node)

    def _compare(self, node: ast.Compare) -> Value:
        values = [self.lower(v) for v in (node.left, *node.comparators)]
        if not any(map(has_arrays, values)):
            first, *others = [v.node for v in values if isinstance(v, Scalar)]
            return Scalar(self.rebuilt(node, left=first, comparators=others), TRUTH)
        if len(node.ops) > 1 or not isinstance(node.ops[0], ast.Lt | ast.LtE | ast.Gt | ast.GtE | ast.Eq | ast.NotEq):
            fix = "compare two arrays at a time, with < <= > >= == or !="
            self.work.refuse(node, f"compares arrays in `{syntax.brief(node)}`", fix)
        make = lambda a, b: ast.Compare(a, node.ops, [b])  # noqa: E731
        return self.work.elementwise(values, make, node, TRUTH)

    def _branching(self, node: Any) -> Value:
        """`and`, `or` and `if … else`, of which a part may not be computed."""
        is_if = isinstance(node, ast.IfExp)
        first, *others = [node.test, node.body, node.orelse] if is_if else node.values
        begin = self.number(first).node
        parts: list[Any] = []
        blocks: list[list[Any]] = []
        for other in others:
            with self.work.inside() as block:
                value = self.lower(other)
                if not isinstance(value, Scalar):
                    fix = "write `if` and `else` as statements, or np.where(test, a, b)"
                    self.work.refuse(node, f"chooses between arrays in `{syntax.brief(node)}`", fix)
                parts.append(value.node)
            blocks.append(block)
        if not any(blocks):
            if is_if:
                return Scalar(self.rebuilt(node, test=begin, body=parts[0], orelse=parts[1]))
            return Scalar(self.rebuilt(node, values=[begin, *parts]))
        name = self.work.fresh("_either")
        ends = [[*b, syntax.assign(name, p)] for b, p in zip(blocks, parts, strict=True)]
        if is_if:
            self.work.emit(syntax.when(begin, *ends))
            return Scalar(syntax.name(name))
        self.work.emit(syntax.assign(name, begin))
        for end in ends:
            test = syntax.name(name) if isinstance(node.op, ast.And) else ast.UnaryOp(ast.Not(), syntax.name(name))
            self.work.emit(syntax.when(test, end))
        return Scalar(syntax.name(name))

    # ---- calls ----

    def _call(self, node: ast.Call, into: Into | None) -> Value:
        function = None if self.names.is_local(node.func) else resolve(node.func, self.names.scope)
        if isinstance(node.func, ast.Attribute) and function is None:
            if (found := self._method(node, node.func, into)) is not None:
                return found
        elif (handler := numpy_calls.handler(function)) is not None:
            self.work.handled.add(id(node))  # also where it is refused, which is then all that is said
            found = handler(self, node, into)
            if found is not None:
                return found
            self.work.handled.discard(id(node))
        given = self._given(node)
        own = getattr(function, "py_func", function)
        if isinstance(own, types.FunctionType) and not (own.__module__ or "").startswith(("numpy", "numba")):
            if given is not None:
                return self._calls_helper(self, node, own, given, into)
            return Scalar(node)
        return self._plain(node)

    def _method(self, node: ast.Call, func: ast.Attribute, into: Into | None) -> Value | None:
        owner = self.lower(func.value)
        if not isinstance(owner, Array):
            return None
        if func.attr in WRITING:
            self.work.writes(owner)
            return None
        numpy = numpy_calls.METHODS.get(func.attr)
        if numpy is None:
            if func.attr in VIEWING or func.attr in ("argmax", "argmin", "item"):
                lying = self.work.materialised(owner, node)
                return Scalar(self.rebuilt(node, func=self.rebuilt(func, value=syntax.name(lying.storage))))
            return None
        as_function = ast.copy_location(ast.Call(func, [func.value, *node.args], node.keywords), node)
        found = numpy_calls.FUNCTIONS[numpy](self, as_function, into)
        if found is not None:
            self.work.handled.add(id(node))
        return found

    def _given(self, node: ast.Call) -> dict[str, Value] | None:
        """What a call gives, by position or name; None where that is not told."""
        if any(isinstance(a, ast.Starred) for a in node.args) or any(k.arg is None for k in node.keywords):
            return None
        given = {str(k): self.lower(a) for k, a in enumerate(node.args)}
        return given | {str(k.arg): self.lower(k.value) for k in node.keywords}

    def _plain(self, node: ast.Call) -> Scalar:
        """A call of a function that takes arrays as they are, or numbers only."""
        values = [self.lower(a) for a in node.args]
        first = _first_written(resolve(node.func, self.names.scope))
        for value in values[first:] if first is not None else ():
            if isinstance(value, Array):
                self.work.writes(value)
        if any(map(has_arrays, values)) and _takes_numbers(resolve(node.func, self.names.scope)):
            name = ast.unparse(node.func).rpartition(".")[2]
            fix = f"use np.{name} where numpy has it, or write a loop over the elements"
            self.work.refuse(node, f"gives an array to `{name}`, which takes numbers", fix)
        arguments = [self._as_it_lies(v, a) for v, a in zip(values, node.args, strict=True)]
        element = UNKNOWN
        function = resolve(node.func, self.names.scope)
        if function in (len, int):
            element = "int64"
        elif function is float or getattr(function, "__module__", "") == "math":
            element = "float64"
        size = None
        if function is len and len(values) == 1 and isinstance(values[0], Array):
            size = values[0].kind.shape[0]
        return Scalar(self.rebuilt(node, args=arguments), element, size)

    def _as_it_lies(self, value: Value, node: Any) -> Any:
        if isinstance(value, Several):
            return node
        return value.node if isinstance(value, Scalar) else syntax.name(self.work.materialised(value, node).storage)


def _type(value: Value) -> str:
    if isinstance(value, Several):
        return UNKNOWN
    return value.element if isinstance(value, Scalar) else value.kind.element


def _first_written(function: Any) -> int | None:
    """The number of the first argument that a function, which is no author's, may write."""
    if isinstance(function, np.ufunc):
        return function.nin
    return None if getattr(function, "__module__", "") in ("builtins", "math") else 0


def _takes_numbers(function: Any) -> bool:
    return function in (float, int, bool, round, range) or getattr(function, "__module__", "") == "math"


def _has_slices(node: Any) -> bool:
    return any(isinstance(n, ast.Slice | ast.Starred) for n in ast.walk(node))


def _alike(a: Any, b: Any) -> bool:
    """Whether a part is what it was: the same nodes, or the same name."""
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(x is y or _alike(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, ast.Tuple) and isinstance(b, ast.Tuple):
        return _alike(a.elts, b.elts)
    return isinstance(a, ast.Name) and isinstance(b, ast.Name) and a.id == b.id


def _loaded(node: Any) -> Any:
    """A part of an array as it is read."""
    other = copy.copy(node)
    other.ctx = ast.Load()
    return other

"""What sizes follow from: slices, sizes of arrays, and arithmetic of both."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from typing import Any

from cosim.authoring.lowering.axis_sizes import ONE, Size
from cosim.authoring.lowering.lowered_values import ArrayKind, Scalar


def indices(node: ast.Subscript) -> list[Any]:
    """The indices of a subscript, one for each axis."""
    return list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]


def asked_axis(node: ast.Subscript) -> int | None:
    """The axis k of ``array.shape[k]``."""
    shape = isinstance(node.value, ast.Attribute) and node.value.attr == "shape"
    index = node.slice.value if isinstance(node.slice, ast.Constant) else None
    return index if shape and type(index) is int and index >= 0 else None


def count(kind: ArrayKind) -> Size | None:
    """How many elements an array has."""
    total = ONE
    for size in kind.shape:
        if total.constant is not None:
            total = size.times(total.constant)
        elif size.constant is not None:
            total = total.times(size.constant)
        else:
            return None
    return total


def computed(operator: ast.operator, left: Scalar, right: Scalar) -> Size | None:
    """The size that arithmetic of sizes gives."""
    a, b = left.size, right.size
    if a is None or b is None:
        return None
    match operator:
        case ast.Add():
            return a.plus(b)
        case ast.Sub():
            return a.plus(b, -1)
        case ast.Mult() if b.constant is not None:
            return a.times(b.constant)
        case ast.Mult() if a.constant is not None:
            return b.times(a.constant)
        case ast.FloorDiv() if a.constant is not None and b.constant:
            return Size(a.constant // b.constant)
    return None


def shape_of(kind: ArrayKind, indices: Sequence[Any], size: Callable[[Any], Size | None]) -> tuple[Size, ...] | None:
    """The shape that indices leave of an array; None where they do not fit it."""
    shape: list[Size] = []
    axis = 0
    for index in indices:
        if isinstance(index, ast.Constant) and index.value is None:
            shape.append(ONE)
            continue
        if axis >= len(kind.shape) or (isinstance(index, ast.Constant) and type(index.value) is not int):
            return None
        if isinstance(index, ast.Slice):
            shape.append(_sliced(kind.shape[axis], index, size))
        axis += 1
    return (*shape, *kind.shape[axis:])


def _sliced(whole: Size, node: ast.Slice, size: Callable[[Any], Size | None]) -> Size:
    """How long a slice is; at most as long as the axis where only a run can tell."""
    lower, upper, step = (None if part is None else size(part) for part in (node.lower, node.upper, node.step))
    by = 1 if node.step is None else step.constant if step else None
    if by is None or by == 0:
        return whole.at_most()
    if node.lower is None and node.upper is None and abs(by) == 1:
        return whole
    numbers = [None if part is None else part.constant for part in (lower, upper)]
    known = all(n is not None or part is None for n, part in zip(numbers, (node.lower, node.upper), strict=True))
    if known and whole.constant is not None:
        return Size(len(range(*slice(numbers[0], numbers[1], by).indices(whole.constant))))
    if by == 1 and known and whole.exact:
        return _cut(whole, numbers[0], numbers[1], node)
    if by == 1 and lower is not None and upper is not None and not (node.lower is None or node.upper is None):
        return upper.plus(lower, -1).at_most()
    return whole.at_most()


def _cut(whole: Size, lower: int | None, upper: int | None, node: ast.Slice) -> Size:
    """A slice from number to number of an axis whose size is not known yet, and at least 1."""
    if node.upper is None and lower in (0, 1):
        return whole.plus(Size(lower), -1)
    if node.lower is None and upper == -1:
        return whole.plus(ONE, -1)
    if lower is not None and node.upper is None and lower < 0:
        return Size(-lower).at_most()
    if upper is not None and upper >= 0 and (lower or 0) >= 0:
        return Size(max(0, upper - (lower or 0))).at_most()
    return whole.at_most()

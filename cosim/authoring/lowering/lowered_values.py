"""What an expression stands for while a function is lowered: a number, an array element by element, or several."""

from __future__ import annotations

import ast
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass
from typing import Any

from cosim.authoring.lowering import syntax
from cosim.authoring.lowering.axis_sizes import ONE, Size, agree

#: Of what type elements are; "" where that is not known.
REAL, WHOLE, TRUTH, UNKNOWN = "float64", "int64", "bool", ""
TUPLE = "tuple"  # of numbers, which is one value


@dataclass(frozen=True)
class ArrayKind:
    """An array's sizes, and the type of its elements."""

    shape: tuple[Size, ...]
    element: str

    def __str__(self) -> str:
        return f"({', '.join(map(str, self.shape))}{',' if len(self.shape) == 1 else ''})"


@dataclass(frozen=True)
class Scalar:
    """A number, or anything else that is no array; size: its value, where it is the size of something."""

    node: Any
    element: str = UNKNOWN
    size: Size | None = None


@dataclass(frozen=True)
class Access:
    """That an expression reads what belongs to `root`; under `storage`, element by element, or "" in another order."""

    root: str
    storage: str


@dataclass(frozen=True)
class Array:
    """An array, which need not lie anywhere.

    at: its element at some indices; size_at: its size along an axis as it runs; storage: its name where it lies
    somewhere; root: to whose memory that belongs; reads: whose memory its elements come from; view: the expression that
    gives it without a copy, where there is one.
    """

    kind: ArrayKind
    at: Callable[[Sequence[Any]], Any]
    size_at: Callable[[int], Any]
    storage: str = ""
    root: str = ""
    reads: frozenset[Access] = frozenset()
    view: Any = None

    @property
    def axes(self) -> int:
        """How many there are."""
        return len(self.kind.shape)

    def is_read_in_order(self, roots: Container[str], storage: str) -> bool:
        """Whether its elements may be put into a storage one by one; roots: whose memory the storage may share."""
        return all(a.storage == storage for a in self.reads if a.root in roots)


@dataclass(frozen=True)
class Several:
    """A tuple, of which one or more are arrays."""

    items: tuple[Value, ...]


Value = Scalar | Array | Several


def stored(name: str, root: str, kind: ArrayKind) -> Array:
    """The array that lies under a name."""

    def size_at(axis: int) -> Any:
        known = kind.shape[axis].constant
        return syntax.size(name, axis) if known is None else syntax.constant(known)

    at = lambda indices: syntax.element(name, indices)  # noqa: E731
    return Array(kind, at, size_at, name, root, frozenset({Access(root, name)}), syntax.name(name))


def has_arrays(value: Value) -> bool:
    """Whether there is an array in it."""
    return isinstance(value, (Array, Several))


def joined(*elements: str) -> str:
    """The type of what is computed from elements; of an unknown one too it is taken for real where it has to lie."""
    if UNKNOWN in elements:
        return REAL if REAL in elements else UNKNOWN
    return REAL if REAL in elements else WHOLE if WHOLE in elements else TRUTH


@dataclass(frozen=True)
class Broadcast:
    """How arrays are brought to one shape.

    shape: that; sources: for each axis, which of them gives its size, and by which of its axes; checks: pairs of such
    whose sizes only a run can tell; wrong: one that cannot fit, as (array, axis, array, axis).
    """

    shape: tuple[Size, ...]
    sources: tuple[tuple[int, int], ...]
    checks: tuple[tuple[tuple[int, int], tuple[int, int]], ...]
    wrong: tuple[int, int] | None


def broadcast(arrays: Sequence[Array]) -> Broadcast:
    """Bring arrays to one shape as numpy does, where an axis of 1 is a 1 in the text."""
    axes = max(a.axes for a in arrays)
    shape, sources, checks, wrong = [], [], [], None
    for axis in range(axes):
        there = [(k, axis - axes + a.axes) for k, a in enumerate(arrays) if axis - axes + a.axes >= 0]
        long = [(k, own) for k, own in there if arrays[k].kind.shape[own] != ONE]
        first = min(long or there, key=lambda p: arrays[p[0]].kind.shape[p[1]].constant is None)
        size = arrays[first[0]].kind.shape[first[1]]
        for other in long:
            same = agree(size, arrays[other[0]].kind.shape[other[1]])
            if same is None and other != first:
                checks.append((first, other))
            elif same is False:
                wrong = wrong or (first[0], other[0])
        shape.append(size)
        sources.append(first)
    return Broadcast(tuple(shape), tuple(sources), tuple(checks), wrong)


def element_of(array: Array, shape: Sequence[Size], indices: Sequence[Any]) -> Any:
    """An array's element where it is brought to a shape."""
    own = indices[len(indices) - array.axes :]
    sizes = shape[len(shape) - array.axes :]
    short = [a == ONE != b for a, b in zip(array.kind.shape, sizes, strict=True)]
    return array.at([syntax.constant(0) if s else i for s, i in zip(short, own, strict=True)])


def reads_of(array: Array, shape: Sequence[Size]) -> frozenset[Access]:
    """What is read of an array that is brought to a shape."""
    sizes = shape[len(shape) - array.axes :]
    repeated = len(shape) != array.axes or any(a == ONE != b for a, b in zip(array.kind.shape, sizes, strict=True))
    return frozenset(Access(a.root, "") for a in array.reads) if repeated else array.reads


def result_of(operator: Any, *elements: str) -> str:
    """The type of what an operator makes of elements."""
    if isinstance(operator, ast.Div):
        return REAL
    if isinstance(operator, (ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE)):
        return TRUTH
    found = joined(*elements)
    bits = isinstance(operator, (ast.BitAnd, ast.BitOr, ast.BitXor))
    return WHOLE if found == TRUTH and not bits else found

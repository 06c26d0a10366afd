"""FMI 2's scalars `x[1]`, `x[2,3]` gathered into arrays."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import prod
from typing import Any

_ELEMENT = re.compile(r"(.+)\[\s*(\d+(?:\s*,\s*\d+)*)\s*\]")


def gathered(variables: Sequence[Any]) -> dict[str, tuple[tuple[Any, ...], tuple[int, ...]]]:
    """Scalars by name, elements `x[…]` of a complete array of one kind by the array's name, in row-major order."""
    taken = {v.name for v in variables}
    arrays: dict[str, dict[tuple[int, ...], Any]] = {}
    for variable in variables:
        if place := _place(variable.name):
            arrays.setdefault(place[0], {})[place[1]] = variable
    shapes = {name: _shape(elements) for name, elements in arrays.items() if name not in taken}
    groups: dict[str, tuple[tuple[Any, ...], tuple[int, ...]]] = {}
    for variable in variables:
        place = _place(variable.name)
        shape = shapes.get(place[0], ()) if place else ()
        if place and shape:
            if place[0] not in groups:
                groups[place[0]] = tuple(v for _, v in sorted(arrays[place[0]].items())), shape
        else:
            groups[variable.name] = ((variable,), ())
    return groups


def _place(name: str) -> tuple[str, tuple[int, ...]] | None:
    match = _ELEMENT.fullmatch(name)
    return (match[1], tuple(int(i) for i in match[2].split(","))) if match else None


def _shape(elements: dict[tuple[int, ...], Any]) -> tuple[int, ...]:
    """The shape, if the indices fill a box that begins at 0 or 1 with variables of one kind; else ()."""
    kinds = {(v.type, v.causality, v.variability, v.initial) for v in elements.values()}
    if len(kinds) != 1 or len({len(index) for index in elements}) != 1:
        return ()
    low, high = [tuple(f(axis) for axis in zip(*elements, strict=True)) for f in (min, max)]
    shape = tuple(b - a + 1 for a, b in zip(low, high, strict=True))
    return shape if set(low) in ({0}, {1}) and len(elements) == prod(shape) else ()

"""Elements that loops leave out: where nothing but loops over `range` write an array, and none of them reaches one."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any

from cosim.authoring.dataflow.bindings import stored
from cosim.authoring.dataflow.counting import is_range
from cosim.authoring.dataflow.effects import Effects, LeftOut
from cosim.authoring.dataflow.extents import Extent, extent, of_size, plus
from cosim.authoring.dataflow.indices import indices, is_special, number
from cosim.authoring.dataflow.symbols import Symbols

#: Of how many elements that a loop leaves out is asked whether another one writes them.
_FEW = 8


def left_out(effects: Effects, symbols: Symbols) -> dict[str, LeftOut]:
    """For each array that only loops write: an element that certainly all of them leave out."""
    loops = [n for n in ast.walk(symbols.node) if isinstance(n, ast.For) and is_range(n.iter, symbols)]
    found = {}
    for name in symbols.arguments if loops else ():
        nodes = [p.node for p in effects.maybe if p.name == name]
        if not nodes or name in effects.unknown or name in symbols.bindings:
            continue
        missed = [_missed(name, node, loops, symbols) for node in nodes]
        common = sorted(set(missed[0]).intersection(*missed[1:]))
        if common:
            found[name] = LeftOut(missed[0][common[0]], *common[0])
    return found


def _missed(name: str, node: Any, loops: Sequence[ast.For], symbols: Symbols) -> dict[tuple[int, int], ast.For]:
    """The elements (axis, index) that a statement leaves out for certain, each with its loop."""
    if not (isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id == name):
        return {}
    shape = symbols.shapes.get(name)
    if shape is None or len(indices(node)) > len(shape) or any(map(is_special, indices(node))):
        return {}
    return {
        (axis, k): loop
        for axis, index in enumerate(indices(node))
        for loop in _loops_of(index, node, loops)
        for k in _not_reached(loop, of_size(shape[axis]), symbols)
    }


def _loops_of(index: Any, node: Any, loops: Sequence[ast.For]) -> list[ast.For]:
    """The loop that an index is the counter of where the node stands; none where that is not certain."""
    if not isinstance(index, ast.Name):
        return []
    inside = [
        (loop, [n for s in loop.body for n in ast.walk(s)])
        for loop in loops
        if isinstance(loop.target, ast.Name) and loop.target.id == index.id
    ]
    around = [(loop, nodes) for loop, nodes in inside if any(n is node for n in nodes)]
    if len(around) != 1 or index.id in stored(around[0][1]):
        return []
    return [around[0][0]]


def _not_reached(loop: ast.For, size: Extent | None, symbols: Symbols) -> set[int]:
    """Indices below a size that a loop certainly leaves out; a few of them, -1 for the last."""
    first, end, step = _bounds(loop, symbols)
    if step is None or step < 1:
        return set()
    missed: set[int] = set()
    if first and first[0] == "" and first[1] >= 0:
        missed = {*range(min(first[1], _FEW)), *range(first[1] + 1, first[1] + min(step, _FEW))}
    if size and size[0] == "":
        missed = {k for k in missed if k < size[1]}
    if size and end and end[0] == size[0] and end[1] < size[1]:
        missed.add(size[1] - 1 if size[0] == "" else -1)
    return missed


def _bounds(loop: ast.For, symbols: Symbols) -> tuple[Extent | None, Extent | None, int | None]:
    """A loop's first number, the one at which it ends, and the step; one that counts down, from its other end."""
    assert isinstance(loop.iter, ast.Call)
    numbers = loop.iter.args
    step = number(numbers[2]) if len(numbers) == 3 else 1
    end = extent(numbers[min(1, len(numbers) - 1)], symbols)
    first = extent(numbers[0], symbols) if len(numbers) > 1 else ("", 0)
    return (plus(end, 1), plus(first, 1), 1) if step == -1 else (first, end, step)

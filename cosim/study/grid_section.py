"""Reads the section `grid` of a study: the values of each axis, listed or spread between two numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cosim.errors import TooLarge, WrongValue
from cosim.language.reader import Reader
from cosim.language.source import Node, describe
from cosim.study.definition import GridAxis
from cosim.study.dotted_paths import paths, short_name

MOST_VALUES = 1_000_000  # of one axis


def read(entries: Mapping[str, Node], reader: Reader) -> tuple[GridAxis, ...]:
    """The axes; of one that is wrong, the first value or 0."""
    return tuple(
        GridAxis(short_name(path), paths(path), _values(path, node, reader), node) for path, node in entries.items()
    )


def _values(path: str, node: Node, reader: Reader) -> tuple[Any, ...]:
    if isinstance(node.value, list) and node.value:
        return tuple(_listed(item, path, reader) for item in node.value)
    kind = next(iter(node.value)) if isinstance(node.value, dict) and len(node.value) == 1 else ""
    items = node.value[kind].value if kind in ("linspace", "geomspace", "range") else None
    if not isinstance(items, list) or len(items) != 3:
        fix = "write [1, 2, 3], {linspace: [first, last, count]}, {geomspace: …} or {range: [from, to, step]}"
        reader.wrong(node, f"`grid.{path}` takes a list of values, not {describe(node)}", fix)
        return (0.0,)
    first, last, _ = (reader.number(item, f"grid.{path}.{kind}") for item in items)
    if kind == "range":
        return _range(path, node, first, last, items[2], reader)
    return _space(path, node, kind, first, last, items[2], reader)


def _listed(node: Node, path: str, reader: Reader) -> Any:
    """One value of a list: a number, text, true or false, or a list of them."""
    if node.value is None or isinstance(node.value, dict):
        reader.wrong(node, f"a value of `grid.{path}` cannot be {describe(node)}", "write a number or text")
        return 0.0
    if isinstance(node.value, list):
        return [_listed(item, path, reader) for item in node.value]
    return node.value


def _range(path: str, node: Node, first: float, last: float, by: Node, reader: Reader) -> tuple[float, ...]:
    """Numbers in equal steps, the last one included."""
    step = reader.positive(by, f"grid.{path}.range")
    if last < first:
        message = f"`grid.{path}`: from {first:g} to {last:g} there is no value"
        reader.wrong(node, message, "exchange the first two numbers", WrongValue)
        return (first,)
    if (last - first) / step >= MOST_VALUES:
        message = f"`grid.{path}`: from {first:g} to {last:g} there are too many steps of {step:g}"
        reader.wrong(by, message, f"at most {MOST_VALUES} values", TooLarge)
        return (first,)
    return tuple(np.arange(first, last + 1e-9 * step, step).tolist())


def _space(
    path: str, node: Node, kind: str, first: float, last: float, count: Node, reader: Reader
) -> tuple[float, ...]:
    """So many numbers with equal differences, or with equal ratios."""
    if not np.isfinite(last - first):
        message = f"`grid.{path}`: from {first:g} to {last:g} is beyond all numbers"
        reader.wrong(node, message, "give a smaller range", WrongValue)
        return (first,)
    if kind == "geomspace" and not first * last > 0:
        message = f"`grid.{path}`: from {first:g} to {last:g} there are no constant ratios"
        reader.wrong(node, message, "give two numbers of one sign, neither of them 0", WrongValue)
        return (first,)
    space: Any = np.geomspace if kind == "geomspace" else np.linspace
    return tuple(space(first, last, reader.count(count, f"grid.{path}.{kind}", MOST_VALUES)).tolist())

"""Reads the section `grid` of a study: the values of each axis, listed or spread between two numbers.

An axis is a path with its values; or a name, with `path` and `values`, or with `variants` that are crossed with others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import TooLarge, WrongValue
from cosim.language import grammar
from cosim.language.reader import Reader
from cosim.language.source import Node, describe
from cosim.study.definition import GridAxis, Variant
from cosim.study.dotted_paths import paths, short_name
from cosim.study.study_keys import AXIS, CROSSED, OVERLAY

MOST_VALUES = 1_000_000  # of one axis
SPREADS = ("linspace", "geomspace", "range")


def read(entries: Mapping[str, Node], reader: Reader) -> tuple[GridAxis, ...]:
    """The axes; of one that is wrong, the first value or 0."""
    return tuple(_axis(name, node, reader) for name, node in entries.items())


def _axis(name: str, node: Node, reader: Reader) -> GridAxis:
    if isinstance(node.value, dict) and "variants" in node.value:
        node = with_empty_variants(node)
        return _crossed(name, grammar.conform(node, reader.problems, CROSSED, f"grid.{name}"), reader)
    if isinstance(node.value, dict) and {"path", "values"} & set(node.value):
        return _named(name, grammar.conform(node, reader.problems, AXIS, f"grid.{name}"), reader)
    return GridAxis(short_name(name), paths(name), _values(name, node, reader), node)


def with_empty_variants(tree: Node) -> Node:
    """A variant of which nothing is said, `name:`, is the diagram as it is."""
    variants = tree.value.get("variants")
    if variants is None or not isinstance(variants.value, dict):
        return tree
    filled = {k: replace(n, value={}) if n.value is None else n for k, n in variants.value.items()}
    return replace(tree, value={**tree.value, "variants": replace(variants, value=filled)})


def _named(name: str, node: Node, reader: Reader) -> GridAxis:
    """A path under a name of its own; its values may have names too."""
    for key, example in (("path", "blocks.plant.parameters.mass"), ("values", "[1, 2]")):
        if key not in node.value:
            reader.missing(node, f"`grid.{name}` has no `{key}`", f"write {key}: {example}")
            return GridAxis(name, (name,), (0.0,), node)
    path, values = reader.text(node.value["path"], f"grid.{name}.path"), node.value["values"]
    if isinstance(values.value, dict) and values.value and not set(SPREADS) & set(values.value):
        found = tuple(_listed(item, name, reader) for item in values.value.values())
        return GridAxis(name, paths(path), found, node, tuple(values.value))
    return GridAxis(name, paths(path), _values(name, values, reader), node)


def _crossed(name: str, node: Node, reader: Reader) -> GridAxis:
    """Changes of the diagram by name, each of which every variant is run with."""
    changes = []
    variants = node.value.get("variants")  # none where nothing is said of them
    for called, written in variants.value.items() if variants else ():
        entries = written.value
        overlay = {key: child for key, child in entries.items() if key in OVERLAY}
        about = reader.text(entries["description"], f"grid.{name}.{called}") if "description" in entries else ""
        swaps, settings = (entries[key].value if key in entries else {} for key in ("swap", "set"))
        layer = Node(overlay, written.position) if overlay else None
        changes.append(Variant(called, Path(), written.place, about, layer, swaps, settings))
    if not changes:
        reader.missing(node, f"`grid.{name}` has no variants", "write variants: {one: {}, other: {set: {…}}}")
        return GridAxis(name, (f"grid.{name}",), ("",), node)
    names = tuple(change.name for change in changes)
    return GridAxis(name, (f"grid.{name}",), names, node, names, tuple(changes))


def _values(path: str, node: Node, reader: Reader) -> tuple[Any, ...]:
    if isinstance(node.value, list) and node.value:
        return tuple(_listed(item, path, reader) for item in node.value)
    kind = next(iter(node.value)) if isinstance(node.value, dict) and len(node.value) == 1 else ""
    items = node.value[kind].value if kind in SPREADS else None
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

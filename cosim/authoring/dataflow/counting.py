"""Loops that count: whether one is certainly entered, or certainly not."""

from __future__ import annotations

import ast
from typing import Any

from cosim.authoring.dataflow.bindings import Element
from cosim.authoring.dataflow.indices import number
from cosim.authoring.dataflow.symbols import Symbols


def is_range(node: Any, symbols: Symbols) -> bool:
    """Whether an iterable is a `range` of numbers that stand one by one."""
    if not (isinstance(node, ast.Call) and symbols.outside(node.func) is range and 0 < len(node.args) < 4):
        return False
    return not node.keywords and not any(isinstance(a, ast.Starred) for a in node.args)


def is_empty(node: Any, symbols: Symbols) -> bool:
    """Whether an iterable certainly has no elements."""
    if isinstance(node, ast.Tuple | ast.List) and not node.elts:
        return True
    if not is_range(node, symbols):
        return False
    numbers = [number(a) for a in node.args]
    if None in numbers or (len(numbers) == 3 and numbers[2] == 0):
        return False
    return not range(*[int(n) for n in numbers if n is not None])


def counts_from_zero(test: Any, before: Any, symbols: Symbols) -> bool:
    """Whether the `k < size` of a `while` follows on the statement `k = 0`, which makes it a `for`."""
    if not (isinstance(test, ast.Compare) and len(test.ops) == 1 and isinstance(test.ops[0], ast.Lt)):
        return False
    if not (isinstance(before, ast.Assign) and isinstance(before.value, ast.Constant) and before.value.value == 0):
        return False
    counter = ast.dump(test.left)
    names = [ast.dump(t).replace("Store", "Load") for t in before.targets if isinstance(t, ast.Name)]
    return counter in names and _is_size(test.comparators[0], symbols)


def _is_size(node: Any, symbols: Symbols) -> bool:
    """Whether a number is certainly above 0, being the size of an array or written out."""
    if isinstance(node, ast.Name) and len(symbols.bindings.get(node.id, [])) == 1:
        node = symbols.bindings[node.id][0]
    match node:
        case Element() | ast.Subscript():
            return isinstance(node.value, ast.Attribute) and node.value.attr == "shape"
        case ast.Attribute():
            return node.attr == "size"
        case ast.Call():
            return symbols.outside(node.func) is len
    return (number(node) or 0) > 0

"""What a turn of a loop leaves for the turns after it."""

from __future__ import annotations

import ast
import itertools
from collections.abc import Sequence
from typing import Any

from cosim.authoring.dataflow.array_operations import is_harmless
from cosim.authoring.dataflow.views import Views


def plainly_written(body: Sequence[Any], views: Views) -> frozenset[str]:
    """What a loop's body sets, so that a later turn may read what an earlier one wrote.

    What is set from itself, as in `y[q] = y[q] + u[q]`, has to have been set before.
    """
    found: set[str] = set()
    for n in itertools.chain.from_iterable(map(ast.walk, body)):
        if isinstance(n, ast.Assign):
            before = _surely_read(n.value, views)
            for target in n.targets:
                for part in target.elts if isinstance(target, ast.Tuple | ast.List) else [target]:
                    found |= views.roots(part.value) - before if isinstance(part, ast.Subscript) else set()
        elif isinstance(n, ast.Call) and not is_harmless(views.symbols.outside(n.func)):
            found.update(*(views.roots(a) for a in (*n.args, *(k.value for k in n.keywords))))
    return frozenset(found)


def _surely_read(node: Any, views: Views) -> frozenset[str]:
    """The arrays of which an expression reads an element, whichever way it goes."""
    match node:
        case ast.IfExp():
            return _surely_read(node.test, views)
        case ast.BoolOp():
            return _surely_read(node.values[0], views)
        case ast.Lambda() | ast.ListComp() | ast.SetComp() | ast.GeneratorExp() | ast.DictComp():
            return frozenset()
        case ast.Subscript() if views.symbols.axes(node) == 0:
            return views.roots(node.value) | _surely_read(node.slice, views)
    return frozenset().union(*(_surely_read(child, views) for child in ast.iter_child_nodes(node)))

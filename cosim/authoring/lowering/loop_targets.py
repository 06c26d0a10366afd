"""What a `for` goes through: numbers, elements of arrays, rows of matrices."""

from __future__ import annotations

import ast
from typing import Any

from cosim.authoring.lowering import syntax
from cosim.authoring.lowering.lowered_values import WHOLE, Array, ArrayKind, Scalar, Several, Value, stored
from cosim.authoring.lowering.work import Lowerer
from cosim.authoring.scope import resolve


def iterated(expressions: Lowerer, node: Any, target: Any) -> tuple[Any, dict[str, Value], bool]:
    """What is gone through as it is lowered, what the loop's names stand for, and whether there is a first turn."""
    function = None
    if isinstance(node, ast.Call) and not expressions.names.is_local(node.func):
        function = resolve(node.func, expressions.names.scope)
    if function is range:
        counts = [expressions.number(a) for a in node.args]
        entered = len(counts) == 1 and counts[0].size is not None
        entered = entered and (counts[0].size.constant is None or counts[0].size.constant > 0)  # type: ignore[union-attr]
        found = expressions.rebuilt(node, args=[c.node for c in counts])
        return found, _names(target, Scalar(target, WHOLE)), entered
    if function in (enumerate, zip) and not node.keywords:
        return _together(expressions, node, target, function)
    value = expressions.lower(node)
    if isinstance(value, Array):
        lying = expressions.work.materialised(value, node)
        if lying.root not in expressions.names.arguments and lying.view is not None:
            lying = expressions.work.copied(lying, node)  # its memory may get another content in the loop
        name = node if lying.storage == getattr(node, "id", "") else syntax.name(lying.storage)
        return name, _of(target, lying), True
    if isinstance(value, Several):
        fix = "write the statements for each of them, in a helper function perhaps"
        expressions.work.refuse(node, f"loops over the arrays in `{syntax.brief(node)}`", fix)
    return value.node, _names(target, Scalar(target)), False


def _together(expressions: Lowerer, node: ast.Call, target: Any, function: Any) -> tuple[Any, dict[str, Value], bool]:
    """Behind `enumerate` and `zip`, each name goes through its own source."""
    values = [expressions.lower(a) for a in node.args]
    lying = [
        expressions.work.materialised(v, a) if isinstance(v, Array) else v
        for v, a in zip(values, node.args, strict=True)
    ]
    arguments = [
        syntax.name(v.storage) if isinstance(v, Array) else getattr(v, "node", a)
        for v, a in zip(lying, node.args, strict=True)
    ]
    parts: list[Any] = list(target.elts) if isinstance(target, ast.Tuple) else []
    sources: list[Any] = [Scalar(target, WHOLE), *lying[:1]] if function is enumerate else lying
    if len(parts) != len(sources):
        return expressions.rebuilt(node, args=arguments), _names(target, Scalar(target)), False
    found: dict[str, Value] = {}
    for part, source in zip(parts, sources, strict=True):
        found |= _of(part, source) if isinstance(source, Array) else _names(part, Scalar(part))
    return expressions.rebuilt(node, args=arguments), found, True


def _of(target: Any, array: Array) -> dict[str, Value]:
    """What a name stands for that goes through an array."""
    if array.axes == 1 or not isinstance(target, ast.Name):
        return _names(target, Scalar(target, array.kind.element))
    row = ArrayKind(array.kind.shape[1:], array.kind.element)
    return {target.id: stored(target.id, array.root, row)}


def _names(target: Any, value: Scalar) -> dict[str, Value]:
    return {n.id: Scalar(syntax.name(n.id), value.element) for n in ast.walk(target) if isinstance(n, ast.Name)}

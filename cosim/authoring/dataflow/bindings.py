"""What a function binds its local names to."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from typing import Any


class Element(ast.expr):
    """What stands for one element of an iterable, or of a tuple that is taken apart (then its index is known)."""

    _fields = ("value",)

    def __init__(self, value: Any, index: int | None = None) -> None:
        super().__init__()
        self.value = value
        self.index = index


def bindings(function: Any) -> dict[str, list[Any]]:
    """For each name that a function binds, the expressions that it may stand for."""
    found: dict[str, list[Any]] = {}
    for node in _own_nodes(function):
        for target, value in _stores(node):
            for name, meant in _taken_apart(target, value):
                found.setdefault(name, []).append(meant)
    return found


def stored(nodes: Iterable[Any]) -> list[str]:
    """The names that are given a value, as often as they are."""
    return [n.id for n in nodes if isinstance(n, ast.Name) and not isinstance(n.ctx, ast.Load)]


def _own_nodes(function: Any) -> Iterator[Any]:
    """All nodes of a function but those inside functions and classes in it."""
    waiting = list(function.body)
    while waiting:
        node = waiting.pop()
        yield node
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Lambda):
            waiting.extend(ast.iter_child_nodes(node))


def _stores(node: Any) -> Iterator[tuple[Any, Any]]:
    """The targets of a node, each with the value that it is given."""
    match node:
        case ast.Assign():
            for target in node.targets:
                yield target, node.value
        case ast.AnnAssign() if node.value is not None:
            yield node.target, node.value
        case ast.For() | ast.AsyncFor():
            yield from _counters(node)
        case ast.NamedExpr():
            yield node.target, node.value
        case ast.withitem() if node.optional_vars is not None:
            yield node.optional_vars, node.context_expr


def _counters(loop: Any) -> Iterator[tuple[Any, Any]]:
    """The targets of a `for`; behind `zip`, each with its own source."""
    iterator = loop.iter
    sources = iterator.args if isinstance(iterator, ast.Call) and _is_zip(iterator) else []
    if isinstance(loop.target, ast.Tuple) and len(sources) == len(loop.target.elts):
        yield from ((part, Element(source)) for part, source in zip(loop.target.elts, sources, strict=True))
    else:
        yield loop.target, Element(iterator)


def _is_zip(node: ast.Call) -> bool:
    return isinstance(node.func, ast.Name) and node.func.id == "zip"


def _taken_apart(target: Any, value: Any) -> Iterator[tuple[str, Any]]:
    """The names in a target, each with its part of the value."""
    if isinstance(target, ast.Starred):
        yield from _taken_apart(target.value, value)
    elif isinstance(target, ast.Name):
        yield target.id, value
    elif isinstance(target, ast.Tuple | ast.List):
        starred = any(isinstance(part, ast.Starred) for part in target.elts)
        alike = isinstance(value, ast.Tuple | ast.List) and len(value.elts) == len(target.elts)
        for k, part in enumerate(target.elts):
            yield from _taken_apart(part, value.elts[k] if alike else Element(value, None if starred else k))

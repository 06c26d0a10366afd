"""Pieces of Python's syntax, as lowered functions are put together from them."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Sequence
from typing import Any


def name(text: str) -> ast.Name:
    """A name that is read."""
    return ast.Name(text, ast.Load())


def constant(value: Any) -> ast.Constant:
    """A number or a text."""
    return ast.Constant(value)


def assign(target: str, value: Any) -> ast.Assign:
    """``target = value``."""
    return ast.Assign([ast.Name(target, ast.Store())], value)


def put(array: str, indices: Sequence[Any], value: Any) -> ast.Assign:
    """``array[indices] = value``."""
    return ast.Assign([ast.Subscript(name(array), _index(indices), ast.Store())], value)


def element(array: str, indices: Sequence[Any]) -> Any:
    """``array[indices]``."""
    return ast.Subscript(name(array), _index(indices), ast.Load())


def _index(indices: Sequence[Any]) -> Any:
    return indices[0] if len(indices) == 1 else ast.Tuple(list(indices), ast.Load())


def size(array: str, axis: int) -> ast.Subscript:
    """``array.shape[axis]``."""
    return ast.Subscript(ast.Attribute(name(array), "shape", ast.Load()), constant(axis), ast.Load())


def binary(left: Any, operator: ast.operator, right: Any) -> ast.BinOp:
    """``left operator right``."""
    return ast.BinOp(left, operator, right)


def call(function: str, *arguments: Any) -> ast.Call:
    """``function(arguments)``."""
    return ast.Call(name(function), list(arguments), [])


def loop(counter: str, size: Any, body: list[Any]) -> ast.For:
    """``for counter in range(size): body``."""
    return ast.For(ast.Name(counter, ast.Store()), call("range", size), body, [])


def when(test: Any, body: list[Any], otherwise: list[Any] | None = None) -> ast.If:
    """``if test: body``."""
    return ast.If(test, body, otherwise or [])


def compare(left: Any, operator: ast.cmpop, right: Any) -> ast.Compare:
    """``left operator right``."""
    return ast.Compare(left, [operator], [right])


def located(statements: Iterable[Any], origin: Any) -> None:
    """Give whatever has no place yet the one of an author's node."""
    for statement in statements:
        for node in ast.walk(statement):
            if not hasattr(node, "lineno"):
                ast.copy_location(node, origin)


def brief(node: Any) -> str:
    """An expression as its author wrote it, cut where it is long."""
    text = ast.unparse(node)
    return text if len(text) <= 40 else f"{text[:39]}…"

"""What the names that a function takes from outside itself stand for."""

from __future__ import annotations

import ast
import types
from typing import Any


def scope_of(function: types.FunctionType) -> dict[str, Any]:
    """The names that a function sees from outside itself."""
    builtins = function.__globals__.get("__builtins__", {})
    scope = dict(vars(builtins) if isinstance(builtins, types.ModuleType) else builtins)
    scope.update(function.__globals__)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            scope[name] = cell.cell_contents
        except ValueError:  # not yet assigned
            scope.pop(name, None)
    return scope


def resolve(node: Any, scope: dict[str, Any]) -> Any:
    """What a name or a dotted name stands for outside the function; None if that is not known."""
    if isinstance(node, ast.Name):
        return scope.get(node.id)
    if isinstance(node, ast.Attribute):
        owner = resolve(node.value, scope)
        return getattr(owner, node.attr, None) if isinstance(owner, types.ModuleType) else None
    return None

"""The source text of authors' functions and classes as syntax trees, with the places where they stand."""

from __future__ import annotations

import ast
import linecache
import sys
import types
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from cosim.errors import Position


@dataclass(frozen=True)
class Text:
    """A function or class as its author wrote it."""

    file: str
    node: Any

    def place(self, node: Any = None) -> Position:
        """Where a part of it stands; without one, where it begins."""
        return place_of(self.file, node or self.node)


def place_of(file: str, node: Any) -> Position:
    """A node's place, in the terms of the user's working folder."""
    return Position(shown(file), node.lineno, node.col_offset + 1)


def shown(file: str) -> str:
    """A path as a person reads it: relative where it lies below the working folder."""
    try:
        return str(Path(file).relative_to(Path.cwd()))
    except (ValueError, OSError):
        return file


def function_text(function: Any) -> Text | None:
    """A function's text; None where it cannot be read, or is not the one that the function was made from."""
    if not isinstance(function, types.FunctionType):
        return None
    code = function.__code__
    module = _module(code.co_filename, function.__globals__)
    node = module.functions.get((code.co_name, code.co_firstlineno)) if module else None
    if node is None or [a.arg for a in arguments_of(node)] != list(code.co_varnames[: code.co_argcount]):
        return None
    return Text(code.co_filename, node)


def class_text(cls: type) -> Text | None:
    """A class's text, the last of its name; None where it cannot be read."""
    module = sys.modules.get(cls.__module__)
    functions = (getattr(member, "__func__", member) for member in vars(cls).values())
    written = [member.__code__.co_filename for member in functions if isinstance(member, types.FunctionType)]
    file = getattr(module, "__file__", None) or next(iter(written), None)  # a notebook's cells are no files
    parsed = _module(file, vars(module) if module else {}) if file else None
    node = parsed.classes.get(cls.__qualname__) if parsed else None
    return Text(str(file), node) if node else None


def arguments_of(node: Any) -> list[ast.arg]:
    """The positional arguments of a function."""
    return [*node.args.posonlyargs, *node.args.args]


@dataclass(frozen=True)
class _Module:
    functions: dict[tuple[str, int], Any]
    classes: dict[str, ast.ClassDef]


def _module(file: str, scope: dict[str, Any]) -> _Module | None:
    lines = linecache.getlines(file, scope)
    return _parsed("".join(lines)) if lines else None


@lru_cache(maxsize=64)
def _parsed(text: str) -> _Module | None:
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError):
        return None
    found = _Module({}, {})
    _gather(tree, "", found)
    return found


def _gather(node: ast.AST, path: str, found: _Module) -> None:
    for child in ast.iter_child_nodes(node):
        inner = path
        if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
            first = min([child.lineno, *(d.lineno for d in child.decorator_list)])
            found.functions[child.name, first] = child
            inner = f"{path}{child.name}.<locals>."
        elif isinstance(child, ast.ClassDef):
            found.classes[f"{path}{child.name}"] = child
            inner = f"{path}{child.name}."
        if not isinstance(child, ast.expr):
            _gather(child, inner, found)

"""The source text of authors' functions and classes as syntax trees, with the places where they stand."""

from __future__ import annotations

import ast
import linecache
import sys
import types
from collections.abc import Callable, Iterator
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
    found = _made_of(code.co_filename, function.__globals__, _definitions, code.co_firstlineno)
    node = found.get((code.co_name, code.co_firstlineno))
    if node is None or [a.arg for a in arguments_of(node)] != list(code.co_varnames[: code.co_argcount]):
        return None
    return Text(code.co_filename, node)


def class_text(cls: type) -> Text | None:
    """A class's text, the last of its name; None where it cannot be read."""
    module = sys.modules.get(cls.__module__)
    functions = (getattr(member, "__func__", member) for member in vars(cls).values())
    written = [member.__code__.co_filename for member in functions if isinstance(member, types.FunctionType)]
    file = getattr(module, "__file__", None) or next(iter(written), None)  # a notebook's cells are no files
    classes = _made_of(file, vars(module) if module else {}, _classes) if file else {}
    node = classes.get(cls.__qualname__)
    return Text(str(file), node) if node else None


def arguments_of(node: Any) -> list[ast.arg]:
    """The positional arguments of a function."""
    return [*node.args.posonlyargs, *node.args.args]


_known: dict[tuple[Any, ...], tuple[list[str], dict[Any, Any]]] = {}


def _made_of(file: str, scope: dict[str, Any], make: Callable[..., dict[Any, Any]], *line: int) -> dict[Any, Any]:
    """What is made of a file's lines, once for as long as they are the same."""
    lines = linecache.getlines(file, scope)
    known = _known.get((make, file, *line))
    if known is None or known[0] is not lines:  # the same list until somebody has the file read anew
        known = _known[make, file, *line] = lines, make(lines, *line)
    return known[1]


def _definitions(lines: list[str], first: int) -> dict[tuple[str, int], Any]:
    """Functions by name and first line: that which begins in a line, and those inside it.

    Nothing else is parsed, unless its end cannot be told by how lines are indented.
    """
    tree = _parsed(_definition(lines, first)) or _parsed("".join(lines))
    return dict(_functions(tree)) if tree else {}


def _definition(lines: list[str], first: int) -> str:
    """The text of a function, each line at its number and each word at its column."""
    begin = first - 1
    indent = _indent(lines[begin]) if first <= len(lines) else 0
    end = next((n for n in range(begin, len(lines)) if lines[n].lstrip().startswith(("def ", "async "))), begin) + 1
    while end < len(lines) and (_indent(lines[end]) > indent or lines[end].lstrip()[:1] in ("", "#")):
        end += 1
    head = "\n" * (begin - 1) + "if True:\n" if indent else "\n" * begin
    return head + "".join(lines[begin:end])


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def _classes(lines: list[str]) -> dict[str, ast.ClassDef]:
    """The classes of a file by their qualified names, the last of each."""
    tree = _parsed("".join(lines))
    return dict(_named(tree, "")) if tree else {}


@lru_cache(maxsize=256)
def _parsed(text: str) -> ast.Module | None:
    try:
        return ast.parse(text)
    except (SyntaxError, ValueError, RecursionError):
        return None


def _functions(node: ast.AST) -> Iterator[tuple[tuple[str, int], Any]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield (child.name, min([child.lineno, *(d.lineno for d in child.decorator_list)])), child
        if not isinstance(child, ast.expr):
            yield from _functions(child)


def _named(node: ast.AST, path: str) -> Iterator[tuple[str, ast.ClassDef]]:
    for child in ast.iter_child_nodes(node):
        inner = path
        if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
            inner = f"{path}{child.name}.<locals>."
        elif isinstance(child, ast.ClassDef):
            yield f"{path}{child.name}", child
            inner = f"{path}{child.name}."
        if not isinstance(child, ast.expr):
            yield from _named(child, inner)

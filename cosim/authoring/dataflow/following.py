"""A function is followed from its first statement to its ends.

A write of any element counts as a write of the array, except where all indices that a function ever writes are
constants: then each element counts by itself.
"""

from __future__ import annotations

import ast
import types
from collections.abc import Sequence
from typing import Any

from cosim.authoring.author_source import arguments_of, function_text
from cosim.authoring.dataflow.effects import Effects
from cosim.authoring.dataflow.expressions import Expressions
from cosim.authoring.dataflow.left_out import left_out
from cosim.authoring.dataflow.paths import Paths
from cosim.authoring.dataflow.record import WalkRecord
from cosim.authoring.dataflow.statements import Statements
from cosim.authoring.dataflow.symbols import Shape, Symbols
from cosim.authoring.dataflow.views import Views
from cosim.authoring.dataflow.written import Elements

#: What has been found of functions with arguments of certain shapes; None as long as one is being followed.
_Known = dict[Any, Effects | None]


def effects(function: Any, shapes: Sequence[Shape]) -> Effects | None:
    """What a function does to its arguments; None where its source cannot be read, or it calls itself.

    shapes: of each argument.
    """
    return _effects(function, shapes, {})


def _effects(function: Any, shapes: Sequence[Shape], known: _Known) -> Effects | None:
    key = (function, tuple(None if s is None else tuple(s) for s in shapes))
    if key not in known:
        known[key] = None
        text = function_text(function)
        known[key] = _followed(Symbols(function, text.node, shapes), known) if text else None
    return known[key]


def _followed(symbols: Symbols, known: _Known) -> Effects:
    def called(call: ast.Call) -> Effects | None:
        return _of_helper(call, symbols, known)

    views = Views(symbols, called)
    elements = Elements(symbols.node, symbols.shapes)
    record = WalkRecord(symbols.arguments, elements)
    expressions = Expressions(views, called, elements, record)
    paths = Paths(Statements(expressions, views, elements, record), expressions, views, record)
    written = paths.to_the_end(symbols.node.body)
    found = record.effects
    if written is None:  # it never returns
        found.surely = frozenset(symbols.arguments)
    else:
        found.surely = frozenset(name for name in symbols.arguments if name in written)
        found.partly = elements.partly(written)
        found.left_out = left_out(found, symbols)
    return found


def _of_helper(call: ast.Call, symbols: Symbols, known: _Known) -> Effects | None:
    """The effects of a helper on its arguments; None where they cannot be told."""
    helper = symbols.outside(call.func)
    helper = getattr(helper, "py_func", helper)
    if not isinstance(helper, types.FunctionType):
        return None
    starred = any(isinstance(a, ast.Starred) for a in call.args) or any(k.arg is None for k in call.keywords)
    text = function_text(helper)
    if starred or text is None:
        return None
    by_name = {k.arg: k.value for k in call.keywords}
    shapes: list[Shape] = []
    for k, argument in enumerate(arguments_of(text.node)):
        given = call.args[k] if k < len(call.args) else by_name.get(argument.arg)
        axes = symbols.axes(given) if given is not None else None
        shapes.append(None if axes is None else (None,) * axes)
    return _effects(helper, shapes, known)

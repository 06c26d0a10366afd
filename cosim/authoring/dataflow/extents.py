"""Whole numbers of which is known by how much they differ from the size of an array."""

from __future__ import annotations

import ast
from typing import Any

import numpy as np

from cosim.authoring.dataflow.bindings import Element, stored
from cosim.authoring.dataflow.indices import number
from cosim.authoring.dataflow.symbols import Symbols

#: A whole number: a dimension ("": none) whose size it is, and what is added to that.
Extent = tuple[Any, int]


def of_size(size: Any) -> Extent | None:
    """A size, or what a name stands for, as an extent."""
    if isinstance(size, str):
        return size, 0
    return ("", int(size)) if isinstance(size, int | np.integer) and not isinstance(size, bool) else None


def plus(extent: Extent | None, number: int) -> Extent | None:
    """An extent and a number more."""
    return None if extent is None else (extent[0], extent[1] + number)


def extent(node: Any, symbols: Symbols, asking: frozenset[str] = frozenset()) -> Extent | None:
    """What a whole number is made of, where it follows from sizes and constants; asking: names this is asked for."""
    written_out = number(node)
    if written_out is not None:
        return "", written_out
    match node:
        case ast.Name() if node.id in symbols.bindings:
            return _of_local(node.id, symbols, asking)
        case ast.Attribute(value=ast.Name(id=name), attr="size") if name in symbols.arguments:
            return _of_axis(name, 0, symbols) if len(symbols.shapes.get(name) or ()) == 1 else None
        case ast.Call(args=[ast.Name(id=name)]) if symbols.outside(node.func) is len:
            return _of_axis(name, 0, symbols)
        case ast.Subscript(value=ast.Attribute(value=ast.Name(id=name), attr="shape")):
            return _of_axis(name, number(node.slice), symbols)
        case Element(value=ast.Attribute(value=ast.Name(id=name), attr="shape")):
            return _of_axis(name, node.index, symbols)
        case ast.BinOp(op=ast.Add() | ast.Sub()) if (more := number(node.right)) is not None:
            return plus(extent(node.left, symbols, asking), more if isinstance(node.op, ast.Add) else -more)
    return of_size(symbols.outside(node))


def _of_local(name: str, symbols: Symbols, asking: frozenset[str]) -> Extent | None:
    if name in symbols.arguments or name in asking or stored(ast.walk(symbols.node)).count(name) != 1:
        return None
    return extent(symbols.bindings[name][0], symbols, asking | {name})


def _of_axis(name: str, axis: int | None, symbols: Symbols) -> Extent | None:
    shape = symbols.shapes.get(name) if name not in symbols.bindings else None
    return of_size(shape[axis]) if shape and axis is not None and -len(shape) <= axis < len(shape) else None

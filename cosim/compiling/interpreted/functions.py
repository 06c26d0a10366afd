"""An author's function line by line, with other constants and with stand-ins for what it calls.

A kernel computes with float64 (IEEE 754, so that 1/0 is infinite and sqrt(-1) is NaN), int64 (which wraps) and bool,
with which it counts; narrower elements are widened when they are read. Python raises here, its integers grow, and numpy
adds truth values as it pleases.
"""

from __future__ import annotations

import builtins
import math
import types
from collections.abc import Callable
from typing import Any

import numpy as np

from cosim.compiling.interpreted.arrays import array_view
from cosim.compiling.interpreted.numbers import exponent, number, truth
from cosim.compiling.interpreted.stand_ins import BUILTINS, MATH, STANDING, elementwise
from cosim.compiling.interpreted.truth_values import EXPONENT, TRUTH, counting

_functions: dict[int, tuple[Any, Callable[..., Any]]] = {}


def interpreted(python: Callable[..., Any]) -> Callable[..., Any]:
    """The function with the numbers of kernels. Its file and lines stay, so that breakpoints hold."""
    if id(python) in _functions:
        return _functions[id(python)][1]
    assert isinstance(python, types.FunctionType)
    scope: dict[str, Any] = {
        "__builtins__": vars(builtins) | BUILTINS | {TRUTH: truth, EXPONENT: exponent},
        "__name__": python.__module__,
    }
    cells = tuple(types.CellType() for _ in python.__closure__ or ())
    made = types.FunctionType(_code(counting(python)), scope, python.__name__, None, cells or None)
    _functions[id(python)] = python, made  # now, as helpers may call each other
    made.__defaults__ = _seen(python.__defaults__)
    made.__kwdefaults__ = {k: _seen(v) for k, v in (python.__kwdefaults__ or {}).items()} or None
    for cell, origin in zip(cells, python.__closure__ or (), strict=True):
        cell.cell_contents = _seen(origin.cell_contents)
    for name in _names(python.__code__):
        if name in python.__globals__:
            scope[name] = _seen(python.__globals__[name])
    return made


def _seen(value: Any) -> Any:
    """What an interpreted function sees of a global, a default value, or a constant."""
    value = getattr(value, "py_func", value)  # a jitted function
    if isinstance(value, types.FunctionType):
        return interpreted(value)
    if isinstance(value, types.ModuleType):
        return _Module(value)
    if isinstance(value, types.CodeType):
        return _code(value)
    if isinstance(value, tuple):
        return tuple(map(_seen, value))
    if isinstance(value, np.ndarray):
        constant = array_view(value)
        constant.flags.writeable = False
        return constant
    try:
        return STANDING.get(value, number(value))
    except (TypeError, OverflowError):  # not hashable, or no number of ours
        return value


class _Module:
    """A module whose functions and numbers are those of interpreted functions."""

    def __init__(self, module: types.ModuleType) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._module, name)
        if self._module is math:
            found = MATH.get(name, found)
        elif self._module is np and isinstance(found, np.ufunc) and found not in STANDING:
            found = elementwise(found, name)
        else:
            found = _seen(found)
        setattr(self, name, found)
        return found


def _code(code: types.CodeType) -> types.CodeType:
    return code.replace(co_consts=_seen(code.co_consts))


def _names(code: types.CodeType) -> set[str]:
    inner = (c for c in code.co_consts if isinstance(c, types.CodeType))
    return set(code.co_names).union(*map(_names, inner))

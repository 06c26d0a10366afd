"""Which attributes and methods of arrays, and which functions of numpy and Python, view an array and which write it."""

from __future__ import annotations

import ast
import types
from typing import Any

import numpy as np

#: Attributes that are another view of the same elements, methods that return one, and methods that write.
VIEWS = frozenset({"T", "flat", "real", "imag"})
VIEWING = frozenset({"reshape", "ravel", "view", "transpose", "squeeze", "swapaxes", "diagonal"})
WRITING = frozenset({"fill", "itemset", "put", "partition", "resize", "setfield", "setflags", "sort"})
#: Methods that read all elements.
READING = frozenset({"sum", "mean", "min", "max", "prod", "any", "all", "dot", "copy", "clip", "trace"})
#: Attributes that say nothing of the elements.
SHAPE = frozenset({"size", "shape", "ndim", "dtype", "nbytes", "itemsize", "strides"})

_VIEWING_FUNCTIONS = frozenset({"asarray", "ascontiguousarray", "atleast_1d", "atleast_2d", "ravel", "reshape"}) | {
    "transpose",
    "squeeze",
    "swapaxes",
    "diagonal",
    "expand_dims",
    "broadcast_to",
}
_WRITING_FUNCTIONS = frozenset({"copyto", "put", "place", "putmask", "fill_diagonal", "shuffle"})


def views_first(function: Any) -> bool:
    """Whether a function of numpy returns another view of its first argument."""
    return _is_numpy(function) and function.__name__ in _VIEWING_FUNCTIONS


def reads_elements(function: Any) -> bool:
    """Whether a function of numpy reads the elements of what it is given, and makes no other view of it."""
    return (
        not views_first(function)
        and function.__name__ not in _WRITING_FUNCTIONS | {"shape", "size", "ndim"}
        and (not function.__name__.endswith("_like"))
    )


def written_by_numpy(call: ast.Call, function: Any) -> list[Any] | None:
    """What a function of numpy writes; None where it is none, or one that is not known."""
    if not _is_numpy(function):
        return None
    outs = [k.value for k in call.keywords if k.arg == "out"]
    if isinstance(function, np.ufunc):
        outs += call.args[function.nin :]
    elif function.__name__ in _WRITING_FUNCTIONS:
        outs += call.args[:1]
    return [part for out in outs for part in (out.elts if isinstance(out, ast.Tuple) else [out])]


def is_harmless(function: Any) -> bool:
    """Whether a function of Python's own writes nothing."""
    module = getattr(function, "__module__", None)
    own = module in ("builtins", "math", "cmath") and not isinstance(function, types.FunctionType)
    return function is not None and own


def _is_numpy(value: Any) -> bool:
    module = getattr(value, "__module__", None)
    return callable(value) and (isinstance(value, np.ufunc) or (isinstance(module, str) and module.startswith("numpy")))

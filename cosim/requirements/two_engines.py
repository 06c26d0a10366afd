"""The functions of requirements that are dear, for either engine: compiled when first needed, or as they are."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from threading import Lock

Kernel = Callable[[float, int, int], int]
"""A function of a time, and of two addresses, the second of which is its frame's."""
_PROTOTYPE = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_int64, ctypes.c_int64)
_loading = Lock()


def kernel(function: Kernel, native: bool) -> Kernel:
    """A function, compiled where `native`."""
    if not native:
        return function
    with _loading:  # runs of a study share a process
        return _compiled(function)


@cache
def _compiled(function: Kernel) -> Kernel:
    from cosim.compiling import kernels

    name = function.__name__
    made = kernels.module(kernels.raw_sources(f"requirements-{name}", (function,)))
    return _PROTOTYPE(made.load().address(name))

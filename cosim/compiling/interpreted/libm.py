"""Functions of real numbers as the C library has them, which kernels call too."""

from __future__ import annotations

import ctypes
import ctypes.util
from collections.abc import Callable
from functools import cache


@cache
def of_c(name: str, arguments: int) -> Callable[..., float]:
    """A function of the C library, of as many floats."""
    library = ctypes.CDLL(ctypes.util.find_library("m") or None)
    function = library[name]
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double] * arguments
    return function

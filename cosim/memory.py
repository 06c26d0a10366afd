"""Raw memory as the loop and the adapters see it: addresses of words, reals and functions.

These are the plain-Python meanings. When a function that uses them is compiled, `cosim.kernels` puts machine
instructions in their place, so the same source serves the compiled and the interpreted engine.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

#: What `call` reaches in the interpreted engine: handle -> (time) -> status.
interpreted: dict[int, Callable[[float], int]] = {}


def words_at(address: int, size: int) -> np.ndarray:
    """The `size` int64 words at an address, as a view (size,)."""
    return np.ctypeslib.as_array((ctypes.c_int64 * int(size)).from_address(int(address)))


def reals_at(address: int, size: int) -> np.ndarray:
    """The `size` float64 numbers at an address, as a view (size,)."""
    return np.ctypeslib.as_array((ctypes.c_double * int(size)).from_address(int(address)))


def call(function: int, time: float, base: int, frame: int) -> int:
    """Call ``int32 function(double time, uint8 *base, int64 *frame)`` at an address and return its status."""
    return interpreted[int(function)](float(time))

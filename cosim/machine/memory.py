"""Raw memory as the loop and the adapters see it: addresses of words, reals and functions.

These are the plain-Python meanings. When a function that uses them is compiled, `cosim.compiling.helpers` puts the
machine instructions of `cosim.compiling.intrinsics` in their place, so the same source serves the compiled and the
interpreted engine.
"""

from __future__ import annotations

import ctypes
import math
import mmap
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache

import numpy as np

from cosim.machine import floating

#: What `call` reaches in the interpreted engine: handle -> (time) -> status.
interpreted: dict[int, Callable[[float], int]] = {}
#: What `power` is in the interpreted engine: as compiled code has it, once that is loaded.
powers: list[Callable[[float, float], float]] = [math.pow]


ALIGNMENT = 64
_WIPE_ON_FORK = 18  # MADV_WIPEONFORK of madvise(2)
_INHERIT_ZERO = 3  # INHERIT_ZERO of minherit(2)


def private(size: int) -> np.ndarray:
    """Zeroed bytes (size,) on an aligned address."""
    raw = np.zeros(size + ALIGNMENT, np.uint8)
    start = -raw.ctypes.data % ALIGNMENT
    return raw[start : start + size]


def shared(size: int) -> np.ndarray:
    """Zeroed bytes (size,) that processes forked later have in common, at the same address."""
    return np.frombuffer(mmap.mmap(-1, max(1, size)), np.uint8)[:size]


def own() -> np.ndarray:
    """A word that is 1 in this process, and 0 in those that are forked from it later, where the system can do that."""
    if sys.platform == "win32":  # has no fork
        return np.ones(1, np.int64)
    page = mmap.mmap(-1, mmap.PAGESIZE, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    word = np.frombuffer(page, np.int64)[:1]
    if sys.platform == "linux":
        with suppress(OSError):  # before Linux 4.14
            page.madvise(_WIPE_ON_FORK)
    elif hasattr(library := ctypes.CDLL(None), "minherit"):
        library.minherit(ctypes.c_void_p(word.ctypes.data), ctypes.c_size_t(mmap.PAGESIZE), _INHERIT_ZERO)
    word[0] = 1
    return word


def words_at(address: int, size: int) -> np.ndarray:
    """The `size` int64 words at an address, as a view (size,)."""
    return np.asarray((ctypes.c_int64 * int(size)).from_address(int(address)))


def reals_at(address: int, size: int) -> np.ndarray:
    """The `size` float64 numbers at an address, as a view (size,)."""
    return np.asarray((ctypes.c_double * int(size)).from_address(int(address)))


def singles_at(address: int, size: int) -> np.ndarray:
    """The `size` float32 numbers at an address, as a view (size,)."""
    return np.asarray((ctypes.c_float * int(size)).from_address(int(address)))


def integers_at(address: int, size: int) -> np.ndarray:
    """The `size` int32 numbers at an address, as a view (size,)."""
    return np.asarray((ctypes.c_int32 * int(size)).from_address(int(address)))


def bytes_at(address: int, size: int) -> np.ndarray:
    """The `size` bytes at an address, as a view (size,)."""
    return np.asarray((ctypes.c_uint8 * int(size)).from_address(int(address)))


def invoke(function: int, arguments: tuple[int | float, ...]) -> int:
    """Call a C function that returns an int32: floats go as double, integers and addresses as 64-bit words.

    The floating-point control word is afterwards what it was, which for the loop is the default.
    """
    kinds = tuple(ctypes.c_double if isinstance(a, float) else ctypes.c_int64 for a in arguments)
    plain = [float(a) if isinstance(a, float) else int(a) for a in arguments]
    with floating.kept():
        return _prototype(kinds)(int(function))(*plain)


@cache
def _prototype(kinds: tuple[type, ...]) -> Callable[[int], Callable[..., int]]:
    return ctypes.CFUNCTYPE(ctypes.c_int32, *kinds)


def call(function: int, time: float, base: int, frame: int) -> int:
    """Call ``int32 function(double time, uint8 *base, int64 *frame)`` at an address and return its status."""
    return interpreted[int(function)](float(time))


def power(base: float, exponent: float) -> float:
    """A power of a number above 0."""
    return powers[0](base, exponent)


def load(address: int) -> int:
    """The word at an address that another process may change at any time."""
    return ctypes.c_int64.from_address(int(address)).value


def store(address: int, value: int) -> None:
    """Change a word that another process waits for; it sees all that was written before."""
    ctypes.c_int64.from_address(int(address)).value = int(value)


def pause() -> None:
    """Let a moment pass while waiting for another processor."""
    time.sleep(0)

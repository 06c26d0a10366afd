"""The floating-point control word of the running thread: rounding, what becomes of subnormal numbers, traps.

Foreign code may leave it changed (a library that was linked with -ffast-math does so as it is loaded), and with it the
figures of everybody who computes in that thread.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

_WORDS = 32  # more than any system's fenv_t
_WINDOWS_DEFAULT = (
    0x0008001F,
    0x0308031F,
)  # _controlfp_s: no traps, to the nearest, subnormal numbers kept; of all these


@contextmanager
def kept() -> Iterator[None]:
    """Whatever is called inside, the control word is afterwards what it was."""
    before = (ctypes.c_uint64 * _WORDS)()
    library = _library()
    library.fegetenv(before)
    try:
        yield
    finally:
        library.fesetenv(before)


@contextmanager
def standard() -> Iterator[None]:
    """Inside, arithmetic is IEEE 754's default: rounded to the nearest, with subnormal numbers, without traps."""
    with kept():
        if sys.platform == "win32":
            value, mask = _WINDOWS_DEFAULT
            _library()._controlfp_s(ctypes.byref(ctypes.c_uint()), value, mask)  # noqa: SLF001  # its name in C
        else:
            _library().fesetenv(_default())
        yield


@cache
def _library() -> Any:
    """The C library with <fenv.h>."""
    if sys.platform == "win32":
        return ctypes.CDLL("ucrtbase")
    library = ctypes.CDLL(None)
    return library if hasattr(library, "fesetenv") else ctypes.CDLL("libm.so.6")


@cache
def _default() -> Any:
    """FE_DFL_ENV."""
    if sys.platform == "darwin":
        return ctypes.byref(ctypes.c_uint64.in_dll(_library(), "_FE_DFL_ENV"))
    return ctypes.c_void_p(-1)

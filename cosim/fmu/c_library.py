"""The C library of this process."""

from __future__ import annotations

import ctypes
import sys


def address(name: str) -> int:
    """The address of a function of the C library."""
    library = ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)
    return ctypes.cast(getattr(library, name), ctypes.c_void_p).value or 0

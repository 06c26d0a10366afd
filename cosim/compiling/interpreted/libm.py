"""Functions of real numbers as kernels have them: the plain ones in the same code, all others the C library's."""

from __future__ import annotations

import ctypes
import ctypes.util
import hashlib
import json
from collections.abc import Callable
from functools import cache

from cosim.compiling import emission
from cosim.machine import cache as kept
from cosim.machine import object_code
from cosim.plain_math.definitions import FUNCTIONS, definition


@cache
def as_compiled(name: str, arguments: int) -> Callable[..., float]:
    """A function of as many floats."""
    if name in FUNCTIONS:
        address = _plain().address(f"cosim_{name}")
        return ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_double] * arguments)(address)
    library = ctypes.CDLL(ctypes.util.find_library("m") or None)
    function = library[name]
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double] * arguments
    return function


@cache
def _plain() -> object_code.Library:
    """The plain functions, from the cache or compiled now."""
    parts = json.dumps([*object_code.host(), *kept.toolchain()])
    entry = f"plain-{hashlib.sha256(parts.encode()).hexdigest()[:24]}"
    code = kept.read(entry)
    if code is None:
        symbols = [f"cosim_{name}" for name in FUNCTIONS]
        code = emission.emit("".join(map(definition, FUNCTIONS)), *object_code.host(), symbols, "functions")
        kept.write(entry, code)
    return object_code.Library(code)

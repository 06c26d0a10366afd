"""Which names a function's bytecode reads from outside of it."""

from __future__ import annotations

import dis
import sys
import types
from typing import Any

Road = tuple[str, ...]
Import = tuple[str, int, tuple[str, ...]]


def reads(code: types.CodeType) -> tuple[set[Road], set[Import]]:
    """What code reads from its globals, and which modules it imports when it runs; not of the functions inside it.

    A road is a global's name with the attributes that are read of it at once, such as ("math", "pi"). An import is the
    module's name, the number of dots before it, and the names that are taken from it.
    """
    roads: set[Road] = set()
    imports: set[Import] = set()
    road: Road = ()
    before: tuple[Any, Any] = None, None  # the values of the two instructions before, as far as they are constants
    high, data = 0, code.co_code
    for at in range(0, len(data), 2):
        operation = data[at]
        if not operation:  # room for the interpreter's caches
            continue
        argument = data[at + 1] | high
        if operation == _EXTENDED:
            high = argument << 8
            continue
        high = 0
        if operation in _ATTRIBUTES and road:
            road = (*road, code.co_names[argument >> _ATTRIBUTE_SHIFT])
            continue
        if road:
            roads.add(road)
            road = ()
        if operation == _GLOBAL:
            road = (code.co_names[argument >> 1],)
        elif operation == _NAME:
            road = (code.co_names[argument],)
        elif operation == _IMPORT:
            imports.add((code.co_names[argument], before[0], before[1] or ()))
        before = before[1], code.co_consts[argument] if operation == _CONSTANT else argument
    return (roads | {road} if road else roads), imports


_GLOBAL, _NAME, _CONSTANT, _IMPORT, _EXTENDED = (
    dis.opmap[name] for name in ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_CONST", "IMPORT_NAME", "EXTENDED_ARG")
)
_ATTRIBUTES = {dis.opmap[name] for name in ("LOAD_ATTR", "LOAD_METHOD") if name in dis.opmap}
_ATTRIBUTE_SHIFT = int(sys.version_info >= (3, 12))  # there the lowest bit says whether a method is called

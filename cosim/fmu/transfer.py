"""Calls of an FMU's C functions, and the values that they set and get: the lower half of the adapter.

A function here returns whether it failed; the link then says where.
"""

from __future__ import annotations

from typing import Any

from cosim.fmu.fields import (
    ALONE,
    BOOLEAN32,
    BYTES,
    CALLED,
    CALLING,
    CODE,
    ERROR,
    FAILED,
    FLOAT32,
    FLOAT64,
    FUNCTION,
    HANDLE,
    INPUTS,
    INTEGER32,
    LEAVE,
    N_INPUTS,
    N_OUTPUTS,
    N_REFERENCES,
    N_VALUES,
    NOT_FINITE,
    OK,
    OUTPUTS,
    REFERENCES,
    ROW,
    ROW_WORDS,
    SHADOW,
    SLOT,
    STAGING,
    STATUS,
    TOO_LARGE,
    VERSION,
    WARNING,
    WARNINGS,
)
from cosim.machine.memory import bytes_at, integers_at, invoke, words_at

_EXPONENT64 = 0x7FF0000000000000
_EXPONENT32 = 0x7F800000
_LARGEST32 = 0x7FFFFFFF


def bad(link: Any, function: int, arguments: Any) -> bool:
    """Call a C function. Returns whether its status is worse than a warning, and keeps both.

    A process that the FMU forks there may run a program of its own, but goes no further here.
    """
    link[CALLING] = function
    link[CALLED] += 1
    status = invoke(function, arguments)
    if words_at(link[ALONE], 1)[0] == 0:
        invoke(link[LEAVE], (0,))
    link[CALLED] += 1
    if status == WARNING:
        link[WARNINGS] += 1
    elif status != OK:
        link[STATUS] = status
        link[FAILED] = function
        link[ROW] = 0
        return True
    return False


def give_up(link: Any, reason: int, row: int) -> bool:
    """Fail for a reason of our own."""
    link[STATUS] = ERROR
    link[FAILED] = reason
    link[ROW] = row
    return True


def transfer(link: Any, row: Any, handle: int, data: int) -> bool:
    """Call a getter or a setter."""
    if link[VERSION] == 2:
        return bad(link, row[FUNCTION], (handle, row[REFERENCES], row[N_REFERENCES], data))
    return bad(link, row[FUNCTION], (handle, row[REFERENCES], row[N_REFERENCES], data, row[N_VALUES]))


def set_value(link: Any, row: Any, address: int, handle: int, at: int, k: int) -> bool:
    """Set one variable of instance k from the arena."""
    n = row[N_VALUES]
    data = at
    if row[CODE] == INTEGER32:
        data = row[STAGING]
        narrow, wide = integers_at(data, n), words_at(at, n)
        for j in range(n):
            if wide[j] > _LARGEST32 or wide[j] < -_LARGEST32 - 1:
                return give_up(link, TOO_LARGE, address)
            narrow[j] = wide[j]
    elif row[CODE] == BOOLEAN32:
        data = row[STAGING]
        wide_flags, flags = integers_at(data, n), bytes_at(at, n)
        for j in range(n):
            wide_flags[j] = flags[j]
    if row[SHADOW] != 0:
        new, old = bytes_at(at, row[BYTES]), bytes_at(row[SHADOW] + k * row[BYTES], row[BYTES])
        for j in range(row[BYTES]):
            old[j] = new[j]
    if transfer(link, row, handle, data):
        link[ROW] = address
        return True
    return False


def get_value(link: Any, row: Any, address: int, handle: int, at: int) -> bool:
    """Get one variable into the arena; what is not finite fails."""
    n = row[N_VALUES]
    code = row[CODE]
    staged = code in (INTEGER32, BOOLEAN32)
    if transfer(link, row, handle, row[STAGING] if staged else at):
        link[ROW] = address
        return True
    if code == FLOAT64:
        bits = words_at(at, n)
        for j in range(n):
            if (bits[j] & _EXPONENT64) == _EXPONENT64:
                return give_up(link, NOT_FINITE, address)
    elif code == FLOAT32:
        short_bits = integers_at(at, n)
        for j in range(n):
            if (short_bits[j] & _EXPONENT32) == _EXPONENT32:
                return give_up(link, NOT_FINITE, address)
    elif code == INTEGER32:
        narrow, wide = integers_at(row[STAGING], n), words_at(at, n)
        for j in range(n):
            wide[j] = narrow[j]
    elif code == BOOLEAN32:
        wide_flags, flags = integers_at(row[STAGING], n), bytes_at(at, n)
        for j in range(n):
            flags[j] = 1 if wide_flags[j] != 0 else 0
    return False


def set_inputs(base: int, link: Any, plan: Any, f: Any, r: Any, k: int) -> bool:
    """Set all inputs that the call reads."""
    for i in range(plan[N_INPUTS]):
        address = plan[INPUTS] + i * ROW_WORDS * 8
        row = words_at(address, ROW_WORDS)
        at = base + f[row[SLOT]] + k * f[row[SLOT] + 1]
        if set_value(link, row, address, r[HANDLE], at, k):
            return True
    return False


def get_outputs(base: int, link: Any, plan: Any, f: Any, r: Any, k: int) -> bool:
    """Get all outputs that the call writes."""
    for i in range(plan[N_OUTPUTS]):
        address = plan[OUTPUTS] + i * ROW_WORDS * 8
        row = words_at(address, ROW_WORDS)
        at = base + f[row[SLOT]] + k * f[row[SLOT] + 1]
        if get_value(link, row, address, r[HANDLE], at):
            return True
    return False


def differs(one: int, other: int, size: int) -> bool:
    """Whether two pieces of memory have different bytes."""
    a, b = bytes_at(one, size), bytes_at(other, size)
    different = 0
    for j in range(size):
        different |= a[j] ^ b[j]
    return different != 0

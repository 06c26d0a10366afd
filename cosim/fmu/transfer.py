"""Calls of an FMU's C functions, and the values that they set and get: the lower half of the adapter.

A function here returns whether it failed; the link then says where.
"""

from __future__ import annotations

from typing import Any

from cosim.fmu.fields import (
    ALONE,
    BOOLEAN32,
    BUFFERED,
    BYTES,
    CALLED,
    CALLING,
    CODE,
    COUNT_OF,
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
    N_PARTS,
    N_REFERENCES,
    N_VALUES,
    NOT_FINITE,
    OK,
    OUTPUTS,
    PART_WORDS,
    PARTS,
    REFERENCES,
    ROW,
    ROW_WORDS,
    SHADOW,
    SLOT,
    STATUS,
    TOO_LARGE,
    TRAVELLING,
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


def transfer(link: Any, row: Any, address: int, handle: int, values: int) -> bool:
    """Call the getter or setter of a row, which lies at an address."""
    arguments = (handle, row[REFERENCES], row[N_REFERENCES], values)
    if link[VERSION] == 2:
        lost = bad(link, row[FUNCTION], arguments)
    else:
        lost = bad(link, row[FUNCTION], (*arguments, row[N_VALUES]))
    if lost:
        link[ROW] = address
    return lost


def set_row(base: int, link: Any, address: int, f: Any, r: Any, k: int) -> bool:
    """Set the variables of one row, of instance k, from the arena."""
    row = words_at(address, ROW_WORDS)
    first = to = row[BUFFERED]
    for i in range(row[N_PARTS]):
        where = row[PARTS] + i * PART_WORDS * 8
        part = words_at(where, PART_WORDS)
        at = base + f[part[SLOT]] + k * f[part[SLOT] + 1]
        if part[SHADOW] != 0:
            move_bytes(part[SHADOW] + k * part[BYTES], at, part[BYTES])
        if first == 0:
            return transfer(link, row, address, r[HANDLE], at)
        if pack(link, part, where, to, at):
            return True
        to += part[TRAVELLING]
    return transfer(link, row, address, r[HANDLE], first)


def get_row(base: int, link: Any, address: int, f: Any, r: Any, k: int) -> bool:
    """Get the variables of one row into the arena; what is not finite fails."""
    row = words_at(address, ROW_WORDS)
    source = row[BUFFERED]
    if source != 0 and transfer(link, row, address, r[HANDLE], source):
        return True
    for i in range(row[N_PARTS]):
        where = row[PARTS] + i * PART_WORDS * 8
        part = words_at(where, PART_WORDS)
        at = base + f[part[SLOT]] + k * f[part[SLOT] + 1]
        if row[BUFFERED] == 0:
            if transfer(link, row, address, r[HANDLE], at):
                return True
        else:
            unpack(part, at, source)
        if not is_finite(part, at):
            return give_up(link, NOT_FINITE, where)
        source += part[TRAVELLING]
    return False


def pack(link: Any, part: Any, where: int, to: int, at: int) -> bool:
    """Put a variable's values, from an address in the arena, where they travel."""
    n = part[COUNT_OF]
    if part[CODE] == INTEGER32:
        narrow, wide = integers_at(to, n), words_at(at, n)
        for j in range(n):
            if wide[j] > _LARGEST32 or wide[j] < -_LARGEST32 - 1:
                return give_up(link, TOO_LARGE, where)
            narrow[j] = wide[j]
    elif part[CODE] == BOOLEAN32:
        wide_flags, flags = integers_at(to, n), bytes_at(at, n)
        for j in range(n):
            wide_flags[j] = flags[j]
    else:
        move_bytes(to, at, part[BYTES])
    return False


def unpack(part: Any, at: int, source: int) -> None:
    """The other way round."""
    n = part[COUNT_OF]
    if part[CODE] == INTEGER32:
        narrow, wide = integers_at(source, n), words_at(at, n)
        for j in range(n):
            wide[j] = narrow[j]
    elif part[CODE] == BOOLEAN32:
        wide_flags, flags = integers_at(source, n), bytes_at(at, n)
        for j in range(n):
            flags[j] = 1 if wide_flags[j] != 0 else 0
    else:
        move_bytes(at, source, part[BYTES])


def is_finite(part: Any, at: int) -> bool:
    """Whether the values of a variable at an address are, where they are real numbers."""
    n = part[COUNT_OF]
    if part[CODE] == FLOAT64:
        bits = words_at(at, n)
        for j in range(n):
            if (bits[j] & _EXPONENT64) == _EXPONENT64:
                return False
    elif part[CODE] == FLOAT32:
        short_bits = integers_at(at, n)
        for j in range(n):
            if (short_bits[j] & _EXPONENT32) == _EXPONENT32:
                return False
    return True


def move_bytes(to: int, source: int, size: int) -> None:
    """Copy memory, whole words where it lies so."""
    if (to | source | size) & 7 == 0:
        words, there = words_at(to, size // 8), words_at(source, size // 8)
        for j in range(size // 8):
            words[j] = there[j]
    else:
        new, old = bytes_at(to, size), bytes_at(source, size)
        for j in range(size):
            new[j] = old[j]


def set_inputs(base: int, link: Any, plan: Any, f: Any, r: Any, k: int) -> bool:
    """Set all inputs that the call reads."""
    row, lost = 0, False
    while row < plan[N_INPUTS] and not lost:
        lost = set_row(base, link, plan[INPUTS] + row * ROW_WORDS * 8, f, r, k)
        row += 1
    return lost


def get_outputs(base: int, link: Any, plan: Any, f: Any, r: Any, k: int) -> bool:
    """Get all outputs that the call writes."""
    row, lost = 0, False
    while row < plan[N_OUTPUTS] and not lost:
        lost = get_row(base, link, plan[OUTPUTS] + row * ROW_WORDS * 8, f, r, k)
        row += 1
    return lost


def has_changed(base: int, row: Any, f: Any, k: int) -> bool:
    """Whether a row's variables have other values than the FMU has now."""
    different = 0
    for i in range(row[N_PARTS]):
        part = words_at(row[PARTS] + i * PART_WORDS * 8, PART_WORDS)
        new = bytes_at(base + f[part[SLOT]] + k * f[part[SLOT] + 1], part[BYTES])
        old = bytes_at(part[SHADOW] + k * part[BYTES], part[BYTES])
        for j in range(part[BYTES]):
            different |= new[j] ^ old[j]
    return different != 0

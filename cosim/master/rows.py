"""Rows in order: calls and copies, and algebraic loops, which are solved. One source, two engines, as in `loop.py`."""

from __future__ import annotations

from typing import Any

from cosim.machine.memory import words_at
from cosim.master.newton import solve
from cosim.master.tables import (
    INNER_BEGIN,
    INNER_END,
    KIND,
    LOOPS,
    OK,
    ROW_BYTES,
    ROW_WORDS,
    ROWS,
    SOLVE,
    WARNING,
    B,
    evaluate,
)


def differentiate(c: Any, base: int, b: Any, time: float) -> int:
    """The derivatives of a bank's stage at a time (s), to D. Returns the status."""
    return operate(c, base, b[INNER_BEGIN], b[INNER_END], time, time)


def operate(c: Any, base: int, begin: int, end: int, time: float, later: float) -> int:
    """Do calls, copies and loops in order, as of a time (s); later: of rows that are done at its end."""
    if c[LOOPS] == 0:
        return evaluate(c, base, begin, end, time, later)
    o = begin
    while o < end:
        row = words_at(c[ROWS] + o * ROW_BYTES, ROW_WORDS)
        if row[KIND] == SOLVE:
            status = solve(c, base, o, time, later)
            o += row[B] + 1
        else:
            first = o
            while o < end and words_at(c[ROWS] + o * ROW_BYTES, ROW_WORDS)[KIND] != SOLVE:
                o += 1
            status = evaluate(c, base, first, o, time, later)
        if status > WARNING:
            return status
    return OK

"""From one communication point to the next: which tick that is, what is due there, phases, and the way between.

One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.machine.memory import reals_at, words_at
from cosim.master.integration import integrate
from cosim.master.rows import operate
from cosim.master.tables import (
    ADVANCE,
    CLOCK_WORDS,
    CLOCKS,
    CONTROL_WORDS,
    DUE,
    EARLY,
    ENDING,
    GRID,
    INTEGRATE,
    KEPT_ENDING,
    KIND,
    LEFT,
    N_CLOCKS,
    NEVER,
    OFFSET,
    OK,
    ORIGIN,
    ORIGIN_TICK,
    PERIOD,
    PHASE,
    PHASE_WORDS,
    ROW_BYTES,
    ROW_WORDS,
    ROWS,
    SAVE,
    SOLVE,
    STEP_SIZE,
    TICK_SIZE,
    WARNING,
    A,
    B,
)


def next_point(c: Any, base: int, k: int) -> int:
    """The tick of the communication point after tick k: of the grid, or where a clock is due."""
    grid = c[GRID]
    following: int = k + grid - k % grid
    if grid != 1:
        for j in range(c[N_CLOCKS]):
            clock = words_at(base + c[CLOCKS] + j * CLOCK_WORDS * 8, CLOCK_WORDS)
            since = k - clock[OFFSET]
            due = clock[OFFSET] if since < 0 else k + clock[PERIOD] - since % clock[PERIOD]
            following = min(following, due)
    return following


def strike(c: Any, base: int, k: int) -> None:
    """Note which clocks are due at tick k: those of events are at every point."""
    for j in range(c[N_CLOCKS]):
        clock = words_at(base + c[CLOCKS] + j * CLOCK_WORDS * 8, CLOCK_WORDS)
        since = k - clock[OFFSET]
        clock[DUE] = 1 if clock[OFFSET] == NEVER or (since >= 0 and since % clock[PERIOD] == 0) else 0


def hush(c: Any, base: int) -> None:
    """Have no clock be due."""
    for j in range(c[N_CLOCKS]):
        words_at(base + c[CLOCKS] + j * CLOCK_WORDS * 8, CLOCK_WORDS)[DUE] = 0


def time_at(c: Any, control: int, k: int) -> float:
    """The time (s) of tick k, from an integer count."""
    numbers = reals_at(control, CONTROL_WORDS)
    time: float = numbers[ORIGIN] + (k - c[ORIGIN_TICK]) * numbers[TICK_SIZE]
    return time


def perform(c: Any, base: int, first: int, last: int, time: float) -> int:
    """Do phases that follow each other, as of a time (s). Returns the status."""
    begin = words_at(c[PHASE] + first * PHASE_WORDS * 8, PHASE_WORDS)[0]
    end = words_at(c[PHASE] + last * PHASE_WORDS * 8, PHASE_WORDS)[1]
    return operate(c, base, begin, end, time, time)


def save(c: Any, base: int, time: float) -> int:
    """Keep what there is at a time (s), for `restore`. Returns the status."""
    c[KEPT_ENDING] = c[ENDING]
    return perform(c, base, SAVE, SAVE, time)


def restore(c: Any, base: int, phase: int, time: float) -> int:
    """Be where all was saved, at a time (s). phase: REJECT, or REPEAT. Returns the status."""
    c[ENDING] = c[KEPT_ENDING]
    return perform(c, base, phase, phase, time)


def advance(c: Any, base: int, control: int, time: float, later: float, step: float) -> int:
    """Go from a time (s) to a later one: ADVANCE with its integrations. Returns the status.

    A foreign block may stop before: then EARLY says when. Until it is accepted, what is
    evaluated then is LEFT of events.
    """
    numbers = reals_at(control, CONTROL_WORDS)
    numbers[STEP_SIZE], numbers[EARLY] = step, math.inf
    c[LEFT] = 1
    phase = words_at(c[PHASE] + ADVANCE * PHASE_WORDS * 8, PHASE_WORDS)
    o = phase[0]
    while o < phase[1]:
        row = words_at(c[ROWS] + o * ROW_BYTES, ROW_WORDS)
        following = row[B] if row[KIND] == SOLVE else 0
        if row[KIND] == INTEGRATE:
            status = integrate(c, base, row[A], time, step)
        else:
            status = operate(c, base, o, o + 1 + following, time, later)
        if status > WARNING:
            return status
        o += 1 + following
    return OK

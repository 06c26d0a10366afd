"""A step that may be judged and done anew: repeated with inputs that are known at its end, or shortened.

    save
    repeat
        advance by n ticks, with inputs as their histories extrapolate them
        evaluate at the end: what blocks then give differs by ε from what was extrapolated
        if ε is too large, and n not the smallest: restore all, take fewer ticks, and anew
    as often as the step is to be repeated
        histories take what blocks give at the end, restore the rest, and advance by n ticks, with inputs interpolated
    the next step: as long as ε promises

ε is relative to the largest value that a wire has brought so far. What sampled blocks give does not change in a step.
One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.machine.memory import reals_at, words_at
from cosim.master.crossings import anticipate, pursue
from cosim.master.histories import measure, misfit, order_of
from cosim.master.stepping import advance, hush, perform, time_at
from cosim.master.tables import (
    COARSE,
    CONTROL_WORDS,
    ENDING,
    EVALUATE,
    FATAL,
    HISTORIES,
    KEEP,
    LONGEST,
    N_HISTORIES,
    N_INDICATORS,
    OK,
    PROPOSED,
    REJECT,
    REPEAT,
    REPEATS,
    ROLLBACK,
    SAVE,
    SHORTEST,
    STARTS,
    STEP_SIZE,
    TICK,
    TICK_SIZE,
    TOLERANCE,
    UNDONE,
    WARNING,
)

SAFETY = 0.9
LEAST, MOST = 0.2, 5.0  # by how much the next step may be shorter or longer than the last
CAUTIOUS = 1.2  # the same where no step is done anew, so that one that is too long is little so


def attempt(c: Any, base: int, control: int, bound: int) -> int:
    """From tick TICK to a later one, no later than `bound`. Returns the status."""
    k = c[TICK]
    numbers = reals_at(control, CONTROL_WORDS)
    time, ending, n = time_at(c, control, k), c[ENDING], bound - k
    if numbers[TOLERANCE] > 0.0:
        n = share(c, n)
    status = anticipate(c, base, time) if c[N_INDICATORS] != 0 else OK
    if status <= WARNING:
        status = perform(c, base, SAVE, SAVE, time)
    while status <= WARNING:
        later = time_at(c, control, k + n)
        numbers[STEP_SIZE] = n * numbers[TICK_SIZE]
        status = advance(c, base, time, later, numbers[STEP_SIZE])
        factor = judge(c, base, numbers[TOLERANCE], status, later)
        if factor < 1.0 and n > 1 and c[ROLLBACK] != 0 and status != FATAL:
            c[UNDONE] += 1
            c[ENDING] = ending
            n = max(1, int(n * max(LEAST, SAFETY * factor)))
            status = perform(c, base, REJECT, REJECT, time)
        else:
            settle(c, base, k, n, factor)
            if status <= WARNING:
                status = repeat(c, base, time, later, numbers[STEP_SIZE])
            if status <= WARNING and c[N_INDICATORS] != 0:
                status = pursue(c, base, time, later)
            return status
    return status


def share(c: Any, left: int) -> int:
    """How many ticks to take of those that are left before a point that has to be hit: one of equal parts."""
    parts = (left + c[PROPOSED] - 1) // c[PROPOSED]
    n: int = (left + parts - 1) // parts
    return n


def judge(c: Any, base: int, tolerance: float, status: int, later: float) -> float:
    """How many times as long a step might have been, by what blocks give at its end; below 1, it was too long."""
    if tolerance == 0.0:
        return 1.0
    if status > WARNING:
        return LEAST
    hush(c, base)
    if perform(c, base, EVALUATE, EVALUATE, later) > WARNING:
        return LEAST
    factor = MOST / SAFETY
    for j in range(c[N_HISTORIES]):
        history = words_at(base + c[HISTORIES] + j * 8, 1)[0]
        error = misfit(base, history, later) / tolerance
        if error > 0.0:
            factor = min(factor, (1.0 / error) ** (1.0 / (order_of(base, history) + 1)))
    return factor


def settle(c: Any, base: int, k: int, n: int, factor: float) -> None:
    """Be n ticks later, and say how long the next step may be."""
    c[TICK] = k + n
    c[COARSE] += 1 if factor < 1.0 else 0
    c[SHORTEST] = n if c[SHORTEST] == 0 else min(c[SHORTEST], n)
    c[LONGEST] = max(c[LONGEST], n)
    most = MOST if c[ROLLBACK] != 0 else CAUTIOUS
    c[PROPOSED] = max(1, math.ceil(n * min(most, max(LEAST, SAFETY * factor))))
    for j in range(c[N_HISTORIES]):
        measure(base, words_at(base + c[HISTORIES] + j * 8, 1)[0])


def repeat(c: Any, base: int, time: float, later: float, step: float) -> int:
    """Do the step again with inputs interpolated to what blocks give at its end. Returns the status."""
    times = c[REPEATS]
    for j in range(c[N_HISTORIES] if c[STARTS] != 0 else 0):
        if order_of(base, words_at(base + c[HISTORIES] + j * 8, 1)[0]) == 0:
            times = max(times, 1)
    for _ in range(times):
        hush(c, base)
        status = perform(c, base, EVALUATE, EVALUATE, later)
        if status <= WARNING:
            status = perform(c, base, KEEP, KEEP, later)
        if status <= WARNING:
            status = perform(c, base, REPEAT, REPEAT, time)
        if status <= WARNING:
            status = advance(c, base, time, later, step)
        if status > WARNING:
            return status
    return OK

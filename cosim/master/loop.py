"""The master's loop: walks the rows of a program over an arena, and knows no diagram.

What a step means says `cosim.engine.program`.

One source, two engines: compiled by `cosim.compiling.compiler` it calls kernels by address; as plain Python it calls
the authors' functions (see `cosim.machine.memory`). Nothing here allocates, takes a lock, or returns before the steps
asked for are done, a buffer of probes is full, somebody wants it to stop, a call's status is worse than a warning, or a
published value is not finite. Time is an integer count of ticks, of which every period is a multiple.

All tables are rows of 64-bit words. `base` is the arena's address, offsets in the tables are bytes from it.
"""

from __future__ import annotations

from typing import Any

from cosim.machine.memory import integers_at, load, reals_at, words_at
from cosim.master.attempts import attempt
from cosim.master.crossings import anticipate, forget_all
from cosim.master.rows import operate
from cosim.master.stepping import advance, next_point, perform, strike, time_at
from cosim.master.tables import (
    AGAIN,
    ARRIVED,
    ATTEMPTS,
    BETWEEN,
    BUFFER,
    CAPACITY,
    CONTROL_WORDS,
    ELEMENT,
    END_ROW,
    ENDED,
    ENDED_AT,
    ENDING,
    EVALUATE,
    FILLED,
    FINAL,
    FIRST_ROW,
    GROUP_EVERY,
    GROUP_WORDS,
    GROUPS,
    LAST,
    LEFT,
    N_GROUPS,
    N_PUBLISHED,
    N_PUBLISHED32,
    NON_FINITE,
    OK,
    PROBE_WORDS,
    PROBES,
    PROBES_BEGIN,
    PROBES_END,
    PUBLISH,
    PUBLISHED,
    PUBLISHED32,
    SETTLE,
    STATES,
    STEP_SIZE,
    STEPS,
    STOP,
    TICK,
    TICK_SIZE,
    UPDATE,
    WARNING,
    X,
    copy,
)

LIMIT = 2.0**332
"""From this magnitude on, about 1e100, a value has diverged: no quantity is as large; its fourth power overflows."""
_EXPONENT = 0x7FF0000000000000
_LIMIT = (1023 + 332) << 52  # the exponent of LIMIT
_EXPONENT32 = 0x7F800000


def run(_: float, base: int, control: int) -> int:
    """Go from the communication point TICK to the last one before LAST, in ticks. Returns the status.

    With FINAL, LAST is evaluated and probed too; who goes on from there with ARRIVED does not have that done again.
    It returns early, with OK and TICK < LAST or FINAL still set, where a buffer of probes is full or STOP is set.
    """
    c, numbers = words_at(control, CONTROL_WORDS), reals_at(control, CONTROL_WORDS)
    last = min(c[LAST], full_at(c))
    while c[TICK] < last:
        k = c[TICK]
        if load(control + STOP * 8) != 0:
            return OK
        time = time_at(c, control, k)
        status, c[ARRIVED] = reach(c, base, k, time) if c[ARRIVED] == 0 else OK, 0
        if status > WARNING:
            return status
        if c[ENDING] != 0:
            c[ENDING] = ENDED
            return OK
        following = next_point(c, base, k)
        numbers[STEP_SIZE] = (following - k) * numbers[TICK_SIZE]
        status = perform(c, base, UPDATE, UPDATE, time)
        if status > WARNING:
            return status
        status = attempt(c, base, control, following) if c[ATTEMPTS] != 0 else step(c, base, control, following)
        if status > WARNING:
            return status
        if c[ENDING] == ENDED:
            return OK
        c[STEPS] += 1
        if c[ENDING] == BETWEEN:
            return finish(c, base, numbers[ENDED_AT])
        if not are_finite(c, base, c[X], c[STATES]):
            return NON_FINITE
    if c[FINAL] != 0 and c[TICK] == c[LAST] < full_at(c):
        status = reach(c, base, c[TICK], time_at(c, control, c[TICK]))
        if status > WARNING:
            return status
        c[FINAL] = 0
    return OK


def step(c: Any, base: int, control: int, following: int) -> int:
    """From tick TICK to another. Returns the status."""
    k, numbers = c[TICK], reals_at(control, CONTROL_WORDS)
    size = (following - k) * numbers[TICK_SIZE]
    status = advance(c, base, control, time_at(c, control, k), time_at(c, control, following), size)
    if status <= WARNING:
        c[TICK] = following
    return status


def reach(c: Any, base: int, k: int, time: float) -> int:
    """Be at the communication point k: evaluate what is published there, and probe it. Returns the status."""
    c[LEFT] = 0
    strike(c, base, k)
    status = perform(c, base, PUBLISH, SETTLE, time)
    if status <= WARNING and c[AGAIN] != 0:
        c[AGAIN] = 0
        forget_all(c, base)
        status = perform(c, base, EVALUATE, SETTLE, time)
    if status > WARNING:
        return status
    if not is_sound(c, base):
        return NON_FINITE
    probe(c, base, k, time)
    return OK


def finish(c: Any, base: int, time: float) -> int:
    """The run ends at an event between two communication points: probe all that is published. Returns the status."""
    c[ENDING] = ENDED
    if not is_sound(c, base) or not are_finite(c, base, c[X], c[STATES]):
        return NON_FINITE
    probe(c, base, 0, time)
    return OK


def begin(time: float, base: int, control: int) -> int:
    """The event, if any, of what is published at a time (s), as at a step's begin. Returns the status."""
    return anticipate(words_at(control, CONTROL_WORDS), base, time)


def execute(time: float, base: int, control: int) -> int:
    """Do the rows FIRST_ROW … END_ROW-1 once, as of TICK and a time (s). Returns the status."""
    c = words_at(control, CONTROL_WORDS)
    strike(c, base, c[TICK])
    status = operate(c, base, c[FIRST_ROW], c[END_ROW], time, time)
    if status > WARNING or is_sound(c, base):
        return status
    return NON_FINITE


def full_at(c: Any) -> int:
    """The first tick, from the next one on, at which a group of probes that is due has no room for another row."""
    k = c[TICK]
    full: int = c[LAST] + 1
    for g in range(c[N_GROUPS]):
        group = words_at(c[GROUPS] + g * GROUP_WORDS * 8, GROUP_WORDS)
        every, room = group[GROUP_EVERY], max(0, group[CAPACITY] - group[FILLED])
        due = (k + every - 1) // every + room
        if due <= c[LAST] // every:  # else a product that may overflow is none of our business
            full = min(full, due * every)
    return full


def probe(c: Any, base: int, k: int, time: float) -> None:
    """Copy the probed signals of every group that is due at tick k to its buffer; `full_at` says that it has room.

    All are due at tick 0, and there is room for one row more.
    """
    for g in range(c[N_GROUPS]):
        group = words_at(c[GROUPS] + g * GROUP_WORDS * 8, GROUP_WORDS)
        every = group[GROUP_EVERY]
        if every != 1 and k % every != 0:
            continue
        column, filled, rows = group[BUFFER], group[FILLED], group[CAPACITY] + 1
        reals_at(column + filled * 8, 1)[0] = time
        column += rows * 8
        for p in range(group[PROBES_BEGIN], group[PROBES_END]):
            probed = words_at(c[PROBES] + p * PROBE_WORDS * 8, PROBE_WORDS)
            copy(column + filled * probed[1] * 8, base + probed[0], probed[1])
            column += rows * probed[1] * 8
        group[FILLED] += 1


def is_sound(c: Any, base: int) -> bool:
    """Whether all that is published besides the continuous states is finite; else ELEMENT says what is not."""
    if not are_finite(c, base, c[PUBLISHED], c[N_PUBLISHED]):
        return False
    n = c[N_PUBLISHED32]
    bits = integers_at(base + c[PUBLISHED32], n)
    for j in range(n):
        if (bits[j] & _EXPONENT32) == _EXPONENT32:
            c[ELEMENT] = c[PUBLISHED32] + 4 * j
            return False
    return True


def are_finite(c: Any, base: int, offset: int, n: int) -> bool:
    """Whether n float64 numbers are finite and below LIMIT; else ELEMENT is the offset of the first that is not."""
    bits = words_at(base + offset, n)
    below = -1  # its sign stays as long as every exponent is below that of the limit
    for j in range(n):
        below &= (bits[j] & _EXPONENT) - _LIMIT
    if below < 0:
        return True
    for j in range(n):
        if (bits[j] & _EXPONENT) >= _LIMIT:
            c[ELEMENT] = offset + 8 * j
            return False
    return True

"""The master's loop: walks the rows of a program over an arena, and knows no diagram.

What a step means says `cosim.engine.program`.

One source, two engines: compiled by `cosim.compiling.compiler` it calls kernels by address; as plain Python it calls
the authors' functions (see `cosim.machine.memory`). Nothing here allocates, takes a lock, or returns before the steps
asked for are done, a buffer of probes is full, somebody wants it to stop, a call's status is worse than a warning, or a
published value is not finite. Time is an integer count of steps.

All tables are rows of 64-bit words. `base` is the arena's address, offsets in the tables are bytes from it.
"""

from __future__ import annotations

from typing import Any

from cosim.engine.integration import integrate
from cosim.engine.rows import operate
from cosim.engine.tables import (
    ADVANCE,
    AGAIN,
    BUFFER,
    CAPACITY,
    CONTROL_WORDS,
    ELEMENT,
    END_ROW,
    ENDED,
    ENDING,
    EVALUATE,
    FILLED,
    FINAL,
    FIRST_ROW,
    GROUP_EVERY,
    GROUP_WORDS,
    GROUPS,
    INTEGRATE,
    KIND,
    LAST,
    N_GROUPS,
    N_PUBLISHED,
    N_PUBLISHED32,
    NON_FINITE,
    OK,
    ORIGIN,
    ORIGIN_STEP,
    PHASE,
    PHASE_WORDS,
    PROBE_WORDS,
    PROBES,
    PROBES_BEGIN,
    PROBES_END,
    PUBLISH,
    PUBLISHED,
    PUBLISHED32,
    ROW_BYTES,
    ROW_WORDS,
    ROWS,
    SAMPLE_WORDS,
    SETTLE,
    SOLVE,
    STATES,
    STEP,
    STEP_SIZE,
    STOP,
    UPDATE,
    WARNING,
    A,
    B,
    X,
    copy,
)
from cosim.machine.memory import integers_at, load, reals_at, words_at

LIMIT = 2.0**332
"""From this magnitude on, about 1e100, a value has diverged: no quantity is as large; its fourth power overflows."""
_EXPONENT = 0x7FF0000000000000
_LIMIT = (1023 + 332) << 52  # the exponent of LIMIT
_EXPONENT32 = 0x7F800000


def run(_: float, base: int, control: int) -> int:
    """Do the steps STEP … LAST-1 of the control block. Returns the status.

    It returns early, with OK and STEP < LAST or FINAL still set, where a buffer of probes is full or STOP is set.
    """
    c = words_at(control, CONTROL_WORDS)
    last = min(c[LAST], full_at(c))
    while c[STEP] < last:
        k = c[STEP]
        if load(control + STOP * 8) != 0:
            return OK
        time = time_at(c, control, k)
        status = reach(c, base, k, time)
        if status > WARNING:
            return status
        if c[ENDING] != 0:
            c[ENDING] = ENDED
            return OK
        status = advance(c, base, k, time, time_at(c, control, k + 1), reals_at(control, CONTROL_WORDS)[STEP_SIZE])
        if status > WARNING:
            return status
        c[STEP] = k + 1
        if not are_finite(c, base, c[X], c[STATES]):
            return NON_FINITE
    if c[FINAL] != 0 and c[STEP] == c[LAST] < full_at(c):
        status = reach(c, base, c[STEP], time_at(c, control, c[STEP]))
        if status > WARNING:
            return status
        c[FINAL] = 0
    return OK


def reach(c: Any, base: int, k: int, time: float) -> int:
    """Be at the communication point k: evaluate what is published there, and probe it. Returns the status."""
    status = perform(c, base, PUBLISH, SETTLE, k, time)
    if status <= WARNING and c[AGAIN] != 0:
        c[AGAIN] = 0
        status = perform(c, base, EVALUATE, SETTLE, k, time)
    if status > WARNING:
        return status
    if not is_sound(c, base):
        return NON_FINITE
    probe(c, base, k, time)
    return OK


def time_at(c: Any, control: int, k: int) -> float:
    """The time (s) of step k, from an integer count of steps."""
    numbers = reals_at(control, CONTROL_WORDS)
    time: float = numbers[ORIGIN] + (k - c[ORIGIN_STEP]) * numbers[STEP_SIZE]
    return time


def execute(time: float, base: int, control: int) -> int:
    """Do the rows FIRST_ROW … END_ROW-1 once, as of STEP and a time (s). Returns the status."""
    c = words_at(control, CONTROL_WORDS)
    status = operate(c, base, c[FIRST_ROW], c[END_ROW], c[STEP], time, time)
    if status > WARNING or is_sound(c, base):
        return status
    return NON_FINITE


def perform(c: Any, base: int, first: int, last: int, k: int, time: float) -> int:
    """Do phases that follow each other, as of step k and a time (s). Returns the status."""
    begin = words_at(c[PHASE] + first * PHASE_WORDS * 8, PHASE_WORDS)[0]
    end = words_at(c[PHASE] + last * PHASE_WORDS * 8, PHASE_WORDS)[1]
    return operate(c, base, begin, end, k, time, time)


def advance(c: Any, base: int, k: int, time: float, later: float, step: float) -> int:
    """Go from the communication point k to k+1: UPDATE, and ADVANCE with its integrations. Returns the status."""
    status = perform(c, base, UPDATE, UPDATE, k, time)
    if status > WARNING:
        return status
    phase = words_at(c[PHASE] + ADVANCE * PHASE_WORDS * 8, PHASE_WORDS)
    o = phase[0]
    while o < phase[1]:
        row = words_at(c[ROWS] + o * ROW_BYTES, ROW_WORDS)
        following = row[B] if row[KIND] == SOLVE else 0
        if row[KIND] == INTEGRATE:
            status = integrate(c, base, row[A], k, time, step)
        else:
            status = operate(c, base, o, o + 1 + following, k, time, later)
        if status > WARNING:
            return status
        o += 1 + following
    return OK


def full_at(c: Any) -> int:
    """The first step, from the next one on, at which a group of probes that is due has no room for another row."""
    k = c[STEP]
    full: int = c[LAST] + 1
    for g in range(c[N_GROUPS]):
        group = words_at(c[GROUPS] + g * GROUP_WORDS * 8, GROUP_WORDS)
        every, room = group[GROUP_EVERY], max(0, group[CAPACITY] - group[FILLED])
        due = (k + every - 1) // every + room
        if due <= c[LAST] // every:  # else a product that may overflow is none of our business
            full = min(full, due * every)
    return full


def probe(c: Any, base: int, k: int, time: float) -> None:
    """Copy the probed signals of every group that is due at step k to its buffer; `full_at` says that it has room."""
    for g in range(c[N_GROUPS]):
        group = words_at(c[GROUPS] + g * GROUP_WORDS * 8, GROUP_WORDS)
        every = group[GROUP_EVERY]
        if every != 1 and k % every != 0:
            continue
        row = group[BUFFER] + group[FILLED] * group[SAMPLE_WORDS] * 8
        reals_at(row, 1)[0] = time
        row += 8
        for p in range(group[PROBES_BEGIN], group[PROBES_END]):
            probed = words_at(c[PROBES] + p * PROBE_WORDS * 8, PROBE_WORDS)
            copy(row, base + probed[0], probed[1])
            row += probed[1] * 8
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

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

from cosim.engine.newton import solve
from cosim.engine.tables import (
    ADVANCE,
    AGAIN,
    BANK_WORDS,
    BANKS,
    BEGIN,
    BEGUN,
    BUFFER,
    CAPACITY,
    CLOCK_WORDS,
    CLOCKS,
    CONTROL_WORDS,
    DUE,
    ELEMENT,
    END,
    END_ROW,
    ENDED,
    ENDING,
    EVALUATE,
    FILLED,
    FINAL,
    FIRST_BEGIN,
    FIRST_END,
    FIRST_ROW,
    GRID,
    GROUP_EVERY,
    GROUP_WORDS,
    GROUPS,
    IN_PLACE,
    INNER_BEGIN,
    INNER_END,
    INNER_STEPS,
    INTEGRATE,
    KIND,
    LAST,
    LOOPS,
    N_CLOCKS,
    N_GROUPS,
    N_PUBLISHED,
    N_PUBLISHED32,
    NON_FINITE,
    OFFSET,
    OK,
    ORIGIN,
    ORIGIN_TICK,
    PERIOD,
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
    SLOPES,
    SOLVE,
    STAGES,
    STATES,
    STEP_SIZE,
    STEPS,
    STOP,
    SUM,
    TABLEAU,
    TICK,
    TICK_SIZE,
    UPDATE,
    WARNING,
    A,
    B,
    D,
    W,
    X,
    copy,
    evaluate,
)
from cosim.integrators import HEAD, NODE
from cosim.machine.memory import integers_at, load, reals_at, words_at
from cosim.machine.stages import move

LIMIT = 2.0**332
"""From this magnitude on, about 1e100, a value has diverged: no quantity is as large; its fourth power overflows."""
_EXPONENT = 0x7FF0000000000000
_LIMIT = (1023 + 332) << 52  # the exponent of LIMIT
_EXPONENT32 = 0x7F800000


def run(_: float, base: int, control: int) -> int:
    """Go from the communication point TICK to the last one before LAST, in ticks. Returns the status.

    It returns early, with OK and TICK < LAST or FINAL still set, where a buffer of probes is full or STOP is set.
    """
    c = words_at(control, CONTROL_WORDS)
    last = min(c[LAST], full_at(c))
    while c[TICK] < last:
        k = c[TICK]
        if load(control + STOP * 8) != 0:
            return OK
        time = time_at(c, control, k)
        status = reach(c, base, k, time)
        if status > WARNING:
            return status
        if c[ENDING] != 0:
            c[ENDING] = ENDED
            return OK
        following = next_point(c, base, k)
        numbers = reals_at(control, CONTROL_WORDS)
        numbers[STEP_SIZE] = (following - k) * numbers[TICK_SIZE]
        status = advance(c, base, time, time_at(c, control, following), numbers[STEP_SIZE])
        if status > WARNING:
            return status
        c[TICK] = following
        c[STEPS] += 1
        if not are_finite(c, base, c[X], c[STATES]):
            return NON_FINITE
    if c[FINAL] != 0 and c[TICK] == c[LAST] < full_at(c):
        status = reach(c, base, c[TICK], time_at(c, control, c[TICK]))
        if status > WARNING:
            return status
        c[FINAL] = 0
    return OK


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
    """Note which clocks are due at tick k."""
    for j in range(c[N_CLOCKS]):
        clock = words_at(base + c[CLOCKS] + j * CLOCK_WORDS * 8, CLOCK_WORDS)
        since = k - clock[OFFSET]
        clock[DUE] = 1 if since >= 0 and since % clock[PERIOD] == 0 else 0


def reach(c: Any, base: int, k: int, time: float) -> int:
    """Be at the communication point k: evaluate what is published there, and probe it. Returns the status."""
    strike(c, base, k)
    status = perform(c, base, PUBLISH, SETTLE, time)
    if status <= WARNING and c[AGAIN] != 0:
        c[AGAIN] = 0
        status = perform(c, base, EVALUATE, SETTLE, time)
    if status > WARNING:
        return status
    if not is_sound(c, base):
        return NON_FINITE
    probe(c, base, k, time)
    return OK


def time_at(c: Any, control: int, k: int) -> float:
    """The time (s) of tick k, from an integer count."""
    numbers = reals_at(control, CONTROL_WORDS)
    time: float = numbers[ORIGIN] + (k - c[ORIGIN_TICK]) * numbers[TICK_SIZE]
    return time


def execute(time: float, base: int, control: int) -> int:
    """Do the rows FIRST_ROW … END_ROW-1 once, as of TICK and a time (s). Returns the status."""
    c = words_at(control, CONTROL_WORDS)
    strike(c, base, c[TICK])
    status = operate(c, base, c[FIRST_ROW], c[END_ROW], time, time)
    if status > WARNING or is_sound(c, base):
        return status
    return NON_FINITE


def perform(c: Any, base: int, first: int, last: int, time: float) -> int:
    """Do phases that follow each other, as of a time (s). Returns the status."""
    begin = words_at(c[PHASE] + first * PHASE_WORDS * 8, PHASE_WORDS)[0]
    end = words_at(c[PHASE] + last * PHASE_WORDS * 8, PHASE_WORDS)[1]
    return operate(c, base, begin, end, time, time)


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


def advance(c: Any, base: int, time: float, later: float, step: float) -> int:
    """Go from a communication point to the next: UPDATE, and ADVANCE with its integrations. Returns the status."""
    status = perform(c, base, UPDATE, UPDATE, time)
    if status > WARNING:
        return status
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


def integrate(c: Any, base: int, bank: int, begun: float, step: float) -> int:
    """Integrate one bank over one communication step with its own integrator and number of inner steps."""
    b = words_at(c[BANKS] + bank * BANK_WORDS * 8, BANK_WORDS)
    inner_steps = b[INNER_STEPS]
    x = part(c, base, b, X)
    w = x if b[IN_PLACE] != 0 else part(c, base, b, W)
    d = part(c, base, b, D)
    h = step / inner_steps
    for s in range(inner_steps):
        time = begun + s * h
        if s == 0:
            status = operate(c, base, b[FIRST_BEGIN], b[FIRST_END], time, time)
        else:
            status = operate(c, base, b[INNER_BEGIN], b[INNER_END], time, time)
        if status > WARNING:
            return status
        if b[STAGES] > 1:
            status = finish(c, base, b, x if s == 0 else w, w, d, time, h)
            if status > WARNING:
                return status
        elif s > 0 or b[IN_PLACE] != 0:
            for j in range(w.size):  # vectorised where the loop below would find that its arrays overlap
                w[j] += h * d[j]
        else:
            for j in range(w.size):
                w[j] = x[j] + h * d[j]
    return OK


def finish(c: Any, base: int, b: Any, origin: Any, w: Any, d: Any, time: float, h: float) -> int:
    """End the inner step of several stages, of which the first one's derivatives are in `d` already."""
    stages, stride = b[STAGES], c[STATES] * 8
    begun, total = part(c, base, b, BEGUN), part(c, base, b, SUM)
    slopes = base + c[SLOPES] + b[BEGIN] * 8
    for j in range(w.size):
        begun[j] = origin[j]
    for stage in range(stages):
        row = reals_at(base + b[TABLEAU] + stage * (HEAD + stages) * 8, HEAD + stages)
        slope = reals_at(slopes + stage * stride, w.size)
        for j in range(w.size):
            slope[j] = d[j]
        move(w, begun, h, row, slopes, stride, total)
        if stage < stages - 1:
            now = time + row[NODE] * h
            status = operate(c, base, b[INNER_BEGIN], b[INNER_END], now, now)
            if status > WARNING:
                return status
    return OK


def part(c: Any, base: int, b: Any, vector: int) -> Any:
    """A bank's part of one of the vectors X, W, BEGUN, SUM, D."""
    return reals_at(base + c[vector] + b[BEGIN] * 8, b[END] - b[BEGIN])


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
    """Copy the probed signals of every group that is due at tick k to its buffer; `full_at` says that it has room."""
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

"""A step that may be judged and done anew: repeated with inputs that are known at its end, shortened, or cut by events.

    save
    repeat
        advance by n ticks, or to the next time event, with inputs as their histories extrapolate them
        if a foreign block has stopped before: restore all, and anew to there
        evaluate at the end: what blocks then give differs by ε from what was extrapolated
        if ε is too large, and n not the smallest: restore all, take fewer ticks, and anew
    as often as the step is to be repeated
        histories take what blocks give at the end, restore the rest, and advance again, with inputs interpolated
    where an indicator has crossed zero: restore, and advance to there, see `crossings`
    at an event: have it happen, and all this anew for what is left of the step
    the next step: as long as ε promises

ε is relative to the largest value that a wire has brought so far. What sampled blocks give does not change in a step.
One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.machine.memory import power, reals_at, words_at
from cosim.master.crossings import ROUNDING, anticipate, cross, happen, has_crossed, linger
from cosim.master.histories import measure, misfit, order_of
from cosim.master.stepping import advance, hush, perform, restore, save, time_at
from cosim.master.tables import (
    BETWEEN,
    COARSE,
    CONTROL_WORDS,
    DIVISIBLE,
    EARLY,
    ENDED,
    ENDED_AT,
    ENDED_BY,
    ENDING,
    EVALUATE,
    EVENTFUL,
    FATAL,
    HAPPENED,
    HISTORIES,
    INDIVISIBLE,
    KEEP,
    LONGEST,
    N_HISTORIES,
    N_INDICATORS,
    N_JUDGED,
    NEXT_EVENT,
    OK,
    PROPOSED,
    REJECT,
    REPEAT,
    REPEATS,
    RESTLESS,
    ROLLBACK,
    SHORTEST,
    STARTS,
    TICK,
    TICK_SIZE,
    TIMES,
    TOLERANCE,
    UNDONE,
    WARNING,
)

SAFETY = 0.9
LEAST, MOST = 0.2, 5.0  # by how much the next step may be shorter or longer than the last
CAUTIOUS = 1.2  # the same where no step is done anew, so that one that is too long is little so
MOST_EVENTS = 100_000  # in one step
NEAR = 1e-9  # of a step: as near as that to its end, a time event is at its end


def attempt(c: Any, base: int, control: int, bound: int) -> int:
    """From tick TICK to a later one, no later than `bound`, through all events between. Returns the status.

    Where an event ends the run, ENDING is BETWEEN and ENDED_AT its time.
    """
    k, numbers = c[TICK], reals_at(control, CONTROL_WORDS)
    begun, n = time_at(c, control, k), bound - k
    if numbers[TOLERANCE] > 0.0:
        n = share(c, n)
    status = anticipate(c, base, begun) if c[N_INDICATORS] != 0 else OK
    if c[ENDED_BY] != 0:
        c[ENDING] = ENDED
        return status
    for _ in range(MOST_EVENTS):
        if status <= WARNING and c[N_INDICATORS] != 0 and c[HAPPENED] != 0:
            status = linger(c, base, control, begun, time_at(c, control, k + n))
        n, reached, status = stretch(c, base, control, status, begun, n)
        if status <= WARNING and c[N_INDICATORS] != 0:
            reached = cross(c, base, control, begun, reached)
            status = OK if reached >= 0.0 else -int(reached)
        if status > WARNING:
            return status
        end = time_at(c, control, k + n)
        if reached < end or (c[N_INDICATORS] != 0 and has_crossed(c, base)):
            status = happen(c, base, reached)
        if status > WARNING:
            return status
        if end - reached <= ROUNDING * (abs(end) + end - begun):
            c[TICK] = k + n
            return status
        if c[ENDING] != 0:
            c[TICK], c[ENDING], numbers[ENDED_AT] = k + n, BETWEEN, reached
            return status
        begun = reached
    return RESTLESS


def stretch(c: Any, base: int, control: int, status: int, begun: float, n: int) -> tuple[int, float, int]:
    """From a time (s) to the end of n ticks after TICK, fewer if that is too far, or to a time event before.

    Returns how many ticks, the time reached, and the status, which is at first that of what came before.
    """
    k, numbers, limit = c[TICK], reals_at(control, CONTROL_WORDS), math.inf
    reached, size = begun, 0.0
    if status <= WARNING:
        status = save(c, base, begun)
    while status <= WARNING:
        first, end = begun == time_at(c, control, k), time_at(c, control, k + n)
        reached = min(limit, ahead(c, base, control, begun, end) if c[EVENTFUL] != 0 else end)
        if reached < end and c[DIVISIBLE] == 0:
            return n, reached, INDIVISIBLE
        size = n * numbers[TICK_SIZE] if first and reached == end else reached - begun
        status = advance(c, base, control, begun, reached, size)
        if numbers[EARLY] < reached and status <= WARNING:
            limit = numbers[EARLY]
            status = restore(c, base, REJECT, begun)
            continue
        part = max(1, math.ceil((reached - begun) / numbers[TICK_SIZE])) if reached < end or not first else n
        factor = judge(c, base, numbers[TOLERANCE], status, reached)
        if factor >= 1.0 or part <= 1 or c[ROLLBACK] == 0 or status == FATAL:
            settle(c, base, part, factor)
            break
        c[UNDONE] += 1
        n = least(c, control, begun) + max(1, int(part * max(LEAST, SAFETY * factor))) - 1
        status = restore(c, base, REJECT, begun)
    if status <= WARNING:
        status = repeat(c, base, control, begun, reached, size)
    return n, reached, status


def share(c: Any, left: int) -> int:
    """How many ticks to take of those that are left before a point that has to be hit: one of equal parts."""
    parts = (left + c[PROPOSED] - 1) // c[PROPOSED]
    n: int = (left + parts - 1) // parts
    return n


def least(c: Any, control: int, begun: float) -> int:
    """The fewest ticks after TICK that lead beyond a time (s)."""
    return int((begun - time_at(c, control, c[TICK])) / reals_at(control, CONTROL_WORDS)[TICK_SIZE]) + 1


def ahead(c: Any, base: int, control: int, begun: float, end: float) -> float:
    """The time (s) of the next time event of a foreign block before an end, or the end."""
    numbers = reals_at(control, CONTROL_WORDS)
    numbers[NEXT_EVENT] = math.inf
    perform(c, base, TIMES, TIMES, begun)
    near: float = NEAR * (end - begun)
    following: float = numbers[NEXT_EVENT]
    return max(following, begun) if following < end - near else end


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
    for j in range(c[N_JUDGED]):
        history = words_at(base + c[HISTORIES] + j * 8, 1)[0]
        error = misfit(base, history, later) / tolerance
        if error > 0.0:
            factor = min(factor, power(1.0 / error, 1.0 / (order_of(base, history) + 1)))
    return factor


def settle(c: Any, base: int, n: int, factor: float) -> None:
    """A step over n ticks is done; say how long the next one may be."""
    c[COARSE] += 1 if factor < 1.0 else 0
    c[SHORTEST] = n if c[SHORTEST] == 0 else min(c[SHORTEST], n)
    c[LONGEST] = max(c[LONGEST], n)
    most = MOST if c[ROLLBACK] != 0 else CAUTIOUS
    c[PROPOSED] = max(1, math.ceil(n * min(most, max(LEAST, SAFETY * factor))))
    for j in range(c[N_JUDGED]):
        measure(base, words_at(base + c[HISTORIES] + j * 8, 1)[0])


def repeat(c: Any, base: int, control: int, time: float, later: float, step: float) -> int:
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
            status = restore(c, base, REPEAT, time)
        if status <= WARNING:
            status = advance(c, base, control, time, later, step)
        if status > WARNING:
            return status
    return OK

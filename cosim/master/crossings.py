"""Events of blocks: indicators that cross zero inside a step, and what happens where they do.

    cross       look at the indicators at the end of a step; where one has crossed since it was looked at last, find the
                crossing: from the step's begin, again and again, to a time between the last before and the first after
    happen      blocks reset their states, all by what there was; then FMUs have their events, by what there is now;
                as long as an indicator has crossed by that, once more
    linger      look at the indicators a moment later; the step goes on from the event

The last time before and the first after a crossing are found by the Illinois method, to within rounding of the time.
The event is at the latter, where what is reset may lie a rounding error beyond zero and on its way back: hence the
moment, in which a crossing back that is none of those that count may be followed by one that does. No other sign is
taken from it, as others may cross in it. An indicator that is zero has the sign that it had; at first, that from which
it may cross so that it counts. One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

import math
import sys
from typing import Any

from cosim.machine.memory import reals_at, words_at
from cosim.master.histories import forget
from cosim.master.stepping import advance, hush, perform, restore, save
from cosim.master.tables import (
    AGAIN,
    CLOCK_WORDS,
    CLOCKS,
    CROSSED,
    DIRECTION,
    DUE,
    ELEMENT,
    END_INDICATOR,
    ENDED_BY,
    ENDING,
    EVALUATE,
    EVENT,
    EVENTS,
    FIRST_INDICATOR,
    HAPPENED,
    HIGH,
    HISTORIES,
    INDICATORS,
    KEEP,
    LEFT,
    LOOKED,
    N_HISTORIES,
    N_INDICATORS,
    N_WATCHED,
    NON_FINITE,
    REJECT,
    REPEAT,
    RESTLESS,
    RETAIN,
    REVIVE,
    SETTLE,
    TERMINAL,
    WANTED,
    WARNING,
    WAS,
    WATCHED,
    WATCHED_WORDS,
    Z,
)

ROUNDING = 2.0**-44  # of the time and the step: how near a crossing is found
MOMENT = 2.0**-20  # of what is left of a step: when the sign of what an event has reset is looked at
BESIDE = sys.float_info.min  # an indicator that is zero, for the sign that it had
MOST_TRIALS = 200
BISECTED = 60  # trials from which the interval is halved
MOST_ROUNDS = 1000  # of an event that causes another at the same time


def look(c: Any, base: int, time: float) -> int:
    """Evaluate the indicators as of what is published. Returns the status."""
    status = perform(c, base, INDICATORS, INDICATORS, time)
    z = reals_at(base + c[Z], c[N_INDICATORS])
    for j in range(z.size):
        if z[j] != z[j] and status <= WARNING:
            c[ELEMENT] = c[Z] + 8 * j
            return NON_FINITE
    return status


def anticipate(c: Any, base: int, time: float) -> int:
    """Look at the indicators at a step's begin: what sampled blocks have set may be an event. Returns the status."""
    status = look(c, base, time)
    if status <= WARNING and c[LOOKED] != 0 and has_crossed(c, base):
        return happen(c, base, time)
    c[LOOKED] = 1
    note(c, base, WAS)
    return status


def cross(c: Any, base: int, control: int, begun: float, reached: float) -> float:
    """Look at the indicators at a time (s) that is reached, and go back to the first crossing since another, if any.

    Returns the time that is reached then, at which an indicator has crossed or none has; or minus the status.
    """
    status = arrive(c, base, reached)
    if status > WARNING:
        return -float(status)
    if has_crossed(c, base):
        note(c, base, HIGH)
        return locate(c, base, control, begun, reached)
    note(c, base, WAS)
    return reached


def linger(c: Any, base: int, control: int, event: float, end: float) -> int:
    """Look at the indicators a moment after an event, which of them have crossed back. Returns the status.

    The moment is one also where little is left of the step: FMUs take no step of no length.
    """
    c[HAPPENED] = 0
    status = save(c, base, event)
    if status <= WARNING:
        status = retry(c, base, control, event, event + max((end - event) * MOMENT, ROUNDING * abs(end)))
    n = c[N_INDICATORS]
    z, was, wanted = reals_at(base + c[Z], n), reals_at(base + c[WAS], n), reals_at(base + c[WANTED], n)
    for j in range(n):
        if z[j] * wanted[j] < 0.0:
            was[j] = z[j]
    return restore(c, base, REJECT, event) if status <= WARNING else status


def arrive(c: Any, base: int, time: float) -> int:
    """Evaluate what is published, and the indicators, where the states have got to. Returns the status."""
    hush(c, base)
    status = perform(c, base, EVALUATE, EVALUATE, time)
    return look(c, base, time) if status <= WARNING else status


def locate(c: Any, base: int, control: int, begun: float, end: float) -> float:
    """The time (s) of the first crossing after a time whose state is saved, which is then reached.

    Returns minus the status where that cannot be.
    """
    low, high, reached, side, before, beyond = begun, end, True, 0, 1.0, 1.0
    nearness = ROUNDING * (abs(end) + end - begun)
    perform(c, base, RETAIN, RETAIN, end)
    for trial in range(MOST_TRIALS):
        if high - low <= nearness:
            break
        part = share(c, base, before, beyond) if trial < BISECTED else 0.5
        least = min(0.5, 0.5 * nearness / (high - low))
        time = low + (high - low) * min(max(part, least), 1.0 - least)
        perform(c, base, REVIVE, REVIVE, end)
        status = retry(c, base, control, begun, time)
        if status > WARNING:
            return -float(status)
        if has_crossed(c, base):
            note(c, base, HIGH)
            high, reached = time, True
            before, beyond = (0.5 * before if side == 1 else 1.0), 1.0
            side = 1
        else:
            note(c, base, WAS)
            low, reached = time, False
            before, beyond = 1.0, (0.5 * beyond if side == -1 else 1.0)
            side = -1
    if not reached:
        perform(c, base, REVIVE, REVIVE, end)
        status = retry(c, base, control, begun, high)
        if status > WARNING:
            return -float(status)
    return high


def retry(c: Any, base: int, control: int, begun: float, time: float) -> int:
    """Go once more from the time whose state is saved to another (s). Returns the status."""
    status = restore(c, base, REPEAT, begun)
    if status <= WARNING:
        status = advance(c, base, control, begun, time, time - begun)
    return arrive(c, base, time) if status <= WARNING else status


def share(c: Any, base: int, before: float, beyond: float) -> float:
    """Where between the last time before and the first after the first crossing may be, by straight lines."""
    n, part = c[N_INDICATORS], 1.0
    was, high, wanted = reals_at(base + c[WAS], n), reals_at(base + c[HIGH], n), reals_at(base + c[WANTED], n)
    for j in range(n):
        if crosses(was[j], high[j], wanted[j]) != 0.0:
            here, there = before * abs(was[j]), beyond * abs(high[j])
            if here + there > 0.0:
                part = min(part, here / (here + there))
    return part


def happen(c: Any, base: int, time: float) -> int:
    """The event at a time (s) at which indicators have crossed, and those that it causes. Returns the status."""
    c[LEFT], c[HAPPENED] = 0, 1
    for _ in range(MOST_ROUNDS):
        hush(c, base)
        strike_crossed(c, base)
        status = perform(c, base, EVENT, EVENT, time)
        if status <= WARNING:
            status = perform(c, base, EVENTS, SETTLE, time)
        if status <= WARNING and c[AGAIN] != 0:
            c[AGAIN] = 0
            status = perform(c, base, EVALUATE, SETTLE, time)
        note(c, base, WAS)
        if status <= WARNING:
            status = look(c, base, time)
        if status > WARNING:
            return status
        if not has_crossed(c, base):
            note(c, base, WAS)
            hush(c, base)
            forget_all(c, base)
            return perform(c, base, KEEP, KEEP, time)
    return RESTLESS


def forget_all(c: Any, base: int) -> None:
    """Begin all histories anew, as what wires bring may have jumped."""
    for j in range(c[N_HISTORIES]):
        forget(base, words_at(base + c[HISTORIES] + j * 8, 1)[0])


def strike_crossed(c: Any, base: int) -> None:
    """Say how each indicator has crossed, and have the blocks be due of which one has; one may end the run."""
    n = c[N_INDICATORS]
    z, was = reals_at(base + c[Z], n), reals_at(base + c[WAS], n)
    direction, wanted = reals_at(base + c[DIRECTION], n), reals_at(base + c[WANTED], n)
    terminal = reals_at(base + c[TERMINAL], n)
    for j in range(n):
        direction[j] = crosses(was[j], z[j], wanted[j])
        if direction[j] != 0.0 and terminal[j] != 0.0 and c[ENDED_BY] == 0:
            c[ENDED_BY], c[ENDING] = j + 1, 1
    for i in range(c[N_WATCHED]):
        watched = words_at(base + c[WATCHED] + i * WATCHED_WORDS * 8, WATCHED_WORDS)
        due = 0
        for j in range(watched[FIRST_INDICATOR], watched[END_INDICATOR]):
            if direction[j] != 0.0:
                due = 1
        words_at(base + c[CLOCKS] + (watched[CROSSED] - 1) * CLOCK_WORDS * 8, CLOCK_WORDS)[DUE] = due


def has_crossed(c: Any, base: int) -> bool:
    """Whether an indicator has crossed zero since it was looked at last."""
    n = c[N_INDICATORS]
    z, was, wanted = reals_at(base + c[Z], n), reals_at(base + c[WAS], n), reals_at(base + c[WANTED], n)
    crossed = False
    for j in range(n):
        crossed = crossed or crosses(was[j], z[j], wanted[j]) != 0.0
    return crossed


def crosses(was: float, z: float, wanted: float) -> float:
    """How an indicator crosses zero: 1 to above zero, -1 from above zero, 0 not, or not so that it counts."""
    direction = 1.0 if was < 0.0 < z else -1.0 if z < 0.0 < was else 0.0
    return direction if wanted in (0.0, direction) else 0.0


def note(c: Any, base: int, vector: int) -> None:
    """Keep the indicators as they are; one that is zero is next to it on the side where it was, or whence it counts."""
    n = c[N_INDICATORS]
    z, kept, wanted = reals_at(base + c[Z], n), reals_at(base + c[vector], n), reals_at(base + c[WANTED], n)
    for j in range(n):
        if z[j] != 0.0:
            kept[j] = z[j]
        elif kept[j] != 0.0:
            kept[j] = math.copysign(BESIDE, kept[j])
        else:
            kept[j] = -wanted[j] * BESIDE

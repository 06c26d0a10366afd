"""Model Exchange: the FMU has states and events, the loop has the integrators.

An FMU's clock never passes its next time event: the loop ends a step there. An event at a communication point, or at
the end of such a step, sees the inputs of that point. So the FMU is in Event Mode while all outputs are evaluated
there; then it handles the event, all outputs are evaluated once more, and it leaves Event Mode.

A function here returns whether it failed; the link then says where.
"""

from __future__ import annotations

from typing import Any

from cosim.fmu.event_mode import (
    communication_step,
    enter_event_mode,
    go_into_event_mode,
    leave_event_mode,
    reals_of,
    settle,
)
from cosim.fmu.fields import (
    AGAIN,
    BUFFER,
    CHANGED,
    CLOCK,
    COMPLETED_STEP,
    CROWDED,
    DERIVATIVE_MAP,
    DISCRETE,
    ENDS,
    EVENT,
    EVENT_DUE,
    GET_DERIVATIVES,
    GET_INDICATORS,
    GET_STATES,
    HANDLE,
    HANDLED,
    INDICATOR_VALUES,
    INDICATORS,
    INPUTS,
    MODE,
    MOST_EVENTS,
    N_INPUTS,
    NEXT,
    NEXT_DEFINED,
    REACHED,
    ROUNDING,
    ROW_WORDS,
    SET_STATES,
    SET_TIME,
    SIGNS,
    STATE_MAP,
    STATES,
    TERMINATED,
)
from cosim.fmu.transfer import bad, give_up, has_changed, set_inputs, set_row
from cosim.machine.memory import integers_at, reals_at, words_at

# ---- what the loop asks for ----


def prepare(time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Set time, states and inputs. Discrete inputs may be set in Event Mode only, and only if they have changed.

    Where a communication point lies ahead with a time event at this very time, they wait for it.
    """
    if r[ENDS] != 0:
        return False
    if r[MODE] == EVENT:
        return set_inputs(base, link, plan, f, r, k)
    if set_time_and_states(time, base, link, plan, f, r, info, k):
        return True
    changed = False
    for i in range(plan[N_INPUTS]):
        address = plan[INPUTS] + i * ROW_WORDS * 8
        row = words_at(address, ROW_WORDS)
        if row[DISCRETE] != 0:
            changed |= has_changed(base, row, f, k)
        elif set_row(base, link, address, f, r, k):
            return True
    if not changed or has_event_before(r, info, time + ROUNDING * communication_step(f)):
        return False
    r[EVENT_DUE] = 0
    if enter_event_mode(link, r, info) or set_inputs(base, link, plan, f, r, k):
        return True
    return finish_event(base, link, plan, f, r, info, k)


def differentiate(time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """The derivatives of a stage of the integration to the arena."""
    if prepare(time, base, link, plan, f, r, info, k):
        return True
    if r[ENDS] != 0:
        return give_up(link, TERMINATED, 0)
    if bad(link, link[GET_DERIVATIVES], (r[HANDLE], link[BUFFER], link[STATES])):
        return True
    scatter(base, link, plan[DERIVATIVE_MAP], f, k, link[BUFFER])
    return False


def begin_events(time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Look for what a communication point finds: the FMU's own wish, indicators' signs, time events."""
    numbers = reals_of(info)
    if r[ENDS] != 0 or not time > numbers[REACHED]:
        return False
    numbers[REACHED] = time
    if set_time_and_states(time, base, link, plan, f, r, info, k) or complete_step(link, r, info):
        return True
    if r[ENDS] != 0:
        return False
    if watch_indicators(link, r):
        return True
    if is_due(time, f, r, info):
        return tell_event(link, r, info)
    return r[EVENT_DUE] != 0 and go_into_event_mode(link, r)


def end_events(time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Handle the event of a communication point with all inputs of that point, or leave Event Mode if that is done."""
    if r[ENDS] != 0 or r[MODE] != EVENT:
        return False
    if set_inputs(base, link, plan, f, r, k):
        return True
    if r[EVENT_DUE] == 0:
        return finish_event(base, link, plan, f, r, info, k)
    words_at(link[AGAIN], 1)[0] = 1
    for _ in range(MOST_EVENTS):
        due = reals_of(info)[NEXT]
        if settle(link, r, info):
            return True
        if r[ENDS] != 0 or not (reals_of(info)[NEXT] > due and is_due(time, f, r, info)):
            return r[CHANGED] != 0 and pull_states(base, link, plan, f, r, k)
        if leave_event_mode(link, r) or tell_event(link, r, info):
            return True
    return give_up(link, CROWDED, 0)


def is_due(time: float, f: Any, r: Any, info: int) -> bool:
    """Whether a communication point has reached the next time event, up to what rounding does to a time."""
    due: bool = r[NEXT_DEFINED] != 0 and reals_of(info)[NEXT] <= time + ROUNDING * communication_step(f)
    return due


def tell_event(link: Any, r: Any, info: int) -> bool:
    """Go into Event Mode at the next time event, which may come a rounding error after the communication point."""
    numbers = reals_of(info)
    if numbers[NEXT] > numbers[CLOCK] and tell_time(numbers[NEXT], link, r, info):
        return True
    r[EVENT_DUE] = 1
    return go_into_event_mode(link, r)


# ---- time ----


def tell_time(time: float, link: Any, r: Any, info: int) -> bool:
    """Set the FMU's clock, as it is."""
    reals_of(info)[CLOCK] = time
    return bad(link, link[SET_TIME], (r[HANDLE], time))


def set_time(time: float, link: Any, r: Any, info: int) -> bool:
    """Set the FMU's clock, but not past its next time event, nor back before the last one."""
    numbers = reals_of(info)
    time = max(time, numbers[HANDLED])
    return tell_time(numbers[NEXT] if has_event_before(r, info, time) else time, link, r, info)


def has_event_before(r: Any, info: int, time: float) -> bool:
    """Whether the next time event comes before a time (s). One that does not lie ahead of the last event is none."""
    numbers = reals_of(info)
    before: bool = r[NEXT_DEFINED] != 0 and numbers[HANDLED] < numbers[NEXT] < time
    return before


# ---- states ----


def set_time_and_states(time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Set the time and the continuous states that the call reads."""
    n = link[STATES]
    if n == 0:
        return set_time(time, link, r, info)
    gather(base, link, plan[STATE_MAP], f, k)
    return set_time(time, link, r, info) or bad(link, link[SET_STATES], (r[HANDLE], link[BUFFER], n))


def gather(base: int, link: Any, table: int, f: Any, k: int) -> None:
    """The states of instance k, from the arena to the buffer."""
    n = link[STATES]
    places, buffer = words_at(table, 2 * n), words_at(link[BUFFER], n)
    for j in range(n):
        slot = places[2 * j]
        buffer[j] = words_at(base + f[slot] + k * f[slot + 1] + 8 * places[2 * j + 1], 1)[0]


def scatter(base: int, link: Any, table: int, f: Any, k: int, source: int) -> None:
    """States or derivatives of instance k, from an address to the arena."""
    n = link[STATES]
    places, values = words_at(table, 2 * n), words_at(source, n)
    for j in range(n):
        slot = places[2 * j]
        words_at(base + f[slot] + k * f[slot + 1] + 8 * places[2 * j + 1], 1)[0] = values[j]


def pull_states(base: int, link: Any, plan: Any, f: Any, r: Any, k: int) -> bool:
    """The FMU's states to the arena."""
    r[CHANGED] = 0
    n = link[STATES]
    if n == 0:
        return False
    if bad(link, link[GET_STATES], (r[HANDLE], link[BUFFER], n)):
        return True
    scatter(base, link, plan[STATE_MAP], f, k, link[BUFFER])
    return False


# ---- events ----


def complete_step(link: Any, r: Any, info: int) -> bool:
    """Tell an FMU that wants to know that the integration has come this far; EVENT_DUE if it wants an event."""
    r[EVENT_DUE] = 0
    if link[COMPLETED_STEP] == 0:
        return False
    flags = integers_at(info, 2)
    flags[0] = flags[1] = 0
    if bad(link, link[COMPLETED_STEP], (r[HANDLE], 1, info, info + 4)):
        return True
    r[ENDS], r[EVENT_DUE] = flags[1], flags[0]
    return False


def watch_indicators(link: Any, r: Any) -> bool:
    """Get the event indicators; EVENT_DUE if one has changed its sign since they were got last."""
    n = link[INDICATORS]
    if n == 0:
        return False
    if bad(link, link[GET_INDICATORS], (r[HANDLE], link[SIGNS], n)):
        return True
    new, old = reals_at(link[SIGNS], n), reals_at(r[INDICATOR_VALUES], n)
    for j in range(n):
        if (new[j] > 0.0) != (old[j] > 0.0):
            r[EVENT_DUE] = 1
        old[j] = new[j]
    return False


def finish_event(base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Event iteration, and back to Continuous-Time Mode with the states that the event has set."""
    if settle(link, r, info):
        return True
    if r[ENDS] != 0:
        return r[CHANGED] != 0 and pull_states(base, link, plan, f, r, k)
    if leave_event_mode(link, r):
        return True
    if r[CHANGED] != 0 and pull_states(base, link, plan, f, r, k):
        return True
    if watch_indicators(link, r):
        return True
    r[EVENT_DUE] = 0
    return False

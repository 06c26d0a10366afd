"""The kernel that stands between the loop and an FMU: set inputs, step, get outputs, handle events.

Generic: one compiled function serves every FMU of either FMI version, because all that differs is data, laid out as
`cosim.fmu.layout` says. Like `cosim.engine`, this is one source for both engines, and nothing here allocates or returns
to Python.

The calls keep to the state machines of FMI 2.0.5 (sections 3.2.3 and 4.2.4) and FMI 3.0.2 (sections 2.3, 3.2, 4.2):

===============  ========================================================================================
FMI 2 and plain  outputs are got at a communication point, inputs are set just before `doStep`: an output
Co-Simulation    never shows an input that was set after the last step
FMI 3 with       each communication point is an event: inputs are set and outputs got in Event Mode
event mode
Model Exchange   time, states and inputs are set, outputs and derivatives are got in Continuous-Time Mode;
                 events that a step has passed are handled at its end, discrete inputs where they change
===============  ========================================================================================
"""

from __future__ import annotations

from typing import Any

from cosim.fmu.layout import (
    ADVANCE,
    BUFFER,
    BYTES,
    CHANGED,
    CO_SIMULATION,
    COMPLETED_STEP,
    COUNT,
    DERIVATIVE_MAP,
    DIFFERENTIATE,
    DISCARD,
    DO_STEP,
    ENDLESS,
    ENTER_EVENT_MODE,
    EVALUATE,
    EVENT,
    EVENT_CO_SIMULATION,
    EVENT_DUE,
    EXCHANGE,
    EXIT_INITIALIZATION,
    FATAL,
    FIRST,
    FRAME_WORDS,
    GET,
    GET_DERIVATIVES,
    GET_INDICATORS,
    GET_STATES,
    HANDLE,
    HANDLE_EVENTS,
    INDICATOR_VALUES,
    INDICATORS,
    INFO,
    INFO_REAL,
    INITIAL,
    INPUTS,
    INSTANCE,
    KIND,
    LEAVE_EVENT_MODE,
    LINK,
    LINK_WORDS,
    MODE,
    MOST_ITERATIONS,
    N_INPUTS,
    NEXT,
    NEXT_DEFINED,
    NO_PROGRESS,
    OK,
    PLAN,
    PLAN_WORDS,
    RECORD_WORDS,
    RECORDS,
    ROW_WORDS,
    RUNNING,
    SET_STATES,
    SET_TIME,
    SETTLES,
    SHADOW,
    SIGNS,
    SLOT,
    STATE_MAP,
    STATES,
    STATUS,
    STEP,
    STEPPED,
    TASK,
    TERMINATED,
    UPDATE_DISCRETE_STATES,
    VERSION,
    WARNING,
    WARNINGS,
)
from cosim.fmu.values import bad, differs, get_outputs, give_up, set_inputs, set_value
from cosim.memory import integers_at, reals_at, words_at


def adapt(time: float, base: int, frame: int) -> int:
    """The kernel: do what the plan says for every instance, up to the first that fails. Returns the status.

    ==============  ====================================================================================
    INITIAL         in Initialization Mode: set inputs, get outputs
    BEGIN           leave Initialization Mode; Model Exchange: the states go to the state vector
    GET             plain Co-Simulation, at a communication point: get outputs
    EXCHANGE        Co-Simulation with event mode, at a communication point: set inputs, get outputs
    ADVANCE         Co-Simulation: set inputs and do a step from `time`
    EVALUATE        Model Exchange: outputs from time, states and inputs
    DIFFERENTIATE   Model Exchange: derivatives from time, states and inputs
    HANDLE_EVENTS   Model Exchange: handle the events of the step that ends now; they may change states
    ==============  ====================================================================================
    """
    link = words_at(words_at(frame, FIRST)[LINK], LINK_WORDS)
    plan = words_at(words_at(frame, FIRST)[PLAN], PLAN_WORDS)
    f = words_at(frame, plan[FRAME_WORDS])
    warnings = link[WARNINGS]
    for k in range(f[COUNT]):
        address = link[RECORDS] + k * RECORD_WORDS * 8
        r = words_at(address, RECORD_WORDS)
        if failed(plan[TASK], time, base, link, plan, f, r, address + INFO * 8, k):
            link[INSTANCE] = k
            return min(max(link[STATUS], DISCARD), FATAL)
    return WARNING if link[WARNINGS] > warnings else OK


def failed(task: int, time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Do a task for instance k. Returns whether it failed; the link then says where, as in all below."""
    if task == GET:
        return get_outputs(base, link, plan, f, r, k)
    if task == ADVANCE:
        return do_step(time, base, link, plan, f, r, info, k)
    if task in (EVALUATE, DIFFERENTIATE):
        if prepare(time, base, link, plan, f, r, info, k):
            return True
        if task == EVALUATE:
            return get_outputs(base, link, plan, f, r, k)
        return get_derivatives(base, link, plan, f, r, k)
    if task == HANDLE_EVENTS:
        return events(time, base, link, plan, f, r, info, k)
    if task == EXCHANGE:
        if enter_event_mode(link, r, info) or set_inputs(base, link, plan, f, r, k):
            return True
        return (plan[SETTLES] != 0 and settle(link, r, info)) or get_outputs(base, link, plan, f, r, k)
    if task == INITIAL:
        return set_inputs(base, link, plan, f, r, k) or get_outputs(base, link, plan, f, r, k)
    return leave_initialization(base, link, plan, f, r, info, k)


# ---- events ----


def enter_event_mode(link: Any, r: Any, info: int) -> bool:
    """Be in Event Mode, with the events that are due handled."""
    if r[MODE] != EVENT:
        if bad(link, link[ENTER_EVENT_MODE], (r[HANDLE],)):
            return True
        r[MODE] = EVENT
    if r[EVENT_DUE] != 0:
        r[EVENT_DUE] = 0
        return settle(link, r, info)
    return False


def leave_event_mode(link: Any, r: Any) -> bool:
    """Go back to Step Mode or Continuous-Time Mode."""
    r[MODE] = RUNNING
    return bad(link, link[LEAVE_EVENT_MODE], (r[HANDLE],))


def settle(link: Any, r: Any, info: int) -> bool:
    """Event iteration until no discrete state needs another update; CHANGED says whether states jumped."""
    flags = integers_at(info, 5)
    for _ in range(MOST_ITERATIONS):
        for j in range(5):
            flags[j] = 0
        if link[VERSION] == 2:
            if bad(link, link[UPDATE_DISCRETE_STATES], (r[HANDLE], info)):
                return True
        else:
            addresses = (r[HANDLE], info, info + 4, info + 8, info + 12, info + 16, info + INFO_REAL)
            if bad(link, link[UPDATE_DISCRETE_STATES], addresses):
                return True
        if flags[1] != 0:
            return give_up(link, TERMINATED, 0)
        if flags[3] != 0:
            r[CHANGED] = 1
        if flags[0] == 0:
            r[NEXT_DEFINED] = flags[4]
            r[NEXT] = words_at(info + INFO_REAL, 1)[0]
            return False
    return give_up(link, ENDLESS, 0)


# ---- Co-Simulation ----


def do_step(time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Set inputs and do a step from `time`."""
    eventful = link[KIND] == EVENT_CO_SIMULATION
    if eventful and enter_event_mode(link, r, info):
        return True
    if set_inputs(base, link, plan, f, r, k):
        return True
    if eventful and (settle(link, r, info) or leave_event_mode(link, r)):
        return True
    step = reals_at(f[LINK], LINK_WORDS)[STEP]
    if link[VERSION] == 2:
        return bad(link, link[DO_STEP], (r[HANDLE], time, step, 1))
    return do_step_3(time, step, link, r, info)


def do_step_3(time: float, step: float, link: Any, r: Any, info: int) -> bool:
    """FMI 3's step: one that it returns from early is continued to its end, events on the way are handled."""
    flags, last = integers_at(info, 3), reals_at(info + INFO_REAL, 1)
    now, h = time, step
    while True:
        for j in range(3):
            flags[j] = 0
        last[0] = now
        if bad(link, link[DO_STEP], (r[HANDLE], now, h, 1, info, info + 4, info + 8, info + INFO_REAL)):
            return True
        if flags[1] != 0:
            return give_up(link, TERMINATED, 0)
        early = flags[2] != 0 and last[0] < time + step
        reached = last[0]
        if flags[0] != 0 and link[KIND] == EVENT_CO_SIMULATION:
            r[EVENT_DUE] = 1
            if early and (enter_event_mode(link, r, info) or leave_event_mode(link, r)):
                return True
        if not early:
            return False
        if not reached > now:
            return give_up(link, NO_PROGRESS, 0)
        now, h = reached, time + step - reached


# ---- Model Exchange ----


def leave_initialization(base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Leave Initialization Mode, which for Model Exchange and event mode ends in Event Mode."""
    if bad(link, link[EXIT_INITIALIZATION], (r[HANDLE],)):
        return True
    if link[KIND] == CO_SIMULATION:
        return False
    r[MODE] = EVENT
    r[EVENT_DUE] = 1
    if link[KIND] == EVENT_CO_SIMULATION:
        return False
    if enter_event_mode(link, r, info) or leave_event_mode(link, r):
        return True
    return pull_states(base, link, plan, f, r, k) or watch_indicators(link, r)


def prepare(time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Set time, states and inputs. Discrete inputs may be set in Event Mode only, and only if they have changed."""
    if set_time_and_states(time, base, link, plan, f, r, k):
        return True
    changed = False
    for i in range(plan[N_INPUTS]):
        address = plan[INPUTS] + i * ROW_WORDS * 8
        row = words_at(address, ROW_WORDS)
        at = base + f[row[SLOT]] + k * f[row[SLOT] + 1]
        if row[SHADOW] != 0:
            changed |= differs(at, row[SHADOW] + k * row[BYTES], row[BYTES])
        elif set_value(link, row, address, r[HANDLE], at, k):
            return True
    if not changed:
        return False
    r[EVENT_DUE] = 0
    if enter_event_mode(link, r, info) or set_inputs(base, link, plan, f, r, k):
        return True
    return finish_events(base, link, plan, f, r, info, k)


def set_time_and_states(time: float, base: int, link: Any, plan: Any, f: Any, r: Any, k: int) -> bool:
    """Set the time and the continuous states that the call reads."""
    if bad(link, link[SET_TIME], (r[HANDLE], time)):
        return True
    n = link[STATES]
    if n == 0:
        return False
    gather(base, link, plan[STATE_MAP], f, k)
    return bad(link, link[SET_STATES], (r[HANDLE], link[BUFFER], n))


def gather(base: int, link: Any, map: int, f: Any, k: int) -> None:
    """The states of instance k, from the arena to the buffer."""
    n = link[STATES]
    places, buffer = words_at(map, 2 * n), words_at(link[BUFFER], n)
    for j in range(n):
        slot = places[2 * j]
        buffer[j] = words_at(base + f[slot] + k * f[slot + 1] + 8 * places[2 * j + 1], 1)[0]


def scatter(base: int, link: Any, map: int, f: Any, k: int) -> None:
    """The states or derivatives of instance k, from the buffer to the arena."""
    n = link[STATES]
    places, buffer = words_at(map, 2 * n), words_at(link[BUFFER], n)
    for j in range(n):
        slot = places[2 * j]
        words_at(base + f[slot] + k * f[slot + 1] + 8 * places[2 * j + 1], 1)[0] = buffer[j]


def pull_states(base: int, link: Any, plan: Any, f: Any, r: Any, k: int) -> bool:
    """The FMU's states to the arena."""
    r[CHANGED] = 0
    n = link[STATES]
    if n == 0:
        return False
    if bad(link, link[GET_STATES], (r[HANDLE], link[BUFFER], n)):
        return True
    scatter(base, link, plan[STATE_MAP], f, k)
    return False


def get_derivatives(base: int, link: Any, plan: Any, f: Any, r: Any, k: int) -> bool:
    """The derivatives to the arena."""
    r[STEPPED] = 1
    if bad(link, link[GET_DERIVATIVES], (r[HANDLE], link[BUFFER], link[STATES])):
        return True
    scatter(base, link, plan[DERIVATIVE_MAP], f, k)
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


def events(time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Handle what happened in the step that ends now: the FMU's own wish, indicators' signs, a time event."""
    if r[STEPPED] == 0:
        return False
    r[STEPPED] = 0
    r[EVENT_DUE] = 0
    if set_time_and_states(time, base, link, plan, f, r, k):
        return True
    if link[COMPLETED_STEP] != 0:
        flags = integers_at(info, 2)
        flags[0] = flags[1] = 0
        if bad(link, link[COMPLETED_STEP], (r[HANDLE], 1, info, info + 4)):
            return True
        if flags[1] != 0:
            return give_up(link, TERMINATED, 0)
        r[EVENT_DUE] = flags[0]
    if watch_indicators(link, r):
        return True
    if r[NEXT_DEFINED] != 0 and time >= reals_at(info - 8 * INFO, RECORD_WORDS)[NEXT]:
        r[EVENT_DUE] = 1
    if r[EVENT_DUE] == 0:
        return False
    r[EVENT_DUE] = 0
    return enter_event_mode(link, r, info) or finish_events(base, link, plan, f, r, info, k)


def finish_events(base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Event iteration, and back to Continuous-Time Mode with the states that the events have set."""
    if settle(link, r, info) or leave_event_mode(link, r):
        return True
    if r[CHANGED] != 0 and pull_states(base, link, plan, f, r, k):
        return True
    if watch_indicators(link, r):
        return True
    r[EVENT_DUE] = 0
    return False

"""The kernel that stands between the loop and an FMU: set inputs, step, get outputs, handle events.

Generic: one compiled function serves every FMU of either FMI version, because all that differs is data. A frame is
``[fault, instances, link, plan, (offset, stride) per argument…]``; `link` is the address of a table that all calls of
one block share, `plan` of one that belongs to the call; `cosim.fmu.instance` fills both. Like `cosim.engine`, this is
one source for both engines, and nothing here allocates or returns to Python.

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

from cosim.memory import bytes_at, integers_at, invoke, reals_at, words_at

OK, WARNING, DISCARD, ERROR, FATAL = range(5)

# A frame's words before the arguments.
FAULT, COUNT, LINK, PLAN, FIRST = range(5)

# What all calls of a block share. Functions are addresses, 0 where the FMU has none.
LINK_WORDS = 32
(
    VERSION,
    KIND,
    RECORDS,
    STATES,
    INDICATORS,
    BUFFER,  # the states in the FMU's order
    SIGNS,  # the event indicators
    STEP,  # communication step, a float64 (s)
    EXIT_INITIALIZATION,
    SET_TIME,
    SET_STATES,
    GET_STATES,
    GET_DERIVATIVES,
    GET_INDICATORS,
    COMPLETED_STEP,
    ENTER_EVENT_MODE,
    UPDATE_DISCRETE_STATES,
    LEAVE_EVENT_MODE,
    DO_STEP,
    STATUS,  # of the call that failed
    FAILED,  # its address, or one of the reasons below
    ROW,  # the address of the row that it was for, or 0
    INSTANCE,  # of which instance, from 0
    WARNINGS,
    CALLING,  # the address of the function that is being called, or was last
    CALLED,  # how many calls there have been
) = range(26)
CO_SIMULATION, EVENT_CO_SIMULATION, MODEL_EXCHANGE = range(3)
NOT_FINITE, TERMINATED, NO_PROGRESS, ENDLESS, TOO_LARGE = -1, -2, -3, -4, -5

# One instance. INFO is four words for what a call hands back: fmi2EventInfo, and the same layout for FMI 3.
RECORD_WORDS = 12
HANDLE, MODE, STEPPED, EVENT_DUE, NEXT_DEFINED, NEXT, CHANGED, INDICATOR_VALUES, INFO = range(9)
RUNNING, EVENT = range(2)
INFO_REAL = 24  # bytes from INFO to the number in it

# What one call exchanges. The maps give (slot, element) for each state in the FMU's order.
PLAN_WORDS = 9
FRAME_WORDS, INPUTS, N_INPUTS, OUTPUTS, N_OUTPUTS, STATE_MAP, DERIVATIVE_MAP, SETTLES, TASK = range(9)

# One variable: the getter or setter, its value references, how many values, and where they are.
ROW_WORDS = 10
FUNCTION, REFERENCES, N_REFERENCES, N_VALUES, SLOT, CODE, STAGING, SHADOW, BYTES = range(9)
PLAIN, FLOAT64, FLOAT32, INTEGER32, BOOLEAN32 = range(5)  # the last two, FMI 2's, are widened or narrowed in STAGING

MOST_ITERATIONS = 1000
_EXPONENT64 = 0x7FF0000000000000
_EXPONENT32 = 0x7F800000
_LARGEST32 = 0x7FFFFFFF

# What a call does for each instance.
INITIAL, BEGIN, GET, EXCHANGE, ADVANCE, EVALUATE, DIFFERENTIATE, HANDLE_EVENTS = range(8)


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


def bad(link: Any, function: int, arguments: Any) -> bool:
    """Call a C function. Returns whether its status is worse than a warning, and keeps both."""
    link[CALLING] = function
    link[CALLED] += 1
    status = invoke(function, arguments)
    if status == WARNING:
        link[WARNINGS] += 1
    elif status != OK:
        link[STATUS] = status
        link[FAILED] = function
        link[ROW] = 0
        return True
    return False


def give_up(link: Any, reason: int, row: int) -> bool:
    """Fail for a reason of our own."""
    link[STATUS] = ERROR
    link[FAILED] = reason
    link[ROW] = row
    return True


# ---- values ----


def transfer(link: Any, row: Any, handle: int, data: int) -> bool:
    """Call a getter or a setter."""
    if link[VERSION] == 2:
        return bad(link, row[FUNCTION], (handle, row[REFERENCES], row[N_REFERENCES], data))
    return bad(link, row[FUNCTION], (handle, row[REFERENCES], row[N_REFERENCES], data, row[N_VALUES]))


def set_value(link: Any, row: Any, address: int, handle: int, at: int, k: int) -> bool:
    """Set one variable of instance k from the arena."""
    n = row[N_VALUES]
    data = at
    if row[CODE] == INTEGER32:
        data = row[STAGING]
        narrow, wide = integers_at(data, n), words_at(at, n)
        for j in range(n):
            if wide[j] > _LARGEST32 or wide[j] < -_LARGEST32 - 1:
                return give_up(link, TOO_LARGE, address)
            narrow[j] = wide[j]
    elif row[CODE] == BOOLEAN32:
        data = row[STAGING]
        wide_flags, flags = integers_at(data, n), bytes_at(at, n)
        for j in range(n):
            wide_flags[j] = flags[j]
    if row[SHADOW] != 0:
        new, old = bytes_at(at, row[BYTES]), bytes_at(row[SHADOW] + k * row[BYTES], row[BYTES])
        for j in range(row[BYTES]):
            old[j] = new[j]
    if transfer(link, row, handle, data):
        link[ROW] = address
        return True
    return False


def get_value(link: Any, row: Any, address: int, handle: int, at: int) -> bool:
    """Get one variable into the arena; what is not finite fails."""
    n = row[N_VALUES]
    code = row[CODE]
    staged = code in (INTEGER32, BOOLEAN32)
    if transfer(link, row, handle, row[STAGING] if staged else at):
        link[ROW] = address
        return True
    if code == FLOAT64:
        bits = words_at(at, n)
        for j in range(n):
            if (bits[j] & _EXPONENT64) == _EXPONENT64:
                return give_up(link, NOT_FINITE, address)
    elif code == FLOAT32:
        short_bits = integers_at(at, n)
        for j in range(n):
            if (short_bits[j] & _EXPONENT32) == _EXPONENT32:
                return give_up(link, NOT_FINITE, address)
    elif code == INTEGER32:
        narrow, wide = integers_at(row[STAGING], n), words_at(at, n)
        for j in range(n):
            wide[j] = narrow[j]
    elif code == BOOLEAN32:
        wide_flags, flags = integers_at(row[STAGING], n), bytes_at(at, n)
        for j in range(n):
            flags[j] = 1 if wide_flags[j] != 0 else 0
    return False


def set_inputs(base: int, link: Any, plan: Any, f: Any, r: Any, k: int) -> bool:
    """Set all inputs that the call reads."""
    for i in range(plan[N_INPUTS]):
        address = plan[INPUTS] + i * ROW_WORDS * 8
        row = words_at(address, ROW_WORDS)
        at = base + f[row[SLOT]] + k * f[row[SLOT] + 1]
        if set_value(link, row, address, r[HANDLE], at, k):
            return True
    return False


def get_outputs(base: int, link: Any, plan: Any, f: Any, r: Any, k: int) -> bool:
    """Get all outputs that the call writes."""
    for i in range(plan[N_OUTPUTS]):
        address = plan[OUTPUTS] + i * ROW_WORDS * 8
        row = words_at(address, ROW_WORDS)
        at = base + f[row[SLOT]] + k * f[row[SLOT] + 1]
        if get_value(link, row, address, r[HANDLE], at):
            return True
    return False


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


def differs(one: int, other: int, size: int) -> bool:
    """Whether two pieces of memory have different bytes."""
    a, b = bytes_at(one, size), bytes_at(other, size)
    different = 0
    for j in range(size):
        different |= a[j] ^ b[j]
    return different != 0


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

"""The kernel that stands between the loop and an FMU: set inputs, step, get outputs, handle events.

Generic: one compiled function serves every FMU of either FMI version, because all that differs is data, laid out as
`cosim.fmu.fields` says. Like `cosim.master.loop`, this is one source for both engines, and nothing here allocates or
returns to Python.

The calls keep to the state machines of FMI 2.0.5 (sections 3.2.3 and 4.2.4) and FMI 3.0.2 (sections 2.3, 3.2, 4.2):

===============  ========================================================================================
FMI 2 and plain  outputs are got at a communication point, inputs are set just before `doStep`: an output
Co-Simulation    never shows an input that was set after the last step
FMI 3 with       each communication point is an event: inputs are set and outputs got in Event Mode
event mode
Model Exchange   time, states and inputs are set, outputs and derivatives are got in Continuous-Time Mode;
                 events that a step has passed are handled at its end, discrete inputs where they change;
                at a communication point with an event, outputs are got in Event Mode
===============  ========================================================================================
"""

from __future__ import annotations

from typing import Any

from cosim.fmu.curves import set_derivatives
from cosim.fmu.event_mode import (
    communication_step,
    enter_event_mode,
    go_into_event_mode,
    leave_event_mode,
    reals_of,
    settle,
)
from cosim.fmu.exchange import begin_events, differentiate, end_events, prepare, pull_states
from cosim.fmu.fields import (
    ADVANCE,
    AGAIN,
    BEGIN_EVENTS,
    BOOLEAN_STATUS,
    CLOCK,
    CO_SIMULATION,
    COUNT,
    DIFFERENTIATE,
    DISCARD,
    DO_STEP,
    EARLY,
    END_EVENTS,
    ENDED,
    ENDED_AT,
    ENDING,
    ENDS,
    EVALUATE,
    EVENT,
    EVENT_CO_SIMULATION,
    EVENT_DUE,
    EXCHANGE,
    EXIT_INITIALIZATION,
    FAILED,
    FATAL,
    FIRST,
    FRAME_WORDS,
    GET,
    GO_BACK,
    HANDLE,
    HANDLED,
    INDICATE,
    INFO,
    INFO_REAL,
    INITIAL,
    INSTANCE,
    KEEP_STATE,
    KIND,
    LAST_TIME_STATUS,
    LEFT,
    LINK,
    LINK_WORDS,
    MODE,
    NEXT,
    NEXT_DEFINED,
    NEXT_EVENT,
    NO_PROGRESS,
    NOTHING,
    OK,
    PLAN,
    PLAN_TANGENT,
    PLAN_WORDS,
    REACHED,
    REAL_STATUS,
    RECORD_WORDS,
    RECORDS,
    ROUNDING,
    SETTLES,
    START_TIME,
    STATUS,
    TANGENT,
    TASK,
    TELL,
    TERMINATED,
    TERMINATED_STATUS,
    UNDERIVED,
    VERSION,
    WARNED,
    WARNED_AT,
    WARNING,
    WARNINGS,
)
from cosim.fmu.going_back import go_back, keep_state
from cosim.fmu.indicators import indicate
from cosim.fmu.tangents import LOST, REFUSED, follow, note
from cosim.fmu.transfer import bad, get_outputs, give_up, set_inputs
from cosim.machine.memory import integers_at, reals_at, words_at
from cosim.master.tables import ALONG, NOTED


def adapt(time: float, base: int, frame: int) -> int:
    """The kernel: do what the plan says for every instance, up to the first that fails, by the FMU's own clock.

    ==============  ====================================================================================
    NOTHING         nobody looks at what it would get
    INITIAL         in Initialization Mode: set inputs, get outputs
    BEGIN           set inputs, leave Initialization Mode; Model Exchange: the states go to the state vector
    GET             plain Co-Simulation, at a communication point: get outputs
    EXCHANGE        Co-Simulation with event mode, at a communication point: set inputs, get outputs
    ADVANCE         Co-Simulation: set inputs and do a step from `time`
    EVALUATE        Model Exchange: outputs from time, states and inputs
    DIFFERENTIATE   Model Exchange: derivatives from time, states and inputs
    BEGIN_EVENTS    Model Exchange: look for events of the step that ends now, and go into Event Mode for them
    END_EVENTS      Model Exchange: handle them with the inputs of this point; they may change states
    KEEP_STATE      keep the FMU state, and what of ours goes with it; GO_BACK: be in it again
    INDICATE        Model Exchange: event indicators from time, states and inputs
    TELL            when the next time event is
    ==============  ====================================================================================
    """
    link = words_at(words_at(frame, FIRST)[LINK], LINK_WORDS)
    plan = words_at(words_at(frame, FIRST)[PLAN], PLAN_WORDS)
    f = words_at(frame, plan[FRAME_WORDS])
    numbers, warnings = reals_at(f[LINK], LINK_WORDS), link[WARNINGS]
    clock = time + numbers[START_TIME]
    for k in range(f[COUNT]):
        address = link[RECORDS] + k * RECORD_WORDS * 8
        r = words_at(address, RECORD_WORDS)
        lost = evaluated(plan[TASK], clock, base, link, plan, f, r, address + INFO * 8, k)
        if link[WARNINGS] > warnings and link[WARNED] == 0:
            link[WARNED] = k + 1
            numbers[WARNED_AT] = time
        if lost or (r[ENDS] != 0 and link[ENDED] == 0):
            numbers[ENDED_AT] = reals_of(address + INFO * 8)[CLOCK] - numbers[START_TIME]
        if lost:
            link[INSTANCE] = k
            return int(min(max(link[STATUS], DISCARD), FATAL))
        if r[ENDS] != 0 and link[ENDED] == 0:
            link[ENDED] = k + 1
            words_at(link[ENDING], 1)[0] = 1
    return WARNING if link[WARNINGS] > warnings else OK


def evaluated(task: int, time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """As `failed`; outputs of which the FMU gives derivatives follow from those where the loop wants it so."""
    table = plan[PLAN_TANGENT]
    if table == 0:
        return failed(task, time, base, link, plan, f, r, info, k)
    wanted = words_at(link[TANGENT], 1)[0]
    if wanted == ALONG and link[UNDERIVED] == 0 and r[ENDS] == 0:
        outcome = follow(base, link, table, f, r, k)
        if outcome != REFUSED:
            return outcome == LOST
    lost = failed(task, time, base, link, plan, f, r, info, k)
    if wanted == NOTED and not lost:
        note(base, table, f, k)
    return lost


def failed(task: int, time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Do a task for instance k. Returns whether it failed; the link then says where, as in all below."""
    if task == NOTHING:
        return False
    if task == GET:
        return get_outputs(base, link, plan, f, r, k)
    if task == ADVANCE:
        return do_step(time, base, link, plan, f, r, info, k)
    if task == EVALUATE:
        return prepare(time, base, link, plan, f, r, info, k) or get_outputs(base, link, plan, f, r, k)
    if task == DIFFERENTIATE:
        return differentiate(time, base, link, plan, f, r, info, k)
    if task == BEGIN_EVENTS:
        return begin_events(time, base, link, plan, f, r, info, k)
    if task == END_EVENTS:
        return end_events(time, base, link, plan, f, r, info, k)
    if task == KEEP_STATE:
        return keep_state(link, r, k)
    if task == GO_BACK:
        return go_back(link, r, k)
    if task == INDICATE:
        return indicate(time, base, link, plan, f, r, info, k)
    if task == TELL:
        tell_next_event(link, f, r, info)
        return False
    if task == EXCHANGE:
        if r[ENDS] != 0:
            return get_outputs(base, link, plan, f, r, k)
        reals_of(info)[CLOCK] = time
        if r[EVENT_DUE] != 0 and words_at(link[LEFT], 1)[0] != 0:
            return look_before_event(base, link, plan, f, r, k)
        if r[EVENT_DUE] != 0:
            words_at(link[AGAIN], 1)[0] = 1
        if enter_event_mode(link, r, info) or set_inputs(base, link, plan, f, r, k):
            return True
        return (plan[SETTLES] != 0 and settle(link, r, info)) or get_outputs(base, link, plan, f, r, k)
    if task == INITIAL:
        return set_inputs(base, link, plan, f, r, k) or get_outputs(base, link, plan, f, r, k)
    return leave_initialization(time, base, link, plan, f, r, info, k)


def look_before_event(base: int, link: Any, plan: Any, f: Any, r: Any, k: int) -> bool:
    """Get outputs as they follow from inputs at an event that has not been handled."""
    if r[MODE] != EVENT and go_into_event_mode(link, r):
        return True
    return set_inputs(base, link, plan, f, r, k) or get_outputs(base, link, plan, f, r, k)


def tell_next_event(link: Any, f: Any, r: Any, info: int) -> None:
    """Have the loop know of a time event that lies ahead."""
    numbers = reals_of(info)
    if r[ENDS] == 0 and r[NEXT_DEFINED] != 0 and numbers[NEXT] > numbers[HANDLED]:
        stop_at(numbers[NEXT], f, link[NEXT_EVENT])


def stop_at(time: float, f: Any, address: int) -> None:
    """Note a time (s) by the FMU's clock where the earliest is kept, by the loop's."""
    earliest = reals_at(address, 1)
    earliest[0] = min(earliest[0], time - reals_at(f[LINK], LINK_WORDS)[START_TIME])


def leave_initialization(time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Leave Initialization Mode, which for Model Exchange and event mode ends in Event Mode.

    That lasts until the outputs of the first communication point are evaluated.
    """
    numbers = reals_of(info)
    numbers[CLOCK] = numbers[REACHED] = time
    if set_inputs(base, link, plan, f, r, k) or bad(link, link[EXIT_INITIALIZATION], (r[HANDLE],)):
        return True
    if link[KIND] == CO_SIMULATION:
        return False
    r[MODE] = EVENT
    r[EVENT_DUE] = 1
    if link[KIND] == EVENT_CO_SIMULATION:
        return False
    return settle(link, r, info) or pull_states(base, link, plan, f, r, k)


# ---- Co-Simulation ----


def do_step(time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Set inputs and do a step from `time`."""
    reals_of(info)[CLOCK] = time
    eventful = link[KIND] == EVENT_CO_SIMULATION
    if eventful and enter_event_mode(link, r, info):
        return True
    if set_inputs(base, link, plan, f, r, k):
        return True
    if eventful and (settle(link, r, info) or leave_event_mode(link, r)):
        return True
    if r[ENDS] != 0:
        return give_up(link, TERMINATED, 0)
    if set_derivatives(base, link, plan, f, r, info, k):
        return True
    step = communication_step(f)
    if link[VERSION] == 3:
        return do_step_3(time, step, link, f, r, info)
    if not bad(link, link[DO_STEP], (r[HANDLE], time, step, 1)):
        return False
    return discarded(time, step, link, f, r, info)


def discarded(time: float, step: float, link: Any, f: Any, r: Any, info: int) -> bool:
    """Whether an FMI 2 step failed, rather than that it ended with the simulation."""
    if link[STATUS] != DISCARD or link[BOOLEAN_STATUS] == 0:
        return True
    flags, last = integers_at(info, 1), reals_at(info + INFO_REAL, 1)
    flags[0] = 0
    last[0] = time
    if bad(link, link[BOOLEAN_STATUS], (r[HANDLE], TERMINATED_STATUS, info)) or flags[0] == 0:
        link[STATUS], link[FAILED] = DISCARD, link[DO_STEP]
        return True
    if link[REAL_STATUS] != 0 and bad(link, link[REAL_STATUS], (r[HANDLE], LAST_TIME_STATUS, info + INFO_REAL)):
        return True
    return ends(last[0], time + step, step, link, f, r, info)


def ends(reached: float, end: float, step: float, link: Any, f: Any, r: Any, info: int) -> bool:
    """The simulation ends in a step: in peace at the end of it; before, at once, unless the loop can come here."""
    reals_of(info)[CLOCK] = reached
    early = reached < end - ROUNDING * step
    if early and link[EARLY] == 0:
        return give_up(link, TERMINATED, 0)
    link[STATUS] = OK
    if early:
        stop_at(reached, f, link[EARLY])
        return False
    r[ENDS] = 1
    return False


def do_step_3(time: float, step: float, link: Any, f: Any, r: Any, info: int) -> bool:
    """FMI 3's step: where it returns early at an event, the loop is to come there.

    Where the loop cannot, such an event is handled by itself, and the step continued to its end.
    """
    flags, last = integers_at(info, 3), reals_at(info + INFO_REAL, 1)
    now, h = time, step
    while True:
        for j in range(3):
            flags[j] = 0
        last[0] = now
        if bad(link, link[DO_STEP], (r[HANDLE], now, h, 1, info, info + 4, info + 8, info + INFO_REAL)):
            return True
        early = flags[2] != 0 and last[0] < time + step - ROUNDING * step
        reached = last[0]
        if flags[1] != 0:
            return ends(reached if early else time + step, time + step, step, link, f, r, info)
        if early and not reached > now:
            return give_up(link, NO_PROGRESS, 0)
        if early and flags[0] != 0 and link[EARLY] != 0:
            stop_at(reached, f, link[EARLY])
            return False
        if flags[0] != 0 and link[KIND] == EVENT_CO_SIMULATION:
            r[EVENT_DUE] = 1
            if early and (enter_event_mode(link, r, info) or leave_event_mode(link, r)):
                return True
            if r[ENDS] != 0:
                return give_up(link, TERMINATED, 0)
        if not early:
            return False
        now, h = reached, time + step - reached

"""Event Mode of Model Exchange and of FMI 3's Co-Simulation: in, event iteration, and out.

A function here returns whether it failed; the link then says where.
"""

from __future__ import annotations

from typing import Any

from cosim.fmu.fields import (
    CHANGED,
    CLOCK,
    ENDLESS,
    ENDS,
    ENTER_EVENT_MODE,
    EVENT,
    EVENT_DUE,
    HANDLE,
    HANDLED,
    INFO,
    INFO_REAL,
    LEAVE_EVENT_MODE,
    LINK,
    LINK_WORDS,
    MODE,
    MOST_ITERATIONS,
    NEXT,
    NEXT_DEFINED,
    RECORD_WORDS,
    RUNNING,
    STEP,
    UPDATE_DISCRETE_STATES,
    VERSION,
)
from cosim.fmu.transfer import bad, give_up
from cosim.machine.memory import integers_at, reals_at, words_at


def reals_of(info: int) -> Any:
    """The words of an instance's record as float64."""
    return reals_at(info - 8 * INFO, RECORD_WORDS)


def communication_step(f: Any) -> float:
    """The loop's communication step (s)."""
    step: float = reals_at(words_at(f[LINK], LINK_WORDS)[STEP], 1)[0]
    return step


def enter_event_mode(link: Any, r: Any, info: int) -> bool:
    """Be in Event Mode, with the events that are due handled."""
    if r[MODE] != EVENT and go_into_event_mode(link, r):
        return True
    if r[EVENT_DUE] != 0:
        return settle(link, r, info)
    return False


def go_into_event_mode(link: Any, r: Any) -> bool:
    """Be in Event Mode, with nothing handled yet."""
    r[MODE] = EVENT
    return bad(link, link[ENTER_EVENT_MODE], (r[HANDLE],))


def leave_event_mode(link: Any, r: Any) -> bool:
    """Go back to Step Mode or Continuous-Time Mode, unless the simulation is at its end."""
    if r[ENDS] != 0:
        return False
    r[MODE] = RUNNING
    return bad(link, link[LEAVE_EVENT_MODE], (r[HANDLE],))


def settle(link: Any, r: Any, info: int) -> bool:
    """Event iteration until no discrete state needs another update; CHANGED says whether states jumped."""
    flags, numbers = integers_at(info, 5), reals_of(info)
    r[EVENT_DUE] = 0
    numbers[HANDLED] = numbers[CLOCK]
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
        if flags[3] != 0:
            r[CHANGED] = 1
        if flags[1] != 0:
            r[ENDS] = 1
            return False
        if flags[0] == 0:
            r[NEXT_DEFINED] = flags[4]
            r[NEXT] = words_at(info + INFO_REAL, 1)[0]
            return False
    return give_up(link, ENDLESS, 0)

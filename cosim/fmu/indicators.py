"""Model Exchange: what an FMU's event indicators are, for whoever looks for an event inside a step."""

from __future__ import annotations

from typing import Any

from cosim.fmu.exchange import prepare
from cosim.fmu.fields import ENDS, GET_INDICATORS, HANDLE, INDICATOR_SLOT, INDICATORS, SIGNS
from cosim.fmu.transfer import bad
from cosim.machine.memory import reals_at


def indicate(time: float, base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """The event indicators to the arena."""
    if r[ENDS] != 0:
        return False
    if prepare(time, base, link, plan, f, r, info, k):
        return True
    n = link[INDICATORS]
    if bad(link, link[GET_INDICATORS], (r[HANDLE], link[SIGNS], n)):
        return True
    slot = plan[INDICATOR_SLOT]
    found, to = reals_at(link[SIGNS], n), reals_at(base + f[slot] + k * f[slot + 1], n)
    for j in range(n):
        to[j] = found[j]
    return False

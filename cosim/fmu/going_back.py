"""A step may be done anew: an FMU keeps its state, and goes back to it.

What this side knows of an instance, such as its mode and its next event, belongs to the state and is kept with it, for
all instances of a block at once. A function here returns whether it failed; the link then says where.
"""

from __future__ import annotations

from typing import Any

from cosim.fmu.fields import (
    COPIED,
    FROM,
    GET_FMU_STATE,
    HANDLE,
    KEPT,
    KEPT_WORDS,
    N_KEPT,
    SET_FMU_STATE,
    SNAPSHOTS,
    WORDS,
)
from cosim.fmu.transfer import bad
from cosim.machine.memory import words_at


def keep_state(link: Any, r: Any, k: int) -> bool:
    """Keep the state of instance k; the one before is given up."""
    if k == 0:
        exchange(link, False)
    return bad(link, link[GET_FMU_STATE], (r[HANDLE], link[SNAPSHOTS] + 8 * k))


def go_back(link: Any, r: Any, k: int) -> bool:
    """Be in the state that instance k has kept."""
    if k == 0:
        exchange(link, True)
    return bad(link, link[SET_FMU_STATE], (r[HANDLE], words_at(link[SNAPSHOTS] + 8 * k, 1)[0]))


def exchange(link: Any, back: bool) -> None:
    """Copy what of ours belongs to the state, or copy it back."""
    for j in range(link[N_KEPT]):
        kept = words_at(link[KEPT] + j * KEPT_WORDS * 8, KEPT_WORDS)
        here, there = words_at(kept[FROM], kept[WORDS]), words_at(kept[COPIED], kept[WORDS])
        for i in range(here.size):
            if back:
                here[i] = there[i]
            else:
                there[i] = here[i]

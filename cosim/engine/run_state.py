"""All that a simulation knows at a communication point, in arrays: with it, another one of the same program goes on.

It is taken whole, so that nothing is forgotten: the arena and the control block. Addresses stay the own of each run,
and so do constants, the frames of calls among them, which hold some; but clocks, which know whether they are due.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol

import numpy as np

from cosim.engine.hosts import Forked, Here
from cosim.engine.program import Program
from cosim.master import tables

_TAKEN = [word for word in range(tables.CONTROL_WORDS) if word not in tables.ADDRESSES]


class Resumable(Protocol):
    """What a simulation is to who saves and restores it; see `cosim.engine.simulation`."""

    program: Program
    arena: np.ndarray
    control: np.ndarray
    host: Here | Forked | None
    ticks: int
    rests_at: int
    resting: bool

    @property
    def done(self) -> int:
        """How many ticks are done."""

    @property
    def time(self) -> float:
        """The simulated time (s)."""


def state_of(simulation: Resumable) -> dict[str, Any]:
    """The state of a simulation that is `resting`. Raises: CosimError of foreign blocks."""
    assert simulation.resting
    assert simulation.host
    return {
        "arena": simulation.arena.copy(),
        "control": simulation.control[_TAKEN],
        "parts": simulation.host.save(simulation.time),
    }


def restore(simulation: Resumable, state: Mapping[str, Any]) -> None:
    """Have a simulation that is initialized, and has done no step, go on from a state.

    Raises: CosimError of foreign blocks; KeyError, TypeError or ValueError for what is none.
    """
    assert simulation.resting
    assert simulation.host
    arena, saved, words = simulation.arena, state["arena"], state["control"]
    if (saved.shape, saved.dtype, words.shape) != (arena.shape, arena.dtype, (len(_TAKEN),)):
        raise ValueError("of another size")
    own = {span: arena[slice(*span)].copy() for span in _constants(simulation.program)}
    arena[:] = saved
    for span, content in own.items():
        arena[slice(*span)] = content
    simulation.control[_TAKEN] = words
    if not 0 <= simulation.done <= simulation.ticks:
        raise ValueError("no time of the run")
    simulation.host.restore(state["parts"], simulation.time)


def _constants(program: Program) -> Iterator[tuple[int, int]]:
    """Where each constant begins and ends, in bytes."""
    for offset, content in program.layout.first:
        if offset >= program.layout.changing and offset != program.clocks:
            yield offset, offset + content.nbytes

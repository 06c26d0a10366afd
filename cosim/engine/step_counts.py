"""What a run tells of the steps that tolerances chose: between communication points, and inside."""

from __future__ import annotations

import numpy as np

from cosim.engine.outcome import Stepping
from cosim.engine.program import Program
from cosim.master import tables


def stepping(program: Program, control: np.ndarray) -> Stepping | None:
    """The communication steps that a tolerance chose, if one did."""
    if not program.attempts.tolerance:
        return None
    words = (tables.SHORTEST, tables.LONGEST, tables.UNDONE, tables.COARSE)
    shortest, longest, rejected, coarse = (int(control[word]) for word in words)
    return Stepping(program.time(shortest), program.time(longest), rejected, coarse)


def inner_steps(program: Program, arena: np.ndarray) -> dict[str, dict[str, int]]:
    """How many were taken and rejected so far of each block within a tolerance, or of all, called joint."""
    found = {}
    for bank in program.banks:
        if bank[tables.CONTROLLED]:
            memory = arena[bank[tables.MEMORY] :][: 8 * tables.MEMORY_WORDS].view(np.int64)
            counts = {"taken": int(memory[tables.TAKEN])}
            if not program.reference:  # which does not tell
                counts["rejected"] = int(memory[tables.REJECTED])
            found[program.name_of(bank)] = counts
    return found

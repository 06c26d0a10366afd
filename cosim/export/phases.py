"""The phases of an exported program: those of every program, and two that only importers ask for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.engine.program import Program
from cosim.master import tables
from cosim.wiring.network import Loop

#: What only FMUs do: EVALUATE while sampled blocks hold what they gave, and the derivatives of all states.
PHASES = (*tables.PHASES, "HELD", "DERIVATIVES")


@dataclass
class Rows:
    """The rows of a program, followed by those of HELD and DERIVATIVES.

    phases: of each of PHASES the first row and the one after the last. loops: algebraic loops, by the row that solves
    them.
    """

    rows: np.ndarray
    phases: list[tuple[int, int]]
    loops: dict[int, Loop]


def rows(program: Program) -> Rows:
    """The program's rows, followed by rows of our own for what only FMUs do."""
    found, loops = program.rows.tolist(), dict(program.loops)
    phases = [program.phases[name] for name in tables.PHASES]
    held, held_loops = _held(program)
    derivatives = [row for part in program.slopes for row in found[slice(*part)]]
    loops |= {len(found) + at: loop for at, loop in held_loops.items()}
    for added in (held, derivatives):
        phases.append((len(found), len(found) + len(added)))
        found += added
    return Rows(np.array(found, np.int64).reshape(-1, tables.ROW_WORDS), phases, loops)


def _held(program: Program) -> tuple[list[list[int]], dict[int, Loop]]:
    """EVALUATE without the calls of sampled blocks, and the loops in it, which may have become shorter."""

    def is_held(row: list[int]) -> bool:
        return row[tables.CLOCK] != 0

    held: list[list[int]] = []
    loops: dict[int, Loop] = {}
    solver, last = [], -1  # of the loop that is being copied: its own row, and the last that it evaluates
    for at in range(*program.phases["EVALUATE"]):
        row = program.rows[at].tolist()
        if row[tables.KIND] == tables.SOLVE:
            solver, last = row, at + row[tables.B]
            row[tables.B], row[tables.C] = 0, tables.NO_SAMPLED
            loops[len(held)] = program.loops[at]
        elif is_held(row):
            continue
        elif at <= last:
            solver[tables.B] += 1
        held.append(row)
    return held, loops

"""Iterated: every step is done twice, as Jacobi does it.

    advance all blocks from t to t + h, with their inputs extrapolated from their histories
    evaluate at t + h, and be back at t
    advance all blocks from t to t + h, with their inputs interpolated through what was found at t + h

Coupling is of order 2, and of one more for each order of `run.extrapolation`. See `cosim.engine.attempts`.
"""

from __future__ import annotations

from collections.abc import Sequence

from cosim.engine.methods import jacobi
from cosim.engine.writer import Writer
from cosim.wiring.network import Loop, Task


def advance(writer: Writer, tasks: Sequence[Task | Loop]) -> None:
    """Write ADVANCE; that it is done again, the program says."""
    jacobi.advance(writer, tasks)

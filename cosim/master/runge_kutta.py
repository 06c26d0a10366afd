"""An inner step of an explicit Runge-Kutta method. One source, two engines, as in `loop.py`."""

from __future__ import annotations

from typing import Any

from cosim.integrators import DENOMINATOR, HEAD, NODE
from cosim.machine.memory import reals_at
from cosim.machine.stages import move, weigh
from cosim.master.rows import differentiate
from cosim.master.tables import (
    BEGIN,
    BEGUN,
    CONTROLLED,
    OK,
    SLOPES,
    STAGES,
    STATES,
    SUM,
    TABLEAU,
    WARNING,
    D,
    part,
    slope_of,
    stage_of,
)


def runge_kutta_step(c: Any, base: int, b: Any, time: float, h: float) -> int:
    """From the states in BEGUN and the first slope to the states of the stage; where errors are controlled, SUM has it.

    Returns the status.
    """
    stages, stride = b[STAGES], c[STATES] * 8
    w, d = stage_of(c, base, b), part(c, base, b, D)
    begun, total = part(c, base, b, BEGUN), part(c, base, b, SUM)
    slopes = base + c[SLOPES] + b[BEGIN] * 8
    for stage in range(stages):
        row = row_of(base, b, stage)
        move(w, begun, h, row, slopes, stride, total)
        if stage < stages - 1:
            status = differentiate(c, base, b, time + row[NODE] * h)
            if status > WARNING:
                return status
            slope = slope_of(c, base, b, stage + 1)
            for j in range(w.size):
                slope[j] = d[j]
    if b[CONTROLLED] != 0:
        row = row_of(base, b, stages)
        weigh(total, row, slopes, stride)
        for j in range(total.size):
            total[j] *= h / row[DENOMINATOR]
    return OK


def row_of(base: int, b: Any, number: int) -> Any:
    """A row of the bank's tableau."""
    words = HEAD + b[STAGES]
    return reals_at(base + b[TABLEAU] + number * words * 8, words)

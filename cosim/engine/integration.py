"""Takes a bank of states over one communication step with its integrator. One source, two engines, as in `loop.py`."""

from __future__ import annotations

from typing import Any

from cosim.engine.rows import operate
from cosim.engine.tables import (
    BANK_WORDS,
    BANKS,
    BEGIN,
    BEGUN,
    END,
    FIRST_BEGIN,
    FIRST_END,
    IN_PLACE,
    INNER_BEGIN,
    INNER_END,
    INNER_STEPS,
    OK,
    SLOPES,
    STAGES,
    STATES,
    SUM,
    TABLEAU,
    WARNING,
    D,
    W,
    X,
)
from cosim.integrators import HEAD, NODE
from cosim.machine.memory import reals_at, words_at
from cosim.machine.stages import move


def integrate(c: Any, base: int, bank: int, k: int, begun: float, step: float) -> int:
    """Integrate one bank over one communication step with its own integrator and number of inner steps."""
    b = words_at(c[BANKS] + bank * BANK_WORDS * 8, BANK_WORDS)
    inner_steps = b[INNER_STEPS]
    x = part(c, base, b, X)
    w = x if b[IN_PLACE] != 0 else part(c, base, b, W)
    d = part(c, base, b, D)
    h = step / inner_steps
    for s in range(inner_steps):
        time = begun + s * h
        if s == 0:
            status = operate(c, base, b[FIRST_BEGIN], b[FIRST_END], k, time, time)
        else:
            status = operate(c, base, b[INNER_BEGIN], b[INNER_END], k, time, time)
        if status > WARNING:
            return status
        if b[STAGES] > 1:
            status = finish(c, base, b, x if s == 0 else w, w, d, k, time, h)
            if status > WARNING:
                return status
        elif s > 0 or b[IN_PLACE] != 0:
            for j in range(w.size):  # vectorised where the loop below would find that its arrays overlap
                w[j] += h * d[j]
        else:
            for j in range(w.size):
                w[j] = x[j] + h * d[j]
    return OK


def finish(c: Any, base: int, b: Any, origin: Any, w: Any, d: Any, k: int, time: float, h: float) -> int:
    """End the inner step of several stages, of which the first one's derivatives are in `d` already."""
    stages, stride = b[STAGES], c[STATES] * 8
    begun, total = part(c, base, b, BEGUN), part(c, base, b, SUM)
    slopes = base + c[SLOPES] + b[BEGIN] * 8
    for j in range(w.size):
        begun[j] = origin[j]
    for stage in range(stages):
        row = reals_at(base + b[TABLEAU] + stage * (HEAD + stages) * 8, HEAD + stages)
        slope = reals_at(slopes + stage * stride, w.size)
        for j in range(w.size):
            slope[j] = d[j]
        move(w, begun, h, row, slopes, stride, total)
        if stage < stages - 1:
            now = time + row[NODE] * h
            status = operate(c, base, b[INNER_BEGIN], b[INNER_END], k, now, now)
            if status > WARNING:
                return status
    return OK


def part(c: Any, base: int, b: Any, vector: int) -> Any:
    """A bank's part of one of the vectors X, W, BEGUN, SUM, D."""
    return reals_at(base + c[vector] + b[BEGIN] * 8, b[END] - b[BEGIN])

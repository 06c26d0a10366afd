"""What the rows of an algebraic loop give: f(z), how it answers to a disturbance, and what of it is noise.

One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.machine.memory import words_at
from cosim.master.tables import ALIVE, ROW_BYTES, ROW_WORDS, ROWS, WARNING, A, B, evaluate
from cosim.master.unknowns import (
    ALLOWED,
    DIVISORS,
    FUZZ,
    HELD,
    KEPT,
    LARGEST,
    MOVE,
    NOMINAL,
    ROW_DIVISORS,
    SIZE,
    TRIAL,
    WEIGHT,
    F,
    R,
    Z,
    exchange,
    unit,
    unknowns,
    vector,
)

POINTS = 9  # on either side, at which f is listened to
APART = 1.375  # residuals between two of these at least
WIDEST = 2.0**-14  # of an unknown, or else a residual, at most: f is taken for a cubic there
FOURTH = math.sqrt(70.0)  # of noise alone, differences of fourth order over its standard deviation
MOST_NOISE = 1e-12  # of the larger of an unknown and its nominal value, what of f may be noise
LOUDEST = 16.0  # standard deviations of noise: what a residual may be


def row_of(c: Any, o: int) -> Any:
    """The row that solves a loop."""
    return words_at(c[ROWS] + o * ROW_BYTES, ROW_WORDS)


def place(c: Any, base: int, o: int) -> int:
    """The address of what row o says of the unknowns."""
    at: int = base + row_of(c, o)[A]
    return at


def residual(c: Any, base: int, o: int, time: float, later: float, to: int, over: int) -> int:
    """f(z) and f(z) - z, to two vectors; the unknowns are then f(z). Returns the status."""
    u = unknowns(place(c, base, o))
    z, f, r, held = vector(base, u, Z), vector(base, u, to), vector(base, u, over), vector(base, u, HELD)
    c[ALIVE] += 1
    exchange(base, place(c, base, o), z, True)
    status = evaluate(c, base, o + 1, o + 1 + row_of(c, o)[B], time, later)
    exchange(base, place(c, base, o), f, False)
    for j in range(z.size):
        r[j] = f[j] - z[j] if held[j] == 0.0 else 0.0
    return status


def disturb(c: Any, base: int, o: int, time: float, later: float) -> int:
    """f near z, in TRIAL, each unknown moved by its own part, in MOVE; then f at z again. Returns the status."""
    u = unknowns(place(c, base, o))
    z, kept, step = vector(base, u, Z), vector(base, u, KEPT), vector(base, u, MOVE)
    size, held = vector(base, u, SIZE), vector(base, u, HELD)
    for j in range(z.size):
        kept[j] = z[j]
        if held[j] == 0.0:
            z[j] += math.sqrt(unit(u)) * (1.0 + 0.125 * (j % 7)) * size[j]
        step[j] = z[j] - kept[j]
    status = residual(c, base, o, time, later, TRIAL, R)
    for j in range(z.size):
        z[j] = kept[j]
    return residual(c, base, o, time, later, F, R) if status <= WARNING else status


def listen(c: Any, base: int, o: int, time: float, later: float, wider: float) -> int:
    """How much of f is noise, in FUZZ, by its fourth differences at points near z; then f at z again.

    Of what is smooth these are as good as nothing, as the points are about as near as f is to z, or so many times
    wider apart; and of noise many times its size. There has to be noise on both sides, as a jump is on one.
    After Moré and Wild 2011, Estimating computational noise. Returns the status.
    """
    u = unknowns(place(c, base, o))
    z, r, f, kept = vector(base, u, Z), vector(base, u, R), vector(base, u, TRIAL), vector(base, u, KEPT)
    size, nominal, fuzz = vector(base, u, SIZE), vector(base, u, NOMINAL), vector(base, u, FUZZ)
    values, slopes = vector(base, u, DIVISORS), vector(base, u, ROW_DIVISORS)
    bends, thirds, before = vector(base, u, LARGEST), vector(base, u, WEIGHT), vector(base, u, ALLOWED)
    for j in range(z.size):
        kept[j] = z[j]
        values[j] = slopes[j] = bends[j] = thirds[j] = fuzz[j] = 0.0
    for point in range(2 * POINTS):
        for j in range(z.size):
            apart = wider * APART * max(abs(r[j]), 4.0 * unit(u) * size[j])
            apart = min(apart, max(APART * abs(r[j]), WIDEST * size[j]))
            z[j] = kept[j] + (point - POINTS + 0.5) * apart
        status = residual(c, base, o, time, later, TRIAL, MOVE)
        if status > WARNING:
            return status
        for j in range(z.size):
            slope = f[j] - values[j]
            bend = slope - slopes[j]
            third = bend - bends[j]
            if point == POINTS:
                before[j] = fuzz[j]
                fuzz[j] = 0.0
            if point % POINTS >= 4:
                fuzz[j] = max(fuzz[j], abs(third - thirds[j]))
            values[j] = f[j]
            slopes[j] = slope
            bends[j] = bend
            thirds[j] = third
    for j in range(z.size):
        z[j] = kept[j]
        fuzz[j] = min(LOUDEST / FOURTH * min(before[j], fuzz[j]), MOST_NOISE * max(size[j], nominal[j]))
    return residual(c, base, o, time, later, F, R)

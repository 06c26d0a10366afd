"""When an algebraic loop is solved: residuals against the sizes of its unknowns and the rounding errors of f.

An unknown that is a small difference of large ones has their rounding errors, which count as nothing in its residual:
what slopes make of the sizes of z. A jump looks like a slope, but seldom from both sides, so the estimates by
differences of both sides have to allow them. One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.master.linear import HUGE
from cosim.master.unknowns import (
    ALLOWED,
    EQUATIONS,
    FUZZ,
    HELD,
    MOVE,
    NOMINAL,
    OTHER,
    ROUNDING,
    SIZE,
    TRIAL,
    WEIGHT,
    F,
    R,
    Z,
    unit,
    vector,
)

STRICT = 16.0  # rounding units: a residual over the unknown's size that is as good as none
LOUD = 64.0  # times the strictest residual: noise that is no rounding error of the unknown
TOLERANCE = 1e-13  # up to which differences of one side are believed what is rounding
MOST_ITERATIONS = 50
AS_TOLD = 2.0**-4  # of a residual, what is left of it at most where a step leads to where derivatives said
MISSED = 0.25  # from here on, it does not
MOST_MISSES = 3
FLOOR = 4.0  # rounding units of what f adds up: a residual that no step makes smaller
# In square roots of the rounding unit:
STEEPEST = 64.0  # of the largest unknown in a block: more than this is no rounding error
SAME = 4.0  # of a disturbance: what is left of it where an unknown comes back as it was disturbed


def measure(base: int, u: Any) -> None:
    """The size of each unknown, of z, f(z), or 1 where both are zero or no number; and the residual that it allows.

    Where f has far more noise than such a size allows, differences are those of the nominal size.
    """
    z, f, held = vector(base, u, Z), vector(base, u, F), vector(base, u, HELD)
    size, allowed = vector(base, u, SIZE), vector(base, u, ALLOWED)
    errors, other, strict = vector(base, u, ROUNDING), vector(base, u, OTHER), STRICT * unit(u)
    fuzz, nominal = vector(base, u, FUZZ), vector(base, u, NOMINAL)
    for j in range(z.size):
        size[j] = max(abs(z[j]), abs(f[j])) if abs(f[j]) < HUGE else abs(z[j])
        if size[j] == 0.0 or held[j] != 0.0:
            size[j] = 1.0
        allowed[j] = max(strict * size[j], min(errors[j], TOLERANCE * size[j]), min(other[j], TOLERANCE * size[j]))
        if fuzz[j] > LOUD * strict * size[j]:
            size[j] = max(size[j], nominal[j])
        allowed[j] = max(allowed[j], fuzz[j])


def allow_rounding(base: int, u: Any) -> None:
    """Allow residuals that are rounding errors of f, as slopes of both sides say."""
    size, allowed, n = vector(base, u, SIZE), vector(base, u, ALLOWED), u[EQUATIONS]
    errors, other, steepest = vector(base, u, ROUNDING), vector(base, u, OTHER), STEEPEST * math.sqrt(unit(u))
    for first in range(0, size.size, n):
        largest = 0.0
        for j in range(first, first + n):
            largest = max(largest, size[j])
        for j in range(first, first + n):
            allowed[j] = max(allowed[j], min(errors[j], other[j], steepest * largest))


def is_small(base: int, u: Any, times: float) -> bool:
    """Whether no residual is above so many times what is allowed."""
    r, size, allowed = vector(base, u, R), vector(base, u, SIZE), vector(base, u, ALLOWED)
    small = True
    for j in range(r.size):
        small = small and abs(r[j]) <= times * allowed[j] and size[j] < HUGE
    return small


def is_near(base: int, u: Any) -> bool:
    """Whether all residuals are so small that noise may make a part of them."""
    r, size, nominal = vector(base, u, R), vector(base, u, SIZE), vector(base, u, NOMINAL)
    near, least = True, math.sqrt(unit(u))
    for j in range(r.size):
        near = near and abs(r[j]) <= least * max(size[j], nominal[j])
    return near


def worst_of(base: int, u: Any) -> tuple[float, int]:
    """The largest residual over the size of its unknown, or what is no number; and the block of that unknown."""
    r, size = vector(base, u, R), vector(base, u, SIZE)
    worst, error = 0, 0.0
    for j in range(r.size):
        if not abs(r[j]) / size[j] <= error:
            worst, error = j, abs(r[j]) / size[j]
            if not error < HUGE:
                break
    return error, worst // u[EQUATIONS]


def progress(base: int, u: Any) -> float:
    """What a step has to lessen: the largest residual over what f adds up, so that no unknown hides behind another."""
    weight, r = vector(base, u, WEIGHT), vector(base, u, R)
    worst = 0.0
    for j in range(r.size):
        error = abs(r[j]) / weight[j]
        if not error < HUGE:
            return HUGE
        worst = max(worst, error)
    return worst


def are_numbers(base: int, u: Any) -> bool:
    """Whether f gives numbers."""
    f, held = vector(base, u, F), vector(base, u, HELD)
    numbers = True
    for j in range(f.size):
        numbers = numbers and (held[j] != 0.0 or abs(f[j]) < HUGE)
    return numbers


def all_answer(base: int, u: Any) -> bool:
    """Whether no unknown has come back as it was disturbed, as if nothing determined it."""
    f, trial, step, held = vector(base, u, F), vector(base, u, TRIAL), vector(base, u, MOVE), vector(base, u, HELD)
    answer, same = True, SAME * math.sqrt(unit(u))
    for j in range(f.size):
        answer = answer and (held[j] != 0.0 or abs(trial[j] - f[j] - step[j]) > same * abs(step[j]))
    return answer


def missed(before: float, left: float, unit: float) -> int:
    """How much a step by derivatives misses what they said, by what it has left of a residual."""
    if left <= FLOOR * unit:
        return MOST_MISSES  # differences alone tell what is rounding
    if left <= MISSED * before:
        return 0
    return 1 if left < before else MOST_MISSES


def pays(n: int, before: float, left: float, unit: float) -> bool:
    """Whether another step by the same slopes is cheaper than by those of n unknowns anew, which it takes twice."""
    rate = 2.0 * left / before if left <= AS_TOLD * before else 1.0
    for _ in range(2 * min(n, MOST_ITERATIONS) + 2):
        left *= rate
    return left <= unit


def take(base: int, u: Any, status: int) -> int:
    """What has been tried is what is. Returns the status."""
    f, trial = vector(base, u, F), vector(base, u, TRIAL)
    for j in range(f.size):
        f[j] = trial[j]
    return status

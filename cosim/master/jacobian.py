"""The matrix of an algebraic loop's equations, 1 - df/dz, and the steps that follow from it.

It is made column by column: an unknown of each block is moved by a difference, and f looked at there; `along` tangents,
if that is what foreign blocks give by their derivatives. Then nothing is said of rounding errors, which are f's alone.
One source, two engines, as in `loop.py`.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.machine.memory import reals_at, words_at
from cosim.master.linear import HUGE, balance, factor, substitute
from cosim.master.unknowns import (
    BLOCKS,
    DIVISORS,
    EQUATIONS,
    FUZZ,
    KEPT,
    LARGEST,
    MOVE,
    OTHER,
    PIVOTS,
    ROUNDING,
    ROW_DIVISORS,
    SIZE,
    TRIAL,
    WEIGHT,
    F,
    R,
    Z,
    block_at,
    is_quiet,
    matrices,
    matrix_at,
    unit,
    vector,
)

# A difference is the square root of the rounding unit, over the unknown's size.
COARSE = 2.0**-4  # one that is more exact where f is linear
ERRORS = 8.0  # rounding units of what f adds up: its rounding errors
NOISE = 4.0  # rounding units over a difference: of a matrix of relative changes, what differences make of a zero
DOUBTFUL = 1024.0  # rounding units over a difference: of a pivot, what differences may make of a zero
SINGULAR = 1024.0  # rounding units over a coarse difference: of a pivot, what those make of a zero
UNHEARD = 64.0  # times what of f is noise: of a pivot, what that makes of a zero, over a coarse difference
FAR = 2.0**-8  # of a pivot, what a coarse difference may make of a zero where f is rounded
NONE, DOUBT = -1, -2  # in place of a block that cannot be solved


def begin_sums(base: int, u: Any, along: bool) -> None:
    """Keep z; what f adds up, and unless `along` its rounding errors, before any slope is known."""
    z, f, kept, weight = vector(base, u, Z), vector(base, u, F), vector(base, u, KEPT), vector(base, u, WEIGHT)
    size, rounding, other = vector(base, u, SIZE), vector(base, u, ROUNDING), vector(base, u, OTHER)
    for j in range(z.size):
        kept[j], weight[j] = z[j], size[j]
        if not along:
            other[j] = rounding[j]
            rounding[j] = ERRORS * unit(u) * max(abs(z[j]), abs(f[j]))


def difference_at(z: float, size: float, difference: float) -> float:
    """A difference over the size of an unknown; away from zero where that is near, as f may end there."""
    if abs(z) < 0.5 * size:
        difference = abs(difference) if z >= 0.0 else -abs(difference)
    return difference * size


def fill_column(base: int, u: Any, column: int, noise: float, along: bool) -> None:
    """Write a column of each matrix: one unknown of each block has moved from KEPT, and f with them from F to TRIAL."""
    n, matrix = u[EQUATIONS], matrices(base, u)
    z, kept, f, trial = vector(base, u, Z), vector(base, u, KEPT), vector(base, u, F), vector(base, u, TRIAL)
    size, weight, rounding = vector(base, u, SIZE), vector(base, u, WEIGHT), vector(base, u, ROUNDING)
    fuzz = vector(base, u, FUZZ)
    for j in range(z.size):
        i = j % n
        p = j - i + column  # the unknown of the same block that has moved
        moved = z[p] - kept[p]
        slope = (trial[j] - f[j]) / moved if moved != 0.0 and abs(trial[j]) < HUGE else 0.0
        weight[j] += abs(slope) * size[p]
        if not along:
            rounding[j] += ERRORS * unit(u) * abs(slope * kept[p])
        entry = ((1.0 if i == column else 0.0) - slope) * size[p]
        counts = abs(entry) > max(noise * max(abs(kept[j]), abs(f[j])), UNHEARD / COARSE * fuzz[j])
        matrix[j * n + column] = entry / size[j] if counts else 0.0


def zero_of(base: int, u: Any) -> float:
    """Of a pivot, what coarse differences may make of a zero, beside the noise of f that is known."""
    size, fuzz = vector(base, u, SIZE), vector(base, u, FUZZ)
    zero = SINGULAR * unit(u)
    for j in range(size.size):
        zero = max(zero, UNHEARD * fuzz[j] / size[j])
    return zero / COARSE


def find_steps(alive: Any, base: int, u: Any, least: float) -> int:
    """Solve for the step of each block; alive: as of `linear`; least: a pivot above which there has to be one.

    Returns the first block that leaves an unknown undetermined, NONE, or DOUBT.
    """
    found = NONE if is_quiet(base, u) else DOUBT
    r, step, size = vector(base, u, R), vector(base, u, MOVE), vector(base, u, SIZE)
    for j in range(r.size):
        step[j] = r[j] / size[j]
    for b in range(u[BLOCKS]):
        pivot = eliminate(alive, base, u, b, least)
        if pivot == 0.0 and found < 0:
            found = b
        elif pivot < DOUBTFUL * math.sqrt(unit(u)) and found == NONE:
            found = DOUBT
    columns, rows = vector(base, u, DIVISORS), vector(base, u, ROW_DIVISORS)
    for j in range(r.size):
        step[j] *= size[j]
        columns[j] /= size[j]
        rows[j] *= size[j]
    return found


def find_again(base: int, u: Any, found: int) -> int:
    """Solve for the step of each block once more, from z on, with what `find_steps` has left. Returns what it found."""
    z, r, kept, step = vector(base, u, Z), vector(base, u, R), vector(base, u, KEPT), vector(base, u, MOVE)
    columns, rows, n = vector(base, u, DIVISORS), vector(base, u, ROW_DIVISORS), u[EQUATIONS]
    for j in range(r.size):
        kept[j] = z[j]
        step[j] = r[j] / rows[j]
    for b in range(u[BLOCKS]):
        pivots = words_at(block_at(base, u, PIVOTS, b), n)
        substitute(matrix_at(base, u, b), pivots, reals_at(block_at(base, u, MOVE, b), n), n)
    for j in range(r.size):
        step[j] /= columns[j]
    return found


def eliminate(alive: Any, base: int, u: Any, b: int, least: float) -> float:
    """Solve the equations of block b for its step. Returns the smallest pivot, 0.0 if one is not above `least`."""
    n, matrix = u[EQUATIONS], matrix_at(base, u, b)
    step, columns = reals_at(block_at(base, u, MOVE, b), n), reals_at(block_at(base, u, DIVISORS, b), n)
    pivots = words_at(block_at(base, u, PIVOTS, b), n)
    rows, largest = reals_at(block_at(base, u, ROW_DIVISORS, b), n), reals_at(block_at(base, u, LARGEST, b), n)
    balance(alive, matrix, step, columns, rows, largest, n)
    pivot = factor(alive, matrix, pivots, n, least)
    substitute(matrix, pivots, step, n)
    for j in range(n):
        step[j] /= columns[j]
    return pivot

"""Algebraic loops: find z = f(z), where f is what the rows of a loop give. Newton's method, with differences.

    begin at what is published
    repeat until the residual r = f(z) - z, or a step, is small against each unknown
        J = 1 - df/dz, column by column, by differences
        z + z' with J z' = r; where that leads astray, a part of z', and at last f(z)

The first time, its matrix is looked at where it has been solved: if that is singular, other values would do as well.
Equations of different members of a fleet that do not depend on each other are solved side by side. One source, two
engines, as in `loop.py`.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.machine.memory import reals_at, words_at
from cosim.master.linear import HUGE, factor, substitute
from cosim.master.tables import (
    AT,
    BLOCKS,
    EQUATIONS,
    OK,
    PIECE_WORDS,
    PIECES,
    ROW_BYTES,
    ROW_WORDS,
    ROWS,
    UNKNOWNS_VECTORS,
    UNKNOWNS_WORDS,
    UNSOLVED,
    WARNING,
    WORK,
    A,
    B,
    C,
    evaluate,
)

MOST_ITERATIONS = 50
TOLERANCE = 1e-13  # of a residual, or of a step, over the unknown's size
EPSILON = 2.0**-49  # of what f adds up: its rounding errors
STEEPEST = 1e-6  # of an unknown: beyond this, rounding errors are no excuse, as a jump looks like a slope
SETTLED = 3  # steps, after which an unknown that is far below the others may be rounding errors of theirs
DIFFERENCE = 2.0**-26  # over the unknown's size
NOISE = 2.0**-24  # of a matrix of relative changes: what differences make of a zero
SINGULAR = 2.0**-40  # of a pivot, where the largest of its row and column is 1
SMALLEST_PART = 2.0**-10  # of a step, that is tried where the whole leads astray
#: Vectors over all unknowns in a loop's work space; behind them a matrix for each block.
Z, F, R, STEP, KEPT, TRIAL, SIZE, ROUNDING, PIVOTS = range(UNKNOWNS_VECTORS)


def solve(c: Any, base: int, o: int, time: float, later: float) -> int:
    """Solve the loop of row o, as of a time (s). Returns the status."""
    u = unknowns(c, base, o)
    z, r, step = vector(base, u, Z), vector(base, u, R), vector(base, u, STEP)
    exchange(c, base, o, z, False)
    for j in range(z.size):
        if not abs(z[j]) < HUGE:
            z[j] = 0.0
    status = residual(c, base, o, time, later, F, R)
    checked = words_at(c[ROWS] + o * ROW_BYTES, ROW_WORDS)[C] == 0
    for iteration in range(MOST_ITERATIONS):
        measure(base, u)
        if status > WARNING or (checked and is_solved(base, u, r, iteration, False)):
            return status
        status = linearize(c, base, o, time, later, checked)
        if status > WARNING:
            return status
        regular = True
        for b in range(u[BLOCKS]):
            regular = solve_block(base, u, b) and regular
        if not regular and not checked and is_solved(base, u, r, iteration, False):  # any value would do
            break
        checked = True
        scale(base, u)
        small = error_of(step, vector(base, u, SIZE)) <= TOLERANCE or is_solved(base, u, r, iteration, True)
        if regular and small:
            return finish(c, base, o, time, later)
        status = step_on(c, base, o, time, later, regular)
    give_up(c, base, o)
    return UNSOLVED


def solve_block(base: int, u: Any, b: int) -> bool:
    """Solve the equations of block b for its step. Returns whether that can be."""
    columns = block_of(base, u, TRIAL, b)
    x, pivots = block_of(base, u, STEP, b), pivots_of(base, u, b)
    return eliminate(matrix_at(base, u, b), x, columns, pivots, u[EQUATIONS])


def finish(c: Any, base: int, o: int, time: float, later: float) -> int:
    """Take a last step, too small to be judged by f, which may be steep: the unknowns are z. Returns the status."""
    u = unknowns(c, base, o)
    z, step, r = vector(base, u, Z), vector(base, u, STEP), vector(base, u, R)
    for j in range(z.size):
        z[j] += step[j]
    status = residual(c, base, o, time, later, TRIAL, R)
    if status <= WARNING and error_of(r, vector(base, u, SIZE)) > STEEPEST:  # a jump looks like a slope
        give_up(c, base, o)
        return UNSOLVED
    exchange(c, base, o, z, True)
    return status


def give_up(c: Any, base: int, o: int) -> None:
    """Leave the error for whoever asks why, and nothing that might pass for a figure."""
    u = unknowns(c, base, o)
    z, f = vector(base, u, Z), vector(base, u, F)
    error = error_of(vector(base, u, R), vector(base, u, SIZE))
    for j in range(z.size):
        z[j] = math.nan
    exchange(c, base, o, z, True)
    f[0] = error
    c[AT] = o


def measure(base: int, u: Any) -> None:
    """The size of each unknown: of z, of f(z), or 1 where both are zero or no number."""
    z, f, size = vector(base, u, Z), vector(base, u, F), vector(base, u, SIZE)
    for j in range(z.size):
        size[j] = max(abs(z[j]), abs(f[j])) if abs(f[j]) < HUGE else abs(z[j])
        if size[j] == 0.0:
            size[j] = 1.0


def scale(base: int, u: Any) -> None:
    """A step out of one in sizes of the unknowns."""
    step, size = vector(base, u, STEP), vector(base, u, SIZE)
    for j in range(step.size):
        step[j] *= size[j]


def is_solved(base: int, u: Any, r: Any, iteration: int, rounding: bool) -> bool:
    """Whether a residual is small against the unknowns; after some steps, against the largest of a block.

    rounding: also if it is no larger than the rounding errors of what f adds up.
    """
    size, errors, n = vector(base, u, SIZE), vector(base, u, ROUNDING), u[EQUATIONS]
    for b in range(u[BLOCKS]):
        largest = largest_of(size, b * n, n)
        for i in range(b * n, b * n + n):
            against = largest if iteration >= SETTLED else size[i]
            allowed = TOLERANCE * against
            if rounding:
                allowed = max(allowed, min(errors[i], STEEPEST * against))
            if not (abs(r[i]) <= allowed and size[i] < HUGE):
                return False
    return True


def largest_of(size: Any, first: int, n: int) -> float:
    """The largest of n sizes."""
    largest = 0.0
    for i in range(first, first + n):
        largest = max(largest, size[i])
    return largest


def progress(base: int, u: Any) -> float:
    """What a step has to lessen: the largest residual; what is small beside others may be their rounding errors."""
    size, r, n = vector(base, u, SIZE), vector(base, u, R), u[EQUATIONS]
    worst = 0.0
    for b in range(u[BLOCKS]):
        floor = 0.001 * largest_of(size, b * n, n)
        for i in range(b * n, b * n + n):
            error = abs(r[i]) / max(size[i], floor)
            if not error < HUGE:
                return HUGE
            worst = max(worst, error)
    return worst


def linearize(c: Any, base: int, o: int, time: float, later: float, checked: bool) -> int:
    """The matrix of each block and the residual as right-hand side in STEP, all relative to sizes. Returns the status.

    checked: an unknown that comes back whatever it is, such as what a sampled block holds, stays as it is.
    """
    u = unknowns(c, base, o)
    n, z, f, r = u[EQUATIONS], vector(base, u, Z), vector(base, u, F), vector(base, u, R)
    step, kept, trial, size = (
        vector(base, u, STEP),
        vector(base, u, KEPT),
        vector(base, u, TRIAL),
        vector(base, u, SIZE),
    )
    for j in range(z.size):
        kept[j] = z[j]
    rounding = vector(base, u, ROUNDING)
    for j in range(z.size):
        rounding[j] = EPSILON * size[j]
    for column in range(n):
        for b in range(u[BLOCKS]):
            z[b * n + column] += DIFFERENCE * size[b * n + column]
        status = residual(c, base, o, time, later, TRIAL, STEP)
        if status > WARNING:
            return status
        for b in range(u[BLOCKS]):
            j = b * n + column
            matrix, difference = matrix_of(base, u, b), z[j] - kept[j]
            for i in range(n):
                slope = (trial[b * n + i] - f[b * n + i]) / difference
                rounding[b * n + i] += EPSILON * abs(slope) * size[j]
                entry = ((1.0 if i == column else 0.0) - slope) * size[j] / size[b * n + i]
                matrix[i * n + column] = entry if abs(entry) > NOISE else 0.0
            z[j] = kept[j]
    for b in range(u[BLOCKS]):
        matrix = matrix_of(base, u, b)
        for i in range(n):
            step[b * n + i] = r[b * n + i] / size[b * n + i]
            if checked and r[b * n + i] == 0.0 and is_zero(matrix, i * n, n):
                matrix[i * n + i] = 1.0
    return OK


def step_on(c: Any, base: int, o: int, time: float, later: float, regular: bool) -> int:
    """Take the step, or so much of it as makes the residual smaller, else go to f(z). Returns the status."""
    u = unknowns(c, base, o)
    z, f, step, kept = vector(base, u, Z), vector(base, u, F), vector(base, u, STEP), vector(base, u, KEPT)
    worst, part = progress(base, u), 1.0
    while regular and part >= SMALLEST_PART:
        for j in range(z.size):
            z[j] = kept[j] + part * step[j]
        status = residual(c, base, o, time, later, TRIAL, R)
        error = progress(base, u)
        if status > WARNING or error < worst or error <= TOLERANCE:
            return take(base, u, status)
        part *= 0.5
    for j in range(z.size):
        z[j] = f[j]
    return take(base, u, residual(c, base, o, time, later, TRIAL, R))


def take(base: int, u: Any, status: int) -> int:
    """What has been tried is what is. Returns the status."""
    f, trial = vector(base, u, F), vector(base, u, TRIAL)
    for j in range(f.size):
        f[j] = trial[j]
    return status


def residual(c: Any, base: int, o: int, time: float, later: float, to: int, over: int) -> int:
    """f(z) and f(z) - z, to two vectors; the unknowns are then f(z). Returns the status."""
    u = unknowns(c, base, o)
    z, f, r = vector(base, u, Z), vector(base, u, to), vector(base, u, over)
    rows = words_at(c[ROWS] + o * ROW_BYTES, ROW_WORDS)[B]
    exchange(c, base, o, z, True)
    status = evaluate(c, base, o + 1, o + 1 + rows, time, later)
    exchange(c, base, o, f, False)
    for j in range(z.size):
        r[j] = f[j] - z[j]
    return status


# ---- memory ----


def unknowns(c: Any, base: int, o: int) -> Any:
    """What row o says of the unknowns."""
    return words_at(base + words_at(c[ROWS] + o * ROW_BYTES, ROW_WORDS)[A], UNKNOWNS_WORDS)


def vector(base: int, u: Any, number: int) -> Any:
    """One of the vectors over all unknowns."""
    size = u[BLOCKS] * u[EQUATIONS]
    return reals_at(base + u[WORK] + number * size * 8, size)


def block_of(base: int, u: Any, number: int, b: int) -> Any:
    """The part of a vector that is block b's."""
    size, n = u[BLOCKS] * u[EQUATIONS], u[EQUATIONS]
    return reals_at(base + u[WORK] + (number * size + b * n) * 8, n)


def pivots_of(base: int, u: Any, b: int) -> Any:
    """Which rows of block b's matrix changed places."""
    size, n = u[BLOCKS] * u[EQUATIONS], u[EQUATIONS]
    return words_at(base + u[WORK] + (PIVOTS * size + b * n) * 8, n)


def matrix_at(base: int, u: Any, b: int) -> int:
    """The address of the matrix of block b."""
    size, n = u[BLOCKS] * u[EQUATIONS], u[EQUATIONS]
    at: int = base + u[WORK] + (UNKNOWNS_VECTORS * size + b * n * n) * 8
    return at


def matrix_of(base: int, u: Any, b: int) -> Any:
    """The matrix of block b, row by row."""
    return reals_at(matrix_at(base, u, b), u[EQUATIONS] * u[EQUATIONS])


def exchange(c: Any, base: int, o: int, values: Any, publish: bool) -> None:
    """The unknowns, block by block: to their places, or from there."""
    u, first = unknowns(c, base, o), words_at(c[ROWS] + o * ROW_BYTES, ROW_WORDS)[A] + UNKNOWNS_WORDS * 8
    j = 0
    for b in range(u[BLOCKS]):
        for p in range(u[PIECES]):
            piece = words_at(base + first + p * PIECE_WORDS * 8, PIECE_WORDS)
            numbers = reals_at(base + piece[0] + b * piece[1], piece[2])
            for i in range(piece[2]):
                if publish:
                    numbers[i] = values[j]
                else:
                    values[j] = numbers[i]
                j += 1


# ---- numbers ----


def error_of(r: Any, size: Any) -> float:
    """The largest residual, or step, over the unknown's size; HUGE where one is no number."""
    worst = 0.0
    for j in range(r.size):
        error = abs(r[j]) / size[j]
        if not error < HUGE:
            return HUGE
        worst = max(worst, error)
    return worst


def is_zero(matrix: Any, first: int, n: int) -> bool:
    """Whether n entries of a matrix are zero."""
    largest = 0.0
    for j in range(first, first + n):
        largest = max(largest, abs(matrix[j]))
    return largest == 0.0


def balance(matrix: Any, x: Any, columns: Any, n: int) -> None:
    """Make the largest entry of every row and then of every column 1; columns: what they are divided by."""
    for i in range(n):
        largest = 0.0
        for j in range(n):
            largest = max(largest, abs(matrix[i * n + j]))
        if 0.0 < largest < HUGE:
            x[i] /= largest
            for j in range(n):
                matrix[i * n + j] /= largest
    for j in range(n):
        largest = 0.0
        for i in range(n):
            largest = max(largest, abs(matrix[i * n + j]))
        columns[j] = largest if 0.0 < largest < HUGE else 1.0
        for i in range(n):
            matrix[i * n + j] /= columns[j]


def eliminate(at: int, x: Any, columns: Any, pivots: Any, n: int) -> bool:
    """Solve for x the equations whose matrix is at an address, in place. Returns whether that can be."""
    balance(reals_at(at, n * n), x, columns, n)
    if not factor(at, pivots, n, SINGULAR):
        return False
    substitute(at, pivots, x, n)
    for p in range(n):
        x[p] /= columns[p]
    return True

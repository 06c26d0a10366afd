"""Linear equations, dense, solved in place. One source, two engines, as in `loop.py`.

A matrix lies row by row at an address, and so it is walked: what is read is near, and a row is one vector. `alive` is a
word that counts on, as a large matrix takes long.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.machine.memory import reals_at

HUGE = 1e100  # from here on, a number is as good as none
SWEEPS = 6  # which bring 26 powers of ten to a few


def factor(alive: Any, at: int, pivots: Any, n: int, least: float) -> float:
    """Gauss's elimination with partial pivoting: a matrix into its factors, the rows that change places into `pivots`.

    Returns the smallest pivot, 0.0 if some unknown has none that is above `least` and a number: `substitute` makes that
    unknown zero.
    """
    smallest, regular = HUGE, True
    for p in range(n):
        alive[0] += 1
        pivot = p
        for i in range(p + 1, n):
            if abs(row(at, i, n)[p]) > abs(row(at, pivot, n)[p]):
                pivot = i
        pivots[p] = pivot
        if not least < abs(row(at, pivot, n)[p]) < HUGE:
            regular = False
            pivot = leave(at, p, n)
            pivots[p] = -1 - pivot
        own, other = row(at, p, n), row(at, pivot, n)
        smallest = min(smallest, abs(other[p]))
        if pivot != p:
            for j in range(n):
                kept = own[j]
                own[j] = other[j]
                other[j] = kept
        for i in range(p + 1, n):
            below = row(at, i, n)
            below[p] /= own[p]
            part = below[p]
            if part != 0.0:
                for j in range(p + 1, n):
                    below[j] -= part * own[j]
    return smallest if regular else 0.0


def leave(at: int, p: int, n: int) -> int:
    """Let unknown p be zero, which no equation left determines. Returns that equation, which said the least so far."""
    emptiest, least = p, HUGE
    for i in range(p, n):
        own = row(at, i, n)
        own[p] = 0.0
        largest = largest_of(own, p, n)
        if largest < least:
            emptiest, least = i, largest
    own = row(at, emptiest, n)
    for j in range(p, n):
        own[j] = 0.0
    own[p] = 1.0
    return emptiest


def substitute(at: int, pivots: Any, x: Any, n: int) -> None:
    """Solve for the right-hand side x, in place, with what `factor` has left."""
    for p in range(n):
        pivot = pivots[p] if pivots[p] >= 0 else -1 - pivots[p]
        kept = x[p]
        x[p] = x[pivot]
        x[pivot] = kept
    for i in range(n):
        own = row(at, i, n)
        for j in range(i):
            x[i] -= own[j] * x[j]
        if pivots[i] < 0:
            x[i] = 0.0
    for i in range(n - 1, -1, -1):
        own = row(at, i, n)
        for j in range(i + 1, n):
            x[i] -= own[j] * x[j]
        x[i] /= own[i]


def balance(alive: Any, at: int, x: Any, columns: Any, rows: Any, largest: Any, n: int) -> None:
    """Make the largest entries of all rows and columns about 1, by Ruiz's method, with the right-hand side x.

    columns, rows: what they are divided by; largest: a vector to work with. Zeros of which nothing tells the size are
    said to be of size 1, which may be far from it.
    """
    for j in range(n):
        columns[j] = rows[j] = 1.0
    for _ in range(SWEEPS if n > 1 else 1):
        alive[0] += 1
        for j in range(n):
            largest[j] = 0.0
        for i in range(n):
            own = row(at, i, n)
            by = divisor(largest_of(own, 0, n))
            x[i] /= by
            rows[i] *= by
            for j in range(n):
                own[j] /= by
                largest[j] = max(largest[j], abs(own[j]))
        for j in range(n):
            largest[j] = divisor(largest[j])
            columns[j] *= largest[j]
        for i in range(n):
            own = row(at, i, n)
            for j in range(n):
                own[j] /= largest[j]


def divisor(largest: float) -> float:
    """What a row or a column is divided by."""
    return math.sqrt(largest) if 0.0 < largest < HUGE else 1.0


def largest_of(own: Any, first: int, n: int) -> float:
    """The largest magnitude of a row from a place on."""
    largest = 0.0
    for j in range(first, n):
        largest = max(largest, abs(own[j]))
    return largest


def row(at: int, i: int, n: int) -> Any:
    """A row of a matrix."""
    return reals_at(at + i * n * 8, n)

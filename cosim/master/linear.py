"""Linear equations, dense, solved in place. One source, two engines, as in `loop.py`.

A matrix lies row by row at an address, and so it is walked: what is read is near, and a row is one vector.
"""

from __future__ import annotations

from typing import Any

from cosim.machine.memory import reals_at

HUGE = 1e100  # from here on, a number is as good as none


def factor(at: int, pivots: Any, n: int, least: float) -> bool:
    """Gauss's elimination with partial pivoting: a matrix into its factors, the rows that change places into `pivots`.

    Returns whether every pivot is above `least` and a number.
    """
    for p in range(n):
        pivot = p
        for i in range(p + 1, n):
            if abs(row(at, i, n)[p]) > abs(row(at, pivot, n)[p]):
                pivot = i
        pivots[p] = pivot
        own, other = row(at, p, n), row(at, pivot, n)
        if not least < abs(other[p]) < HUGE:
            return False
        if pivot != p:
            for j in range(n):
                kept = own[j]
                own[j] = other[j]
                other[j] = kept
        for i in range(p + 1, n):
            below = row(at, i, n)
            below[p] /= own[p]
            part = below[p]
            for j in range(p + 1, n):
                below[j] -= part * own[j]
    return True


def substitute(at: int, pivots: Any, x: Any, n: int) -> None:
    """Solve for the right-hand side x, in place, with what `factor` has left."""
    for p in range(n):
        kept = x[p]
        x[p] = x[pivots[p]]
        x[pivots[p]] = kept
    for i in range(n):
        own = row(at, i, n)
        for j in range(i):
            x[i] -= own[j] * x[j]
    for i in range(n - 1, -1, -1):
        own = row(at, i, n)
        for j in range(i + 1, n):
            x[i] -= own[j] * x[j]
        x[i] /= own[i]


def row(at: int, i: int, n: int) -> Any:
    """A row of a matrix."""
    return reals_at(at + i * n * 8, n)

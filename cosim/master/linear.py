"""Linear equations, dense, solved in place. A matrix lies row by row. One source, two engines, as in `loop.py`."""

from __future__ import annotations

from typing import Any

HUGE = 1e100  # from here on, a number is as good as none


def factor(matrix: Any, pivots: Any, n: int, least: float) -> bool:
    """Gauss's elimination with partial pivoting: a matrix into its factors, the rows that change places into `pivots`.

    Returns whether every pivot is above `least` and a number.
    """
    for p in range(n):
        pivot = p
        for i in range(p + 1, n):
            if abs(matrix[i * n + p]) > abs(matrix[pivot * n + p]):
                pivot = i
        if not least < abs(matrix[pivot * n + p]) < HUGE:
            return False
        pivots[p] = pivot
        if pivot != p:
            for j in range(n):
                kept = matrix[p * n + j]
                matrix[p * n + j] = matrix[pivot * n + j]
                matrix[pivot * n + j] = kept
        for i in range(p + 1, n):
            part = matrix[i * n + p] / matrix[p * n + p]
            matrix[i * n + p] = part
            for j in range(p + 1, n):
                matrix[i * n + j] -= part * matrix[p * n + j]
    return True


def substitute(matrix: Any, pivots: Any, x: Any, n: int) -> None:
    """Solve for the right-hand side x, in place, with what `factor` has left."""
    for p in range(n):
        kept = x[p]
        x[p] = x[pivots[p]]
        x[pivots[p]] = kept
    for p in range(n):
        for i in range(p + 1, n):
            x[i] -= matrix[i * n + p] * x[p]
    for p in range(n - 1, -1, -1):
        for j in range(p + 1, n):
            x[p] -= matrix[p * n + j] * x[j]
        x[p] /= matrix[p * n + p]

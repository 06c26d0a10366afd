"""What lowered functions call: plain loops, in the order in which both engines run them."""

from __future__ import annotations

from typing import Any


def same_size(size: int, needed: int) -> None:
    """Raises: ValueError where two axes that have to be equally long are not."""
    if size != needed:
        raise ValueError(f"an array of size {size} does not fit one of size {needed}")


def sign(x: float) -> float:
    """1, -1, or 0 as it is."""
    if x > 0.0:
        return 1.0
    if x < 0.0:
        return -1.0
    return x


def factorised(a: Any, lu: Any, rows: Any) -> bool:
    """L and U of a matrix, whose rows are exchanged so that each pivot is the largest; False where one is zero.

    rows: which row of the matrix each of L U is.
    """
    n = rows.size
    for i in range(n):
        rows[i] = i
        for j in range(n):
            lu[i, j] = a[i, j]
    for k in range(n):
        largest = k
        for i in range(k + 1, n):
            if abs(lu[i, k]) > abs(lu[largest, k]):
                largest = i
        if lu[largest, k] == 0.0:
            return False
        if largest != k:
            row = rows[k]
            rows[k] = rows[largest]
            rows[largest] = row
            for j in range(n):
                moved = lu[k, j]
                lu[k, j] = lu[largest, j]
                lu[largest, j] = moved
        for i in range(k + 1, n):
            factor = lu[i, k] / lu[k, k]
            lu[i, k] = factor
            for j in range(k + 1, n):
                lu[i, j] -= factor * lu[k, j]
    return True


def substituted(lu: Any, x: Any, column: int) -> None:
    """Solve L U x = b in place, for one column of b, whose rows are exchanged."""
    n = lu.shape[0]
    for i in range(n):
        total = x[i, column]
        for j in range(i):
            total -= lu[i, j] * x[j, column]
        x[i, column] = total
    for back in range(n):
        i = n - 1 - back
        total = x[i, column]
        for j in range(i + 1, n):
            total -= lu[i, j] * x[j, column]
        x[i, column] = total / lu[i, i]


def solved(lu: Any, rows: Any, b: Any, x: Any) -> None:
    """The solution of A x = b for a factorised A and a matrix b."""
    for j in range(x.shape[1]):
        for i in range(x.shape[0]):
            x[i, j] = b[rows[i], j]
        substituted(lu, x, j)


def solved_vector(lu: Any, rows: Any, b: Any, x: Any) -> None:
    """The same for a vector b, in the same order."""
    n = x.size
    for i in range(n):
        total = b[rows[i]]
        for j in range(i):
            total -= lu[i, j] * x[j]
        x[i] = total
    for back in range(n):
        i = n - 1 - back
        total = x[i]
        for j in range(i + 1, n):
            total -= lu[i, j] * x[j]
        x[i] = total / lu[i, i]


def inverted(lu: Any, rows: Any, x: Any) -> None:
    """The inverse of a factorised matrix."""
    for j in range(x.shape[1]):
        for i in range(x.shape[0]):
            x[i, j] = 1.0 if rows[i] == j else 0.0
        substituted(lu, x, j)

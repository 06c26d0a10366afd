"""Products and norms of vectors, as in (10), (13) and (33); sums begin with 0 and run from first to last."""

import math

from numpy.typing import NDArray


def dot(a: NDArray, b: NDArray) -> float:
    """a^T b; a, b: (n)."""
    total = 0.0
    for q in range(a.size):
        total += a[q] * b[q]
    return total


def norm(a: NDArray) -> float:
    """||a||; a: (n)."""
    return math.sqrt(dot(a, a))


def norm_of_difference(a: NDArray, b: NDArray) -> float:
    """||a - b||; a, b: (n)."""
    total = 0.0
    for q in range(a.size):
        total += (a[q] - b[q]) * (a[q] - b[q])
    return math.sqrt(total)


def norm_of_all(a: NDArray) -> float:
    """||[a_1; …; a_N]|| of a whole fleet; a: (robots, n)."""
    total = 0.0
    for i in range(a.shape[0]):
        square = 0.0
        for q in range(a.shape[1]):
            square += a[i, q] * a[i, q]
        total += square
    return math.sqrt(total)

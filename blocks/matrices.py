"""Riccati equations of small matrices, by doubling."""

import math

import numpy as np
from numpy.typing import NDArray

MOST_DOUBLINGS = 60


def double(a: NDArray, g: NDArray, h: NDArray) -> None:
    """Bring h to X = A^T X (I + G X)^-1 A + H, the discrete Riccati equation; a and g are used up.

    Structure-preserving doubling: Chu, Fan, Lin and Wang, Int. J. Control 77 (2004) 767–788. Raises: ValueError where
    it does not converge, as (A, B) cannot be stabilized.
    """
    for _ in range(MOST_DOUBLINGS):  # each squares what is left
        inverse = np.linalg.inv(np.eye(a.shape[0]) + g @ h)
        left = a @ inverse
        change = a.T @ h @ inverse @ a
        g += left @ g @ a.T
        h += change
        a[:] = left @ a
        largest = np.max(np.abs(h))
        if not largest < 1e100:
            raise ValueError("the Riccati equation has no solution: what the inputs do not reach is unstable")
        if np.max(np.abs(change)) <= 1e-15 * largest:
            return
    raise ValueError("the Riccati equation has no solution to which doubling converges")


def cayley(a: NDArray, g: NDArray, h: NDArray) -> None:
    """Bring A^T X + X A - X G X + H = 0, the continuous equation, to the discrete one with the same X."""
    gamma = 1.1 * (row_norm(a) + math.sqrt(row_norm(g) * row_norm(h))) + 1e-9
    shifted = a - gamma * np.eye(a.shape[0])
    inverse = np.linalg.inv(shifted)
    right = h @ inverse
    w = np.linalg.inv(shifted.T + right @ g)
    a[:] = np.eye(a.shape[0]) + 2.0 * gamma * w.T
    g[:] = 2.0 * gamma * (inverse @ g @ w)
    h[:] = 2.0 * gamma * (w @ right)


def row_norm(a: NDArray) -> float:
    """The largest sum of magnitudes in a row."""
    return np.max(np.sum(np.abs(a), axis=1))

"""Elimination against numpy, with rows that have to change places."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.master.linear import factor, substitute


def solved(matrix: np.ndarray, right: np.ndarray, least: float = 0.0) -> np.ndarray | None:
    n = len(matrix)
    mine, x, pivots = matrix.copy(), right.copy(), np.full(n, -1)
    if not factor(mine.ctypes.data, pivots, n, least):
        return None
    substitute(mine.ctypes.data, pivots, x, n)
    return x


@pytest.mark.parametrize("n", [1, 2, 3, 7, 40])
def test_solutions_are_those_of_linear_algebra(n):
    rng = np.random.default_rng(n)
    for _ in range(10):
        matrix, right = rng.normal(size=(n, n)), rng.normal(size=n)
        np.testing.assert_allclose(matrix @ solved(matrix, right), right, atol=1e-13 * np.linalg.cond(matrix))


def test_a_permutation_is_undone():
    """All diagonals are zero, so that every row changes its place, some of them twice."""
    matrix = np.eye(5)[[3, 0, 4, 1, 2]]
    assert solved(matrix, np.arange(5.0)).tolist() == [1.0, 3.0, 4.0, 0.0, 2.0]


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf, 1e-13])
def test_a_matrix_without_a_pivot_is_not_solved(bad):
    assert solved(np.array([[1.0, 2.0], [1.0, 2.0 + bad]]), np.ones(2), 1e-12) is None

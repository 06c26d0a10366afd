"""Elimination against numpy, with rows that have to change places."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.master.linear import balance, factor, substitute


def solved(matrix: np.ndarray, right: np.ndarray, least: float = 0.0) -> np.ndarray | None:
    n = len(matrix)
    mine, x, pivots = matrix.copy(), right.copy(), np.full(n, -1)
    if factor(np.zeros(1, np.int64), mine.ctypes.data, pivots, n, least) == 0.0:
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


def test_an_unknown_that_nothing_determines_is_zero_and_the_others_are_solved_for():
    """2 (x + y + z) = 6, and 4 w = 8 behind what contradicts that or says it again: one of x, y, z alone is 3."""
    matrix = np.array([[1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 0.0], [0.0, 0.0, 0.0, 4.0], [2.0, 2.0, 2.0, 0.0]])
    right, pivots, alive = np.array([3.0, 5.0, 8.0, 6.0]), np.full(4, -1), np.zeros(1, np.int64)
    assert factor(alive, matrix.ctypes.data, pivots, 4, 1e-12) == 0.0
    substitute(matrix.ctypes.data, pivots, right, 4)
    assert sorted(right[:3]) == [0.0, 0.0, 3.0] and right[3] == 2.0
    assert alive[0] == 4


@pytest.mark.parametrize("n", [2, 5, 20])
def test_a_balanced_matrix_has_entries_of_about_one_and_the_same_solutions(n):
    """Of rows and columns in units that are up to 24 powers of ten apart."""
    rng = np.random.default_rng(n)
    matrix = rng.uniform(0.5, 2.0, (n, n)) * 10.0 ** rng.integers(-12, 12, (n, 1)) * 10.0 ** rng.integers(-12, 12, n)
    mine, right = matrix.copy(), np.ones(n)
    columns, rows, largest = np.zeros((3, n))
    balance(np.zeros(1, np.int64), mine.ctypes.data, right, columns, rows, largest, n)
    for axis in (0, 1):
        assert (np.abs(np.abs(mine).max(axis) - 1.0) < 0.9).all()
    np.testing.assert_allclose(mine, matrix / rows[:, None] / columns, rtol=1e-13)
    np.testing.assert_allclose(right * rows, np.ones(n), rtol=1e-13)

"""Finds the robots near a robot, those of (5) for one, in a time that grows with the number of robots only.

A block keeps the grid of square cells as one work space::

    grid = Local("robots", FIELDS, dtype=np.int64, unit="1", description="work space: the cell grid")

There are as many buckets as robots, and cells share buckets by hashing, so that the plane needs no bounds.
"""

import math

from numpy.typing import NDArray

#: Up to so many robots, looking at every pair is faster.
SMALL = 32

#: What row i of a grid holds: column and row of robot i's cell, the first robot in bucket i (-1: none), the robot after
#: robot i in its bucket (-1: none), and the i-th robot that was found near another one.
COLUMN, ROW, HEAD, LINK, FOUND = range(5)
FIELDS = 5


def sort_into_cells(x: NDArray, reach: float, grid: NDArray) -> None:
    """Prepare the search for robots at x (robots, n) that are at most `reach` (m) apart."""
    robots = x.shape[0]
    if robots <= SMALL:
        return
    side = 1.001 * reach  # wider than the reach, so that a rounded quotient cannot put a near robot two cells away
    for bucket in range(robots):
        grid[bucket, HEAD] = -1
    for i in range(robots):
        grid[i, COLUMN] = math.floor(x[i, 0] / side)
        grid[i, ROW] = math.floor(x[i, 1] / side)
        bucket = bucket_of(grid[i, COLUMN], grid[i, ROW], robots)
        grid[i, LINK] = grid[bucket, HEAD]
        grid[bucket, HEAD] = i


def later_near(i: int, grid: NDArray) -> int:
    """Look for the robots j > i that may be within reach of i; returns how many there are for `later`.

    They are all that are within reach, and some that are not. Each pair is met once, from its smaller number.
    """
    robots = grid.shape[0]
    if robots <= SMALL:
        return robots - i - 1
    count = 0
    for column in range(grid[i, COLUMN] - 1, grid[i, COLUMN] + 2):
        for row in range(grid[i, ROW] - 1, grid[i, ROW] + 2):
            j = grid[bucket_of(column, row, robots), HEAD]
            while j >= 0:
                if j > i and grid[j, COLUMN] == column and grid[j, ROW] == row:
                    k = count
                    while k > 0 and grid[k - 1, FOUND] > j:
                        grid[k, FOUND] = grid[k - 1, FOUND]
                        k -= 1
                    grid[k, FOUND] = j
                    count += 1
                j = grid[j, LINK]
    return count


def later(k: int, i: int, grid: NDArray) -> int:
    """The k-th robot (from 0, ascending) that `later_near` found for i."""
    return i + 1 + k if grid.shape[0] <= SMALL else grid[k, FOUND]


def sees_all(x: NDArray, reach: float) -> bool:
    """Whether no two robots can be farther apart than `reach` (m), or the search looks at every pair anyway."""
    robots = x.shape[0]
    if robots <= SMALL:
        return True
    left, right, bottom, top = x[0, 0], x[0, 0], x[0, 1], x[0, 1]
    for i in range(robots):
        left, right = min(left, x[i, 0]), max(right, x[i, 0])
        bottom, top = min(bottom, x[i, 1]), max(top, x[i, 1])
    return (right - left) + (top - bottom) <= reach


def bucket_of(column: int, row: int, buckets: int) -> int:
    """The bucket of a cell."""
    return (column * 73_856_093 + row * 19_349_663) % buckets

"""Finds the robots near a robot through square cells, in a time that grows with the number of robots only.

A block keeps the grid as work space::

    cells = Local("robots", 2, dtype=np.int64)   # column and row of each robot's cell
    heads = Local("robots", dtype=np.int64)      # first robot of each bucket of cells, -1: empty
    links = Local("robots", dtype=np.int64)      # next robot of the same bucket, -1: the last
    found = Local("robots", dtype=np.int64)      # the answer for one robot

There are as many buckets as robots, and cells share buckets by hashing, so that the plane needs no bounds.
"""

import math

from numpy.typing import NDArray

#: Up to so many robots, looking at every pair is faster.
SMALL = 32


def sort_into_cells(x: NDArray, reach: float, cells: NDArray, heads: NDArray, links: NDArray) -> None:
    """Prepare the search for robots at x (robots, n) that are at most `reach` (m) apart."""
    robots = x.shape[0]
    if robots <= SMALL:
        return
    side = 1.001 * reach  # wider than the reach, so that a rounded quotient cannot put a near robot two cells away
    for i in range(robots):
        heads[i] = -1
    for i in range(robots):
        cells[i, 0] = math.floor(x[i, 0] / side)
        cells[i, 1] = math.floor(x[i, 1] / side)
        bucket = bucket_of(cells[i, 0], cells[i, 1], robots)
        links[i] = heads[bucket]
        heads[bucket] = i


def later_near(i: int, cells: NDArray, heads: NDArray, links: NDArray, found: NDArray) -> int:
    """Look for the robots j > i that may be within reach of i; returns how many there are for `later`.

    They are all that are within reach, and some that are not. Each pair is met once, from its smaller number.
    """
    robots = heads.size
    if robots <= SMALL:
        return robots - i - 1
    count = 0
    for column in range(cells[i, 0] - 1, cells[i, 0] + 2):
        for row in range(cells[i, 1] - 1, cells[i, 1] + 2):
            j = heads[bucket_of(column, row, robots)]
            while j >= 0:
                if j > i and cells[j, 0] == column and cells[j, 1] == row:
                    k = count
                    while k > 0 and found[k - 1] > j:
                        found[k] = found[k - 1]
                        k -= 1
                    found[k] = j
                    count += 1
                j = links[j]
    return count


def later(k: int, i: int, found: NDArray) -> int:
    """The k-th robot (from 0, ascending) that `later_near` found for i."""
    return i + 1 + k if found.size <= SMALL else found[k]


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

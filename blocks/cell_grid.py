"""Finds the robots near a robot, those of (5) for one, in a time that grows with the number of robots only.

Who is near whom is listed, with a skin: those too that are a little farther away than asked. As long as nobody has
moved by half of the skin, whoever is near is in the list, and nothing is searched. A block keeps two work spaces::

    grid = Local("robots", FIELDS, dtype=np.int64, unit="1", description="work space: who is near whom")
    searched = Local("robots", SEARCHED, finite=False, description="work space: where robots were searched")

The search is one in square cells. There are as many buckets as robots, and cells share buckets by hashing, so that the
plane needs no bounds.
"""

import math

from numpy.typing import NDArray

from cosim.blocks.distance import planar_square, surely_beyond

#: Up to so many robots, looking at every pair is faster.
SMALL = 32
#: So many later robots are listed with each; who has more near is searched for at every call.
LISTED = 16
#: How much farther than asked robots are listed, relative.
SKIN = 0.2

#: What row i of a grid holds: column and row of robot i's cell, the first robot in bucket i (-1: none), the robot after
#: robot i in its bucket (-1: none), the i-th robot that was found near another one, how many are listed with robot i
#: (-1: too many), and these.
COLUMN, ROW, HEAD, LINK, FOUND, COUNT, FIRST = range(7)
FIELDS = FIRST + LISTED
#: What row i of `searched` holds: where robot i was; row 0 also within which distance all are listed.
ACROSS, ALONG, REACH = range(3)
SEARCHED = 3


def look_around(x: NDArray, reach: float, grid: NDArray, searched: NDArray) -> float:
    """List the robots at x (robots, n) that are at most `reach` (m) apart; returns within which distance all are."""
    robots = x.shape[0]
    if robots <= SMALL:
        return reach
    if searched[0, REACH] >= reach and have_stayed(x, searched):
        return searched[0, REACH]
    searched[0, REACH] = 0.0  # nothing is listed where a search comes to no end
    sort_into_cells(x, (1.0 + SKIN) * reach, grid)
    for i in range(robots):
        list_later(i, x, (1.0 + SKIN) * reach, grid)
        searched[i, ACROSS], searched[i, ALONG], searched[i, REACH] = x[i, 0], x[i, 1], reach
    return reach


def have_stayed(x: NDArray, searched: NDArray) -> bool:
    """Whether no robot has moved by half of the skin since they were searched."""
    most = 0.5 * SKIN * searched[0, REACH]
    for i in range(x.shape[0]):
        across, along = x[i, 0] - searched[i, ACROSS], x[i, 1] - searched[i, ALONG]
        if not across * across + along * along <= most * most:
            return False
    return True


def sort_into_cells(x: NDArray, reach: float, grid: NDArray) -> None:
    """Prepare the search for robots at x (robots, n) that are at most `reach` (m) apart."""
    robots = x.shape[0]
    side = 1.001 * reach  # wider than the reach, so that a rounded quotient cannot put a near robot two cells away
    for bucket in range(robots):
        grid[bucket, HEAD] = -1
    for i in range(robots):
        grid[i, COLUMN] = math.floor(x[i, 0] / side)
        grid[i, ROW] = math.floor(x[i, 1] / side)
        bucket = bucket_of(grid[i, COLUMN], grid[i, ROW], robots)
        grid[i, LINK] = grid[bucket, HEAD]
        grid[bucket, HEAD] = i


def list_later(i: int, x: NDArray, reach: float, grid: NDArray) -> None:
    """List the robots j > i that are at most `reach` (m) from robot i, by their number."""
    count = 0
    for k in range(find_later(i, grid)):
        j = grid[k, FOUND]
        if surely_beyond(planar_square(x, i, j), reach):
            continue
        if count == LISTED:
            grid[i, COUNT] = -1
            return
        grid[i, FIRST + count] = j
        count += 1
    grid[i, COUNT] = count


def find_later(i: int, grid: NDArray) -> int:
    """Search the robots j > i in the nine cells around robot i; returns how many were FOUND, by their number."""
    robots = grid.shape[0]
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


def later_near(i: int, grid: NDArray) -> int:
    """How many robots j > i there are for `later`: all that are within reach of i, and some that are not.

    Each pair is met once, from its smaller number.
    """
    robots = grid.shape[0]
    if robots <= SMALL:
        return robots - i - 1
    return grid[i, COUNT] if grid[i, COUNT] >= 0 else find_later(i, grid)


def later(k: int, i: int, grid: NDArray) -> int:
    """The k-th robot (from 0, ascending) that `later_near` has for i."""
    if grid.shape[0] <= SMALL:
        return i + 1 + k
    return grid[i, FIRST + k] if grid[i, COUNT] >= 0 else grid[k, FOUND]


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

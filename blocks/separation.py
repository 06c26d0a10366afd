"""How near robots come to each other, Section IV."""

import math

import numpy as np
from numpy.typing import NDArray

from cosim import Course, Dimension, Input, Local, Measure, Output, Parameter, State, condition, rule
from cosim.blocks.agreement import radii_agree
from cosim.blocks.cell_grid import FIELDS, SEARCHED, later, later_near, look_around, sees_all
from cosim.blocks.distance import planar_square, surely_beyond


def rows_used(collisions: NDArray) -> int:
    """How many rows of the table hold a pair; they come first, a NaN marks the others."""
    used = 0
    while used < collisions.shape[0] and collisions[used, 0] > 0.0:
        used += 1
    return used


def has_row(collisions: NDArray, used: int, i: int, j: int) -> bool:
    """Whether the robots i < j (numbers from 0) are among the first `used` rows of the table."""
    listed = False
    for k in range(used):
        listed = listed or (collisions[k, 0] == i + 1 and collisions[k, 1] == j + 1)
    return listed


def everything_listed(unlisted: Course, collision_capacity: int) -> tuple[bool, str]:
    """Whether the table of collisions had a row for every pair."""
    count = int(unlisted.largest)
    if count == 0:
        return True, ""
    return False, (
        f"the first {collision_capacity} are listed; at t = {unlisted.largest_at:.4g} s, {count} more touched: "
        f"raise `collision_capacity` under this block's dimensions"
    )


class Separation(Measure):
    """The smallest gap ||z_ij|| - R_i - R_j over all pairs of robots, and which pairs collided when, Section IV.

    ::

        x ─► min_gap       exact: near robots are found through a cell grid, whose reach is doubled until no pair
          ─► collisions    beyond it can be nearer than the nearest one within it
          ─► unlisted

    A pair collides when its gap is first 0 or less; it gets a row [i, j, time] with the robots' numbers i < j from 1.
    When all rows are used, `unlisted` counts the pairs that touch and have none.
    """

    collision_capacity = Dimension(default=20, description="how many pairs that collide are listed")

    x = Input("robots", "n", description="positions; the first two channels are planar")
    radii = Parameter("robots", unit="m", description="radius R_i of each robot")
    grid = Local("robots", FIELDS, dtype=np.int64, unit="1", description="work space: who is near whom")
    searched = Local("robots", SEARCHED, unit="m", finite=False, description="work space: where robots were searched")
    min_gap = Output(unit="m", finite=False, description="smallest gap of all pairs; infinite for a single robot")
    unlisted = Output(dtype=np.int64, unit="1", description="how many pairs touch that have no row and get none")
    collisions = Output("collision_capacity", 3, finite=False, description="rows [i, j, time] so far; NaN where none")
    listed = State("collision_capacity", 3, start=math.nan, finite=False, description="the rows before this instant")

    positive = rule("radii > 0")(lambda radii: min(radii) > 0.0)
    same = rule("radii as the plant has them, if x is a plant's")(radii_agree)
    complete = condition("every pair that collides is listed")(everything_listed)

    def outputs(time, x, radii, listed, grid, searched, min_gap, unlisted, collisions):
        largest = 0.0
        for i in range(radii.size):
            largest = max(largest, radii[i])
        reach = 8.0 * largest
        before = rows_used(listed)
        collisions.fill(math.nan)
        for k in range(before):
            for q in range(3):
                collisions[k, q] = listed[k, q]
        while True:
            reach = look_around(x, reach, grid, searched)
            smallest = math.inf
            used, without = before, 0
            for i in range(x.shape[0]):
                for k in range(later_near(i, grid)):
                    j = later(k, i, grid)
                    square = planar_square(x, i, j)
                    if surely_beyond(square, max(smallest, 0.0) + radii[i] + radii[j]):
                        continue
                    gap = math.sqrt(square) - radii[i] - radii[j]
                    smallest = min(smallest, gap)
                    if gap > 0.0 or has_row(listed, before, i, j):
                        continue
                    if used < collisions.shape[0]:
                        collisions[used, 0], collisions[used, 1], collisions[used, 2] = i + 1, j + 1, time
                        used += 1
                    else:
                        without += 1
            if smallest <= reach - 2.0 * largest or sees_all(x, reach):
                break
            reach *= 2.0
        min_gap[0] = smallest
        unlisted[0] = without

    def update(collisions, next_listed):
        for k in range(rows_used(next_listed), rows_used(collisions)):
            for q in range(3):
                next_listed[k, q] = collisions[k, q]

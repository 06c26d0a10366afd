"""How near robots come to each other."""

import math

import numpy as np
from numpy.typing import NDArray

from blocks.cell_grid import later, later_near, sees_all, sort_into_cells
from blocks.distance import planar_square, surely_beyond
from cosim.block import Dimension, Input, Local, Measure, Output, Parameter, State, rule


def remember(pairs: NDArray, i: int, j: int) -> None:
    """Write a pair to the first free row, marked by a 0 in its first column.

    Raises: ValueError if there is none.
    """
    for k in range(pairs.shape[0]):
        if pairs[k, 0] == 0:
            pairs[k, 0] = i + 1
            pairs[k, 1] = j + 1
            return
    raise ValueError("more pairs of robots collide than `collision_capacity`: raise it under this block's dimensions")


def forget(pairs: NDArray) -> None:
    """Free all rows; used ones come first."""
    for k in range(pairs.shape[0]):
        if pairs[k, 0] == 0:
            return
        pairs[k, 0] = 0


def note(i: int, j: int, time: float, collisions: NDArray) -> None:
    """Write a pair that collides to the first free row, marked by a NaN, unless it has a row.

    Raises: ValueError if there is none.
    """
    for k in range(collisions.shape[0]):
        if not collisions[k, 0] > 0.0:
            collisions[k, 0] = i
            collisions[k, 1] = j
            collisions[k, 2] = time
            return
        if collisions[k, 0] == i and collisions[k, 1] == j:
            return
    raise ValueError("more pairs of robots collided than `collision_capacity`: raise it under this block's dimensions")


class Separation(Measure):
    """The smallest gap ||z_ij|| - R_i - R_j over all pairs of robots, and which pairs collided when.

    ::

        x ─► min_gap       exact: near robots are found through a cell grid, whose reach is doubled until no pair
          ─► collisions    beyond it can be nearer than the nearest one within it

    A pair collides when its gap is first 0 or less; it gets a row [i, j, time] with the robots' numbers i < j from 1.
    """

    collision_capacity = Dimension(default=20, description="how many pairs may collide in a run")

    x = Input("robots", "n", description="positions; the first two channels are planar")
    radii = Parameter("robots", unit="m", description="radius R_i of each robot")
    cells = Local("robots", 2, dtype=np.int64, unit="1", description="work space: cell of each robot")
    heads = Local("robots", dtype=np.int64, unit="1", description="work space: first robot of each bucket")
    links = Local("robots", dtype=np.int64, unit="1", description="work space: next robot of a bucket")
    found = Local("robots", dtype=np.int64, unit="1", description="work space: robots near one robot")
    touching = Local(
        "collision_capacity", 2, dtype=np.int32, unit="1", description="pairs that touch, numbers from 1; 0: none"
    )
    min_gap = Output(unit="m", description="smallest gap of all pairs; infinite for a single robot")
    collisions = State(
        "collision_capacity", 3, output=True, start=math.nan, description="rows [i, j, time]; NaN where none"
    )

    positive = rule("radii > 0")(lambda radii: min(radii) > 0.0)

    def outputs(x, radii, cells, heads, links, found, touching, min_gap):
        largest = 0.0
        for i in range(radii.size):
            largest = max(largest, radii[i])
        reach = 8.0 * largest
        while True:
            sort_into_cells(x, reach, cells, heads, links)
            forget(touching)
            smallest = math.inf
            for i in range(x.shape[0]):
                for k in range(later_near(i, cells, heads, links, found)):
                    j = later(k, i, found)
                    square = planar_square(x, i, j)
                    if surely_beyond(square, max(smallest, 0.0) + radii[i] + radii[j]):
                        continue
                    gap = math.sqrt(square) - radii[i] - radii[j]
                    smallest = min(smallest, gap)
                    if gap <= 0.0:
                        remember(touching, i, j)
            if smallest <= reach - 2.0 * largest or sees_all(x, reach):
                min_gap[0] = smallest
                return
            reach *= 2.0

    def update(time, touching, next_collisions):
        for k in range(touching.shape[0]):
            if touching[k, 0] == 0:
                return
            note(touching[k, 0], touching[k, 1], time, next_collisions)

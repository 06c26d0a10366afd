"""The communication graph that grows edges between robots that are near each other, (5)."""

import math

import numpy as np

from cosim import Block, Dimension, Input, Local, Output, Parameter, rule
from cosim.blocks.adjacency import add_neighbour, begin_with_static, is_heard, names_robots, strongly_connected
from cosim.blocks.cell_grid import FIELDS, SEARCHED, later, later_near, look_around
from cosim.blocks.distance import planar_square, surely_beyond


def fading_weight(distance: float, eta_1: float, eta_2: float, eta_3: float) -> float:
    """f(||z||), (44): eta_1 for near robots, falling to 0 around the distance eta_3 (m) with the steepness eta_2 (1/m).

    Written so that no exponential overflows.
    """
    z = eta_2 * (distance - eta_3)
    if z < 0.0:
        return eta_1 / (1.0 + math.exp(z))
    near = math.exp(-z)
    return eta_1 * near / (1.0 + near)


class RangeTopology(Block):
    """The static graph G1 and a range-based graph G2: A = A_1 + A_2, (5) and (44).

    ::

        x ─► neighbours, weights       a_ij = 1             where i hears j in G1
                                       a_ij = f(||z_ij||)   else, for ||z_ij|| <= R_c
                                       a_ij = 0             else
    """

    capacity = Dimension(default=8, description="how many robots one robot can hear at once")

    x = Input("robots", "n", description="positions; the first two channels are planar")
    hears = Parameter("robots", "heard", dtype=np.int32, unit="1", description="whom each robot hears; 0: nobody")
    eta_1 = Parameter(unit="1", default=0.2, description="weight of a near robot")
    eta_2 = Parameter(unit="1/m", default=14.0, description="steepness of the weight's fall")
    eta_3 = Parameter(unit="m", default=1.1, description="distance of half the weight")
    R_c = Parameter(unit="m", default=1.5, description="communication range")
    grid = Local("robots", FIELDS, dtype=np.int64, unit="1", description="work space: who is near whom")
    searched = Local("robots", SEARCHED, unit="m", finite=False, description="work space: where robots were searched")
    count = Local("robots", dtype=np.int32, unit="1", description="number of neighbours")
    neighbours = Output("robots", "capacity", dtype=np.int32, unit="1", description="neighbours from 0; -1: none")
    weights = Output("robots", "capacity", unit="1", description="a_ij of each neighbour j")

    range_rule = rule("R_c > 0 and 0 < eta_1 <= 1", "eq. 5")(lambda R_c, eta_1: R_c > 0.0 and 0.0 < eta_1 <= 1.0)
    falling = rule("eta_2 > 0 and eta_3 > 0", "eq. 44")(lambda eta_2, eta_3: eta_2 > 0.0 and eta_3 > 0.0)
    numbers = rule("every robot hears other robots, each once", "Section II-B")(names_robots)
    connected = rule("a strongly connected static graph G1", "Section II-B, Lemma 2")(strongly_connected)

    def outputs(x, hears, eta_1, eta_2, eta_3, R_c, grid, searched, count, neighbours, weights):
        begin_with_static(hears, count, neighbours, weights)
        look_around(x, R_c, grid, searched)
        for i in range(x.shape[0]):
            for k in range(later_near(i, grid)):
                j = later(k, i, grid)
                square = planar_square(x, i, j)
                if surely_beyond(square, R_c):
                    continue
                distance = math.sqrt(square)
                if distance <= R_c:
                    weight = fading_weight(distance, eta_1, eta_2, eta_3)
                    if not is_heard(hears, i, j):
                        add_neighbour(i, j, weight, count, neighbours, weights)
                    if not is_heard(hears, j, i):
                        add_neighbour(j, i, weight, count, neighbours, weights)

"""The static communication graph, Section II-B."""

import numpy as np

from cosim import Block, Dimension, Input, Local, Output, Parameter, rule
from cosim.blocks.adjacency import begin_with_static, names_robots, strongly_connected


class StaticTopology(Block):
    """The static directed graph G1: robot i hears j, a_ij = 1, wherever they are (Section II-B).

    ::

        x ─► neighbours, weights
    """

    capacity = Dimension(default=8, description="how many robots one robot can hear at once")

    x = Input("robots", "n", description="positions; they tell the number of robots, and nothing else")
    hears = Parameter("robots", "heard", dtype=np.int32, unit="1", description="whom each robot hears; 0: nobody")
    count = Local("robots", dtype=np.int32, unit="1", description="number of neighbours")
    neighbours = Output("robots", "capacity", dtype=np.int32, unit="1", description="neighbours from 0; -1: none")
    weights = Output("robots", "capacity", unit="1", description="a_ij of each neighbour j")

    numbers = rule("every robot hears other robots, each once", "Section II-B")(names_robots)
    connected = rule("a strongly connected static graph G1", "Section II-B, Lemma 2")(strongly_connected)

    def outputs(hears, count, neighbours, weights):
        begin_with_static(hears, count, neighbours, weights)

"""The weights of chosen edges that robots' nearness made, (5)."""

import numpy as np
from numpy.typing import NDArray

from cosim import Input, Measure, Output, Parameter, rule
from cosim.blocks.adjacency import is_heard
from cosim.blocks.agreement import agrees


def edges_are_pairs(edges: NDArray, robots: int) -> tuple[bool, str]:
    """Whether each edge names two different robots."""
    wrong = [edge for edge in edges.tolist() if edge[0] == edge[1] or not all(1 <= i <= robots for i in edge)]
    return not wrong, f"wrong: {wrong}"


class EdgeWeights(Measure):
    """The elements a_ij of A_2, (5), for listed edges [i, j]: how much i hears j by range; 0 for edges of G1."""

    neighbours = Input("robots", "capacity", dtype=np.int32, unit="1", description="neighbours from 0; -1: none")
    weights = Input("robots", "capacity", unit="1", description="a_ij of each neighbour j")
    hears = Parameter("robots", "heard", dtype=np.int32, unit="1", description="whom each robot hears in G1; 0: nobody")
    edges = Parameter("listed", 2, dtype=np.int32, unit="1", description="edges as robots' numbers, from 1: i hears j")
    a_2 = Output("listed", unit="1", description="element a_ij of A_2 of each edge")

    graph = rule("hears as the topology has it", "eq. 5")(lambda neighbours, hears: agrees(neighbours, hears=hears))
    numbers = rule("edges between two different robots")(edges_are_pairs)

    def outputs(neighbours, weights, hears, edges, a_2):
        for k in range(a_2.size):
            i, j = edges[k, 0] - 1, edges[k, 1] - 1
            a_2[k] = 0.0
            if is_heard(hears, i, j):
                continue
            for slot in range(neighbours.shape[1]):
                if neighbours[i, slot] == j:
                    a_2[k] = weights[i, slot]

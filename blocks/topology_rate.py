"""How fast the range-based part of a network changes, (44)."""

import math

import numpy as np

from cosim import Input, Measure, Output, Parameter, condition, rule
from cosim.blocks.agreement import agrees
from cosim.blocks.distance import planar_distance
from cosim.blocks.stability_conditions import formation_reached_along, topology_slow_along


class TopologyRate(Measure):
    """The Frobenius norms of L_2 and of its derivative, by which Theorem 3 bounds a run (Assumption 3).

    ::

        x, v, neighbours, weights ─► L_2, dL_2

        d a_ij/dt = f'(||z_ij||) z_ij (v_i - v_j)/||z_ij||,    f' = -eta_2 f (1 - f/eta_1)                       (44)

    for the edges of G2; those of weight 1 are G1's. At R_c, where (44) jumps to 0 by less than 0.1 % of a weight of 1
    with the paper's values, it is the derivative on the inner side.
    """

    x = Input("robots", "n", description="positions; the first two channels are planar")
    v = Input("robots", "n", description="true velocities")
    neighbours = Input("robots", "capacity", dtype=np.int32, unit="1", description="neighbours from 0; -1: none")
    weights = Input("robots", "capacity", unit="1", description="a_ij of each neighbour j")
    s_hat = Input("robots", "n", only="s_hat", description="of the controller with whose gains Theorem 3 is judged")
    eta_1 = Parameter(unit="1", default=0.2, description="weight of a near robot")
    eta_2 = Parameter(unit="1/m", default=14.0, description="steepness of the weight's fall")
    L_2 = Output(unit="1", description="||L_2||")
    dL_2 = Output(unit="1/s", description="||dL_2/dt||")

    same = rule("eta_1 and eta_2 as the topology has them", "eq. 44")(
        lambda weights, eta_1, eta_2: agrees(weights, eta_1=eta_1, eta_2=eta_2)
    )
    reached = condition("c sigma(Q_1)/2 - sigma_max(P_1) L_M/sigma(L_1 + B) > 0 along the run", "Theorem 3")(
        formation_reached_along
    )
    slow = condition("sigma(Lambda) - L_M/sigma(L_1 + B) > 0 along the run", "Theorem 3")(topology_slow_along)

    def outputs(x, v, neighbours, weights, eta_1, eta_2, L_2, dL_2):
        square, square_of_rate = 0.0, 0.0
        for i in range(neighbours.shape[0]):
            degree, rate_of_degree = 0.0, 0.0
            for k in range(neighbours.shape[1]):
                j = neighbours[i, k]
                if j < 0:
                    break
                a = weights[i, k]
                if a == 1.0:
                    continue
                distance = planar_distance(x, i, j)
                approach = (x[i, 0] - x[j, 0]) * (v[i, 0] - v[j, 0]) + (x[i, 1] - x[j, 1]) * (v[i, 1] - v[j, 1])
                rate = -eta_2 * a * (1.0 - a / eta_1) * approach / distance if distance > 0.0 else 0.0  # (44)
                degree += a
                rate_of_degree += rate
                square += a * a
                square_of_rate += rate * rate
            square += degree * degree
            square_of_rate += rate_of_degree * rate_of_degree
        L_2[0] = math.sqrt(square)
        dL_2[0] = math.sqrt(square_of_rate)

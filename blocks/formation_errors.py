"""How well the formation is kept."""

import math

import numpy as np

from cosim.authoring.block import Measure
from cosim.authoring.rules import rule
from cosim.authoring.variables import Input, Local, Output, Parameter
from cosim.blocks.agreement import agrees
from cosim.blocks.consensus import local_errors


class FormationErrors(Measure):
    """The formation's errors as the true velocities show them, norms over the whole fleet, Fig. 7.

    ::

        delta_x = ||x - x_d||,   e_x = ||((L + B) ⊗ I)(x - x_d)||                              (24), (26)
        S = ||e_v + (Lambda ⊗ I) e_x||,   e_v = ((L + B) ⊗ I)(v - dx_d)                        (28)
        S_hat: the same with what the robots know of v and dx_d, as their controller found it  (31)
    """

    x = Input("robots", "n", description="positions")
    v = Input("robots", "n", description="true velocities")
    x_d = Input("robots", "n", description="position references")
    dx_d = Input("robots", "n", description="true first derivatives of x_d")
    s_hat = Input("robots", "n", only="s_hat", description="estimated sliding variables")
    neighbours = Input("robots", "capacity", dtype=np.int32, unit="1", description="neighbours from 0; -1: none")
    weights = Input("robots", "capacity", unit="1", description="a_ij of each neighbour j")
    lambda_ = Parameter("robots", unit="1/s", default=2.0, description="slope of each robot's sliding variable")
    b = Parameter("robots", unit="1", default=2.0, description="weight of each robot's own reference")
    local_x = Local("robots", "n", description="local formation tracking errors")
    local_v = Local("robots", "n", description="local velocity tracking errors")
    delta_x = Output(description="norm of the position tracking errors")
    e_x = Output(description="norm of the local formation tracking errors")
    S = Output(description="norm of the sliding variables")
    S_hat = Output(description="norm of the estimated sliding variables")

    gains = rule("lambda_ and b as the controller has them", "eq. 28")(
        lambda s_hat, lambda_, b: agrees(s_hat, lambda_=lambda_, b=b)
    )

    def outputs(x, v, x_d, dx_d, s_hat, neighbours, weights, lambda_, b, local_x, local_v, delta_x, e_x, S, S_hat):
        robots, n = x.shape
        local_errors(x, x_d, v, dx_d, neighbours, weights, b, local_x, local_v)
        all_delta, all_e, all_s, all_s_hat = 0.0, 0.0, 0.0, 0.0
        for i in range(robots):
            of_delta, of_e, of_s, of_s_hat = 0.0, 0.0, 0.0, 0.0
            for q in range(n):
                delta = x[i, q] - x_d[i, q]
                e = local_x[i, q]
                s = local_v[i, q] + lambda_[i] * e
                of_delta += delta * delta
                of_e += e * e
                of_s += s * s
                of_s_hat += s_hat[i, q] * s_hat[i, q]
            all_delta += of_delta
            all_e += of_e
            all_s += of_s
            all_s_hat += of_s_hat
        delta_x[0] = math.sqrt(all_delta)
        e_x[0] = math.sqrt(all_e)
        S[0] = math.sqrt(all_s)
        S_hat[0] = math.sqrt(all_s_hat)

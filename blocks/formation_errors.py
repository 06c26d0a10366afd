"""How well the formation is kept, (24) to (31)."""

import numpy as np

from cosim import Input, Local, Measure, Output, Parameter, rule
from cosim.blocks.agreement import agrees
from cosim.blocks.consensus import local_errors
from cosim.blocks.vectors import norm_of_all


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
    tracking_x = Local("robots", "n", description="position tracking errors")
    tracking_v = Local("robots", "n", description="velocity tracking errors")
    local_x = Local("robots", "n", description="local formation tracking errors")
    local_v = Local("robots", "n", description="local velocity tracking errors")
    sliding = Local("robots", "n", description="sliding variables")
    delta_x = Output(description="norm of the position tracking errors")
    e_x = Output(description="norm of the local formation tracking errors")
    S = Output(description="norm of the sliding variables")
    S_hat = Output(description="norm of the estimated sliding variables")

    gains = rule("lambda_ and b as the controller has them", "eq. 28")(
        lambda s_hat, lambda_, b: agrees(s_hat, lambda_=lambda_, b=b)
    )

    def outputs(
        x, v, x_d, dx_d, s_hat, neighbours, weights,
        lambda_, b,
        tracking_x, tracking_v, local_x, local_v, sliding, delta_x, e_x, S, S_hat,
    ):  # fmt: skip
        robots, n = x.shape
        for i in range(robots):
            for q in range(n):
                tracking_x[i, q] = x[i, q] - x_d[i, q]  # (24)
                tracking_v[i, q] = v[i, q] - dx_d[i, q]  # (24)
        local_errors(tracking_x, tracking_v, neighbours, weights, b, local_x, local_v)  # (26)
        for i in range(robots):
            for q in range(n):
                sliding[i, q] = local_v[i, q] + lambda_[i] * local_x[i, q]  # (27)
        delta_x[0] = norm_of_all(tracking_x)
        e_x[0] = norm_of_all(local_x)
        S[0] = norm_of_all(sliding)  # (28)
        S_hat[0] = norm_of_all(s_hat)  # (31)

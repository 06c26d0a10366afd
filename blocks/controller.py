"""The controller that keeps the formation, (33)."""

import numpy as np

from cosim import Block, Input, Local, Output, Parameter, condition, rule
from cosim.blocks.consensus import local_errors
from cosim.blocks.stability_conditions import (
    formation_reached,
    network_covers_reference,
    references_apart,
    topology_slow,
)
from cosim.blocks.vectors import dot


class SlidingModeController(Block):
    """Robust sliding-mode formation control with limited information, (26), (30) and (33), for all robots.

    ::

        x, x_d               ──►┌────────────┐
        v_hat, w_hat         ──►│            │
        xi_2, xi_3           ──►│ controller │──► u
        F, g_inverse         ──►│            │
        neighbours, weights  ──►└────────────┘

        delta_x = x - x_d,   delta_v = v_hat - xi_2                                       (24), (30)
        e_x = ((L + B) ⊗ I) delta_x,   e_v = ((L + B) ⊗ I) delta_v                        (26), (30)
        s_hat_i = e_v_i + lambda_i e_x_i                                                        (30)
        u_i = g_i^-1 (-c s_hat_i - w_hat_i - lambda_i delta_v_i - delta_x_i + xi_3_i + F_i)     (33)

    A robot uses what it measures and estimates itself, and what its neighbours tell.
    """

    x = Input("robots", "n", description="measured positions")
    x_d = Input("robots", "n", description="position references")
    v_hat = Input("robots", "n", description="estimated velocities")
    w_hat = Input("robots", "n", description="estimated uncertainties")
    xi_2 = Input("robots", "n", description="estimated first derivatives of x_d")
    xi_3 = Input("robots", "n", description="estimated second derivatives of x_d")
    F = Input("robots", "n", description="repulsive forces")
    g_inverse = Input("robots", "n", "n", description="inverses of the control gains")
    neighbours = Input("robots", "capacity", dtype=np.int32, unit="1", description="neighbours from 0; -1: none")
    weights = Input("robots", "capacity", unit="1", description="a_ij of each neighbour j")
    c = Parameter(unit="1/s", default=2.0, description="gain of the sliding variable")
    lambda_ = Parameter("robots", unit="1/s", default=2.0, description="slope of each robot's sliding variable")
    b = Parameter("robots", unit="1", default=2.0, description="weight of each robot's own reference")
    delta_x = Local("robots", "n", description="position tracking errors")
    delta_v = Local("robots", "n", description="estimated velocity tracking errors")
    e_x = Local("robots", "n", description="local formation tracking errors")
    e_v = Local("robots", "n", description="estimated local velocity tracking errors")
    s_hat = Local("robots", "n", description="estimated sliding variables")
    gu = Local("robots", "n", description="g_i u_i, the accelerations that the control inputs cause")
    u = Output("robots", "n", description="control inputs")

    positive = rule("c > 0 and lambda_ > 0", "eqs. 27 and 33")(lambda c, lambda_: c > 0.0 and min(lambda_) > 0.0)
    pinned = rule("b >= 0, and b > 0 for at least one robot", "Lemma 2")(lambda b: min(b) >= 0.0 and max(b) > 0.0)
    reached = condition("c sigma(Q_1)/2 - sigma_max(P_1) L_M/sigma(L_1 + B) > 0", "Theorem 3")(formation_reached)
    slow = condition("sigma(Lambda) - L_M/sigma(L_1 + B) > 0", "Theorem 3")(topology_slow)
    apart = condition("references farther apart than the outer boundary of the potential", "Definition 2, eq. 36")(
        references_apart
    )
    covered = condition("the reference stays within one width of the observer's neurons until the end", "Remark 5")(
        network_covers_reference
    )

    def outputs(
        x, x_d, v_hat, w_hat, xi_2, xi_3, F, g_inverse, neighbours, weights,
        c, lambda_, b,
        delta_x, delta_v, e_x, e_v, s_hat, gu, u,
    ):  # fmt: skip
        robots, n = x.shape
        for i in range(robots):
            for q in range(n):
                delta_x[i, q] = x[i, q] - x_d[i, q]  # (24)
                delta_v[i, q] = v_hat[i, q] - xi_2[i, q]  # (30)
        local_errors(delta_x, delta_v, neighbours, weights, b, e_x, e_v)  # (26), (30)
        for i in range(robots):
            for q in range(n):
                s_hat[i, q] = e_v[i, q] + lambda_[i] * e_x[i, q]  # (30)
                gu[i, q] = (  # (33)
                    xi_3[i, q] - w_hat[i, q] - lambda_[i] * delta_v[i, q] - delta_x[i, q] - c * s_hat[i, q] + F[i, q]
                )
            for q in range(n):
                u[i, q] = dot(g_inverse[i, q], gu[i])  # (33)

"""Collision avoidance by control barrier functions: the least change of a control input that keeps robots apart."""

import math

import numpy as np

from cosim import Block, Input, Local, Output, Parameter, rule
from cosim.blocks.agreement import radii_agree
from cosim.blocks.distance import planar_distance
from cosim.blocks.half_planes import least_violating
from cosim.blocks.vectors import dot


class ControlBarrierFilter(Block):
    """Safety filter by exponential control barrier functions, between a controller and the robots.

    ::

        u                 ──►┌────────┐──► u_safe = u + g^-1 (a - a_0),   a_0 = g u + w_hat
        x, v_hat, w_hat   ──►│ filter │
        g, g_inverse      ──►│        │──► violation      0 where all conditions can be kept
        neighbours        ──►└────────┘──► infeasible

        a: the planar acceleration of at most `limit` that is nearest to a_0 and for each neighbour j has
        z^T a >= -(||nu||^2 + (p_1 + p_2) z^T nu + p_1 p_2 h / 2) / 2,    z = x_i - x_j,   nu = v_hat_i - v_hat_j

    The barrier is h = ||z||^2 - (epsilon_1 (R_i + R_j))^2. Each robot does its half; with both, d^2h/dt^2 + (p_1 + p_2)
    dh/dt + p_1 p_2 h >= 0: h stays above zero where it and dh/dt + p_1 h begin there. The quadratic program has two
    unknowns and is solved exactly, see `half_planes`; where nothing keeps all conditions, what misses them least is
    taken, and `violation` is by how much. Nguyen and Sreenath, Exponential control barrier functions, American Control
    Conference (2016) 322–328; for each robot by itself: Wang, Ames and Egerstedt, IEEE Transactions on Robotics 33
    (2017) 661–674.
    """

    x = Input("robots", "n", description="positions; the first two channels are planar")
    v_hat = Input("robots", "n", description="estimated velocities")
    w_hat = Input("robots", "n", description="estimated uncertainties")
    u = Input("robots", "n", description="wanted control inputs")
    g = Input("robots", "n", "n", description="control gains")
    g_inverse = Input("robots", "n", "n", description="inverses of the control gains")
    neighbours = Input("robots", "capacity", dtype=np.int32, unit="1", description="neighbours from 0; -1: none")
    radii = Parameter("robots", unit="m", description="radius R_i of each robot")
    epsilon_1 = Parameter(unit="1", default=1.1, description="minimal safe distance over R_i + R_j")
    p_1 = Parameter(unit="1/s", default=4.0, description="rate at which the barrier may be approached")
    p_2 = Parameter(unit="1/s", default=8.0, description="rate at which that rate may be reached")
    limit = Parameter(unit="m/s2", default=math.inf, description="largest planar acceleration")
    normals = Local("capacity", 2, unit="1", finite=False, description="work space: directions of the conditions")
    offsets = Local(
        "capacity", finite=False, description="work space: what the acceleration has to be in these directions"
    )
    u_safe = Output("robots", "n", description="control inputs")
    violation = Output("robots", unit="m/s2", description="by how much the nearest condition is missed")
    infeasible = Output(
        "robots",
        dtype=bool,
        unit="1",
        description="whether no acceleration keeps all conditions",
        event="no acceleration keeps the conditions for all neighbours: the least violating one is taken",
    )

    positive = rule("radii, p_1, p_2, limit > 0")(lambda radii, p_1, p_2, limit: min(*radii, p_1, p_2, limit) > 0.0)
    same = rule("radii as the plant has them, if x is a plant's", "Definition 2")(radii_agree)

    def outputs(
        x, v_hat, w_hat, u, g, g_inverse, neighbours,
        radii, epsilon_1, p_1, p_2, limit,
        normals, offsets, u_safe, violation, infeasible,
    ):  # fmt: skip
        for i in range(x.shape[0]):
            count = 0
            for k in range(neighbours.shape[1]):
                j = neighbours[i, k]
                if j < 0:
                    break
                distance = planar_distance(x, i, j)
                if distance == 0.0:
                    continue
                across, along = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1]
                nu_x, nu_y = v_hat[i, 0] - v_hat[j, 0], v_hat[i, 1] - v_hat[j, 1]
                safe = epsilon_1 * (radii[i] + radii[j])
                closing = (p_1 + p_2) * (across * nu_x + along * nu_y)
                barrier = p_1 * p_2 * (distance * distance - safe * safe)
                normals[count, 0], normals[count, 1] = across / distance, along / distance
                offsets[count] = -0.5 * (nu_x * nu_x + nu_y * nu_y + closing + 0.5 * barrier) / distance
                count += 1
            a_x, a_y = dot(g[i, 0], u[i]) + w_hat[i, 0], dot(g[i, 1], u[i]) + w_hat[i, 1]
            new_x, new_y, violation[i] = least_violating(a_x, a_y, normals, offsets, count, limit)
            infeasible[i] = violation[i] > 0.0
            for q in range(x.shape[1]):
                change = g_inverse[i, q, 0] * (new_x - a_x) + g_inverse[i, q, 1] * (new_y - a_y)
                u_safe[i, q] = u[i, q] + change

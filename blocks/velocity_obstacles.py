"""Collision avoidance by reciprocal velocity obstacles (ORCA)."""

import math

import numpy as np

from cosim import Block, Input, Local, Output, Parameter, rule
from cosim.blocks.agreement import radii_agree
from cosim.blocks.half_planes import least_violating
from cosim.blocks.vectors import dot


def nearest_border(
    p_x: float, p_y: float, nu_x: float, nu_y: float, reach: float, horizon: float
) -> tuple[float, float, float]:
    """The tangent n · nu = c of a velocity obstacle at the point of its border nearest to the relative velocity nu.

    The obstacle of a robot at p (m), relative to us, holds the velocities, ours relative to its, that bring us within
    `reach` (m) before `horizon` (s): a disc about p / horizon and what lies behind it. n points out of it.
    Returns: n, c.
    """
    square = p_x * p_x + p_y * p_y - reach * reach
    w_x, w_y = nu_x - p_x / horizon, nu_y - p_y / horizon
    size = math.sqrt(w_x * w_x + w_y * w_y)
    ahead = w_x * p_x + w_y * p_y
    if square > 0.0 and (ahead >= 0.0 or ahead * ahead <= reach * reach * size * size):
        leg = math.sqrt(square)
        side = 1.0 if p_x * w_y - p_y * w_x > 0.0 else -1.0
        distance_squared = square + reach * reach
        n_x = (-p_x * reach - side * p_y * leg) / distance_squared
        n_y = (-p_y * reach + side * p_x * leg) / distance_squared
        return n_x, n_y, 0.0
    if size == 0.0:
        return 1.0, 0.0, p_x / horizon + reach / horizon
    n_x, n_y = w_x / size, w_y / size
    return n_x, n_y, (n_x * p_x + n_y * p_y + reach) / horizon


class VelocityObstacles(Block):
    """Optimal reciprocal collision avoidance (ORCA), between a controller and the robots, for each by itself.

    ::

        u                 ──►┌────────┐──► u_safe = u + g^-1 (v - v_0) / T,   v_0 = v_hat + T (g u + w_hat)
        x, v_hat, w_hat   ──►│ filter │
        g, g_inverse      ──►│        │──► violation      0 where all half-planes have a point in common
        neighbours        ──►└────────┘──► infeasible

        v: the planar velocity of at most `limit` that is nearest to v_0 and for each neighbour j has
        n^T (v - v_hat_i) >= (c - n^T nu) / 2,     nu = v_hat_i - v_hat_j

    where n^T nu = c touches the velocity obstacle of j where it is nearest to nu: each robot does half of what it takes
    to have no collision of discs of epsilon_1 R within `horizon`. The robot is of second order: it would have v_0 after
    the time T, and takes on v in its place. Touching discs are parted within T. Where the half-planes have no point in
    common, what misses them least is taken. Van den Berg, Guy, Lin and Manocha, Reciprocal n-body collision avoidance,
    Robotics Research (2011) 3–19.
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
    horizon = Parameter(unit="s", default=1.0, description="how far it looks ahead")
    T = Parameter(unit="s", default=0.1, description="time in which a velocity is taken on")
    limit = Parameter(unit="m/s", default=math.inf, description="largest planar velocity")
    normals = Local("capacity", 2, unit="1", finite=False, description="work space: normals of the half-planes")
    offsets = Local("capacity", unit="m/s", finite=False, description="work space: their distances from the origin")
    u_safe = Output("robots", "n", description="control inputs")
    violation = Output("robots", unit="m/s", description="by how much the nearest half-plane is missed")
    infeasible = Output(
        "robots",
        dtype=bool,
        unit="1",
        description="whether no velocity lies in all half-planes",
        event="no velocity lies in the half-planes of all neighbours: the least violating one is taken",
    )

    positive = rule("radii, horizon, T, limit > 0")(
        lambda radii, horizon, T, limit: min(*radii, horizon, T, limit) > 0.0
    )
    same = rule("radii as the plant has them, if x is a plant's", "Definition 2")(radii_agree)

    def outputs(
        x, v_hat, w_hat, u, g, g_inverse, neighbours,
        radii, epsilon_1, horizon, T, limit,
        normals, offsets, u_safe, violation, infeasible,
    ):  # fmt: skip
        for i in range(x.shape[0]):
            count = 0
            for k in range(neighbours.shape[1]):
                j = neighbours[i, k]
                if j < 0:
                    break
                p_x, p_y = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1]
                nu_x, nu_y = v_hat[i, 0] - v_hat[j, 0], v_hat[i, 1] - v_hat[j, 1]
                reach = epsilon_1 * (radii[i] + radii[j])
                ahead = horizon if p_x * p_x + p_y * p_y > reach * reach else T
                n_x, n_y, c = nearest_border(p_x, p_y, nu_x, nu_y, reach, ahead)
                normals[count, 0], normals[count, 1] = n_x, n_y
                change = 0.5 * (c - n_x * nu_x - n_y * nu_y)
                offsets[count] = n_x * v_hat[i, 0] + n_y * v_hat[i, 1] + change
                count += 1
            v_x = v_hat[i, 0] + T * (dot(g[i, 0], u[i]) + w_hat[i, 0])
            v_y = v_hat[i, 1] + T * (dot(g[i, 1], u[i]) + w_hat[i, 1])
            new_x, new_y, violation[i] = least_violating(v_x, v_y, normals, offsets, count, limit)
            infeasible[i] = violation[i] > 0.0
            for q in range(x.shape[1]):
                change = (g_inverse[i, q, 0] * (new_x - v_x) + g_inverse[i, q, 1] * (new_y - v_y)) / T
                u_safe[i, q] = u[i, q] + change

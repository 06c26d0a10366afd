"""How well the formation is kept."""

import math

import numpy as np
from numpy.typing import NDArray

from blocks.consensus import local_error
from cosim.block import Input, Local, Measure, Output, Parameter


def norm(values: NDArray) -> float:
    """The Euclidean norm of all elements of a matrix."""
    square = 0.0
    for i in range(values.shape[0]):
        row = 0.0
        for q in range(values.shape[1]):
            row += values[i, q] * values[i, q]
        square += row
    return math.sqrt(square)


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
    s_hat = Input("robots", "n", description="estimated sliding variables")
    neighbours = Input("robots", "capacity", dtype=np.int32, unit="1", description="neighbours from 0; -1: none")
    weights = Input("robots", "capacity", unit="1", description="a_ij of each neighbour j")
    lambda_ = Parameter("robots", unit="1/s", default=2.0, description="slope of each robot's sliding variable")
    b = Parameter("robots", unit="1", default=2.0, description="weight of each robot's own reference")
    errors = Local("robots", "n", description="tracking errors: x - x_d, then v - dx_d")
    local_x = Local("robots", "n", description="local formation tracking errors")
    local_v = Local("robots", "n", description="local velocity tracking errors, then sliding variables")
    delta_x = Output(description="norm of the position tracking errors")
    e_x = Output(description="norm of the local formation tracking errors")
    S = Output(description="norm of the sliding variables")
    S_hat = Output(description="norm of the estimated sliding variables")

    def outputs(
        x, v, x_d, dx_d, s_hat, neighbours, weights, lambda_, b, errors, local_x, local_v, delta_x, e_x, S, S_hat
    ):
        robots, n = x.shape
        for i in range(robots):
            for q in range(n):
                errors[i, q] = x[i, q] - x_d[i, q]
        delta_x[0] = norm(errors)
        local_error(errors, neighbours, weights, b, local_x)
        e_x[0] = norm(local_x)
        for i in range(robots):
            for q in range(n):
                errors[i, q] = v[i, q] - dx_d[i, q]
        local_error(errors, neighbours, weights, b, local_v)
        for i in range(robots):
            for q in range(n):
                local_v[i, q] += lambda_[i] * local_x[i, q]
        S[0] = norm(local_v)
        S_hat[0] = norm(s_hat)

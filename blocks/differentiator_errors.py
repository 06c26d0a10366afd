"""How well differentiators differentiate."""

import math

from numpy.typing import NDArray

from cosim.authoring.block import Measure
from cosim.authoring.variables import Input, Output


def largest_norm(estimate: NDArray, truth: NDArray) -> float:
    """The largest ||estimate_i - truth_i|| of all rows; both (robots, n)."""
    largest = 0.0
    for i in range(truth.shape[0]):
        square = 0.0
        for q in range(truth.shape[1]):
            square += (estimate[i, q] - truth[i, q]) * (estimate[i, q] - truth[i, q])
        largest = max(largest, square)
    return math.sqrt(largest)


class DifferentiatorErrors(Measure):
    """The largest errors of any robot's differentiator: ||xi_2 - dx_d/dt|| and ||xi_3 - d2x_d/dt2||, 0 by Lemma 6."""

    xi_2 = Input("robots", "n", description="estimated first derivatives of x_d")
    xi_3 = Input("robots", "n", description="estimated second derivatives of x_d")
    dx_d = Input("robots", "n", description="true first derivatives of x_d")
    ddx_d = Input("robots", "n", description="true second derivatives of x_d")
    first = Output(description="largest norm of a first derivative's error")
    second = Output(description="largest norm of a second derivative's error")

    def outputs(xi_2, xi_3, dx_d, ddx_d, first, second):
        first[0] = largest_norm(xi_2, dx_d)
        second[0] = largest_norm(xi_3, ddx_d)

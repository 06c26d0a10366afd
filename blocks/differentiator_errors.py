"""How well differentiators (29) differentiate."""

from numpy.typing import NDArray

from cosim import Input, Measure, Output
from cosim.blocks.vectors import norm_of_difference


def largest_norm(estimate: NDArray, truth: NDArray) -> float:
    """max_i ||estimate_i - truth_i||, 0 by Lemma 6; both (robots, n)."""
    largest = 0.0
    for i in range(truth.shape[0]):
        largest = max(largest, norm_of_difference(estimate[i], truth[i]))
    return largest


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

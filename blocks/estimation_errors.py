"""How well observers (10), (45) estimate."""

from numpy.typing import NDArray

from cosim import Input, Measure, Output
from cosim.blocks.vectors import norm_of_difference


def sum_of_norms(estimate: NDArray, truth: NDArray) -> float:
    """sum_i ||estimate_i - truth_i||, as of N_x, N_v and N_w in Section IV; both (robots, n)."""
    total = 0.0
    for i in range(truth.shape[0]):
        total += norm_of_difference(estimate[i], truth[i])
    return total


class EstimationErrors(Measure):
    """The observers' errors, summed over the fleet, Section IV.

    ::

        N_x = sum_i ||x_i - x_hat_i||,   N_v = sum_i ||v_i - v_hat_i||,   N_w = sum_i ||w_i - w_hat_i||
    """

    x = Input("robots", "n", description="true positions")
    v = Input("robots", "n", description="true velocities")
    w = Input("robots", "n", description="true uncertainties")
    x_hat = Input("robots", "n", description="estimated positions")
    v_hat = Input("robots", "n", description="estimated velocities")
    w_hat = Input("robots", "n", description="estimated uncertainties")
    N_x = Output(description="sum of the norms of the position estimates' errors")
    N_v = Output(description="sum of the norms of the velocity estimates' errors")
    N_w = Output(description="sum of the norms of the uncertainty estimates' errors")

    def outputs(x, v, w, x_hat, v_hat, w_hat, N_x, N_v, N_w):
        N_x[0] = sum_of_norms(x_hat, x)
        N_v[0] = sum_of_norms(v_hat, v)
        N_w[0] = sum_of_norms(w_hat, w)

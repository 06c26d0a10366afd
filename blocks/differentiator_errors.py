"""How well differentiators differentiate."""

import math

from cosim.block import Input, Measure, Output


class DifferentiatorErrors(Measure):
    """The differentiators' errors over the whole fleet: norms of xi_2 - dx_d/dt and xi_3 - d2x_d/dt2 (Lemma 6)."""

    xi_2 = Input("robots", "n", description="estimated first derivatives of x_d")
    xi_3 = Input("robots", "n", description="estimated second derivatives of x_d")
    dx_d = Input("robots", "n", description="true first derivatives of x_d")
    ddx_d = Input("robots", "n", description="true second derivatives of x_d")
    first = Output(description="norm of the errors of the first derivatives")
    second = Output(description="norm of the errors of the second derivatives")

    def outputs(xi_2, xi_3, dx_d, ddx_d, first, second):
        square_1, square_2 = 0.0, 0.0
        for i in range(xi_2.shape[0]):
            for q in range(xi_2.shape[1]):
                square_1 += (xi_2[i, q] - dx_d[i, q]) * (xi_2[i, q] - dx_d[i, q])
                square_2 += (xi_3[i, q] - ddx_d[i, q]) * (xi_3[i, q] - ddx_d[i, q])
        first[0] = math.sqrt(square_1)
        second[0] = math.sqrt(square_2)

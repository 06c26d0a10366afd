"""What a motor can give."""

from numpy.typing import NDArray

from cosim.authoring.block import Block
from cosim.authoring.rules import rule
from cosim.authoring.variables import Input, Output, Parameter


class ForceLimit(Block):
    """Each force, cut off at plus and minus `limit`.

    ::

        u ─► limited       limited_q = min(max(u_q, -limit), limit)
    """

    u = Input("n", unit="N", description="wanted forces")
    limit = Parameter(unit="N", description="largest force")
    limited = Output("n", unit="N", description="forces that the motors give")

    positive = rule("limit > 0")(lambda limit: limit > 0.0)

    def outputs(u: NDArray, limit: float, limited: NDArray):
        for q in range(u.size):
            limited[q] = min(max(u[q], -limit), limit)

"""What a motor can give, of the forces u of (42)."""

from cosim import Block, Input, Output, Parameter, rule


class ForceLimit(Block):
    """Each force, cut off at plus and minus `limit`; the paper's motors have no limit, (42).

    ::

        u ─► limited       limited_q = min(max(u_q, -limit), limit)
    """

    u = Input("n", unit="N", description="wanted forces")
    limit = Parameter(unit="N", description="largest force")
    limited = Output("n", unit="N", description="forces that the motors give")

    positive = rule("limit > 0")(lambda limit: limit > 0.0)

    def outputs(u, limit, limited):
        for q in range(u.size):
            limited[q] = min(max(u[q], -limit), limit)

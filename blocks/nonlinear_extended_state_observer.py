"""The extended-state observer with nonlinear gains, of active disturbance rejection control."""

import math

from cosim import Block, Dimension, Input, Local, Output, Parameter, State, rule
from cosim.blocks.linear_observers import write_estimates
from cosim.blocks.signed_power import signed_power
from cosim.blocks.vectors import dot


def fal(e: float, exponent: float, delta: float) -> float:
    """Han's gain: sgn(e) |e|^exponent beyond delta, and linear within, e / delta^(1 - exponent)."""
    if abs(e) > delta:
        return signed_power(e, exponent)
    return e / math.pow(delta, 1.0 - exponent)


class NonlinearExtendedStateObserver(Block):
    """The nonlinear extended-state observer (NESO): small errors are corrected by larger gains; of any order.

    ::

        x ──►┌──────────┐──► x_hat = z_1     dz_k/dt = z_(k+1) + beta_k fal(e, exponent_k, delta),   e = x - z_1
        u ──►│ observer │──► v_hat = z_2     dz_n/dt = w_hat + g u + beta_n fal(e, exponent_n, delta)
        g ──►└──────────┘──► w_hat           dw_hat/dt = beta_(n+1) fal(e, exponent_(n+1), delta)

        fal(e, a, delta) = sgn(e) |e|^a     for |e| > delta,    e / delta^(1-a)   else

    Han, From PID to active disturbance rejection control, IEEE Transactions on Industrial Electronics 56 (2009)
    900–906. At the start z_1 = x(0), the others are 0.
    """

    order = Dimension(of="layers", less=1, description="how many integrators lie between g u + w and x")

    x = Input("n", description="measured position")
    u = Input("n", description="control input")
    g = Input("n", "n", description="known control gain")
    beta = Parameter("layers", default=(60.0, 400.0, 1000.0), description="gains beta_1 … beta_(n+1)")
    exponent = Parameter("layers", unit="1", default=(1.0, 0.5, 0.25), description="exponents of the layers")
    delta = Parameter(default=0.01, description="error up to which the gains are linear")
    z = State("order", "n", output=True, description="estimates of x and its derivatives")
    w_hat = State("n", output=True, description="estimate of the uncertainty")
    e = Local("n", description="x - z_1")
    x_hat = Output("n", description="estimate of the position")
    v_hat = Output("n", description="estimate of the velocity")

    positive = rule("beta > 0 and delta > 0")(lambda beta, delta: min(*beta, delta) > 0.0)
    powers = rule("0 < exponent <= 1")(lambda exponent: min(exponent) > 0.0 and max(exponent) <= 1.0)

    def start(x, z):
        for q in range(x.size):
            z[0, q] = x[q]

    def outputs_error(x, z, e):
        for q in range(x.size):
            e[q] = x[q] - z[0, q]

    def outputs(z, x_hat, v_hat):
        write_estimates(z, x_hat, v_hat)

    def derivatives(u, g, z, w_hat, e, beta, exponent, delta, d_z, d_w_hat):
        n = z.shape[0]
        for q in range(e.size):
            for k in range(n - 1):
                d_z[k, q] = z[k + 1, q] + beta[k] * fal(e[q], exponent[k], delta)
            d_z[n - 1, q] = w_hat[q] + beta[n - 1] * fal(e[q], exponent[n - 1], delta) + dot(g[q], u)
            d_w_hat[q] = beta[n] * fal(e[q], exponent[n], delta)

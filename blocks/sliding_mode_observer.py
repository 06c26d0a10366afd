"""All derivatives and the uncertainty of a chain of integrators by a higher-order sliding mode."""

import math

from cosim import Block, CalculatedParameter, Dimension, Input, Local, Output, Parameter, State, rule
from cosim.blocks.levant_gains import write_gains
from cosim.blocks.linear_observers import write_estimates
from cosim.blocks.signed_power import sign
from cosim.blocks.vectors import dot


class SlidingModeObserver(Block):
    """Higher-order sliding-mode observer of d^n x/dt^n = w + g u: exact after a finite time; of any order n.

    ::

        x ──►┌──────────┐──► x_hat = z_1     dz_k/dt = z_(k+1) + k_(k-1) |e|^((n+1-k)/(n+1)) sgn(e),   e = x - z_1
        u ──►│ observer │──► v_hat = z_2     dz_n/dt = w_hat + g u + k_(n-1) |e|^(1/(n+1)) sgn(e)
        g ──►└──────────┘──► w_hat           dw_hat/dt = k_n sgn(e)

    Levant's differentiator that knows g u. It is exact where |dw/dt| <= lipschitz. Fridman, Levant and Davila,
    Observation of linear systems with unknown inputs via high-order sliding-modes, Int. J. Systems Science 38 (2007)
    773–791. The gains: see `levant_gains`. At the start z_1 = x(0), the others are 0.
    """

    order = Dimension(default=2, description="n: how many integrators lie between g u + w and x")

    x = Input("n", description="measured position")
    u = Input("n", description="control input")
    g = Input("n", "n", description="known control gain")
    lipschitz = Parameter(default=10.0, description="bound of the derivative of the uncertainty")
    gains = CalculatedParameter("layers", description="k_0 … k_n")
    layers = Dimension(of="order", less=-1)
    z = State("order", "n", output=True, description="estimates of x and its derivatives")
    w_hat = State("n", output=True, description="estimate of the uncertainty")
    e = Local("n", description="x - z_1")
    x_hat = Output("n", description="estimate of the position")
    v_hat = Output("n", description="estimate of the velocity")

    positive = rule("lipschitz > 0")(lambda lipschitz: lipschitz > 0.0)
    known = rule("an order from 1 to 7, for which gains are known", "levant_gains")(lambda order: 1 <= order <= 7)

    def calculate(lipschitz, gains):
        write_gains(lipschitz, gains)

    def start(x, z):
        for q in range(x.size):
            z[0, q] = x[q]

    def outputs_error(x, z, e):
        for q in range(x.size):
            e[q] = x[q] - z[0, q]

    def outputs(z, x_hat, v_hat):
        write_estimates(z, x_hat, v_hat)

    def derivatives(u, g, z, w_hat, e, gains, d_z, d_w_hat):
        n = z.shape[0]
        for q in range(e.size):
            root = math.pow(abs(e[q]), 1.0 / (n + 1.0))
            power = 1.0
            d_w_hat[q] = gains[n] * sign(e[q])
            for back in range(n):
                k = n - 1 - back
                power *= root
                above = z[k + 1, q] if back > 0 else w_hat[q] + dot(g[q], u)
                d_z[k, q] = above + gains[k] * power * sign(e[q])

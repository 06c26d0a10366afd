"""Velocity and uncertainty of a mechanical system by a second-order sliding mode."""

import math

from cosim import Block, Input, Local, Parameter, State, rule
from cosim.blocks.signed_power import sign
from cosim.blocks.vectors import dot


class SuperTwistingObserver(Block):
    """The super-twisting observer; the uncertainty is its discontinuous term, through a filter.

    ::

        x ──►┌──────────┐──► x_hat     d x_hat/dt = v_hat + lambda |e|^(1/2) sgn(e),   e = x - x_hat
        u ──►│ observer │──► v_hat     d v_hat/dt = g u + alpha sgn(e)
        g ──►└──────────┘──► w_hat     d w_hat/dt = (alpha sgn(e) - w_hat) / T

    Exact after a finite time, apart from the filter, where alpha is 1.1 times a bound of |w|, and lambda 1.5 times its
    root. Davila, Fridman and Levant, Second-order sliding-mode observer for mechanical systems, IEEE Transactions on
    Automatic Control 50 (2005) 1785–1789; the filter: Davila, Fridman and Poznyak, Int. J. Control 79 (2006) 1251–1262.
    At the start x_hat = x(0), the others are 0.
    """

    x = Input("n", description="measured position")
    u = Input("n", description="control input")
    g = Input("n", "n", description="known control gain")
    x_hat = State("n", output=True, description="estimate of the position")
    v_hat = State("n", output=True, description="estimate of the velocity")
    w_hat = State("n", output=True, description="estimate of the uncertainty")
    lambda_ = Parameter(default=3.0, description="gain of the position estimate")
    alpha = Parameter(default=4.4, description="gain of the velocity estimate")
    T = Parameter(unit="s", default=0.05, description="time constant of the filter")
    e = Local("n", description="x - x_hat")

    positive = rule("lambda_, alpha, T > 0")(lambda lambda_, alpha, T: min(lambda_, alpha, T) > 0.0)

    def start(x, x_hat):
        for q in range(x.size):
            x_hat[q] = x[q]

    def outputs(x, x_hat, e):
        for q in range(x.size):
            e[q] = x[q] - x_hat[q]

    def derivatives(u, g, v_hat, w_hat, e, lambda_, alpha, T, d_x_hat, d_v_hat, d_w_hat):
        for q in range(u.size):
            d_x_hat[q] = v_hat[q] + lambda_ * math.copysign(math.sqrt(abs(e[q])), e[q])
            d_v_hat[q] = dot(g[q], u) + alpha * sign(e[q])
            d_w_hat[q] = (alpha * sign(e[q]) - w_hat[q]) / T

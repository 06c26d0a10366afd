"""Velocity and uncertainty of a robot from its position: the finite-time observer without a neural network, (45)."""

from cosim import Block, CalculatedParameter, Input, Local, Parameter, State, rule
from cosim.blocks.signed_power import common_root, signed_powers
from cosim.blocks.vectors import dot


class FiniteTimeObserver(Block):
    """The original finite-time observer (OFTO), (45), with e = x_hat - x.

    ::

        x ──►┌──────────┐──► x_hat      d x_hat/dt = v_hat - alpha_1 sgn^beta_1(e)
        u ──►│ observer │──► v_hat      d v_hat/dt = w_hat - alpha_2 sgn^beta_2(e) + g u
        g ──►└──────────┘──► w_hat      d w_hat/dt = -alpha_3 sgn^beta_2(e)

    where beta_2 = 2 beta_1 - 1. At the start x_hat = x(0), the others are 0.
    """

    x = Input("n", description="measured position")
    u = Input("n", description="control input")
    g = Input("n", "n", description="known control gain g_i(x_i)")
    x_hat = State("n", output=True, description="estimate of the position")
    v_hat = State("n", output=True, description="estimate of the velocity")
    w_hat = State("n", output=True, description="estimate of the uncertainty")
    alpha_1 = Parameter(default=8.0, description="gain of the position estimate")
    alpha_2 = Parameter(default=8.0, description="gain of the velocity estimate")
    alpha_3 = Parameter(default=6.0, description="gain of the uncertainty estimate")
    beta_1 = Parameter(unit="1", default="2/3", description="exponent of the position estimate")
    root = CalculatedParameter(dtype=int, unit="1", description="the root that both powers are made of; 0: none")
    e = Local("n", description="x_hat - x")
    s_1 = Local("n", description="sgn^beta_1(e)")
    s_2 = Local("n", description="sgn^beta_2(e)")

    positive = rule("alpha_1, alpha_2, alpha_3 > 0", "eq. 45")(
        lambda alpha_1, alpha_2, alpha_3: min(alpha_1, alpha_2, alpha_3) > 0.0
    )
    exponent = rule("0.5 < beta_1 < 1", "eq. 45")(lambda beta_1: 0.5 < beta_1 < 1.0)

    def calculate(beta_1, root):
        root[0] = common_root(beta_1)

    def start(x, x_hat):
        for q in range(x.size):
            x_hat[q] = x[q]

    def outputs(x, x_hat, beta_1, root, e, s_1, s_2):
        for q in range(x.size):
            e[q] = x_hat[q] - x[q]
        signed_powers(e, beta_1, root, s_1, s_2)

    def derivatives(u, g, v_hat, w_hat, s_1, s_2, alpha_1, alpha_2, alpha_3, d_x_hat, d_v_hat, d_w_hat):
        for q in range(u.size):
            d_x_hat[q] = v_hat[q] - alpha_1 * s_1[q]  # (45)
            d_v_hat[q] = w_hat[q] - alpha_2 * s_2[q] + dot(g[q], u)
            d_w_hat[q] = -alpha_3 * s_2[q]

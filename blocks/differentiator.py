"""Derivatives of a signal, exact after a finite time, (29)."""

import math

from cosim import Block, CalculatedParameter, Input, Parameter, State, rule
from cosim.blocks.cube_root import cube_root
from cosim.blocks.signed_power import sign


class SlidingModeDifferentiator(Block):
    """Four-layer sliding-mode differentiator for each channel of a signal, (29).

    ::

        x_d ─► xi_1 … xi_4,  estimates of x_d and its first three derivatives

        nu_1 = -eta_1 beta^(1/4) sgn^(3/4)(xi_1 - x_d)  + xi_2        d xi_1/dt = nu_1
        nu_2 = -eta_2 beta^(1/3) sgn^(2/3)(xi_2 - nu_1) + xi_3        d xi_2/dt = nu_2
        nu_3 = -eta_3 beta^(1/2) sgn^(1/2)(xi_3 - nu_2) + xi_4        d xi_3/dt = nu_3
        nu_4 = -eta_4 beta sgn(xi_4 - nu_3)                           d xi_4/dt = nu_4

    Each nu_k - xi_(k+1) is a power of e = xi_1 - x_d, so that the cascade is evaluated as

        nu_1 = -k_1 sgn^(3/4)(e) + xi_2      k_1 = eta_1 beta^(1/4)
        nu_2 = -k_2 sgn^(1/2)(e) + xi_3      k_2 = eta_2 beta^(1/3) k_1^(2/3)
        nu_3 = -k_3 sgn^(1/4)(e) + xi_4      k_3 = eta_3 beta^(1/2) k_2^(1/2)
        nu_4 = -k_4 sgn(e)                   k_4 = eta_4 beta

    which needs two square roots a channel. At the start xi_1 = x_d(0), the others are 0.
    """

    x_d = Input("n", description="signal to be differentiated")
    xi_1 = State("n", output=True, description="estimate of x_d")
    xi_2 = State("n", output=True, description="estimate of the first derivative of x_d")
    xi_3 = State("n", output=True, description="estimate of the second derivative of x_d")
    xi_4 = State("n", output=True, description="estimate of the third derivative of x_d")
    eta = Parameter(4, unit="1", default=(6.0, 8.0, 8.0, 6.0), description="gains of the four layers")
    lipschitz = Parameter(default=0.03, description="beta: Lipschitz constant of the second derivative of x_d")
    gains = CalculatedParameter(4, description="k_1 … k_4, the gains scaled by the Lipschitz constant")

    positive = rule("lipschitz > 0", "Assumption 2")(lambda lipschitz: lipschitz > 0.0)
    gained = rule("eta > 0", "eq. 29")(lambda eta: min(eta) > 0.0)

    def calculate(eta, lipschitz, gains):
        root = math.sqrt(lipschitz)
        gains[0] = eta[0] * math.sqrt(root)
        gains[1] = eta[1] * cube_root(lipschitz) * cube_root(gains[0]) ** 2
        gains[2] = eta[2] * root * math.sqrt(gains[1])
        gains[3] = eta[3] * lipschitz

    def start(x_d, xi_1):
        for q in range(x_d.size):
            xi_1[q] = x_d[q]

    def derivatives(x_d, xi_1, xi_2, xi_3, xi_4, gains, d_xi_1, d_xi_2, d_xi_3, d_xi_4):
        for q in range(x_d.size):
            e = xi_1[q] - x_d[q]
            half = math.sqrt(abs(e))
            quarter = math.sqrt(half)
            d_xi_1[q] = -gains[0] * sign(e) * half * quarter + xi_2[q]  # (29)
            d_xi_2[q] = -gains[1] * sign(e) * half + xi_3[q]
            d_xi_3[q] = -gains[2] * sign(e) * quarter + xi_4[q]
            d_xi_4[q] = -gains[3] * sign(e)

"""Derivatives of a sampled signal, as exact as its sampling allows."""

import math

from cosim import Block, CalculatedParameter, Dimension, Input, Output, Parameter, State, rule
from cosim.blocks.levant_gains import write_gains
from cosim.blocks.signed_power import sign


class ProperDifferentiator(Block):
    """Homogeneous sliding-mode differentiator of any order in its proper discrete form; sampled.

    ::

        x_d ─► xi_1 = z_0, xi_2 = z_1, xi_3 = z_2, xi = [z_1; …; z_n]      z_i estimates the i-th derivative, n = order

        z_i[k+1] = sum_(j=0)^(n-i) h^j/j! z_(i+j)[k]  -  h k_i |e|^((n-i)/(n+1)) sgn(e),    e = z_0[k] - x_d[k]

    with the sampling period h. The terms of Taylor's series from h^2 on are what Euler's method leaves out of (29): it
    errs by h/2 times a derivative one order higher, this one by no more than c_i L h^(n+1-i) in z_i, with the Lipschitz
    constant L of the n-th derivative, and of a polynomial of degree n not at all. Livne and Levant, Proper
    discretization of homogeneous differentiators, Automatica 50 (2014) 2007–2014. The gains k_i: see `levant_gains`.
    At the start z_0 = x_d(0), the others are 0.
    """

    order = Dimension(default=3, description="how many derivatives it estimates")

    x_d = Input("n", description="signal to be differentiated")
    lipschitz = Parameter(default=0.03, description="L: Lipschitz constant of the order-th derivative of x_d")
    gains = CalculatedParameter("layers", description="k_0 … k_n")
    layers = Dimension(of="order", less=-1)
    z = State("layers", "n", description="estimates of x_d and its derivatives")
    xi_1 = Output("n", description="estimate of x_d")
    xi_2 = Output("n", description="estimate of the first derivative of x_d")
    xi_3 = Output("n", description="estimate of the second derivative of x_d; 0 of order 1")
    xi = Output("order", "n", description="estimates of the derivatives of x_d, the first to the last")

    positive = rule("lipschitz > 0", "Lemma 6")(lambda lipschitz: lipschitz > 0.0)
    known = rule("an order from 1 to 7, for which gains are known", "levant_gains")(lambda order: 1 <= order <= 7)

    def calculate(lipschitz, gains):
        write_gains(lipschitz, gains)

    def start(x_d, z):
        for q in range(x_d.size):
            z[0, q] = x_d[q]

    def outputs(z, xi_1, xi_2, xi_3, xi):
        for q in range(xi_1.size):
            for i in range(xi.shape[0]):
                xi[i, q] = z[i + 1, q]
            xi_1[q] = z[0, q]
            xi_2[q] = z[1, q]
            xi_3[q] = z[2, q] if z.shape[0] > 2 else 0.0

    def update(period, x_d, z, gains, next_z):
        n = gains.size - 1
        for q in range(x_d.size):
            e = z[0, q] - x_d[q]
            root = math.pow(abs(e), 1.0 / (n + 1.0))
            power = 1.0
            for back in range(n + 1):
                i = n - back
                total = z[i, q] - period * gains[i] * power * sign(e)
                term = 1.0
                for j in range(1, n - i + 1):
                    term *= period / j
                    total += term * z[i + j, q]
                next_z[i, q] = total
                power *= root

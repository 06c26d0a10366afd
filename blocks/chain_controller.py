"""Formation control of agents of any order, as of Remark 3: (26) to (33) extended."""

import numpy as np

from cosim import Block, CalculatedParameter, Input, Local, Output, Parameter, rule
from cosim.blocks.consensus import local_error
from cosim.blocks.vectors import dot


class ChainFormationController(Block):
    """Sliding-mode formation control with limited information of agents of any order n, (26) to (33) extended.

    ::

        x, x_d               ──►┌────────────┐          agents: d^n x/dt^n = g u + w
        z, w_hat             ──►│            │
        xi                   ──►│ controller │──► u
        g_inverse            ──►│            │
        neighbours, weights  ──►└────────────┘

        delta_0 = x - x_d,   delta_k = z_(k+1) - xi_k,   k = 1 … n-1
        S_hat = ((L + B) ⊗ I) sum_(k=0)^(n-1) m_k delta_k,    m_k = (n-1 over k) lambda^(n-1-k)
        u_i = g_i^-1 (xi_n - w_hat - sum_(k=0)^(n-2) m_k delta_(k+1) - c S_hat_i)

    z_k estimates d^(k-1) x/dt^(k-1), as the observers of any order do, and xi_k the k-th derivative of x_d, as
    `ProperDifferentiator` does. With exact estimates and constant weights dS/dt = -c ((L + B) ⊗ I) S, and (d/dt +
    lambda)^(n-1) delta_0 = ((L + B) ⊗ I)^-1 S. Of order 2 it is (33) with one lambda for all, and without the term
    -delta_x of its Lyapunov function.
    """

    x = Input("robots", "n", description="measured positions")
    x_d = Input("robots", "n", description="position references")
    z = Input("robots", "order", "n", description="estimates of x and its derivatives")
    w_hat = Input("robots", "n", description="estimated uncertainties")
    xi = Input("robots", "order", "n", description="estimated derivatives of x_d, from the first on")
    g_inverse = Input("robots", "n", "n", description="inverses of the control gains")
    neighbours = Input("robots", "capacity", dtype=np.int32, unit="1", description="neighbours from 0; -1: none")
    weights = Input("robots", "capacity", unit="1", description="a_ij of each neighbour j")
    c = Parameter(unit="1/s", default=1.0, description="gain of the sliding variable")
    lambda_ = Parameter(unit="1/s", default=2.0, description="rate at which errors vanish on the sliding surface")
    b = Parameter("robots", unit="1", default=2.0, description="weight of each agent's own reference")
    m = CalculatedParameter("order", description="m_0 … m_(n-1)")
    combined = Local("robots", "n", description="sum of the errors m_k delta_k")
    S_hat = Local("robots", "n", description="estimated sliding variables")
    a = Local("robots", "n", description="g_i u_i")
    u = Output("robots", "n", description="control inputs")

    positive = rule("c > 0 and lambda_ > 0", "eqs. 27 and 33")(lambda c, lambda_: c > 0.0 and lambda_ > 0.0)
    pinned = rule("b >= 0, and b > 0 for at least one agent", "Lemma 2")(lambda b: min(b) >= 0.0 and max(b) > 0.0)

    def calculate(lambda_, m):
        m[m.size - 1] = 1.0
        for back in range(1, m.size):
            k = m.size - 1 - back
            m[k] = m[k + 1] * lambda_ * (k + 1.0) / back

    def outputs(
        x, x_d, z, w_hat, xi, g_inverse, neighbours, weights,
        c, b, m,
        combined, S_hat, a, u,
    ):  # fmt: skip
        last = m.size - 1
        for i in range(x.shape[0]):
            for q in range(x.shape[1]):
                combined[i, q] = m[0] * (x[i, q] - x_d[i, q])
                a[i, q] = xi[i, last, q] - w_hat[i, q]
                for k in range(last):
                    delta = z[i, k + 1, q] - xi[i, k, q]
                    combined[i, q] += m[k + 1] * delta
                    a[i, q] -= m[k] * delta
        local_error(combined, neighbours, weights, b, S_hat)  # (26)
        for i in range(x.shape[0]):
            for q in range(x.shape[1]):
                a[i, q] -= c * S_hat[i, q]
            for q in range(x.shape[1]):
                u[i, q] = dot(g_inverse[i, q], a[i])

"""Velocity and uncertainty of a robot from its position: the finite-time observer with a neural network, (10)."""

import math

from numpy.typing import NDArray

from cosim import Block, CalculatedParameter, Input, Local, Output, Parameter, State, condition, rule
from cosim.blocks.radial_basis import activations, weighted_sum
from cosim.blocks.signed_power import common_root, signed_powers
from cosim.blocks.stability_conditions import network_covers_run, observer_region, observer_stable
from cosim.blocks.vectors import dot, norm


def band_of(size: float, lower: NDArray) -> int:
    """The band of (22), from 0, in which the norm of sgn^beta_1(e) lies; lower: (bands), descending to 0."""
    band = 0
    while size < lower[band]:
        band += 1
    return band


class NeuralObserver(Block):
    """The finite-time neural-based observer (10), with e = x - x_hat, y = [x; v_hat] and beta_2 = 2 beta_1 - 1.

    ::

        x ──►┌──────────┐──► x_hat      d x_hat/dt = v_hat + alpha_1 sgn^beta_1(e)
        u ──►│ observer │──► v_hat      d v_hat/dt = w_hat + alpha_2 sgn^beta_2(e) + g u
        g ──►└──────────┘──► w_hat      w_hat = W_hat^T phi(y),  phi_j = exp(-||y - d_j||^2 / width^2)   (6), (7)

        d W_hat/dt = gamma_1 phi(y) sgn^beta_1(e)^T - gamma_2 ||sgn^beta_1(e)|| W_hat                    (13)

    The norm in (13) selects the gains (22): the k-th band of gamma_1 and gamma_2 holds for norms from 10^(c_v - k),
    the last one for all smaller norms. One band is the observer with static gains (NBOSP), several are the one with
    varying gains (NBOVP). At the start x_hat = x(0), the others are 0.
    """

    x = Input("n", description="measured position")
    u = Input("n", description="control input")
    g = Input("n", "n", description="known control gain g_i(x_i)")
    x_hat = State("n", output=True, description="estimate of the position")
    v_hat = State("n", output=True, description="estimate of the velocity")
    W_hat = State("neurons", "n", description="estimated weights")
    w_hat = Output("n", description="estimate of the uncertainty")
    alpha_1 = Parameter(default=8.0, description="gain of the position estimate")
    alpha_2 = Parameter(default=8.0, description="gain of the velocity estimate")
    beta_1 = Parameter(unit="1", default="2/3", description="exponent of the position estimate")
    gamma_1 = Parameter("bands", default=(1, 5, 50, 200, 10000), description="learning rate in each band")
    gamma_2 = Parameter("bands", default=(0.05, 0.25, 5, 20, 100), description="forgetting rate in each band")
    c_v = Parameter(unit="1", default=1.0, description="the first band begins at 10^(c_v - 1)")
    centres = Parameter("neurons", default=(-2, -1, 0, 1, 2, 3, 4, 5), description="d_j = centre_j [1, …, 1]")
    width = Parameter(default=8.0, description="mu: width of the neurons")
    root = CalculatedParameter(dtype=int, unit="1", description="the root that both powers are made of; 0: none")
    lower = CalculatedParameter("bands", description="smallest norm in each band")
    e = Local("n", description="x - x_hat")
    s_1 = Local("n", description="sgn^beta_1(e)")
    s_2 = Local("n", description="sgn^beta_2(e)")
    phi = Local("neurons", unit="1", description="activations of the neurons")
    coverage = Local(unit="1", description="largest activation: 1/e where y is one width away from the nearest centre")

    positive = rule("alpha_1, alpha_2 > 0", "Theorem 1")(lambda alpha_1, alpha_2: min(alpha_1, alpha_2) > 0.0)
    exponent = rule("0.5 < beta_1 < 1", "Theorem 1")(lambda beta_1: 0.5 < beta_1 < 1.0)
    wide = rule("width > 0", "eq. 7")(lambda width: width > 0.0)
    learning = rule("gamma_1 > 0 and gamma_2 > 0", "eq. 13")(
        lambda gamma_1, gamma_2: min(*gamma_1, *gamma_2, 1.0) > 0.0
    )
    stable = condition("A of the error's dynamics is Hurwitz", "Theorem 1, Lemma 4")(observer_stable)
    region = condition("the ultimate bound of the error lies in each band's region (23)", "Theorem 2")(observer_region)
    covered = condition("y stays within one width of a neuron", "Remark 5")(network_covers_run)

    def calculate(beta_1, c_v, root, lower):
        root[0] = common_root(beta_1)
        for k in range(lower.size - 1):
            lower[k] = math.pow(10.0, c_v - 1.0 - k)
        lower[lower.size - 1] = 0.0

    def start(x, x_hat):
        for q in range(x.size):
            x_hat[q] = x[q]

    def outputs_correction(x, x_hat, beta_1, root, e, s_1, s_2):
        for q in range(x.size):
            e[q] = x[q] - x_hat[q]
        signed_powers(e, beta_1, root, s_1, s_2)

    def outputs(x, v_hat, W_hat, centres, width, phi, coverage, w_hat):
        coverage[0] = activations(x, v_hat, centres, width, phi)  # (7)
        weighted_sum(W_hat, phi, w_hat)  # (6)

    def derivatives(
        u, g, v_hat, W_hat, w_hat, s_1, s_2, phi, alpha_1, alpha_2, gamma_1, gamma_2, lower, d_x_hat, d_v_hat, d_W_hat
    ):
        for q in range(u.size):
            d_x_hat[q] = v_hat[q] + alpha_1 * s_1[q]  # (10)
            d_v_hat[q] = w_hat[q] + alpha_2 * s_2[q] + dot(g[q], u)  # (10)
        size = norm(s_1)
        band = band_of(size, lower)
        learning, forgetting = gamma_1[band], gamma_2[band]  # (22)
        for j in range(phi.size):
            for q in range(u.size):
                d_W_hat[j, q] = learning * phi[j] * s_1[q] - forgetting * size * W_hat[j, q]  # (13)

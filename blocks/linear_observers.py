"""Linear observers of a chain of integrators: Luenberger, high-gain, extended state, Kalman; any order.

All observe d^n x/dt^n = w + g u with n = `order`, from x alone, and correct z_k, the estimate of d^(k-1) x/dt^(k-1), by
l_k e with e = x - z_1. They differ in what they assume of w, and in how their gains are chosen.
"""

import math

from numpy.typing import NDArray

from cosim import Block, CalculatedParameter, Dimension, Input, Local, Output, Parameter, State, rule
from cosim.blocks.vectors import dot


def follow_chain(u: NDArray, g: NDArray, z: NDArray, w_hat: NDArray, e: NDArray, gains: NDArray, d_z: NDArray) -> None:
    """d z_k/dt = z_(k+1) + l_k e, and d z_n/dt = w_hat + g u + l_n e; z, d_z: (order, n); gains: from l_1 on."""
    last = z.shape[0] - 1
    for q in range(e.size):
        for k in range(last):
            d_z[k, q] = z[k + 1, q] + gains[k] * e[q]
        d_z[last, q] = w_hat[q] + gains[last] * e[q] + dot(g[q], u)


def write_estimates(z: NDArray, x_hat: NDArray, v_hat: NDArray) -> None:
    """The first two of the estimates z (order, n); of order 1, v_hat is 0."""
    for q in range(x_hat.size):
        x_hat[q] = z[0, q]
        v_hat[q] = z[1, q] if z.shape[0] > 1 else 0.0


def multiply_pole(gains: NDArray, degree: int, rate: float) -> None:
    """From the coefficients l_1 … l_degree of s^degree + l_1 s^(degree-1) + … to those of the same times (s + rate)."""
    for k in range(degree, 0, -1):
        gains[k] += rate * gains[k - 1]
    gains[0] += rate


class LuenbergerObserver(Block):
    """An observer of a chain of integrators by its poles, which takes the uncertainty for zero.

    ::

        x ──►┌──────────┐──► x_hat = z_1      dz_k/dt = z_(k+1) + l_k e,   dz_n/dt = g u + l_n e,   e = x - z_1
        u ──►│ observer │──► v_hat = z_2
        g ──►└──────────┘──► w_hat = 0        s^n + l_1 s^(n-1) + … + l_n = product of (s + poles_k)

    Luenberger, An introduction to observers, IEEE Transactions on Automatic Control 16 (1971) 596–602. For any linear
    system with a given gain there is `Luenberger`. At the start z_1 = x(0), the others are 0.
    """

    x = Input("n", description="measured position")
    u = Input("n", description="control input")
    g = Input("n", "n", description="known control gain")
    poles = Parameter("order", unit="rad/s", default=(20.0, 25.0), description="minus the poles of the error, real")
    gains = CalculatedParameter("order", description="l_1 … l_n")
    z = State("order", "n", output=True, description="estimates of x and its derivatives")
    e = Local("n", description="x - z_1")
    x_hat = Output("n", description="estimate of the position")
    v_hat = Output("n", description="estimate of the velocity")
    w_hat = Output("n", description="estimate of the uncertainty: none, 0")

    positive = rule("poles > 0")(lambda poles: min(poles) > 0.0)

    def calculate(poles, gains):
        for k in range(gains.size):
            gains[k] = 0.0
        for k in range(poles.size):
            multiply_pole(gains, k, poles[k])

    def start(x, z):
        for q in range(x.size):
            z[0, q] = x[q]

    def outputs_error(x, z, e):
        for q in range(x.size):
            e[q] = x[q] - z[0, q]

    def outputs(z, x_hat, v_hat, w_hat):
        write_estimates(z, x_hat, v_hat)
        for q in range(w_hat.size):
            w_hat[q] = 0.0

    def derivatives(u, g, z, w_hat, e, gains, d_z):
        follow_chain(u, g, z, w_hat, e, gains, d_z)


class HighGainObserver(Block):
    """High-gain observer of a chain of integrators; its estimate of the uncertainty is what corrects its last state.

    ::

        x ──►┌──────────┐──► x_hat = z_1     dz_k/dt = z_(k+1) + alpha_k / epsilon^k e,   e = x - z_1
        u ──►│ observer │──► v_hat = z_2     dz_n/dt = w_hat + g u
        g ──►└──────────┘──► w_hat           w_hat = alpha_n / epsilon^n e

    The roots of s^n + alpha_1 s^(n-1) + … + alpha_n have to lie left of 0. Errors shrink with epsilon; noise grows, and
    so does the peak at the start. Khalil and Praly, High-gain observers in nonlinear feedback control, Int. J. Robust
    and Nonlinear Control 24 (2014) 993–1015. At the start z_1 = x(0), the others are 0.
    """

    x = Input("n", description="measured position")
    u = Input("n", description="control input")
    g = Input("n", "n", description="known control gain")
    alpha = Parameter("order", unit="1", default=(2.0, 1.0), description="alpha_1 … alpha_n")
    epsilon = Parameter(unit="s", default=0.02, description="the small parameter")
    gains = CalculatedParameter("order", description="alpha_k / epsilon^k")
    last = CalculatedParameter("order", description="the same without its last element, which w_hat holds")
    z = State("order", "n", output=True, description="estimates of x and its derivatives")
    e = Local("n", description="x - z_1")
    x_hat = Output("n", description="estimate of the position")
    v_hat = Output("n", description="estimate of the velocity")
    w_hat = Output("n", description="estimate of the uncertainty")

    positive = rule("alpha > 0 and epsilon > 0")(lambda alpha, epsilon: min(*alpha, epsilon) > 0.0)

    def calculate(alpha, epsilon, gains, last):
        for k in range(gains.size):
            gains[k] = alpha[k] / math.pow(epsilon, k + 1.0)
            last[k] = gains[k] if k < gains.size - 1 else 0.0

    def start(x, z):
        for q in range(x.size):
            z[0, q] = x[q]

    def outputs_error(x, z, e):
        for q in range(x.size):
            e[q] = x[q] - z[0, q]

    def outputs(z, x_hat, v_hat):
        write_estimates(z, x_hat, v_hat)

    def outputs_uncertainty(e, gains, w_hat):
        for q in range(e.size):
            w_hat[q] = gains[gains.size - 1] * e[q]

    def derivatives(u, g, z, w_hat, e, last, d_z):
        follow_chain(u, g, z, w_hat, e, last, d_z)


class LinearExtendedStateObserver(Block):
    """The linear extended-state observer (LESO): the uncertainty is a state too; all poles at minus its bandwidth.

    ::

        x ──►┌──────────┐──► x_hat = z_1     dz_k/dt = z_(k+1) + l_k e,   e = x - z_1
        u ──►│ observer │──► v_hat = z_2     dz_n/dt = w_hat + g u + l_n e
        g ──►└──────────┘──► w_hat           dw_hat/dt = l_(n+1) e

        s^(n+1) + l_1 s^n + … + l_(n+1) = (s + omega)^(n+1)

    Gao, Scaling and bandwidth-parameterization based controller tuning, American Control Conference (2003) 4989–4996.
    At the start z_1 = x(0), the others are 0.
    """

    order = Dimension(default=2, description="how many integrators lie between g u + w and x")

    x = Input("n", description="measured position")
    u = Input("n", description="control input")
    g = Input("n", "n", description="known control gain")
    omega = Parameter(unit="rad/s", default=30.0, description="bandwidth")
    gains = CalculatedParameter("layers", description="l_1 … l_(n+1)")
    layers = Dimension(of="order", less=-1)
    z = State("order", "n", output=True, description="estimates of x and its derivatives")
    w_hat = State("n", output=True, description="estimate of the uncertainty")
    e = Local("n", description="x - z_1")
    x_hat = Output("n", description="estimate of the position")
    v_hat = Output("n", description="estimate of the velocity")

    positive = rule("omega > 0")(lambda omega: omega > 0.0)

    def calculate(omega, gains):
        for k in range(gains.size):
            gains[k] = 0.0
        for k in range(gains.size):
            multiply_pole(gains, k, omega)

    def start(x, z):
        for q in range(x.size):
            z[0, q] = x[q]

    def outputs_error(x, z, e):
        for q in range(x.size):
            e[q] = x[q] - z[0, q]

    def outputs(z, x_hat, v_hat):
        write_estimates(z, x_hat, v_hat)

    def derivatives(u, g, z, w_hat, e, gains, d_z, d_w_hat):
        follow_chain(u, g, z, w_hat, e, gains, d_z)
        for q in range(e.size):
            d_w_hat[q] = gains[gains.size - 1] * e[q]


class KalmanObserver(Block):
    """The stationary Kalman–Bucy filter of a chain of integrators whose uncertainty is a random walk.

    ::

        x ──►┌──────────┐──► x_hat = z_1     dz_k/dt = z_(k+1) + l_k e,   e = x - z_1
        u ──►│ observer │──► v_hat = z_2     dz_n/dt = w_hat + g u + l_n e
        g ──►└──────────┘──► w_hat           dw_hat/dt = l_(n+1) e

        dw/dt = noise of the density Q,   x is measured with noise of the density R

    Its Riccati equation has a closed form: s^(n+1) + l_1 s^n + … is Butterworth's polynomial of the bandwidth
    (Q/R)^(1/(2n+2)). Noise that is sampled every h seconds with the deviation d has the density d^2 h. Kalman and Bucy,
    New results in linear filtering and prediction theory, Journal of Basic Engineering 83 (1961) 95–108. At the start
    z_1 = x(0), the others are 0. For sampled linear systems in general there is `KalmanFilter`.
    """

    order = Dimension(default=2, description="how many integrators lie between g u + w and x")

    x = Input("n", description="measured position")
    u = Input("n", description="control input")
    g = Input("n", "n", description="known control gain")
    Q = Parameter(default=1.0, description="density of the noise that drives the uncertainty")
    R = Parameter(default=1e-9, description="density of the noise of the measurement")
    gains = CalculatedParameter("layers", description="l_1 … l_(n+1)")
    layers = Dimension(of="order", less=-1)
    z = State("order", "n", output=True, description="estimates of x and its derivatives")
    w_hat = State("n", output=True, description="estimate of the uncertainty")
    e = Local("n", description="x - z_1")
    x_hat = Output("n", description="estimate of the position")
    v_hat = Output("n", description="estimate of the velocity")

    positive = rule("Q > 0 and R > 0")(lambda Q, R: Q > 0.0 and R > 0.0)

    def calculate(Q, R, gains):
        half = math.pi / (2.0 * gains.size)
        bandwidth = math.pow(Q / R, 0.5 / gains.size)
        product = 1.0
        for k in range(gains.size):
            product *= bandwidth * math.cos(k * half) / math.sin((k + 1.0) * half)
            gains[k] = product

    def start(x, z):
        for q in range(x.size):
            z[0, q] = x[q]

    def outputs_error(x, z, e):
        for q in range(x.size):
            e[q] = x[q] - z[0, q]

    def outputs(z, x_hat, v_hat):
        write_estimates(z, x_hat, v_hat)

    def derivatives(u, g, z, w_hat, e, gains, d_z, d_w_hat):
        follow_chain(u, g, z, w_hat, e, gains, d_z)
        for q in range(e.size):
            d_w_hat[q] = gains[gains.size - 1] * e[q]

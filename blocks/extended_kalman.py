"""The extended Kalman filter, for systems whose two functions an author writes."""

import numpy as np

from cosim import Input, Local, Output, Parameter, State, rule
from cosim.blocks.estimation_control import is_covariance
from cosim.blocks.kalman_steps import begin, correct, predict


class ExtendedKalmanFilter:
    """The Kalman filter of a sampled system that is not linear, about its own estimate.

    ::

        x[k+1] = f(x[k], u[k]) + w,   y[k] = h(x[k]) + v,   cov w = Q,   cov v = R
        F = df/dx at x_hat[k],   H = dh/dx at x

        S = H P H^T + R,   K = P H^T S^-1
        x_hat[k] = x + K (y[k] - h(x)),   P_hat = (I - K H) P (I - K H)^T + K R K^T   at the sample
        x = f(x_hat[k], u[k]),            P = F P_hat F^T + Q                         for the next one

    A block derives from it and from `Block`, and says what f and h are, in two functions that may name parameters of
    its own, `u`, `period` and `time`::

        class PendulumFilter(ExtendedKalmanFilter, Block):
            def outputs_measurement(x, h, H):              h[:] and H[:] at the prediction x
            def outputs_transition(x_hat, u, period, f, F):          f[:] and F[:] at x_hat

    `cosim.blocks.jacobian` gives H and F by differences. The measurements are taken one by one, so that R is diagonal:
    `R` are its elements. Begin with P in `start`. Simon, Optimal State Estimation (2006), section 13.2.
    """

    u = Input("m?", start=0.0, description="what drives the system")
    y = Input("p?", description="measurements")
    Q = Parameter("n", "n", description="covariance of the process noise")
    R = Parameter("p", description="variances of the measurements")
    x = State("n", description="predicted states")
    P = State("n", "n", description="covariance of their error")
    h = Local("p", description="measurements as predicted")
    H = Local("p", "n", description="their Jacobian by the states")
    f = Local("n", description="states at the next sample")
    F = Local("n", "n", description="their Jacobian by the states")
    x_hat = Output("n", description="estimated states")
    P_hat = Output("n", "n", description="covariance of their error")

    positive = rule("R > 0")(lambda R: bool(np.all(R > 0.0)))
    same = rule("Q is symmetric, with no negative eigenvalue")(is_covariance)

    def outputs_measurement(x, h, H):
        """h[:] = h(x), H[:] = dh/dx: what derives from this class writes it."""

    def outputs(y, R, x, P, h, H, x_hat, P_hat):
        begin(x, P, x_hat, P_hat)
        for k in range(y.size):
            innovation = y[k] - h[k]
            for i in range(x.size):
                innovation -= H[k, i] * (x_hat[i] - x[i])
            correct(innovation, H[k], R[k], x_hat, P_hat)

    def outputs_transition(x_hat, f, F):
        """f[:] = f(x_hat, u), F[:] = df/dx: what derives from this class writes it."""

    def update(f, F, Q, P_hat, next_x, next_P):
        next_x[:] = f
        predict(F, P_hat, Q, next_P)

"""Observers and state feedback for linear systems: Luenberger, Kalman, LQR; within limits, `LinearMPC`."""

import numpy as np
from numpy.typing import NDArray

from cosim import Block, CalculatedParameter, Input, Output, Parameter, State, rule
from cosim.blocks.kalman_steps import begin, correct, predict
from cosim.blocks.matrices import cayley, double


def is_covariance(Q: NDArray) -> bool:
    """Whether a matrix is symmetric, with no negative eigenvalue."""
    q = np.atleast_2d(Q)
    return bool(np.all(np.isfinite(q)) and np.allclose(q, q.T) and np.linalg.eigvalsh(q)[0] >= -1e-12 * abs(q).max())


def is_definite(R: NDArray) -> bool:
    """Whether a matrix is symmetric, with positive eigenvalues alone."""
    r = np.atleast_2d(R)
    return bool(np.all(np.isfinite(r)) and np.allclose(r, r.T) and np.linalg.eigvalsh(r)[0] > 0.0)


class Luenberger(Block):
    """An observer of a linear system's states, with a given gain.

    ::

        dx_hat/dt = A x_hat + B u + L (y - C x_hat)
    """

    u = Input("m?", description="what drives the system")
    y = Input("p?", description="measurements")
    A = Parameter("n", "n", description="system matrix")
    B = Parameter("n", "m", description="input matrix")
    C = Parameter("p", "n", description="output matrix")
    L = Parameter("n", "p", description="gain")
    x_hat = State("n", output=True, description="estimated states")

    def derivatives(u, y, A, B, C, L, x_hat, d_x_hat):
        for i in range(x_hat.size):
            d_x_hat[i] = 0.0
            for j in range(x_hat.size):
                d_x_hat[i] += A[i, j] * x_hat[j]
            for j in range(u.size):
                d_x_hat[i] += B[i, j] * u[j]
        for k in range(y.size):
            error = y[k]
            for j in range(x_hat.size):
                error -= C[k, j] * x_hat[j]
            for i in range(x_hat.size):
                d_x_hat[i] += L[i, k] * error


class KalmanFilter(Block):
    """The Kalman filter of a sampled linear system, with the covariance of its error.

    ::

        x[k+1] = A x[k] + B u[k] + w,   y[k] = C x[k] + v,   cov w = Q,   cov v = R

        S = C P C^T + R,   K = P C^T S^-1
        x_hat[k] = x + K (y[k] - C x),   P_hat = (I - K C) P (I - K C)^T + K R K^T   at the sample
        x = A x_hat[k] + B u[k],         P = A P_hat A^T + Q                         for the next one

    The measurements are taken one by one, so that R is diagonal: `R` are its elements. Begin with P in `start`. For a
    system that is not linear, derive a block from `cosim.blocks.extended_kalman.ExtendedKalmanFilter`.
    """

    u = Input("m?", start=0.0, description="what drives the system")
    y = Input("p?", description="measurements")
    A = Parameter("n", "n", description="system matrix")
    B = Parameter("n", "m", description="input matrix")
    C = Parameter("p", "n", description="output matrix")
    Q = Parameter("n", "n", description="covariance of the process noise")
    R = Parameter("p", description="variances of the measurements")
    x = State("n", description="predicted states")
    P = State("n", "n", description="covariance of their error")
    x_hat = Output("n", description="estimated states")
    P_hat = Output("n", "n", description="covariance of their error")

    positive = rule("R > 0")(lambda R: bool(np.all(R > 0.0)))
    same = rule("Q is symmetric, with no negative eigenvalue")(is_covariance)

    def outputs(y, C, R, x, P, x_hat, P_hat):
        begin(x, P, x_hat, P_hat)
        for k in range(y.size):
            innovation = y[k]
            for i in range(x.size):
                innovation -= C[k, i] * x_hat[i]
            correct(innovation, C[k], R[k], x_hat, P_hat)

    def update(u, A, B, Q, x_hat, P_hat, next_x, next_P):
        for i in range(x_hat.size):
            total = 0.0
            for j in range(x_hat.size):
                total += A[i, j] * x_hat[j]
            for j in range(u.size):
                total += B[i, j] * u[j]
            next_x[i] = total
        predict(A, P_hat, Q, next_P)


class LQR(Block):
    """State feedback that minimizes a quadratic cost in continuous time, by its Riccati equation.

    ::

        u = K (x_ref - x),   K = R^-1 B^T X,   A^T X + X A - X B R^-1 B^T X + Q = 0
        least integral of  x^T Q x + u^T R u

    The gain is computed once, before the first step, and anew where an FMU's matrices are changed.
    """

    x = Input("n", description="states")
    x_ref = Input("n", start=0.0, description="where they are to be")
    A = Parameter("n", "n", description="system matrix")
    B = Parameter("n", "m", description="input matrix")
    Q = Parameter("n", "n", description="weights of the states")
    R = Parameter("m", "m", default=1.0, description="weights of the inputs")
    K = CalculatedParameter("m", "n", description="gain")
    u = Output("m?", description="inputs of the system")

    weights = rule("Q is symmetric, with no negative eigenvalue")(is_covariance)
    definite = rule("R is symmetric, with positive eigenvalues")(is_definite)

    def calculate(A, B, Q, R, K):
        inverse = np.linalg.inv(R)
        a, g, h = A.copy(), B @ inverse @ B.T, Q.copy()
        cayley(a, g, h)
        double(a, g, h)
        K[:] = inverse @ B.T @ h

    def outputs(x, x_ref, K, u):
        for i in range(u.size):
            u[i] = 0.0
            for j in range(x.size):
                u[i] += K[i, j] * (x_ref[j] - x[j])


class DiscreteLQR(Block):
    """State feedback that minimizes a quadratic cost of a sampled system, by its Riccati equation; sampled.

    ::

        u[k] = K (x_ref[k] - x[k]),   K = (R + B^T X B)^-1 B^T X A
        X = A^T X A - A^T X B (R + B^T X B)^-1 B^T X A + Q
        least sum of  x^T Q x + u^T R u

    The gain is computed once, before the first step, and anew where an FMU's matrices are changed. Give it the `period`
    for which A and B are.
    """

    x = Input("n", description="states")
    x_ref = Input("n", start=0.0, description="where they are to be")
    A = Parameter("n", "n", description="system matrix")
    B = Parameter("n", "m", description="input matrix")
    Q = Parameter("n", "n", description="weights of the states")
    R = Parameter("m", "m", default=1.0, description="weights of the inputs")
    K = CalculatedParameter("m", "n", description="gain")
    u = Output("m?", description="inputs of the system")

    weights = rule("Q is symmetric, with no negative eigenvalue")(is_covariance)
    definite = rule("R is symmetric, with positive eigenvalues")(is_definite)

    def calculate(A, B, Q, R, K):
        a, g, h = A.copy(), B @ np.linalg.inv(R) @ B.T, Q.copy()
        double(a, g, h)
        K[:] = np.linalg.solve(R + B.T @ h @ B, B.T @ h @ A)

    def outputs(x, x_ref, K, u):
        for i in range(u.size):
            u[i] = 0.0
            for j in range(x.size):
                u[i] += K[i, j] * (x_ref[j] - x[j])

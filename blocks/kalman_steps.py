"""The two steps of a Kalman filter, for filters of one's own: an extended one hands over its Jacobians.

::

    class PendulumFilter(Block):
        def outputs(y, R, x, P, gain, x_hat, P_hat):
            begin(x, P, x_hat, P_hat)
            C = (math.cos(x[0]), 0.0)                      the Jacobian of h(x) = sin(x_1), of which y is a measurement
            correct(y - math.sin(x[0]), C, R, x_hat, P_hat, gain)

        def update(x_hat, P_hat, Q, period, F, next_x, next_P):
            next_x[0] = x_hat[0] + period * x_hat[1]       f(x)
            …
            predict(F, P_hat, Q, next_P)                   F: the Jacobian of f, a Local that outputs() fills
"""

from numpy.typing import NDArray


def begin(x: NDArray, P: NDArray, x_hat: NDArray, P_hat: NDArray) -> None:
    """The prediction, before any measurement corrects it."""
    x_hat[:] = x
    P_hat[:] = P


def correct(innovation: float, row: NDArray, variance: float, x_hat: NDArray, P_hat: NDArray, gain: NDArray) -> None:
    """Correct states and covariance by one measurement.

    innovation: measured less predicted; row: how it depends on the states (n); variance: that of its noise; gain: work
    space (n).
    """
    total = variance
    for i in range(x_hat.size):
        gain[i] = 0.0
        for j in range(x_hat.size):
            gain[i] += P_hat[i, j] * row[j]
    for i in range(x_hat.size):
        total += row[i] * gain[i]
    for i in range(x_hat.size):
        x_hat[i] += gain[i] / total * innovation
        for j in range(x_hat.size):
            P_hat[i, j] -= gain[i] * gain[j] / total


def predict(F: NDArray, P_hat: NDArray, Q: NDArray, P: NDArray) -> None:
    """P = F P_hat F^T + Q."""
    P[:] = F @ P_hat @ F.T + Q

"""The two steps of a Kalman filter, linear or extended: correct by measurements, predict."""

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

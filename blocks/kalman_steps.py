"""The two steps of a Kalman filter, linear or extended: correct by measurements, predict."""

import numpy as np
from numpy.typing import NDArray


def begin(x: NDArray, P: NDArray, x_hat: NDArray, P_hat: NDArray) -> None:
    """The prediction, before any measurement corrects it."""
    x_hat[:] = x
    P_hat[:] = P


def correct(innovation: float, row: NDArray, variance: float, x_hat: NDArray, P_hat: NDArray) -> None:
    """Correct states and covariance by one measurement, in Joseph's form.

    innovation: measured less predicted; row: how it depends on the states (n); variance: that of its noise. The shorter
    P - K C P loses as many digits as the measurement is more exact than the prediction: all, where that is 1e16.
    """
    spread = P_hat @ row
    gain = spread / (row @ spread + variance)
    x_hat[:] = x_hat + gain * innovation
    kept = np.eye(row.size) - np.outer(gain, row)
    P_hat[:] = kept @ P_hat @ kept.T + variance * np.outer(gain, gain)


def predict(F: NDArray, P_hat: NDArray, Q: NDArray, P: NDArray) -> None:
    """P = F P_hat F^T + Q."""
    P[:] = F @ P_hat @ F.T + Q

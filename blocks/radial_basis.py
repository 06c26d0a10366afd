"""Radial-basis-function network on y = [x; v], with centres d_j = centre_j [1, …, 1], (6), (7)."""

import math

from numpy.typing import NDArray


def activation(x: NDArray, v: NDArray, centre: float, width: float) -> float:
    """exp(-||y - d_j||^2 / width^2), (7), of one neuron; x, v: (n)."""
    sharpness = -1.0 / (width * width)
    square = 0.0
    for q in range(x.size):
        square += (x[q] - centre) * (x[q] - centre) + (v[q] - centre) * (v[q] - centre)
    return math.exp(square * sharpness)


def activations(x: NDArray, v: NDArray, centres: NDArray, width: float, phi: NDArray) -> float:
    """Write phi(y), (7); x, v: (n); centres, phi: (neurons). Returns the largest of them."""
    largest = 0.0
    for j in range(phi.size):
        phi[j] = activation(x, v, centres[j], width)
        largest = max(largest, phi[j])
    return largest


def weighted_sum(W: NDArray, phi: NDArray, w: NDArray) -> None:
    """w = W^T phi, (6); W: (neurons, n), phi: (neurons), w: (n)."""
    for q in range(w.size):
        w[q] = 0.0
    for j in range(phi.size):
        for q in range(w.size):
            w[q] += W[j, q] * phi[j]

"""Radial-basis-function network on y = [x; v], with centres d_j = centre_j · [1, …, 1], (6) and (7)."""

import math

from numpy.typing import NDArray


def equal_spacing(centres: NDArray) -> float:
    """The spacing of centres (neurons) that ascend in equal steps; 0 if they do not."""
    if centres.size < 2:
        return 0.0
    spacing = (centres[centres.size - 1] - centres[0]) / (centres.size - 1)
    for j in range(centres.size):
        if abs(centres[0] + j * spacing - centres[j]) > 1e-12 * abs(spacing):
            return 0.0
    return max(spacing, 0.0)


def activations(
    x: NDArray, v: NDArray, centres: NDArray, width: float, spacing: float, decay: float, phi: NDArray
) -> float:
    """phi_j = exp(-||y - d_j||^2 / width^2), (7); x, v: (n); centres, phi: (neurons). Returns the largest of them.

    With equal spacing, the quotient of two neighbours is itself a geometric sequence, so that three exponentials
    are enough. Going outwards from the centre nearest to y, all quotients are below 1 and nothing can overflow.
    spacing: `equal_spacing(centres)`; decay: exp(-4 spacing^2 / width^2).
    """
    if spacing == 0.0:
        highest = 0.0
        for j in range(phi.size):
            phi[j] = activation(x, v, centres[j], width)
            highest = max(highest, phi[j])
        return highest
    per_spacing = 1.0 / spacing
    last = phi.size - 1
    middle = 0.0
    for q in range(x.size):
        middle += x[q] + v[q]
    middle *= 0.5 / x.size
    steps = (middle - centres[0]) * per_spacing
    nearest = 0 if not steps > 0.0 else last if steps >= last else int(steps + 0.5)
    largest = activation(x, v, centres[nearest], width)
    phi[nearest] = largest
    scale = 2 * x.size * spacing / (width * width)
    shift = 2.0 * (middle - centres[nearest])
    falling = 1.0
    for _ in range(x.size):
        falling *= decay
    if nearest < last:
        value, quotient = largest, math.exp(scale * (shift - spacing))
        for j in range(nearest + 1, last + 1):
            value *= quotient
            quotient *= falling
            phi[j] = value
    if nearest > 0:
        value, quotient = largest, math.exp(scale * (-shift - spacing))
        for j in range(nearest - 1, -1, -1):
            value *= quotient
            quotient *= falling
            phi[j] = value
    return largest


def activation(x: NDArray, v: NDArray, centre: float, width: float) -> float:
    """One neuron's activation, (7)."""
    sharpness = -1.0 / (width * width)
    square = 0.0
    for q in range(x.size):
        square += (x[q] - centre) * (x[q] - centre) + (v[q] - centre) * (v[q] - centre)
    return math.exp(square * sharpness)


def weighted_sum(weights: NDArray, phi: NDArray, w: NDArray) -> None:
    """w = W^T phi, (6); weights: (neurons, n), phi: (neurons), w: (n)."""
    for q in range(w.size):
        w[q] = 0.0
    for j in range(phi.size):
        for q in range(w.size):
            w[q] += weights[j, q] * phi[j]

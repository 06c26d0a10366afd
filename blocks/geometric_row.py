"""The activations (7) of equally spaced centres from three exponentials, however many there are.

The quotient of two neighbours' activations is itself a geometric sequence: with s = spacing and the mean m of y,

    phi_(j+1) / phi_j = exp(2n s (2 (m - centre_j) - s) / width^2)

falls from one neuron to the next by decay^n, decay = exp(-4 s^2 / width^2).
"""

import math

from numpy.typing import NDArray

from cosim.blocks.radial_basis import activation


def equal_spacing(centres: NDArray) -> float:
    """The spacing of centres (neurons) that ascend in equal steps; 0 if they do not."""
    if centres.size < 2:
        return 0.0
    spacing = (centres[centres.size - 1] - centres[0]) / (centres.size - 1)
    for j in range(centres.size):
        if abs(centres[0] + j * spacing - centres[j]) > 1e-12 * abs(spacing):
            return 0.0
    return max(spacing, 0.0)


def geometric_row(
    x: NDArray, v: NDArray, centres: NDArray, width: float, spacing: float, decay: float, phi: NDArray
) -> float:
    """Write phi(y), (7), as `activations` does; spacing: `equal_spacing(centres)` > 0. Returns the largest.

    Going outwards from the centre nearest to y, all quotients are below 1 and nothing can overflow.
    """
    last = phi.size - 1
    middle = mean(x, v)
    nearest = nearest_centre(middle, centres[0], spacing, last)
    phi[nearest] = activation(x, v, centres[nearest], width)
    scale = 2 * x.size * spacing / (width * width)
    shift = 2.0 * (middle - centres[nearest])
    falling = 1.0
    for _ in range(x.size):
        falling *= decay
    if nearest < last:
        quotient = math.exp(scale * (shift - spacing))
        for j in range(nearest + 1, last + 1):
            phi[j] = phi[j - 1] * quotient
            quotient *= falling
    if nearest > 0:
        quotient = math.exp(scale * (-shift - spacing))
        for j in range(nearest - 1, -1, -1):
            phi[j] = phi[j + 1] * quotient
            quotient *= falling
    return phi[nearest]


def mean(x: NDArray, v: NDArray) -> float:
    """The mean of all elements of y = [x; v], (7); x, v: (n)."""
    total = 0.0
    for q in range(x.size):
        total += x[q] + v[q]
    return total * (0.5 / x.size)


def nearest_centre(middle: float, first: float, spacing: float, last: int) -> int:
    """Which of the centres `first`, `first + spacing`, … is nearest to `middle`, from 0 to `last`."""
    steps = (middle - first) * (1.0 / spacing)
    return 0 if not steps > 0.0 else last if steps >= last else int(steps + 0.5)

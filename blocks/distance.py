"""Distance of two robots in the plane."""

import math

from numpy.typing import NDArray


def planar_distance(x: NDArray, i: int, j: int) -> float:
    """||z_ij|| of the rows i and j of x (robots, n), whose first two channels are planar positions (m)."""
    across, along = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1]
    return math.sqrt(across * across + along * along)

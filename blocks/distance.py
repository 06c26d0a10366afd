"""Distance ||z_ij|| of two robots in the plane, z_ij = x_pi - x_pj of (5) and (9)."""

import math

from numpy.typing import NDArray


def planar_square(x: NDArray, i: int, j: int) -> float:
    """||z_ij||^2 (m2) of the rows i and j of x (robots, n), whose first two channels are planar positions (m)."""
    across, along = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1]
    return across * across + along * along


def planar_distance(x: NDArray, i: int, j: int) -> float:
    """||z_ij|| (m), see `planar_square`."""
    return math.sqrt(planar_square(x, i, j))


def surely_beyond(square: float, reach: float) -> bool:
    """Whether a distance of this square is larger than `reach` >= 0 (m) however both are rounded: spares most roots."""
    return square > 1.001 * reach * reach

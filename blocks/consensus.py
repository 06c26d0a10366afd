"""Disagreement of a network's robots, (26)."""

from numpy.typing import NDArray


def local_errors(
    delta_x: NDArray,
    delta_v: NDArray,
    neighbours: NDArray,
    weights: NDArray,
    b: NDArray,
    e_x: NDArray,
    e_v: NDArray,
) -> None:
    """e_i = sum_j a_ij (delta_i - delta_j) + b_i delta_i, (26) and (30), that is e = ((L + B) ⊗ I_n) delta.

    For positions and velocities in one pass. delta_x, delta_v, e_x, e_v: (robots, n); neighbours, weights: (robots,
    capacity), see `adjacency.py`; b: (robots). The sums begin with the robot's own error.
    """
    for i in range(delta_x.shape[0]):
        for q in range(delta_x.shape[1]):
            e_x[i, q] = b[i] * delta_x[i, q]
            e_v[i, q] = b[i] * delta_v[i, q]
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            if j < 0:
                break
            for q in range(delta_x.shape[1]):
                e_x[i, q] += weights[i, k] * (delta_x[i, q] - delta_x[j, q])
                e_v[i, q] += weights[i, k] * (delta_v[i, q] - delta_v[j, q])


def local_error(delta: NDArray, neighbours: NDArray, weights: NDArray, b: NDArray, e: NDArray) -> None:
    """The same of one kind of error alone; delta, e: (robots, n)."""
    for i in range(delta.shape[0]):
        for q in range(delta.shape[1]):
            e[i, q] = b[i] * delta[i, q]
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            if j < 0:
                break
            for q in range(delta.shape[1]):
                e[i, q] += weights[i, k] * (delta[i, q] - delta[j, q])

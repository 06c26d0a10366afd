"""Disagreement of a network's robots."""

from numpy.typing import NDArray


def local_error(delta: NDArray, neighbours: NDArray, weights: NDArray, b: NDArray, e: NDArray) -> None:
    """e_i = sum_j a_ij (delta_i - delta_j) + b_i delta_i, that is e = ((L + B) ⊗ I_n) delta, (26).

    delta, e: (robots, n); neighbours, weights: (robots, capacity), see `blocks.adjacency`; b: (robots).
    """
    for i in range(delta.shape[0]):
        for q in range(delta.shape[1]):
            e[i, q] = b[i] * delta[i, q]
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            if j < 0:
                break
            for q in range(delta.shape[1]):
                e[i, q] += weights[i, k] * (delta[i, q] - delta[j, q])

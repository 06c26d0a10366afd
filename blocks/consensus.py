"""Disagreement of a network's robots."""

from numpy.typing import NDArray


def local_errors(
    x: NDArray,
    x_d: NDArray,
    v: NDArray,
    v_d: NDArray,
    neighbours: NDArray,
    weights: NDArray,
    b: NDArray,
    e_x: NDArray,
    e_v: NDArray,
) -> None:
    """e_i = sum_j a_ij (delta_i - delta_j) + b_i delta_i, that is e = ((L + B) ⊗ I_n) delta, (26), (30).

    For delta = x - x_d and for delta = v - v_d. x, x_d, v, v_d, e_x, e_v: (robots, n); neighbours, weights:
    (robots, capacity), see `adjacency.py`; b: (robots).
    """
    for i in range(x.shape[0]):
        for q in range(x.shape[1]):
            e_x[i, q] = b[i] * (x[i, q] - x_d[i, q])
            e_v[i, q] = b[i] * (v[i, q] - v_d[i, q])
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            if j < 0:
                break
            for q in range(x.shape[1]):
                e_x[i, q] += weights[i, k] * ((x[i, q] - x_d[i, q]) - (x[j, q] - x_d[j, q]))
                e_v[i, q] += weights[i, k] * ((v[i, q] - v_d[i, q]) - (v[j, q] - v_d[j, q]))

"""The powers of the finite-time observers, sgn^b(e) = sign(e) |e|^b: those of beta_1 and beta_2, (10) and (45)."""

import math

from numpy.typing import NDArray

from cosim.blocks.cube_root import HIGHEST, LOWEST, cube_root, cube_root_within


def sign(e: float) -> float:
    """sgn(e) of (29): 1, -1, or 0 for 0."""
    return 1.0 if e > 0.0 else -1.0 if e < 0.0 else 0.0


def signed_power(e: float, beta: float) -> float:
    """sgn^beta(e) = sign(e) |e|^beta, as in (10), (29) and (45)."""
    return math.copysign(math.pow(abs(e), beta), e)


def common_root(beta_1: float) -> int:
    """Of which root of e both powers of `signed_powers` are whole powers: 3, 4, or 0 for none of these."""
    if abs(beta_1 - 2.0 / 3.0) < 1e-12:
        return 3
    if abs(beta_1 - 3.0 / 4.0) < 1e-12:
        return 4
    return 0


def signed_powers(e: NDArray, beta_1: float, root: int, s_1: NDArray, s_2: NDArray) -> None:
    """Write sgn^beta_1(e) to s_1 and sgn^beta_2(e) to s_2, (10) and (45), with beta_2 = 2 beta_1 - 1.

    e, s_1, s_2: (n); root: `common_root(beta_1)`. The exponents 2/3 with 1/3, and 3/4 with 1/2, are what designs use;
    they cost no general power.
    """
    if root == 3:
        signed_cube_roots(e, s_2)
        for q in range(e.size):
            s_1[q] = math.copysign(s_2[q] * s_2[q], e[q])
        return
    for q in range(e.size):
        if root == 4:
            half = math.sqrt(abs(e[q]))
            s_1[q], s_2[q] = math.copysign(half * math.sqrt(half), e[q]), math.copysign(half, e[q])
        else:
            s_1[q], s_2[q] = signed_power(e[q], beta_1), signed_power(e[q], 2.0 * beta_1 - 1.0)


def signed_cube_roots(e: NDArray, roots: NDArray) -> None:
    """Write sgn^(1/3)(e) to roots, all at once where no e_q is extreme, which returning one by one could not; (n)."""
    ordinary = True
    for q in range(e.size):
        ordinary &= LOWEST < abs(e[q]) < HIGHEST
    if ordinary:
        for q in range(e.size):
            roots[q] = math.copysign(cube_root_within(abs(e[q])), e[q])
    else:
        for q in range(e.size):
            roots[q] = math.copysign(cube_root(abs(e[q])), e[q])

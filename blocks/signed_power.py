"""The powers of the finite-time observers: |e|^beta and |e|^(2 beta - 1), from one root where there is one."""

import math

from numpy.typing import NDArray

from cosim.blocks.cube_root import HIGHEST, LOWEST, cube_root, cube_root_within


def common_root(beta: float) -> int:
    """Of which root r of e both |e|^beta and |e|^(2 beta - 1) are whole powers: 3, 4, or 0 for none of these."""
    if abs(beta - 2.0 / 3.0) < 1e-12:
        return 3
    if abs(beta - 3.0 / 4.0) < 1e-12:
        return 4
    return 0


def signed_powers(beta: float, root: int, s_1: NDArray, s_2: NDArray) -> None:
    """Replace e in `s_1` by sgn^beta(e), and write sgn^(2 beta - 1)(e) to `s_2`, where sgn^b(e) = sign(e) |e|^b.

    s_1, s_2: (n); root: `common_root(beta)`. The exponents 2/3 with 1/3, and 3/4 with 1/2, are what designs use; they
    cost no general power.
    """
    if root == 3:
        cube_roots(s_1, s_2)
        for q in range(s_1.size):
            r, e = s_2[q], s_1[q]
            s_1[q] = math.copysign(r * r, e)
            s_2[q] = math.copysign(r, e)
        return
    for q in range(s_1.size):
        e, size = s_1[q], abs(s_1[q])
        if root == 4:
            half = math.sqrt(size)
            s_1[q], s_2[q] = math.copysign(half * math.sqrt(half), e), math.copysign(half, e)
        else:
            s_1[q] = math.copysign(math.pow(size, beta), e)
            s_2[q] = math.copysign(math.pow(size, 2.0 * beta - 1.0), e)


def cube_roots(e: NDArray, roots: NDArray) -> None:
    """|e_q|^(1/3), all at once where no e_q is extreme; e, roots: (n)."""
    ordinary = True
    for q in range(e.size):
        ordinary &= LOWEST < abs(e[q]) < HIGHEST
    if ordinary:
        for q in range(e.size):
            roots[q] = cube_root_within(abs(e[q]))
    else:
        for q in range(e.size):
            roots[q] = cube_root(abs(e[q]))

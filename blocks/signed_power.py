"""The powers of the finite-time observers: |e|^beta and |e|^(2 beta - 1), from one root where there is one."""

import math

from blocks.cube_root import cube_root


def common_root(beta: float) -> int:
    """Of which root r of e both |e|^beta and |e|^(2 beta - 1) are whole powers: 3, 4, or 0 for none of these."""
    if abs(beta - 2.0 / 3.0) < 1e-12:
        return 3
    if abs(beta - 3.0 / 4.0) < 1e-12:
        return 4
    return 0


def signed_powers(e: float, beta: float, root: int) -> tuple[float, float]:
    """sgn^beta(e) and sgn^(2 beta - 1)(e), where sgn^b(e) = sign(e) |e|^b; root: `common_root(beta)`.

    The exponents 2/3 with 1/3, and 3/4 with 1/2, are what designs use; they cost no general power.
    """
    size = abs(e)
    if root == 3:
        r = cube_root(size)
        return math.copysign(r * r, e), math.copysign(r, e)
    if root == 4:
        half = math.sqrt(size)
        return math.copysign(half * math.sqrt(half), e), math.copysign(half, e)
    return math.copysign(math.pow(size, beta), e), math.copysign(math.pow(size, 2.0 * beta - 1.0), e)

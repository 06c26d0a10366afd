"""The cube root in plain arithmetic: several times faster than a power, and the same bits wherever it runs.

For sgn^(2/3) and sgn^(1/3) of (10) and (45) with beta_1 = 2/3, and for beta^(1/3) of (29).
"""

import math

import numpy as np

#: Between these, `cube_root_within` is right.
LOWEST, HIGHEST = 1e-280, 1e280


def cube_root(a: float) -> float:
    """The cube root of a number a >= 0, within one unit in the last place; infinity and NaN are handed on."""
    if LOWEST < a < HIGHEST:
        return cube_root_within(a)
    if not 0.0 < a < math.inf:
        return a
    if a < 1.0:
        return 2.0**-100 * cube_root_within(2.0**300 * a)
    return 2.0**100 * cube_root_within(2.0**-300 * a)


def cube_root_within(a: float) -> float:
    """The cube root of a number in (LOWEST, HIGHEST), without branches, so that several are found at once.

    Dividing the exponent field of a's bits by -3 gives a^(-1/3) to within 4 %, one step of fourth order to within
    2e-5. The root from it, cut to 17 bits so that its cube is exact, leaves a remainder u, and a Taylor series of
    (1 + u)^(1/3) finishes. The upper half of the bits, times 2^32 / 3, is a third of them in one multiplication.
    """
    guess = np.int64(0x553EEC6D51E95C00 - (np.float64(a).view(np.int64) >> 32) * 0x55555556).view(np.float64)
    e = 1.0 - a * guess * guess * guess
    inverse = guess * (1.0 + e * (1.0 / 3.0 + e * (2.0 / 9.0 + e * (14.0 / 81.0))))
    near = a * inverse * inverse
    shifted = near * (2.0**36 + 1.0)
    root = shifted - (shifted - near)
    cube = root * root * root
    u = (a - cube) / cube
    series = u * (1.0 / 3.0 - u * (1.0 / 9.0 - u * (5.0 / 81.0 - u * (10.0 / 243.0))))
    return root + root * series

"""The natural logarithm: log(x) = k ln(2) + log(m), with sqrt(1/2) <= m < sqrt(2), and s = f / (2 + f), f = m - 1.

log(1 + f) = f - f^2/2 + s (f^2/2 + R(s^2)). R is that of fdlibm's e_log.c (Sun Microsystems, 1993).
"""

from __future__ import annotations

import math
from typing import Any

from cosim.plain_math.operations import bits, polynomial, real, select
from cosim.plain_math.pairs import LN2, joined

_ONE = 1023 << 52
_LEAST = 0x3FE6A09E667F3BCD  # the bits of sqrt(1/2)
_LIFT = 18014398509481984.0  # 2^54
_SERIES = (
    *(6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01, 2.222219843214978396e-01),
    *(1.818357216161805012e-01, 1.531383769920937332e-01, 1.479819860511658591e-01),
)


def octaves(x: Any, least: int) -> tuple[Any, Any]:
    """k and m of x = 2^k m, positive and finite; least: the bits of the smallest m, of which no m is twice as large."""
    small = x < 2.2250738585072014e-308
    word = bits(select(small, x * _LIFT, x)) + (_ONE - least)
    k = real((word >> 52) | (0x433 << 52)) - select(small, 4503599627370496.0 + 1077.0, 4503599627370496.0 + 1023.0)
    return k, real((word & ((1 << 52) - 1)) + least)


def log(x: Any) -> Any:
    """The natural logarithm of x, within 0.85 ulp; of 0 -infinity, below NaN."""
    k, m = octaves(x, _LEAST)
    f = m - 1.0
    s = f / (2.0 + f)
    z = s * s
    half = 0.5 * f * f
    series = z * polynomial(z, _SERIES)
    first, rest = joined(k * LN2[0], f)
    y = first + (rest - (half - (s * (half + series) + k * LN2[1])))
    y = select(x < math.inf, y, x)  # NaN too
    return select(x > 0.0, y, select(x == 0.0, -math.inf, select(x < 0.0, math.nan, x)))

"""The exponential: e^x = 2^n e^r, with |r| <= ln(2)/2.

e^r = 1 + r + r^2/2 + r^3 q(r), with a polynomial q of least error (1e-3 ulp, by Remez' algorithm).
"""

from __future__ import annotations

from typing import Any

from cosim.plain_math.operations import ROUND, bits, polynomial, real, select
from cosim.plain_math.pairs import LN2, Pair, joined, upper

_PER_OCTAVE = 1.4426950408889634  # 1 / ln(2)
_SERIES = (
    *(0.16666666666666685, 0.04166666666666673, 0.008333333333316397, 0.001388888888885805, 0.00019841269897919576),
    *(2.4801587374533345e-05, 2.7557233364181443e-06, 2.7557232674804586e-07, 2.5112548073403137e-08),
    2.0927155537861314e-09,
)
_EXPONENT = 0x7FF << 52


def reduced(x: Any, rest: Any) -> tuple[Any, Any, Any]:
    """ROUND + n, and r as a sum of two, with x + rest = n ln(2) + r."""
    shifted = x * _PER_OCTAVE + ROUND
    n = shifted - ROUND
    high, low = x - n * LN2[0], n * LN2[1] - rest
    r = high - low
    return shifted, r, (high - r) - low


def exponential(high: Any, low: Any) -> Any:
    """e^(high + low), where |low| <= 2^-16: overflows to infinity, underflows gradually."""
    high = select(high > 710.0, 710.0, select(high < -746.0, -746.0, high))
    shifted, r, tail = reduced(high, low)
    one, rest = joined(1.0, r)
    y = one + (rest + (tail + r * r * polynomial(r, (0.5, *_SERIES))))
    octaves = bits(shifted) + 2046  # 2^n as two factors, so that both ends of the range are right
    first = (octaves << 51) & _EXPONENT
    return y * real(first) * real((octaves << 52) - first)


def exp(x: Any) -> Any:
    """e^x, within 0.7 ulp, of a subnormal number 0.8."""
    return exponential(x, 0.0)


def excess(x: Any) -> Pair:
    """e^x - 1 for 0 <= x <= 44, as the sum of two numbers, to 2^-57 of it."""
    shifted, r, tail = reduced(x, 0.0)
    head = upper(r)
    first, second = joined(r, 0.5 * head * head)
    rest = tail + (0.5 * (r - head) * (r + head) + r * r * r * polynomial(r, _SERIES))
    first, second = joined(first, second + rest)
    power = real((bits(shifted) + 1023) << 52)
    total, rest = joined(power - 1.0, power * first)
    return total, rest + power * second

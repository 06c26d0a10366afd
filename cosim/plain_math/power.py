"""Powers: |x|^y = e^(y log|x|), with the logarithm and the product in two parts each.

log(x) = k ln(2) + log(b) + 2/3 s (3 + s^2 + s^4 P(s^2)), with x = 2^k m, b = 1 or 3/2, s = (m - b) / (m + b) and
|s| < 0.102, after fdlibm's e_pow.c (Sun Microsystems, 1993). Special cases are those of C's `pow`.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.plain_math.exponential import exponential
from cosim.plain_math.logarithm import octaves
from cosim.plain_math.operations import SIGN, bits, polynomial, real, select
from cosim.plain_math.pairs import Pair, joined, upper

#: ln(2): the first part times a whole number below 2^11 is exact.
_LN2 = (0.693147180559890330, 5.497923018708371e-14)
_TWO_THIRDS = (0.6666666567325592, 9.934107462565104e-09)
_TWO_THIRDS_ROUNDED = 0.6666666666666666
_SERIES = (
    *(0.5999999999999999, 0.4285714285721559, 0.33333333250761044, 0.2727276153837671),
    *(0.23070502753339053, 0.20552878157578422),
)
_LEAST = 0x3FEBB67AE8584CAA  # the bits of sqrt(3)/2
_FAR = 1.224744871391589  # sqrt(3/2): above, m is compared with 3/2
_LOG_BASE = (0.4054651081081644, -2.8811380259626426e-18)  # log(3/2)
_WHOLE = 4503599627370496.0  # 2^52, from which on all numbers are
_MOST = 36893488147419103232.0  # 2^65: an exponent so large leads out of all numbers, or to 1


def pow(x: Any, y: Any) -> Any:  # noqa: A001  # its name for everybody
    """x to the power y, within 0.8 ulp."""
    size = abs(x)
    power = _positive(size, select(y > _MOST, _MOST, select(y < -_MOST, -_MOST, y)))
    power = select(size == 0.0, select(y < 0.0, math.inf, 0.0), power)
    power = select(size == math.inf, select(y < 0.0, 0.0, math.inf), power)
    length = abs(y)
    integer = (length >= _WHOLE) | (_rounded(length) == length)
    half = 0.5 * length
    odd = integer & ((half < _WHOLE) & (_rounded(half) != half))
    sign = bits(x) & SIGN
    power = real(select(odd, bits(power) | sign, bits(power)))
    power = select((x < 0.0) & (size < math.inf) & (integer ^ True), math.nan, power)
    power = select((x != x) | (y != y), math.nan, power)  # noqa: PLR0124  # NaN alone
    return select((y == 0.0) | (x == 1.0), 1.0, power)


def _rounded(size: Any) -> Any:
    return (size + _WHOLE) - _WHOLE


def _positive(x: Any, y: Any) -> Any:
    """A power of a positive number."""
    high, low = _logarithm(x)
    upper_y = upper(y)
    product = upper_y * high
    rest = (y - upper_y) * high + y * low
    return exponential(product, select(abs(product) < 800.0, rest, 0.0))


def _logarithm(x: Any) -> Pair:
    """The natural logarithm to some 2^-66 of it, as the sum of two, the first of which has 26 bits."""
    k, m = octaves(x, _LEAST)
    far = m > _FAR
    base = select(far, 1.5, 1.0)
    f = m - base
    inverse = 1.0 / (m + base)
    below = upper(m + base)
    below_rest = m - (below - base)
    s = f * inverse
    s_upper = upper(s)
    s_rest = ((f - s_upper * below) - s_upper * below_rest) * inverse
    z = s * s
    square = s_upper * s_upper
    rest = s_rest * (s_upper + s) + z * z * polynomial(z, _SERIES)
    factor = upper((3.0 + square) + rest)
    factor_rest = rest - ((factor - 3.0) - square)
    product = s_upper * factor
    product_rest = s_rest * factor + factor_rest * s
    series = upper(product + product_rest)
    series_rest = product_rest - (series - product)
    inner, inner_rest = joined(select(far, _LOG_BASE[0], 0.0), _TWO_THIRDS[0] * series)
    first, rest = joined(k * _LN2[0], inner)
    rest = (rest + inner_rest) + (_TWO_THIRDS[1] * series + _TWO_THIRDS_ROUNDED * series_rest)
    rest = rest + (k * _LN2[1] + select(far, _LOG_BASE[1], 0.0))
    total = upper(first + rest)
    return total, rest - (total - first)

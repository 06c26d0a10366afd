"""Powers: |x|^y = e^(y log|x|), with the logarithm and the product in two parts each.

log(1 + f) = 2 s + s^3 (2/3 + s^2 P(s^2)), with s = f / (2 + f), |s| < 0.172. Special cases are those of C's `pow`.
"""

from __future__ import annotations

import math
from typing import Any

from cosim.compiling.plain_math.exponential import exponential
from cosim.compiling.plain_math.logarithm import octaves
from cosim.compiling.plain_math.operations import SIGN, bits, polynomial, real, select
from cosim.compiling.plain_math.pairs import Pair, joined, multiplied

#: ln(2): the first part times a whole number below 2^11 is exact.
_LN2 = (0.693147180559890330, 5.497923018708371e-14)
_THIRD = (0.6666666666666666, 3.700743415417188e-17)  # 2/3
_SERIES = (
    *(0.4, 0.2857142857142938, 0.22222222221648977, 0.18181818336854544, 0.15384594815484784),
    *(0.13334812275690675, 0.1170604271435305, 0.11725119011623665),
)
_WHOLE = 4503599627370496.0  # 2^52, from which on all numbers are
_MOST = 36893488147419103232.0  # 2^65: an exponent so large leads out of all numbers, or to 1


def pow(x: Any, y: Any) -> Any:  # noqa: A001  # its name for everybody
    """x to the power y, within 0.7 ulp."""
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
    product, rest = multiplied(high, y)
    inside = abs(product) < 800.0
    return exponential(product, select(inside, rest + low * y, 0.0))


def _logarithm(x: Any) -> Pair:
    """The natural logarithm, as the sum of two, to some 2^-65 of it."""
    k, m = octaves(x)
    f = m - 1.0
    below = m + 1.0
    below_rest = m - (below - 1.0)
    s = f / below
    product, product_rest = multiplied(s, below)
    s_rest = (((f - product) - product_rest) - s * below_rest) / below
    square, square_rest = multiplied(s, s)
    square_rest = square_rest + 2.0 * s * s_rest
    factor, factor_rest = joined(_THIRD[0], square * polynomial(square, _SERIES))
    factor_rest = factor_rest + _THIRD[1]
    term, term_rest = multiplied(square, factor)
    term_rest = term_rest + (square * factor_rest + square_rest * factor)
    cube, cube_rest = multiplied(s, term)
    cube_rest = cube_rest + (s * term_rest + s_rest * term)
    first, rest = joined(2.0 * s, cube)
    total, total_rest = joined(k * _LN2[0], first)
    rest = total_rest + (rest + (2.0 * s_rest + cube_rest) + k * _LN2[1])
    return joined(total, rest)

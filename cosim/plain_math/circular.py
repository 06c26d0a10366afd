"""Sine and cosine: x = n pi/2 + r, with |r| <= pi/4 in two parts.

The polynomials, and how far pi/2 is taken apart, are those of fdlibm (Sun Microsystems, 1993).
"""

from __future__ import annotations

import math
from typing import Any

from cosim.plain_math.operations import ROUND, SIGN, bits, polynomial, real, select
from cosim.plain_math.pairs import joined
from cosim.plain_math.wide_angles import quarters

#: Below this, 2^19 pi/2, n has so few digits that its products with the first two parts of pi/2 are exact.
_NEAR = 823549.0
_PER_QUARTER = 6.36619772367581382433e-01  # 2 / pi
#: pi/2: three parts of 33 bits each, and the rest.
_QUARTER = (
    1.57079632673412561417e00,
    6.07710050630396597660e-11,
    2.02226624871116645580e-21,
    8.47842766036889956997e-32,
)
_SINE = (
    *(-1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04, 2.75573137070700676789e-06),
    *(-2.50507602534068634195e-08, 1.58969099521155010221e-10),
)
_COSINE = (
    *(4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05),
    *(-2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11),
)


def outside(x: Any) -> Any:
    """Whether `sin` and `cos` are wrong, as x is too large, and `wide_sin` and `wide_cos` are right."""
    return (abs(x) < _NEAR) ^ True


def sin(x: Any) -> Any:
    """The sine of x, within 0.85 ulp."""
    return select(x == 0.0, x, _of_quarter(*_reduced(x)))


def cos(x: Any) -> Any:
    """The cosine of x, within 0.85 ulp."""
    n, r, tail = _reduced(x)
    return _of_quarter(n + 1, r, tail)


def wide_sin(x: Any) -> Any:
    """The sine of a large x, within 0.85 ulp; of an infinite one NaN."""
    return select(abs(x) < math.inf, _of_quarter(*quarters(x)), math.nan)


def wide_cos(x: Any) -> Any:
    """The cosine of a large x, within 0.85 ulp; of an infinite one NaN."""
    n, r, tail = quarters(x)
    return select(abs(x) < math.inf, _of_quarter(n + 1, r, tail), math.nan)


def _reduced(x: Any) -> tuple[Any, Any, Any]:
    """An integer that is n modulo 4, and r as the sum of two.

    What is subtracted may be larger than what from: then there is nothing to round, as all bits lie
    between 2^-99 and 2^-13.
    """
    shifted = x * _PER_QUARTER + ROUND
    n = shifted - ROUND
    a, first = joined(x - n * _QUARTER[0], -(n * _QUARTER[1]))
    r, second = joined(a, -(n * _QUARTER[2]))
    return bits(shifted), r, (first + second) - n * _QUARTER[3]


def _of_quarter(n: Any, r: Any, tail: Any) -> Any:
    """The sine of n pi/2 + r + tail: that of r, or the cosine, of which only the coefficients are chosen."""
    odd = (n & 1) != 0
    z = r * r
    half = 0.5 * z
    one = 1.0 - half
    first = select(odd, one, r)
    rest = select(odd, ((1.0 - one) - half) - r * tail, tail - half * tail)
    series = polynomial(z, [select(odd, c, s) for c, s in zip(_COSINE, _SINE, strict=True)])
    y = first + (rest + select(odd, z * z, z * r) * series)
    return real(bits(y) ^ ((n << 62) & SIGN))

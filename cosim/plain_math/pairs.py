"""A real number as the exact sum of two float64: what a rounding leaves is the second. After Dekker and Knuth."""

from __future__ import annotations

from typing import Any

from cosim.plain_math.operations import bits, real

Pair = tuple[Any, Any]
#: ln(2): the first part times a whole number below 2^20 is exact.
LN2 = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
_UPPER = -1 << 27


def upper(x: Any) -> Any:
    """The 26 upper bits of a number: the product of two such is exact."""
    return real(bits(x) & _UPPER)


def joined(larger: Any, smaller: Any) -> Pair:
    """a + b for |a| >= |b|, or a = 0."""
    total = larger + smaller
    return total, smaller - (total - larger)


def added(a: Any, b: Any) -> Pair:
    """a + b."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def multiplied(a: Any, b: Any) -> Pair:
    """a b, but for 2^-106 of it, where neither overflows and the second is no subnormal number."""
    total = a * b
    high_a, high_b = upper(a), upper(b)
    low_a, low_b = a - high_a, b - high_b
    return total, ((high_a * high_b - total) + high_a * low_b + low_a * high_b) + low_a * low_b

"""The hyperbolic tangent: tanh(x) = E / (E + 2) with E = e^(2|x|) - 1, in two parts each."""

from __future__ import annotations

from typing import Any

from cosim.plain_math.exponential import excess
from cosim.plain_math.operations import select, signed
from cosim.plain_math.pairs import added, multiplied


def tanh(x: Any) -> Any:
    """The hyperbolic tangent of x, within 0.75 ulp."""
    size = abs(x)
    top, top_rest = excess(2.0 * select(size > 22.0, 22.0, size))
    bottom, bottom_rest = added(top, 2.0)
    inverse = 1.0 / bottom
    quotient = top * inverse
    product, product_rest = multiplied(quotient, bottom)
    left = ((top - product) - product_rest) + (top_rest - quotient * (bottom_rest + top_rest))
    return signed(quotient + left * inverse, x)

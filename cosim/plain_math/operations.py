"""What the functions of this folder are made of: operations that round once, or not at all.

Besides + - * / and comparisons of float64, and + - * & | ^ << >> of int64, which wraps. Each of them works on arrays of
numpy, as an oracle for tests, and on `Traced` values, of which code is made. A number is shifted right only where it is
not negative. Nothing branches: both values of a `select` are computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cosim.plain_math.traced import Traced

SIGN = -1 << 63
REST = (1 << 63) - 1
#: 1.5 * 2^52: adding it rounds to a whole number, which the low bits then are.
ROUND = 6755399441055744.0
ROUND_BITS = 0x4338000000000000


def select(condition: Any, first: Any, second: Any) -> Any:
    """The first value where a condition holds, else the second."""
    if isinstance(condition, Traced):
        return condition.select(first, second)
    return np.where(condition, first, second)


def bits(x: Any) -> Any:
    """The 64 bits of a float64, as an int64."""
    return x.bits() if isinstance(x, Traced) else np.asarray(x).view(np.int64)


def real(n: Any) -> Any:
    """The float64 that 64 bits are."""
    return n.real() if isinstance(n, Traced) else np.asarray(n).view(np.float64)


def sqrt(x: Any) -> Any:
    """The square root, correctly rounded."""
    return x.sqrt() if isinstance(x, Traced) else np.sqrt(x)


def pick(table: Sequence[int], index: Any) -> Any:
    """An entry of a table of int64."""
    return index.picked_from(tuple(table)) if isinstance(index, Traced) else np.array(table)[index]


def signed(x: Any, like: Any) -> Any:
    """A number that is not negative, with the sign of another one."""
    return real(bits(x) | (bits(like) & SIGN))


def whole(n: Any) -> Any:
    """A small int64, below 2^51, as a float64."""
    return real(n + ROUND_BITS) - ROUND


def polynomial(x: Any, coefficients: Sequence[float]) -> Any:
    """A polynomial with these coefficients, of 1 first: by Estrin's scheme, of which much can be done at once."""
    terms: list[Any] = list(coefficients)
    power = x
    while len(terms) > 1:
        pairs = [a + power * b for a, b in zip(terms[::2], terms[1::2], strict=False)]
        terms = pairs + terms[2 * len(pairs) :]
        power = power * power
    return terms[0]

"""The functions of real numbers that arithmetic in diagrams has: for values, in kernels and interpreted, the same.

They are compiled as an author's helpers are. A truth value is 1.0 or 0.0, or NaN where what is compared is no number:
neither a condition nor `min` or `max` hides that. In values, those that cosim computes itself take arrays too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

WHOLE = 4503599627370496.0  # from 2^52 on, every number is a whole one


def smaller(a: float, b: float) -> float:
    """The smaller number."""
    return a if a <= b or a != a else b  # noqa: PLR0124  # NaN


def larger(a: float, b: float) -> float:
    """The larger number."""
    return a if a >= b or a != a else b  # noqa: PLR0124  # NaN


def whole_below(a: float) -> float:
    """The largest whole number that is not above."""
    return float(math.floor(a)) if abs(a) < WHOLE else a


def whole_above(a: float) -> float:
    """The smallest whole number that is not below."""
    return float(math.ceil(a)) if abs(a) < WHOLE else a


def sign(a: float) -> float:
    """1, -1, or 0 of 0."""
    return 1.0 if a > 0.0 else -1.0 if a < 0.0 else a


def hypotenuse(a: float, b: float) -> float:
    """The root of the sum of two squares, which may be beyond the range of numbers themselves."""
    first, second = abs(a), abs(b)
    longer, shorter = (first, second) if first >= second else (second, first)
    if longer == 0.0 or longer == math.inf:  # noqa: PLR1714  # compiled
        return longer + shorter
    ratio = shorter / longer
    return longer * math.sqrt(1.0 + ratio * ratio)


def below(a: float, b: float) -> float:
    """Whether a < b."""
    return 1.0 if a < b else 0.0 if a >= b else math.nan


def at_most(a: float, b: float) -> float:
    """Whether a <= b."""
    return 1.0 if a <= b else 0.0 if a > b else math.nan


def equal(a: float, b: float) -> float:
    """Whether a == b."""
    return 1.0 if a == b else 0.0 if a < b or a > b else math.nan


def both(p: float, q: float) -> float:
    """Whether p and q; what q is does not matter where p is not."""
    return q if p == 1.0 else p


def either(p: float, q: float) -> float:
    """Whether p or q; what q is does not matter where p is."""
    return q if p == 0.0 else p


def opposite(p: float) -> float:
    """Whether not p."""
    return 1.0 - p


def chosen(p: float, a: float, b: float) -> float:
    """a where p, else b."""
    return a if p == 1.0 else b if p == 0.0 else p


PLAIN = ("sin", "cos", "exp", "log", "tanh", "atan2")
"""Those that cosim computes itself, besides powers."""


class NotRealError(ValueError):
    """A power that is no real number, which another power may hide."""


def plain(name: str, said: str = "", none: type[ValueError] = ValueError) -> Callable[..., Any]:
    """A function of numbers, or of arrays of them. It raises `none` or OverflowError where it has no value.

    said: what it is called where it raises, if not by its name.
    """

    def function(*numbers: Any) -> Any:
        from cosim.plain_math.evaluation import evaluated

        found = evaluated(name, *numbers)
        if np.isnan(found).any() and not any(np.isnan(number).any() for number in numbers):
            raise none(f"{said or name} has no value there")
        if np.isinf(found).any() and all(np.isfinite(number).all() for number in numbers):
            raise OverflowError(f"{said or name} is infinite there")
        return found

    return function


def root(a: Any) -> Any:
    """A square root, of a number or of an array of them."""
    return np.sqrt(a) if isinstance(a, np.ndarray) else math.sqrt(a)


@dataclass(frozen=True)
class Elementary:
    """A function of real numbers. least, most: of how many."""

    python: Callable[..., float]
    least: int = 1
    most: float = 1

    @property
    def count(self) -> str:
        """Of how many, in words."""
        if self.most == math.inf:
            return f"{self.least} numbers or more"
        if self.least < self.most:
            return f"{self.least} or {self.most:g} numbers"
        return f"{self.least} number{'s' if self.least > 1 else ''}"


FUNCTIONS: dict[str, Elementary] = {
    "sin": Elementary(math.sin),
    "cos": Elementary(math.cos),
    "tan": Elementary(math.tan),
    "asin": Elementary(math.asin),
    "acos": Elementary(math.acos),
    "atan": Elementary(math.atan),
    "atan2": Elementary(math.atan2, 2, 2),
    "sinh": Elementary(math.sinh),
    "cosh": Elementary(math.cosh),
    "tanh": Elementary(math.tanh),
    "asinh": Elementary(math.asinh),
    "acosh": Elementary(math.acosh),
    "atanh": Elementary(math.atanh),
    "sqrt": Elementary(math.sqrt),
    "exp": Elementary(math.exp),
    "log": Elementary(math.log, 1, 2),
    "log2": Elementary(math.log2),
    "log10": Elementary(math.log10),
    "abs": Elementary(abs),
    "sign": Elementary(sign),
    "min": Elementary(smaller, 2, math.inf),
    "max": Elementary(larger, 2, math.inf),
    "floor": Elementary(whole_below),
    "ceil": Elementary(whole_above),
    "hypot": Elementary(hypotenuse, 2, 2),
}
"""By the names that are written. `log` has a base as its second number; of several, `min` and `max` take two by two."""

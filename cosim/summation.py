"""Sums without rounding, so that they do not depend on order: a run's figures must not follow how it came in batches.

Every finite float64 is a whole number of 2**-1074, and Python's integers have no end. Numbers of one exponent are first
added up in float64, in two halves of their digits, which is exact for as few as `PART`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_LEAST_EXPONENT = -1073  # of np.frexp
_HIGH_BITS, _LOW_BITS = 27, 26  # of the 53 digits of a float64
PART = 2**16
"""How many numbers are added in float64: 2**16 halves below 2**27 stay far below 2**53, where that is exact."""


class ExactSum:
    """The exact sum of float64 numbers; NaN and infinities are added as IEEE 754 says, beside it."""

    def __init__(self) -> None:
        self.count = 0
        self._units = 0
        self._special = 0.0

    def add(self, values: NDArray[Any]) -> None:
        """Add all elements of an array."""
        flat = values.astype(float).ravel()
        self.count += flat.size
        finite = np.isfinite(flat)
        if not finite.all():
            with np.errstate(invalid="ignore"):
                self._special += float(flat[~finite].sum())
            flat = flat[finite]
        for first in range(0, flat.size, PART):
            self._add_finite(flat[first : first + PART])

    def mean(self) -> float:
        """The mean, correctly rounded. Raises: ZeroDivisionError without numbers."""
        if self._special != 0.0:
            return self._special
        return self._units / (self.count << (_LOW_BITS + _HIGH_BITS - _LEAST_EXPONENT))

    def _add_finite(self, values: NDArray[np.float64]) -> None:
        mantissas, exponents = np.frexp(values)
        scaled = mantissas * 2.0**_HIGH_BITS
        high = np.trunc(scaled)
        low = (scaled - high) * 2.0**_LOW_BITS
        exponents -= _LEAST_EXPONENT
        highs, lows = np.bincount(exponents, high), np.bincount(exponents, low)
        for exponent in np.flatnonzero((highs != 0.0) | (lows != 0.0)).tolist():
            self._units += ((int(highs[exponent]) << _LOW_BITS) + int(lows[exponent])) << exponent

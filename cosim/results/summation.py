"""Sums without rounding, so that they do not depend on order: a run's figures must not follow how it came in batches.

Every finite float64 is a whole number of 2**-1074, and Python's integers have no end. Numbers of one exponent are first
added up in float64, in two halves of their digits, which is exact for as few as `PART`.

Squares are rounded before they are added, each as if exponents had no end: those of very small and very large numbers
are taken of the numbers times a power of two.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

_LEAST_EXPONENT = -1073  # of np.frexp
_HIGH_BITS, _LOW_BITS = 27, 26  # of the 53 digits of a float64
PART = 2**16
"""How many numbers are added in float64: 2**16 halves below 2**27 stay far below 2**53, where that is exact."""


_UNIT_BITS = _LOW_BITS + _HIGH_BITS - _LEAST_EXPONENT
_SCALE_BITS = 600
_SMALL, _LARGE = 2.0**-511, 2.0**511
"""Squares of numbers in between have all their digits, and are finite."""
_SQUARES = 2.0**-1020, 2.0**1020
"""Squares within these bounds are of numbers between _SMALL and _LARGE, however they were rounded."""


class ExactSum:
    """The exact sum of float64 and of whole numbers; NaN and infinities are added as IEEE 754 says, beside it.

    units: the sum of the finite ones in units of 2**-1126. special: that of the others, 0.0 where there are none.
    """

    def __init__(self) -> None:
        self.count = 0
        self.units = 0
        self.special = 0.0

    def add(self, values: NDArray[Any]) -> None:
        """Add all elements of an array."""
        self.count += values.size
        if values.dtype.kind in "iu":
            self._add_whole(values)
            return
        flat = np.asarray(values, float).ravel()
        finite = np.isfinite(flat)
        if not finite.all():
            with np.errstate(invalid="ignore"):
                self.special += float(flat[~finite].sum())
            flat = flat[finite]
        for first in range(0, flat.size, PART):
            self._add_finite(flat[first : first + PART])

    def mean(self) -> float:
        """The mean, correctly rounded. Raises: ZeroDivisionError without numbers."""
        if self.special != 0.0:
            return self.special
        return self.units / (self.count << _UNIT_BITS)

    def state(self) -> dict[str, NDArray[Any]]:
        """What has been added, to the bit."""
        return {"count": np.array(self.count), "units": _bytes_of(self.units), "special": np.array(self.special)}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from a state."""
        self.count, self.special = int(state["count"]), float(state["special"])
        self.units = int.from_bytes(state["units"].tobytes(), "little", signed=True)

    def _add_whole(self, values: NDArray[Any]) -> None:
        """In halves of 32 bits: 64 bits have room for the sum of 2**31 of each."""
        wide = values.astype(np.uint64 if values.dtype.kind == "u" else np.int64)
        high, low = wide >> 32, wide & 0xFFFFFFFF
        self.units += ((int(high.sum()) << 32) + int(low.sum())) << _UNIT_BITS

    def _add_finite(self, values: NDArray[np.float64]) -> None:
        mantissas, exponents = np.frexp(values)
        scaled = mantissas * 2.0**_HIGH_BITS
        high = np.trunc(scaled)
        low = (scaled - high) * 2.0**_LOW_BITS
        exponents -= _LEAST_EXPONENT
        highs, lows = np.bincount(exponents, high), np.bincount(exponents, low)
        for exponent in np.flatnonzero((highs != 0.0) | (lows != 0.0)).tolist():
            self.units += ((int(highs[exponent]) << _LOW_BITS) + int(lows[exponent])) << exponent


class SquareSum:
    """The sum of the squares of numbers, exact but for the rounding of each square to 53 digits."""

    def __init__(self) -> None:
        self._between = ExactSum()
        self._small = ExactSum()  # of numbers times 2**_SCALE_BITS
        self._large = ExactSum()  # of numbers by 2**_SCALE_BITS

    @property
    def count(self) -> int:
        """How many numbers there are."""
        return self._between.count + self._small.count + self._large.count

    def add(self, values: NDArray[Any]) -> None:
        """Add the squares of all elements of an array."""
        flat = np.asarray(values, float).ravel()
        with np.errstate(over="ignore", under="ignore"):
            squares = np.square(flat)
        least, most = _SQUARES
        if squares.max(initial=0.0) <= most and not ((squares < least) & (flat != 0.0)).any():
            self._between.add(squares)
            return
        sizes = np.abs(flat)
        small, large = (sizes < _SMALL) & (sizes > 0.0), (sizes > _LARGE) & (sizes < math.inf)
        for part, chosen, power in ((self._small, small, _SCALE_BITS), (self._large, large, -_SCALE_BITS)):
            if chosen.any():
                part.add(np.square(np.ldexp(flat[chosen], power)))
        self._between.add(squares[~(small | large)])

    def state(self) -> dict[str, dict[str, NDArray[Any]]]:
        """As of `ExactSum`."""
        return {"between": self._between.state(), "small": self._small.state(), "large": self._large.state()}

    def restore(self, state: Mapping[str, Mapping[str, NDArray[Any]]]) -> None:
        """As of `ExactSum`."""
        self._between.restore(state["between"])
        self._small.restore(state["small"])
        self._large.restore(state["large"])

    def root_mean(self) -> float:
        """The square root of their mean. Raises: ZeroDivisionError without numbers."""
        if self._between.special != 0.0:
            return self._between.special
        scale = 2 * _SCALE_BITS
        units = self._small.units + (self._between.units << scale) + (self._large.units << 2 * scale)
        count = self.count << _UNIT_BITS + scale
        # The mean's own exponent may be beyond those of float64; half of it is not.
        half = (units.bit_length() - count.bit_length()) // 2
        return math.ldexp(math.sqrt((units << max(0, -2 * half)) / (count << max(0, 2 * half))), half)


def _bytes_of(number: int) -> NDArray[np.uint8]:
    """A whole number of any size."""
    return np.frombuffer(number.to_bytes(number.bit_length() // 8 + 1, "little", signed=True), np.uint8)

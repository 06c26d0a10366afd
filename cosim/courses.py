"""What variables did along a run, fed batch by batch: the extremes that conditions are judged by."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cosim.block import Course

Array = NDArray[Any]


class Courses:
    """The courses of one variable's members. A NaN stays the extreme from when it is seen."""

    def __init__(self, members: int) -> None:
        self.seen = False
        self._smallest = _Extremes(members)
        self._negated = _Extremes(members)

    def update(self, times: Array, samples: Array) -> None:
        """Take a batch: times (k,) in s and samples (k, *shape), the members first if there are several."""
        if samples.size:
            self.seen = True
            values = np.asarray(samples, float).reshape(len(times), self._smallest.values.size, -1)
            self._smallest.update(times, values.min(axis=2))
            self._negated.update(times, -values.max(axis=2))

    def of_members(self) -> list[Course]:
        """The course of each member."""
        low, high = self._smallest, self._negated
        return [Course(*map(float, row)) for row in zip(low.values, low.times, -high.values, high.times, strict=True)]


class _Extremes:
    """The smallest value of each member, and when it came first (s)."""

    def __init__(self, members: int) -> None:
        self.values = np.full(members, np.inf)
        self.times = np.full(members, np.nan)

    def update(self, times: Array, values: Array) -> None:
        """times: (k,); values: (k, members)."""
        at = values.argmin(axis=0)  # of a NaN, if there is one
        found = values[at, np.arange(at.size)]
        better = np.isnan(self.times) | (~(found >= self.values) & ~np.isnan(self.values))
        self.values = np.where(better, found, self.values)
        self.times = np.where(better, times[at], self.times)

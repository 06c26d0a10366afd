"""What variables did along a run, fed batch by batch: the extremes that conditions are judged by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cosim.authoring.rules import Course

Array = NDArray[Any]


class Courses:
    """The courses of one variable's members. A NaN stays the extreme from when it is seen."""

    def __init__(self, members: int) -> None:
        self.seen = False
        self._smallest = _Extremes(members, np.minimum, np.argmin)
        self._largest = _Extremes(members, np.maximum, np.argmax)

    def update(self, times: Array, samples: Array) -> None:
        """Take a batch: times (k,) in s and samples (k, *shape), the members first if there are several."""
        if samples.size:
            self.seen = True
            members = len(self._smallest.values)
            series = np.ascontiguousarray(samples.reshape(len(times), members, -1).transpose(1, 2, 0))
            self._smallest.update(times, series)
            self._largest.update(times, series)

    def state(self) -> dict[str, Any]:
        """What it has seen so far: arrays, to the bit."""
        return {"seen": np.array(self.seen), "smallest": self._smallest.state(), "largest": self._largest.state()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a state."""
        self.seen = bool(state["seen"])
        self._smallest.restore(state["smallest"])
        self._largest.restore(state["largest"])

    def of_members(self) -> list[Course]:
        """The course of each member."""
        low, high = self._smallest, self._largest
        columns = (low.exact(), low.times.tolist(), high.exact(), high.times.tolist())
        return [Course(*row) for row in zip(*columns, strict=True)]


class _Extremes:
    """The smallest or largest value of each member, and when it came first (s).

    pick, place: np.minimum and np.argmin, or np.maximum and np.argmax; a NaN is the extreme for all of them.
    """

    def __init__(self, members: int, pick: Any, place: Any) -> None:
        self.values = np.full(members, np.nan)
        self.times = np.full(members, np.nan)
        self._pick = pick
        self._place = place

    def update(self, times: Array, series: Array) -> None:
        """times: (k,); series: (members, elements, k)."""
        found = self._pick.reduce(self._pick.reduce(series, axis=2), axis=1)
        if found.dtype.kind in "iu" and np.isnan(self.times).all():
            self.values = np.zeros(len(found), found.dtype)  # a float64 holds no integer beyond 2^53
        unseen, lost = np.isnan(self.times), np.isnan(self.values)
        better = unseen | (~lost & (np.isnan(found) | (self._pick(found, self.values) != self.values)))
        if better.any():
            self.values[better] = found[better]
            self.times[better] = times[self._place(self._pick.reduce(series[better], axis=1), axis=1)]

    def state(self) -> dict[str, Any]:
        """As of `Courses`."""
        return {"values": self.values, "times": self.times}

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Courses`."""
        self.values, self.times = state["values"], state["times"]

    def exact(self) -> list[Any]:
        """The extremes, of integers as such."""
        return (self.values if self.values.dtype.kind in "iu" else self.values.astype(float)).tolist()

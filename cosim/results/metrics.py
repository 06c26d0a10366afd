"""Figures of a run: reductions of one signal over time, fed batch by batch, so that memory does not grow with the run.

A reduction takes the samples whose times lie in its window, bounds included. Bounds are compared with a relative
tolerance of 1e-9, because sample times are rounded products of the step.

Every figure has the same bits however the samples come in batches. A NaN among the samples makes `max`, `min`, `mean`
and `rms` NaN; an infinity counts as one: it is the largest or smallest, and makes the mean infinite.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cosim.errors import MetricError, nearest
from cosim.results.summation import ExactSum, SquareSum

Array = NDArray[Any]
WINDOW_TOLERANCE = 1e-9
NOT_FINITE = ("nan", "inf", "-inf")
"""What has no number in JSON, as text."""


class Reduction(ABC):
    """One figure of one signal; `value()` is None while no sample has fallen into the window."""

    name: ClassVar[str]
    unit: ClassVar[str | None] = None
    """The unit of the value where it is not the signal's."""

    def __init__(self, start: float | None, stop: float | None, dtype: np.dtype[Any], shape: tuple[int, ...]) -> None:
        self.start = start
        self.stop = stop
        self.dtype = dtype
        self.shape = shape
        if any(bound is not None and not math.isfinite(bound) for bound in (start, stop)):
            raise MetricError("the time window of a metric is not finite", fix="leave an open end out")
        if start is not None and stop is not None and start > stop:
            raise MetricError(
                f"the time window from {start:g} s to {stop:g} s is empty", fix="`from` must not exceed `to`"
            )

    def reaches(self, time: float) -> bool:
        """Whether the window goes as far as a time (s), or farther."""
        return self._inside(np.array([time])).stop == 1

    def holds_sample(self, step: float, steps: int) -> bool:
        """Whether one of the times 0, step, …, steps · step (s) lies in the window."""
        near = math.floor(min(max((self.start or 0.0) / step - 1.0, 0.0), steps))
        times = step * np.arange(near, min(near + 4, steps + 1))
        inside = self._inside(times)
        return inside.start < inside.stop

    def unit_from(self, unit: str) -> str:
        """The value's unit, from the signal's."""
        return self.unit or unit

    def update(self, times: Array, samples: Array) -> None:
        """Take a batch: times (k,) in s, never decreasing, and samples (k, *shape). Keeps no reference to either."""
        inside = self._inside(times)
        if samples[inside].size:
            self._take(times[inside], samples[inside])

    @abstractmethod
    def value(self) -> Any:
        """A number, a list, or None if the window held no sample. A NaN or infinity among the samples shows."""

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """What it has made of the samples so far: arrays, to the bit."""

    @abstractmethod
    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a state of such a reduction."""

    @abstractmethod
    def _take(self, times: Array, samples: Array) -> None:
        """Take a batch that lies in the window and is not empty."""

    def _inside(self, times: Array) -> slice[int, int]:
        first, last = 0, len(times)
        if self.start is not None:
            first = int(np.searchsorted(times, self.start - WINDOW_TOLERANCE * abs(self.start), "left"))
        if self.stop is not None:
            last = int(np.searchsorted(times, self.stop + WINDOW_TOLERANCE * abs(self.stop), "right"))
        return slice(first, last)

    def __str__(self) -> str:
        match self.start, self.stop:
            case None, None:
                return self.name
            case start, None:
                return f"{self.name}, from {start:g} s"
            case None, stop:
                return f"{self.name}, to {stop:g} s"
            case start, stop:
                return f"{self.name}, {start:g}–{stop:g} s"


class Maximum(Reduction):
    """Largest of all elements at all times."""

    name = "max"
    pick: ClassVar[Any] = np.maximum

    def __init__(self, *signal: Any) -> None:
        super().__init__(*signal)
        self._extreme: Any = None

    def _take(self, times: Array, samples: Array) -> None:
        # np.maximum and np.minimum hand NaN on, as Python's max and min do not.
        extreme = self.pick.reduce(samples, axis=None)
        self._extreme = extreme if self._extreme is None else self.pick(self._extreme, extreme)

    def state(self) -> dict[str, Any]:
        """As of `Reduction`."""
        return _given(extreme=self._extreme)

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Reduction`."""
        self._extreme = state["extreme"][()] if "extreme" in state else None

    def value(self) -> float | None:
        """As of `Reduction`."""
        if self._extreme is None:
            return None
        value = self._extreme.item()
        return value + 0.0 if isinstance(value, float) else value  # of 0.0 and -0.0, whichever came first is "largest"


class Minimum(Maximum):
    """Smallest of all elements at all times."""

    name = "min"
    pick = np.minimum


class Mean(Reduction):
    """Arithmetic mean of all elements of all samples, correctly rounded."""

    name = "mean"

    def __init__(self, *signal: Any) -> None:
        super().__init__(*signal)
        self._sum = ExactSum()

    def _take(self, times: Array, samples: Array) -> None:
        self._sum.add(samples)

    def state(self) -> dict[str, Any]:
        """As of `Reduction`."""
        return self._sum.state()

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Reduction`."""
        self._sum.restore(state)

    def value(self) -> float | None:
        """As of `Reduction`."""
        return self._sum.mean() if self._sum.count else None


class RootMeanSquare(Reduction):
    """Square root of the mean square of all elements of all samples, of numbers of any size."""

    name = "rms"

    def __init__(self, *signal: Any) -> None:
        super().__init__(*signal)
        self._squares = SquareSum()

    def _take(self, times: Array, samples: Array) -> None:
        self._squares.add(samples)

    def state(self) -> dict[str, Any]:
        """As of `Reduction`."""
        return self._squares.state()

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Reduction`."""
        self._squares.restore(state)

    def value(self) -> float | None:
        """As of `Reduction`."""
        return self._squares.root_mean() if self._squares.count else None


class Final(Reduction):
    """The last sample: a number, or nested lists for an array."""

    name = "final"

    def __init__(self, *signal: Any) -> None:
        super().__init__(*signal)
        self._last: Array | None = None

    def _take(self, times: Array, samples: Array) -> None:
        self._last = np.array(samples[-1])

    def state(self) -> dict[str, Any]:
        """As of `Reduction`."""
        return _given(last=self._last)

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Reduction`."""
        self._last = state.get("last")

    def value(self) -> Any:
        """As of `Reduction`."""
        return None if self._last is None else self._last.tolist()


class Events(Final):
    """What happened when: a block keeps rows [numbers of the members…, time], NaN in those not used yet.

    The rows of the last sample count, as far as their own times lie in the window; sorted by time. `value` raises
    MetricError where a row is no event.
    """

    name = "events"
    unit = "s"

    def __init__(self, *signal: Any) -> None:
        super().__init__(*signal)
        self._now = 0.0
        if self.dtype.kind != "f" or len(self.shape) < 2 or self.shape[-1] < 2:
            raise MetricError(
                f"`events` needs a float matrix with rows [members…, time], not {self.dtype} of shape {self.shape}",
                fix="use the output of a block that records events, or reduce with `final`",
            )

    def holds_sample(self, step: float, steps: int) -> bool:
        """As of `Reduction`; events may happen between two steps."""
        ends = self._inside(np.array([0.0, step * steps]))
        return ends.start < 2 and ends.stop > 0

    def update(self, times: Array, samples: Array) -> None:
        """As of `Reduction`; the window is one of the rows' own times."""
        if samples.size:
            self._now = float(times[-1])
            self._take(times, samples)

    def state(self) -> dict[str, Any]:
        """As of `Reduction`."""
        return {**super().state(), "now": np.array(self._now)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Reduction`."""
        super().restore(state)
        self._now = float(state["now"])

    def value(self) -> list[dict[str, Any]] | None:
        """As of `Reduction`."""
        if self._last is None:
            return None
        rows = self._last.reshape(-1, self.shape[-1])
        rows = rows[~np.isnan(rows).all(axis=1)]
        self._refuse_what_is_no_event(rows)
        rows = rows[np.argsort(rows[:, -1], kind="stable")]
        return [_event(row[:-1], row[-1]) for row in rows[self._inside(rows[:, -1])]]

    def _refuse_what_is_no_event(self, rows: Array) -> None:
        members, times = rows[:, :-1], rows[:, -1]
        latest = self._now * (1 + WINDOW_TOLERANCE)
        with np.errstate(invalid="ignore"):
            sound = ((members >= 1) & (members % 1 == 0)).all(axis=1) & (times >= 0) & (times <= latest)
        if not sound.all():
            row = ", ".join(f"{number:.6g}" for number in rows[int(sound.argmin())])
            raise MetricError(
                f"`events` found the row [{row}], which is not [numbers of members from 1, a time of the run]",
                fix="use the output of a block that records events, or reduce with `final`",
            )


class First(Reduction):
    """When a boolean first became true: a time for a scalar; for an array one event for each element that did."""

    name = "first"
    unit = "s"

    def __init__(self, *signal: Any) -> None:
        super().__init__(*signal)
        if self.dtype.kind != "b":
            raise MetricError(f"`first` needs a boolean signal, not {self.dtype}", fix="use `max`, `min` or `final`")
        self._times: Array | None = None

    def _take(self, times: Array, samples: Array) -> None:
        if self._times is None:
            self._times = np.full(self.shape, np.nan)
        found = times[samples.argmax(axis=0)]
        self._times = np.where(np.isnan(self._times) & samples.any(axis=0), found, self._times)

    def state(self) -> dict[str, Any]:
        """As of `Reduction`."""
        return _given(times=self._times)

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Reduction`."""
        self._times = state.get("times")

    def value(self) -> float | list[dict[str, Any]] | None:
        """As of `Reduction`."""
        if self._times is None:
            return None
        if not self.shape:
            return None if np.isnan(self._times) else self._times.item()
        members = np.argwhere(~np.isnan(self._times))
        events = [_event(index + 1, self._times[tuple(index)]) for index in members]
        return sorted(events, key=lambda event: event["time"])


REDUCTIONS: dict[str, type[Reduction]] = {
    kind.name: kind for kind in (Maximum, Minimum, Mean, RootMeanSquare, Final, Events, First)
}


def reduction(
    name: str,
    start: float | None = None,
    stop: float | None = None,
    dtype: Any = float,
    shape: tuple[int, ...] = (),
) -> Reduction:
    """The reduction of that name over start ≤ t ≤ stop (s; None is an open end) of a signal of that type and shape.

    Raises: MetricError for an unknown name, an impossible window, or a signal that the reduction does not fit.
    """
    if name not in REDUCTIONS:
        raise MetricError(f"unknown reduction `{name}`", fix=nearest(name, REDUCTIONS))
    return REDUCTIONS[name](start, stop, np.dtype(dtype), tuple(shape))


def for_json(value: Any) -> Any:
    """The same value with texts for "nan", "inf" and "-inf", which JSON does not have; numpy scalars become numbers.

    So null is left for what has no value at all. `from_json` gives the numbers back.
    """
    if isinstance(value, Mapping):
        return {key: for_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [for_json(item) for item in value]
    if isinstance(value, np.generic):
        return for_json(value.item())
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def from_json(value: Any) -> Any:
    """A metric, or a mapping or list of them, as it was before `for_json`: no metric is a text."""
    if isinstance(value, Mapping):
        return {key: from_json(item) for key, item in value.items()}
    if isinstance(value, list):
        return [from_json(item) for item in value]
    return float(value) if value in NOT_FINITE else value


def _given(**values: Any) -> dict[str, Any]:
    """The values that there are, as arrays."""
    return {name: np.array(value) for name, value in values.items() if value is not None}


def _event(members: Array, time: Any) -> dict[str, Any]:
    """One event; a single member is a number, two are a pair."""
    numbers = [int(member) for member in members]
    who: dict[str, Any] = {"member": numbers[0]} if len(numbers) == 1 else {"pair": numbers}
    return {**who, "time": float(time)}

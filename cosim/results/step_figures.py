"""Figures that control engineers give of a response: how fast, how far beyond, how much error along it.

The samples in the window are kept, as most of these figures need to know where the signal ends. Between two samples it
is taken to run along a line. Of an array, each element has its figure, and the largest is given.

Names and definitions follow the usual ones: Franklin, Powell and Emami-Naeini, Feedback Control of Dynamic Systems,
section 3.4, and for integrals of the error Graham and Lathrop, AIEE Transactions 72 (1953) 273–288.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from cosim.errors import MetricError
from cosim.results.metrics import Array, Reduction, reduction

RISE = 0.1, 0.9
"""Between which parts of the way the rise time is taken."""


class StepFigure(Reduction):
    """A figure of all samples in the window. takes: its options with their defaults, None for what it finds itself."""

    takes: ClassVar[Mapping[str, float | None]] = {}

    def __init__(self, *signal: Any) -> None:
        super().__init__(*signal)
        if self.dtype.kind not in "fiu":
            raise MetricError(
                f"`{self.name}` needs a signal of numbers, not {self.dtype}", fix="use `first` or `final`"
            )
        self.options: dict[str, float | None] = dict(self.takes)
        self._times: list[Array] = []
        self._rows: list[Array] = []

    def configure(self, options: Mapping[str, float]) -> None:
        """Take options. Raises: MetricError for one that it does not have."""
        for name in options:
            if name not in self.takes:
                own = ", ".join(self.takes) or "none"
                raise MetricError(f"`{name}` does not go with `reduce: {self.name}`", fix=f"its options: {own}")
        self.options |= options

    def _take(self, times: Array, samples: Array) -> None:
        self._times.append(np.array(times))
        self._rows.append(np.array(samples, float).reshape(len(times), -1))

    def state(self) -> dict[str, Any]:
        """As of `Reduction`."""
        return {} if not self._times else {"times": np.concatenate(self._times), "rows": np.concatenate(self._rows)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Reduction`."""
        self._times, self._rows = ([state["times"]], [state["rows"]]) if state else ([], [])

    def value(self) -> float | None:
        """As of `Reduction`; None too where an element has no such figure."""
        if not self._times:
            return None
        times, rows = np.concatenate(self._times), np.concatenate(self._rows)
        if not np.isfinite(rows).all():
            return math.nan
        found = [self.of(times, course) for course in self.elements(rows).T]
        known = [figure for figure in found if figure is not None]
        return max(known) if len(known) == len(found) and known else None

    def elements(self, rows: Array) -> Array:
        """What the figure is taken of: all elements (k, elements), or one course made of them (k, 1)."""
        return rows

    @abstractmethod
    def of(self, times: Array, course: Array) -> float | None:
        """The figure of one element: times (k,) in s, course (k,), k > 0."""

    def __str__(self) -> str:
        said = [f"{k} {value:g}" for k, value in self.options.items() if value is not None and not math.isnan(value)]
        return ", ".join([super().__str__(), *said])


class _Error(StepFigure):
    takes: ClassVar[Mapping[str, float | None]] = {"reference": 0.0}

    def of(self, times: Array, course: Array) -> float:
        """As of `StepFigure`."""
        reference = self.options["reference"] or 0.0
        return float(np.trapezoid(self.weighed(times - times[0], course - reference), times))

    def weighed(self, since: Array, error: Array) -> Array:
        """What is integrated, of an error and the time since the window's begin (s)."""
        raise NotImplementedError

    def unit_from(self, unit: str) -> str:
        """As of `Reduction`."""
        return f"{unit}.s" if unit else ""


class AbsoluteError(_Error):
    """IAE: the integral of |y - reference|."""

    name = "iae"

    def weighed(self, since: Array, error: Array) -> Array:
        """As of `_Error`."""
        return np.abs(error)


class SquaredError(_Error):
    """ISE: the integral of (y - reference)^2."""

    name = "ise"

    def weighed(self, since: Array, error: Array) -> Array:
        """As of `_Error`."""
        return np.square(error)

    def unit_from(self, unit: str) -> str:
        """As of `Reduction`."""
        return f"({unit})2.s" if unit else ""


class TimedError(_Error):
    """ITAE: the integral of t |y - reference|, with t from the window's begin."""

    name = "itae"

    def weighed(self, since: Array, error: Array) -> Array:
        """As of `_Error`."""
        return since * np.abs(error)

    def unit_from(self, unit: str) -> str:
        """As of `Reduction`."""
        return f"{unit}.s2" if unit else ""


class _Response(StepFigure):
    """A figure of the way from the first sample to the reference, or where none is given to the last sample."""

    takes: ClassVar[Mapping[str, float | None]] = {"reference": None}

    def progress(self, course: Array) -> Array | None:
        """How much of the way has been made, 0 at the begin and 1 at the reference; None where there is no way."""
        given = self.options["reference"]
        end = float(course[-1]) if given is None else given
        way = end - float(course[0])
        return None if way == 0.0 else (course - course[0]) / way


class SettlingTime(_Response):
    """From when on the signal stays within a band around its end; none where it does not stay.

    band: in parts of the way; within: in the signal's unit, in its place.
    """

    name = "settling_time"
    unit = "s"
    takes: ClassVar[Mapping[str, float | None]] = {"reference": None, "band": 0.02, "within": None}

    def configure(self, options: Mapping[str, float]) -> None:
        """As of `StepFigure`."""
        if {"band", "within"} <= options.keys():
            raise MetricError("`band` and `within` both say how near", fix="leave one of them out")
        super().configure({**options, "band": math.nan} if "within" in options else options)

    def of(self, times: Array, course: Array) -> float | None:
        """As of `StepFigure`."""
        made, band, within = self.progress(course), self.options["band"], self.options["within"]
        assert band is not None
        if within is not None:
            given = self.options["reference"]
            made, band = 1.0 + (course - (course[-1] if given is None else given)) / within, 1.0
        if made is None:
            return 0.0
        outside = np.flatnonzero(np.abs(made - 1.0) > band)
        if not outside.size:
            return 0.0
        last = int(outside[-1])
        if last == len(made) - 1:
            return None
        edge = 1.0 + math.copysign(band, made[last] - 1.0)
        return _when(times, made, last, edge) - float(times[0])


class RiseTime(_Response):
    """How long the signal takes from a tenth to nine tenths of its way, where it first comes to each."""

    name = "rise_time"
    unit = "s"

    def of(self, times: Array, course: Array) -> float | None:
        """As of `StepFigure`."""
        made = self.progress(course)
        if made is None:
            return None
        reached = [_first(times, made, part) for part in RISE]
        return None if reached[0] is None or reached[1] is None else reached[1] - reached[0]


class Overshoot(_Response):
    """How far the signal goes beyond its end at most, in per cent of its way."""

    name = "overshoot"
    unit = "%"

    def of(self, times: Array, course: Array) -> float | None:
        """As of `StepFigure`."""
        made = self.progress(course)
        return None if made is None else max(100.0 * (float(made.max()) - 1.0), 0.0)


class TimeOfMaximum(StepFigure):
    """When the largest of all elements is largest, first."""

    name = "time_of_max"
    unit = "s"
    sign: ClassVar[float] = 1.0

    def elements(self, rows: Array) -> Array:
        """As of `StepFigure`."""
        found: Array = (self.sign * rows).max(axis=1, keepdims=True)
        return found

    def of(self, times: Array, course: Array) -> float:
        """As of `StepFigure`."""
        return float(times[course.argmax()])


class TimeOfMinimum(TimeOfMaximum):
    """When the smallest of all elements is smallest, first."""

    name = "time_of_min"
    sign = -1.0


class Percentile(StepFigure):
    """What so many per cent of the samples do not exceed, between two of them along a line."""

    name = "percentile"
    takes: ClassVar[Mapping[str, float | None]] = {"percent": 95.0}

    def of(self, times: Array, course: Array) -> float:
        """As of `StepFigure`."""
        percent = self.options["percent"]
        assert percent is not None
        return float(np.percentile(course, percent))


def _first(times: Array, made: Array, part: float) -> float | None:
    """When a part of the way is first reached (s); None where it never is."""
    reached = np.flatnonzero(made >= part)
    if not reached.size:
        return None
    first = int(reached[0])
    return float(times[0]) if first == 0 else _when(times, made, first - 1, part)


def _when(times: Array, made: Array, k: int, level: float) -> float:
    """When the line from sample k to the next crosses a level (s)."""
    part = (level - made[k]) / (made[k + 1] - made[k])
    return float(times[k] + part * (times[k + 1] - times[k]))


STEP_FIGURES: dict[str, type[StepFigure]] = {
    kind.name: kind
    for kind in (
        AbsoluteError,
        SquaredError,
        TimedError,
        SettlingTime,
        RiseTime,
        Overshoot,
        TimeOfMaximum,
        TimeOfMinimum,
        Percentile,
    )
}


def reduced_by(
    name: str, options: Mapping[str, float], start: float | None, stop: float | None, dtype: Any, shape: tuple[int, ...]
) -> Reduction:
    """The reduction of that name, as of `metrics.reduction`, with options. Raises: MetricError."""
    if name not in STEP_FIGURES:
        for option in options:
            raise MetricError(f"`{option}` does not go with `reduce: {name}`", fix=f"remove `{option}`")
        return reduction(name, start, stop, dtype, shape)
    made = STEP_FIGURES[name](start, stop, np.dtype(dtype), tuple(shape))
    made.configure(options)
    return made

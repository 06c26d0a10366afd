"""What keeps, along a run, by how much a condition holds from the run's begin: no more of its samples than it needs."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.errors import FormulaError
from cosim.requirements.extrema import NEAR
from cosim.requirements.terms import Array, Quantity, Samples, spreader

Bounds = tuple[Array, Array]
"""The lowest and the highest that a robustness may yet be, (*shape) each; equal where it is settled."""


@dataclass(frozen=True)
class Moment:
    """What decides a robustness: a time (s), and an element, from 0 along each axis, with the axes' fleets."""

    time: float
    element: tuple[int, ...]
    fleets: tuple[str | None, ...]


class Judge(ABC):
    """A condition from the run's begin.

    margin: its shape, fleets and unit. words: the numbers that it takes for each sample of the run, at most, about.
    """

    margin: Quantity
    words = 0

    @abstractmethod
    def update(self, times: Array, samples: Samples) -> None:
        """Take a batch: times (k,) in s, rising, and samples (k, *shape)."""

    @abstractmethod
    def bounds(self, ended: bool) -> Bounds:
        """What the robustness may be; ended: whether the run has come to its end."""

    @abstractmethod
    def decisive(self, element: tuple[int, ...]) -> Moment:
        """What decides the robustness of an element."""

    @property
    def empty(self) -> str:
        """A window that has passed between two samples, so that nothing is known of it, in words; mostly none."""
        return ""

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """What it has made of the samples so far: arrays, to the bit."""

    @abstractmethod
    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a state of such a judge."""


class AtStart(Judge):
    """A condition of one instant: at the first sample."""

    def __init__(self, margin: Quantity) -> None:
        self.margin = margin
        self._value: Array | None = None
        self._time = 0.0

    def update(self, times: Array, samples: Samples) -> None:
        """As of `Judge`."""
        if self._value is None and len(times):
            self._time = float(times[0])
            self._value = course(self.margin, times[:1], {key: s[:1] for key, s in samples.items()})[0]

    def bounds(self, ended: bool) -> Bounds:
        """As of `Judge`."""
        return unknown(self.margin) if self._value is None else (self._value, self._value)

    def decisive(self, element: tuple[int, ...]) -> Moment:
        """As of `Judge`."""
        return Moment(self._time, element, self.margin.fleets)

    def state(self) -> dict[str, Any]:
        """As of `Judge`."""
        return {} if self._value is None else {"value": self._value, "time": np.array(self._time)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Judge`."""
        self._value = state.get("value")
        self._time = float(state.get("time", 0.0))


class Extreme(Judge):
    """A condition of one instant at all times of a window, or at any of them: the extreme of its margin so far.

    start, stop: the window (s), bounds included.
    """

    def __init__(self, margin: Quantity, every: bool, start: float, stop: float) -> None:
        self.margin = margin
        self._every, self._start, self._stop = every, start, stop
        self._extreme = np.full(margin.shape, math.inf if every else -math.inf)
        self._when = np.full(margin.shape, math.nan)
        self._elements = np.arange(math.prod(margin.shape))
        self._now = -math.inf

    def update(self, times: Array, samples: Samples) -> None:
        """As of `Judge`."""
        self._now = float(times[-1]) if len(times) else self._now
        begin = int(np.searchsorted(times, self._start * (1.0 - NEAR), "left"))
        end = int(np.searchsorted(times, self._stop * (1.0 + NEAR), "right"))
        if begin >= end:
            return
        within = samples if end - begin == len(times) else {key: s[begin:end] for key, s in samples.items()}
        self._take(times[begin:end], _course(self.margin, end - begin, within))

    def _take(self, times: Array, margins: Array) -> None:
        """Take margins (k, *shape), of which one that is no number is an extreme to `argmin`."""
        by_element = margins.reshape(len(margins), -1)
        at = by_element.argmin(axis=0) if self._every else by_element.argmax(axis=0)
        found = by_element[at, self._elements].reshape(self.margin.shape)
        _refuse_no_number(found, times, margins)
        further = (found < self._extreme if self._every else found > self._extreme) | np.isnan(self._when)
        if further.any():
            self._extreme = np.where(further, found, self._extreme)
            self._when = np.where(further, times[at].reshape(self.margin.shape), self._when)

    def bounds(self, ended: bool) -> Bounds:
        """As of `Judge`."""
        low, high = unknown(self.margin)
        if not self._seen:
            return low, high
        if self._now >= self._stop * (1.0 - NEAR) or (ended and math.isinf(self._stop)):
            return self._extreme, self._extreme
        return (low, self._extreme) if self._every else (self._extreme, high)

    @property
    def empty(self) -> str:
        """As of `Judge`."""
        passed = self._now >= self._stop * (1.0 - NEAR) and not self._seen
        return f"[{self._start:g}, {self._stop:g}]" if passed else ""

    @property
    def _seen(self) -> bool:
        """Whether there was a sample within the window."""
        return not np.isnan(self._when).all()

    def decisive(self, element: tuple[int, ...]) -> Moment:
        """As of `Judge`."""
        return Moment(float(self._when[element]), element, self.margin.fleets)

    def state(self) -> dict[str, Any]:
        """As of `Judge`."""
        return {"extreme": self._extreme, "when": self._when, "now": np.array(self._now)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Judge`."""
        self._extreme, self._when, self._now = state["extreme"], state["when"], float(state["now"])


class Opposite(Judge):
    """What holds where another condition does not."""

    def __init__(self, operand: Judge) -> None:
        self.margin, self._operand = operand.margin, operand
        self.words = operand.words

    def update(self, times: Array, samples: Samples) -> None:
        """As of `Judge`."""
        self._operand.update(times, samples)

    def bounds(self, ended: bool) -> Bounds:
        """As of `Judge`."""
        low, high = self._operand.bounds(ended)
        return -high, -low

    def decisive(self, element: tuple[int, ...]) -> Moment:
        """As of `Judge`."""
        return self._operand.decisive(element)

    @property
    def empty(self) -> str:
        """As of `Judge`."""
        return self._operand.empty

    def state(self) -> dict[str, Any]:
        """As of `Judge`."""
        return self._operand.state()

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Judge`."""
        self._operand.restore(state)


class Together(Judge):
    """What holds where all of several conditions do, or any of them. margin: of all of them."""

    def __init__(self, margin: Quantity, every: bool, operands: Sequence[Judge]) -> None:
        self.margin, self._every, self._operands = margin, every, operands
        self.words = sum(operand.words for operand in operands)
        self._ended = False

    def update(self, times: Array, samples: Samples) -> None:
        """As of `Judge`."""
        for operand in self._operands:
            operand.update(times, samples)

    def bounds(self, ended: bool) -> Bounds:
        """As of `Judge`."""
        self._ended = ended
        pick = np.minimum if self._every else np.maximum
        lows, highs = zip(*(self._spread(operand) for operand in self._operands), strict=True)
        return pick.reduce(lows), pick.reduce(highs)

    def _spread(self, operand: Judge) -> Bounds:
        """The bounds of an operand, for all elements."""
        spread = spreader(operand.margin.shape, self.margin.shape)
        low, high = (np.broadcast_to(spread(b[None])[0], self.margin.shape) for b in operand.bounds(self._ended))
        return low, high

    def decisive(self, element: tuple[int, ...]) -> Moment:
        """As of `Judge`: of the operand that decides, by what is settled of it."""
        found = [self._spread(operand) for operand in self._operands]
        of = [high if self._every else low for low, high in found]
        pick = np.argmin if self._every else np.argmax
        operand = self._operands[int(pick([values[element] for values in of]))]
        return operand.decisive(element[: len(operand.margin.shape)])

    @property
    def empty(self) -> str:
        """As of `Judge`."""
        return next((operand.empty for operand in self._operands if operand.empty), "")

    def state(self) -> dict[str, Any]:
        """As of `Judge`."""
        return {str(k): operand.state() for k, operand in enumerate(self._operands)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Judge`."""
        for k, operand in enumerate(self._operands):
            operand.restore(state.get(str(k), {}))


def course(margin: Quantity, times: Array, samples: Samples) -> Array:
    """The course (k, *shape) of a margin. Raises: FormulaError where it is no number."""
    found = _course(margin, len(times), samples)
    _refuse_no_number(found, times, found)
    return found


def _course(margin: Quantity, count: int, samples: Samples) -> Array:
    """The same of so many samples, whether or not it is a number."""
    with np.errstate(all="ignore"):
        found = margin.of(samples)
    shape = (count, *margin.shape)
    return found if found.shape == shape else np.broadcast_to(found, shape)


def _refuse_no_number(found: Array, times: Array, margins: Array) -> None:
    """Raises: FormulaError if something that was `found` of margins (k, *shape) at times (k,) is no number."""
    if np.isnan(found).any():
        when = times[np.argwhere(np.isnan(margins))[0][0]]
        fix = "keep what it compares finite, and roots and logarithms within their domains"
        raise FormulaError(f"its margin is no number at t = {when:g} s", fix=fix)


def unknown(margin: Quantity) -> Bounds:
    """The bounds of what nothing is known of."""
    return np.full(margin.shape, -math.inf), np.full(margin.shape, math.inf)

"""A condition with windows within windows: the courses of its margins are kept, and judged when all has been seen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cosim.language.formula_tree import Condition, Junction, Not, Temporal, Until, conditions, horizon, is_open
from cosim.requirements.extrema import NEAR
from cosim.requirements.gaps import gap, gaps
from cosim.requirements.judges import Bounds, Judge, Moment, course, unknown
from cosim.requirements.operators import Operators
from cosim.requirements.terms import Array, Quantity, Samples

WORK = 4
"""Courses that an operator has beside those that it is of, and its own."""


class Deferred(Judge):
    """margin: of the whole; margins: of each part that is of one instant."""

    def __init__(
        self, condition: Condition, margin: Quantity, margins: Mapping[Condition, Quantity], native: bool
    ) -> None:
        self.margin = margin
        self._condition, self._margins, self._native = condition, margins, native
        self._open = is_open(condition)
        kept = 1 + sum(math.prod(one.shape) for one in margins.values())
        self.words = kept + (windows(condition) + WORK) * math.prod(margin.shape)
        self._empty = ""
        self._gaps: dict[Condition, Array] = {}
        self._times: list[Array] = []
        self._courses: dict[Condition, list[Array]] = {part: [] for part in margins}
        self._robustness: dict[Condition, Array] = {}  # (*shape, k) of each part, as far as it has a margin

    def update(self, times: Array, samples: Samples) -> None:
        """As of `Judge`."""
        if not len(times) or self._is_seen(False):
            return
        self._times.append(np.array(times))
        for part, margin in self._margins.items():
            self._courses[part].append(np.array(np.moveaxis(course(margin, times, samples), 0, -1)))

    def _is_seen(self, ended: bool) -> bool:
        """Whether nothing that is still to come can change the robustness."""
        now = float(self._times[-1][-1]) if self._times else -math.inf
        return now >= horizon(self._condition) * (1.0 - NEAR) and (ended or not self._open)

    def bounds(self, ended: bool) -> Bounds:
        """As of `Judge`."""
        if not self._is_seen(ended):
            return unknown(self.margin)
        times = self._joined_times()
        value = self._of(self._condition, times, Operators(self._native, times))[..., 0]
        self._empty = gap(self._condition, self._gaps, times) if self._gaps else ""
        return unknown(self.margin) if self._empty else (value, value)

    @property
    def empty(self) -> str:
        """As of `Judge`."""
        return self._empty

    def _joined_times(self) -> Array:
        self._times = [np.concatenate(self._times)]
        return self._times[0]

    def _of(self, part: Condition, times: Array, operators: Operators) -> Array:
        """The robustness (*shape, k) of a part at the first samples, as many as have one."""
        if part not in self._robustness:
            self._robustness[part] = self._computed(part, times, operators)
        return self._robustness[part]

    def _computed(self, part: Condition, times: Array, operators: Operators) -> Array:
        if part in self._margins:
            self._courses[part] = [np.concatenate(self._courses[part], axis=-1)]
            return self._courses[part][0]
        match part:
            case Not(operand):
                return -self._of(operand, times, operators)
            case Junction(every, operands):
                pick: Any = np.minimum if every else np.maximum
                joined: Array = pick.reduce(self._alike([self._of(o, times, operators) for o in operands]))
                return joined
            case Temporal(every, start, stop, operand):
                moving = operators.lowest if every else operators.highest
                found = moving(self._of(operand, times, operators), start, stop)
            case Until():
                found = self._until(part, times, operators)
            case _:
                raise AssertionError(part)
        found = found[..., : self._count(part, times)]
        if part.start > 0.0 and np.isinf(found).any():
            self._gaps[part] = gaps(times, part, found.shape[-1])
        return found

    def _until(self, part: Until, times: Array, operators: Operators) -> Array:
        """`right` within the window, and `left` until a time in it or later at which `right` holds, and up to it.

        Donzé, Ferrère and Maler, Efficient robust monitoring for STL, CAV 2013, lemma 1.
        """
        left, right = self._alike([self._of(one, times, operators) for one in (part.left, part.right)])
        times = times[: left.shape[-1]]
        begin = np.searchsorted(times, (times + part.start) * (1.0 - NEAR), "left")
        later = operators.until(left, right)
        after = np.where(begin < len(times), later[..., np.minimum(begin, len(times) - 1)], -math.inf)
        if part.start > 0.0:
            after = np.minimum(after, operators.before(left, part.start))
        found: Array = np.minimum(operators.highest(right, part.start, part.stop), after)
        return found

    def _count(self, part: Condition, times: Array) -> int:
        """How many samples have as much behind them as a part looks ahead."""
        return max(int(np.searchsorted(times, (times[-1] - horizon(part)) * (1.0 + NEAR), "right")), 1)

    @staticmethod
    def _alike(courses: Sequence[Array]) -> list[Array]:
        """Courses with the axes of the one that has most, and as long as the shortest."""
        size, shape = min(c.shape[-1] for c in courses), max((c.shape[:-1] for c in courses), key=len)
        more = [c[..., :size].reshape(*c.shape[:-1], *(1,) * (len(shape) + 1 - c.ndim), size) for c in courses]
        return [np.broadcast_to(c, (*shape, size)) for c in more]

    # ---- what decides ----

    def decisive(self, element: tuple[int, ...]) -> Moment:
        """As of `Judge`."""
        if not self._robustness:
            return Moment(math.nan, element, self.margin.fleets)
        return self._decisive(self._condition, 0, element)

    def _decisive(self, part: Condition, at: int, element: tuple[int, ...]) -> Moment:
        """What decides a part's robustness at a sample."""
        if part in self._margins:
            margin = self._margins[part]
            return Moment(float(self._times[0][at]), element[: len(margin.shape)], margin.fleets)
        match part:
            case Not(operand):
                return self._decisive(operand, at, element)
            case Junction(every, operands):
                values = [self._value(operand, element)[at] for operand in operands]
                return self._decisive(operands[_extreme(values, every)], at, element)
            case Temporal(every, start, stop, operand):
                course = self._value(operand, element)
                first, last = self._window(at, start, stop, len(course))
                return self._decisive(operand, first + _extreme(course[first:last], every), element)
            case Until():
                return self._decisive_until(part, at, element)
        raise AssertionError(part)

    def _decisive_until(self, part: Until, at: int, element: tuple[int, ...]) -> Moment:
        left, right = self._value(part.left, element), self._value(part.right, element)
        first, last = self._window(at, part.start, part.stop, min(len(left), len(right)))
        before = np.minimum.accumulate(np.concatenate([[math.inf], left[at:last]]))[first - at : last - at]
        found = np.minimum(right[first:last], before)
        best = int(np.argmax(found))
        if right[first + best] <= before[best]:
            return self._decisive(part.right, first + best, element)
        return self._decisive(part.left, at + int(np.argmin(left[at : first + best])), element)

    def _value(self, part: Condition, element: tuple[int, ...]) -> Array:
        """The robustness (k,) of an element, or of what it is an element of."""
        found: Array = self._robustness[part][element[: self._robustness[part].ndim - 1]]
        return found

    def _window(self, at: int, start: float, stop: float, size: int) -> tuple[int, int]:
        """The first sample of a window from a sample on, and the one behind its last."""
        times = self._times[0][:size]
        first = int(np.searchsorted(times, (times[at] + start) * (1.0 - NEAR), "left"))
        return first, int(np.searchsorted(times, (times[at] + stop) * (1.0 + NEAR), "right"))

    # ---- checkpoints ----

    def state(self) -> dict[str, Any]:
        """As of `Judge`."""
        if not self._times:
            return {}
        courses = {str(k): np.concatenate(self._courses[p], axis=-1) for k, p in enumerate(self._margins)}
        return {"times": np.concatenate(self._times), "courses": courses}

    def restore(self, state: Mapping[str, Any]) -> None:
        """As of `Judge`."""
        if "times" in state:
            self._times = [state["times"]]
            self._courses = {part: [state["courses"][str(k)]] for k, part in enumerate(self._margins)}


def windows(condition: Condition) -> int:
    """How many temporal operators a condition has."""
    return isinstance(condition, Temporal | Until) + sum(windows(part) for part in conditions(condition))


def _extreme(values: Any, every: bool) -> int:
    return int(np.argmin(values) if every else np.argmax(values))

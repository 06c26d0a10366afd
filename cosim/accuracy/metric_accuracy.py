"""How sure a metric is: a number by its limit; what is counted by whether it is the same at all steps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cosim.accuracy import limit as limits
from cosim.accuracy.accuracies import AGREES, CHANGES, Accuracy, ErrorPart
from cosim.accuracy.limit import NO_ORDER, ORDER, ROUNDING, UNSETTLED, Limit
from cosim.accuracy.refined_runs import Observation
from cosim.accuracy.refinement import COUPLING, INTEGRATION, TOTAL, Refinement, Triple
from cosim.results.formatting import format_seconds, format_value
from cosim.results.metrics import Array, for_json

WORST_FIRST = (NO_ORDER, UNSETTLED, ORDER, ROUNDING)


class MetricJudge:
    """Judges metrics by runs with the steps of TOTAL; with those of INTEGRATION and COUPLING, their parts too.

    highest: the order up to which theory goes. steps: how many steps of integration the longest run has.
    """

    def __init__(self, runs: Mapping[Refinement, Observation], highest: int, steps: int) -> None:
        self._runs, self._highest, self._steps = runs, highest, steps
        self._elsewhere = next((refinement for refinement in runs if refinement.lies_elsewhere), None)

    def judge(self, name: str, unit: str, doubted: str = "") -> Accuracy:
        """A metric's accuracy. doubted: why it has no order, where that is known."""
        runs = [self._runs[refinement] for refinement in TOTAL]
        values = tuple(run.observed.figures[name] for run in runs)
        rows = _numbers(values)
        if rows is None:
            runs += [self._runs[self._elsewhere]] if self._elsewhere else []
            counted = _events if all(map(_are_events, values)) else _counted
            return counted([run.observed.figures[name] for run in runs], [run.step for run in runs], unit)
        courses = [run.observed.course(name) for run in runs]
        believed = not doubted and limits.falls(courses[0], courses[1], courses[2], self._noise(name, rows))
        found = self._limits(name, TOTAL, believed, self._elsewhere)
        errors = tuple(max(map(Limit.error, found, row)) for row in rows.tolist())
        kind, order = _worst(found)
        accuracy = Accuracy(kind, order, unit, values, errors, float(np.abs(rows[0]).max()), tuple(found))
        accuracy.said = doubted if kind == NO_ORDER else ""
        if all(refinement in self._runs for refinement in (*COUPLING, *INTEGRATION)):
            accuracy.coupling = self._part(name, COUPLING, believed)
            accuracy.integration = self._part(name, INTEGRATION, believed)
        return accuracy

    def _limits(self, name: str, triple: Triple, believed: bool, elsewhere: Refinement | None = None) -> list[Limit]:
        """The limit of each element of a metric; none where they are no numbers."""
        chosen = [self._runs[refinement].observed for refinement in (*triple, *([elsewhere] if elsewhere else []))]
        rows = _numbers([observed.smooth(name) for observed in chosen])
        if rows is None:
            return []
        noise = self._noise(name, rows)
        ratio = elsewhere.step(1.0) if elsewhere else 0.0
        return [
            limits.limit(column[:3], self._highest, noise, believed, (ratio, column[3]) if elsewhere else None)
            for column in rows.T.tolist()
        ]

    def _noise(self, name: str, rows: Array) -> float:
        """How large the rounding error of a metric may be: that of the largest numbers on its way."""
        course = self._runs[TOTAL[0]].observed.course(name)
        largest = np.abs(course[np.isfinite(course)]).max(initial=float(np.abs(rows).max()))
        return limits.noise(float(largest), self._steps)

    def _part(self, name: str, triple: Triple, believed: bool) -> ErrorPart | None:
        found = self._limits(name, triple, believed)
        rows = _numbers([self._runs[triple[0]].observed.smooth(name)])
        if not found or rows is None or len(rows[0]) != len(found):
            return None
        kind, order = _worst(found)
        if len(found) == 1 and order is not None:
            return ErrorPart(found[0].offset(float(rows[0, 0])), kind, order, signed=True)
        return ErrorPart(max(map(Limit.error, found, rows[0].tolist())), kind, order)


def error(accuracy: Accuracy, name: str, run: Observation) -> float:
    """By how much a metric, by its name, may be off in another run; infinite where that has no number."""
    rows = _numbers([run.observed.figures[name]])
    if rows is None or len(rows[0]) != len(accuracy.limits):
        return math.inf
    return max(map(Limit.error, accuracy.limits, rows[0].tolist()))


def _worst(found: Sequence[Limit]) -> tuple[str, float | None]:
    """The kind of the least certain limit, and the order of the widest one if all have one."""
    kind = min((one.kind for one in found), key=WORST_FIRST.index)
    return kind, None if kind == NO_ORDER else max(found, key=lambda one: one.high - one.low).order


def _numbers(values: Sequence[Any]) -> Array | None:
    """Metrics as rows of numbers, those left out that are not finite and the same in all; None if that is not so."""
    if not all(map(_is_real, values)):
        return None
    arrays = [np.ravel(np.asarray(value, float)) for value in values]
    if len({array.shape for array in arrays}) > 1:
        return None
    rows = np.array(arrays)
    finite = np.isfinite(rows).all(axis=0)
    others = rows[:, ~finite]
    same = all(np.array_equal(others[0], other, equal_nan=True) for other in others)
    return rows[:, finite] if same and finite.any() else None


def _is_real(value: Any) -> bool:
    """Whether a metric is a float, or nested lists of such."""
    return isinstance(value, float) or (isinstance(value, list) and bool(value) and all(map(_is_real, value)))


def _are_events(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(event, Mapping) for event in value)


def _counted(values: Sequence[Any], steps: Sequence[float], unit: str) -> Accuracy:
    """What is the same, or is not."""
    kept = tuple(values[: len(TOTAL)])
    if all(for_json(value) == for_json(values[0]) for value in values):
        return Accuracy(AGREES, unit=unit, values=kept)
    return Accuracy(CHANGES, unit=unit, values=kept, said=_changes([format_value(v) for v in values], steps))


def _events(values: Sequence[list[Any]], steps: Sequence[float], unit: str) -> Accuracy:
    """Events agree if the same happened; their times are those of steps, so no surer than the finest of these."""
    kept = tuple(values[: len(TOTAL)])
    happened = [sorted(events, key=_who) for events in values]
    names = [[_who(event) for event in events] for events in happened]
    if any(others != names[0] for others in names):
        counts = [str(len(events)) for events in values]
        lists = [", ".join("–".join(map(str, who)) for who in row) or "none" for row in names]
        return Accuracy(
            CHANGES, unit=unit, values=kept, said=_changes(counts if len(set(counts)) > 1 else lists, steps)
        )
    times = np.array([[event["time"] for event in events] for events in happened[: len(TOTAL)]])
    found = [limits.limit(column, 1, 0.0, believed=False) for column in times.T.tolist()]
    errors = tuple(max(map(Limit.error, found, row)) + steps[2] for row in times.tolist()) if found else ()
    return Accuracy(AGREES, unit=unit, values=kept, errors=errors, limits=tuple(found))


def _who(event: Mapping[str, Any]) -> list[int]:
    """The members that an event is of."""
    return list(event["pair"]) if "pair" in event else [event["member"]]


def _changes(words: Sequence[str], steps: Sequence[float]) -> str:
    at = ", ".join(f"{word} at {format_seconds(step, 3)}" for word, step in zip(words, steps, strict=True))
    return f"{at}: depends on the step"

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

Limits = Mapping[int, Limit]
"""The limit of each element of a metric, by its number, of those that are finite."""
WORST_FIRST = (NO_ORDER, UNSETTLED, ORDER, ROUNDING)


class MetricJudge:
    """Judges metrics by runs with the steps of TOTAL; with those of INTEGRATION and COUPLING, their parts too.

    highest: the order up to which theory goes. steps: how many steps of integration the longest run has.
    """

    def __init__(self, runs: Mapping[Refinement, Observation], highest: int, steps: int) -> None:
        self._runs, self._highest, self._steps = runs, highest, steps
        self._elsewhere = next((refinement for refinement in runs if refinement.lies_elsewhere), None)
        self._early = next((refinement for refinement in runs if refinement.early), None)

    def judge(self, name: str, unit: str, doubted: str = "") -> Accuracy:
        """A metric's accuracy. doubted: why it has no order, where that is known."""
        runs = [self._runs[refinement] for refinement in TOTAL]
        values = tuple(run.observed.figures[name] for run in runs)
        rows = _rows(values)
        if rows is None:
            return self._counted(name, runs, unit)
        courses = [run.observed.course(name) for run in runs]
        believed = not doubted and limits.falls(courses[0], courses[1], courses[2], self._noise(name, rows))
        found = self._limits(name, TOTAL, believed, self._elsewhere, self._early)
        errors = tuple(_largest_error(found, row) for row in rows)
        kind, order = _worst(found)
        size = max(abs(float(rows[0, k])) for k in found)
        accuracy = Accuracy(kind, order, unit, values, errors, size, found)
        accuracy.said = doubted if kind == NO_ORDER else ""
        if all(refinement in self._runs for refinement in (*COUPLING, *INTEGRATION)):
            accuracy.coupling = self._part(name, COUPLING, believed)
            accuracy.integration = self._part(name, INTEGRATION, believed)
        return accuracy

    def _limits(self, name: str, triple: Triple, believed: bool, *beside: Refinement | None) -> Limits:
        """The limit of each element of a metric that is a finite number; none where they are no numbers.

        beside: the run whose steps lie elsewhere, and the one that stops early.
        """
        rows = _rows([self._runs[refinement].observed.smooth(name) for refinement in triple])
        if rows is None:
            return {}
        ratio, noise = self._elsewhere.step(1.0) if self._elsewhere else 1.0, self._noise(name, rows)
        most = limits.most_noise(noise, self._steps)
        elsewhere, early = (self._known(name, refinement, rows.shape[1]) for refinement in beside or (None, None))
        found = {}
        for k, column in enumerate(rows.T.tolist()):
            if all(map(math.isfinite, column)):
                at = (ratio, elsewhere[k]) if k in elsewhere else None
                cut = (early[k], most) if k in early else None
                found[k] = limits.limit(column, self._highest, noise, believed, at, cut)
        return found

    def _known(self, name: str, refinement: Refinement | None, size: int) -> dict[int, float]:
        """The elements of a metric that are finite numbers in a run, of so many."""
        row = _rows([self._runs[refinement].observed.smooth(name)]) if refinement else None
        known = row is not None and row.shape[1] == size
        return {k: x for k, x in enumerate(row[0].tolist()) if math.isfinite(x)} if row is not None and known else {}

    def _noise(self, name: str, rows: Array) -> float:
        """How large the rounding error of a metric may be: that of the largest numbers on its way."""
        course = self._runs[TOTAL[0]].observed.course(name)
        numbers = np.concatenate([np.ravel(course), np.ravel(rows)])
        return limits.noise(float(np.abs(numbers[np.isfinite(numbers)]).max(initial=0.0)), self._steps)

    def _part(self, name: str, triple: Triple, believed: bool) -> ErrorPart | None:
        found = self._limits(name, triple, believed)
        rows = _rows([self._runs[triple[0]].observed.smooth(name)])
        if not found or rows is None:
            return None
        kind, order = _worst(found)
        if rows.shape[1] == 1 and order is not None:
            return ErrorPart(found[0].offset(float(rows[0, 0])), kind, order, signed=True)
        return ErrorPart(_largest_error(found, rows[0]), kind, order)

    def _counted(self, name: str, runs: Sequence[Observation], unit: str) -> Accuracy:
        """Of what is no number."""
        beside = [self._runs[self._elsewhere]] if self._elsewhere else []
        runs = [*runs, *(run for run in beside if run.observed.figures[name] is not None)]
        values, steps = [run.observed.figures[name] for run in runs], [run.step for run in runs]
        return (_events if all(map(_are_events, values)) else _counted)(values, steps, unit)


def error(accuracy: Accuracy, name: str, run: Observation) -> float:
    """By how much a metric, by its name, may be off in another run; infinite where that has no number."""
    rows = _rows([run.observed.figures[name]])
    fits = rows is not None and rows.shape[1] > max(accuracy.limits, default=0)
    return _largest_error(accuracy.limits, rows[0]) if fits and rows is not None else math.inf


def _largest_error(found: Limits, row: Array) -> float:
    """Of all elements that have a limit; infinite if one of them is no number here."""
    errors = [limit.error(float(row[k])) for k, limit in found.items()]
    return max(errors) if all(map(math.isfinite, errors)) else math.inf


def _worst(found: Limits) -> tuple[str, float | None]:
    """The kind of the least certain limit, and the order of the widest one if all have one."""
    kind = min((one.kind for one in found.values()), key=WORST_FIRST.index)
    return kind, None if kind == NO_ORDER else max(found.values(), key=lambda one: one.high - one.low).order


def _rows(values: Sequence[Any]) -> Array | None:
    """Metrics that are numbers, a row each; None if they are not, or not finite at places that are not the same."""
    if not all(map(_is_real, values)):
        return None
    arrays = [np.ravel(np.asarray(value, float)) for value in values]
    if len({array.shape for array in arrays}) > 1:
        return None
    rows = np.array(arrays)
    finite = np.isfinite(rows).all(axis=0)
    others = rows[:, ~finite]
    same = all(np.array_equal(others[0], other, equal_nan=True) for other in others)
    return rows if same and finite.any() else None


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
    return Accuracy(AGREES, unit=unit, values=kept, errors=errors, limits=dict(enumerate(found)))


def _who(event: Mapping[str, Any]) -> list[int]:
    """The members that an event is of."""
    return list(event["pair"]) if "pair" in event else [event["member"]]


def _changes(words: Sequence[str], steps: Sequence[float]) -> str:
    at = ", ".join(f"{word} at {format_seconds(step, 3)}" for word, step in zip(words, steps, strict=True))
    return f"{at}: depends on the step"

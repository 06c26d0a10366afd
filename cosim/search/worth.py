"""What values of free parameters are worth: the objective over some runs, and what of their bounds is not kept."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cosim.errors import ExpressionError
from cosim.language import expression
from cosim.language.elementary import FUNCTIONS
from cosim.study.definition import Bounds, Tuning
from cosim.study.member_run import Row

HEAVY = 10.0
"""What a bound that is not kept costs, in objectives, beside by how much it is not."""
LOST = 1e6
"""What a run costs that has no figure."""


@dataclass(frozen=True)
class Worth:
    """The mean objective over some runs, None where one has none; broken: what they do not keep, in words.

    cost: the objective, relative to that of the values before, and what `broken` adds.
    """

    objective: float | None
    broken: tuple[str, ...]
    cost: float


class Yardstick:
    """How runs are judged. scale: the objective of the values before; expected: the conditions that have to hold."""

    def __init__(self, tuning: Tuning, scale: float, expected: frozenset[str]) -> None:
        self._tuning, self._scale, self._expected = tuning, scale, expected

    def worth(self, rows: Sequence[Row]) -> Worth:
        """What the runs of one candidate are worth."""
        broken: dict[str, float] = {}
        values = [self._of(row, broken) for row in rows]
        known = [value for value in values if value is not None]
        mean = sum(known) / len(known) if len(known) == len(rows) else None
        penalty = sum(HEAVY * (1.0 + min(size, 100.0)) for size in broken.values())
        cost = LOST if mean is None else mean / self._scale
        return Worth(mean, tuple(broken), cost + penalty)

    def _of(self, row: Row, broken: dict[str, float]) -> float | None:
        """The objective of a run; what it does not keep goes to `broken`, with by how much."""
        if row["status"] != "completed":
            broken[f"a run {row['status']}: {row['reason']}"] = 100.0
            return None
        metrics = row["metrics"]
        for bounds in self._tuning.subject:
            _note(broken, bounds, metrics.get(bounds.signal))
        for name, (holds, _) in row["requirements"].items():
            if holds is not True:
                margin = metrics.get(name)
                broken[name] = max(broken.get(name, 0.0), abs(margin) if margin is not None else 1.0)
        for name, holds in row["conditions"].items():
            if name in self._expected and holds is False:
                broken[name] = 1.0
        return objective(self._tuning, metrics)


def objective(tuning: Tuning, metrics: Mapping[str, Any]) -> float | None:
    """The objective of a run; None where one of its metrics has no number."""
    names = expression.names(tuning.objective.value)
    found = {name: metrics[name] for name in names if isinstance(metrics.get(name), int | float)}
    try:
        value = expression.evaluate(tuning.objective.value, found)
    except ExpressionError:
        return None
    return value if math.isfinite(value) else None


def figures(tuning: Tuning) -> list[str]:
    """The metrics that the objective and the bounds name."""
    names = expression.names(tuning.objective.value) - {*expression.CONSTANTS, *FUNCTIONS}
    return [*sorted(names), *(b.signal for b in tuning.subject if b.signal not in names)]


def _note(broken: dict[str, float], bounds: Bounds, value: Any) -> None:
    if not isinstance(value, int | float) or math.isnan(value):
        broken[f"{bounds.signal} has no value"] = 1.0
        return
    sides = ((bounds.least, bounds.least - value, "least"), (bounds.most, value - bounds.most, "most"))
    for limit, beyond, word in sides:
        if beyond > 0.0:
            text = f"{bounds.signal} is at {word} {limit:g}"
            broken[text] = max(broken.get(text, 0.0), beyond / (abs(limit) or 1.0))


def changed_by(tuning: Tuning, rows: Sequence[Row], finer: Sequence[Row]) -> float:
    """By how much, of their size, the figures change with a smaller step at most; infinite where one is lost."""
    most = 0.0
    for row, fine in zip(rows, finer, strict=True):
        if fine["status"] != "completed":
            return math.inf
        for name in figures(tuning):
            a, b = row["metrics"].get(name), fine["metrics"].get(name)
            if not isinstance(a, int | float) or not isinstance(b, int | float):
                continue  # constants of the objective
            most = max(most, abs(a - b) / abs(b) if b else (0.0 if a == b else math.inf))
    return most

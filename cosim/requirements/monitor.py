"""A requirement along a run: fed with samples as they come, it tells by how much the run keeps it.

What lies between two samples is not seen. A condition whose windows reach beyond the samples has no margin there, and
what looks at all times to the end looks at those at which it has one. Robustness is that of Fainekos and Pappas,
Robustness of temporal logic specifications for continuous-time signals, Theoretical Computer Science 410 (2009).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from cosim.language.formula_tree import (
    Condition,
    Junction,
    Not,
    Temporal,
    Until,
    conditions,
    horizon,
    is_instant,
    is_open,
    mentions,
)
from cosim.requirements.deferred import Deferred
from cosim.requirements.judges import AtStart, Extreme, Judge, Moment, Opposite, Together
from cosim.requirements.margins import alike, margin
from cosim.requirements.terms import Array, Quantity, Samples, Scope, joined


@dataclass(frozen=True)
class Robustness:
    """By how much a requirement is kept.

    margin: positive where it is kept, in its unit; None where too little has been seen. settled: whether nothing that
    would still come could change it; where it is not, the margin is the least, or the most, that it may be. moment:
    what decides it. reason: why there is no margin.
    """

    margin: float | None
    settled: bool
    unit: str
    moment: Moment | None
    reason: str = ""

    @property
    def holds(self) -> bool | None:
        """Whether it is kept; None where nobody can say."""
        return None if self.margin is None else self.margin > 0.0


class Monitor:
    """A requirement's judge.

    Raises: FormulaError, WrongUnit, and what the scope's `look` raises.
    """

    def __init__(self, condition: Condition, scope: Scope) -> None:
        self._scope = scope
        named = list(mentions(condition))
        if not named:
            raise scope.refused("the formula names no signal", 0, "write block.port, such as plant.x")
        if is_instant(condition):
            fix = "write always(…) or eventually(…); of the begin alone, always[0, 0](…)"
            raise scope.refused("the formula says nothing of when it has to hold", 0, fix)
        self._condition = condition
        self.keys: tuple[Any, ...] = tuple(dict.fromkeys(scope.look(m.signal, None).key for m in named))
        self._judge = self._judged(condition)

    @property
    def unit(self) -> str:
        """The unit of its margin, "" where that is not known."""
        return self._judge.margin.label

    @property
    def words(self) -> int:
        """The numbers that it takes for each sample of the run, at most, about; 0 where it keeps no samples."""
        return self._judge.words

    def update(self, times: Array, samples: Samples) -> None:
        """Take a batch: times (k,) in s, rising, and samples (k, *shape) of `keys`."""
        self._judge.update(times, samples)

    def robustness(self, ended: bool) -> Robustness:
        """By how much the run keeps the requirement; ended: whether it has come to its end."""
        low, high = self._judge.bounds(ended)
        least, most = float(np.min(low)), float(np.min(high))
        settled = bool(least == most)
        if not settled and least <= 0.0 <= most:
            return Robustness(None, False, self._judge.margin.label, None, self._why_not(ended))
        decisive = high if settled or most < 0.0 else low
        element = tuple(int(k) for k in np.unravel_index(int(np.argmin(decisive)), decisive.shape))
        found = float(decisive[element])
        return Robustness(found, settled, self._judge.margin.label, self._judge.decisive(element))

    def bound(self, ended: bool) -> tuple[float, float]:
        """The most that its margin may be, whatever comes, and the time (s) that decides that; NaN for unknown."""
        high = self._judge.bounds(ended)[1]
        element = tuple(int(k) for k in np.unravel_index(int(np.argmin(high)), high.shape))
        known = math.isfinite(high[element])
        return float(high[element]), self._judge.decisive(element).time if known else math.nan

    def _why_not(self, ended: bool) -> str:
        if empty := self._judge.empty:
            return f"no sample lies within {empty} s"
        if not ended and is_open(self._condition):
            return "the run did not come to its end"
        return f"its windows need {horizon(self._condition):g} s"

    def state(self) -> dict[str, Any]:
        """What it has made of the samples so far: arrays, to the bit."""
        return self._judge.state()

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a state of such a requirement's."""
        self._judge.restore(state)

    # ---- how it is judged ----

    def _judged(self, condition: Condition) -> Judge:
        if is_instant(condition):
            return AtStart(margin(condition, self._scope))
        match condition:
            case Not(operand):
                return Opposite(self._judged(operand))
            case Junction(every, operands):
                judges = [self._judged(operand) for operand in operands]
                return Together(self._of_all([judge.margin for judge in judges], condition.at), every, judges)
            case Temporal(every, start, stop, operand) if is_instant(operand):
                return Extreme(margin(operand, self._scope), every, start, stop)
        margins = {part: margin(part, self._scope) for part in _instants(condition)}
        at = condition.at if isinstance(condition, Temporal | Until) else 0
        return Deferred(condition, self._of_all(list(margins.values()), at), margins, self._scope.native)

    def _of_all(self, margins: list[Quantity], at: int) -> Quantity:
        """The shape and the unit of several margins together. Raises: FormulaError for shapes that do not fit."""
        return reduce(lambda a, b: joined("and", np.minimum, *alike(a, b), self._scope, at), margins)


def _instants(condition: Condition) -> list[Condition]:
    """The largest parts of a condition that speak of one instant."""
    if is_instant(condition):
        return [condition]
    return [part for child in conditions(condition) for part in _instants(child)]

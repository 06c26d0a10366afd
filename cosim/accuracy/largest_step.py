"""The largest step that keeps an error that is wanted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from cosim.accuracy.accuracies import Accuracy
from cosim.accuracy.limit import ORDER, UNSETTLED
from cosim.accuracy.refined_runs import Observation, RefinedRuns
from cosim.accuracy.refinement import TOTAL, Refinement
from cosim.errors import DiagramErrors

MOST = 10**6
"""Times as many steps: more than anybody runs, and where rounding errors have long taken over."""


@dataclass(frozen=True)
class Wanted:
    """Which errors are wanted. absolute: by name, in its unit.

    relative: to the value of a metric, or to the range of a signal, of all others.
    """

    relative: float | None = None
    absolute: Mapping[str, float] = field(default_factory=dict)

    def of(self, name: str, accuracy: Accuracy) -> float | None:
        """The error that is wanted of a metric or signal; None if none is, or if it has no error."""
        if accuracy.error is None or name in self.absolute:
            return self.absolute.get(name) if accuracy.errors else None
        return self.relative * accuracy.size if self.relative and accuracy.size else None


@dataclass(frozen=True)
class Subject:
    """What an error may be wanted of: a metric or signal, and the error that it has in another run."""

    name: str
    accuracy: Accuracy
    error: Callable[[Observation], float]


def find(subjects: Iterable[Subject], wanted: Wanted, runs: RefinedRuns) -> dict[Refinement, Observation]:
    """Note the largest step that keeps each error that is wanted: smaller ones by theory, larger ones by running them.

    Steps are doubled as long as an error is kept, the run comes to its end, and they fit the diagram's times. Returns
    these runs. Raises: as of `RefinedRuns.observe`, but for steps that do not fit.
    """
    keeping = []
    for subject in subjects:
        accuracy = subject.accuracy
        accuracy.wanted = wanted.of(subject.name, accuracy)
        if accuracy.wanted is not None and (count := steps_for(accuracy, accuracy.wanted)):
            accuracy.largest_step = runs.network.diagram.run.step / count
            keeping += [subject] if count == 1 else []
    done: dict[Refinement, Observation] = {}
    while keeping:
        coarser = Refinement(coarser=2 ** (len(done) + 1))
        try:
            done |= runs.observe([coarser])
        except DiagramErrors:
            break
        if done[coarser].outcome.status != "completed":
            break
        keeping = [s for s in keeping if s.error(done[coarser]) <= (s.accuracy.wanted or 0.0)]
        for subject in keeping:
            subject.accuracy.largest_step = done[coarser].step
    return done


def steps_for(accuracy: Accuracy, wanted: float) -> int | None:
    """Into how many steps one of the diagram is to be divided, 1 if none; None where nobody can say.

    Where there is an order, it tells; where there is none, only what was run. Counts are of the form 2^a 5^b, so that a
    step of few digits has few digits.
    """
    run = [r.steps for r, error in zip(TOTAL, accuracy.errors, strict=True) if error <= wanted]
    if run and (run[0] == 1 or accuracy.kind not in (ORDER, UNSETTLED)):
        return run[0]
    if accuracy.kind not in (ORDER, UNSETTLED) or not wanted > 0.0 or accuracy.order is None:
        return None
    order = accuracy.order if accuracy.kind == ORDER else 1.0
    share = (accuracy.errors[0] / wanted) ** (1.0 / order)
    return min((count for count in _round_counts() if count >= share), default=None)


def _round_counts() -> list[int]:
    return sorted(2**a * 5**b for a in range(21) for b in range(10) if 2**a * 5**b <= MOST)

"""How sure a requirement's margin is: an interval from runs with other steps; and whether all give the same verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping

from cosim.accuracy import limit as limits
from cosim.accuracy.accuracies import AGREES, CHANGES, Accuracy
from cosim.accuracy.refined_runs import Observation
from cosim.accuracy.refinement import TOTAL, Refinement
from cosim.requirements.verdict import Verdict
from cosim.results.formatting import format_seconds, format_value

OTHERWISE = {True: "violated", False: "kept"}


def judge(name: str, runs: Mapping[Refinement, Observation]) -> Accuracy:
    """The accuracy of a requirement's margin, in its unit, by runs with the steps of TOTAL, and others if there are.

    A margin is an extreme over samples, of which smaller steps have more, so no order is believed: the error is an
    interval. CHANGES where runs give other verdicts, or the margin is less than its error.
    """
    verdicts = {refinement: run.outcome.requirements[name] for refinement, run in runs.items()}
    first = verdicts[TOTAL[0]]
    values = tuple(verdicts[refinement].margin for refinement in TOTAL)
    if any(one.holds is not first.holds for one in verdicts.values()):
        return Accuracy(CHANGES, unit=first.unit, values=values, said=_said(verdicts, runs))
    known = [one.margin for one in verdicts.values() if one.margin is not None and math.isfinite(one.margin)]
    if len(known) < len(verdicts):
        return Accuracy(AGREES, unit=first.unit, values=values)
    return _of_numbers(first, {refinement: float(one.margin or 0.0) for refinement, one in verdicts.items()})


def _of_numbers(first: Verdict, margins: Mapping[Refinement, float]) -> Accuracy:
    row = [margins[refinement] for refinement in TOTAL]
    beside = [(refinement.step(1.0), margin) for refinement, margin in margins.items() if refinement.lies_elsewhere]
    found = limits.limit(row, 1, 0.0, believed=False, elsewhere=beside[0] if beside else None)
    errors = tuple(map(found.error, row))
    made = Accuracy(found.kind, None, first.unit, tuple(row), errors, abs(row[0]), {0: found})
    if abs(row[0]) <= errors[0] and first.holds is not None:
        made.kind = CHANGES
        made.said = f"{first.word} by less than its error: with another step it may be {OTHERWISE[first.holds]}"
    return made


def _said(verdicts: Mapping[Refinement, Verdict], runs: Mapping[Refinement, Observation]) -> str:
    words = [f"{_word(verdicts[r])} at {format_seconds(runs[r].step, 3)}" for r in verdicts]
    return f"{', '.join(words)}: depends on the step"


def _word(verdict: Verdict) -> str:
    return verdict.word if verdict.margin is None else f"{verdict.word} by {format_value(abs(verdict.margin))}"

"""How sure a requirement's margin is: an interval from runs with other steps; and whether all give the same verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from cosim.accuracy import limit as limits
from cosim.accuracy.accuracies import AGREES, CHANGES, Accuracy
from cosim.accuracy.limit import Limit
from cosim.accuracy.refined_runs import Observation
from cosim.accuracy.refinement import TOTAL, Refinement
from cosim.requirements.verdict import Verdict
from cosim.results.formatting import format_seconds, format_value

OTHERWISE = {True: "violated", False: "kept"}


def judge(name: str, runs: Mapping[Refinement, Observation], highest: int, steps: int) -> Accuracy:
    """The accuracy of a requirement's margin, in its unit, by runs with the steps of TOTAL, and others if there are.

    A margin is an extreme over samples, of which smaller steps have more, so no order is believed: the error is an
    interval. CHANGES where runs give other verdicts, or the margin is less than its error. highest, steps: as of
    `MetricJudge`.
    """
    verdicts = {refinement: run.outcome.requirements[name] for refinement, run in runs.items()}
    first = verdicts[TOTAL[0]]
    values = tuple(verdicts[refinement].margin for refinement in TOTAL)
    if any(one.holds is not first.holds for one in verdicts.values()):
        return Accuracy(CHANGES, unit=first.unit, values=values, said=_said(verdicts, runs))
    known = [one.margin for one in verdicts.values() if one.margin is not None and math.isfinite(one.margin)]
    if len(known) < len(verdicts):
        return Accuracy(AGREES, unit=first.unit, values=values)
    margins = {refinement: float(one.margin or 0.0) for refinement, one in verdicts.items()}
    return _of_numbers(first, _limit(margins, highest, steps), [margins[refinement] for refinement in TOTAL])


def _limit(margins: Mapping[Refinement, float], highest: int, steps: int) -> Limit:
    """Its limit without an order; or what a stop before common points says of one, where that is wider."""
    row = [margins[refinement] for refinement in TOTAL]
    elsewhere = next(((one.step(1.0), margin) for one, margin in margins.items() if one.lies_elsewhere), None)
    found = limits.limit(row, highest, 0.0, believed=False, elsewhere=elsewhere)
    noise = limits.noise(max(map(abs, row)), steps)
    for cut in (margin for one, margin in margins.items() if one.early):
        warned = limits.limit(row, highest, noise, True, elsewhere, (cut, limits.most_noise(noise, steps)))
        found = max(found, warned, key=lambda one: one.high - one.low)
    return found


def _of_numbers(first: Verdict, found: Limit, row: Sequence[float]) -> Accuracy:
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

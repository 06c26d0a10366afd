"""The certificate of accuracy of a diagram: by how much each metric and each recorded signal may be off."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from cosim.accuracy import largest_step, metric_accuracy, refinement
from cosim.accuracy.accuracies import CHANGES, Accuracy
from cosim.accuracy.largest_step import Subject, Wanted
from cosim.accuracy.metric_accuracy import MetricJudge
from cosim.accuracy.refined_runs import Observation, RefinedRuns
from cosim.accuracy.refinement import COUPLING, INTEGRATION, TOTAL, Refinement
from cosim.accuracy.signal_accuracy import SignalJudge
from cosim.engine.outcome import Outcome
from cosim.errors import NoCertificate
from cosim.results.formatting import format_seconds
from cosim.wiring.network import Network, Signal

Runs = Mapping[Refinement, Observation]
ENDINGS = {"diverged": "diverges", "failed": "fails", "terminated": "is ended"}


@dataclass
class Certificate:
    """How sure the figures of a diagram are. steps: those that were compared (s). notes: what to bear in mind.

    runs: how many, and cost: as how many runs of the diagram; seconds: of wall-clock time.
    """

    diagram: str
    method: str
    steps: tuple[float, ...]
    metrics: dict[str, Accuracy]
    signals: dict[str, Accuracy] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    runs: int = 0
    cost: float = 0.0
    seconds: float = 0.0

    @property
    def changing(self) -> list[str]:
        """What depends on the step, a sentence each."""
        both = {**self.signals, **self.metrics}
        return [f"{name}: {accuracy.said}" for name, accuracy in both.items() if accuracy.kind == CHANGES]

    def as_json(self) -> dict[str, Any]:
        """For JSON, before `for_json`."""
        content: dict[str, Any] = {
            "diagram": self.diagram,
            "status": "depends on the step" if self.changing else "done",
        }
        content |= {"method": self.method, "steps": list(self.steps), "runs": self.runs, "cost": self.cost}
        content |= {"seconds": round(self.seconds, 6), "notes": self.notes, "changing": self.changing}
        for name in ("metrics", "signals"):
            content[name] = {key: accuracy.as_json() for key, accuracy in getattr(self, name).items()}
        return content


def certify(runs: RefinedRuns, wanted: Wanted | None = None) -> Certificate:
    """The certificate of a diagram, with all parts, by six runs; by more, with larger steps, where errors are wanted.

    Raises: NoCertificate where a run with a smaller step does not come to its end; else as `RefinedRuns.observe`.
    """
    began, network = time.perf_counter(), runs.network
    whole = refinement.why_one(network)
    observed = runs.observe({*TOTAL} if whole else {*TOTAL, *INTEGRATION, *COUPLING})
    whole = whole or _dropped(observed)
    made = _begun(network, observed)
    made.notes += [whole] if whole else []
    doubts = refinement.sampled_by_the_step(network)
    with SignalJudge(observed, *_theory(network)) as judge:
        for signal in network.recorded:
            made.signals[str(signal)] = judge.judge(str(signal), _unit(network, signal), _doubt(doubts, signal))
        if wanted:
            observed |= largest_step.find([*_subjects(made, judge)], wanted, runs)
    return _counted(made, observed, began)


def certify_run(done: Observation, runs: RefinedRuns) -> Certificate:
    """The certificate of a run that is done, of its metrics alone, by two more. Raises: as `certify`."""
    began = time.perf_counter()
    observed = {TOTAL[0]: done, **runs.observe(TOTAL[1:])}
    return _counted(_begun(runs.network, observed), observed, began)


def _counted(made: Certificate, observed: Runs, began: float) -> Certificate:
    made.runs, made.cost = len(observed), sum(refinement.cost for refinement in observed)
    made.seconds = time.perf_counter() - began
    return made


def _begun(network: Network, observed: Runs) -> Certificate:
    """With the metrics. Raises: NoCertificate."""
    _require_ends(observed)
    run, doubts = network.diagram.run, refinement.sampled_by_the_step(network)
    judge, units = MetricJudge(observed, *_theory(network)), observed[TOTAL[0]].observed.units
    metrics = {name: judge.judge(name, units[name], _doubt(doubts, signal)) for name, signal in network.reduced.items()}
    notes = [_sampled(name) for name in dict.fromkeys(doubts.values())]
    steps = tuple(observed[refinement].step for refinement in TOTAL)
    return Certificate(str(network.diagram.path), run.method, steps, metrics, notes=notes)


def _require_ends(observed: Runs) -> None:
    """Raises: NoCertificate, with every step at which a run does not come to its end."""
    ends = {observed[refinement].step: observed[refinement].outcome for refinement in TOTAL}
    failed = [f"at {_ending(step, outcome)}" for step, outcome in ends.items() if outcome.status != "completed"]
    if not failed:
        return
    whole = [format_seconds(step) for step, outcome in ends.items() if outcome.status == "completed"]
    also = f"; at {' and '.join(whole)} it comes to its end" if whole else ""
    errors = [outcome.error for outcome in ends.values() if outcome.error]
    fix = "a smaller `run.step`, if the step is too large for the method" if whole else errors[0].fix if errors else ""
    message = f"nobody can tell how wrong the figures are: {'; '.join(failed)}{also}"
    raise NoCertificate(message, errors[0].position if errors else None, fix)


def _ending(step: float, outcome: Outcome) -> str:
    return f"{format_seconds(step)} the run {ENDINGS[outcome.status]}: {outcome.reason}"


def _dropped(observed: dict[Refinement, Observation]) -> str:
    """Why the errors' parts cannot be told, as a run that only they need has failed; such runs are left out."""
    wrong = [r for r, run in observed.items() if run.outcome.status != "completed" and r not in TOTAL]
    if not wrong:
        return ""
    outcome, first = observed[wrong[0]].outcome, wrong[0]
    for refined in wrong:
        del observed[refined]
    said = f"with {first.inner} times the inner steps, at {_ending(observed[TOTAL[0]].step / first.steps, outcome)}"
    return f"coupling and integration are not told apart: {said}"


def _theory(network: Network) -> tuple[int, int]:
    """The highest order that theory admits, and how many steps of integration the longest run has."""
    run = network.diagram.run
    inner = max([run.inner_steps, *(component.inner_steps for component in network.components.values())])
    return refinement.highest_order(network), run.steps * inner * TOTAL[-1].steps


def _unit(network: Network, signal: Signal) -> str:
    unit = network.variable(signal).unit
    return unit if isinstance(unit, str) else ""


def _doubt(doubts: Mapping[str, str], signal: Signal) -> str:
    return _sampled(doubts[signal.component]) if signal.component in doubts else ""


def _sampled(name: str) -> str:
    return (
        f"{name} is sampled at every step, so with another step it is another block, and what it acts on has no order; "
        f"with a `period` it stays the same"
    )


def _subjects(made: Certificate, judge: SignalJudge) -> Iterator[Subject]:
    """What an error may be wanted of."""
    for name, accuracy in made.metrics.items():
        yield Subject(name, accuracy, partial(metric_accuracy.error, accuracy, name))
    for name, accuracy in made.signals.items():
        yield Subject(name, accuracy, partial(judge.error, name))

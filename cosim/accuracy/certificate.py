"""The certificate of accuracy of a diagram: by how much each metric and each recorded signal may be off."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from cosim.accuracy import largest_step, margin_accuracy, metric_accuracy
from cosim.accuracy.accuracies import CHANGES, Accuracy
from cosim.accuracy.largest_step import Subject, Wanted
from cosim.accuracy.metric_accuracy import MetricJudge
from cosim.accuracy.refined_runs import Observation, RefinedRuns
from cosim.accuracy.refinement import (
    COUPLING,
    INTEGRATION,
    TOTAL,
    Refinement,
    beside,
    highest_order,
    sampled_by_the_step,
    steps_of_their_own,
    why_not_parts,
)
from cosim.accuracy.signal_accuracy import SignalJudge
from cosim.errors import CosimError, NoCertificate, UsageError
from cosim.results.formatting import format_seconds
from cosim.wiring.network import Network, Signal

Runs = Mapping[Refinement, Observation]
NESTED = "all steps have their points in common, so what happens between two may be as wrong with all of them"
FMUS = "a co-simulation FMU may have inner steps of its own"
ENDINGS = {"diverged": "diverges", "failed": "fails", "terminated": "is ended"}


@dataclass
class Certificate:
    """How sure the figures of a diagram are. steps: those that were compared (s). notes: what to bear in mind.

    requirements: how sure their margins are. runs: how many, and cost: as how many runs of the diagram; seconds: of
    wall-clock time. warnings: of what is unstable at the diagram's step, where all figures may agree and be wrong.
    """

    diagram: str
    method: str
    steps: tuple[float, ...]
    metrics: dict[str, Accuracy]
    signals: dict[str, Accuracy] = field(default_factory=dict)
    requirements: dict[str, Accuracy] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    runs: int = 0
    cost: float = 0.0
    seconds: float = 0.0
    warnings: list[CosimError] = field(default_factory=list)

    @property
    def changing(self) -> list[str]:
        """The metrics that are counted and depend on the step, and the requirements that may, a sentence each."""
        both = {**self.metrics, **self.requirements}
        return [f"{name}: {accuracy.said}" for name, accuracy in both.items() if accuracy.kind == CHANGES]

    def as_json(self) -> dict[str, Any]:
        """For JSON, before `for_json`."""
        content: dict[str, Any] = {
            "diagram": self.diagram,
            "status": "depends on the step" if self.changing else "done",
        }
        content |= {"method": self.method, "steps": list(self.steps), "runs": self.runs, "cost": self.cost}
        content |= {"seconds": round(self.seconds, 6), "notes": self.notes, "changing": self.changing}
        content |= {"warnings": list(map(str, self.warnings))} if self.warnings else {}
        for name in ("metrics", "signals", "requirements"):
            content[name] = {key: accuracy.as_json() for key, accuracy in getattr(self, name).items()}
        return content


def require_figures(network: Network, signals: bool) -> None:
    """Raises: UsageError where there is no metric, no requirement, and no recorded signal if `signals` count too.

    Also where steps are as long as a tolerance allows: other steps then say nothing of the error that it leaves.
    """
    for key, component in _tolerances(network):
        where = f"blocks.{component}.{key}" if component else f"run.{key}"
        message = f"`{where}` chooses steps, so that halving them does not tell how wrong a figure is"
        raise UsageError(message, fix=f"compare with a run of a tenth of it; or --set {where}=~ for steps of one size")
    if network.reduced or network.diagram.requirements or (signals and network.recorded):
        return
    none = "no metric, no requirement and no recorded signal" if signals else "no metric and no requirement"
    message = f"{network.diagram.path} has {none}, so there is no figure that may be wrong"
    raise UsageError(message, fix="such as metrics: {largest: {signal: plant.x, reduce: max}}")


def _tolerances(network: Network) -> Iterator[tuple[str, str]]:
    """What chooses steps: a key of the run, or of a component."""
    run = network.diagram.run
    for key in ("coupling_tolerance", "tolerance"):
        if getattr(run, key) is not None:
            yield key, ""
    for component in network.components.values():
        if component.declaration.continuous() and component.integration.tolerance is not None:
            yield "tolerance", component.name


def certify(runs: RefinedRuns, wanted: Wanted | None = None) -> Certificate:
    """The certificate of a diagram, with all parts, by eight runs; by more, with larger steps, where errors are wanted.

    Raises: NoCertificate where a run with a smaller step does not come to its end; else as `RefinedRuns.observe`.
    """
    began, network = time.perf_counter(), runs.network
    why = why_not_parts(network)
    parts = set() if why else {*INTEGRATION, *COUPLING}
    observed = runs.observe({*TOTAL, *parts, *beside(network)})
    made = _begun(network, observed)
    made.warnings += observed[TOTAL[0]].unstable
    made.notes += [f"coupling and integration are not told apart: {why}"] if why else []
    doubts = sampled_by_the_step(network)
    with SignalJudge(observed, *_theory(network)) as judge:
        for signal in network.recorded:
            name = str(signal)
            made.signals[name] = judge.judge(name, _unit(network, signal), _doubt(doubts, signal))
            made.notes += [f"{name}: {made.signals[name].said}"] if made.signals[name].kind == CHANGES else []
        if wanted:
            observed |= largest_step.find([*_subjects(made, judge)], wanted, runs)
    return _counted(made, observed, began)


def certify_run(done: Observation, runs: RefinedRuns) -> Certificate:
    """The certificate of a run that is done, of its metrics alone, by four more. Raises: as `certify`."""
    began = time.perf_counter()
    observed = {TOTAL[0]: done, **runs.observe({*TOTAL[1:], *beside(runs.network)})}
    return _counted(_begun(runs.network, observed), observed, began)


def _counted(made: Certificate, observed: Runs, began: float) -> Certificate:
    made.runs, made.cost = len(observed), sum(refinement.cost for refinement in observed)
    made.seconds = time.perf_counter() - began
    return made


def _begun(network: Network, observed: dict[Refinement, Observation]) -> Certificate:
    """With the metrics; runs that have failed, and only give more, are left out. Raises: NoCertificate."""
    _require_ends(observed)
    doubts = sampled_by_the_step(network)
    notes = [_sampled(name) for name in dict.fromkeys(doubts.values())]
    if alone := steps_of_their_own(network):
        notes.append(f"of {', '.join(alone)}, only what follows the communication step is in the errors: {FMUS}")
    notes += [_left_out(r, observed.pop(r)) for r in [*observed] if observed[r].outcome.status != "completed"]
    if any(observed[refinement].outcome.termination for refinement in TOTAL):
        times = ", ".join(format_seconds(observed[refinement].outcome.time) for refinement in TOTAL)
        notes.append(f"the runs are ended at {times}; signals are compared before")
    if not any(refinement.lies_elsewhere for refinement in observed):
        notes.append(NESTED)
    theory, units = _theory(network), observed[TOTAL[0]].observed.units
    judge = MetricJudge(observed, *theory)
    metrics = {name: judge.judge(name, units[name], _doubt(doubts, signal)) for name, signal in network.reduced.items()}
    margins = {name: margin_accuracy.judge(name, observed, *theory) for name in network.diagram.requirements}
    steps = tuple(observed[refinement].step for refinement in TOTAL)
    method = network.diagram.run.method
    return Certificate(str(network.diagram.path), method, steps, metrics, requirements=margins, notes=notes)


def _require_ends(observed: Runs) -> None:
    """Raises: NoCertificate, with every step at which a run does not come to its end."""
    runs = [observed[refinement] for refinement in TOTAL]
    failed = [run for run in runs if run.outcome.status != "completed"]
    if not failed:
        return
    whole = [format_seconds(run.step) for run in runs if run not in failed]
    also = f"; at {' and '.join(whole)} it comes to its end" if whole else ""
    error = next((run.outcome.error for run in failed if run.outcome.error), None)
    fix = "a smaller `run.step`, if the step is too large for the method" if whole else error.fix if error else ""
    message = f"nobody can tell how wrong the figures are: {'; '.join(map(_ending, failed))}{also}"
    raise NoCertificate(message, error.position if error else None, fix)


def _ending(run: Observation) -> str:
    return f"with steps of {format_seconds(run.step)} the run {ENDINGS[run.outcome.status]}: {run.outcome.reason}"


def _left_out(refinement: Refinement, run: Observation) -> str:
    """What cannot be told without a run."""
    if refinement.lies_elsewhere:
        return f"steps that lie elsewhere are of no use: {_ending(run)}"
    if refinement.early:
        return f"what happens a little before a point that all steps have in common is not seen: {_ending(run)}"
    return f"coupling and integration are not told apart: in {refinement.inner} times the inner steps, {_ending(run)}"


def _theory(network: Network) -> tuple[int, int]:
    """The highest order that theory admits, and how many steps of integration the longest run has."""
    run = network.diagram.run
    inner = max([run.inner_steps, *(component.integration.inner_steps for component in network.components.values())])
    return highest_order(network), run.steps * inner * TOTAL[-1].steps


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

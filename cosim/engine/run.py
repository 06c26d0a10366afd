"""From a diagram to its outcome: builds the table, runs it, reduces metrics, and records, come what may."""

from __future__ import annotations

import json
import time as clock
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cosim.authoring.variables import Local, Output
from cosim.engine import simulation, table
from cosim.engine.courses import Courses
from cosim.engine.simulation import Kernels, Probes, Samples, Simulation
from cosim.engine.table import Table
from cosim.errors import (
    CosimError,
    Diverged,
    MetricError,
    Problems,
    ResultError,
    Terminated,
)
from cosim.language import diagram as diagrams
from cosim.language.diagram import Diagram
from cosim.machine import interruption
from cosim.machine.interruption import Interrupted, Interruption
from cosim.results import metrics as reductions
from cosim.results import result_file
from cosim.results.metrics import Events, Final, Reduction
from cosim.wiring import conditions, resolution, windows
from cosim.wiring.network import Finding, Network, Signal

FLUSH_SECONDS = 1.0
ENGINES = ("native", "python")


@dataclass
class Event:
    """A boolean output that says something happened: what, and when each member saw it first."""

    signal: Signal
    text: str
    times: Any


@dataclass
class Outcome:
    """How a run ended. status: completed, terminated (an FMU asked for the end), diverged, interrupted or failed.

    seconds: wall-clock time of each part. signal: the number of the signal that interrupted it, or 0.
    """

    diagram: str
    status: str
    steps: int
    method: str
    engine: str
    kernels_compiled: int
    seconds: dict[str, float]
    metrics: dict[str, Any]
    results: str | None
    error: CosimError | None = None
    signal: int = 0
    termination: CosimError | None = None  # who asked for the end, which is one of the warnings too
    events: list[Event] = field(default_factory=list)
    warnings: list[CosimError] = field(default_factory=list)  # what FMUs make different, and conditions that failed
    conditions: list[Finding] = field(default_factory=list)  # those that are judged along a run
    units: dict[str, str] = field(default_factory=dict)
    windows: dict[str, str] = field(default_factory=dict)
    swaps: list[str] = field(default_factory=list)  # what each block keeps and drops whose type a layer replaces

    @property
    def reason(self) -> str:
        """Why the run ended before its time, or nothing."""
        ended = self.error or self.termination
        return ended.message if ended else ""

    @property
    def verdicts(self) -> list[dict[str, Any]]:
        """The conditions as JSON has them."""
        return [asdict(finding) for finding in self.conditions]

    def as_json(self) -> str:
        """One JSON object, as of `for_json`."""
        names = ["diagram", "status", "steps", "method", "engine", "kernels_compiled", "seconds", "metrics", "results"]
        content = {name: getattr(self, name) for name in names}
        if self.error:
            content["error"] = str(self.error)
        if self.warnings:
            content["warnings"] = [str(warning) for warning in self.warnings]
        if self.conditions:
            content["conditions"] = self.verdicts
        if self.swaps:
            content["swaps"] = self.swaps
        return json.dumps(reductions.for_json(content), ensure_ascii=False)


def load(path: str | Path, settings: Iterable[str] = (), swaps: Iterable[str] = (), code: bool = True) -> Network:
    """Read and wire a diagram; without `code`, as of `wiring.wire`.

    Raises: DiagramErrors with all mistakes, of the grammar and of the wiring.
    """
    problems = Problems()
    return resolution.wire(diagrams.load(path, settings, swaps, problems), problems, code)


class Run:
    """One run of a wired diagram.

    output: where the result is written, or None. `seconds["setup"]` counts from `began` (time.perf_counter()).
    prepared: a table of this network with its kernels, where there is one already.
    attributes: what else the result's file says of itself.
    """

    def __init__(
        self,
        network: Network,
        engine: str = "native",
        output: Path | None = None,
        began: float | None = None,
        prepared: tuple[Table, Kernels] | None = None,
        attributes: Mapping[str, str] | None = None,
    ) -> None:
        started = clock.perf_counter() if began is None else began
        self.network = network
        self.engine = engine
        self.output = output
        self.attributes = dict(attributes or {})
        settings = network.diagram.run
        self.metrics, self._warnings = windows.reduced(network)
        self._events = _events(network)
        self._courses = _courses(network)
        built, kernels = prepared or (table.build(network, settings.method), None)
        compiling = clock.perf_counter()
        if engine == "native" and kernels is None:
            kernels = simulation.compile_table(built)
        elif engine == "python":
            simulation.compile_table(built)  # for what it refuses, so that both engines do the same things
        compiled = clock.perf_counter() - compiling
        self.kernels_compiled = kernels.compiled if kernels else 0
        self.simulation = Simulation(built, kernels, self._probes())
        self.seconds = {"setup": clock.perf_counter() - started - compiled, "compile": compiled, "solve": 0.0}

    def _probes(self) -> list[Probes]:
        """What is reduced is seen at every step, what is recorded at the recording's period."""
        stepwise = [s for s, r in (*self.metrics.values(), *self._events.values()) if not self._at_end(r)]
        stepwise += self._courses
        record = self.network.diagram.record
        recorded = [self.network.find(str(n.value), n.position) for n in record.signals] if record else []
        every = round(record.period / self.simulation_step) if record else 1
        return [Probes(tuple(dict.fromkeys(stepwise))), Probes(tuple(dict.fromkeys(recorded)), every)]

    def _at_end(self, reduction: Reduction) -> bool:
        """Whether a reduction looks at the signal's last value alone."""
        last = isinstance(reduction, Final) and reduction.reaches(self.network.diagram.run.stop)
        return last or isinstance(reduction, Events)

    @property
    def reductions(self) -> dict[str, str]:
        """What each metric is, in words: two of one name that differ here are not to be compared."""
        return {name: f"{reduction} of {signal}" for name, (signal, reduction) in self.metrics.items()}

    @property
    def simulation_step(self) -> float:
        """The communication step (s)."""
        return self.network.diagram.run.step

    def execute(self, watch: Callable[[float], None] = lambda time: None) -> Outcome:
        """Run to the end, or to what stops it; `watch` is told the simulated time (s) between batches.

        A signal ends the run after the batch that is under way; until the result is closed, further ones lose nothing.
        Raises: ResultError if the result cannot be begun; everything else is in the outcome.
        """
        with interruption.deferred() as interrupted:
            return self._execute(watch, interrupted)

    def _execute(self, watch: Callable[[float], None], interrupted: Interruption) -> Outcome:
        writer = self._writer() if self.output else None
        status = "completed"
        error: CosimError | None = None
        termination: CosimError | None = None
        try:
            self._solve(writer, watch, interrupted)
        except Diverged as stopped:
            status, error = "diverged", stopped
        except Terminated as stopped:
            status, termination = "terminated", stopped
        except CosimError as stopped:
            status, error = "failed", stopped
        except KeyboardInterrupt:
            status = "interrupted"
        figures, wrong = self._figures()
        if status == "completed" and wrong:
            status, error = "failed", wrong
        outcome = self._outcome(status, error, figures)
        outcome.termination = termination
        outcome.warnings += [*self.simulation.warnings(), *([termination] if termination else [])]
        outcome.signal = interrupted.number or outcome.signal
        if writer:
            _close(writer, outcome)
        return outcome

    def _solve(
        self, writer: result_file.ResultWriter | None, watch: Callable[[float], None], interrupted: Interruption
    ) -> None:
        began = flushed = clock.perf_counter()
        writing = 0.0

        def wanted() -> bool:
            return interrupted.wanted

        try:
            self.simulation.breakable = interrupted.breakable
            self.simulation.initialize(wanted)
            interrupted.raise_if_wanted()
            for stepwise, recorded in self.simulation.batches(wanted):
                resumed = clock.perf_counter()
                self._reduce(stepwise)
                if writer:
                    self._append(writer, recorded)
                    if resumed - flushed > FLUSH_SECONDS:
                        writer.flush()
                        flushed = resumed
                watch(self.simulation.time)
                writing += clock.perf_counter() - resumed
                interrupted.raise_if_wanted()
            self.simulation.close()
        except BaseException:
            with suppress(CosimError):  # what comes after a failure is no news
                self.simulation.close()
            raise
        finally:
            self.seconds["solve"] = clock.perf_counter() - began - writing

    def _reduce(self, samples: Samples) -> None:
        times = samples.steps * self.simulation_step
        for signal, reduction in (*self.metrics.values(), *self._events.values()):
            if not self._at_end(reduction):
                reduction.update(times, samples.values[signal])
        for signal, courses in self._courses.items():
            courses.update(times, samples.values[signal])

    def _figures(self) -> tuple[dict[str, Any], CosimError | None]:
        """The metrics' values, and why one of them has none where that is a mistake."""
        now, values, wrong = np.array([self.simulation.time]), dict.fromkeys(self.metrics), None
        for name, (signal, reduction) in self.metrics.items():
            if self._at_end(reduction):
                reduction.update(now, self.simulation.value(signal)[None])
            try:
                values[name] = reduction.value()
            except MetricError as error:
                wrong = wrong or windows.named(self.network.diagram.metrics[name], error)
        return values, wrong

    def _append(self, writer: result_file.ResultWriter, samples: Samples) -> None:
        values = {str(signal): array for signal, array in samples.values.items()}
        writer.append(samples.steps * self.simulation_step, values)

    def _writer(self) -> result_file.ResultWriter:
        assert self.output is not None
        diagram = self.network.diagram
        settings = {k: getattr(diagram.run, k) for k in ("stop", "step", "method", "integrator", "inner_steps")}
        attributes = {
            "title": diagram.title,
            "diagram": diagram.resolved(),
            "settings": settings,
            "method": diagram.run.method,
            "engine": self.engine,
            "reductions": self.reductions,
            **self.attributes,
        }
        recorded = [_described(self.network, signal) for signal in self.simulation.probes[1].signals]
        return result_file.ResultWriter(self.output, recorded, attributes)

    def _conditions(self) -> list[Finding]:
        """The conditions along the run so far; none if it has seen nothing."""
        if not all(courses.seen for courses in self._courses.values()):
            return []
        return conditions.judge_run(
            self.network, {signal: courses.of_members() for signal, courses in self._courses.items()}
        )

    def _judged(self) -> tuple[list[Finding], list[CosimError], int]:
        """The conditions along the run, warnings of others, and the number of a signal that ended a rule, or 0.

        A rule may never end. Nothing is lost with it but what the rules would have said.
        """
        try:
            with interruption.heard():
                return self._conditions(), _warnings(self.network), 0
        except Interrupted as stopped:
            where = " ".join(("no condition was judged: interrupted", *getattr(stopped, "__notes__", [])))
            return [], [CosimError(where)], stopped.number

    def _outcome(self, status: str, error: CosimError | None, figures: dict[str, Any]) -> Outcome:
        diagram = self.network.diagram
        judged, warnings, signal = self._judged()
        failed = [conditions.as_warning(self.network, finding) for finding in judged if finding.holds is False]
        events = [
            Event(signal, _event_text(self.network, signal), times)
            for signal, reduction in self._events.values()
            if (times := reduction.value())
        ]
        return Outcome(
            diagram=str(diagram.path),
            status="interrupted" if signal else status,
            steps=self.simulation.done,
            method=diagram.run.method,
            engine=self.engine,
            kernels_compiled=self.kernels_compiled,
            seconds={name: round(value, 6) for name, value in self.seconds.items()},
            metrics=figures,
            results=str(self.output) if self.output else None,
            error=error,
            events=events,
            signal=signal,
            warnings=[*self._warnings, *warnings, *failed],
            conditions=judged,
            units={name: _unit(self.network, *pair) for name, pair in self.metrics.items()},
            windows={name: str(reduction) for name, (_, reduction) in self.metrics.items()},
            swaps=[str(swap) for swap in self.network.swaps],
        )


def _courses(network: Network) -> dict[Signal, Courses]:
    """What the conditions that are judged after the run have to know of it."""
    signals = {signal for _, _, signals in conditions.along(network) for signal in signals}
    return {signal: Courses(network.components[signal.component].count) for signal in signals}


def _close(writer: result_file.ResultWriter, outcome: Outcome) -> None:
    """Write how the run ended; a result that cannot be written makes a failure of it, which loses no figure."""
    try:
        writer.close(outcome.status, outcome.reason, outcome.metrics, outcome.steps, outcome.seconds, outcome.verdicts)
    except ResultError as full:
        if outcome.error is None:
            outcome.status, outcome.error = "failed", full


def _warnings(network: Network) -> list[CosimError]:
    """The conditions of foreign blocks that do not hold, such as outputs without a step of delay."""
    foreign = {name for name, component in network.components.items() if component.declaration.foreign}
    broken = (
        [f for f in conditions.conditions(network) if f.component in foreign and f.holds is False] if foreign else []
    )
    return [conditions.as_warning(network, finding) for finding in broken]


def _events(network: Network) -> dict[Signal, tuple[Signal, Reduction]]:
    """The boolean outputs that report something, with the times at which they first do."""
    found = {}
    for signal in network.signals():
        if _event_text(network, signal):
            first = reductions.reduction("first", dtype=bool, shape=network.shape(signal))
            found[signal] = signal, first
    return found


def _event_text(network: Network, signal: Signal) -> str:
    variable = network.variable(signal)
    return variable.event if isinstance(variable, (Output, Local)) else ""


def _unit(network: Network, signal: Signal, reduction: Reduction) -> str:
    unit = reduction.unit or network.variable(signal).unit
    return unit if isinstance(unit, str) else ""


def _described(network: Network, signal: Signal) -> result_file.Signal:
    component, variable = network.components[signal.component], network.variable(signal)
    axes = component.signal_axes(variable) or ()
    return result_file.Signal(
        name=str(signal),
        shape=network.shape(signal),
        dtype=variable.dtype,
        fleet=(axes[0].fleet if axes else None) or "",
        unit=variable.unit,
        description=variable.description,
        causality=variable.causality,
    )


def run(diagram: Diagram, **options: Any) -> Outcome:
    """Wire and run a diagram; options as of `Run`. Raises: DiagramErrors, ResultError."""
    return Run(resolution.wire(diagram), **options).execute()

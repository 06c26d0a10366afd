"""From a diagram to its outcome: builds the program, runs it, reduces metrics, and records, come what may."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.compiling.kernels import Kernels
from cosim.engine import compilation, program, recording, stability, step_counts
from cosim.engine.allocation import copy_of
from cosim.engine.outcome import Outcome
from cosim.engine.probes import Probes
from cosim.engine.program import Program
from cosim.engine.recording import Kept
from cosim.engine.reductions import Reductions
from cosim.engine.simulation import Simulation
from cosim.errors import (
    CosimError,
    Diverged,
    Problems,
    Terminated,
    WrongValue,
    nearest,
)
from cosim.language import diagram as diagrams
from cosim.language.diagram import Diagram
from cosim.machine import interruption, supervision
from cosim.machine.interruption import Interrupted, Interruption
from cosim.machine.stopwatch import START, Stopwatch
from cosim.results.result_writer import ResultWriter
from cosim.wiring import conditions, resolution, unseen_jumps
from cosim.wiring.network import Finding, Network

if TYPE_CHECKING:
    from cosim.engine.checkpoints import Checkpoints
    from cosim.requirements.verdict import Verdict

STEPS_BEFORE_END = 100
"""After whose multiples a violation is looked for that ends the run: at the same time whatever the machine's speed."""
ENGINES = ("native", "python")


def load(path: str | Path, settings: Iterable[str] = (), swaps: Iterable[str] = (), code: bool = True) -> Network:
    """Read and wire a diagram, or an FMU alone; without `code`, as of `wiring.wire`.

    Raises: DiagramErrors with all mistakes, of the grammar and of the wiring.
    """
    problems = Problems()
    if Path(path).suffix.lower() == ".fmu":
        from cosim.wiring import fmu_alone  # with all that FMUs need

        with START.lap("reading"):
            diagram = fmu_alone.load(Path(path), settings, swaps, problems)
    else:
        with START.lap("reading"):
            diagram = diagrams.load(path, settings, swaps, problems)
    with START.lap("wiring"):
        return resolution.wire(diagram, problems, code)


class Run:
    """One run of a wired diagram; it starts, and compiles what it needs, when it is executed.

    output: where the result is written, or None. `seconds["setup"]` counts from `began` (time.perf_counter()).
    prepared: a program of this network with its kernels, if there is one. kept: whether `samples` has what is recorded.
    attributes: what else the result's file says of itself. checkpoint: how often one is kept beside the result, as of
    `Interval`; resume: whether to go on from it. until: where it is broken off before its end (s). margins: whether it
    gives those of requirements alone, as of a search's many runs.
    Raises: WrongValue for an engine that there is not, and for checkpoints without a result.
    """

    def __init__(
        self,
        network: Network,
        engine: str = "native",
        output: Path | None = None,
        began: float | None = None,
        prepared: tuple[Program, Kernels] | None = None,
        attributes: Mapping[str, str] | None = None,
        checkpoint: str | None = None,
        resume: bool = False,
        kept: bool = False,
        until: float = math.inf,
        margins: bool = False,
    ) -> None:
        started = clock.perf_counter() if began is None else began
        if engine not in ENGINES:
            raise WrongValue(f"there is no engine `{engine}`", fix=nearest(engine, ENGINES))
        self.network = network
        self.engine = engine
        self.output = output
        self.attributes = dict(attributes or {})
        self.checkpoints = _checkpoints(output, checkpoint, resume)
        self.reductions = Reductions(network, engine == "native", margins)
        with START.lap("building"):
            self._program = prepared[0] if prepared else program.build(network, network.diagram.run.method)
        self._kernels = prepared[1] if prepared else None
        self.steps = _steps(network, until)
        self.looks = prepared is None  # whether equal steps are stable, and see all jumps: of many runs nobody asks
        self.unstable: list[CosimError] = []
        self.kernels_compiled = self._kernels.compiled if self._kernels else 0
        self.samples = Kept(network, _probes(self.network, self.reductions)[1]) if kept else None
        self._executed = False
        self._stopped: Callable[[], bool] = supervision.never
        self.stopwatch = Stopwatch()  # of what is done between batches
        self.seconds = {"setup": clock.perf_counter() - started, "compile": 0.0, "solve": 0.0}

    @cached_property
    def simulation(self) -> Simulation:
        """The run's simulation, compiled and loaded when it is first asked for. Raises: DiagramErrors."""
        began = clock.perf_counter()
        kernels = self._kernels
        if kernels is None:
            with START.lap("compiling"):
                kernels = compilation.compile_program(self._program)  # interpreted too: both refuse the same
            self._kernels = kernels
            self.kernels_compiled = kernels.compiled if self.engine == "native" else 0
        if self.engine == "native":
            with START.lap("linking"):
                kernels.load()
        compiled = clock.perf_counter()
        probes = _probes(self.network, self.reductions)
        made = Simulation(self._program, kernels if self.engine == "native" else None, probes)
        made.ticks = self.steps * self.network.schedule.grid
        if self.reductions.enders:
            made.looks_at = STEPS_BEFORE_END * self.network.schedule.grid
        self.seconds["compile"] = compiled - began
        self.seconds["setup"] += clock.perf_counter() - compiled
        return made

    def execute(
        self, watch: Callable[[float], None] = lambda time: None, stopped: Callable[[], bool] = supervision.never
    ) -> Outcome:
        """Run to the end, or to what stops it; `watch` is told the simulated time (s) between batches.

        stopped: whether somebody other than a signal wants it to stop.
        A signal ends the run after the batch that is under way; until the result is closed, further ones lose nothing.
        Raises: DiagramErrors of what cannot be compiled, ResultError and CheckpointError if the result cannot be begun
        or resumed, CosimError if it was executed before, and what `watch` raises; everything else is in the outcome.
        """
        if self._executed:
            raise CosimError("this run has been executed", fix="make another `Run` of the same network")
        self._executed, self._stopped = True, stopped
        self.simulation  # noqa: B018  compiled before a result is begun
        with self._checkpointed(), interruption.deferred() as interrupted, self._writer() as writer:
            return self._recorded(writer, watch, interrupted)

    def _checkpointed(self) -> AbstractContextManager[None]:
        if not self.checkpoints:
            return nullcontext()
        from cosim.engine.identity import identity  # which takes a while

        assert self._kernels
        return self.checkpoints.of(self.network, identity(self.network, self._program, self._kernels, self.engine))

    def _recorded(
        self, writer: ResultWriter | None, watch: Callable[[float], None], interrupted: Interruption
    ) -> Outcome:
        status = "completed"
        error: CosimError | None = None
        try:
            self._solve(writer, watch, interrupted)
        except Diverged as stopped:
            status, error = "diverged", stopped
        except Terminated as stopped:
            status, error = "terminated", stopped
        except CosimError as stopped:
            status, error = "failed", stopped
        except KeyboardInterrupt:
            status = "interrupted"
        figures, wrong = self.reductions.values(self.simulation.time, self.simulation.value)
        status, error = ("failed", wrong) if status == "completed" and wrong else (status, error)
        outcome = _outcome(self, status, error, figures)
        outcome.termination = _end_of(self.reductions.violated) or self.simulation.termination
        outcome.warnings += self.simulation.warnings()
        outcome.signal = interrupted.number or outcome.signal
        if writer:
            recording.close(writer, outcome)
        if self.checkpoints:
            self.checkpoints.end(outcome)
        return outcome

    def _solve(self, writer: ResultWriter | None, watch: Callable[[float], None], interrupted: Interruption) -> None:
        began = clock.perf_counter()
        aside = 0.0

        def wanted() -> bool:
            return interrupted.wanted or self._stopped()

        try:
            self.simulation.breakable = interrupted.breakable
            with START.lap("initializing"):
                self.simulation.initialize(wanted)
            interrupted.raise_if_wanted()
            aside += self._look(wanted)
            if self.checkpoints and writer:
                self.checkpoints.start(self.simulation, self.reductions, writer)
            with self.stopwatch.lap("stepping"):
                for stepwise, recorded in self.simulation.batches(wanted):
                    resumed = clock.perf_counter()
                    self.reductions.update(stepwise)
                    if self.samples:
                        self.samples.append(recorded)
                    if writer:
                        with self.stopwatch.lap("recording"):
                            recording.append(writer, recorded)
                    watch(self.simulation.time)
                    if self.checkpoints and writer:
                        self.checkpoints.follow(self.simulation, self.reductions, writer, interrupted.wanted)
                    aside += clock.perf_counter() - resumed
                    interrupted.raise_if_wanted()
                    if self._stopped():
                        raise KeyboardInterrupt
                    if not self.simulation.done % self.simulation.looks_at and self.reductions.ends():
                        break
            self.simulation.close()
        except BaseException:
            with suppress(CosimError):  # what comes after a failure is no news
                self.simulation.close()
            raise
        finally:
            self.seconds["solve"] = clock.perf_counter() - began - aside

    def _look(self, wanted: Callable[[], bool]) -> float:
        """Look whether equal steps are stable, which is part of the setup; how long that takes (s)."""
        began, simulation = clock.perf_counter(), self.simulation
        if self._kernels and self.looks:
            own = simulation.arena.nbytes > program.LARGE and simulation.kernels and not self.network.has_foreign
            arena = simulation.arena if own else copy_of(simulation.arena)
            try:
                self.unstable = stability.warnings(self._program, self._kernels, arena, wanted)
            finally:
                if own:
                    self._program.begin(simulation.arena)
                    simulation.initialize(wanted)
        spent = clock.perf_counter() - began
        self.seconds["setup"] += spent
        return spent

    def _writer(self) -> AbstractContextManager[ResultWriter | None]:
        if self.output is None:
            return nullcontext()  # else it keeps what is there, come what may
        more, state = dict(self.attributes), None
        if self.checkpoints:
            more, state = {**more, **self.checkpoints.marked}, self.checkpoints.result
        about = {**recording.about(self.network, self.engine, self.reductions), **more}
        return ResultWriter(self.output, recording.described(self.network, self.simulation.probes[1]), about, state)


def _checkpoints(output: Path | None, every: str | None, resume: bool) -> Checkpoints | None:
    """What keeps checkpoints, where somebody wants some. Raises: WrongValue without a result."""
    if every is None and not resume:
        return None
    from cosim.engine.checkpoints import Checkpoints

    return Checkpoints(output, every, resume)


def _steps(network: Network, until: float) -> int:
    """How many steps lead to the first communication point that is not before a time (s), or to the end."""
    run = network.diagram.run
    return run.steps if until >= run.stop else max(1, min(run.steps, math.ceil(until / run.step - 1e-9)))


def _probes(network: Network, reductions: Reductions) -> list[Probes]:
    """What is reduced is seen at every step, what is recorded at the recording's period."""
    record, grid = network.diagram.record, network.schedule.grid
    every = grid * round(record.period / network.diagram.run.step) if record else grid
    return [Probes(reductions.signals, grid), Probes(network.recorded, every)]


def _outcome(run: Run, status: str, error: CosimError | None, figures: dict[str, Any]) -> Outcome:
    diagram = run.network.diagram
    judged, warnings, signal = _judged(run.network, run.reductions)
    failed = [conditions.as_warning(run.network, finding) for finding in judged if finding.holds is False]
    coarse = _coarse(run.network, run.simulation)
    unseen = unseen_jumps.warnings(run.network) if run.looks else ()
    return Outcome(
        diagram=str(diagram.path),
        status="interrupted" if signal else status,
        steps=run.simulation.steps,
        time=run.simulation.time,
        method=diagram.run.method,
        engine=run.engine,
        kernels_compiled=run.kernels_compiled,
        seconds={name: round(value, 6) for name, value in run.seconds.items()},
        metrics=figures,
        results=str(run.output) if run.output else None,
        inner_steps=step_counts.inner_steps(run.simulation.program, run.simulation.arena),
        error=error,
        events=run.reductions.events(),
        signal=signal,
        warnings=[*run.reductions.warnings, *run.unstable, *warnings, *failed, *coarse, *unseen],
        conditions=judged,
        requirements=run.reductions.verdicts(status == "completed" and run.steps == diagram.run.steps),
        units=run.reductions.units,
        windows=run.reductions.windows,
        swaps=[str(swap) for swap in run.network.swaps],
        stepping=step_counts.stepping(run.simulation.program, run.simulation.control),
    )


def _end_of(violated: Verdict | None) -> CosimError | None:
    """Why a violated requirement ended the run."""
    if violated is None:
        return None
    return CosimError(f"ended as {violated.name} is violated: {violated.formula}, at {violated.place}")


def _judged(network: Network, reductions: Reductions) -> tuple[list[Finding], list[CosimError], int]:
    """The conditions along the run, warnings of others, and the number of a signal that ended a rule, or 0.

    A rule may never end. Nothing is lost with it but what the rules would have said.
    """
    try:
        with interruption.heard():
            return reductions.conditions(), _warnings(network), 0
    except Interrupted as stopped:
        where = " ".join(("no condition was judged: interrupted", *getattr(stopped, "__notes__", [])))
        return [], [CosimError(where)], stopped.number


def _coarse(network: Network, simulation: Simulation) -> list[CosimError]:
    """A warning of steps that were longer than the tolerance allows."""
    stepping, run = step_counts.stepping(simulation.program, simulation.control), network.diagram.run
    if not stepping or not stepping.coarse:
        return []
    message = f"{stepping.coarse} of {simulation.steps} steps miss run.coupling_tolerance"
    why, fix = "and the next could only be shorter", "write run.rollback: true, or a smaller run.step"
    if run.rollback:
        why, fix = (
            f"at the smallest step of {stepping.shortest:.3g} s",
            "choose a smaller run.smallest_step",
        )
    return [CosimError(f"{message}, {why}", run.nodes["coupling_tolerance"].place, fix)]


def _warnings(network: Network) -> list[CosimError]:
    """The conditions of foreign blocks that do not hold, such as outputs without a step of delay."""
    foreign = {name for name, component in network.components.items() if component.declaration.foreign}
    broken = (
        [f for f in conditions.conditions(network) if f.component in foreign and f.holds is False] if foreign else []
    )
    return [conditions.as_warning(network, finding) for finding in broken]


def run(diagram: Diagram, **options: Any) -> Outcome:
    """Wire and run a diagram; options as of `Run`. Raises: DiagramErrors, ResultError."""
    return Run(resolution.wire(diagram), **options).execute()

"""Runs of one diagram with other steps: on threads of this process, with kernels that are compiled, or loaded, once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path

from cosim.accuracy.observed import Observed
from cosim.accuracy.refinement import TOTAL, Refinement, settings, stopping_early
from cosim.compiling.kernels import Kernels
from cosim.engine import compilation, program
from cosim.engine.outcome import Outcome
from cosim.engine.program import Program
from cosim.engine.run import ENGINES, Run
from cosim.errors import CosimError, DiagramErrors, ResultError
from cosim.machine import parallel, supervision
from cosim.machine.interruption import Interrupted
from cosim.wiring.network import Network

NetworkOf = Callable[[Sequence[str]], Network]
"""The diagram with further settings, as of --set."""


@dataclass
class Observation:
    """A run that has ended. step: in s; file: where its signals are recorded, if they are.

    unstable: warnings of what is unstable at the diagram's own step.
    """

    step: float
    outcome: Outcome
    observed: Observed
    file: Path | None = None
    unstable: Sequence[CosimError] = ()


class RefinedRuns:
    """The runs of a diagram. folder: where signals are recorded, or None. watch: told how far they are, and of how far.

    Both are simulated times (s); a run that costs as much as k runs of the diagram counts k times. kernels: where a run
    of the diagram has them already.
    """

    def __init__(
        self,
        network: Network,
        network_of: NetworkOf,
        engine: str = ENGINES[0],
        folder: Path | None = None,
        watch: Callable[[float, float], None] = lambda done, total: None,
        kernels: Kernels | None = None,
    ) -> None:
        self.network = network
        self._network_of, self._engine, self._folder, self._watch = network_of, engine, folder, watch
        self._kernels = kernels
        self._passed: dict[Refinement, float] = {}
        self._total = 0.0
        self._lock = threading.Lock()

    def observe(self, refinements: Iterable[Refinement]) -> dict[Refinement, Observation]:
        """Run them, the longest first; how each ended is in its outcome.

        FMUs and plain Python run one after another, as nobody vouches for their code. What is extra and does not fit
        the diagram is left out. Raises: DiagramErrors of others that do not, Interrupted, ResultError.
        """
        runs = {}
        for refinement in sorted(refinements, key=lambda refinement: -refinement.cost):
            with suppress(DiagramErrors) if refinement.is_extra else nullcontext():
                runs[refinement] = self._run(refinement)
        self._total += self.network.diagram.run.stop * sum(refinement.cost for refinement in runs)
        count = min(parallel.processors(), len(runs))
        if count <= 1 or self._is_python() or self.network.has_foreign:
            return {refinement: self._observation(refinement, run) for refinement, run in runs.items()}
        stop = threading.Event()
        with parallel.threads(count) as executor:
            try:
                futures = {r: executor.submit(self._observation, r, run, stop.is_set) for r, run in runs.items()}
                return {refinement: future.result() for refinement, future in futures.items()}
            except BaseException:
                stop.set()
                raise

    def _run(self, refinement: Refinement) -> Run:
        changed = settings(self.network, refinement)
        network = self._network_of(changed) if changed else self.network
        network = stopping_early(network, refinement.early) if refinement.early else network
        built = program.build(network, network.diagram.run.method)
        name = f"{refinement.steps}-{refinement.inner}-{refinement.coarser}-{refinement.early}.nc"
        output = self._folder / name if self._folder else None
        run = Run(network, self._engine, output, prepared=(built, self._compiled(built)))
        run.reductions = Observed(network, refinement.steps)
        run.looks = refinement == TOTAL[0]
        return run

    def _is_python(self) -> bool:
        """Whether the interpreter has a part in it, at any block."""
        modules = self._kernels.modules.values() if self._kernels else ()
        return self._engine != ENGINES[0] or any(module is None for module in modules)

    def _compiled(self, built: Program) -> Kernels:
        """The kernels of all runs: they know of no step. Loaded here, where no other thread is loading."""
        if self._kernels is None:
            self._kernels = compilation.compile_program(built)
            for module in (*self._kernels.modules.values(), self._kernels.loop):
                if module and self._engine == ENGINES[0]:
                    module.load()
        return compilation.fitting(self._kernels, built)

    def _observation(
        self, refinement: Refinement, run: Run, stopped: Callable[[], bool] = supervision.never
    ) -> Observation:
        def watch(time: float) -> None:
            with self._lock:
                self._passed[refinement] = time * refinement.cost
                self._watch(sum(self._passed.values()), self._total)

        outcome = run.execute(watch, stopped)
        if outcome.status == "interrupted":
            raise Interrupted(outcome.signal or signal.SIGINT)
        if isinstance(outcome.error, ResultError):  # which says nothing of the step
            raise outcome.error
        assert isinstance(run.reductions, Observed)
        return Observation(run.network.diagram.run.step, outcome, run.reductions, run.output, run.unstable)

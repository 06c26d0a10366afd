"""One run of a program: binds its calls to an engine, initializes, and advances in batches of steps.

Between two batches the caller may look at the probes, draw progress, write to disk or be interrupted; inside a batch
nothing returns to Python, and the interpreter's lock is released.
"""

from __future__ import annotations

import time as clock
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial

import numpy as np

from cosim.authoring.foreign import LoopWords, Part
from cosim.compiling.kernels import Kernels
from cosim.engine import failures, hosts
from cosim.engine.binding import Binding, Walked
from cosim.engine.probes import Buffers, Probes, Samples
from cosim.engine.program import Program
from cosim.errors import CosimError, Terminated
from cosim.machine import floating, memory, supervision
from cosim.master import tables
from cosim.wiring.network import Component, Signal

_TOLD = {
    "step": tables.STEP_SIZE,
    "ending": tables.ENDING,
    "again": tables.AGAIN,
    "next_event": tables.NEXT_EVENT,
    "left": tables.LEFT,
    "early": tables.EARLY,
    "tangent": tables.TANGENT,
}
BATCH_SECONDS, GROWTH = 0.04, 16
"""How long a batch is to take, and how many times the last one it may be: steps differ in what they cost."""
LARGEST_BATCH = 1 << 40


class Simulation:
    """A run of a program on its own copy of the arena. Nothing is started before `initialize`.

    kernels: from `compile_program` for the compiled engine; None interprets everything as plain Python. walked: what
    the loop walks in place of the program itself. spent: how long batches took so far (s).
    """

    def __init__(
        self, program: Program, kernels: Kernels | None, probes: Sequence[Probes] = (), walked: Walked | None = None
    ) -> None:
        self.program = program
        self.kernels = kernels
        self.ticks = program.network.diagram.run.steps * program.network.schedule.grid
        self._foreign = [c for c in program.network.components.values() if c.declaration.foreign]
        self._forked = bool(self._foreign) and supervision.AVAILABLE
        self._zeros = memory.shared if self._forked else memory.private
        self.arena = program.begun(self._zeros)
        self.probes = probes
        self.buffers = Buffers(program, self.arena, probes, self.ticks, self._words)
        self.control = self._words(tables.CONTROL_WORDS)
        self.breakable: Callable[[], AbstractContextManager[None]] = nullcontext  # put around what is interpreted
        self.termination: Terminated | None = None
        self.rests_at = self.looks_at = LARGEST_BATCH  # ticks: a batch goes no further than the next multiple of both
        self.resting = False  # whether what is known is that of a communication point which is still ahead
        self.spent, self._walked = 0.0, walked
        self._interpreted = kernels is None and not self._forked
        self._initialized = False
        self._binding: Binding | None = None
        self._parts: Mapping[str, Sequence[Part]] = {}
        self.host: hosts.Here | hosts.Forked | None = None

    def _words(self, *shape: int) -> np.ndarray:
        """Zeroed words that the loop changes."""
        return self._zeros(8 * int(np.prod(shape))).view(np.int64).reshape(shape)

    # ---- binding ----

    def _open(self) -> hosts.Here | hosts.Forked:
        """The host of the loop, with the instances of foreign blocks. Raises: CosimError."""
        binding = self._binding = Binding(self.program, self.kernels, self.arena, self.control, self._zeros)
        binding.fill(self.buffers, self._walked)
        self._parts = {component.name: self._foreign_parts(component) for component in self._foreign}
        base, control = self.arena.ctypes.data, self.control.ctypes.data
        bound = {name: partial(function, 0.0, base, control) for name, function in binding.commands.items()}
        commands = {name: partial(_standard, function) for name, function in bound.items()}
        watch = hosts.Watch(self.program, self.control, self._parts)
        patience = self.program.network.diagram.run.patience
        if self._forked:
            return hosts.Forked(self._parts, commands, watch, patience)
        # An abandoned call goes on with all of this.
        keep = None if self.kernels is None else (self.arena, self.control, self.buffers, binding, self.kernels)
        host = hosts.Here(self._parts, commands, watch, patience, keep)
        weakref.finalize(self, host.close, terminate=False)
        return host

    def _foreign_parts(self, component: Component) -> Sequence[Part]:
        """The instances of a foreign block, which compute those locals only that somebody looks at."""
        network = self.program.network
        looked_at = {s for group in self.probes for s in group.signals}
        looked_at |= {s.whole for other in network.components.values() for wires in other.wires.values() for s in wires}
        looked_at |= {*network.reduced.values()}
        wanted = {s.variable for s in looked_at if s.component == component.name}
        calls = [call for call in self.program.calls if call.component == component.name]
        assert component.declaration.foreign
        return component.declaration.foreign.parts(
            component, calls, self.arena, self._loop(component), wanted, self._zeros
        )

    def _loop(self, component: Component) -> LoopWords:
        """What foreign blocks are told of the loop."""
        words = {name: self.control.ctypes.data + 8 * w for name, w in _TOLD.items()}
        words["early"] *= int(self.program.attempts.rollback)
        return LoopWords(**words, histories=self.program.going_on(component))

    # ---- running ----

    def initialize(self, wanted: Callable[[], bool] = supervision.never) -> None:
        """Calculated parameters, start values and outputs at time zero; instances of foreign blocks.

        wanted: as of `batches`. Raises: BlockFailed, Diverged, FmuError.
        """
        self.host = self.host or self._open()
        self.host.open()
        self.execute("CALCULATE", "START", wanted)
        self._initialized = self.resting = True

    def execute(self, first: str, last: str, wanted: Callable[[], bool] = supervision.never) -> None:
        """Do phases that follow each other, once, at time zero. Raises: as `initialize`."""
        phases = self.program.phases
        self.control[tables.FIRST_ROW], self.control[tables.END_ROW] = phases[first][0], phases[last][1]
        self._raise(self._have("execute", wanted))

    def close(self) -> None:
        """End all instances of foreign blocks; signals can still be read. Raises: FmuCrashed, FmuHung."""
        if self.host:
            self.host.close(self._initialized)

    def warnings(self) -> list[CosimError]:
        """What foreign blocks warned of so far; of a block in many processes, what the first of them did."""
        found: list[CosimError] = []
        for parts in self._parts.values():
            several = [warnings for part in parts if (warnings := part.trace.warnings())]
            found += several[0] if several else []
        return found

    @property
    def done(self) -> int:
        """How many ticks are done."""
        return int(self.control[tables.TICK])

    @property
    def steps(self) -> int:
        """How many communication steps are done."""
        return int(self.control[tables.STEPS])

    @property
    def time(self) -> float:
        """The simulated time (s)."""
        between = float(self.control.view(float)[tables.ENDED_AT])
        return between if between > 0.0 else self.program.time(self.done)

    def batches(self, wanted: Callable[[], bool] = supervision.never) -> Iterator[list[Samples]]:
        """Run to the end; after each batch, what the probes saw. The arrays are valid until the next batch.

        wanted: whether somebody wants the run to stop; a batch then ends at the next step, and the caller stops.
        Where a block ends the run before, `termination` says so. Raises: BlockFailed, Diverged, Terminated where that
        is within a step and cannot be reached, KeyboardInterrupt where a block does not let it stop; what the probes
        saw before is yielded first.
        """
        size = (1 if self._parts else 64) * self.program.network.schedule.grid
        finished = False
        while not finished:
            before = self.done
            last = min(before + size, self.ticks, *((before // n + 1) * n for n in (self.rests_at, self.looks_at)))
            self.control[tables.LAST], self.control[tables.FINAL] = last, last == self.ticks
            self.control[tables.STOP] = 0
            began = clock.perf_counter()
            status, error = self._do_batch(wanted)
            spent = clock.perf_counter() - began
            self.spent += spent
            finished = last == self.ticks and not self.control[tables.FINAL]
            ended = finished or self.control[tables.ENDING] == tables.ENDED
            self.resting = error is None and status <= tables.WARNING and not ended
            yield self.buffers.take()
            if error:
                raise error
            self._raise(status)
            if self.control[tables.ENDING] == tables.ENDED and self.time < self.program.time(self.ticks):
                self.termination = self.ended_by()
                return
            did = self.done - before
            size = int(max(1, min(GROWTH * size, did * BATCH_SECONDS / max(spent, 1e-6), LARGEST_BATCH)))

    def ended_by(self) -> Terminated:
        """Who ended the run."""
        ended_by = int(self.control[tables.ENDED_BY])
        if ended_by:
            return failures.terminated(self.program, ended_by - 1, self.time)
        return next(p.trace.termination() for ps in self._parts.values() for p in ps if p.trace.terminated)

    def _have(self, command: str, wanted: Callable[[], bool]) -> int:
        """Have the loop do something. Interpreted, it is this thread that does it, and a block may not return."""
        assert self.host, "initialize() comes first"
        with self.breakable() if self._interpreted else nullcontext():
            return self.host.run(command, wanted)

    def _do_batch(self, wanted: Callable[[], bool]) -> tuple[int, BaseException | None]:
        try:
            return self._have("run", wanted), None
        except (CosimError, KeyboardInterrupt) as error:  # a process has ended, but what it probed is here
            return tables.OK, error

    def _raise(self, status: int) -> None:
        """Raises: the error that a status of the loop means."""
        if status <= tables.WARNING:
            return
        if status == tables.NON_FINITE:
            raise failures.divergence(self.program, self.arena, int(self.control[tables.ELEMENT]), self.time)
        if status == tables.STALLED:
            raise failures.stalled(self.program, self.arena, int(self.control[tables.ELEMENT]))
        row = int(self.control[tables.AT])
        if status == tables.RESTLESS:
            raise failures.restless(self.program, self.time)
        if status == tables.INDIVISIBLE:
            raise failures.indivisible(self.program, float(self.control.view(float)[tables.NEXT_EVENT]))
        if status == tables.UNSOLVED:
            raise failures.unsolved(self.program, self.arena, row, self.time)
        call = self.program.calls[int(self.program.rows[row, tables.A])]
        if call.component in self._parts:
            assert self.host
            raise self.host.failure(call.component, self.time)
        error = failures.failure(self.program, self.arena, call, self.time, self._interpreted)
        causes = self._binding.causes if self._binding else []
        raise error from (causes[-1] if causes else None)

    def value(self, signal: Signal) -> np.ndarray:
        """A signal now, as a copy (instances…, *shape)."""
        return self.program.signal(signal, self.arena).copy()


def _standard(function: Callable[..., int]) -> int:
    """Call a function of the loop with IEEE 754's arithmetic, whatever else this process has loaded."""
    with floating.standard(), np.errstate(all="ignore"):
        return function()

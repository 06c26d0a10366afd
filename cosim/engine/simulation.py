"""One run of a table: binds its calls to an engine, initializes, and advances in batches of steps.

Between two batches the caller may look at the probes, draw progress, write to disk or be interrupted; inside a batch
nothing returns to Python, and the interpreter's lock is released.
"""

from __future__ import annotations

import ctypes
import math
import time as clock
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from typing import Any

import numpy as np

from cosim.authoring.foreign import Loop
from cosim.authoring.variables import Local, State
from cosim.compiling import kernels
from cosim.engine import faults, hosts, loop
from cosim.engine.table import UNWRITTEN, Call, Place, Table, copy_of
from cosim.errors import (
    BlockFailed,
    CosimError,
    DeclarationError,
    DiagramErrors,
    Diverged,
    KernelError,
    Problems,
)
from cosim.machine import floating, memory, supervision
from cosim.wiring.network import Component, Signal

KERNEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)
BATCH_SECONDS = 0.04
TEXT_BYTES = 1024  # of what a function that raised says
LARGEST_BATCH = 1 << 40
BUFFER_BYTES = 4_000_000
KINDS = {"output": "output", "calculatedParameter": "calculated parameter"}
_handles = count(1)


@dataclass(frozen=True)
class Probes:
    """Signals that are copied out together every so many steps."""

    signals: tuple[Signal, ...]
    every: int = 1


@dataclass
class Samples:
    """What one group of probes saw in one batch: step numbers (k,), and an array (k, *shape) for each signal."""

    steps: np.ndarray
    values: dict[Signal, np.ndarray]


@dataclass(frozen=True)
class Column:
    """Where a signal is in the rows of a group of probes."""

    signal: Signal
    words: slice
    stored: tuple[int, ...]
    shape: tuple[int, ...]
    dtype: np.dtype

    def of(self, rows: np.ndarray) -> np.ndarray:
        """The signal's values (k, *shape) in the rows (k, words), as a view; all have what is stored once."""
        size = math.prod(self.stored)
        found = rows[:, self.words].view(self.dtype)[:, :size].reshape(len(rows), *self.stored)
        if self.stored == self.shape:
            return found
        return np.broadcast_to(found[:, None], (len(rows), *self.shape))


@dataclass
class Kernels:
    """The modules that a table calls, by component, and the loop's; None for a component that stays Python."""

    modules: dict[str, kernels.Module | None] = field(default_factory=dict)
    loop: kernels.Module | None = None

    @property
    def compiled(self) -> int:
        """How many modules had to be compiled rather than found in the cache."""
        found = {m.key: m for m in (*self.modules.values(), self.loop) if m is not None}
        return sum(m.compiled_now for m in found.values())


def compile_table(table: Table) -> Kernels:
    """The compiled loop and the kernels of all components of a table, each block type once.

    Raises: DiagramErrors with all that keeps functions from being compiled, each at its line.
    """
    made: dict[tuple[Any, ...], kernels.Module | None] = {}
    problems = Problems()
    result = Kernels(loop=kernels.raw_module("engine", (loop.run, loop.execute)))
    for name, component in table.network.components.items():
        foreign = component.declaration.foreign
        if foreign:
            result.modules[name] = kernels.raw_module("fmu", [foreign.kernel])
            continue
        if not component.declaration.compiled:
            result.modules[name] = None
            continue
        key = (id(component.declaration), *component.constants().items())
        if key not in made:
            made[key] = _module(component, problems)
        result.modules[name] = made[key]
    problems.raise_if_any()
    return result


def _module(component: Component, problems: Problems) -> kernels.Module | None:
    """The kernels of a component's type; None, and mistakes with its name, where they cannot be compiled."""
    try:
        return kernels.block_module(component.declaration, component.constants())
    except (KernelError, DeclarationError, DiagramErrors) as error:
        for mistake in error.errors if isinstance(error, DiagramErrors) else [error]:
            place = mistake.position or component.entry.type.position
            problems.add(type(mistake)(f"block {component.name}: {mistake.message}", place, mistake.fix))
        return None


class Simulation:
    """A run of a table on its own copy of the arena.

    kernels: from `compile_table` for the compiled engine; None interprets everything as plain Python.
    """

    def __init__(self, table: Table, kernels: Kernels | None, probes: Sequence[Probes] = ()) -> None:
        self.table = table
        self.step = table.network.diagram.run.step
        self.steps = round(table.network.diagram.run.stop / self.step)
        foreign = [component for component in table.network.components.values() if component.declaration.foreign]
        forked = bool(foreign) and supervision.AVAILABLE
        self._zeros = memory.shared if forked else memory.private
        self.arena = copy_of(table.arena, self._zeros)
        self.probes = probes
        self.breakable: Callable[[], AbstractContextManager[None]] = nullcontext  # put around what is interpreted
        self._interpreted = kernels is None and not forked
        self._initialized = False
        self._texts = self._zeros(TEXT_BYTES)
        self._causes: list[BaseException] = []
        self._keep: list[Any] = []
        if kernels is None:
            functions = [next(_handles) for _ in table.calls]
            memory.interpreted.update((handle, self._python(n)) for n, handle in enumerate(functions))
            weakref.finalize(self, _forget, functions)
            run: Callable[..., int] = loop.run
            execute: Callable[..., int] = loop.execute
        else:
            functions = [self._address(kernels, n) for n in range(len(table.calls))]
            assert kernels.loop is not None
            compiled = kernels.loop.load()
            run, execute = KERNEL(compiled.address("run")), KERNEL(compiled.address("execute"))
        self._build_control(np.array(functions, np.int64))
        base, control, step = self.arena.ctypes.data, self.control.ctypes.data, self.step
        bound = {"run": partial(run, step, base, control), "execute": partial(execute, 0.0, base, control)}
        commands = {name: partial(_standard, function) for name, function in bound.items()}
        # An abandoned call goes on with all of this.
        keep = None if kernels is None else (self.arena, self.control, self._groups, self._buffers, self._keep, kernels)
        self._parts = {component.name: self._foreign_parts(component) for component in foreign}
        self._host: hosts.Here | hosts.Forked
        watch, patience = hosts.Watch(table, self.control, self._parts), table.network.diagram.run.patience
        if forked:
            self._host = hosts.Forked(self._parts, commands, watch, patience)
        else:
            self._host = hosts.Here(self._parts, commands, watch, patience, keep)
            weakref.finalize(self, self._host.close, terminate=False)

    def _address(self, kernels: Kernels, n: int) -> int:
        call = self.table.calls[n]
        module = kernels.modules[call.component]
        if module is not None:
            foreign = self.table.network.components[call.component].declaration.foreign
            return module.load().address(foreign.kernel.__name__ if foreign else call.function.name)
        python = self._python(n)
        thunk = KERNEL(lambda time, base, frame: python(time))
        self._keep.append(thunk)
        return ctypes.cast(thunk, ctypes.c_void_p).value or 0

    def _python(self, n: int) -> Callable[[float], int]:
        """The n-th call as plain Python."""
        call = self.table.calls[n]
        if foreign := self.table.network.components[call.component].declaration.foreign:
            base = self.arena.ctypes.data
            return lambda time: foreign.kernel(time, base, base + call.frame)
        compiled = self.table.network.components[call.component].declaration.compiled
        return _interpreted(self.arena, call, compiled, self._texts, self._causes)

    def _build_control(self, functions: np.ndarray) -> None:
        table = self.table
        rows: list[list[int]] = []
        probes: list[list[int]] = []
        self._buffers: list[np.ndarray] = []
        self._columns: list[list[Column]] = []
        for group in self.probes:
            begin, words = len(probes), 1
            self._columns.append([])
            for signal in group.signals:
                stored = table.stored(signal, self.arena)
                size = -(-stored.nbytes // 8)
                probes.append([table.places[signal].offset, size])
                span, shape = slice(words, words + size), table.network.shape(signal)
                self._columns[-1].append(Column(signal, span, stored.shape, shape, stored.dtype))
                words += size
            capacity = max(1, min(BUFFER_BYTES // (8 * words), self.steps // group.every + 1))
            buffer = self._words(capacity, words)
            self._buffers.append(buffer)
            rows.append([group.every, begin, len(probes), words, 0, buffer.ctypes.data, capacity])
        self._groups = self._words(len(rows), loop.GROUP_WORDS)
        self._groups[:] = np.array(rows, np.int64).reshape(self._groups.shape)
        self._probe_rows = np.array(probes, np.int64).reshape(-1, loop.PROBE_WORDS)
        self._functions = functions
        control = self.control = self._words(loop.CONTROL_WORDS)
        for at, array in (
            (loop.OPERATIONS, table.operations),
            (loop.BANKS, table.banks),
            (loop.FUNCTIONS, functions),
            (loop.GROUPS, self._groups),
            (loop.PROBES, self._probe_rows),
        ):
            control[at] = array.ctypes.data
        control[loop.N_GROUPS] = len(self._groups)
        control[loop.STATES] = table.states
        control[loop.PUBLISHED], control[loop.N_PUBLISHED] = table.published
        control[loop.PUBLISHED32], control[loop.N_PUBLISHED32] = table.published32
        for name, offset in table.vectors.items():
            control[getattr(loop, name)] = offset

    def _words(self, *shape: int) -> np.ndarray:
        """Zeroed words that the loop changes."""
        return self._zeros(8 * int(np.prod(shape))).view(np.int64).reshape(shape)

    def initialize(self, wanted: Callable[[], bool] = supervision.never) -> None:
        """Calculated parameters, start values and outputs at time zero; instances of foreign blocks.

        wanted: as of `batches`. Raises: BlockFailed, Diverged, FmuError.
        """
        self._host.open()
        self.control[loop.POINT_BEGIN], self.control[loop.POINT_END] = self.table.initial
        self._raise(self._have("execute", wanted))
        self.control[loop.POINT_BEGIN], self.control[loop.POINT_END] = self.table.point
        self.control[loop.AGAIN_BEGIN] = self.table.again
        self.control[loop.BETWEEN_BEGIN], self.control[loop.BETWEEN_END] = self.table.between
        self._initialized = True

    def _foreign_parts(self, component: Component) -> Sequence[Any]:
        """The instances of a foreign block, which compute those locals only that somebody looks at."""
        network = self.table.network
        looked_at = {s for group in self.probes for s in group.signals}
        looked_at |= {s.whole for other in network.components.values() for wires in other.wires.values() for s in wires}
        looked_at |= {network.find(str(m.signal.value), None) for m in network.diagram.metrics.values()}
        wanted = {s.variable for s in looked_at if s.component == component.name}
        calls = [call for call in self.table.calls if call.component == component.name]
        assert component.declaration.foreign
        return component.declaration.foreign.parts(
            component, calls, self.arena, self._loop(component), wanted, self._zeros
        )

    def _loop(self, component: Component) -> Loop:
        """What a foreign block is told of the loop."""
        run = self.table.network.diagram.run
        joint = run.method == "joint"
        method, inner_steps = (run.integrator, run.inner_steps) if joint else (component.method, component.inner_steps)
        ending, again = (self.control.ctypes.data + 8 * word for word in (loop.ENDING, loop.AGAIN))
        return Loop(self.step, self.step / inner_steps, {"euler": 1, "rk4": 4}[method], joint, ending, again)

    def close(self) -> None:
        """End all instances of foreign blocks; signals can still be read. Raises: FmuCrashed, FmuHung."""
        self._host.close(self._initialized)

    def warnings(self) -> list[CosimError]:
        """What foreign blocks warned of so far; of a block in many processes, what the first of them did."""
        found: list[CosimError] = []
        for parts in self._parts.values():
            several = [warnings for part in parts if (warnings := part.trace.warnings())]
            found += several[0] if several else []
        return found

    @property
    def done(self) -> int:
        """How many steps are done."""
        return int(self.control[loop.STEP])

    @property
    def time(self) -> float:
        """The simulated time (s)."""
        return self.done * self.step

    def batches(self, wanted: Callable[[], bool] = supervision.never) -> Iterator[list[Samples]]:
        """Run to the end; after each batch, what the probes saw. The arrays are valid until the next batch.

        wanted: whether somebody wants the run to stop; a batch then ends at the next step, and the caller stops.
        Raises: BlockFailed, Diverged, Terminated, KeyboardInterrupt where a block does not let it stop; what the probes
        saw before is yielded first.
        """
        size = 1 if self._parts else 64
        finished = False
        while not finished:
            before, last = self.done, min(self.done + size, self.steps)
            self.control[loop.LAST], self.control[loop.FINAL] = last, last == self.steps
            self.control[loop.STOP] = 0
            began = clock.perf_counter()
            status, error = self._do_batch(wanted)
            spent = clock.perf_counter() - began
            yield self._samples()
            if error:
                raise error
            self._raise(status)
            if self.control[loop.ENDING] == loop.ENDED and self.done < self.steps:
                raise next(p.trace.termination() for ps in self._parts.values() for p in ps if p.trace.terminated)
            finished = last == self.steps and not self.control[loop.FINAL]
            did = self.done - before
            size = int(max(1, min(4 * size, did * BATCH_SECONDS / max(spent, 1e-6), LARGEST_BATCH)))

    def _have(self, command: str, wanted: Callable[[], bool]) -> int:
        """Have the loop do something. Interpreted, it is this thread that does it, and a block may not return."""
        with self.breakable() if self._interpreted else nullcontext():
            return self._host.run(command, wanted)

    def _do_batch(self, wanted: Callable[[], bool]) -> tuple[int, BaseException | None]:
        try:
            return self._have("run", wanted), None
        except (CosimError, KeyboardInterrupt) as error:  # a process has ended, but what it probed is here
            return loop.OK, error

    def _samples(self) -> list[Samples]:
        result = []
        for row, buffer, columns in zip(self._groups, self._buffers, self._columns, strict=True):
            filled = min(max(0, int(row[loop.FILLED])), len(buffer))  # a crash may have left any number
            row[loop.FILLED] = 0
            values = {column.signal: column.of(buffer[:filled]) for column in columns}
            result.append(Samples(buffer[:filled, 0], values))
        return result

    def _raise(self, status: int) -> None:
        if status <= loop.WARNING:
            return
        if status == loop.NON_FINITE:
            raise self._divergence()
        self._raise_fault(int(self.control[loop.AT]))

    def _divergence(self) -> CosimError:
        """The error for the value that the loop found to be not finite."""
        offset = int(self.control[loop.ELEMENT])
        signal, instance, element = self.table.owner(offset)
        component, variable = self.table.network.components[signal.component], self.table.network.variable(signal)
        value = self.arena[offset : offset + variable.dtype.itemsize].view(variable.dtype)[0]
        mark = UNWRITTEN[variable.dtype]
        if value.view(mark.dtype) == mark and (unwritten := self._unwritten()):
            return unwritten
        index = np.unravel_index(element, component.shape(variable)) if variable.shape else ()
        place = f"[{','.join(str(int(i) + 1) for i in index)}]" if index else ""
        member = f" of {component.fleet} {instance + 1}" if component.fleet else ""
        what = f"is {value:.3g}, beyond {loop.LIMIT:.0e}" if np.isfinite(value) else f"is not finite ({value})"
        kind = "state" if isinstance(variable, State) else KINDS.get(variable.causality, "local")
        message = f"block {signal.component}: {kind} `{signal.variable}{place}`{member} {what} at t = {self.time:g} s"
        is_state = isinstance(variable, State)
        fix = "try a smaller step, or look at what drives it" if is_state else "look at what it is computed from"
        return Diverged(message, component.entry.position, fix)

    def _unwritten(self) -> BlockFailed | None:
        """The error for the first function, in the order of evaluation, that has not written a number of its own."""
        for call in self.table.calls:
            component = self.table.network.components[call.component]
            for name, place in zip(call.function.arguments, call.arguments, strict=True):
                mark = UNWRITTEN.get(place.dtype) if place and name in call.function.writes else None
                if place is None or mark is None or component.declaration.foreign:
                    continue
                for k in range(call.count):
                    left = np.argwhere(place.view(self.arena, k).view(mark.dtype) == mark)
                    if len(left):
                        element = f"{name}[{','.join(str(i + 1) for i in left[0])}]" if len(left[0]) else name
                        member = f" of {component.fleet} {k + 1}" if component.fleet else ""
                        message = f"block {component.name}: {call.function.name}() has not written `{element}`{member}"
                        fix = f"write every element of `{name}`, and of what it is computed from, before it is read"
                        if isinstance(component.declaration.variables.get(name), Local):
                            fix += "; if it is work space, declare it with finite=False"
                        return BlockFailed(f"{message} at t = {self.time:g} s", component.entry.position, fix)
        return None

    def _raise_fault(self, operation: int) -> None:
        """Tell what went wrong in a call, from what it left behind."""
        call_index = int(self.table.operations[operation, loop.A])
        call = self.table.calls[call_index]
        if call.component in self._parts:
            raise self._host.failure(call.component, self.time)
        fault = faults.left(self.arena.ctypes.data + call.frame) or faults.Fault("an error", self.time, 0)
        component = self.table.network.components[call.component]
        member = f" of {component.fleet} {fault.instance + 1}" if component.fleet else ""
        message = f"block {call.component}: {call.function.name}(){member} failed at t = {fault.time:g} s: {fault.text}"
        fix = "set a breakpoint in the block" if self._interpreted else "run with `--engine python` to step through it"
        raise BlockFailed(message, component.entry.position, fix) from (self._causes[-1] if self._causes else None)

    def value(self, signal: Signal) -> np.ndarray:
        """A signal now, as a copy (instances…, *shape)."""
        return self.table.signal(signal, self.arena).copy()


def _standard(function: Callable[..., int]) -> int:
    """Call a function of the loop with IEEE 754's arithmetic, whatever else this process has loaded."""
    with floating.standard():
        return function()


def _forget(handles: list[int]) -> None:
    for handle in handles:
        memory.interpreted.pop(handle, None)


def _interpreted(
    arena: np.ndarray, call: Call, compiled: bool, texts: np.ndarray, causes: list[BaseException]
) -> Callable[[float], int]:
    """The call as plain Python: the author's function over views of the arena, for each instance.

    compiled: it computes as compiled functions do. What it raises is left in the frame, with the text in `texts`, and
    kept in `causes`.
    """
    from cosim.compiling import interpreted  # which takes long to import

    arguments = [
        _views(arena, call, compiled, a, p) for a, p in zip(call.function.arguments, call.arguments, strict=True)
    ]
    python = interpreted.function(call.function.python) if compiled else call.function.python

    def run(time: float) -> int:
        instance = 0
        try:
            with np.errstate(all="ignore"):
                for instance in range(call.count):
                    python(*[np.float64(time) if a is None else a[instance]() for a in arguments])
        except (Exception, SystemExit) as error:  # an exit would be lost in what calls this, and the run go on
            faults.leave(arena.ctypes.data + call.frame, texts, error, time, instance)
            causes.append(error)
            return loop.ERROR
        return loop.OK

    return run


def _views(arena: np.ndarray, call: Call, compiled: bool, name: str, place: Place | None) -> Any:
    """For each instance, what a function gets for an argument: a number for a read scalar, else an array."""
    from cosim.compiling import interpreted

    if place is None:
        return None
    views = [place.view(arena, k) for k in range(call.count)]
    if place.shape == () and name not in call.function.writes:
        return [(lambda view=view: interpreted.number(view[()]) if compiled else view[()]) for view in views]
    arrays = [view.reshape(1) if place.shape == () else view for view in views]
    for array in arrays:
        array.flags.writeable = name in call.function.writes
    arrays = [interpreted.array(array) for array in arrays] if compiled else arrays
    return [(lambda array=array: array) for array in arrays]

"""The resolved diagram as a table: one arena of memory, and the operations that the loop walks.

Everything that changes during a run lives in the arena, and everything that points into it is an offset, so that a
copy of the arena is another run of the same diagram.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cosim import engine, order
from cosim.adapters import FAULT_WORDS, run_time_dimensions
from cosim.block import CalculatedParameter, Function, Input, Local, Output, Parameter, State, Variable, variable_of
from cosim.errors import FmuError
from cosim.memory import ALIGNMENT, private
from cosim.network import Network, Signal, Slave

#: What stands where no function has written yet: a NaN that arithmetic does not make.
UNWRITTEN: dict[Any, Any] = {
    np.dtype(float): np.uint64(0x7FF8_C051_0000_0000),
    np.dtype(np.float32): np.uint32(0x7FC0_C051),
}


@dataclass(frozen=True)
class Place:
    """Where a variable lives: offset of its first instance, bytes from one instance to the next (0: shared)."""

    offset: int
    stride: int
    shape: tuple[int, ...]
    dtype: np.dtype

    def view(self, arena: np.ndarray, instance: int = 0) -> np.ndarray:
        """The variable of one instance, as a view into an arena."""
        return np.ndarray(self.shape, self.dtype, arena.data, self.offset + instance * self.stride)


@dataclass(frozen=True)
class Call:
    """One row that calls: a function of a slave with the places of its arguments."""

    slave: str
    function: Function
    count: int
    frame: int
    arguments: tuple[Place | None, ...]  # None for `time`


@dataclass
class Table:
    """What the loop needs of a diagram, position-independent; see `cosim.engine` for the columns."""

    network: Network
    arena: np.ndarray
    operations: np.ndarray
    banks: np.ndarray
    calls: list[Call]
    initial: tuple[int, int]
    point: tuple[int, int]
    again: int  # the operation of `point` with which it begins once more after an event
    between: tuple[int, int]
    states: int
    vectors: dict[str, int]  # offsets of X, W, START, SUM, D
    published: tuple[int, int]  # offset and count of the float64 numbers that have to be finite, besides the states
    published32: tuple[int, int]  # and of the float32 numbers
    places: dict[Signal, Place] = field(default_factory=dict)
    given: dict[Signal, list[tuple[int, int]]] = field(default_factory=dict)  # offsets and instances of set values

    def revalued(self, network: Network, changed: Iterable[Signal]) -> Table:
        """The same layout with the values that the changed signals have in `network`, from `wiring.revalue`."""
        arena = copy_of(self.arena)
        for signal in changed:
            place = self.places[signal]
            for offset, instances in self.given.get(signal, ()):
                view = np.ndarray((instances, *place.shape), place.dtype, arena.data, offset)
                view[...] = network.slaves[signal.slave].values[signal.variable]
        return replace(self, network=network, arena=arena)

    def signal(self, signal: Signal, arena: np.ndarray) -> np.ndarray:
        """A signal over all instances, as a view into an arena."""
        stored = self.stored(signal, arena)
        return np.broadcast_to(stored, self.network.shape(signal)) if self.is_shared(signal) else stored

    def stored(self, signal: Signal, arena: np.ndarray) -> np.ndarray:
        """A signal as it lies in an arena, as a view: that of all instances, or the one that all share."""
        place = self.places[signal]
        shape = place.shape if self.is_shared(signal) else self.network.shape(signal)
        return np.ndarray(shape, place.dtype, arena.data, place.offset)

    def is_shared(self, signal: Signal) -> bool:
        """Whether several instances have one and the same value in memory."""
        return self.places[signal].stride == 0 and self.network.slaves[signal.slave].count > 1

    def owner(self, offset: int) -> tuple[Signal, int, int]:
        """Whose value lies at an offset, of which instance, and which element of it (both from 0)."""
        for signal, place in self.places.items():
            declared = self.network.variable(signal)
            size = int(np.prod(self.network.shape(signal))) * place.dtype.itemsize
            if not isinstance(declared, (Parameter, Input)) and place.offset <= offset < place.offset + size:
                instance, rest = divmod(offset - place.offset, place.stride or size)
                return signal, instance, rest // place.dtype.itemsize
        raise IndexError(offset)


def build(network: Network, method: str) -> Table:
    """Lay out a network for one of the methods ``jacobi``, ``gauss-seidel``, ``joint``. Raises: DiagramErrors."""
    return _Builder(network, method).table()


class _Builder:
    def __init__(self, network: Network, method: str) -> None:
        self.network = network
        self.method = method
        self.size = 0
        self.writes: list[tuple[int, np.ndarray]] = []  # what the arena starts with
        self.places: dict[Signal, Place] = {}
        self.next: dict[Signal, Place] = {}  # discrete states after the next update
        self.scratch: dict[Signal, Place] = {}  # outputs that derivatives read, inside an integration
        self.given: dict[Signal, list[tuple[int, int]]] = {}
        self.calls: list[Call] = []
        self.operations: list[list[int]] = []
        self.banks: list[list[int]] = []
        self.vectors: dict[str, int] = {}
        self.published: dict[str, tuple[int, int]] = {}
        self.states = 0

    def table(self) -> Table:
        self._lay_out()
        evaluation = order.evaluation_order(self.network)
        initial = self._initial(order.initial_order(self.network))
        point, again = self._point(evaluation)
        between = self._between(evaluation)
        arena = private(self.size)
        for offset, data in self.writes:
            arena[offset : offset + data.nbytes] = np.ascontiguousarray(data).reshape(-1).view(np.uint8)
        return Table(
            network=self.network,
            arena=arena,
            operations=np.array(self.operations, np.int64).reshape(-1, engine.OPERATION_WORDS),
            banks=np.array(self.banks, np.int64).reshape(-1, engine.BANK_WORDS),
            calls=self.calls,
            initial=initial,
            point=point,
            again=again,
            between=between,
            states=self.states,
            vectors=self.vectors,
            published=self.published["float64"],
            published32=self.published["float32"],
            places=self.places,
            given=self.given,
        )

    # ---- memory ----

    def _allocate(self, size: int, alignment: int = ALIGNMENT) -> int:
        offset = -(-self.size // alignment) * alignment
        self.size = offset + -(-size // 8) * 8
        return offset

    def _store(self, slave: Slave, variable: Variable, instances: int, dense: bool = False) -> Place:
        """New memory for a variable; dense: small ones side by side."""
        size = slave.nbytes(variable)
        stride = size if instances > 1 else 0
        alignment = 8 if dense and size * instances < ALIGNMENT else ALIGNMENT
        return Place(self._allocate(size * instances, alignment), stride, slave.shape(variable), variable.dtype)

    def _lay_out(self) -> None:
        """A place for every variable: states in the state vector, the others where they come."""
        continuous = [(s, v) for s in self.network.slaves.values() for v in s.declaration.continuous()]
        self.states = sum(s.count * s.nbytes(v) for s, v in continuous) // 8
        for name in ("X", "W", "START", "SUM", "D"):
            self.vectors[name] = self._allocate(8 * self.states)
        at = self.vectors["X"]
        for slave, state in continuous:
            size = slave.nbytes(state)
            place = Place(at, size if slave.count > 1 else 0, slave.shape(state), state.dtype)
            self._place(slave, state, place)
            self._fill(slave, state, self._moved(place, "D").offset)
            at += size * slave.count
        for kind in ("float64", "float32", ""):
            begin = self._allocate(0)
            for slave in self.network.slaves.values():
                for variable in slave.declaration.variables.values():
                    if _checked(variable) == kind:
                        self._lay_out_one(slave, variable)
            if kind:
                self.published[kind] = begin, (self.size - begin) // np.dtype(kind).itemsize
        for slave in self.network.slaves.values():
            self._lay_out_hidden(slave)
            for port in slave.wires:
                self._connect(slave, port)

    def _lay_out_one(self, slave: Slave, variable: Variable) -> None:
        signal = Signal(slave.name, variable.name)
        if signal in self.places or variable.name in slave.wires or variable.dtype.hasobject:
            return
        given = slave.values.get(variable.name)
        shared = isinstance(variable, (Parameter, Input)) and given is not None and len(given) == 1
        dense = bool(_checked(variable))
        self._place(slave, variable, self._store(slave, variable, 1 if shared else slave.count, dense))

    def _lay_out_hidden(self, slave: Slave) -> None:
        """What nobody outside sees: the next values of discrete states, the outputs inside an integration."""
        for state in slave.declaration.discrete():
            self.next[Signal(slave.name, state.name)] = self._store(slave, state, slave.count)
        for name in sorted({name for f in order.needed_outputs(slave) for name in f.writes}):
            variable = slave.declaration.variables[name]
            self.scratch[Signal(slave.name, name)] = place = self._store(slave, variable, slave.count)
            self._fill(slave, variable, place.offset)

    def _place(self, slave: Slave, variable: Variable, place: Place) -> None:
        signal = Signal(slave.name, variable.name)
        self.places[signal] = place
        given = slave.values.get(variable.name)
        if given is not None:
            instances = slave.count if place.stride else 1
            self.given[signal] = [(place.offset, instances)]
            full = np.broadcast_to(given, (instances, *place.shape)) if instances != len(given) else given
            self.writes.append((place.offset, np.array(full, variable.dtype)))
        elif isinstance(variable, (Output, CalculatedParameter, Local)):
            self._fill(slave, variable, place.offset)

    def _fill(self, slave: Slave, variable: Variable, offset: int) -> None:
        """Mark what an author's function is to write, so that what it leaves out does not pass for a zero."""
        if variable.finite and variable.dtype in UNWRITTEN and not slave.declaration.foreign:
            mark = UNWRITTEN[variable.dtype]
            self.writes.append((offset, np.full(slave.count * slave.nbytes(variable) // mark.itemsize, mark)))

    def _connect(self, slave: Slave, port: str) -> None:
        """The place of a wired input: its source's own memory, or new memory where several sources are joined."""
        variable = slave.declaration.variables[port]
        shape = slave.shape(variable)
        rank = max(len(self.network.shape(source)) for source in slave.wires[port])
        if order.is_joined(slave, port):
            mapped = max(1, rank) == len(shape) + 1  # else all members read all of what is joined
            place = self._store(slave, variable, slave.count if mapped else 1)
            self._allocate(8)  # copies are of whole words, and the last one may end in the middle of one
        else:
            source = slave.wires[port][0]
            there = self.places[source.whole]
            mapped = slave.fleet is not None and rank == len(shape) + 1
            offset = there.offset + source.first * self._member_bytes(source)
            place = Place(offset, slave.nbytes(variable) if mapped else 0, shape, variable.dtype)
        self.places[Signal(slave.name, port)] = place

    def _member_bytes(self, signal: Signal) -> int:
        """The size of one member of a signal's first axis."""
        return int(np.prod(self.network.shape(signal.whole)[1:])) * self.places[signal.whole].dtype.itemsize

    # ---- operations ----

    def _operation(self, kind: int, a: int, b: int = 0, c: int = 0, every: int = 1, at_end: int = 0) -> None:
        self.operations.append([kind, a, b, c, every, at_end])

    def _range(self, begin: int) -> tuple[int, int]:
        return begin, len(self.operations)

    def _copy(self, to: int, source: int, size: int, every: int = 1) -> None:
        self._operation(engine.COPY, to, source, -(-size // 8), every)

    def _call(self, slave: Slave, function: Function, stage: bool = False, at_end: int = 0, every: int = 1) -> None:
        """A row that calls a function; stage: on the states (and outputs) of an integration's stage."""
        arguments = tuple(self._argument(slave, name, stage) for name in function.arguments)
        sizes = [slave.axes[name].size for name in run_time_dimensions(slave.declaration, slave.constants())]
        foreign = slave.declaration.foreign
        words = [*[0] * FAULT_WORDS, slave.count, *sizes, *[0] * (foreign.frame_words if foreign else 0)]
        for place in arguments:
            if place is not None:
                words += [place.offset, place.stride]
        frame = self._allocate(8 * len(words))
        self.writes.append((frame, np.array(words, np.int64)))
        self._operation(engine.CALL, len(self.calls), frame, every=every, at_end=at_end)
        self.calls.append(Call(slave.name, function, slave.count, frame, arguments))

    def _argument(self, slave: Slave, name: str, stage: bool) -> Place | None:
        if name == "time":
            return None
        signal = Signal(slave.name, variable_of(slave.declaration, name).name)
        place = self.places[signal]
        continuous = self.vectors["X"] <= place.offset < self.vectors["X"] + 8 * self.states
        if name not in slave.declaration.variables:  # d_x or next_x
            return self._moved(place, "D") if continuous else self.next[signal]
        if stage and isinstance(slave.declaration.variables[name], State) and continuous:
            return self._moved(place, "W")
        return self.scratch.get(signal, place) if stage else place

    def _moved(self, place: Place, vector: str) -> Place:
        """The same element of another vector of the state vector's layout."""
        return Place(place.offset - self.vectors["X"] + self.vectors[vector], place.stride, place.shape, place.dtype)

    def _initial(self, tasks: Iterable[order.Task]) -> tuple[int, int]:
        """Calculated parameters, start functions, outputs at time zero; given start values win over computed ones."""
        begin = len(self.operations)
        for slave in self.network.slaves.values():
            for function in slave.declaration.kind("calculate"):
                self._call(slave, function)
        for task in tasks:
            slave = self.network.slaves[task.slave]
            self._task(task)
            for function in slave.declaration.kind("start"):
                if function.name == task.function:
                    for name in sorted(function.writes & slave.given):
                        self._restore(slave, name)
        self._calls("begin")
        for signal, place in self.next.items():
            self._copy(place.offset, self.places[signal].offset, self._bytes(signal))
        return self._range(begin)

    def _restore(self, slave: Slave, name: str) -> None:
        signal = Signal(slave.name, name)
        place = self.places[signal]
        full = np.broadcast_to(slave.values[name], (slave.count, *place.shape))
        offset = self._allocate(full.size * place.dtype.itemsize)
        self.given[signal].append((offset, slave.count))
        self.writes.append((offset, np.array(full, place.dtype)))
        self._copy(place.offset, offset, full.size * place.dtype.itemsize)

    def _bytes(self, signal: Signal) -> int:
        return int(np.prod(self.network.shape(signal))) * self.places[signal.whole].dtype.itemsize

    def _task(self, task: order.Task, at_end: int = 0) -> None:
        slave = self.network.slaves[task.slave]
        if task.function:
            function = next(f for f in slave.declaration.functions if f.name == task.function)
            every = slave.every if order.is_sampled(slave) and function.kind == "outputs" else 1
            self._call(slave, function, at_end=at_end, every=every)
            return
        to = self.places[Signal(slave.name, task.port)].offset
        for source in slave.wires[task.port]:
            size = self._bytes(source)
            self._copy(to, self.places[source.whole].offset + source.first * self._member_bytes(source), size)
            to += size

    def _point(self, tasks: Iterable[order.Task]) -> tuple[tuple[int, int], int]:
        """At a communication point: sampled states take their next value, then outputs are evaluated in order.

        An event of a foreign block sees the inputs of this very point, so it comes last; then, from the second
        operation returned on, outputs are evaluated once more.
        """
        begin = len(self.operations)
        for signal, place in self.next.items():
            every = self.network.slaves[signal.slave].every
            self._copy(self.places[signal].offset, place.offset, self._bytes(signal), every)
        self._calls("events")
        again = len(self.operations)
        for task in tasks:
            self._task(task)
        self._calls("settle")
        return self._range(begin), again

    def _calls(self, kind: str) -> None:
        """The functions of one kind of all slaves."""
        for slave in self.network.slaves.values():
            for function in slave.declaration.kind(kind):
                self._call(slave, function)

    def _between(self, tasks: list[order.Task]) -> tuple[int, int]:
        """From one communication point to the next: sampled updates, then the method's integrations.

        A foreign block that is sampled samples what is published, as an update does, so it waits for no turn.
        """
        in_turns = self.method == "gauss-seidel"
        banks = self._joint_bank(tasks) if self.method == "joint" else self._banks()
        hidden = self.method == "jacobi" and any(not self.banks[bank][engine.IN_PLACE] for bank in banks.values())
        begin = len(self.operations)
        for slave in self.network.slaves.values():
            for function in slave.declaration.kind("update"):
                self._call(slave, function, every=slave.every)
            for function in slave.declaration.kind("step"):
                if not (in_turns and order.has_turn(slave)):
                    self._call(slave, function)
        if in_turns:
            self._one_after_the_other(tasks, banks)
        else:
            for bank in banks.values():
                self._operation(engine.INTEGRATE, bank)
        if hidden:
            self._copy(self.vectors["X"], self.vectors["W"], 8 * self.states)
        return self._range(begin)

    def _one_after_the_other(self, tasks: list[order.Task], banks: dict[str, int]) -> None:
        """Gauss-Seidel: block by block, on the newest of what it reads; then what it publishes is of the later time."""
        for turn in order.turns(self.network, tasks):
            slave = self.network.slaves[turn.slave]
            for task in turn.before:
                self._task(task, at_end=1)
            for function in slave.declaration.kind("step"):
                self._call(slave, function)
            if slave.name in banks:
                self._integrate_alone(banks[slave.name])
            for task in turn.after:
                self._task(task, at_end=1)

    def _integrate_alone(self, bank: int) -> None:
        """Gauss-Seidel: integrate one block's states; what it reads of itself is held like any other input."""
        begin, end, in_place = self.banks[bank][: engine.IN_PLACE + 1]
        published, staged = (self.vectors[name] + 8 * begin for name in ("X", "W"))
        if not in_place:
            self._copy(staged, published, 8 * (end - begin))
        self._operation(engine.INTEGRATE, bank)
        if not in_place:
            self._copy(published, staged, 8 * (end - begin))

    def _banks(self) -> dict[str, int]:
        """A bank for each slave with states. Stages stay hidden until it, or under Jacobi all slaves, have stepped."""
        slaves = [s for s in self.network.slaves.values() if s.declaration.continuous()]
        simple = {s.name: s.method == "euler" and s.inner_steps == 1 for s in slaves}
        if self.method == "jacobi":
            return self._simple_bank(slaves) if all(simple.values()) else {s.name: self._bank(s, 0) for s in slaves}
        return {s.name: self._bank(s, int(simple[s.name] and not order.needed_outputs(s))) for s in slaves}

    def _simple_bank(self, slaves: list[Slave]) -> dict[str, int]:
        """Jacobi where each slave does one Euler step: all derivatives come first, so one bank in place does it."""
        begin = len(self.operations)
        for slave in slaves:
            self._derivatives(slave)
        first = self._range(begin)
        return {"": self._add_bank(0, self.states, 1, "euler", 1, first, (first[1], first[1]))} if slaves else {}

    def _bank(self, slave: Slave, in_place: int) -> int:
        """The states of one slave, and the operations that give their derivatives."""
        states = slave.declaration.continuous()
        at = (self.places[Signal(slave.name, states[0].name)].offset - self.vectors["X"]) // 8
        size = sum(slave.count * slave.nbytes(s) for s in states) // 8
        begin = len(self.operations)
        self._derivatives(slave)
        first = self._range(begin)
        begin = len(self.operations)
        for function in order.needed_outputs(slave):
            self._call(slave, function, stage=True)
        self._derivatives(slave, stage=not in_place)
        inner = self._range(begin)
        if self.method == "gauss-seidel" and not in_place:  # what comes in has changed since outputs were published
            first = inner
        return self._add_bank(at, at + size, in_place, slave.method, slave.inner_steps, first, inner)

    def _joint_bank(self, tasks: list[order.Task]) -> dict[str, int]:
        """One bank of all states: the outputs and derivatives of all slaves at every stage."""
        slaves = self.network.slaves.values()
        for slave in slaves:
            if slave.declaration.kind("step"):
                message = f"block {slave.name}: a co-simulation FMU steps by itself, so it cannot be integrated jointly"
                raise FmuError(message, slave.entry.type.position, "choose another run.method, or model exchange")
        begin = len(self.operations)
        for slave in slaves:
            self._derivatives(slave)
        first = self._range(begin)
        begin = len(self.operations)
        for task in tasks:
            if not order.is_sampled(self.network.slaves[task.slave]):
                self._task(task)
        for slave in slaves:
            self._derivatives(slave)
        run = self.network.diagram.run
        return {"": self._add_bank(0, self.states, 1, run.integrator, run.inner_steps, first, self._range(begin))}

    def _derivatives(self, slave: Slave, stage: bool = False) -> None:
        for function in slave.declaration.kind("derivatives"):
            self._call(slave, function, stage)

    def _add_bank(
        self,
        begin: int,
        end: int,
        in_place: int,
        method: str,
        inner_steps: int,
        first: tuple[int, int],
        inner: tuple[int, int],
    ) -> int:
        kind = {"euler": engine.EULER, "rk4": engine.RK4}[method]
        self.banks.append([begin, end, in_place, kind, inner_steps, *first, *inner])
        return len(self.banks) - 1


def _checked(variable: Variable) -> str:
    """The data type as which a variable has to be finite at every communication point; "" where it need not."""
    if isinstance(variable, (Parameter, Input)) or not variable.finite:
        return ""
    return variable.dtype.name if variable.dtype.name in ("float64", "float32") else ""


def copy_of(arena: np.ndarray, zeros: Callable[[int], np.ndarray] = private) -> np.ndarray:
    """Another arena with the same content, in memory that `zeros` gives."""
    new = zeros(arena.size)
    new[:] = arena
    return new

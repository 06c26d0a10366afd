"""The resolved diagram as a table: one arena of memory, and the operations that the loop walks.

Everything that changes during a run lives in the arena, and everything that points into it is an offset, so that a
copy of the arena is another run of the same diagram.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cosim.authoring.declaration import Function, variable_of
from cosim.authoring.variables import CalculatedParameter, Input, Local, Output, Parameter, State, Variable
from cosim.compiling.adapters import FAULT_WORDS, run_time_dimensions
from cosim.engine import loop
from cosim.errors import FmuError
from cosim.machine.memory import ALIGNMENT, private
from cosim.wiring import order
from cosim.wiring.network import Component, Network, Signal

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
    """One row that calls: a function of a component with the places of its arguments."""

    component: str
    function: Function
    count: int
    frame: int
    arguments: tuple[Place | None, ...]  # None for `time`


@dataclass
class Table:
    """What the loop needs of a diagram, position-independent; see `cosim.engine.loop` for the columns."""

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
                view[...] = network.components[signal.component].values[signal.variable]
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
        return self.places[signal].stride == 0 and self.network.components[signal.component].count > 1

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
            operations=np.array(self.operations, np.int64).reshape(-1, loop.OPERATION_WORDS),
            banks=np.array(self.banks, np.int64).reshape(-1, loop.BANK_WORDS),
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

    def _store(self, component: Component, variable: Variable, instances: int, dense: bool = False) -> Place:
        """New memory for a variable; dense: small ones side by side."""
        size = component.nbytes(variable)
        stride = size if instances > 1 else 0
        alignment = 8 if dense and size * instances < ALIGNMENT else ALIGNMENT
        return Place(self._allocate(size * instances, alignment), stride, component.shape(variable), variable.dtype)

    def _lay_out(self) -> None:
        """A place for every variable: states in the state vector, the others where they come."""
        continuous = [(s, v) for s in self.network.components.values() for v in s.declaration.continuous()]
        self.states = sum(s.count * s.nbytes(v) for s, v in continuous) // 8
        for name in ("X", "W", "START", "SUM", "D"):
            self.vectors[name] = self._allocate(8 * self.states)
        at = self.vectors["X"]
        for component, state in continuous:
            size = component.nbytes(state)
            place = Place(at, size if component.count > 1 else 0, component.shape(state), state.dtype)
            self._place(component, state, place)
            self._fill(component, state, self._moved(place, "D").offset)
            at += size * component.count
        for kind in ("float64", "float32", ""):
            begin = self._allocate(0)
            for component in self.network.components.values():
                for variable in component.declaration.variables.values():
                    if _checked(variable) == kind:
                        self._lay_out_one(component, variable)
            if kind:
                self.published[kind] = begin, (self.size - begin) // np.dtype(kind).itemsize
        for component in self.network.components.values():
            self._lay_out_hidden(component)
            for port in component.wires:
                self._connect(component, port)

    def _lay_out_one(self, component: Component, variable: Variable) -> None:
        signal = Signal(component.name, variable.name)
        if signal in self.places or variable.name in component.wires or variable.dtype.hasobject:
            return
        given = component.values.get(variable.name)
        shared = isinstance(variable, (Parameter, Input)) and given is not None and len(given) == 1
        dense = bool(_checked(variable))
        self._place(component, variable, self._store(component, variable, 1 if shared else component.count, dense))

    def _lay_out_hidden(self, component: Component) -> None:
        """What nobody outside sees: the next values of discrete states, the outputs inside an integration."""
        for state in component.declaration.discrete():
            self.next[Signal(component.name, state.name)] = self._store(component, state, component.count)
        for name in sorted({name for f in order.needed_outputs(component) for name in f.writes}):
            variable = component.declaration.variables[name]
            self.scratch[Signal(component.name, name)] = place = self._store(component, variable, component.count)
            self._fill(component, variable, place.offset)

    def _place(self, component: Component, variable: Variable, place: Place) -> None:
        signal = Signal(component.name, variable.name)
        self.places[signal] = place
        given = component.values.get(variable.name)
        if given is not None:
            instances = component.count if place.stride else 1
            self.given[signal] = [(place.offset, instances)]
            full = np.broadcast_to(given, (instances, *place.shape)) if instances != len(given) else given
            self.writes.append((place.offset, np.array(full, variable.dtype)))
        elif isinstance(variable, (Output, CalculatedParameter, Local)):
            self._fill(component, variable, place.offset)

    def _fill(self, component: Component, variable: Variable, offset: int) -> None:
        """Mark what an author's function is to write, so that what it leaves out does not pass for a zero."""
        if variable.finite and variable.dtype in UNWRITTEN and not component.declaration.foreign:
            mark = UNWRITTEN[variable.dtype]
            self.writes.append((offset, np.full(component.count * component.nbytes(variable) // mark.itemsize, mark)))

    def _connect(self, component: Component, port: str) -> None:
        """The place of a wired input: its source's own memory, or new memory where several sources are joined."""
        variable = component.declaration.variables[port]
        shape = component.shape(variable)
        rank = max(len(self.network.shape(source)) for source in component.wires[port])
        if order.is_joined(component, port):
            mapped = max(1, rank) == len(shape) + 1  # else all members read all of what is joined
            place = self._store(component, variable, component.count if mapped else 1)
            self._allocate(8)  # copies are of whole words, and the last one may end in the middle of one
        else:
            source = component.wires[port][0]
            there = self.places[source.whole]
            mapped = component.fleet is not None and rank == len(shape) + 1
            offset = there.offset + source.first * self._member_bytes(source)
            place = Place(offset, component.nbytes(variable) if mapped else 0, shape, variable.dtype)
        self.places[Signal(component.name, port)] = place

    def _member_bytes(self, signal: Signal) -> int:
        """The size of one member of a signal's first axis."""
        return int(np.prod(self.network.shape(signal.whole)[1:])) * self.places[signal.whole].dtype.itemsize

    # ---- operations ----

    def _operation(self, kind: int, a: int, b: int = 0, c: int = 0, every: int = 1, at_end: int = 0) -> None:
        self.operations.append([kind, a, b, c, every, at_end])

    def _range(self, begin: int) -> tuple[int, int]:
        return begin, len(self.operations)

    def _copy(self, to: int, source: int, size: int, every: int = 1) -> None:
        self._operation(loop.COPY, to, source, -(-size // 8), every)

    def _call(
        self, component: Component, function: Function, stage: bool = False, at_end: int = 0, every: int = 1
    ) -> None:
        """A row that calls a function; stage: on the states (and outputs) of an integration's stage."""
        arguments = tuple(self._argument(component, name, stage) for name in function.arguments)
        sizes = [
            component.axes[name].size for name in run_time_dimensions(component.declaration, component.constants())
        ]
        foreign = component.declaration.foreign
        words = [*[0] * FAULT_WORDS, component.count, *sizes, *[0] * (foreign.frame_words if foreign else 0)]
        for place in arguments:
            if place is not None:
                words += [place.offset, place.stride]
        frame = self._allocate(8 * len(words))
        self.writes.append((frame, np.array(words, np.int64)))
        self._operation(loop.CALL, len(self.calls), frame, every=every, at_end=at_end)
        self.calls.append(Call(component.name, function, component.count, frame, arguments))

    def _argument(self, component: Component, name: str, stage: bool) -> Place | None:
        if name == "time":
            return None
        signal = Signal(component.name, variable_of(component.declaration, name).name)
        place = self.places[signal]
        continuous = self.vectors["X"] <= place.offset < self.vectors["X"] + 8 * self.states
        if name not in component.declaration.variables:  # d_x or next_x
            return self._moved(place, "D") if continuous else self.next[signal]
        if stage and isinstance(component.declaration.variables[name], State) and continuous:
            return self._moved(place, "W")
        return self.scratch.get(signal, place) if stage else place

    def _moved(self, place: Place, vector: str) -> Place:
        """The same element of another vector of the state vector's layout."""
        return Place(place.offset - self.vectors["X"] + self.vectors[vector], place.stride, place.shape, place.dtype)

    def _initial(self, tasks: Iterable[order.Task]) -> tuple[int, int]:
        """Calculated parameters, start functions, outputs at time zero; given start values win over computed ones."""
        begin = len(self.operations)
        for component in self.network.components.values():
            for function in component.declaration.kind("calculate"):
                self._call(component, function)
        for task in tasks:
            component = self.network.components[task.component]
            self._task(task)
            for function in component.declaration.kind("start"):
                if function.name == task.function:
                    for name in sorted(function.writes & component.given):
                        self._restore(component, name)
        self._calls("begin")
        for signal, place in self.next.items():
            self._copy(place.offset, self.places[signal].offset, self._bytes(signal))
        return self._range(begin)

    def _restore(self, component: Component, name: str) -> None:
        signal = Signal(component.name, name)
        place = self.places[signal]
        full = np.broadcast_to(component.values[name], (component.count, *place.shape))
        offset = self._allocate(full.size * place.dtype.itemsize)
        self.given[signal].append((offset, component.count))
        self.writes.append((offset, np.array(full, place.dtype)))
        self._copy(place.offset, offset, full.size * place.dtype.itemsize)

    def _bytes(self, signal: Signal) -> int:
        return int(np.prod(self.network.shape(signal))) * self.places[signal.whole].dtype.itemsize

    def _task(self, task: order.Task, at_end: int = 0) -> None:
        component = self.network.components[task.component]
        if task.function:
            function = next(f for f in component.declaration.functions if f.name == task.function)
            every = component.every if order.is_sampled(component) and function.kind == "outputs" else 1
            self._call(component, function, at_end=at_end, every=every)
            return
        to = self.places[Signal(component.name, task.port)].offset
        for source in component.wires[task.port]:
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
            every = self.network.components[signal.component].every
            self._copy(self.places[signal].offset, place.offset, self._bytes(signal), every)
        self._calls("events")
        again = len(self.operations)
        for task in tasks:
            self._task(task)
        self._calls("settle")
        return self._range(begin), again

    def _calls(self, kind: str) -> None:
        """The functions of one kind of all components."""
        for component in self.network.components.values():
            for function in component.declaration.kind(kind):
                self._call(component, function)

    def _between(self, tasks: list[order.Task]) -> tuple[int, int]:
        """From one communication point to the next: sampled updates, then the method's integrations.

        A foreign block that is sampled samples what is published, as an update does, so it waits for no turn.
        """
        in_turns = self.method == "gauss-seidel"
        banks = self._joint_bank(tasks) if self.method == "joint" else self._banks()
        hidden = self.method == "jacobi" and any(not self.banks[bank][loop.IN_PLACE] for bank in banks.values())
        begin = len(self.operations)
        for component in self.network.components.values():
            for function in component.declaration.kind("update"):
                self._call(component, function, every=component.every)
            for function in component.declaration.kind("step"):
                if not (in_turns and order.has_turn(component)):
                    self._call(component, function)
        if in_turns:
            self._one_after_the_other(tasks, banks)
        else:
            for bank in banks.values():
                self._operation(loop.INTEGRATE, bank)
        if hidden:
            self._copy(self.vectors["X"], self.vectors["W"], 8 * self.states)
        return self._range(begin)

    def _one_after_the_other(self, tasks: list[order.Task], banks: dict[str, int]) -> None:
        """Gauss-Seidel: block by block, on the newest of what it reads; then what it publishes is of the later time."""
        for turn in order.turns(self.network, tasks):
            component = self.network.components[turn.component]
            for task in turn.before:
                self._task(task, at_end=1)
            for function in component.declaration.kind("step"):
                self._call(component, function)
            if component.name in banks:
                self._integrate_alone(banks[component.name])
            for task in turn.after:
                self._task(task, at_end=1)

    def _integrate_alone(self, bank: int) -> None:
        """Gauss-Seidel: integrate one block's states; what it reads of itself is held like any other input."""
        begin, end, in_place = self.banks[bank][: loop.IN_PLACE + 1]
        published, staged = (self.vectors[name] + 8 * begin for name in ("X", "W"))
        if not in_place:
            self._copy(staged, published, 8 * (end - begin))
        self._operation(loop.INTEGRATE, bank)
        if not in_place:
            self._copy(published, staged, 8 * (end - begin))

    def _banks(self) -> dict[str, int]:
        """A bank for each component with states. Stages stay hidden until it, or under Jacobi all, have stepped."""
        components = [s for s in self.network.components.values() if s.declaration.continuous()]
        simple = {s.name: s.method == "euler" and s.inner_steps == 1 for s in components}
        if self.method == "jacobi":
            return (
                self._simple_bank(components)
                if all(simple.values())
                else {s.name: self._bank(s, 0) for s in components}
            )
        return {s.name: self._bank(s, int(simple[s.name] and not order.needed_outputs(s))) for s in components}

    def _simple_bank(self, components: list[Component]) -> dict[str, int]:
        """Jacobi where each component does one Euler step: all derivatives come first, so one bank in place does it."""
        begin = len(self.operations)
        for component in components:
            self._derivatives(component)
        first = self._range(begin)
        return {"": self._add_bank(0, self.states, 1, "euler", 1, first, (first[1], first[1]))} if components else {}

    def _bank(self, component: Component, in_place: int) -> int:
        """The states of one component, and the operations that give their derivatives."""
        states = component.declaration.continuous()
        at = (self.places[Signal(component.name, states[0].name)].offset - self.vectors["X"]) // 8
        size = sum(component.count * component.nbytes(s) for s in states) // 8
        begin = len(self.operations)
        self._derivatives(component)
        first = self._range(begin)
        begin = len(self.operations)
        for function in order.needed_outputs(component):
            self._call(component, function, stage=True)
        self._derivatives(component, stage=not in_place)
        inner = self._range(begin)
        if self.method == "gauss-seidel" and not in_place:  # what comes in has changed since outputs were published
            first = inner
        return self._add_bank(at, at + size, in_place, component.method, component.inner_steps, first, inner)

    def _joint_bank(self, tasks: list[order.Task]) -> dict[str, int]:
        """One bank of all states: the outputs and derivatives of all components at every stage."""
        components = self.network.components.values()
        for component in components:
            if component.declaration.kind("step"):
                message = (
                    f"block {component.name}: a co-simulation FMU steps by itself, so it cannot be integrated jointly"
                )
                raise FmuError(message, component.entry.type.position, "choose another run.method, or model exchange")
        begin = len(self.operations)
        for component in components:
            self._derivatives(component)
        first = self._range(begin)
        begin = len(self.operations)
        for task in tasks:
            if not order.is_sampled(self.network.components[task.component]):
                self._task(task)
        for component in components:
            self._derivatives(component)
        run = self.network.diagram.run
        return {"": self._add_bank(0, self.states, 1, run.integrator, run.inner_steps, first, self._range(begin))}

    def _derivatives(self, component: Component, stage: bool = False) -> None:
        for function in component.declaration.kind("derivatives"):
            self._call(component, function, stage)

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
        kind = {"euler": loop.EULER, "rk4": loop.RK4}[method]
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

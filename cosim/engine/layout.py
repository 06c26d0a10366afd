"""Where everything lies in the arena: two segments, what changes along a run and what does not.

An arena is a copy of all that a run knows, and whatever points into it is an offset, so that a copy of it is another
run. The state segment comes first, so that to save and restore a step is one copy of it. Where the elements of a
variable and the members of a fleet lie is decided here, and known by a `Place` alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.authoring.declaration import variable_of
from cosim.authoring.variables import CalculatedParameter, Input, Local, Output, Parameter, State, Variable
from cosim.engine import tables
from cosim.machine.memory import ALIGNMENT, private
from cosim.wiring import order
from cosim.wiring.network import Component, Loop, Network, Signal

#: What stands where no function has written yet: a NaN that arithmetic does not make.
UNWRITTEN: dict[Any, Any] = {
    np.dtype(float): np.uint64(0x7FF8_C051_0000_0000),
    np.dtype(np.float32): np.uint32(0x7FC0_C051),
}
#: The vectors over all continuous states: as published, of the stage that is evaluated, at the begin of an inner step,
#: a weighted sum of slopes, and derivatives.
VECTORS = ("X", "W", "BEGUN", "SUM", "D")


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

    def moved(self, bytes_: int) -> Place:
        """The same, so many bytes further on."""
        return Place(self.offset + bytes_, self.stride, self.shape, self.dtype)


class Layout:
    """A place for every variable of a network.

    places: by signal; next: of discrete states after the next update; scratch: of outputs that derivatives read, inside
    an integration. given: offsets and instances of the values that a diagram sets. vectors: offsets of VECTORS and of
    SLOPES, which is `slopes` vectors of derivatives. states: the size of each. memory: offset of what integrations keep
    from one step to the next. published: offset and count, by type, of
    numbers that have to be finite, besides the states. changing: bytes of the state segment; then come the constants.
    """

    def __init__(self, network: Network) -> None:
        self.network = network
        self.size = 0
        self.places: dict[Signal, Place] = {}
        self.next: dict[Signal, Place] = {}
        self.scratch: dict[Signal, Place] = {}
        self.given: dict[Signal, list[tuple[int, int]]] = {}
        self.vectors: dict[str, int] = {}
        self.published: dict[str, tuple[int, int]] = {}
        self._first: list[tuple[int, np.ndarray]] = []  # what the arena starts with
        self._lay_out_states()
        self._lay_out_published()
        components = self.network.components.values()
        for component in components:
            self._lay_out_hidden(component)
        for component in components:
            for port in component.wires:
                self._connect(component, port)
        self.changing = self.allocate(0)
        for component in components:
            for parameter in component.declaration.of(Parameter):
                self._lay_out(component, parameter, dense=False)

    def arena(self) -> np.ndarray:
        """The arena as a run begins with it."""
        arena = private(self.size)
        for offset, data in self._first:
            arena[offset : offset + data.nbytes] = np.ascontiguousarray(data).reshape(-1).view(np.uint8)
        return arena

    def allocate(self, size: int, alignment: int = ALIGNMENT) -> int:
        """The offset of so many bytes that are nobody's yet."""
        offset = -(-self.size // alignment) * alignment
        self.size = offset + -(-size // 8) * 8
        return offset

    def constant(self, content: np.ndarray) -> int:
        """The offset of a constant."""
        offset = self.allocate(content.nbytes)
        self._first.append((offset, content))
        return offset

    def bytes_of(self, signal: Signal) -> int:
        """The size of a signal over all instances."""
        return int(np.prod(self.network.shape(signal))) * self.places[signal.whole].dtype.itemsize

    def offset_of(self, signal: Signal) -> int:
        """Where a signal begins, which may be some members of a variable."""
        shape, whole = self.network.shape(signal.whole), self.places[signal.whole]
        return whole.offset + signal.first * int(np.prod(shape[1:])) * whole.dtype.itemsize

    def argument(self, component: Component, name: str, stage: bool) -> Place | None:
        """Where a function finds what it names, None for `time`; stage: inside an integration, not as published."""
        if name == "time":
            return None
        signal = Signal(component.name, variable_of(component.declaration, name).name)
        place = self.places[signal]
        continuous = self.vectors["X"] <= place.offset < self.vectors["X"] + 8 * self.states
        if name not in component.declaration.variables:  # d_x or next_x
            return self.derivative(place) if continuous else self.next[signal]
        if stage and continuous and isinstance(component.declaration.variables[name], State):
            return place.moved(self.vectors["W"] - self.vectors["X"])
        return self.scratch.get(signal, place) if stage else place

    def derivative(self, state: Place) -> Place:
        """Where the derivative of a continuous state lies."""
        return state.moved(self.vectors["D"] - self.vectors["X"])

    def states_of(self, component: Component) -> np.ndarray:
        """The places of a component's continuous states in the state vector, (instances, states of each)."""
        parts = [np.zeros((component.count, 0), int)]
        for state in component.declaration.continuous():
            place, size = self.places[Signal(component.name, state.name)], component.nbytes(state) // 8
            first = (place.offset - self.vectors["X"]) // 8
            parts.append(first + size * np.arange(component.count)[:, None] + np.arange(size))
        return np.concatenate(parts, axis=1)

    def unknowns(self, loop: Loop) -> int:
        """The offset of what the loop's SOLVE has to know of an algebraic loop, and works with; see `loop.py`."""
        places = [self.places[signal] for signal in loop.torn]
        fleets = {self.network.components[task.component].fleet for task in loop.tasks}
        apart = len(fleets) == 1 and fleets != {None} and _is_memberwise(self.network, loop, self.places)
        members = self.network.components[loop.torn[0].component].count if apart else 1
        sizes = [self.bytes_of(signal) // 8 // members for signal in loop.torn]
        size = sum(sizes)
        work = self.allocate(8 * members * size * (size + tables.UNKNOWNS_VECTORS))
        pieces = [word for place, n in zip(places, sizes, strict=True) for word in (place.offset, place.stride, n)]
        return self.constant(np.array([members, size, len(places), work, *pieces], np.int64))

    # ---- the state segment ----

    def _lay_out_states(self) -> None:
        continuous = [(c, v) for c in self.network.components.values() for v in c.declaration.continuous()]
        self.states = sum(c.count * c.nbytes(v) for c, v in continuous) // 8
        for name in VECTORS:
            self.vectors[name] = self.allocate(8 * self.states)
        owners = {component.name for component, _ in continuous}
        self.memory = self.allocate(8 * tables.MEMORY_WORDS * max(1, len(owners)))
        stages = _stages(self.network)
        self.slopes = stages if stages > 1 else 0
        self.vectors["SLOPES"] = self.allocate(8 * self.states * self.slopes)
        at = self.vectors["X"]
        for component, state in continuous:
            size = component.nbytes(state)
            place = Place(at, size if component.count > 1 else 0, component.shape(state), state.dtype)
            self._place(component, state, place)
            self._mark(component, state, self.derivative(place).offset)
            at += size * component.count

    def _lay_out_published(self) -> None:
        """The variables, those side by side that have to be finite."""
        for kind in ("float64", "float32", ""):
            begin = self.allocate(0)
            for component in self.network.components.values():
                for variable in component.declaration.variables.values():
                    if _checked(variable) == kind and not isinstance(variable, Parameter):
                        self._lay_out(component, variable, dense=bool(kind))
            if kind:
                self.published[kind] = begin, (self.size - begin) // np.dtype(kind).itemsize

    def _lay_out(self, component: Component, variable: Variable, dense: bool) -> None:
        signal = Signal(component.name, variable.name)
        if signal in self.places or variable.name in component.wires or variable.dtype.hasobject:
            return
        given = component.values.get(variable.name)
        shared = isinstance(variable, (Parameter, Input)) and given is not None and len(given) == 1
        self._place(component, variable, self._store(component, variable, 1 if shared else component.count, dense))

    def _lay_out_hidden(self, component: Component) -> None:
        """What nobody outside sees: the next values of discrete states, the outputs inside an integration."""
        for state in component.declaration.discrete():
            self.next[Signal(component.name, state.name)] = self._store(component, state, component.count)
        for name in sorted({name for f in order.needed_outputs(component) for name in f.writes}):
            variable = component.declaration.variables[name]
            self.scratch[Signal(component.name, name)] = place = self._store(component, variable, component.count)
            self._mark(component, variable, place.offset)

    def _connect(self, component: Component, port: str) -> None:
        """The place of a wired input: its source's own memory, or new memory where several sources are joined."""
        variable = component.declaration.variables[port]
        shape = component.shape(variable)
        rank = max(len(self.network.shape(source)) for source in component.wires[port])
        if component.is_joined(port):
            several = isinstance(component.entry.inputs[port].value, list)
            # else all members read all of what is joined
            mapped = (max(1, rank) if several else rank) == len(shape) + 1
            place = self._store(component, variable, component.count if mapped else 1)
            self.allocate(8)  # copies are of whole words, and the last one may end in the middle of one
        else:
            mapped = component.fleet is not None and rank == len(shape) + 1
            offset = self.offset_of(component.wires[port][0])
            place = Place(offset, component.nbytes(variable) if mapped else 0, shape, variable.dtype)
        self.places[Signal(component.name, port)] = place

    def _store(self, component: Component, variable: Variable, instances: int, dense: bool = False) -> Place:
        """New memory for a variable; dense: small ones side by side."""
        size = component.nbytes(variable)
        stride = size if instances > 1 else 0
        alignment = 8 if dense and size * instances < ALIGNMENT else ALIGNMENT
        return Place(self.allocate(size * instances, alignment), stride, component.shape(variable), variable.dtype)

    # ---- what stands there at first ----

    def _place(self, component: Component, variable: Variable, place: Place) -> None:
        signal = Signal(component.name, variable.name)
        self.places[signal] = place
        given = component.values.get(variable.name)
        if given is not None:
            instances = component.count if place.stride else 1
            self.given[signal] = [(place.offset, instances)]
            full = np.broadcast_to(given, (instances, *place.shape)) if instances != len(given) else given
            self._first.append((place.offset, np.array(full, variable.dtype)))
        elif isinstance(variable, (Output, CalculatedParameter, Local)):
            self._mark(component, variable, place.offset)

    def shadow(self, component: Component, name: str) -> int:
        """The offset of a second copy of a start value that the diagram gives."""
        signal = Signal(component.name, name)
        place = self.places[signal]
        full = np.broadcast_to(component.values[name], (component.count, *place.shape))
        offset = self.constant(np.array(full, place.dtype))
        self.given[signal].append((offset, component.count))
        return offset

    def _mark(self, component: Component, variable: Variable, offset: int) -> None:
        """Mark what an author's function is to write, so that what it leaves out does not pass for a zero."""
        if variable.finite and variable.dtype in UNWRITTEN and not component.declaration.foreign:
            mark = UNWRITTEN[variable.dtype]
            size = component.count * component.nbytes(variable) // mark.itemsize
            self._first.append((offset, np.full(size, mark)))


def copy_of(arena: np.ndarray, zeros: Callable[[int], np.ndarray] = private) -> np.ndarray:
    """Another arena with the same content, in memory that `zeros` gives."""
    new = zeros(arena.size)
    new[:] = arena
    return new


def _stages(network: Network) -> int:
    """The most stages of any integrator that a network's states may be integrated by."""
    used = (network.diagram.run.integration, *(c.integration for c in network.components.values()))
    return max(integration.method.count for integration in used)


def _checked(variable: Variable) -> str:
    """The data type as which a variable has to be finite at every communication point; "" where it need not."""
    if isinstance(variable, (Parameter, Input)) or not variable.finite:
        return ""
    return variable.dtype.name if variable.dtype.name in ("float64", "float32") else ""


def _is_memberwise(network: Network, loop: Loop, places: Mapping[Signal, Place]) -> bool:
    """Whether each member of a fleet depends on itself alone."""
    parts = {task.component for task in loop.tasks}
    wires = [
        (name, port, source)
        for name in parts
        for port, sources in network.components[name].wires.items()
        for source in sources
        if source.component in parts
    ]
    return all(task.function for task in loop.tasks) and all(
        source.members is None and places[Signal(name, port)].stride for name, port, source in wires
    )

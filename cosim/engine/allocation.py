"""Memory of an arena as it is given out: places of variables, and what stands in them at first.

An input lies where its source does, or in memory of its own that a wire fills, with a history or without.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.authoring.declaration import Function
from cosim.authoring.variables import Variable
from cosim.compiling.frame import in_arena
from cosim.machine.memory import ALIGNMENT, private
from cosim.master.histories import head, words
from cosim.wiring import jumps
from cosim.wiring.network import Component, Network, Signal


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


class Allocation:
    """What has been given out so far.

    size: how many bytes. places: by signal. histories: offsets of what wires brought, by input; fresh: where they bring
    it, if the input is not read there. first: what the arena starts with, by offset; the rest is zero.
    """

    def __init__(self, network: Network) -> None:
        self.network = network
        self.size = 0
        self.places: dict[Signal, Place] = {}
        self.histories: dict[Signal, int] = {}
        self.fresh: dict[Signal, Place] = {}
        self.first: list[tuple[int, np.ndarray]] = []
        self._work: dict[tuple[str, str], dict[str, tuple[int, int]]] = {}

    def write(self, arena: np.ndarray) -> None:
        """Let an arena be as a run begins with it."""
        arena[:] = 0
        for offset, data in self.first:
            arena[offset : offset + data.nbytes] = np.ascontiguousarray(data).reshape(-1).view(np.uint8)

    def allocate(self, size: int, alignment: int = ALIGNMENT) -> int:
        """The offset of so many bytes that are nobody's yet."""
        offset = -(-self.size // alignment) * alignment
        self.size = offset + -(-size // 8) * 8
        return offset

    def constant(self, content: np.ndarray) -> int:
        """The offset of a constant."""
        offset = self.allocate(content.nbytes)
        self.first.append((offset, content))
        return offset

    def work(self, component: Component, function: Function) -> dict[str, tuple[int, int]]:
        """Where the memory is, which all instances share, that a function needs besides its arguments."""
        key = component.name, function.name
        if key not in self._work:
            sizes = {name: axis.size for name, axis in component.axes.items()}
            self._work[key] = {}
            for temporary in in_arena(component.declaration, function, component.constants()):
                shape = [size.of(sizes) for size in temporary.kind.shape]
                self._work[key][temporary.name] = self.constant(np.zeros(shape, temporary.kind.element)), 0
        return self._work[key]

    def bytes_of(self, signal: Signal) -> int:
        """The size of a signal over all instances."""
        return int(np.prod(self.network.shape(signal))) * self.places[signal.whole].dtype.itemsize

    def offset_of(self, signal: Signal) -> int:
        """Where a signal begins, which may be some members of a variable."""
        shape, whole = self.network.shape(signal.whole), self.places[signal.whole]
        return whole.offset + signal.first * int(np.prod(shape[1:])) * whole.dtype.itemsize

    def store(self, component: Component, variable: Variable, instances: int, dense: bool = False) -> Place:
        """New memory for a variable; dense: small ones side by side."""
        size = component.nbytes(variable)
        stride = size if instances > 1 else 0
        alignment = 8 if dense and size * instances < ALIGNMENT else ALIGNMENT
        return Place(self.allocate(size * instances, alignment), stride, component.shape(variable), variable.dtype)


def connect(memory: Allocation, component: Component, port: str) -> None:
    """The place of a wired input: its source's own memory, or new memory where several sources are joined."""
    variable = component.declaration.variables[port]
    shape = component.shape(variable)
    rank = max(len(memory.network.shape(source)) for source in component.wires[port])
    if component.is_joined(port):
        several = isinstance(component.entry.inputs[port].value, list)
        # else all members read all of what is joined
        mapped = (max(1, rank) if several else rank) == len(shape) + 1
        place = memory.store(component, variable, component.count if mapped else 1)
        memory.allocate(8)  # copies are of whole words, and the last one may end in the middle of one
    else:
        mapped = component.fleet is not None and rank == len(shape) + 1
        offset = memory.offset_of(component.wires[port][0])
        place = Place(offset, component.nbytes(variable) if mapped else 0, shape, variable.dtype)
    memory.places[Signal(component.name, port)] = place


def remember(memory: Allocation, component: Component, port: str) -> None:
    """The history of an input, empty as yet; what is read late has its own start value until there is one."""
    signal, coupling = Signal(component.name, port), component.couplings[port]
    variable, to = component.declaration.variables[port], memory.places[signal]
    instances, room, fresh = component.count if to.stride else 1, coupling.order + 2, to
    if coupling.delay:
        fresh = memory.fresh[signal] = memory.store(component, variable, instances)
        memory.allocate(8)  # as of `connect`
        room = jumps.room(memory.network, coupling)
    if port in component.given:
        start = np.broadcast_to(component.values[port], (instances, *to.shape))
        memory.first.append((to.offset, np.array(start, to.dtype)))
    width = -(-instances * component.nbytes(variable) // 8)
    memory.histories[signal] = memory.allocate(8 * words(room, width))
    between = int(jumps.flows(memory.network, component, port)) if coupling.delay else coupling.order + 1
    pieces = not coupling.delay or jumps.are_met(memory.network, component, port), port in component.given
    made = head(to.offset, fresh.offset, width, room, (coupling.order, between), float(coupling.delay), pieces)
    memory.first.append((memory.histories[signal], made))


def copy_of(arena: np.ndarray) -> np.ndarray:
    """Another arena with the same content."""
    new = private(arena.size)
    new[:] = arena
    return new

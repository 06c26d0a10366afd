"""Memory of an arena as it is given out: places of variables, and what stands in them at first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cosim.authoring.variables import Variable
from cosim.machine.memory import ALIGNMENT, private
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

    def arena(self) -> np.ndarray:
        """The arena as a run begins with it."""
        arena = private(self.size)
        for offset, data in self.first:
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
        self.first.append((offset, content))
        return offset

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


def copy_of(arena: np.ndarray, zeros: Callable[[int], np.ndarray] = private) -> np.ndarray:
    """Another arena with the same content, in memory that `zeros` gives."""
    new = zeros(arena.size)
    new[:] = arena
    return new

"""Where inputs lie in the arena: at their source, or in memory of their own that a wire fills, with a past or not."""

from __future__ import annotations

import numpy as np

from cosim.engine.allocation import Allocation, Place
from cosim.master.histories import head, words
from cosim.wiring.clocks import exact
from cosim.wiring.network import Component, Signal


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
        room = memory.network.schedule.most_points(min(coupling.delay, exact(memory.network.diagram.run.stop))) + 2
    if port in component.given:
        start = np.broadcast_to(component.values[port], (instances, *to.shape))
        memory.first.append((to.offset, np.array(start, to.dtype)))
    width = -(-instances * component.nbytes(variable) // 8)
    memory.histories[signal] = memory.allocate(8 * words(room, width))
    between = int(memory.network.flows(component, port)) if coupling.delay else coupling.order + 1
    made = head(to.offset, fresh.offset, width, room, (coupling.order, between), float(coupling.delay))
    memory.first.append((memory.histories[signal], made))

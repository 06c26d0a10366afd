"""What the loop and exported FMUs walk: a diagram as a program of named phases over one arena of memory.

The meaning of a step. At the communication point k, the time is t = k h, and every state x has a value x(t):

    PUBLISH    sampled states that are due take the values that were computed for them: x ← x⁺
    EVENTS     foreign blocks that have reached an event begin it
    EVALUATE   outputs and locals, in the order of direct feedthrough, each as a function of t, x(t) and its inputs
    SETTLE     foreign blocks end their events with these inputs; if one had an event, EVALUATE and SETTLE once more
               probes copy what is published
    UPDATE     sampled blocks that are due compute x⁺ from what is published, which stays
    ADVANCE    the method takes continuous states and foreign blocks from t to t + h: see its file in `methods/`

Before the first step, CALCULATE has the calculated parameters, and START the start functions and the outputs at time
zero, each after what it reads; then foreign blocks end their initialization, and x⁺ ← x.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from cosim.authoring.variables import Input, Parameter
from cosim.engine import newton, tables
from cosim.engine.layout import Layout, Place, copy_of
from cosim.engine.methods import gauss_seidel, jacobi, joint
from cosim.engine.writer import Call, Writer
from cosim.wiring import order
from cosim.wiring.network import Loop, Network, Signal, Task

METHODS = {"jacobi": jacobi.advance, "gauss-seidel": gauss_seidel.advance, "joint": joint.advance}


@dataclass
class Program:
    """What the loop needs of a diagram, position-independent; see `cosim.engine.loop` for the columns.

    phases: the rows of each, by name. started: the row after which a state is set that a start function computes.
    loops: algebraic loops, by the row that solves them. layout: where everything lies in the arena.
    """

    network: Network
    layout: Layout
    arena: np.ndarray
    rows: np.ndarray
    banks: np.ndarray
    calls: list[Call]
    phases: dict[str, tuple[int, int]]
    started: list[tuple[int, Signal]]
    loops: dict[int, Loop]

    @property
    def places(self) -> dict[Signal, Place]:
        """Where each variable lies."""
        return self.layout.places

    def name_of(self, bank: np.ndarray) -> str:
        """The block whose states a bank has; joint, if there are several."""
        owners = [component for component in self.network.components.values() if component.declaration.continuous()]
        begin, end = bank[tables.BEGIN], bank[tables.END]
        names = [component.name for component in owners if begin <= self.layout.states_of(component).min() < end]
        return names[0] if len(names) == 1 else "joint"

    def unsolved_error(self, row: int, arena: np.ndarray) -> float:
        """The error of the guess at which the solver of an algebraic loop, by its row, gave up."""
        offset = int(self.rows[row, tables.A])
        blocks, equations, _, work = arena[offset : offset + 8 * tables.UNKNOWNS_WORDS].view(np.int64)
        at = int(work + newton.F * blocks * equations * 8)
        return float(arena[at : at + 8].view(np.float64)[0])

    def phase_words(self) -> np.ndarray:
        """The first row of each phase and the one after its last, as the loop wants them."""
        return np.array([self.phases[name] for name in tables.PHASES], np.int64)

    def revalued(self, network: Network, changed: Iterable[Signal]) -> Program:
        """The same program with the values that the changed signals have in `network`, from `wiring.revalue`."""
        arena = copy_of(self.arena)
        for signal in changed:
            place = self.places[signal]
            for offset, instances in self.layout.given.get(signal, ()):
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


def build(network: Network, method: str) -> Program:
    """The program of a network for one of METHODS. Raises: DiagramErrors, FmuError."""
    layout = Layout(network)
    writer = Writer(layout)
    _write_start(writer, network.initial)
    _write_point(writer, network.evaluation)
    _write_updates(writer)
    METHODS[method](writer, network.evaluation)
    return Program(
        network=network,
        layout=layout,
        arena=layout.arena(),
        rows=np.array(writer.rows, np.int64).reshape(-1, tables.ROW_WORDS),
        banks=np.array(writer.banks, np.int64).reshape(-1, tables.BANK_WORDS),
        calls=writer.calls,
        phases=writer.phases,
        started=writer.started,
        loops=writer.loops,
    )


def _write_start(writer: Writer, tasks: Iterable[Task | Loop]) -> None:
    """CALCULATE and START."""
    components, layout = writer.network.components.values(), writer.layout
    begin = writer.begin()
    for component in components:
        writer.call_kind(component, "calculate")
    writer.phase("CALCULATE", begin)
    begin = writer.begin()
    for task in tasks:
        writer.start(task)
    for component in components:
        writer.call_kind(component, "begin")
    for signal, place in layout.next.items():
        writer.copy(place.offset, layout.places[signal].offset, layout.bytes_of(signal))
    writer.phase("START", begin)


def _write_point(writer: Writer, tasks: Iterable[Task | Loop]) -> None:
    """PUBLISH, EVENTS, EVALUATE, SETTLE."""
    components, layout = writer.network.components, writer.layout
    begin = writer.begin()
    for signal, place in layout.next.items():
        every = components[signal.component].every
        writer.copy(layout.places[signal].offset, place.offset, layout.bytes_of(signal), every)
    writer.phase("PUBLISH", begin)
    begin = writer.begin()
    for component in components.values():
        writer.call_kind(component, "events")
    writer.phase("EVENTS", begin)
    begin = writer.begin()
    writer.tasks(tasks)
    writer.phase("EVALUATE", begin)
    begin = writer.begin()
    for component in components.values():
        writer.call_kind(component, "settle")
    writer.phase("SETTLE", begin)


def _write_updates(writer: Writer) -> None:
    """UPDATE. A foreign block that is sampled samples what is published, as an update does, so it waits for no turn."""
    begin = writer.begin()
    for component in writer.network.components.values():
        writer.call_kind(component, "update", component.every)
        if not order.has_turn(component):
            writer.call_kind(component, "step")
    writer.phase("UPDATE", begin)

"""Writes rows: calls with their frames, copies, banks of states with the rows that give their derivatives."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from cosim.authoring.declaration import Function, variable_of
from cosim.compiling.frame import frame_of
from cosim.engine.allocation import Place
from cosim.engine.layout import Layout, marks
from cosim.master import tables
from cosim.wiring import jumps, order
from cosim.wiring.clocks import Clock
from cosim.wiring.network import Component, Coupling, Loop, Network, Signal, Task

Range = tuple[int, int]


@dataclass(frozen=True)
class Call:
    """What a row calls: a function of a component, with the offset of its frame and the places of its arguments."""

    component: str
    function: Function
    count: int
    frame: int
    arguments: tuple[Place | None, ...]  # None for `time`


class Writer:
    """Appends rows, and remembers which belong to which phase.

    started: the row after which a state is set that a start function computes. loops: those that are solved, by row.
    slopes: those of the derivatives of all states at what is published. clocks: their numbers, from 1. watching: those
    of events, of components with indicators, which are due at communication points too. at_end: whether a row is done
    at the end of a step; clock: by which it is; 0: at every communication point.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.network: Network = layout.network
        self.rows: list[list[int]] = []
        self.banks: list[list[int]] = []
        self.calls: list[Call] = []
        self.phases: dict[str, Range] = {}
        self.slopes: list[Range] = []
        self.started: list[tuple[int, Signal]] = []
        self.loops: dict[int, Loop] = {}
        self.tableaus: dict[str, int] = {}
        clocks = self.network.schedule.clocks
        self.clocks: dict[Clock | None, int] = {None: 0, **{clock: k + 1 for k, clock in enumerate(clocks)}}
        self.watching = {c.name: len(clocks) + k + 1 for k, c in enumerate(self.network.watched)}

    def begin(self) -> int:
        """Where the next row goes."""
        return len(self.rows)

    def end(self, begin: int) -> Range:
        """The rows since then."""
        return begin, len(self.rows)

    def phase(self, name: str, begin: int) -> None:
        """The rows since then are a phase of the program."""
        self.phases[name] = self.end(begin)

    # ---- rows ----

    def clock(self, component: Component) -> int:
        """The number of a component's clock."""
        return self.clocks[component.clock]

    def copy(self, to: int, source: int, size: int, clock: int = 0) -> None:
        """Copy so many bytes, in whole words."""
        self._row(tables.COPY, to, source, -(-size // 8), clock)

    def integrate(self, bank: int) -> None:
        """Integrate a bank over a communication step."""
        self._row(tables.INTEGRATE, bank)

    def call(
        self,
        component: Component,
        function: Function,
        stage: bool = False,
        hidden: bool = False,
        at_end: bool = False,
        clock: int = 0,
    ) -> None:
        """Call a function; stage: on the outputs of an integration's stage; hidden: and on its states."""
        places = {name: self.layout.argument(component, function, name, stage, hidden) for name in function.arguments}
        frame = frame_of(component.declaration, function, component.constants())
        sizes = {name: component.axes[name].size for name in frame.dimensions}
        work = self.layout.work(component, function)
        placed = {name: (place.offset, place.stride) for name, place in places.items() if place is not None} | work
        offset = self.layout.constant(np.array(frame.words(component.count, sizes, placed), np.int64))
        self._row(tables.CALL, len(self.calls), offset, clock=clock, at_end=at_end)
        seen = (_as_seen(component, name, place) for name, place in places.items())
        self.calls.append(Call(component.name, function, component.count, offset, tuple(seen)))

    def call_kind(self, component: Component, kind: str, clock: int = 0) -> None:
        """The functions of one kind of a component."""
        for function in component.declaration.kind(kind):
            self.call(component, function, clock=clock)

    def step(self, component: Component) -> None:
        """A foreign block's step, with its inputs as they are at its begin."""
        if component.declaration.kind("step"):
            self.recall(component)
            self.call_kind(component, "step")

    def start(self, task: Task | Loop) -> None:
        """Evaluate for the first time; a start value that the diagram gives wins over a computed one."""
        self.tasks([task], first=True)
        if isinstance(task, Loop):
            return
        component = self.network.components[task.component]
        for function in component.declaration.kind("start"):
            if function.name == task.function:
                row = len(self.rows) - 1
                self.started += [(row, Signal(component.name, name)) for name in sorted(function.writes)]
                for name in sorted(function.writes & component.given):
                    place = self.layout.own(Signal(component.name, name))
                    size = component.count * component.nbytes(component.declaration.variables[name])
                    self.copy(place.offset, self.layout.shadow(component, name), size)
        self.hold(component)

    def hold(self, component: Component, clock: int = 0) -> None:
        """Publish the continuous states of a component that holds them, when a clock is due."""
        for signal, place in self.layout.integrated.items():
            if signal.component == component.name:
                self.copy(self.layout.places[signal].offset, place.offset, self.layout.bytes_of(signal), clock)

    def copy_states(self, to: str, source: str, component: Component | None = None) -> None:
        """Copy a vector over the continuous states to another, of one component or all: X is published, W a stage."""
        begin, end = self.layout.part(component) if component else (0, self.layout.states)
        vectors = self.layout.vectors
        self.copy(vectors[to] + 8 * begin, vectors[source] + 8 * begin, 8 * (end - begin))

    def tasks(self, tasks: Iterable[Task | Loop], at_end: bool = False, first: bool = False) -> None:
        """Evaluate, in order: outputs and joins of sources, sampled ones when they are due, and loops of them.

        first: for the first time, when all are due.
        """
        for task in tasks:
            if isinstance(task, Loop):
                self._solve(task, at_end, first)
                continue
            component = self.network.components[task.component]
            clock = 0 if first else _clock_of(self, task)
            if task.function:
                self.call(component, self.network.function(task), at_end=at_end, clock=clock)
            else:
                self._bring(component, task.port, clock, at_end, first)

    def _solve(self, loop_: Loop, at_end: bool, first: bool) -> None:
        """Solve an algebraic loop: a row for it, then those that evaluate it.

        first: its solution has to be the only one near by, and every number of it written.
        """
        row = len(self.rows)
        network, tasks = self.network, loop_.tasks
        clocks = {signal: _clock_of(self, task) for task in tasks for signal in network.written(task)}
        due = tables.ALL_FIRST if first else tables.AS_CLOCKS_SAY
        self._row(tables.SOLVE, self.layout.unknowns(loop_, clocks), c=due, at_end=at_end)
        self.loops[row] = loop_
        for task in tasks:
            for signal in network.written(task) if first and task.function else ():
                if signal in loop_.torn:
                    _unwrite(self, signal)
            self.tasks([task], at_end, first)
        self.rows[row][tables.B] = len(self.rows) - row - 1

    def _bring(self, component: Component, port: str, clock: int, at_end: bool, first: bool) -> None:
        """Give an input of its own memory what it reads. What is read late begins with its start value."""
        signal = Signal(component.name, port)
        if component.is_late(port) and not first:
            self._row(tables.TRACE, self.layout.histories[signal], clock=clock, at_end=at_end)
        elif not (component.is_late(port) and port in component.given):
            self.join(component, port, self.layout.places[signal].offset, clock)

    def join(self, component: Component, port: str, to: int, clock: int = 0) -> None:
        """Copy what a wire brings to an offset."""
        for source in component.wires[port]:
            size = self.layout.bytes_of(source)
            self.copy(to, self.layout.offset_of(source), size, clock)
            to += size

    def remember(self, component: Component, port: str, at_end: bool = False) -> None:
        """Keep what a wire brings now, for an input that is read late or extrapolated."""
        signal, late = Signal(component.name, port), component.is_late(port)
        if late or at_end:
            self.join(component, port, (self.layout.fresh if late else self.layout.places)[signal].offset)
        self._row(tables.PUSH, self.layout.histories[signal], at_end=at_end)

    def forget(self, component: Component, port: str) -> None:
        """Begin the history of an input anew where a sampled block is due that it depends on: then it breaks."""
        for clock in jumps.breaks(self.network, component, port):
            if clock in self.clocks:  # else it is due after the end
                self._row(tables.FORGET, self.layout.histories[Signal(component.name, port)], clock=self.clocks[clock])

    def recall(self, component: Component, at_end: bool = False) -> None:
        """Give the inputs that are read late or extrapolated their values at the time of a stage."""
        for port, coupling in component.couplings.items() if not component.samples_inputs else ():
            if coupling != Coupling():
                self._row(tables.TRACE, self.layout.histories[Signal(component.name, port)], at_end=at_end)

    def _row(self, kind: int, a: int, b: int = 0, c: int = 0, clock: int = 0, at_end: bool = False) -> None:
        self.rows.append([kind, a, b, c, clock, int(at_end)])

    # ---- integration ----

    def derivatives(self, components: Iterable[Component]) -> Range:
        """The derivatives of components, of the published states."""
        begin = self.begin()
        for component in components:
            if component.is_sampled and order.needed_outputs(component):  # what it publishes is not what it is
                self.stage(component, hidden=False)
            else:
                for function in component.declaration.kind("derivatives"):
                    self.call(component, function)
        return self.end(begin)

    def stage(self, component: Component, hidden: bool) -> Range:
        """A component's derivatives at a stage; hidden: its states are not where the published ones are."""
        begin = self.begin()
        self.recall(component)
        for function in (*order.needed_outputs(component), *component.declaration.kind("derivatives")):
            self.call(component, function, stage=True, hidden=hidden)
        return self.end(begin)


def _clock_of(writer: Writer, task: Task) -> int:
    """The number of the clock by which a task is done: that of its block's events, if it is held until one."""
    component = writer.network.components[task.component]
    if component.is_sampled or not writer.network.is_held(task):
        return writer.clocks[writer.network.clock(task)]
    return writer.watching.get(task.component, 0)


def _as_seen(component: Component, argument: str, place: Place | None) -> Place | None:
    """The place of an argument in the shape in which an author's function sees it."""
    if place is None or component.declaration.foreign:
        return place
    return replace(place, shape=component.seen_shape(variable_of(component.declaration, argument)))


def _unwrite(writer: Writer, signal: Signal) -> None:
    """Mark what an author's function is to write, though it is guessed, as not written yet."""
    network, layout, size = writer.network, writer.layout, writer.layout.bytes_of(signal)
    content = marks(network.components[signal.component], network.variable(signal), size)
    if content is not None:
        writer.copy(layout.places[signal].offset, layout.constant(content), size)

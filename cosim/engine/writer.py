"""Writes rows: calls with their frames, copies, banks of states with the rows that give their derivatives."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.authoring.declaration import Function
from cosim.compiling.frame import frame_of
from cosim.engine import tables
from cosim.engine.layout import Layout, Place
from cosim.integrators import Integration
from cosim.wiring import order
from cosim.wiring.network import Component, Loop, Network, Signal, Task

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

    started: the row after which a state is set that a start function computes.
    loops: those that are solved, by row. at_end: whether a row is done at the
    end of a step, every: at which communication points.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.network: Network = layout.network
        self.rows: list[list[int]] = []
        self.banks: list[list[int]] = []
        self.calls: list[Call] = []
        self.phases: dict[str, Range] = {}
        self.started: list[tuple[int, Signal]] = []
        self.loops: dict[int, Loop] = {}
        self._tableaus: dict[str, int] = {}

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

    def copy(self, to: int, source: int, size: int, every: int = 1) -> None:
        """Copy so many bytes, in whole words."""
        self._row(tables.COPY, to, source, -(-size // 8), every)

    def integrate(self, bank: int) -> None:
        """Integrate a bank over a communication step."""
        self._row(tables.INTEGRATE, bank)

    def call(
        self, component: Component, function: Function, stage: bool = False, at_end: bool = False, every: int = 1
    ) -> None:
        """Call a function; stage: on the states (and outputs) of an integration's stage."""
        places = {name: self.layout.argument(component, name, stage) for name in function.arguments}
        frame = frame_of(component.declaration, function, component.constants())
        sizes = {name: component.axes[name].size for name in frame.dimensions}
        placed = {name: (place.offset, place.stride) for name, place in places.items() if place is not None}
        offset = self.layout.constant(np.array(frame.words(component.count, sizes, placed), np.int64))
        self._row(tables.CALL, len(self.calls), offset, every=every, at_end=at_end)
        self.calls.append(Call(component.name, function, component.count, offset, tuple(places.values())))

    def call_kind(self, component: Component, kind: str, every: int = 1) -> None:
        """The functions of one kind of a component."""
        for function in component.declaration.kind(kind):
            self.call(component, function, every=every)

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
                    place = self.layout.places[Signal(component.name, name)]
                    size = component.count * component.nbytes(component.declaration.variables[name])
                    self.copy(place.offset, self.layout.shadow(component, name), size)

    def publish_states(self, component: Component | None = None) -> None:
        """Publish the states that an integration has left in W, of one component or all."""
        self._copy_states("X", "W", component)

    def stage_states(self, component: Component) -> None:
        """Have an integration begin in W with what is published."""
        self._copy_states("W", "X", component)

    def _copy_states(self, to: str, source: str, component: Component | None) -> None:
        begin, end = self.part([component]) if component else (0, self.layout.states)
        vectors = self.layout.vectors
        self.copy(vectors[to] + 8 * begin, vectors[source] + 8 * begin, 8 * (end - begin))

    def tasks(self, tasks: Iterable[Task | Loop], at_end: bool = False, first: bool = False) -> None:
        """Evaluate, in order: outputs, sampled ones when they are due, joins of several sources, and loops of them."""
        for task in tasks:
            if isinstance(task, Loop):
                self._solve(task, at_end, first)
                continue
            component = self.network.components[task.component]
            if task.function:
                function = self.network.function(task)
                every = component.every if component.is_sampled and function.kind == "outputs" else 1
                self.call(component, function, at_end=at_end, every=every)
            else:
                self._join(component, task.port)

    def _solve(self, loop_: Loop, at_end: bool, first: bool) -> None:
        """Solve an algebraic loop: a row for it, then those that evaluate it. first: as there is only one solution."""
        row = len(self.rows)
        self._row(tables.SOLVE, self.layout.unknowns(loop_), c=int(first), at_end=at_end)
        self.loops[row] = loop_
        self.tasks(loop_.tasks, at_end)
        self.rows[row][tables.B] = len(self.rows) - row - 1

    def _join(self, component: Component, port: str) -> None:
        to = self.layout.places[Signal(component.name, port)].offset
        for source in component.wires[port]:
            size = self.layout.bytes_of(source)
            self.copy(to, self.layout.offset_of(source), size)
            to += size

    def _row(self, kind: int, a: int, b: int = 0, c: int = 0, every: int = 1, at_end: bool = False) -> None:
        self.rows.append([kind, a, b, c, every, int(at_end)])

    # ---- integration ----

    def derivatives(self, components: Iterable[Component], stage: bool = False) -> Range:
        """The derivatives of components; stage: of the states of an integration's stage."""
        begin = self.begin()
        for component in components:
            for function in component.declaration.kind("derivatives"):
                self.call(component, function, stage)
        return self.end(begin)

    def stage(self, component: Component, hidden: bool) -> Range:
        """A component's derivatives at a stage; hidden: its states are not where the published ones are."""
        begin = self.begin()
        for function in order.needed_outputs(component):
            self.call(component, function, stage=True)
        self.derivatives([component], stage=hidden)
        return self.end(begin)

    def bank(
        self,
        components: Sequence[Component],
        in_place: bool,
        integration: Integration,
        first: Range,
        inner: Range,
        apart: bool = True,
    ) -> int:
        """The states of components that are integrated together, of one or of all.

        first, inner: the rows that give derivatives, from what is published and at a stage; in_place: stages are
        written over what is published. apart: whether members of a fleet do not depend on each other in a step.
        """
        method = integration.method
        if integration.integrator not in self._tableaus:
            self._tableaus[integration.integrator] = self.layout.constant(np.array(method.words()))
        row = dict.fromkeys(range(tables.BANK_WORDS), 0)
        row[tables.BEGIN], row[tables.END] = self.part(components)
        row[tables.IN_PLACE], row[tables.INNER_STEPS] = int(in_place), integration.inner_steps
        row[tables.FIRST_BEGIN], row[tables.FIRST_END] = first
        row[tables.INNER_BEGIN], row[tables.INNER_END] = inner
        row[tables.STAGES], row[tables.TABLEAU] = method.count, self._tableaus[integration.integrator]
        row[tables.CONTROLLED] = int(integration.tolerance is not None)
        row[tables.TOLERANCES] = self.layout.constant(np.array(integration.tolerances))
        row[tables.ESTIMATED], row[tables.HANDS_ON] = method.order, int(method.ends_with_slope)
        row[tables.MEMORY] = self.layout.memory + 8 * tables.MEMORY_WORDS * len(self.banks)
        if method.is_implicit:
            row[tables.IMPLICIT] = self._equations(components, inner, apart)
        self.banks.append([*row.values()])
        return len(self.banks) - 1

    def _equations(self, components: Sequence[Component], inner: Range, apart: bool) -> int:
        """The offset of what an implicit integrator solves for the states of components."""
        found = [part for component in components if (part := self.layout.states_of(component)).size]
        states = np.concatenate(found if apart else [part.reshape(1, -1) for part in found], axis=1)
        systems, size = states.shape
        timed = any(None in self.calls[row[tables.A]].arguments for row in self._calls(inner))
        work = self.layout.allocate(8 * states.size * (tables.SYSTEM_VECTORS + 2 * size))
        words = [systems, size, work, int(timed), *(states - self.part(components)[0]).reshape(-1)]
        return self.layout.constant(np.array(words, np.int64))

    def _calls(self, rows: Range) -> list[list[int]]:
        return [row for row in self.rows[slice(*rows)] if row[tables.KIND] == tables.CALL]

    def part(self, components: Sequence[Component]) -> Range:
        """Where the continuous states of components that stand side by side are in the state vector."""
        states = np.concatenate([self.layout.states_of(component).reshape(-1) for component in components])
        return int(states.min()), int(states.max()) + 1
